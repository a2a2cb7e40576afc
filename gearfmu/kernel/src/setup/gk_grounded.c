/* What ground oscillators and supports do to one side of an engagement, by the few motions that a flank has in them
 * (gk_node_motion). */
#include "setup/gk_grounded.h"

/* sum (n, m) += factor · a (n) · b (m); b is padded with zeros */
static void add_outer(double factor, const double *a, const double *b, int n, int m, double *sum)
{
    for (int i = 0; i < n; i++, sum += m) {
        const double by = factor * a[i];
        for (int j = 0; j < m && by != 0.0; j++) sum[j] += by * b[j];
    }
}

/* one oscillator that is not dynamic */
static void add_yield(const gk_node *n, const gk_grounded *g, int k)
{
    const gk_ground *ground = &n->model->ground[n->setup->base.set];
    const int which = n->gear->ground[n->setup->base.set].list[k], supports = n->model->supports;
    const double by = 1.0 / (ground->omega[which] * ground->omega[which]);
    double column[12 + MAX_LOW + 3], joint[MAX_SUPPORTS + 4] = {0};
    for (int i = g->motions; i < g->stride; i++) column[i] = 0.0;
    for (int i = 0; i < g->motions; i++) column[i] = gk_node_motion(n->gear, n->setup->base.set, i)[k];
    for (int s = 0; s < supports; s++) joint[s] = ground->support_rows[s * ground->n + which];
    if (n->side->port_of >= 0) joint[supports] = ground->port_rows[n->side->port_of * ground->n + which];
    add_outer(by, column, column, g->motions, g->stride, g->yields);
    add_outer(by, column, joint, g->motions, g->held, g->joints);
}

/* the supports' answer to forces on the gear's node: C_fs of a point is node · node_support */
static void add_supports(const gk_node *n, const gk_grounded *g)
{
    const int supports = n->model->supports, first = 6 + n->gear->low;
    const int carrying = n->model->ground[n->setup->base.set].carrying;
    const double *kappa = n->model->ground[n->setup->base.set].kappa;
    const double *to_port = n->model->port_support + n->side->port_of * supports;
    for (int i = 0; i < 6; i++) {
        const double *a = n->gear->node_support + i * supports;
        double *joint = g->joints + (size_t)(first + i) * (size_t)g->held;
        for (int s = 0; s < supports; s++) {
            if (a[s] == 0.0) continue;
            joint[s] += a[s];
            for (int j = 0; j < 6; j++)
                g->yields[(size_t)(first + i) * (size_t)g->stride + (size_t)(first + j)] -=
                    a[s] * gk_node_dot(kappa + s * supports, n->gear->node_support + j * supports, carrying);
            if (n->side->port_of >= 0) joint[supports] -= a[s] * gk_node_dot(kappa + s * supports, to_port, carrying);
        }
    }
}

/* M of the dynamic oscillators, in their order; rigid motion is not among what sides hold of them: the gap reads it */
static void select_dynamic(const gk_node *n, const gk_grounded *g)
{
    const gk_base *base = &n->setup->base;
    const int32_t *list = n->gear->ground[base->set].list;
    for (int i = 6; i < g->motions; i++) {
        const double *row = gk_node_motion(n->gear, base->set, i);
        double *to = g->dynamic + (size_t)i * (size_t)g->columns - base->from[n->side->gear];
        for (int k = 0; k < n->gear->ground[base->set].reads; k++)
            if (base->slot[list[k]] >= 0) to[base->slot[list[k]]] = row[k];
    }
}

size_t gk_grounded_room(const gk_model *model, const gk_gear *gear, int columns)
{
    GK_ASSERT(columns % 4 == 0);
    const size_t motions = (size_t)gk_node_motions(gear), held = (size_t)gk_padded(model->supports + 1);
    return motions * ((size_t)gk_padded((int)motions) + held + (size_t)columns);
}

gk_grounded gk_grounded_side(const gk_node *n, double *room)
{
    GK_ASSERT(n->setup && room);
    const gk_base *base = &n->setup->base;
    const int motions = gk_node_motions(n->gear);
    gk_grounded g = {.motions = motions,
                     .stride = gk_padded(motions),
                     .held = gk_padded(n->model->supports + 1),
                     .columns = base->width[n->side->gear]};
    g.yields = room, g.joints = g.yields + motions * g.stride, g.dynamic = g.joints + motions * g.held;
    memset(room, 0, gk_grounded_room(n->model, n->gear, g.columns) * sizeof *room);
    const int32_t *list = n->gear->ground[base->set].list;
    for (int k = 0; k < n->gear->ground[base->set].reads; k++)
        if (base->slot[list[k]] < 0) add_yield(n, &g, k);
    add_supports(n, &g);
    select_dynamic(n, &g);
    return g;
}

/* ---- products ---------------------------------------------------------------------------------------------------- */
/* `count` rows of x times some chunks of columns of a matrix, from column j on, added to rows of out; sums stay in
 * registers and run in order */
GK_INLINE void times_block(const double *x, const gk_matrix *by, int j, double *out, int count, int chunks)
{
    const size_t n = (size_t)by->rows, m = (size_t)by->columns;
    gk_chunk sum[4][2];
    for (int p = 0; p < count; p++)
        for (int q = 0; q < chunks; q++) sum[p][q] = ((const gk_chunk *)(out + (size_t)p * m + j))[q];
    for (size_t i = 0; i < n; i++) {
        const gk_chunk *row = (const gk_chunk *)(by->entry + i * m + j);
        for (int p = 0; p < count; p++)
            for (int q = 0; q < chunks; q++) sum[p][q] += x[(size_t)p * n + i] * row[q];
    }
    for (int p = 0; p < count; p++)
        for (int q = 0; q < chunks; q++) ((gk_chunk *)(out + (size_t)p * m + j))[q] = sum[p][q];
}

GK_INLINE void times_rows(const double *x, const gk_matrix *by, double *out, int count)
{
    int j = 0;
    for (; j + 2 * GK_CHUNK <= by->columns; j += 2 * GK_CHUNK) times_block(x, by, j, out, count, 2);
    if (j < by->columns) times_block(x, by, j, out, count, 1);
}

void gk_grounded_times(const double *x, const gk_matrix *by, int points, double *out)
{
    GK_ASSERT(points >= 0 && by->columns % 4 == 0);
    const size_t n = (size_t)by->rows, m = (size_t)by->columns;
    int i = 0;
    for (; i + 4 <= points; i += 4) times_rows(x + (size_t)i * n, by, out + (size_t)i * m, 4);
    for (; i < points; i++) times_rows(x + (size_t)i * n, by, out + (size_t)i * m, 1);
}
