/* Tables of one gear of an engagement along the path of contact: rows of its dynamic modes, what its ground oscillators
 * read, and compliance of what is not dynamic (docs/theory.md, eq. 2), for all teeth that may touch, at NODES + 1
 * positions in one pitch. Teeth of one flank are whole base pitches apart, so one position decides all lengths of roll.
 * A row between two nodes is linear, the compliance of what is not dynamic a parabola. Twins are sides whose points lie
 * at the same places of gears of one body, as those of a sun at equal planets: what depends on bodies alone is made
 * once for all of them, to the same bits. */
#include "setup/gk_residual.h"
#include "setup/gk_tables.h"

/* ---- what twins have in common ----------------------------------------------------------------------------------- */
static void store_modes(const gk_node *n, int at, const double *rows, gk_real *table)
{
    const gk_modal *m = &n->setup->modal[n->side->gear];
    for (int i = 0; i < n->points; i++) {
        gk_real *to = table + ((size_t)at * n->points + i) * m->n;
        memset(to, 0, (size_t)m->n * sizeof *to);
        for (int k = 0; k < m->count; k++) to[m->lane[k]] = (gk_real)rows[(size_t)i * n->gear->modes + k];
    }
}

/* tables that twins read in the first one's place */
static void share_tables(const gk_side *first, gk_side *side)
{
    side->rows = first->rows;
    side->path = first->path;
    side->along.rows = first->along.rows;
}

/* ---- what each side has of its own ------------------------------------------------------------------------------- */
/* rows of the dynamic ground oscillators without the rigid motion, which the gap reads */
static void store_ground(const gk_node *n, int at, const gk_grounded *g, const double *motion, double *table)
{
    const gk_matrix dynamic = gk_grounded_dynamic(g);
    const size_t size = (size_t)n->points * (size_t)g->columns;
    double *to = table + (size_t)at * size;
    memset(to, 0, size * sizeof *to);
    gk_grounded_times(motion, &dynamic, n->points, to);
}

/* what friction puts on supports at once */
static void store_along_support(const gk_node *n, int at, const gk_grounded *g, double *moved)
{
    const int supports = n->model->supports, carrying = n->model->ground[n->setup->base.set].carrying;
    const double *kappa = n->model->ground[n->setup->base.set].kappa;
    const gk_matrix joints = gk_grounded_joints(g);
    memset(moved, 0, (size_t)n->points * (size_t)g->held * sizeof *moved);
    if (n->setup->on.residual) gk_grounded_times(n->along_motion, &joints, n->points, moved);
    for (int i = 0; i < n->points; i++, moved += g->held) {
        double *held = n->side->along.support + ((size_t)at * n->points + (size_t)i) * (size_t)supports;
        for (int s = 0; s < supports; s++) held[s] = gk_node_dot(kappa + s * supports, moved, carrying);
    }
}

/* flank to bore angle and to supports, beside what dynamic oscillators carry */
static void store_joints(const gk_node *n, int at, const gk_grounded *g, double *moved)
{
    const gk_side *side = n->side;
    const int supports = n->model->supports, carrying = n->model->ground[n->setup->base.set].carrying;
    const double *kappa = n->model->ground[n->setup->base.set].kappa;
    const gk_matrix joints = gk_grounded_joints(g);
    memset(moved, 0, (size_t)n->points * (size_t)g->held * sizeof *moved);
    gk_grounded_times(n->motion, &joints, n->points, moved);
    for (int i = 0; i < n->points; i++, moved += g->held) {
        const size_t point = (size_t)at * n->points + (size_t)i;
        double *to = side->support + point * gk_padded(supports);
        for (int s = 0; s < supports; s++) to[s] = gk_node_dot(kappa + s * supports, moved, carrying);
        side->port[point] = n->port[i] + moved[supports];
    }
}

/* patterns of far teeth at the points */
static void store_far(const gk_node *n, int at)
{
    const gk_side *side = n->side;
    for (int i = 0; i < n->points; i++)
        gk_node_blend(n, n->flank->far, &n->at[i], FAR, side->far + ((size_t)at * n->points + i) * FAR);
}

/* ---- all of them ------------------------------------------------------------------------------------------------- */
/* the supports that any point of the tables loads */
static gk_span held_by(const double *support, size_t points, int supports)
{
    int from = supports, to = 0;
    for (size_t i = 0; i < points; i++, support += gk_padded(supports))
        for (int s = 0; s < supports; s++)
            if (support[s] != 0.0) from = s < from ? s : from, to = s >= to ? s + 1 : to;
    return from < to ? (gk_span){from, to - from} : (gk_span){0, 0};
}

/* rows over the supports become rows of whole quads over those that the side loads */
static void keep_held(gk_side *side, size_t rows, int supports)
{
    const size_t width = (size_t)gk_padded(side->held.width), held = (size_t)side->held.width;
    for (size_t r = 0; r < rows; r++) {
        double row[MAX_SUPPORTS] = {0};
        memcpy(row, side->support + r * (size_t)gk_padded(supports) + side->held.from, held * sizeof *row);
        memcpy(side->support + r * width, row, width * sizeof *row);
    }
}

typedef struct maker { /* of the tables of twins */
    gk_node n;
    gk_residual r;
    double *moved; /* (points, held) */
    const gk_twins *twins;
    gk_side *side[2 * MAX_ENGAGEMENTS];
    gk_grounded grounded[2 * MAX_ENGAGEMENTS];
} maker;

