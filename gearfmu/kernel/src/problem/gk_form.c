/* Forms the problem of an engagement in a step (docs/theory.md, eq. 10): which forces are unknown, what they do to the
 * gaps within the step (D) and at once through what is quasi-static (A, P), and the gaps without them. Rows: strips of
 * all tooth pairs, then the live joints of its ports (springs, shafts, clutches). Contact forces press inward, rows
 * measure outward: a contact row is −(flank row). */
#include "problem/gk_work.h"

static const double SHARE = 0.95, SHARE_OF_BOTH_FLANKS = 0.75;

/* ---- rows -------------------------------------------------------------------------------------------------------- */
static void list_contacts(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work,
                          int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_meshing *meshing = &data->meshing[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    static const gk_memory fresh;
    const double damping = GK_ON(setup, contact_damping) ? 2.0 * mesh->damping / h : 0.0;
    const double slice = setup->slices / model->engagement[e].width, per_cosine = 1.0 / mesh->cosine;
    int n = 0;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        const gk_memory *memory = place->memory < 0 ? &fresh : &meshing->memory[place->memory];
        if (!s->own_laws) gk_law_set(model, setup, mesh, place->point[0].curvature, &s->local[p]);
        for (int i = 0; i < GK_STRIPS(s); i++, n++) {
            const gk_point *point = gk_point_of(setup, place, i);
            const double width = mesh->strip_width[i] * point->share;
            s->kind[n] = ROW_CONTACT;
            s->port_of[n] = s->joint_of[n] = -1;
            s->place_of[n] = p;
            s->force0[n] = memory->force[i];
            s->end0[n] = memory->end[i];
            s->dash0[n] = memory->dash[i];
            s->damping[n] = damping * width;
            s->bound[n] = 0.0;
            s->weight[n] = width * slice;
            s->width[n] = width * per_cosine;
            s->per_width[n] = 1.0 / s->width[n];
            if (s->own_laws) gk_law_set(model, setup, mesh, point->curvature, &s->local[n]);
        }
    }
    s->contacts = s->n = n;
}

static void list_joint(const gk_setup *setup, const gk_data *data, double h, gk_system *s, int port, int joint)
{
    const gk_joint_state *state = &data->joint[port][joint];
    const int clutch = joint == JOINT_CLUTCH, torque = joint == JOINT_PORT && setup->given_torque[port];
    s->kind[s->n] = clutch ? ROW_CLUTCH : torque ? ROW_TORQUE : ROW_SPRING;
    s->port_of[s->n] = port, s->joint_of[s->n] = joint;
    s->weight[s->n] = 1.0;
    s->force0[s->n] = clutch ? 0.0 : state->force;
    s->end0[s->n] = state->end;
    s->dash0[s->n] = state->dash;
    s->damping[s->n] = 2.0 * setup->joint[port][joint].damping / h;
    s->bound[s->n] = clutch ? 2.0 * data->shaft[port][V_CAPACITY] : 0.0;
    s->width[s->n] = s->per_width[s->n] = 0.0;
    s->clutches += clutch;
    s->n++;
}

static void list_rows(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_system *s = &work->engaged[e].system;
    s->strips = setup->strips;
    s->n = s->clutches = 0;
    s->own_laws = setup->spatial;
    list_contacts(model, setup, data, h, work, e);
    for (int joint = 0; joint < JOINTS; joint++) /* clutches last */
        for (int p = 0; p < mesh->ports; p++)
            if (setup->joint[mesh->port[p]][joint].live) list_joint(setup, data, h, s, mesh->port[p], joint);
    s->stride = (s->n + 3) / 4 * 4;
    for (int i = s->n; i < s->n + 4 && i < MAX_STRIDE; i++)
        s->g[i] = s->force0[i] = s->dash0[i] = s->end0[i] = s->damping[i] = s->width[i] = s->per_width[i] = 0.0;
}

