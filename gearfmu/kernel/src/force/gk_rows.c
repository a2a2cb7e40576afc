/* What the rows of an engagement read of the oscillators, and what their forces do to them. A contact's row on a gear
 * group is the interpolated row of its candidate, for the reference tooth 0: the group's state is turned to the
 * reference tooth before it is read, and its force turned back (docs/theory.md, eq. 3). On the ground group a row is
 * minus the outward displacement of both gears plus the gap's gradient times their rigid motion. */
#include "problem/gk_work.h"

static const int RIGID_ROW[SPACE] = {0, 1, 5, 2, 3, 4}; /* of a pose among the rows of a gear's rigid motion */

/* rigid motion of both gears of an engagement by displacements (or speeds) of the ground group */
static void read_rigid(const gk_model *model, const gk_setup *setup, int e, const double *ground, double rigid[POSE])
{
    const gk_base *base = &setup->base;
    for (int w = 0; w < 2; w++) {
        const int g = model->engagement[e].gear[w], from = base->from[g], quads = base->width[g] / 4;
        for (int c = 0; c < gk_directions(setup); c++)
            rigid[SPACE * w + c] = gk_dot_quads(base->centre[g] + RIGID_ROW[c] * base->n + from, ground + from, quads);
        for (int c = gk_directions(setup); c < SPACE; c++) rigid[SPACE * w + c] = 0.0;
    }
}

/* positions and angles of both gears of an engagement: spin, and rigid motion by the ground oscillators */
void gk_rows_pose(const gk_model *model, const gk_setup *setup, int e, const double *spin, const double *ground,
                  double *pose)
{
    read_rigid(model, setup, e, ground, pose);
    for (int w = 0; w < 2; w++) pose[SPACE * w + PHIA] += spin[model->gear[model->engagement[e].gear[w]].rotor];
}

static void contact_rows(const gk_setup *setup, const gk_side *side, const gk_engaged *work, gk_real *out)
{
    const gk_position *at = &work->position[side->which];
    const int halves = 2 * GK_LANES(setup, side->gear) / LANES, strips = GK_STRIPS(setup),
              points = side->candidates * strips;
    const gk_real part = (gk_real)at->part;
    gk_half *to = (gk_half *)out;
    for (int p = 0; p < work->places; p++) {
        const size_t first = ((size_t)at->node * points + (size_t)(work->place[p].candidate[side->which] * strips)) *
                             halves;
        const gk_half *low = (const gk_half *)side->rows + first, *high = low + (size_t)points * halves;
        for (int k = 0; k < strips * halves; k++) to[k] = low[k] + part * (high[k] - low[k]);
        to += strips * halves;
    }
}

/* what the ground oscillators displace outward at the contacts */
static void outward_rows(const gk_setup *setup, const gk_side *side, const gk_engaged *work, double *out)
{
    const gk_position *at = &work->position[side->which];
    const int quads = setup->base.width[side->gear] / 4, strips = GK_STRIPS(setup), points = side->candidates * strips;
    gk_quad *to = (gk_quad *)out;
    for (int p = 0; p < work->places; p++, to += strips * quads) {
        const size_t first = ((size_t)at->node * points + (size_t)(work->place[p].candidate[side->which] * strips)) *
                             quads;
        const gk_quad *low = (const gk_quad *)side->ground + first, *high = low + (size_t)points * quads;
        for (int q = 0; q < strips * quads; q++) to[q] = low[q] + at->part * (high[q] - low[q]);
    }
}

/* Fills the rows of the contacts that were found: on the gear groups and on the ground group */
void gk_rows_form(const gk_model *model, const gk_setup *setup, gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    (void)model;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        if (GK_LANES(setup, side->gear)) contact_rows(setup, side, engaged, engaged->basis[w]);
        if (setup->base.width[side->gear]) outward_rows(setup, side, engaged, engaged->outward[w]);
    }
}

