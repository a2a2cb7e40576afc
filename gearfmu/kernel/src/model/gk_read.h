/* Reading the arrays of a blob, each checked before it is trusted (gk_read.c). */
#ifndef GK_READ_H
#define GK_READ_H
#include "base/gk_blob.h"
#include "gk.h"
#include "model/gk_fields.h"
#include "model/gk_model.h"

/* what is read with: blob, shape so far, and the first thing that was wrong */
typedef struct gk_reader {
    const gk_blob *blob;
    gk_shape shape;
    gk_outcome outcome;
    char *message;
} gk_reader;

void gk_read_refuse(gk_reader *r, const char *what, const char *why);
const void *gk_read_take(gk_reader *r, int field);
void gk_read_demand(gk_reader *r, int holds, const char *what);
void gk_read_range(gk_reader *r, const char *what, double x, double low, double high);
uint64_t gk_read_count(const gk_reader *r, int field);
const double *gk_read_bounded(gk_reader *r, int field, double limit);
const float *gk_read_bounded_f32(gk_reader *r, int field, float limit);
#define WITHIN(r, x, RANGE, what) gk_read_range(r, what, x, GK_LOW_##RANGE, GK_HIGH_##RANGE)
static inline int gk_read_between(double x, double low, double high) { return x >= low && x <= high; }
static inline int gk_read_counted(const int32_t *c, int32_t low, int32_t high) { return *c >= low && *c <= high; }
#endif
