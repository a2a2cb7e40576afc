/* Tables of a gear's flanks on the even grid of rolls, from those at the points of its body (stage/assembly/
 * compact.py).
 * A model stores rows at P points and each number of a compliance once; on the grid they are several times as large.
 * Rows are kept in the setup, compliances only while the sides of their gear are filled. */
#include "setup/gk_grounded.h"

enum { CHUNK = 64 };

/* ---- which gears ------------------------------------------------------------------------------------------------- */
/* gears of one body: of one shape, with modes of the same numbers, and with one copy of its tables in the blob;
 * patterns of far teeth are each gear's own */
static int same_shape(const gk_gear *a, const gk_gear *b)
{
    const double of_a[] = {a->r_b,   a->s_form, a->s_tip, a->psi_b,         a->width,       a->local,
                           a->strip, a->edge,   a->helix, a->corner_radius, a->corner_angle};
    const double of_b[] = {b->r_b,   b->s_form, b->s_tip, b->psi_b,         b->width,       b->local,
                           b->strip, b->edge,   b->helix, b->corner_radius, b->corner_angle};
    return a->z == b->z && !memcmp(of_a, of_b, sizeof of_a);
}

static int same_modes(const gk_gear *a, const gk_gear *b)
{
    const size_t n = (size_t)a->modes;
    return a->modes == b->modes && a->low == b->low && !memcmp(a->omega, b->omega, n * sizeof *a->omega) &&
           !memcmp(a->diameter, b->diameter, n * sizeof *a->diameter) &&
           !memcmp(a->member, b->member, n * sizeof *a->member) &&
           !memcmp(a->low_member, b->low_member, (size_t)a->low * sizeof *a->low_member);
}

static int same_tables(const gk_gear *a, const gk_gear *b)
{
    return a->points == b->points && a->mirrored == b->mirrored && a->resample == b->resample && a->rows == b->rows &&
           a->low_rows == b->low_rows && a->node == b->node && a->residual_own == b->residual_own &&
           a->residual_next == b->residual_next && a->residual_across == b->residual_across &&
           a->along_rows == b->along_rows && a->along_low == b->along_low && a->along_normal == b->along_normal &&
           a->along_own == b->along_own && a->along_across == b->along_across;
}

static int same_body(const gk_gear *a, const gk_gear *b)
{
    return a == b || (same_tables(a, b) && same_shape(a, b) && same_modes(a, b));
}

int gk_spread_leader(const gk_model *model, int g)
{
    GK_ASSERT(gk_is_gear(model, g));
    int first = 0;
    while (!same_body(&model->gear[first], &model->gear[g])) first++;
    return first;
}

/* ---- rows -------------------------------------------------------------------------------------------------------- */
/* (tables, points, size) → (tables, rolls, size) */
static void spread_rows(const gk_model *model, const gk_gear *gear, int tables, size_t size, const float *from,
                        gk_real *to)
{
    for (int t = 0; t < tables && to; t++, from += (size_t)gear->points * size)
        for (int k = 0; k < model->rolls; k++, to += size)
            for (size_t at = 0; at < size; at += CHUNK) {
                const int count = size - at < CHUNK ? (int)(size - at) : CHUNK;
                double sum[CHUNK] = {0};
                for (int i = 0; i < gear->points; i++) {
                    const double weight = gear->resample[k * gear->points + i];
                    const float *row = from + (size_t)i * size + at;
                    for (int c = 0; c < count && weight != 0.0; c++) sum[c] += weight * row[c];
                }
                for (int c = 0; c < count; c++) to[at + (size_t)c] = (gk_real)sum[c];
            }
}

void gk_spread_rows(const gk_model *model, gk_setup *setup, int g)
{
    GK_ASSERT(gk_is_gear(model, g));
    const gk_gear *gear = &model->gear[g];
    const gk_flank_tables *to = &setup->flank[g];
    const size_t A = (size_t)model->functions;
    spread_rows(model, gear, 2, A * (size_t)model->ports, gear->port_residual, to->port);
    spread_rows(model, gear, 2, A * FAR, gear->far_rows, to->far);
    if (gk_spread_leader(model, g) != g) return;
    spread_rows(model, gear, 2, A * (size_t)gear->modes, gear->rows, to->rows);
    spread_rows(model, gear, 2, A * (size_t)gear->low, gear->low_rows, to->low);
    spread_rows(model, gear, 6, A * 6, gear->node, to->node);
    spread_rows(model, gear, 2, A * (size_t)gear->modes, gear->along_rows, to->along_rows);
    spread_rows(model, gear, 2, A * (size_t)gear->low, gear->along_low, to->along_low);
}

/* ---- compliance -------------------------------------------------------------------------------------------------- */
static size_t places_of(const gk_model *model, const gk_gear *gear)
{
    return (size_t)(gear->points * model->functions);
}

static size_t block_size(const gk_model *model)
{
    const size_t across = (size_t)(model->rolls * model->functions);
    return across * across;
}

/* hands out the blocks of a gear, from `at` on; with at = NULL it counts them */
static size_t lay_out(const gk_model *model, const gk_gear *gear, int along, gk_real *at, gk_compliance *to)
{
    const int flanks = gear->mirrored ? 1 : 2;
    const size_t size = block_size(model);
    size_t used = 0;
    memset(to, 0, sizeof *to);
#define TAKE(block) ((block) = at ? at + used * size : NULL, used++)
    for (int f = 0; f < flanks; f++) {
        TAKE(to->own[f]);
        for (int m = 0; m < FURTHER; m++) TAKE(to->next[f][m]);
    }
    for (int i = 0; i < ACROSS; i++) TAKE(to->across[i]);
    for (int f = 0; f < flanks && along; f++) {
        for (int g = 0; g < 2; g++) TAKE(to->along_normal[f][g]);
        TAKE(to->along_own[f]);
    }
    if (along) TAKE(to->along_across);
#undef TAKE
    return used;
}