/* ---- compliance of the gear groups and of what is not dynamic ------------------------------------------------------ */
/* tooth pairs that follow each other: their strips are neighbours in the system and in the tables of both sides */
typedef struct run {
    int column, count, point[2]; /* columns of the system; where they begin in the tables */
} run;

static int list_runs(const gk_engaged *engaged, int strips, run runs[MAX_PAIRS])
{
    int count = 0;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        if (p && place->candidate[0] == place[-1].candidate[0] + 1 && place->candidate[1] == place[-1].candidate[1] + 1)
            runs[count - 1].count += strips;
        else
            runs[count++] = (run){p * strips, strips, {place->candidate[0] * strips, place->candidate[1] * strips}};
    }
    return count;
}

/* D and A are symmetric and filled by block rows of quads: row i of a contact has columns up to the end of its block, that
 * of a joint up to itself; mirror() writes the rest. */
static int block_end(int i) { return i / 4 * 4 + 4; }

GK_INLINE void mirror(gk_system *s, const int quads)
{
    const int stride = 4 * quads;
    for (int block = 1; block < quads; block++)
        for (int i = 4 * block; i < 4 * block + 4; i++)
            for (int j = 0; j < 4 * block; j++) {
                s->D[j * stride + i] = s->D[i * stride + j];
                s->A[j * stride + i] = s->A[i * stride + j];
            }
    for (int i = s->contacts; i < s->n; i++)
        for (int j = i / 4 * 4; j < i; j++) {
            s->D[j * stride + i] = s->D[i * stride + j];
            s->A[j * stride + i] = s->A[i * stride + j];
        }
}

/* quads of a row between contacts: where they stand in the system and in the tables of both sides */
typedef struct part {
    int column, point[2];
} part;

static int list_parts(const gk_engaged *engaged, int strips, part *parts)
{
    run runs[MAX_PAIRS];
    const int count = list_runs(engaged, strips, runs);
    int n = 0;
    for (int r = 0; r < count; r++)
        for (int c = 0; c < runs[r].count; c += 4)
            parts[n++] = (part){runs[r].column + c, {runs[r].point[0] + c, runs[r].point[1] + c}};
    return n;
}

typedef struct
    blend { /* a table of one side at two neighbouring nodes: (points, parts, columns) each, and their weights */
    const gk_real *low, *high;
    double square_low, mixed, square_high;
    size_t columns, row; /* of one part; of all parts */
} blend;

static blend blend_of(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, const gk_real *table,
                      int parts)
{
    const gk_position *at = &engaged->position[side->which];
    const size_t columns = (size_t)side->columns, row = (size_t)parts * columns;
    const size_t node = (size_t)(side->candidates * GK_STRIPS(setup)) * row;
    const double x = at->part, y = 1.0 - x;
    const gk_real *low = table + (size_t)at->node * node;
    return (blend){low, low + node, y * y, x * y, x * x, columns, row};
}

#define WIDENED(values) GK_WIDENED(*(const gk_four *)(values))
#define BLENDED(b, at)                                                                                                 \
    ((b).square_low * WIDENED((b).low + (at)) + (b).mixed * WIDENED((b).low + (at) + (b).columns) +                    \
     (b).square_high * WIDENED((b).high + (at)))

/* rows of D and A between the contacts, or of A alone. What a quad writes beyond its run the next one writes again. */
GK_INLINE void table_rows(const gk_engaged *engaged, const blend *p, const blend *q, const part *parts, int count,
                          const int moves, const int strips)
{
    const gk_system *s = &engaged->system;
    double *D = s->D, *A = s->A;
    for (int place = 0, i = 0; place < engaged->places; place++) {
        size_t first = (size_t)(engaged->place[place].candidate[0] * strips) * p->row;
        size_t second = (size_t)(engaged->place[place].candidate[1] * strips) * q->row;
        for (int strip = 0; strip < strips; strip++, i++, first += p->row, second += q->row) {
            const int end = block_end(i);
            for (int c = 0; c < count && parts[c].column < end; c++) {
                const size_t a = first + (size_t)parts[c].point[0], b = second + (size_t)parts[c].point[1];
                if (moves) {
                    *(gk_quad *)(D + parts[c].column) = BLENDED(*p, a) + BLENDED(*q, b);
                    *(gk_quad *)(A + parts[c].column) = BLENDED(*p, a + 2 * p->columns) +
                                                        BLENDED(*q, b + 2 * q->columns);
                } else {
                    *(gk_quad *)(A + parts[c].column) = BLENDED(*p, a) + BLENDED(*q, b);
                }
            }
            for (int j = s->contacts; j < end; j++) D[j] = A[j] = 0.0;
            D += s->stride, A += s->stride;
        }
    }
}

