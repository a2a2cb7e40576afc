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
    for (int p = 0; p < engaged->places; p++)
        for (int i = 0; i < GK_STRIPS(s); i++, s->n++) {
            const gk_place *place = &engaged->place[p];
            const gk_point *point = gk_point_of(setup, place, i);
            const double width = mesh->strip_width[i] * point->share;
            const gk_memory *memory = place->memory < 0 ? NULL : &meshing->memory[place->memory];
            s->kind[s->n] = ROW_CONTACT;
            s->port_of[s->n] = s->joint_of[s->n] = -1;
            s->place_of[s->n] = p;
            s->force0[s->n] = memory ? memory->force[i] : 0.0;
            s->end0[s->n] = memory ? memory->end[i] : 0.0;
            s->dash0[s->n] = memory ? memory->dash[i] : 0.0;
            s->damping[s->n] = GK_ON(setup, contact_damping) ? 2.0 * mesh->damping * width / h : 0.0;
            s->bound[s->n] = 0.0;
            s->weight[s->n] = width * setup->slices / model->engagement[e].width;
            s->width[s->n] = width / mesh->cosine;
            s->per_width[s->n] = mesh->cosine / width;
            if (s->own_laws || i == 0)
                gk_law_set(model, setup, mesh, point->curvature, &s->local[s->own_laws ? s->n : p]);
        }
    s->contacts = s->n;
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
    s->spring[s->n] = setup->joint[port][joint].compliance;
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
        s->g[i] = s->force0[i] = s->dash0[i] = s->end0[i] = s->spring[i] = s->width[i] = s->per_width[i] = 0.0;
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

typedef struct row_source { /* a row of the tables of one side: at two neighbouring nodes, with their weights */
    const gk_real *Q, *next_Q, *D, *next_D;
    double square_low, mixed, square_high;
    size_t columns;
} row_source;

static row_source source_of(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, const gk_real *moves,
                            int point)
{
    const gk_position *at = &engaged->position[side->which];
    const size_t columns = (size_t)side->columns, points = (size_t)(side->candidates * GK_STRIPS(setup));
    const size_t row = (size_t)at->node * points + (size_t)point;
    const double x = at->part, y = 1.0 - x;
    row_source s = {.square_low = y * y, .mixed = x * y, .square_high = x * x, .columns = columns};
    s.Q = side->residual + row * 2 * columns, s.next_Q = s.Q + points * 2 * columns;
    s.D = moves ? moves + row * 4 * columns : NULL, s.next_D = moves ? s.D + points * 4 * columns : NULL;
    return s;
}

