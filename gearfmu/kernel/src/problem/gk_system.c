/* The small system of a step (docs/theory.md, eq. 10): which forces are unknown, what they do to the gaps within the
 * step (D) and at once through what is massless (A, P), and the gaps without them. Rows: slices of all places, then the
 * live bilateral rows (bearings, port springs, shafts, clutches). Contact forces press inward, rows measure outward: a
 * contact row is −(flank row). */
#include "model/gk_core.h"

static const double SHARE = 0.95, SHARE_OF_BOTH_FLANKS = 0.75;

/* row of the system that basis row i of gear g stands in, −1: none */
static int row_of(const gk_system *s, int g, int i) { return i < s->contacts ? i : s->bore[g][i - s->contacts]; }

/* what every basis row reads of y, B·y */
static void gather(const gk_setup *setup, const gk_work *work, int g, const gk_real *y, double *read)
{
    const int n = GK_LANES(setup, g), rows = work->system.contacts + BORE_ROWS;
    for (int i = 0; i < rows; i++)
        read[i] = n && row_of(&work->system, g, i) >= 0 ? gk_dot(work->basis[g] + (size_t)i * n, y, n) : 0.0;
}

/* B diag(mobility) Bᵀ and −B diag(κ) Bᵀ, added to D and A: for a step that has no table */
static void gram(const gk_setup *setup, gk_work *work, int g, const gk_coefficients *k, double *D, double *A)
{
    const gk_system *s = &work->system;
    const int n = GK_LANES(setup, g), P = setup->modal[g].pairs, rows = s->contacts + BORE_ROWS;
    const gk_flow *flow = &k->flow[g];
    gk_real *moves = work->scaled, *yields = moves + n;
    if (!n || (k->timeless && !flow->exact)) return;
    for (int i = 0; i < rows; i++) {
        const gk_real *b = work->basis[g] + (size_t)i * n;
        const int row = row_of(s, g, i);
        if (row < 0) continue;
        for (int l = 0; l < n; l++) moves[l] = b[l] * flow->mobility[l], yields[l] = b[l] * flow->kappa[l];
        for (int j = i; j < rows; j++) {
            const gk_real *other = work->basis[g] + (size_t)j * n;
            const int column = row_of(s, g, j);
            if (column < 0) continue;
            const double sign = (i < s->contacts) == (j < s->contacts) ? 1.0 : -1.0;
            const double moved = k->timeless ? 0.0 : sign * gk_dot(moves, other, n);
            const double yielded = flow->exact ? sign * (gk_dot(yields, other, flow->exact) +
                                                         gk_dot(yields + P, other + P, flow->exact))
                                               : 0.0;
            D[row * s->stride + column] += moved, A[row * s->stride + column] -= yielded;
            if (row != column) D[column * s->stride + row] += moved, A[column * s->stride + row] -= yielded;
        }
    }
}

static void list_contacts(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work)
{
    gk_system *s = &work->system;
    for (int p = 0; p < work->places; p++)
        for (int i = 0; i < GK_STRIPS(s); i++, s->n++) {
            const gk_place *place = &work->place[p];
            s->kind[s->n] = ROW_CONTACT;
            s->link_of[s->n] = -1;
            s->place_of[s->n] = p;
            s->force0[s->n] = place->memory < 0 ? 0.0 : data->memory[place->memory].force[i];
            s->damping[s->n] = GK_ON(setup, contact_damping) ? 2.0 * setup->damping * setup->strip_width[i] / h : 0.0;
            s->bound[s->n] = 0.0;
            s->end0[s->n] = place->memory < 0 ? 0.0 : data->memory[place->memory].end[i];
            s->dash0[s->n] = place->memory < 0 ? 0.0 : data->memory[place->memory].dash[i];
            s->weight[s->n] = setup->strip_width[i] * setup->slices / setup->width;
            s->width[s->n] = setup->strip_width[i];
            s->per_width[s->n] = 1.0 / setup->strip_width[i];
            if (i == 0) gk_law_set(model, setup, place->curvature, &s->local[p]);
        }
    s->contacts = s->n;
}

static void list_rows(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work)
{
    gk_system *s = &work->system;
    s->strips = setup->strips;
    s->n = s->clutches = 0;
    list_contacts(model, setup, data, h, work);
    for (int g = 0; g < 2; g++)
        for (int k = 0; k < BORE_ROWS; k++) s->bore[g][k] = -1;
    for (int link = GK_HAS(bearings) ? 0 : PORT_0; link < LINKS; link++) {
        if (!setup->link[link]) continue;
        const int torque = (link == PORT_0 || link == PORT_1) && setup->given_torque[link - PORT_0];
        s->kind[s->n] = link >= CLUTCH_0 ? ROW_CLUTCH : torque ? ROW_TORQUE : ROW_SPRING;
        s->link_of[s->n] = link;
        s->weight[s->n] = 1.0;
        if (link <= BEARING_1Y)
            s->bore[link / 2][link % 2] = s->n;
        else if (link <= PORT_1 ? !model->port[link - PORT_0].chain : link <= SHAFT_1)
            s->bore[(link - PORT_0) % 2][BORE_RZ] = s->n;
        s->force0[s->n] = link >= CLUTCH_0 ? 0.0 : data->link[link];
        s->end0[s->n] = data->link_end[link];
        s->dash0[s->n] = data->link_dash[link];
        s->spring[s->n] = setup->link_c[link];
        s->damping[s->n] = 2.0 * setup->link_d[link] / h;
        s->bound[s->n] = link >= CLUTCH_0 ? 2.0 * data->value[GK_OF_SHAFT(CAPACITY, link - CLUTCH_0)] : 0.0;
        s->width[s->n] = s->per_width[s->n] = 0.0;
        s->clutches += link >= CLUTCH_0;
        s->n++;
    }
    s->stride = (s->n + 3) / 4 * 4;
    for (int i = s->n; i < s->n + 4; i++)
        s->g[i] = s->force0[i] = s->dash0[i] = s->end0[i] = s->spring[i] = s->width[i] = s->per_width[i] = 0.0;
}