/* compliance between the contacts through both gears, from the tables: of the step, or of what is not dynamic alone; the
 * rest of D and A is cleared */
static void between_contacts(const gk_setup *setup, const gk_engaged *engaged, int e, int tables)
{
    const gk_system *s = &engaged->system;
    const gk_side *side = setup->mesh[e].side;
    const int strips = GK_STRIPS(s);
    blend of[2];
    part parts[MAX_CONTACTS];
    const int count = list_parts(engaged, strips, parts);
    for (int w = 0; w < 2; w++)
        of[w] = tables ? blend_of(setup, engaged, &side[w], engaged->table[w].moves, 4)
                       : blend_of(setup, engaged, &side[w], side[w].residual, 2);
    if (tables) {
        GK_STRIPPED(strips, table_rows, engaged, &of[0], &of[1], parts, count, 1)
    } else {
        memset(s->D, 0, (size_t)(s->contacts * s->stride) * sizeof *s->D);
        GK_STRIPPED(strips, table_rows, engaged, &of[0], &of[1], parts, count, 0)
    }
    memset(s->D + s->contacts * s->stride, 0, (size_t)((s->stride - s->contacts) * s->stride) * sizeof *s->D);
    memset(s->A + s->contacts * s->stride, 0, (size_t)((s->stride - s->contacts) * s->stride) * sizeof *s->A);
}

/* rows diag(mobility) rowsᵀ and −rows diag(κ) rowsᵀ, added to D and A: for a step that has no table */
static void gram(const gk_setup *setup, gk_work *work, gk_engaged *engaged, const gk_side *side,
                 const gk_coefficients *k)
{
    gk_system *s = &engaged->system;
    const int n = GK_LANES(setup, side->gear), P = setup->modal[side->gear].pairs;
    const gk_flow *flow = &k->flow[side->gear];
    gk_real *moves = work->scaled, *yields = moves + n;
    if (!n || k->timeless) return;
    for (int i = 0; i < s->contacts; i++) {
        const gk_real *b = engaged->basis[side->which] + (size_t)i * n;
        for (int l = 0; l < n; l++) moves[l] = b[l] * flow->mobility[l], yields[l] = b[l] * flow->kappa[l];
        for (int j = 0; j < block_end(i) && j < s->contacts; j++) {
            const gk_real *other = engaged->basis[side->which] + (size_t)j * n;
            s->D[i * s->stride + j] += gk_dot(moves, other, n);
            if (flow->exact)
                s->A[i * s->stride + j] -= gk_dot(yields, other, flow->exact) +
                                           gk_dot(yields + P, other + P, flow->exact);
        }
    }
}

/* residual between contacts and the bores of their own gear, and of the bores */
GK_INLINE void joint_rows(const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e, const int strips)
{
    gk_system *s = &engaged->system;
    for (int r = s->contacts; r < s->n; r++) {
        if (!gk_rows_at_bore(setup, s, r)) continue;
        s->A[r * s->stride + r] += setup->port_own[s->port_of[r]];
        for (int w = 0; w < 2; w++) {
            const gk_side *side = &setup->mesh[e].side[w];
            const double part = engaged->position[w].part;
            const int points = side->candidates * strips;
            double *A = s->A + r * s->stride;
            if (model->gear[side->gear].rotor != model->port[s->port_of[r]].rotor) continue;
            const double *node = side->port + (size_t)engaged->position[w].node * points;
            for (int p = 0; p < engaged->places; p++, A += strips) {
                const double *low = node + engaged->place[p].candidate[w] * strips, *high = low + points;
                for (int i = 0; i < strips; i++) A[i] -= low[i] + part * (high[i] - low[i]);
            }
        }
    }
}