#define WIDENED(values) GK_WIDENED(*(const gk_four *)(values))
#define SQUARE(s, table, at)                                                                                           \
    ((s).square_low * WIDENED((s).table + (at)) + (s).mixed * WIDENED((s).table + (at) + (s).columns) +                \
     (s).square_high * WIDENED((s).next_##table + (at)))

/* a row of D, −K and Q between the contacts; moves 0: of Q alone. What a quad writes beyond a run the next run writes
 * again. */
static void table_row(const row_source source[2], const run *runs, int count, int moves, double *D, double *A,
                      double *Q)
{
    const row_source p = source[0], q = source[1];
    for (int r = 0; r < count; r++)
        for (int c = 0; c < runs[r].count; c += 4) {
            const size_t a = (size_t)(runs[r].point[0] + c), b = (size_t)(runs[r].point[1] + c);
            const int to = runs[r].column + c;
            *(gk_quad *)(Q + to) = SQUARE(p, Q, a) + SQUARE(q, Q, b);
            if (!moves) continue;
            *(gk_quad *)(D + to) = SQUARE(p, D, a) + SQUARE(q, D, b);
            *(gk_quad *)(A + to) = SQUARE(p, D, a + 2 * p.columns) + SQUARE(q, D, b + 2 * q.columns);
        }
}

/* compliance between the contacts through both gears, from the tables; the rest of D, A and Q is cleared */
static void between_contacts(const gk_setup *setup, const gk_engaged *engaged, int e, const gk_real *const moves[2])
{
    const gk_system *s = &engaged->system;
    const gk_side *side = setup->mesh[e].side;
    const int strips = GK_STRIPS(s), tables = moves[0] && moves[1], from = tables ? s->contacts : 0;
    run runs[MAX_PAIRS];
    const int count = list_runs(engaged, strips, runs);
    for (int i = 0; i < s->stride; i++) {
        double *D = s->D + i * s->stride, *A = s->A + i * s->stride, *Q = s->Q + i * s->stride;
        const int contact = i < s->contacts;
        if (contact) {
            const int *candidate = engaged->place[s->place_of[i]].candidate;
            const row_source source[2] = {
                source_of(setup, engaged, &side[0], moves[0], candidate[0] * strips + i % strips),
                source_of(setup, engaged, &side[1], moves[1], candidate[1] * strips + i % strips)};
            table_row(source, runs, count, tables, D, A, Q);
        }
        const int first = contact ? from : 0, first_Q = contact ? s->contacts : 0;
        memset(D + first, 0, (size_t)(s->stride - first) * sizeof *D);
        memset(A + first, 0, (size_t)(s->stride - first) * sizeof *A);
        memset(Q + first_Q, 0, (size_t)(s->stride - first_Q) * sizeof *Q);
    }
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
        for (int j = i; j < s->contacts; j++) {
            const gk_real *other = engaged->basis[side->which] + (size_t)j * n;
            const double moved = gk_dot(moves, other, n);
            const double yielded = flow->exact
                                       ? gk_dot(yields, other, flow->exact) + gk_dot(yields + P, other + P, flow->exact)
                                       : 0.0;
            s->D[i * s->stride + j] += moved, s->A[i * s->stride + j] -= yielded;
            if (i != j) s->D[j * s->stride + i] += moved, s->A[j * s->stride + i] -= yielded;
        }
    }
}

/* residual between contacts and the bores of their own gear, and of the bores */
static void joint_residual(const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    const int strips = GK_STRIPS(s);
    for (int r = s->contacts; r < s->n; r++) {
        if (!gk_rows_at_bore(setup, s, r)) continue;
        s->Q[r * s->stride + r] += setup->port_own[s->port_of[r]];
        for (int w = 0; w < 2; w++) {
            const gk_side *side = &setup->mesh[e].side[w];
            const gk_position *at = &engaged->position[w];
            if (model->gear[side->gear].rotor != model->port[s->port_of[r]].rotor) continue;
            for (int i = 0; i < s->contacts; i++) {
                const int point = engaged->place[s->place_of[i]].candidate[w] * strips + i % strips;
                const double *t = side->port + (size_t)at->node * side->candidates * strips + point;
                const double turns = t[0] + at->part * (t[side->candidates * strips] - t[0]);
                s->Q[r * s->stride + i] -= turns, s->Q[i * s->stride + r] -= turns;
            }
        }
    }
}

/* ---- compliance of the ground group and of the spins --------------------------------------------------------------- */
/* D += W mobility Wᵀ, A −= W κ Wᵀ over the dynamic ground oscillators, from whole rows */
static void add_ground(const gk_model *model, const gk_setup *setup, gk_work *work, int e, const gk_coefficients *k)
{
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    const int width = setup->base.n, quads = width / 4;
    double *moves = work->ground_scaled, *yields = moves + width;
    if (!width || k->timeless) return;
    gk_rows_whole(model, setup, work, e);
    for (int i = 0; i < s->n; i++) {
        const double *row = engaged->ground + (size_t)i * width;
        for (int l = 0; l < width; l++)
            moves[l] = row[l] * k->ground.mobility[l], yields[l] = row[l] * k->ground.kappa[l];
        for (int j = i; j < s->n; j++) {
            const double *other = engaged->ground + (size_t)j * width;
            const double moved = gk_dot_quads(moves, other, quads), yielded = gk_dot_quads(yields, other, quads);
            s->D[i * s->stride + j] += moved, s->A[i * s->stride + j] -= yielded;
            if (i != j) s->D[j * s->stride + i] += moved, s->A[j * s->stride + i] -= yielded;
        }
    }
}

/* The same of one side from tables: with W = −u + gΦ (u outward, g gradient, Φ rigid motion) what u alone makes is in the
 * tables of the contacts; the rest is −h gᵀ − g hᵀ, h = uMΦᵀ − ½ gΦMΦᵀ */
typedef struct pulled {                                                        /* of the contacts on one side */
    double g[SPACE][MAX_STRIDE], h[2][SPACE][MAX_STRIDE], port[2][MAX_STRIDE]; /* 2: in D, in K */
    int count, of[SPACE];                                                      /* motions that the gear has */
} pulled;

GK_INLINE void pull(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, pulled *p,
                    const int directions)
{
    const gk_system *s = &engaged->system;
    const gk_position *at = &engaged->position[side->which];
    const gk_step_side *table = &engaged->table[side->which];
    const int strips = GK_STRIPS(setup), points = side->candidates * strips;
    const int common = directions == SPACE ? COMMON : COMMON / 2;
    p->count = 0;
    for (int c = 0; c < directions; c++) {
        if (table->own[0][c][c] != 0.0 || c < PHIA) p->of[p->count++] = c;
        p->g[c][s->stride - 1] = p->h[0][c][s->stride - 1] = p->h[1][c][s->stride - 1] = 0.0;
        for (int i = s->contacts; i < s->stride; i++) p->g[c][i] = p->h[0][c][i] = p->h[1][c][i] = 0.0;
    }
    for (int i = 0; i < s->contacts; i++) {
        const gk_place *place = &engaged->place[s->place_of[i]];
        const double *g = gk_point_of(setup, place, i % strips)->gradient + SPACE * side->which;
        const size_t row = (size_t)at->node * points + (size_t)(place->candidate[side->which] * strips + i % strips);
        for (int c = 0; c < directions; c++) p->g[c][i] = g[c];
        for (int kind = 0; kind < 2; kind++) {
            const double *low = table->pulls + (2 * row + (size_t)kind) * common, *high = low + 2 * points * common;
            for (int c = 0; c <= directions; c++) {
                const double u = low[c] + at->part * (high[c] - low[c]);
                double own = 0.0;
                for (int d = 0; d < directions; d++) own += g[d] * table->own[kind][c][d];
                if (c < directions)
                    p->h[kind][c][i] = u - 0.5 * own;
                else
                    p->port[kind][i] = own - u;
            }
        }
    }
}

GK_INLINE void add_pulled(gk_system *s, const pulled *p, const int quads)
{
    for (int i = 0; i < s->contacts; i++) {
        gk_quad *D = (gk_quad *)s->D + i * quads, *A = (gk_quad *)s->A + i * quads;
        for (int m = 0; m < p->count; m++) {
            const int c = p->of[m];
            const gk_quad *g = (const gk_quad *)p->g[c], *h = (const gk_quad *)p->h[0][c],
                          *k = (const gk_quad *)p->h[1][c];
            const double own = p->g[c][i], moved = p->h[0][c][i], yielded = p->h[1][c][i];
            for (int q = 0; q < quads; q++) D[q] -= moved * g[q] + own * h[q], A[q] += yielded * g[q] + own * k[q];
        }
    }
}

static void add_ground_tables(const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    const int port = gk_directions(setup); /* among what is common */
    pulled p;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        if (!setup->base.width[side->gear]) continue;
        if (setup->spatial)
            pull(setup, engaged, side, &p, SPACE);
        else
            pull(setup, engaged, side, &p, PLANE);
        GK_SIZED(s->stride / 4, add_pulled, s, &p)
        for (int r = s->contacts; r < s->n; r++) {
            if (!gk_rows_at_bore(setup, s, r) || model->port[s->port_of[r]].rotor != model->gear[side->gear].rotor)
                continue;
            const int at = r * s->stride;
            for (int i = 0; i < s->contacts; i++) {
                s->D[at + i] += p.port[0][i], s->D[i * s->stride + r] += p.port[0][i];
                s->A[at + i] -= p.port[1][i], s->A[i * s->stride + r] -= p.port[1][i];
            }
            s->D[at + r] += engaged->table[w].own[0][port][port], s->A[at + r] -= engaged->table[w].own[1][port][port];
        }
    }
}