static void begin(maker *m, const gk_model *model, gk_setup *setup, const gk_room *of, const gk_twins *twins)
{
    m->twins = twins;
    for (int i = 0; i < twins->count; i++) m->side[i] = &setup->mesh[twins->engagement[i]].side[twins->which[i]];
    m->n = gk_node_begin(model, setup, of, twins->engagement[0], m->side[0]);
    double *room = gk_node_room(&m->n);
    room = gk_residual_begin(&m->r, &m->n, room);
    m->moved = room, room += (size_t)m->n.points * (size_t)gk_padded(model->supports + 1);
    for (int i = 0; i < twins->count; i++) {
        gk_node_take(&m->n, twins->engagement[i], m->side[i]);
        if (i) share_tables(m->side[0], m->side[i]);
        if (i && m->side[i]->gear == m->side[i - 1]->gear) {
            m->grounded[i] = m->grounded[i - 1];
            continue;
        }
        m->grounded[i] = gk_grounded_side(&m->n, room);
        room += gk_grounded_room(model, m->n.gear, m->grounded[i].columns);
    }
}

/* one node of the tables of one side */
static void store_own(maker *m, int at, const gk_grounded *g)
{
    const gk_setup *setup = m->n.setup;
    const int round = m->n.e->kind != MESH_FLAT, friction = GK_ON(setup, friction);
    gk_node_turn(&m->n, friction);
    if (setup->on.elastic && round) store_ground(&m->n, at, g, m->n.motion, m->n.side->ground);
    if (setup->far_on[m->n.side->gear]) store_far(&m->n, at);
    if (setup->on.residual) gk_residual_store(&m->r, &m->n, at, 0, g);
    if (setup->on.residual && round) store_joints(&m->n, at, g, m->moved);
    if (friction && setup->on.elastic && round) {
        store_ground(&m->n, at, g, m->n.along_motion, m->n.side->along.ground);
        store_along_support(&m->n, at, g, m->moved);
    }
    if (friction && setup->on.residual) gk_residual_store_along(&m->r, &m->n, at, g);
}

static void fill_node(maker *m, int at)
{
    const gk_setup *setup = m->n.setup;
    gk_node_take(&m->n, m->twins->engagement[0], m->side[0]);
    gk_node_gather(&m->n, (double)at / m->side[0]->nodes, 1);
    store_modes(&m->n, at, m->n.rows, m->side[0]->rows);
    if (GK_ON(setup, friction)) store_modes(&m->n, at, m->n.along_rows, m->side[0]->along.rows);
    if (setup->on.residual) gk_residual_gather(&m->r, &m->n, at, 0);
    if (setup->on.residual && GK_ON(setup, friction)) gk_residual_gather_along(&m->r, &m->n);
    for (int i = 0; i < m->twins->count; i++) {
        gk_node_take(&m->n, m->twins->engagement[i], m->side[i]);
        store_own(m, at, &m->grounded[i]);
    }
}

static void fill_halfway(maker *m, int at)
{
    gk_node_take(&m->n, m->twins->engagement[0], m->side[0]);
    gk_node_gather(&m->n, (at + 0.5) / m->side[0]->nodes, 0);
    gk_residual_gather(&m->r, &m->n, at, 1);
    for (int i = 0; i < m->twins->count; i++) {
        gk_node_take(&m->n, m->twins->engagement[i], m->side[i]);
        gk_node_turn(&m->n, 0);
        gk_residual_store(&m->r, &m->n, at, 1, &m->grounded[i]);
    }
}

/* zeros in what a side does not have at this level */
static void clear_absent(const gk_model *model, const gk_setup *setup, const gk_engagement *e, gk_side *side)
{
    const size_t points = ((size_t)side->nodes + 1) * (size_t)(side->candidates * setup->strips);
    const int along = GK_ON(setup, friction);
    if (!setup->on.elastic || e->kind == MESH_FLAT) {
        memset(side->ground, 0, points * (size_t)setup->base.width[side->gear] * sizeof *side->ground);
        if (along) {
            memset(side->along.ground, 0, points * (size_t)setup->base.width[side->gear] * sizeof *side->ground);
            memset(side->along.support, 0, points * (size_t)model->supports * sizeof *side->along.support);
        }
    }
    if (!setup->on.residual) {
        memset(side->residual, 0, 2 * points * (size_t)side->columns * sizeof(gk_real));
        memset(side->path, 0, points * (size_t)setup->strips * sizeof *side->path);
    }
    if (!setup->on.residual || e->kind == MESH_FLAT) {
        memset(side->port, 0, points * sizeof *side->port);
        memset(side->support, 0, points * (size_t)gk_padded(model->supports) * sizeof *side->support);
    }
    if (along && !setup->on.residual) {
        memset(side->along.normal, 0, points * (size_t)side->columns * sizeof(gk_real));
        memset(side->along.own, 0, points * (size_t)side->columns * sizeof(gk_real));
    }
}

/* tables of sides that are twins */
void gk_side_fill(const gk_model *model, gk_setup *setup, gk_room *room, const gk_twins *twins)
{
    GK_ASSERT(twins->count > 0 && twins->count <= 2 * MAX_ENGAGEMENTS);
    maker m;
    begin(&m, model, setup, room, twins);
    for (int at = 0; at <= m.side[0]->nodes; at++) fill_node(&m, at);
    for (int at = 0; at < m.side[0]->nodes && setup->on.residual; at++) fill_halfway(&m, at);
    for (int i = 0; i < twins->count; i++) {
        const size_t points = ((size_t)m.side[i]->nodes + 1) * (size_t)m.n.points;
        clear_absent(model, setup, &model->engagement[twins->engagement[i]], m.side[i]);
        m.side[i]->held = held_by(m.side[i]->support, points, model->supports);
        keep_held(m.side[i], points, model->supports);
    }
}