static void joint_residual(const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e)
{
    GK_STRIPPED(GK_STRIPS(setup), joint_rows, model, setup, engaged, e)
}

/* ---- compliance of the ground group and of the spins --------------------------------------------------------------- */
/* D += W mobility Wᵀ, A −= W κ Wᵀ over the dynamic ground oscillators, from the rows: for a step that has no table */
static void add_ground(const gk_setup *setup, gk_work *work, int e, const gk_coefficients *k)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    const int width = mesh->local;
    double *moves = work->ground_scaled, *yields = moves + width, mobility[MAX_GROUND + 4 * MAX_ROTORS],
           kappa[MAX_GROUND + 4 * MAX_ROTORS];
    if (!width || k->timeless) return;
    gk_local_gather(mesh, k->ground.mobility, mobility);
    gk_local_gather(mesh, k->ground.kappa, kappa);
    for (int i = 0; i < s->n; i++) {
        const double *row = engaged->ground + (size_t)i * width;
        for (int l = 0; l < width; l++) moves[l] = row[l] * mobility[l], yields[l] = row[l] * kappa[l];
        for (int j = 0; j < block_end(i) && j < s->n; j++) {
            const double *other = engaged->ground + (size_t)j * width;
            s->D[i * s->stride + j] += gk_dot_quads(moves, other, width / 4);
            s->A[i * s->stride + j] -= gk_dot_quads(yields, other, width / 4);
        }
    }
}

/* The same from tables: with W = −u + gΦ (u outward, g gradient, Φ rigid motion) what u alone makes is in the tables of the
 * contacts; the rest is −h gᵀ − g hᵀ, h = uMΦᵀ − ½ gΦMΦᵀ, motion by motion of both gears */
typedef struct pulled {                                           /* a motion of a gear */
    double g[MAX_STRIDE], moved[MAX_STRIDE], yielded[MAX_STRIDE]; /* h in D, in K */
} pulled;

/* motions of one gear, and what the bore of its rotor has in common with the contacts: `port`, in D and in K */
GK_INLINE void pull(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, pulled *p,
                    double port[2][MAX_STRIDE], const int quads, const int motions, const int strips)
{
    const gk_system *s = &engaged->system;
    const gk_position *at = &engaged->position[side->which];
    const gk_step_side *table = &engaged->table[side->which];
    const int points = side->candidates * strips, *motion = setup->base.motion[side->gear];
    const int bore = quads == 1 ? PLANE : SPACE, each = quads == 1 ? strips : 1; /* strips with the same gradient */
    const gk_quad *const node = (const gk_quad *)table->pulls + 2 * (size_t)(at->node * points) * quads;
    for (int m = 0; m < motions; m++)
        for (int i = s->contacts; i < s->stride; i++) p[m].g[i] = p[m].moved[i] = p[m].yielded[i] = 0.0;
    for (int place = 0, i = 0; place < engaged->places; place++) {
        const gk_place *found = &engaged->place[place];
        const gk_quad *low = node + 2 * (size_t)(found->candidate[side->which] * strips) * quads,
                      *high = low + 2 * (size_t)points * quads;
        for (int first = 0; first < strips; first += each) {
            const double *g = found->point[first].gradient + SPACE * side->which;
            gk_quad own[2][COMMON / 4] = {{{0}}};
            for (int m = 0; m < motions; m++)
                for (int kind = 0; kind < 2; kind++)
                    for (int q = 0; q < quads; q++)
                        own[kind][q] += g[motion[m]] * ((const gk_quad *)table->own[kind][motion[m]])[q];
            for (int kind = 0; kind < 2; kind++)
                for (int q = 0; q < quads; q++) own[kind][q] *= ((const gk_quad *)table->share)[q];
            for (int strip = 0; strip < each; strip++, i++, low += 2 * quads, high += 2 * quads) {
                double h[2][COMMON];
                for (int kind = 0; kind < 2; kind++)
                    for (int q = 0; q < quads; q++)
                        ((gk_quad *)h[kind])[q] = low[kind * quads + q] - own[kind][q] +
                                                  at->part * (high[kind * quads + q] - low[kind * quads + q]);
                for (int m = 0; m < motions; m++) {
                    p[m].g[i] = g[motion[m]];
                    p[m].moved[i] = h[0][motion[m]], p[m].yielded[i] = h[1][motion[m]];
                }
                port[0][i] = -h[0][bore], port[1][i] = -h[1][bore];
            }
        }
    }
}

