/* What a step makes of the rows in the tables of a side: D and A = C − K between all points, C what is not dynamic.
 * A row between two nodes is linear, so both are quadratic there: tabulated as squares of nodes and products of
 * neighbours, they are exactly the bilinear form of the interpolated rows. */
#include "problem/gk_work.h"

/* Σ a b over modes between all points: rows of one node, and mixed with those of the next (NULL: none) */
static void store_products(const gk_side *side, const gk_real *scaled, const gk_real *rows, const gk_real *next_scaled,
                           const gk_real *next, int n, int points, double sign, gk_real *out)
{
    const size_t columns = (size_t)side->columns;
    for (int i = 0; i < points; i++)
        for (int j = i; j < points; j++) {
            const size_t a = (size_t)i * n, b = (size_t)j * n, here = (size_t)i * 4 * columns + j,
                         mirrored = (size_t)j * 4 * columns + i;
            double mixed = 0.0;
            if (next) mixed = gk_dot(scaled + a, next + b, n) + gk_dot(next_scaled + a, rows + b, n);
            out[here] = out[mirrored] = (gk_real)(sign * gk_dot(scaled + a, rows + b, n));
            out[here + columns] = out[mirrored + columns] = (gk_real)(sign * mixed);
        }
}

static void scale_rows(const gk_real *rows, const gk_real *by, int points, int n, gk_real *out)
{
    for (int i = 0; i < points; i++)
        for (int k = 0; k < n; k++) out[(size_t)i * n + k] = rows[(size_t)i * n + k] * by[k];
}

/* Σ over the gear's part of the ground group of two rows, each oscillator weighed */
static double weighed(const double *a, const double *b, const double *by, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i] * by[i];
    return sum;
}

/* what gaps and bores read of the gear, per oscillator of its part: rigid motion as in a pose, then the angle of its
 * bore; returns how many */
static int common_rows(const gk_model *model, const gk_setup *setup, const gk_side *side, const double *rows[COMMON])
{
    static const double nothing[MAX_GROUND + 4 * MAX_ROTORS];
    const gk_base *base = &setup->base;
    const int directions = gk_directions(setup);
    for (int c = 0; c < directions; c++) rows[c] = base->moved[side->gear][c];
    rows[directions] = nothing;
    const int port = gk_port_of(model, side->gear);
    if (port >= 0) rows[directions] = base->port_rows + port * base->n + base->from[side->gear];
    return directions + 1;
}

/* adds the ground group to the products of a node: rows with rows, and rows with what the gap reads as rigid motion */
static void add_ground_products(const gk_model *model, const gk_setup *setup, const gk_coefficients *k,
                                gk_step_side *table, const gk_side *side, int at)
{
    const int from = setup->base.from[side->gear], width = setup->base.width[side->gear];
    const int points = side->candidates * setup->strips;
    const size_t columns = (size_t)side->columns, size = (size_t)points * 4 * columns;
    const double *rows = side->ground + (size_t)at * points * width, *common[COMMON];
    const double *next = at < side->nodes ? rows + points * width : NULL;
    gk_real *out = table->moves + (size_t)at * size;
    const int count = common_rows(model, setup, side, common), padded = gk_common(setup);
    for (int kind = 0; kind < 2; kind++) {
        const double *by = (kind ? k->ground.kappa : k->ground.mobility) + from, sign = kind ? -1.0 : 1.0;
        for (int i = 0; i < points; i++) {
            const double *a = rows + i * width;
            gk_real *to = out + ((size_t)i * 4 + 2 * (size_t)kind) * columns;
            for (int j = 0; j < points; j++) {
                const double *b = rows + j * width;
                to[j] += (gk_real)(sign * weighed(a, b, by, width));
                if (next)
                    to[columns + j] += (gk_real)(sign * (weighed(a, next + j * width, by, width) +
                                                         weighed(next + i * width, b, by, width)));
            }
            for (int c = 0; c < count; c++)
                table->pulls[(((size_t)at * points + i) * 2 + kind) * padded + c] = weighed(a, common[c], by, width);
        }
        for (int c = 0; c < count; c++) {
            table->share[c] = c < count - 1 ? 0.5 : 1.0;
            for (int d = 0; d < count; d++) table->own[kind][c][d] = weighed(common[c], common[d], by, width);
        }
    }
}

/* adds what is not dynamic to −K */
static void add_residual(const gk_side *side, int at, int points, gk_real *out)
{
    const size_t columns = (size_t)side->columns;
    for (int i = 0; i < points; i++) {
        const gk_real *C = side->residual + ((size_t)at * (size_t)points + (size_t)i) * 2 * columns;
        gk_real *to = out + (size_t)i * 4 * columns + 2 * columns;
        for (size_t j = 0; j < 2 * columns; j++) to[j] += C[j];
    }
}

/* D and A of a step on both sides of an engagement */
static void fill_step(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e,
                      int which)
{
    const gk_side *side = &setup->mesh[e].side[which];
    const int n = GK_LANES(setup, side->gear);
    const size_t points = (size_t)(side->candidates * setup->strips), size = points * 4 * (size_t)side->columns;
    const gk_real *const by[2] = {k->flow[side->gear].mobility, k->flow[side->gear].kappa};
    gk_real *scaled = (gk_real *)work->columns, *next_scaled = scaled + points * (size_t)n;
    for (int at = 0; at <= side->nodes; at++) {
        const gk_real *rows = side->rows + (size_t)at * points * n, *next = at < side->nodes ? rows + points * n : NULL;
        for (int kind = 0; kind < 2; kind++) {
            gk_real *out = work->engaged[e].table[which].moves + (size_t)at * size +
                           2 * (size_t)kind * (size_t)side->columns;
            scale_rows(rows, by[kind], (int)points, n, scaled);
            if (next) scale_rows(next, by[kind], (int)points, n, next_scaled);
            store_products(side, scaled, rows, next_scaled, next, n, (int)points, kind ? -1.0 : 1.0, out);
        }
        add_ground_products(model, setup, k, &work->engaged[e].table[which], side, at);
        add_residual(side, at, (int)points, work->engaged[e].table[which].moves + (size_t)at * size);
    }
}

void gk_side_step(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_coefficients *k)
{
    GK_ASSERT(k && k->h > 0.0);
    GK_ASSERT(k->gamma >= 0.0 && k->gamma <= 1.0);
    for (int e = 0; e < model->engagements; e++)
        for (int which = 0; which < 2; which++) fill_step(model, setup, work, k, e, which);
    work->table_h = k->h;
    work->table_gamma = k->gamma;
}