/* the whole rows on the ground group, of contacts and joints: for steps that have no tables */
void gk_rows_whole(const gk_model *model, const gk_setup *setup, gk_work *work, int e)
{
    const gk_base *base = &setup->base;
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    const size_t size = (size_t)base->n * sizeof(double);
    for (int i = 0; i < s->n; i++) {
        double *row = engaged->ground + (size_t)i * base->n;
        memset(row, 0, size);
        if (i >= s->contacts) {
            if (gk_rows_at_bore(setup, s, i)) memcpy(row, base->port_rows + s->port_of[i] * base->n, size);
            continue;
        }
        const double *gradient = gk_point_of(setup, &engaged->place[s->place_of[i]], i % GK_STRIPS(s))->gradient;
        for (int w = 0; w < 2; w++) {
            const int g = model->engagement[e].gear[w], from = base->from[g], width = base->width[g];
            for (int c = 0; c < gk_directions(setup); c++)
                gk_axpy(gradient[SPACE * w + c], base->centre[g] + RIGID_ROW[c] * base->n, row, from / 4,
                        (from + width) / 4);
            gk_axpy(-1.0, engaged->outward[w] + (size_t)i * width, row + from, 0, width / 4);
        }
    }
}

/* a gear group's state in the frame of a tooth: what tooth 0 of a state turned back would have */
static void turn_back(const gk_modal *m, int tooth, const gk_real *y, gk_real *out)
{
    const int half = m->n / LANES; /* halves of LANES in one half of the lanes */
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    const gk_half *a = (const gk_half *)y, *b = a + half;
    gk_half *to = (gk_half *)out;
    for (int k = 0; k < half; k++) {
        to[k] = a[k] * c[k] + b[k] * s[k];
        to[half + k] = b[k] * c[k] - a[k] * s[k];
    }
}

/* adds a force in the frame of a tooth to the group's */
static void turn_forth(const gk_modal *m, int tooth, const gk_real *f, gk_real *sum)
{
    const int half = m->n / LANES;
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    const gk_half *a = (const gk_half *)f, *b = a + half;
    gk_half *to = (gk_half *)sum;
    for (int k = 0; k < half; k++) {
        to[k] += a[k] * c[k] - b[k] * s[k];
        to[half + k] += a[k] * s[k] + b[k] * c[k];
    }
}

/* What the rows of an engagement read of displacements (or speeds) y of the gear groups and `ground`, rigid motion of the
 * gears left out: the gap reads that */
void gk_rows_read(const gk_setup *setup, gk_work *work, int e, const gk_real *const y[], const double *ground,
                  double *read)
{
    const gk_base *base = &setup->base;
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    for (int i = 0; i < s->stride; i++) read[i] = 0.0;
    for (int w = 0; w < 2; w++) {
        const int g = setup->mesh[e].side[w].gear, n = GK_LANES(setup, g), from = base->from[g], width = base->width[g];
        if (n && s->contacts) turn_back(&setup->modal[g], engaged->position[w].tooth, y[g], work->turned);
        for (int i = 0; i < s->contacts; i++) {
            if (n) read[i] -= gk_dot(engaged->basis[w] + (size_t)i * n, work->turned, n);
            read[i] -= gk_dot_quads(engaged->outward[w] + (size_t)i * width, ground + from, width / 4);
        }
    }
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i))
            read[i] = gk_dot_span(base->port_span[s->port_of[i]], base->port_rows + s->port_of[i] * base->n, ground);
}

/* what the rows of an engagement read of displacements of the ground group, rigid motion included */
void gk_rows_read_ground(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int e,
                         const double *ground, double *read)
{
    const gk_base *base = &setup->base;
    const gk_system *s = &engaged->system;
    for (int i = 0; i < s->stride; i++) read[i] = 0.0;
    for (int w = 0; w < 2; w++) {
        const int g = model->engagement[e].gear[w], from = base->from[g], width = base->width[g];
        for (int i = 0; i < s->contacts; i++)
            read[i] -= gk_dot_quads(engaged->outward[w] + (size_t)i * width, ground + from, width / 4);
    }
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i))
            read[i] = gk_dot_span(base->port_span[s->port_of[i]], base->port_rows + s->port_of[i] * base->n, ground);
    gk_rows_read_rigid(model, setup, engaged, e, ground, read);
}

