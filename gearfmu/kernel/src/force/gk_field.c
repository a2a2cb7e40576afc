/* Displacement of the flank of one tooth for nodal contact: read at a few points along the flank, by width function,
 * where a node first asks for it; places between are interpolated. Loads are gathered at the same points and press on
 * the oscillators once a tooth, however many nodes it has. */
#include "force/gk_field.h"
#include "force/gk_turn.h"

/* forgets what was read; y, speed: state of the gear group */
void gk_field_begin(gk_field *f, const gk_real *y, const gk_real *speed)
{
    GK_ASSERT(f->setup && f->ground && f->tooth >= 0);
    const gk_modal *m = &f->setup->modal[f->gear];
    memset(f->known, 0, sizeof f->known);
    if (!GK_LANES(f->setup, f->gear)) return;
    gk_turn_back(m, f->tooth, y, f->q);
    gk_turn_back(m, f->tooth, speed, f->v);
}

static size_t cell_of(const gk_field *f, int part, int cell)
{
    return (size_t)((2 * part + f->flank) * POINTS * f->functions + cell);
}

static const gk_real *modal_row(const gk_field *f, int cell)
{
    return f->setup->point_rows[f->gear].modes + cell_of(f, 0, cell) * (size_t)f->setup->modal[f->gear].n;
}

typedef struct ground_parts { /* rows c0, c_c, c_s of a cell and their factors at the angle of the tooth (eq. 2c) */
    const gk_four *c0, *cc, *cs;
    double cosine, sine;
} ground_parts;

static ground_parts ground_row(const gk_field *f, int cell)
{
    const gk_real *rows = f->setup->point_rows[f->gear].ground;
    const size_t width = (size_t)f->setup->base.width[f->gear];
    return (ground_parts){(const gk_four *)(rows + cell_of(f, 0, cell) * width),
                          (const gk_four *)(rows + cell_of(f, 1, cell) * width),
                          (const gk_four *)(rows + cell_of(f, 2, cell) * width), f->cosine, f->sine};
}

#define GROUND_QUAD(row, q)                                                                                            \
    (GK_WIDENED((row)->c0[q]) + (row)->cosine * GK_WIDENED((row)->cc[q]) + (row)->sine * GK_WIDENED((row)->cs[q]))

/* adds the sums of a row with two vectors */
static void read_ground_row(const ground_parts *row, const double *x, const double *y, int quads, double sum[2])
{
    gk_quad a = {0}, b = {0};
    for (int q = 0; q < quads; q++) {
        const gk_quad r = GROUND_QUAD(row, q);
        a += r * ((const gk_quad *)x)[q], b += r * ((const gk_quad *)y)[q];
    }
    sum[0] += (a[0] + a[2]) + (a[1] + a[3]), sum[1] += (b[0] + b[2]) + (b[1] + b[3]);
}

/* displacement and its rate at a point, by width function */
static void read_point(gk_field *f, int point)
{
    const gk_base *base = &f->setup->base;
    const int A = f->functions, n = GK_LANES(f->setup, f->gear), quads = base->width[f->gear] / 4;
    const double *x = f->ground + base->from[f->gear], *v = x + base->n;
    for (int cell = point * A; cell < (point + 1) * A; cell++) {
        double sum[2] = {0.0, 0.0};
        if (n) sum[0] = gk_dot(modal_row(f, cell), f->q, n), sum[1] = gk_dot(modal_row(f, cell), f->v, n);
        const ground_parts ground = ground_row(f, cell);
        read_ground_row(&ground, x, v, quads, sum);
        f->at[cell] = sum[0], f->rate[cell] = sum[1], f->load[cell] = 0.0;
    }
    f->known[point] = 1;
}

/* displacement, its slope along the flank and its rate at a place */
gk_reading gk_field_read(gk_field *f, const gk_grid *grid)
{
    GK_ASSERT(grid->index >= 0 && grid->index + 4 <= POINTS);
    const int A = f->functions;
    gk_reading r = {{0}, {0}, {0}};
    for (int i = 0; i < 4; i++)
        if (!f->known[grid->index + i]) read_point(f, grid->index + i);
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++) {
            const int cell = (grid->index + i) * A + a;
            r.at[a] += grid->weight[i] * f->at[cell];
            r.slope[a] += grid->slope[i] * f->at[cell];
            r.rate[a] += grid->weight[i] * f->rate[cell];
        }
    return r;
}

/* adds a load at a place that has been read */
void gk_field_load(gk_field *f, const gk_grid *grid, const double *load)
{
    GK_ASSERT(f->known[grid->index]);
    const int A = f->functions;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++) f->load[(grid->index + i) * A + a] += grid->weight[i] * load[a];
}

static void press_modes(const gk_field *field, const gk_real *zero, gk_real *sum[2])
{
    const int n = GK_LANES(field->setup, field->gear), A = field->functions;
    gk_half *f = (gk_half *)field->f;
    memset(field->f, 0, (size_t)n * sizeof *field->f);
    for (int cell = 0; cell < POINTS * A && n; cell++) {
        if (!field->known[cell / A] || field->load[cell] == 0.0) continue;
        const gk_half *row = (const gk_half *)modal_row(field, cell);
        const gk_real load = (gk_real)field->load[cell];
        for (int k = 0; k < 2 * n / LANES; k++) f[k] -= load * row[k];
    }
    const gk_real *turned[2] = {field->f, zero};
    if (n) gk_turn_forth(&field->setup->modal[field->gear], field->tooth, turned, sum);
}

/* Presses the loads on the oscillators: inward, against the rows. sum: modal forces of the gear, now and for the next
 * prediction, which these do not enter (zero). */
void gk_field_end(const gk_field *f, const gk_real *zero, gk_real *sum[2], double *ground_force)
{
    GK_ASSERT(zero && sum && ground_force);
    const int A = f->functions, quads = f->setup->base.width[f->gear] / 4;
    gk_quad *force = (gk_quad *)(ground_force + f->setup->base.from[f->gear]);
    press_modes(f, zero, sum);
    for (int cell = 0; cell < POINTS * A; cell++) {
        if (!f->known[cell / A] || f->load[cell] == 0.0) continue;
        const ground_parts row = ground_row(f, cell);
        const double load = f->load[cell];
        for (int q = 0; q < quads; q++) force[q] -= load * GROUND_QUAD(&row, q);
    }
}
