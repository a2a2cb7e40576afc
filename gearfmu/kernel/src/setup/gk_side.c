/* Tables of one gear of an engagement along the path of contact: rows of its dynamic modes, what its ground oscillators
 * read, and compliance of what is not dynamic (docs/theory.md, eq. 2), for all teeth that may touch, at NODES + 1
 * positions in one pitch. Teeth of one flank are whole base pitches apart, so one position decides all lengths of roll.
 * A row between two nodes is linear, the compliance of what is not dynamic a parabola. */
#include "setup/gk_block.h"
#include "setup/gk_grounded.h"

static const double MARGIN = 0.15, CORNER = 0.5; /* base pitches beyond the ends of the flanks: play; tip corners */

/* ---- which teeth ------------------------------------------------------------------------------------------------- */
/* lengths of roll of this side between which the other side has a flank, corners included */
static void span(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int which, double ends[2])
{
    const gk_gear *own = &model->gear[e->gear[which]], *other = &model->gear[e->gear[1 - which]];
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double R = gk_base_reach(model, e), L = sqrt(x * x + y * y - R * R);
    const double pitch = own->r_b * 2.0 * GK_PI / own->z, beyond = (setup->on.tip_contact ? CORNER : 0.0) + MARGIN;
    const double lean = 0.5 * e->width *
                        fabs(gk_node_tan(own->helix)); /* the ends of the face width are ahead and behind */
    if (e->kind == MESH_EXTERNAL) {
        ends[0] = L - other->s_tip, ends[1] = own->s_tip;
    } else if (which == 0) { /* the planet in the ring: s_B = L + s_A */
        ends[0] = other->s_tip - L, ends[1] = own->s_tip;
    } else {
        ends[0] = own->s_tip, ends[1] = L + other->s_tip;
    }
    ends[0] -= beyond * pitch + lean, ends[1] += beyond * pitch + lean;
}

void gk_side_plan(const gk_model *model, const gk_setup *setup, int index, gk_side *side, int which)
{
    GK_ASSERT(gk_is_engagement(model, index));
    GK_ASSERT(which == 0 || which == 1);
    const gk_engagement *e = &model->engagement[index];
    const gk_gear *gear = &model->gear[e->gear[which]];
    memset(side, 0, sizeof *side);
    side->gear = e->gear[which], side->which = which;
    side->port_of = gk_port_of(model, side->gear);
    side->nodes = 1, side->candidates = side->count[0] = 1;
    side->step = which == 1 && e->kind == MESH_EXTERNAL ? -1 : 1;
    side->pitch = 1.0;
    if (e->kind == MESH_FLAT) return;
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double a = sqrt(x * x + y * y), R = gk_base_reach(model, e);
    double ends[2];
    side->nodes = NODES;
    side->pitch = gear->r_b * 2.0 * GK_PI / gear->z;
    side->both = 2.0 * gear->r_b * (gear->psi_b + gk_acos(R / a));
    span(model, setup, e, which, ends);
    side->candidates = 0;
    for (int flank = 0; flank < 2; flank++) {
        side->count[flank] = 0;
        for (int k = -gear->z; k <= gear->z && side->candidates < MAX_CANDIDATES; k++) {
            const int offset = side->step * k;
            const double begin = gk_node_roll(side, flank, 0.0, offset), end = gk_node_roll(side, flank, 1.0, offset);
            if (gk_max(begin, end) < ends[0] || gk_min(begin, end) > ends[1]) continue;
            if (!side->count[flank]) side->first[flank] = offset;
            side->count[flank]++, side->candidates++;
        }
    }
}

