/* What a step makes of the rows in the tables of a side: D and A = C − K between all points, C what is not dynamic.
 * A row between two nodes is linear, so both are quadratic there: tabulated as squares of nodes and products of
 * neighbours, they are exactly the bilinear form of the interpolated rows. */
#include "setup/gk_patterns.h"
#include "setup/gk_tables.h"

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

/* What the rows of a node have in common in the ground group: numbers of one side, in the room of gk_moves_scratch.
 * Rows by columns have the points, then what gaps and bores read; sums over the oscillators stay in order. */
typedef struct ground_part {
    const gk_side *side;
    int from, width, points, padded, count;      /* padded: points in whole quads; count: of what gaps and bores read */
    const double *by[2], *common[COMMON], *rows; /* rows: of the node in hand */
    double *columns;              /* (width, padded + COMMON): rows by columns: of a node, then of the next */
    double *square[2], *mixed[2]; /* (points, padded + COMMON): node · node, node · next, each oscillator weighed */
} ground_part;

#ifndef GK_WIDE
size_t gk_moves_scratch(size_t points, size_t lanes, size_t ground)
{
    GK_ASSERT(points > 0 && lanes > 0);
    const size_t columns = points + 4 + COMMON;
    return 4 * points * lanes + ground * columns + 4 * points * columns;
}
#endif

static int columns_of(const ground_part *p) { return p->padded + COMMON; }

static ground_part part_of(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, const gk_side *side,
                           double *room)
{
    ground_part p = {.side = side,
                     .from = setup->base.from[side->gear],
                     .width = setup->base.width[side->gear],
                     .points = side->candidates * setup->strips};
    p.padded = gk_padded(p.points);
    const size_t columns = (size_t)columns_of(&p);
    p.by[0] = k->ground.mobility + p.from, p.by[1] = k->ground.kappa + p.from;
    p.count = common_rows(model, setup, side, p.common);
    p.columns = room, room += (size_t)p.width * columns;
    for (int kind = 0; kind < 2; kind++) {
        p.square[kind] = room, room += (size_t)p.points * columns;
        p.mixed[kind] = room, room += (size_t)p.points * columns;
    }
    return p;
}

static const double *rows_of(const ground_part *p, int at)
{
    return p->side->ground + (size_t)at * (size_t)(p->points * p->width);
}

static void by_columns(const ground_part *p, int at)
{
    const double *rows = rows_of(p, at);
    const int columns = columns_of(p);
    double *out = p->columns;
    for (int k = 0; k < p->width; k++, out += columns) {
        memset(out + p->points, 0, (size_t)(columns - p->points) * sizeof *out);
        for (int i = 0; i < p->points; i++) out[i] = rows[i * p->width + k];
        for (int c = 0; c < p->count; c++) out[p->padded + c] = p->common[c][k];
    }
}

/* `count` rows, from row i on, times a chunk of columns from j on, weighed by mobility and by κ */
GK_INLINE void weigh_block(const ground_part *p, int i, int j, int count, double *const out[2])
{
    const int n = p->width, stride = columns_of(p);
    gk_chunk sum[2][4] = {{{0}}};
    const double *a = p->rows + (size_t)i * n, *b = p->columns + j;
    for (int k = 0; k < n; k++, b += stride) {
        const gk_chunk column = *(const gk_chunk *)b;
        const double mobility = p->by[0][k], kappa = p->by[1][k];
        for (int r = 0; r < count; r++) {
            const gk_chunk product = a[(size_t)r * n + k] * column;
            sum[0][r] += product * mobility;
            sum[1][r] += product * kappa;
        }
    }
    for (int kind = 0; kind < 2; kind++)
        for (int r = 0; r < count; r++) *(gk_chunk *)(out[kind] + (size_t)(i + r) * stride + j) = sum[kind][r];
}

/* rows of a node times columns, each row from its own column on where the product is symmetric, up to column `end` */
static void weigh(const ground_part *p, int symmetric, double *const out[2])
{
    const int end = symmetric ? columns_of(p) : p->padded;
    int i = 0;
    for (; i + 4 <= p->points; i += 4)
        for (int j = symmetric ? i : 0; j < end; j += GK_CHUNK) weigh_block(p, i, j, 4, out);
    for (; i < p->points; i++)
        for (int j = symmetric ? i / GK_CHUNK * GK_CHUNK : 0; j < end; j += GK_CHUNK) weigh_block(p, i, j, 1, out);
}

/* adds the ground group to the products of a node: rows with rows, and rows with what the gap reads as rigid motion */
static void add_ground_node(const ground_part *p, gk_step_side *table, int at, int common)
{
    const size_t columns = (size_t)p->side->columns, stride = (size_t)columns_of(p), points = (size_t)p->points;
    for (int kind = 0; kind < 2; kind++) {
        const double sign = kind ? -1.0 : 1.0, *square = p->square[kind], *mixed = p->mixed[kind];
        for (size_t i = 0; i < points; i++) {
            gk_real *to = table->moves + (((size_t)at * points + i) * 4 + 2 * (size_t)kind) * columns;
            for (size_t j = 0; j < points; j++) {
                to[j] += (gk_real)(sign * (j < i ? square[j * stride + i] : square[i * stride + j]));
                if (at < p->side->nodes)
                    to[columns + j] += (gk_real)(sign * (mixed[i * stride + j] + mixed[j * stride + i]));
            }
            for (int c = 0; c < p->count; c++)
                table->pulls[(((size_t)at * points + i) * 2 + (size_t)kind) * (size_t)common + (size_t)c] =
                    square[i * stride + (size_t)(p->padded + c)];
        }
    }
}