/* interpolated far row of a contact on one side, its sign that of the contact's row */
static void far_row(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, int i, double *out)
{
    const gk_position *at = &engaged->position[side->which];
    const int strips = GK_STRIPS(setup), points = side->candidates * strips, far = setup->far;
    const int point = engaged->place[engaged->system.place_of[i]].candidate[side->which] * strips + i % strips;
    const gk_real *low = side->far + ((size_t)at->node * points + point) * far, *high = low + (size_t)points * far;
    for (int k = 0; k < far; k++) out[k] -= low[k] + at->part * (high[k] - low[k]);
}

static void whole_far_row(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, int i, double *row)
{
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    (void)model;
    memset(row, 0, (size_t)setup->far * sizeof *row);
    if (i < s->contacts)
        for (int w = 0; w < 2; w++) far_row(setup, engaged, &setup->mesh[e].side[w], i, row);
    else if (gk_rows_at_bore(setup, s, i))
        memcpy(row, work->port_far + (size_t)s->port_of[i] * setup->far, (size_t)setup->far * sizeof *row);
}

/* what the rows read through the residual that engagements share */
void gk_rows_read_far(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, const double *far,
                      double *read)
{
    const gk_system *s = &work->engaged[e].system;
    double row[MAX_GROUND + MAX_SUPPORTS];
    for (int i = 0; i < s->stride; i++) read[i] = 0.0;
    for (int i = 0; i < s->n && setup->far; i++) {
        const int supports = setup->far - model->supports;
        whole_far_row(model, setup, work, e, i, row);
        for (int k = 0; k < setup->far; k++) read[i] += k < supports ? row[k] * far[k] : -row[k] * far[k];
    }
}

void gk_rows_push_far(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, const double *x,
                      double *out)
{
    const gk_system *s = &work->engaged[e].system;
    double row[MAX_GROUND + MAX_SUPPORTS];
    for (int i = 0; i < s->n && setup->far; i++) {
        if (x[i] == 0.0) continue;
        whole_far_row(model, setup, work, e, i, row);
        for (int k = 0; k < setup->far; k++) out[k] += x[i] * row[k];
    }
}

/* adds what rigid motion of the gears by `ground` makes of the gaps of the contacts */
void gk_rows_read_rigid(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int e,
                        const double *ground, double *read)
{
    const gk_system *s = &engaged->system;
    double rigid[POSE];
    read_rigid(model, setup, e, ground, rigid);
    for (int i = 0; i < s->contacts; i++) {
        const double *gradient = gk_point_of(setup, &engaged->place[s->place_of[i]], i % GK_STRIPS(s))->gradient;
        for (int w = 0; w < 2; w++)
            for (int c = 0; c < gk_directions(setup); c++) read[i] += gradient[SPACE * w + c] * rigid[SPACE * w + c];
    }
}

/* Σ rows·x and Σ rows·y of a gear group, in the frame of the reference tooth */
static void contact_forces(const gk_setup *setup, const gk_engaged *work, const gk_side *side, const double *x,
                           const double *y, gk_real *out_x, gk_real *out_y)
{
    const gk_system *s = &work->system;
    const int halves = 2 * GK_LANES(setup, side->gear) / LANES;
    const gk_half *rows[MAX_CONTACTS];
    gk_half of_x[MAX_CONTACTS], of_y[MAX_CONTACTS];
    int count = 0;
    for (int r = 0; r < s->contacts; r++) {
        if (x[r] == 0.0 && y[r] == 0.0) continue;
        of_x[count] = (gk_half){0} - (gk_real)x[r];
        of_y[count] = (gk_half){0} - (gk_real)y[r];
        rows[count++] = (const gk_half *)work->basis[side->which] + (size_t)r * halves;
    }
    for (int i = 0; i < halves; i++) {
        gk_half sum_x = {0}, sum_y = {0};
        for (int r = 0; r < count; r++) {
            const gk_half b = rows[r][i];
            sum_x += of_x[r] * b;
            sum_y += of_y[r] * b;
        }
        ((gk_half *)out_x)[i] = sum_x;
        ((gk_half *)out_y)[i] = sum_y;
    }
}