GK_INLINE void pull_stripped(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, pulled *p,
                             double port[2][MAX_STRIDE], const int strips)
{
    const int motions = setup->base.motions[side->gear];
    if (setup->spatial)
        pull(setup, engaged, side, p, port, COMMON / 4, motions, strips);
    else if (motions == 2)
        pull(setup, engaged, side, p, port, COMMON / 8, 2, strips);
    else
        pull(setup, engaged, side, p, port, COMMON / 8, motions, strips);
}

GK_INLINE void add_pulled(gk_system *s, const pulled *p, int motions, const int quads)
{
    for (int m = 0; m < motions; m++) {
        const gk_quad *g = (const gk_quad *)p[m].g, *h = (const gk_quad *)p[m].moved,
                      *k = (const gk_quad *)p[m].yielded;
        gk_quad *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
        for (int i = 0; i < s->contacts; i++, D += quads, A += quads) {
            const double own = p[m].g[i], moved = p[m].moved[i], yielded = p[m].yielded[i];
            for (int q = 0; q <= i / 4; q++) D[q] -= moved * g[q] + own * h[q], A[q] += yielded * g[q] + own * k[q];
        }
    }
}

/* D takes mobility·R, A gives κ·R, R = Σ rowᵀrow/J over the spins that move */
GK_INLINE void add_rows(const gk_coefficients *k, const double *inverse, int spins, gk_system *s, const int quads)
{
    for (int m = 0; m < spins; m++) {
        const double moves = k->rigid_mobility * inverse[m], yields = k->rigid_kappa * inverse[m];
        const gk_quad *row = (const gk_quad *)s->rigid[m];
        gk_quad *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
        for (int i = 0; i < s->n; i++, D += quads, A += quads) {
            const double x = s->rigid[m][i], moved = moves * x, yielded = yields * x;
            if (x == 0.0) continue;
            for (int q = 0; q <= i / 4; q++) D[q] += moved * row[q], A[q] -= yielded * row[q];
        }
    }
}

static void add_spins(const gk_setup *setup, const gk_coefficients *k, gk_system *s, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    double inverse[MAX_LOCAL];
    for (int l = 0; l < mesh->spins; l++) inverse[l] = setup->inverse_inertia[mesh->spin[l]];
    GK_SIZED(s->stride / 4, add_rows, k, inverse, mesh->spins, s)
}

/* a clutch is a row of speeds, without κ; clutches are the last rows */
static void leave_clutches(gk_system *s)
{
    for (int i = s->n - s->clutches; i < s->n; i++)
        for (int j = 0; j <= i; j++) s->A[i * s->stride + j] = s->A[j * s->stride + i] = 0.0;
}