static void add_ground_products(const gk_setup *setup, ground_part *p, gk_step_side *table)
{
    for (int kind = 0; kind < 2; kind++)
        for (int c = 0; c < p->count; c++)
            for (int d = 0; d < p->count; d++)
                table->own[kind][c][d] = weighed(p->common[c], p->common[d], p->by[kind], p->width);
    for (int c = 0; c < p->count; c++) table->share[c] = c < p->count - 1 ? 0.5 : 1.0;
    by_columns(p, 0);
    for (int at = 0; at <= p->side->nodes; at++) {
        p->rows = rows_of(p, at);
        weigh(p, 1, p->square);
        if (at < p->side->nodes) {
            by_columns(p, at + 1);
            weigh(p, 0, p->mixed);
        }
        add_ground_node(p, table, at, gk_common(setup));
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

/* D and A by the modes of the gear group */
static void fill_modes(const gk_setup *setup, gk_room *room, const gk_coefficients *k, const gk_side *side,
                       gk_real *moves)
{
    const int n = GK_LANES(setup, side->gear);
    const size_t points = (size_t)(side->candidates * setup->strips), columns = (size_t)side->columns;
    const gk_real *const by[2] = {k->flow[side->gear].mobility, k->flow[side->gear].kappa};
    gk_real *scaled = (gk_real *)room->columns, *next_scaled = scaled + points * (size_t)n;
    for (int at = 0; at <= side->nodes; at++, moves += points * 4 * columns) {
        const gk_real *rows = side->rows + (size_t)at * points * n, *next = at < side->nodes ? rows + points * n : NULL;
        for (int kind = 0; kind < 2; kind++) {
            scale_rows(rows, by[kind], (int)points, n, scaled);
            if (next) scale_rows(next, by[kind], (int)points, n, next_scaled);
            store_products(side, scaled, rows, next_scaled, next, n, (int)points, kind ? -1.0 : 1.0,
                           moves + 2 * (size_t)kind * columns);
        }
    }
}

/* sides with one table of rows (gk_side_twins), and the same damping */
static int same_products(const gk_setup *setup, const gk_coefficients *k, const gk_side *a, const gk_side *b)
{
    const gk_flow *f = &k->flow[a->gear], *g = &k->flow[b->gear];
    const size_t size = (size_t)setup->modal[a->gear].n * sizeof(gk_real);
    return a->rows == b->rows && !memcmp(f->mobility, g->mobility, size) && !memcmp(f->kappa, g->kappa, size);
}

/* an earlier side with the same products by the modes, or NULL */
static const gk_real *known_products(const gk_model *model, const gk_setup *setup, const gk_room *room,
                                     const gk_coefficients *k, const gk_side *side)
{
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) {
            const gk_side *other = &setup->mesh[e].side[w];
            if (other == side) return NULL;
            if (same_products(setup, k, other, side)) return room->table[e][w].moves;
        }
    return NULL;
}

static size_t moves_size(const gk_setup *setup, const gk_side *side)
{
    const size_t points = (size_t)(side->candidates * setup->strips);
    return ((size_t)side->nodes + 1) * points * 4 * (size_t)side->columns;
}

void gk_side_step(const gk_model *model, const gk_setup *setup, gk_room *room, const gk_coefficients *k)
{
    GK_ASSERT(k && k->h > 0.0);
    GK_ASSERT(k->gamma >= 0.0 && k->gamma <= 1.0);
    for (int side = 0; side < 2 * model->engagements; side++) {
        const gk_side *of = &setup->mesh[side / 2].side[side % 2];
        gk_real *moves = room->table[side / 2][side % 2].moves;
        const gk_real *known = known_products(model, setup, room, k, of);
        if (known)
            memcpy(moves, known, moves_size(setup, of) * sizeof *moves);
        else
            fill_modes(setup, room, k, of, moves);
    }
    for (int side = 0; side < 2 * model->engagements; side++) {
        const gk_side *of = &setup->mesh[side / 2].side[side % 2];
        gk_step_side *table = &room->table[side / 2][side % 2];
        const size_t points = (size_t)(of->candidates * setup->strips);
        ground_part part = part_of(model, setup, k, of, room->columns);
        add_ground_products(setup, &part, table);
        for (int at = 0; at <= of->nodes; at++)
            add_residual(of, at, (int)points, table->moves + (size_t)at * points * 4 * (size_t)of->columns);
    }
    gk_patterns_between(model, setup, k, room->between);
    room->table_h = k->h;
    room->table_gamma = k->gamma;
}