/* row i of R = Σ rowᵀrow/J over the spins that move */
GK_INLINE void spin_row(const double *inverse, const gk_system *s, int spins, int i, gk_quad *sum, const int quads)
{
    for (int q = 0; q < quads; q++) sum[q] = (gk_quad){0};
    for (int m = 0; m < spins; m++) {
        const double *coordinate = s->rigid[m], w = inverse[m] * coordinate[i];
        if (w != 0.0)
            for (int q = 0; q < quads; q++) sum[q] += w * ((const gk_quad *)coordinate)[q];
    }
}

/* A ← A + Q; D takes mobility·R, A gives κ·R; shared: strips of a tooth pair with the same row of R */
GK_INLINE void add_rows(const gk_coefficients *k, const double *inverse, int spins, int shared, gk_system *s,
                        const int quads)
{
    gk_quad sum[MAX_STRIDE / 4], *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
    const gk_quad *Q = (const gk_quad *)s->Q;
    for (int first = 0, next; first < s->n; first = next) {
        next = first + (first < s->contacts ? shared : 1);
        spin_row(inverse, s, spins, first, sum, quads);
        for (int i = first; i < next; i++, D += quads, A += quads, Q += quads)
            for (int q = 0; q < quads; q++) D[q] += k->rigid_mobility * sum[q], A[q] += Q[q] - k->rigid_kappa * sum[q];
    }
}