/* elastic part of every row from what the basis rows read, in the row's own sense */
static void elastic(const gk_system *s, double (*const read)[MAX_BASIS], double *out)
{
    for (int i = 0; i < s->contacts; i++) out[i] = -read[0][i] - read[1][i];
    for (int i = s->contacts; i < s->n; i++) out[i] = 0.0;
    for (int g = 0; g < 2; g++)
        for (int k = 0; k < BORE_ROWS; k++)
            if (s->bore[g][k] >= 0) out[s->bore[g][k]] = read[g][s->contacts + k];
}

/* what a link reads of rigid coordinates x, and its derivatives as row i */
static double link_reading(const gk_model *model, const gk_setup *setup, const gk_work *work, int link, const double *x,
                           double (*rigid)[MAX_STRIDE], int i)
{
    const int g = link <= BEARING_1Y ? link / 2 : (link - PORT_0) % 2, phi = g ? PHIB : PHIA, outer = INERTIA_0 + g,
              disc = DISC_0 + g;
    switch (link) {
    case BEARING_0X:
    case BEARING_1X:
        rigid[3 * g][i] = 1.0;
        if (setup->on.roll_motion)
            rigid[phi][i] =
                -work->read[g][work->system.contacts + BORE_Y]; /* the elastic bore displacement turns with the frame */
        return x[3 * g];
    case BEARING_0Y:
    case BEARING_1Y:
        rigid[3 * g + 1][i] = 1.0;
        if (setup->on.roll_motion) rigid[phi][i] = work->read[g][work->system.contacts + BORE_X];
        return x[3 * g + 1];
    case PORT_0:
    case PORT_1: rigid[model->port[g].chain ? outer : phi][i] = 1.0; return x[model->port[g].chain ? outer : phi];
    case SHAFT_0:
    case SHAFT_1: rigid[phi][i] = 1.0, rigid[disc][i] = -1.0; return x[phi] - x[disc];
    default: rigid[outer][i] = 1.0, rigid[disc][i] = -1.0; return x[outer] - x[disc];
    }
}

/* gaps at the predicted frames: undeformed gap minus outward elastic displacement; springs measure relative to their
 * outer ends; clutches read half a step of slip */
static void gaps(const gk_model *model, const gk_setup *setup, double h, gk_work *work)
{
    gk_system *s = &work->system;
    for (int d = 0; d < RIGID; d++) memset(s->rigid[d], 0, (size_t)s->stride * sizeof(double));
    elastic(s, work->read, s->g);
    for (int i = 0; i < s->contacts; i++) {
        const gk_place *p = &work->place[s->place_of[i]];
        s->g[i] += p->gap;
        for (int d = 0; d < INERTIA_0; d++) s->rigid[d][i] = p->gradient[d];
    }
    for (int i = s->contacts; i < s->n; i++) {
        const int port = s->link_of[i] - PORT_0;
        if (s->kind[i] == ROW_CLUTCH)
            s->g[i] += 0.5 * h * link_reading(model, setup, work, s->link_of[i], work->speed, s->rigid, i);
        else
            s->g[i] += link_reading(model, setup, work, s->link_of[i], work->frame, s->rigid, i);
        if (s->kind[i] == ROW_SPRING && port >= 0 && port < 2) s->g[i] -= work->outer[port];
    }
}

/* d/dt of the gaps that the rows read, for given modal and rigid speeds, at the system formed last */
void gk_system_rates(const gk_setup *setup, gk_work *work, const gk_real *const modal_speed[2], const double *speed,
                     double *rate)
{
    const gk_system *s = &work->system;
    for (int g = 0; g < 2; g++) gather(setup, work, g, modal_speed[g], work->read_rate[g]);
    elastic(s, work->read_rate, rate);
    for (int i = 0; i < s->n; i++) {
        const int port = s->link_of[i] - PORT_0;
        for (int d = 0; d < RIGID; d++) rate[i] += s->rigid[d][i] * speed[d];
        if (s->kind[i] == ROW_SPRING && port >= 0 && port < 2) rate[i] -= work->outer_speed[port];
    }
}

