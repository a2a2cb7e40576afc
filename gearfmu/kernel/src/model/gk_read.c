/* A field of the blob, or one message that says what is wrong with the first that cannot be used. */
#include "model/gk_read.h"
#include "base/gk_lanes.h"
#include <stdio.h>

static const double ROUNDING = 1e-9; /* relative: of numbers that are computed from those of the stage file */

void gk_read_refuse(gk_reader *r, const char *what, const char *why)
{
    GK_ASSERT(r && what && why);
    if (r->outcome) return;
    snprintf(r->message, GK_MESSAGE, "model blob: %s %s; make the model again with this version of gearfmu", what, why);
    r->outcome = GK_BAD_BLOB;
}

const void *gk_read_take(gk_reader *r, int field)
{
    const char *wrong = NULL;
    if (r->outcome) return NULL;
    const void *found = gk_field_find(r->blob, field, &r->shape, &wrong);
    if (wrong) gk_read_refuse(r, gk_field_name(field), wrong);
    return wrong ? NULL : found;
}

void gk_read_demand(gk_reader *r, int holds, const char *what)
{
    if (!holds) gk_read_refuse(r, what, "are out of range");
}

/* a number of the stage file within its range (gk_ranges.h), but for rounding, or a message that names both */
void gk_read_range(gk_reader *r, const char *what, double x, double low, double high)
{
    if (r->outcome || gk_read_between(x, low - ROUNDING * fabs(low), high + ROUNDING * fabs(high))) return;
    snprintf(r->message, GK_MESSAGE,
             "model blob: %s = %.6g is out of range, from %.6g to %.6g; correct the stage and make the model again",
             what, x, low, high);
    r->outcome = GK_BAD_BLOB;
}
uint64_t gk_read_count(const gk_reader *r, int field) { return gk_field_count(r->blob, field, &r->shape); }

/* numbers of a field, none of them beyond ±limit */
const double *gk_read_bounded(gk_reader *r, int field, double limit)
{
    const double *v = gk_read_take(r, field);
    if (!v) return NULL;
    for (uint64_t i = 0, count = gk_read_count(r, field); i < count; i++)
        if (!gk_read_between(v[i], -limit, limit)) {
            gk_read_refuse(r, gk_field_name(field), "is out of range");
            return NULL;
        }
    return v;
}

/* the same in single precision */
const float *gk_read_bounded_f32(gk_reader *r, int field, float limit)
{
    const float *v = gk_read_take(r, field);
    if (!v) return NULL;
    for (uint64_t i = 0, count = gk_read_count(r, field); i < count; i++)
        if (!(v[i] >= -limit && v[i] <= limit)) {
            gk_read_refuse(r, gk_field_name(field), "is out of range");
            return NULL;
        }
    return v;
}