/* a clutch is a row of speeds, without κ */
static void add_spins(const gk_setup *setup, const gk_coefficients *k, gk_system *s, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    double inverse[MAX_LOCAL];
    for (int l = 0; l < mesh->spins; l++) inverse[l] = setup->inverse_inertia[mesh->spin[l]];
    GK_SIZED(s->stride / 4, add_rows, k, inverse, mesh->spins, setup->spatial ? 1 : GK_STRIPS(s), s)
    for (int i = s->contacts; i < s->n; i++)
        if (s->kind[i] == ROW_CLUTCH)
            for (int j = 0; j < s->n; j++) s->A[i * s->stride + j] = s->A[j * s->stride + i] = 0.0;
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
    gk_rows_read(setup, work, e, work->y, work->ground_y, engaged->read);
    memcpy(s->g, engaged->read, (size_t)s->n * sizeof *s->g);
    for (int i = 0; i < s->contacts; i++) {
        const gk_point *p = gk_point_of(setup, &engaged->place[s->place_of[i]], i % GK_STRIPS(s));
        s->g[i] += p->gap;
        s->rigid[0][i] = p->gradient[PHIA], s->rigid[1][i] = p->gradient[PHIB];
    }
    for (int i = s->contacts; i < s->n; i++) {
        const int clutch = s->kind[i] == ROW_CLUTCH;
        const double reading = joint_reading(model, setup, mesh, s, i, clutch ? work->speed : work->spin);
        s->g[i] += clutch ? 0.5 * h * reading : reading;
        if (s->kind[i] == ROW_SPRING && s->joint_of[i] == JOINT_PORT) s->g[i] -= work->outer[s->port_of[i]];
    }
}

/* d/dt of the gaps that the rows read, for given speeds, at the problem formed last */
void gk_form_rates(const gk_model *model, const gk_setup *setup, gk_work *work, int e,
                   const gk_real *const modal_speed[], const double *ground_speed, const double *speed, double *rate)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_system *s = &work->engaged[e].system;
    gk_rows_read(setup, work, e, modal_speed, ground_speed, rate);
    gk_rows_read_rigid(model, setup, &work->engaged[e], e, ground_speed, rate);
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

/* P of a tooth pair: both teeth */
static void path_of(const gk_setup *setup, const gk_engaged *engaged, int e, int p, double *out)
{
    const int square = GK_STRIPS(setup) * GK_STRIPS(setup);
    for (int c = 0; c < square; c++) out[c] = 0.0;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        const gk_position *at = &engaged->position[w];
        const double *low = side->path +
                            ((size_t)at->node * side->candidates + engaged->place[p].candidate[w]) * square;
        const double *high = low + side->candidates * square;
        for (int c = 0; c < square; c++) out[c] += low[c] + at->part * (high[c] - low[c]);
    }
}

/* the paths of the contacts' own dampers; what is in P is not in A and Q */
static void take_paths(const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    const int strips = GK_STRIPS(s);
    for (int p = 0; p < engaged->places; p++) {
        const double share = path_share(engaged, p);
        path_of(setup, engaged, e, p, s->path[p]);
        for (int c = 0; c < strips * strips; c++) s->path[p][c] *= share;
        for (int a = 0; a < strips; a++)
            for (int b = 0; b < strips; b++) {
                const int at = (p * strips + a) * s->stride + p * strips + b;
                s->A[at] -= s->path[p][a * strips + b];
                s->Q[at] -= s->path[p][a * strips + b];
            }
    }
}

/* Forms the problem of engagement e at its places for the step k: D, A, Q and the paths of the rows' own dampers, P and
 * 1/k; C′ = A + P. The local law is in neither (it depends on the force). */
void gk_form_system(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                    gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    list_rows(model, setup, data, k->h, work, e);
    const size_t size = (size_t)(s->stride * s->stride + 4); /* a quad may write beyond the last row */
    const int tables = work->table_h > 0.0 && k->h == work->table_h && k->gamma == work->table_gamma;
    s->D = engaged->matrix;
    s->A = s->D + size;
    s->Q = s->A + size;
    s->J = s->Q + size;
    s->L = s->J + size;
    s->B = s->L + size;
    const gk_real *const moves[2] = {tables ? engaged->table[0].moves : NULL, tables ? engaged->table[1].moves : NULL};
    between_contacts(setup, engaged, e, moves);
    for (int w = 0; w < 2 && !tables; w++) gram(setup, work, engaged, &setup->mesh[e].side[w], k);
    memset(s->outer, 0, (size_t)s->stride * sizeof(double));
    memset(s->beyond, 0, (size_t)s->stride * sizeof(double));
    if (GK_ON(setup, residual)) joint_residual(model, setup, engaged, e);
    gaps(model, setup, k->h, work, e);
    if (tables)
        add_ground_tables(model, setup, engaged, e);
    else
        add_ground(model, setup, work, e, k);
    add_spins(setup, k, s, e);
    if (GK_ON(setup, residual) && GK_ON(setup, contact_damping))
        take_paths(setup, engaged, e);
    else
        memset(s->path, 0, (size_t)engaged->places * sizeof *s->path); /* no damper asks for it */
}