/* row i of R = Σ rowᵀrow/m over the rigid coordinates that move */
GK_INLINE void rigid_row(const gk_setup *setup, const gk_system *s, const int *moving, int count, int i, gk_quad *sum,
                         const int quads)
{
    for (int q = 0; q < quads; q++) sum[q] = (gk_quad){0};
    for (int m = 0; m < count; m++) {
        const double *coordinate = s->rigid[moving[m]], w = setup->inverse_mass[moving[m]] * coordinate[i];
        if (w != 0.0)
            for (int q = 0; q < quads; q++) sum[q] += w * ((const gk_quad *)coordinate)[q];
    }
}

/* A ← A + Q; D takes mobility·R, A gives κ·R; strips of a place share one row of R */
GK_INLINE void add_rows(const gk_setup *setup, const gk_coefficients *k, gk_system *s, const int quads)
{
    int moving[RIGID], count = 0;
    gk_quad sum[MAX_STRIDE / 4], *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
    const gk_quad *Q = (const gk_quad *)s->Q;
    for (int d = 0; d < RIGID; d++)
        if (setup->inverse_mass[d] > 0.0) moving[count++] = d;
    for (int first = 0, next; first < s->n; first = next) {
        next = first + (first < s->contacts ? GK_STRIPS(s) : 1);
        rigid_row(setup, s, moving, count, first, sum, quads);
        for (int i = first; i < next; i++, D += quads, A += quads, Q += quads)
            for (int q = 0; q < quads; q++) D[q] += k->rigid_mobility * sum[q], A[q] += Q[q] - k->rigid_kappa * sum[q];
    }
}

/* a clutch is a row of speeds, without κ */
static void add_rigid(const gk_setup *setup, const gk_coefficients *k, gk_system *s)
{
    GK_SIZED(s->stride / 4, add_rows, setup, k, s)
    for (int i = s->contacts; i < s->n; i++)
        if (s->kind[i] == ROW_CLUTCH)
            for (int j = 0; j < s->n; j++) s->A[i * s->stride + j] = s->A[j * s->stride + i] = 0.0;
}

/* The share of a tooth's own residual that its dashpot is parallel to. What other contacts have in common with it stays
 * outside, so that Q = C_res − P is positive: little with the neighbours, more with the other flank of the same tooth
 * (docs/theory.md, 2.5). */
static double path_share(const gk_work *work, int p)
{
    const gk_place *place = work->place;
    for (int q = 0; q < work->places; q++)
        if (place[q].flank != place[p].flank &&
            (place[q].number[0] == place[p].number[0] || place[q].number[1] == place[p].number[1]))
            return SHARE_OF_BOTH_FLANKS;
    return SHARE;
}

/* the paths of the contacts' own dashpots; what is in P is not in A and Q */
static void take_paths(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    gk_system *s = &work->system;
    const int strips = GK_STRIPS(s);
    for (int p = 0; p < work->places; p++) {
        const double share = path_share(work, p);
        gk_table_path(model, setup, &work->place[p], s->path[p]);
        for (int c = 0; c < strips * strips; c++) s->path[p][c] *= share;
        for (int a = 0; a < strips; a++)
            for (int b = 0; b < strips; b++) {
                const int at = (p * strips + a) * s->stride + p * strips + b;
                s->A[at] -= s->path[p][a * strips + b];
                s->Q[at] -= s->path[p][a * strips + b];
            }
    }
}

/* Forms the system at work->place for the step k: D, A, Q and the paths of the rows' own dashpots, P and 1/k; C′ = A +
 * P. The local law is in neither (it depends on the force). */
void gk_system_form(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                    gk_work *work)
{
    gk_system *s = &work->system;
    list_rows(model, setup, data, k->h, work);
    const size_t size = (size_t)(s->stride * s->stride);
    const int tables = work->table_h > 0.0 && k->h == work->table_h && k->gamma == work->table_gamma;
    s->D = work->matrix;
    s->A = s->D + size;
    s->Q = s->A + size;
    s->J = s->Q + size;
    s->L = s->J + size;
    s->B = s->L + size;
    memset(s->D, 0, 3 * size * sizeof(double));
    for (int g = 0; g < 2; g++) gather(setup, work, g, work->y[g], work->read[g]);
    if (GK_ON(setup, elastic)) {
        double *const all[KINDS] = {s->D, s->A, s->Q}, *const residual[KINDS] = {s->Q};
        const gk_table *const of_step[2] = {&work->table[0], &work->table[1]}, *const at_rest[2] = {
                                                                                   &setup->modal[0].residual,
                                                                                   &setup->modal[1].residual};
        if (tables)
            gk_table_put(model, setup, of_step, all);
        else if (GK_ON(setup, residual))
            gk_table_put(model, setup, at_rest, residual);
        for (int g = 0; g < 2 && !tables; g++) gram(setup, work, g, k, s->D, s->A);
    }
    gaps(model, setup, k->h, work);
    add_rigid(setup, k, s);
    if (GK_ON(setup, residual) && GK_ON(setup, contact_damping))
        take_paths(model, setup, work);
    else
        memset(s->path, 0, (size_t)work->places * sizeof *s->path); /* no dashpot asks for it */
}