/* ground group by its tables, and spins; numbers are written one by one well before quads of them are read */
static void add_tabled(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, gk_engaged *engaged,
                       int e)
{
    gk_system *s = &engaged->system;
    const int bore = gk_directions(setup); /* among what is common */
    double port[2][2][MAX_STRIDE];
    pulled p[POSE];
    int motions = 0;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        if (!setup->base.width[side->gear]) continue;
        GK_STRIPPED(GK_STRIPS(s), pull_stripped, setup, engaged, side, p + motions, port[w])
        motions += setup->base.motions[side->gear];
    }
    add_spins(setup, k, s, e);
    GK_SIZED(s->stride / 4, add_pulled, s, p, motions)
    for (int r = s->contacts; r < s->n; r++)
        for (int w = 0; w < 2; w++) {
            const int g = setup->mesh[e].side[w].gear;
            double *D = s->D + r * s->stride, *A = s->A + r * s->stride;
            if (!setup->base.width[g] || !gk_rows_at_bore(setup, s, r) ||
                model->port[s->port_of[r]].rotor != model->gear[g].rotor)
                continue;
            for (int i = 0; i < s->contacts; i++) D[i] += port[w][0][i], A[i] -= port[w][1][i];
            D[r] += engaged->table[w].own[0][bore][bore], A[r] -= engaged->table[w].own[1][bore][bore];
        }
}

/* ---- gaps ------------------------------------------------------------------------------------------------------------ */
/* derivatives of a joint's row by the spins of the engagement; its reading of spins x */
static double joint_reading(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, gk_system *s, int i,
                            const double *x)
{
    const int port = s->port_of[i], slot = mesh->port[0] == port ? 0 : 1, chain = setup->chained[port];
    const int *chained = mesh->joint_spin[slot];
    int plus = 0, minus = -1;
    while (mesh->spin[plus] != model->port[port].rotor) plus++;
    if (s->joint_of[i] == JOINT_SHAFT) minus = chained[1];
    if (s->joint_of[i] == JOINT_CLUTCH) plus = chained[0], minus = chained[1];
    if (s->joint_of[i] == JOINT_PORT && chain) plus = chained[0];
    s->rigid[plus][i] = 1.0;
    if (minus >= 0) s->rigid[minus][i] = -1.0;
    return x[mesh->spin[plus]] - (minus >= 0 ? x[mesh->spin[minus]] : 0.0);
}

/* Undeformed gap at the predicted poses, which contain what the ground group moves the gears rigidly, minus outward elastic
 * displacement. Springs measure relative to their outer ends; clutches read half a step of slip. */
static void gaps(const gk_model *model, const gk_setup *setup, double h, gk_work *work, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    for (int d = 0; d < mesh->spins; d++) memset(s->rigid[d], 0, (size_t)s->stride * sizeof(double));
    gk_rows_read(setup, work, e, work->y, work->ground_y, s->g);
    gk_rows_without_rigid(model, setup, engaged, e, work->ground_y, s->g);
    for (int p = 0, i = 0; p < engaged->places; p++)
        for (int strip = 0; strip < GK_STRIPS(s); strip++, i++) {
            const gk_point *point = gk_point_of(setup, &engaged->place[p], strip);
            s->g[i] += point->gap;
            s->rigid[0][i] = point->gradient[PHIA], s->rigid[1][i] = point->gradient[PHIB];
        }
    for (int i = s->contacts; i < s->n; i++) {
        const int clutch = s->kind[i] == ROW_CLUTCH;
        const double reading = joint_reading(model, setup, mesh, s, i, clutch ? work->speed : work->spin);
        s->g[i] += clutch ? 0.5 * h * reading : reading;
        if (s->kind[i] == ROW_SPRING && s->joint_of[i] == JOINT_PORT) s->g[i] -= work->outer[s->port_of[i]];
    }
}

/* d/dt of the gaps that the rows read, for given speeds, at the problem formed last */
void gk_form_rates(const gk_setup *setup, gk_work *work, int e, const gk_real *const modal_speed[],
                   const double *ground_speed, const double *speed, double *rate)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_system *s = &work->engaged[e].system;
    gk_rows_read(setup, work, e, modal_speed, ground_speed, rate);
    for (int i = 0; i < s->n; i++) {
        for (int d = 0; d < mesh->spins; d++) rate[i] += s->rigid[d][i] * speed[mesh->spin[d]];
        if (s->kind[i] == ROW_SPRING && s->joint_of[i] == JOINT_PORT) rate[i] -= work->outer_speed[s->port_of[i]];
    }
}

