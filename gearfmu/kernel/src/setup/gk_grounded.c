/* What ground oscillators and supports do to one side of an engagement, by the few motions that a flank has in them
 * (gk_node_motion). */
#include "setup/gk_grounded.h"

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
    double column[12 + MAX_LOW], joint[MAX_SUPPORTS + 1] = {0};
    for (int i = 0; i < g->motions; i++) column[i] = gk_node_motion(n->gear, n->setup->base.set, i)[k];
    for (int s = 0; s < supports; s++) joint[s] = ground->support_rows[s * ground->n + which];
    if (n->side->port_of >= 0) joint[supports] = ground->port_rows[n->side->port_of * ground->n + which];
    add_outer(by, column, column, g->motions, g->motions, g->yields);
    add_outer(by, column, joint, g->motions, supports + 1, g->joints);
}

/* the supports' answer to forces on the gear's node: C_fs of a point is node · node_support */
static void add_supports(const gk_node *n, const gk_grounded *g)
{
    const int supports = n->model->supports, first = 6 + n->gear->low;
    const double *kappa = n->model->ground[n->setup->base.set].kappa;
    const double *to_port = n->model->port_support + n->side->port_of * supports;
    for (int i = 0; i < 6; i++) {
        const double *a = n->gear->node_support + i * supports;
        double *joint = g->joints + (size_t)(first + i) * (size_t)(supports + 1);
        for (int s = 0; s < supports; s++) {
            if (a[s] == 0.0) continue;
            joint[s] += a[s];
            for (int j = 0; j < 6; j++)
                g->yields[(size_t)(first + i) * (size_t)g->motions + (size_t)(first + j)] -=
                    a[s] * gk_node_dot(kappa + s * supports, n->gear->node_support + j * supports, supports);
            if (n->side->port_of >= 0) joint[supports] -= a[s] * gk_node_dot(kappa + s * supports, to_port, supports);
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

gk_grounded gk_grounded_side(const gk_node *n)
{
    const gk_base *base = &n->setup->base;
    const size_t motions = (size_t)gk_node_motions(n->gear), joints = (size_t)n->model->supports + 1;
    gk_grounded g = {.motions = (int)motions, .columns = base->width[n->side->gear]};
    g.yields = gk_node_room(n), g.joints = g.yields + motions * motions;
    g.dynamic = g.joints + motions * joints, g.loaded = g.dynamic + motions * (size_t)g.columns;
    memset(g.yields, 0, (motions * (motions + joints + (size_t)g.columns)) * sizeof *g.yields);
    const int32_t *list = n->gear->ground[base->set].list;
    for (int k = 0; k < n->gear->ground[base->set].reads; k++)
        if (base->slot[list[k]] < 0) add_yield(n, &g, k);
    add_supports(n, &g);
    select_dynamic(n, &g);
    return g;
}

typedef double gk_two __attribute__((vector_size(2 * sizeof(double)), may_alias, aligned(sizeof(double))));

/* out (m) += x (n) · matrix (n, m), by eight columns whose sums stay in registers */
void gk_grounded_times(const double *x, const double *matrix, int n, int m, double *out)
{
    int j = 0;
    for (; j + 8 <= m; j += 8) {
        const gk_two *row;
        gk_two *to = (gk_two *)(out + j), a = to[0], b = to[1], c = to[2], d = to[3];
        for (int i = 0; i < n; i++) {
            row = (const gk_two *)(matrix + (size_t)i * (size_t)m + (size_t)j);
            a += x[i] * row[0], b += x[i] * row[1], c += x[i] * row[2], d += x[i] * row[3];
        }
        to[0] = a, to[1] = b, to[2] = c, to[3] = d;
    }
    for (; j < m; j++)
        for (int i = 0; i < n; i++) out[j] += x[i] * matrix[(size_t)i * (size_t)m + (size_t)j];
}

/* yields · motion of every point of a node */
void gk_grounded_load(const gk_node *n, const gk_grounded *g)
{
    memset(g->loaded, 0, (size_t)n->points * (size_t)g->motions * sizeof *g->loaded);
    for (int i = 0; i < n->points; i++) {
        const size_t at = (size_t)i * (size_t)g->motions;
        gk_grounded_times(n->motion + at, g->yields, g->motions, g->motions, g->loaded + at);
    }
}

/* through the ground oscillators that are not dynamic and the supports, between two points */
double gk_grounded_through(const gk_node *n, const gk_grounded *g, int i, int j)
{
    return gk_node_dot(n->motion + (size_t)i * (size_t)g->motions, g->loaded + (size_t)j * (size_t)g->motions,
                       g->motions);
}