/* adds the forces x of the rows on the ground group */
void gk_rows_push_ground(const gk_model *model, const gk_setup *setup, const gk_engaged *work, int e, const double *x,
                         double *out)
{
    const gk_base *base = &setup->base;
    const gk_system *s = &work->system;
    double rigid[POSE] = {0};
    for (int i = 0; i < s->contacts; i++) {
        const double *gradient = gk_point_of(setup, &work->place[s->place_of[i]], i % GK_STRIPS(s))->gradient;
        if (x[i] == 0.0) continue;
        for (int d = 0; d < POSE; d++) rigid[d] += x[i] * gradient[d];
        for (int w = 0; w < 2; w++) {
            const int g = model->engagement[e].gear[w], width = base->width[g];
            gk_axpy(-x[i], work->outward[w] + (size_t)i * width, out + base->from[g], 0, width / 4);
        }
    }
    for (int w = 0; w < 2; w++) {
        const int g = model->engagement[e].gear[w], from = base->from[g];
        for (int c = 0; c < gk_directions(setup); c++)
            gk_axpy(rigid[SPACE * w + c], base->centre[g] + RIGID_ROW[c] * base->n, out, from / 4,
                    (from + base->width[g]) / 4);
    }
    for (int i = s->contacts; i < s->n; i++)
        if (x[i] != 0.0 && gk_rows_at_bore(setup, s, i))
            gk_axpy_span(base->port_span[s->port_of[i]], x[i], base->port_rows + s->port_of[i] * base->n, out);
}

/* modal forces of the rows' forces x and y of all engagements, into work->force, next, ground_force and ground_next */
void gk_rows_scatter(const gk_model *model, const gk_setup *setup, gk_work *work, const double *(*x)(const gk_system *),
                     const double *(*y)(const gk_system *))
{
    const size_t width = (size_t)setup->base.n * sizeof(double);
    for (int g = 0; g < model->gears; g++) {
        const size_t size = (size_t)GK_LANES(setup, g) * sizeof(gk_real);
        memset(work->force[g], 0, size);
        memset(work->next[g], 0, size);
    }
    memset(work->ground_force, 0, width);
    memset(work->ground_next, 0, width);
    for (int e = 0; e < model->engagements; e++) {
        const gk_engaged *engaged = &work->engaged[e];
        const double *of_x = x(&engaged->system), *of_y = y(&engaged->system);
        for (int w = 0; w < 2; w++) {
            const gk_side *side = &setup->mesh[e].side[w];
            if (!GK_LANES(setup, side->gear) || !engaged->system.contacts) continue;
            contact_forces(setup, engaged, side, of_x, of_y, work->turned, work->turned_next);
            turn_forth(&setup->modal[side->gear], engaged->position[w].tooth, work->turned, work->force[side->gear]);
            turn_forth(&setup->modal[side->gear], engaged->position[w].tooth, work->turned_next,
                       work->next[side->gear]);
        }
        if (!width) continue;
        gk_rows_push_ground(model, setup, engaged, e, of_x, work->ground_force);
        if (of_x != of_y) gk_rows_push_ground(model, setup, engaged, e, of_y, work->ground_next);
    }
    if (width && model->engagements && x == y) memcpy(work->ground_next, work->ground_force, width);
}