/* ---- compliance of what is not dynamic --------------------------------------------------------------------------- */
/* Σ a_k b_k/ω² over modes below `dynamic` */
static double carried(const gk_node *n, int i, int j, int dynamic)
{
    const double *a = n->rows + (size_t)i * n->gear->modes, *b = n->rows + (size_t)j * n->gear->modes;
    double lane[4] = {0, 0, 0, 0};
    for (int k = 0; k < dynamic; k++) lane[k % 4] += a[k] * b[k] * n->flexibility[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* the same between two candidates, (strips, strips); 0 when they are too far apart for the table: what stored modes
 * carry is all there is then */
static int tabulated(const gk_node *n, int first, int second, double *out)
{
    const int A = n->model->functions, strips = n->setup->strips;
    const int offset = n->at[second * strips].offset - n->at[first * strips].offset;
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    for (int c = 0; c < strips * strips; c++) out[c] = 0.0;
    if (offset < -FURTHER || offset > FURTHER) return 0;
    const gk_block b = gk_block_of(n, n->at[first * strips].flank, n->at[second * strips].flank, offset);
    for (int s = 0; s < strips; s++)
        for (int t = 0; t < strips; t++) {
            if (n->gear->helix != 0.0 || s + t == 0) /* else all strips have the same rolls */
                gk_block_tabulate(n, b, &n->at[first * strips + s], &n->at[second * strips + t], cell);
            const double *of_s = n->at[first * strips + s].width, *of_t = n->at[second * strips + t].width;
            for (int a = 0; a < A; a++) out[s * strips + t] += of_s[a] * gk_node_dot(cell + a * A, of_t, A);
        }
    return 1;
}

/* Σ a b/ω² over the dynamic modes, rows halfway to the next node as the step interpolates them */
static double carried_halfway(const gk_node *n, int at, int i, int j)
{
    const gk_modal *m = &n->setup->modal[n->side->gear];
    const gk_real *rows = n->side->rows + (size_t)at * n->points * m->n, *next = rows + (size_t)n->points * m->n;
    const gk_real *a = rows + (size_t)i * m->n, *c = next + (size_t)i * m->n;
    const gk_real *b = rows + (size_t)j * m->n, *d = next + (size_t)j * m->n;
    double lane[4] = {0, 0, 0, 0};
    for (int k = 0; k < m->n; k++)
        if (m->omega2[k] > 0) lane[k % 4] += 0.25 * ((double)a[k] + c[k]) * ((double)b[k] + d[k]) / m->omega2[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* The residual between two candidates at a node, and of a tooth with itself what no stored mode carries: what its
 * damper is parallel to. Halfway to the next node: what makes the parabola there right. */
static void store_block(const gk_node *n, int at, int halfway, const gk_grounded *g, int p, int q)
{
    const gk_side *side = n->side;
    const int strips = n->setup->strips, square = strips * strips, dynamic = n->setup->modal[side->gear].count;
    const size_t columns = (size_t)side->columns, size = 2 * (size_t)n->points * columns;
    gk_real *table = side->residual + (size_t)at * size;
    double cell[MAX_BLOCK];
    const int near = tabulated(n, p, q, cell);
    for (int c = 0; c < square; c++) {
        const int i = p * strips + c / strips, j = q * strips + c % strips;
        const size_t here = 2 * (size_t)i * columns + (size_t)j, mirrored = 2 * (size_t)j * columns + (size_t)i;
        const double stored = !near || (p == q && !halfway) ? carried(n, i, j, n->gear->modes) : 0.0;
        const double ground = n->e->kind == MESH_FLAT ? 0.0 : gk_grounded_through(n, g, i, j);
        const double all = (near ? cell[c] : stored) + ground;
        if (halfway) {
            const double middle = all - carried_halfway(n, at, i, j);
            table[here + columns] = table[mirrored + columns] = (gk_real)(4.0 * middle - table[here] -
                                                                          table[here + size]);
            continue;
        }
        if (p == q) side->path[((size_t)at * side->candidates + p) * square + c] = cell[c] - stored;
        table[here] = table[mirrored] = (gk_real)(all - carried(n, i, j, dynamic));
    }
}

static void store_residual(const gk_node *n, int at, int halfway, const gk_grounded *g)
{
    if (n->e->kind != MESH_FLAT) gk_grounded_load(n, g);
    for (int p = 0; p < n->side->candidates; p++)
        for (int q = p; q < n->side->candidates; q++) store_block(n, at, halfway, g, p, q);
}

/* Σ a b/ω² over modes `from` … `to` − 1 */
static double carried_by(const gk_node *n, const double *a, const double *b, int from, int to)
{
    double sum = 0.0;
    for (int k = from; k < to; k++) sum += a[k] * b[k] * n->flexibility[k];
    return sum;
}

/* What is not dynamic yields along the normal and along the profile per force along the profile. One tooth by its own
 * table; of others what stored modes carry. */
static void store_along_residual(const gk_node *n, int at, const gk_grounded *g)
{
    const gk_side *side = n->side;
    const gk_gear *gear = n->gear;
    const int modes = gear->modes, dynamic = n->setup->modal[side->gear].count;
    const double own = gk_node_along(n);
    double loaded[12 + MAX_LOW];
    for (int j = 0; j < n->points; j++) {
        memset(loaded, 0, (size_t)g->motions * sizeof *loaded);
        if (n->e->kind != MESH_FLAT)
            gk_grounded_times(n->along_motion + (size_t)j * (size_t)g->motions, g->yields, g->motions, g->motions,
                              loaded);
        for (int i = 0; i < n->points; i++) {
            const int same = n->at[i].offset == n->at[j].offset && gear->along_normal;
            const double *a = n->rows + (size_t)i * modes, *s = n->along_rows + (size_t)i * modes;
            const double *t = n->along_rows + (size_t)j * modes;
            const int from = same ? 0 : dynamic, to = same ? dynamic : modes;
            const double sign = same ? -1.0 : 1.0;
            double normal = sign * carried_by(n, a, t, from, to), along = sign * carried_by(n, s, t, from, to);
            if (same)
                normal += own * gk_block_between(n, gk_block_along_normal(n, n->at[i].flank, n->at[j].flank), i, j),
                    along += gk_block_between(n, gk_block_along_own(n, n->at[i].flank, n->at[j].flank), i, j);
            if (n->e->kind != MESH_FLAT) {
                normal += gk_node_dot(n->motion + (size_t)i * (size_t)g->motions, loaded, g->motions);
                along += gk_node_dot(n->along_motion + (size_t)i * (size_t)g->motions, loaded, g->motions);
            }
            const size_t to_table = ((size_t)at * n->points + (size_t)i) * (size_t)side->columns + (size_t)j;
            side->along.normal[to_table] = (gk_real)normal;
            side->along.own[to_table] = (gk_real)along;
        }
    }
}

/* rows along the profile of what is dynamic, and what friction puts on supports at once */
static void store_along(const gk_node *n, int at, const gk_grounded *g)
{
    const gk_side *side = n->side;
    const gk_modal *m = &n->setup->modal[side->gear];
    const int supports = n->model->supports;
    const gk_ground *ground = &n->model->ground[n->setup->base.set];
    for (int i = 0; i < n->points; i++) {
        const size_t point = (size_t)at * n->points + (size_t)i;
        gk_real *to = side->along.rows + point * m->n;
        memset(to, 0, (size_t)m->n * sizeof *to);
        for (int k = 0; k < m->count; k++) to[m->lane[k]] = (gk_real)n->along_rows[(size_t)i * n->gear->modes + k];
        double *moves = side->along.ground + point * (size_t)g->columns, *held = side->along.support + point * supports;
        double moved[MAX_SUPPORTS + 1] = {0};
        memset(moves, 0, (size_t)g->columns * sizeof *moves);
        memset(held, 0, (size_t)supports * sizeof *held);
        if (n->e->kind == MESH_FLAT || !n->setup->on.elastic) continue;
        const double *motion = n->along_motion + (size_t)i * (size_t)g->motions;
        gk_grounded_times(motion, g->dynamic, g->motions, g->columns, moves);
        if (n->setup->on.residual) gk_grounded_times(motion, g->joints, g->motions, supports + 1, moved);
        for (int s = 0; s < supports; s++) held[s] = gk_node_dot(ground->kappa + s * supports, moved, supports);
    }
}

/* flank to bore angle and to supports, beside what dynamic oscillators carry */
static void store_joints(const gk_node *n, int at, const gk_grounded *g)
{
    const gk_side *side = n->side;
    const int supports = n->model->supports;
    const double *kappa = n->model->ground[n->setup->base.set].kappa;
    for (int i = 0; i < n->points; i++) {
        const size_t point = (size_t)at * n->points + (size_t)i;
        double moved[MAX_SUPPORTS + 1] = {0}, *to = side->support + point * gk_padded(supports);
        gk_grounded_times(n->motion + (size_t)i * (size_t)g->motions, g->joints, g->motions, supports + 1, moved);
        for (int s = 0; s < supports; s++) to[s] = gk_node_dot(kappa + s * supports, moved, supports);
        side->port[point] = n->port[i] + moved[supports];
    }
}

static void store_rows(const gk_node *n, int at)
{
    const gk_side *side = n->side;
    const gk_modal *m = &n->setup->modal[side->gear];
    for (int i = 0; i < n->points; i++) {
        gk_real *to = side->rows + ((size_t)at * n->points + i) * m->n;
        memset(to, 0, (size_t)m->n * sizeof *to);
        for (int k = 0; k < m->count; k++) to[m->lane[k]] = (gk_real)n->rows[(size_t)i * n->gear->modes + k];
    }
}

/* rows of the dynamic ground oscillators without the rigid motion, which the gap reads */
static void store_ground(const gk_node *n, int at, const gk_grounded *g)
{
    double *to = n->side->ground + (size_t)at * (size_t)n->points * (size_t)g->columns;
    memset(to, 0, (size_t)n->points * (size_t)g->columns * sizeof *to);
    for (int i = 0; i < n->points; i++, to += g->columns)
        gk_grounded_times(n->motion + (size_t)i * (size_t)g->motions, g->dynamic, g->motions, g->columns, to);
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

/* tables of a side that the level decides */
void gk_side_fill(const gk_model *model, gk_setup *setup, gk_work *work, int e, int which)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    GK_ASSERT(setup->mesh[e].side[which].candidates <= MAX_CANDIDATES);
    gk_side *side = &setup->mesh[e].side[which];
    gk_node n = gk_node_begin(model, setup, work, e, side);
    const gk_grounded g = gk_grounded_side(&n);
    const size_t nodes = (size_t)side->nodes + 1, points = (size_t)n.points;
    for (int at = 0; at <= side->nodes; at++) {
        gk_node_gather(&n, (double)at / side->nodes);
        store_rows(&n, at);
        if (setup->on.elastic && n.e->kind != MESH_FLAT) store_ground(&n, at, &g);
        if (setup->far_on[side->gear]) store_far(&n, at);
        if (setup->on.residual) store_residual(&n, at, 0, &g);
        if (setup->on.residual && n.e->kind != MESH_FLAT) store_joints(&n, at, &g);
        if (GK_ON(setup, friction)) store_along(&n, at, &g);
        if (GK_ON(setup, friction) && setup->on.residual) store_along_residual(&n, at, &g);
    }
    for (int at = 0; at < side->nodes && setup->on.residual; at++) {
        gk_node_gather(&n, (at + 0.5) / side->nodes);
        store_residual(&n, at, 1, &g);
    }
    if (!setup->on.elastic || n.e->kind == MESH_FLAT)
        memset(side->ground, 0, nodes * points * (size_t)setup->base.width[side->gear] * sizeof *side->ground);
    if (!setup->on.residual) {
        memset(side->residual, 0, 2 * nodes * points * (size_t)side->columns * sizeof(gk_real));
        memset(side->path, 0, nodes * points * (size_t)setup->strips * sizeof *side->path);
    }
    if (!setup->on.residual || n.e->kind == MESH_FLAT) {
        memset(side->port, 0, nodes * points * sizeof *side->port);
        memset(side->support, 0, nodes * points * (size_t)gk_padded(model->supports) * sizeof *side->support);
    }
    if (GK_ON(setup, friction) && !setup->on.residual) {
        memset(side->along.normal, 0, nodes * points * (size_t)side->columns * sizeof(gk_real));
        memset(side->along.own, 0, nodes * points * (size_t)side->columns * sizeof(gk_real));
    }
    side->held = held_by(side->support, nodes * points, model->supports);
    keep_held(side, nodes * points, model->supports);
}