size_t gk_spread_scratch(const gk_model *model, size_t *reals)
{
    size_t doubles = 0;
    *reals = 0;
    for (int g = 0; g < model->gears; g++) {
        gk_compliance counted;
        const size_t n = places_of(model, &model->gear[g]);
        const size_t packed = (size_t)((model->rolls + model->gear[g].points) *
                                       gk_padded(model->functions * model->functions));
        const size_t own = n * n + n * (size_t)(model->rolls * model->functions) + packed;
        const size_t blocks = lay_out(model, &model->gear[g], model->gear[g].along_rows != NULL, NULL, &counted) *
                              block_size(model);
        doubles = own > doubles ? own : doubles;
        *reals = blocks > *reals ? blocks : *reals;
    }
    return doubles;
}

typedef struct spreader {
    const gk_model *model;
    const gk_gear *gear;
    double *square, *between; /* (places, places); (rolls, functions, places) */
    double *packed;           /* (points + rolls, functions² in whole quads) */
} spreader;

/* (rolls, functions, functions) from (functions, points, functions): a product of matrices once the functions stand
 * together */
static void spread_points(const spreader *s, const double *from, gk_real *out)
{
    const int A = s->model->functions, rolls = s->model->rolls, points = s->gear->points, columns = gk_padded(A * A);
    const size_t n = places_of(s->model, s->gear);
    const gk_matrix packed = {s->packed, points, columns};
    memset(s->packed, 0, (size_t)((points + rolls) * columns) * sizeof *s->packed);
    for (int j = 0; j < points; j++)
        for (int c = 0; c < A * A; c++)
            s->packed[j * columns + c] = from[(size_t)(c / A) * n + (size_t)(j * A + c % A)];
    double *sum = s->packed + points * columns;
    gk_grounded_times(s->gear->resample, &packed, rolls, sum);
    for (int l = 0; l < rolls; l++)
        for (int c = 0; c < A * A; c++) out[l * A * A + c] = (gk_real)sum[l * columns + c];
}

/* (rolls, rolls, functions, functions) of the square */
static void spread_square(const spreader *s, gk_real *out)
{
    const int A = s->model->functions, rolls = s->model->rolls, points = s->gear->points;
    const size_t n = places_of(s->model, s->gear);
    memset(s->between, 0, (size_t)(rolls * A) * n * sizeof *s->between);
    for (int k = 0; k < rolls; k++)
        for (int i = 0; i < points; i++) {
            const double weight = s->gear->resample[k * points + i];
            const double *from = s->square + (size_t)(i * A) * n;
            double *to = s->between + (size_t)(k * A) * n;
            for (size_t c = 0; c < (size_t)A * n && weight != 0.0; c++) to[c] += weight * from[c];
        }
    for (int k = 0; k < rolls; k++)
        spread_points(s, s->between + (size_t)(k * A) * n, out + (size_t)k * (size_t)(rolls * A * A));
}

static const float *spread_whole(const spreader *s, const float *from, gk_real *out)
{
    const size_t n = places_of(s->model, s->gear);
    for (size_t i = 0; i < n * n; i++) s->square[i] = from[i];
    spread_square(s, out);
    return from + n * n;
}

/* of the lower triangle of a symmetric block; signs: it is symmetric but for those of the displaced place */
static const float *spread_half(const spreader *s, const float *from, int signs, gk_real *out)
{
    const int A = s->model->functions;
    const size_t n = places_of(s->model, s->gear);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            const double value = *from++;
            s->square[i * n + j] = signs ? value * gk_width_sign(s->model, (int)(j % (size_t)A)) : value;
            s->square[j * n + i] = signs ? value * gk_width_sign(s->model, (int)(i % (size_t)A)) : value;
        }
    spread_square(s, out);
    return from;
}

static const float *spread_across(const spreader *s, const float *from, gk_real *out)
{
    return s->gear->mirrored ? spread_half(s, from, 1, out) : spread_whole(s, from, out);
}

void gk_spread_compliance(const gk_model *model, const gk_setup *setup, int g, double *scratch, gk_real *blocks,
                          gk_compliance *to)
{
    GK_ASSERT(gk_is_gear(model, g) && blocks);
    const gk_gear *gear = &model->gear[g];
    const int flanks = gear->mirrored ? 1 : 2, along = GK_ON(setup, friction) && gear->along_rows;
    const size_t n = places_of(model, gear);
    double *between = scratch + n * n;
    const spreader s = {model, gear, scratch, between, between + n * (size_t)(model->rolls * model->functions)};
    lay_out(model, gear, along, blocks, to);
    const float *own = gear->residual_own, *next = gear->residual_next, *across = gear->residual_across;
    for (int f = 0; f < flanks; f++) {
        own = spread_half(&s, own, 0, to->own[f]);
        for (int m = 0; m < FURTHER; m++) next = spread_whole(&s, next, to->next[f][m]);
    }
    for (int i = 0; i < ACROSS; i++) across = spread_across(&s, across, to->across[i]);
    if (!along) return;
    const float *normal = gear->along_normal, *turned = gear->along_own;
    for (int f = 0; f < flanks; f++) {
        for (int i = 0; i < 2; i++) normal = spread_whole(&s, normal, to->along_normal[f][i]);
        turned = spread_half(&s, turned, 0, to->along_own[f]);
    }
    spread_across(&s, gear->along_across, to->along_across);
}