/* ---- dampers --------------------------------------------------------------------------------------------------------- */
/* The share of a tooth's own residual that its damper is parallel to. What other contacts have in common with it stays
 * outside, so that Q = C_res − P is positive: little with the neighbours, more with the other flank of the same tooth
 * (docs/theory.md, 2.5). */
static double path_share(const gk_engaged *engaged, int p)
{
    const gk_place *place = engaged->place;
    for (int q = 0; q < engaged->places; q++)
        if (place[q].flank != place[p].flank &&
            (place[q].number[0] == place[p].number[0] || place[q].number[1] == place[p].number[1]))
            return SHARE_OF_BOTH_FLANKS;
    return SHARE;
}

/* the paths of the contacts' own dampers, both teeth; what is in P is not in A */
GK_INLINE void paths(const gk_setup *setup, gk_engaged *engaged, int e, const int strips)
{
    gk_system *s = &engaged->system;
    const int square = strips * strips;
    const gk_side *side = setup->mesh[e].side;
    const double part[2] = {engaged->position[0].part, engaged->position[1].part};
    for (int p = 0; p < engaged->places; p++) {
        double *A = s->A + (size_t)(p * strips) * (s->stride + 1), *P = s->P + (size_t)(p * strips) * (s->stride + 1);
        const double share = path_share(engaged, p), *low[2], *high[2];
        for (int w = 0; w < 2; w++) {
            low[w] = side[w].path +
                     ((size_t)engaged->position[w].node * side[w].candidates + engaged->place[p].candidate[w]) * square;
            high[w] = low[w] + side[w].candidates * square;
        }
        for (int a = 0, c = 0; a < strips; a++, A += s->stride, P += s->stride)
            for (int b = 0; b < strips; b++, c++) {
                P[b] = share * ((low[0][c] + part[0] * (high[0][c] - low[0][c])) +
                                (low[1][c] + part[1] * (high[1][c] - low[1][c])));
                A[b] -= P[b];
            }
    }
}

static void take_paths(const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    memset(s->P, 0, (size_t)(s->n * s->stride) * sizeof *s->P);
    if (GK_ON(setup, residual) && GK_ON(setup, contact_damping)) /* else no damper asks for it */
        GK_STRIPPED(GK_STRIPS(setup), paths, setup, engaged, e)
    for (int i = s->contacts; i < s->n; i++)
        s->P[i * s->stride + i] = setup->joint[s->port_of[i]][s->joint_of[i]].compliance;
}

/* Forms the problem of engagement e at its places for the step k: D, A and the paths of the rows' own dampers, P and
 * 1/k; C′ = A + P. The local law is in neither (it depends on the force). */
void gk_form_system(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                    gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    list_rows(model, setup, data, k->h, work, e);
    const size_t size = (size_t)(s->stride * s->stride + 4); /* a quad may write beyond the last row */
    const int tables = work->table_h > 0.0 && k->h == work->table_h && k->gamma == work->table_gamma &&
                       !setup->mesh[e].joined;
    s->D = engaged->matrix;
    s->A = s->D + size;
    s->P = s->A + size;
    s->J = s->P + size;
    s->L = s->J + size;
    s->B = s->L + size;
    gk_rows_form_ground(setup, work, e);
    gk_rows_form_far(setup, work, e);
    between_contacts(setup, engaged, e, tables);
    take_paths(setup, engaged, e); /* entry by entry: long before quads of the same rows are read again */
    for (int w = 0; w < 2 && !tables; w++) gram(setup, work, engaged, &setup->mesh[e].side[w], k);
    memset(s->outer, 0, (size_t)s->stride * sizeof(double));
    memset(s->beyond, 0, (size_t)s->stride * sizeof(double));
    if (GK_ON(setup, residual)) joint_residual(model, setup, engaged, e);
    gaps(model, setup, k->h, work, e);
    if (tables)
        add_tabled(model, setup, k, engaged, e);
    else
        add_ground(setup, work, e, k), add_spins(setup, k, s, e);
    leave_clutches(s);
    GK_SIZED(s->stride / 4, mirror, s)
}
