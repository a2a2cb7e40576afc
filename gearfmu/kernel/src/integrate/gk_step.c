/* One internal step of dg4 (docs/theory.md, 3). It reads like its description: predict, find, form, recall, solve, and
 * only if all is finite: correct and remember. Until `correct` nothing of gk_data changes but its expression for
 * another h, so a step that fails can be repeated with another h or scheme. */
#include "model/gk_core.h"

static const double PAYABLE =
    1e-4; /* of the energy of the massless part: what a contact that only grazes cannot repay waits */
static const double ENERGY_SMALL = 1e-300, HUGE_FORCE = 1e15; /* N: no gear lives here */
static const double MEMORY =
    0.75; /* of a dashpot's force at the end of the step: how much of the last one's goes into it (docs/theory, 3.4) */
static const double FARTHEST = 0.25 * 2.0 * GK_PI; /* a quarter of a pitch */

/* a speed of the scheme is ẋ + lead·ḟ/m (docs/theory, 3.8) */
static double speed_lead(double h, double gamma) { return h * h * (2.0 * gamma - 1.0) / 12.0; }

/* energy of the dynamic coordinates in a state expressed for k */
static double dynamic_energy(const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    const gk_real *q = data->modal;
    double sum = ENERGY_SMALL;
    for (int d = 0; d < RIGID; d++)
        if (setup->inverse_mass[d] > 0.0) sum += 0.5 * data->v[d] * data->v[d] / setup->inverse_mass[d];
    for (int g = 0; g < 2; g++) {
        const int n = GK_LANES(setup, g);
        for (int i = 0; i < n; i++) {
            const double omega = setup->modal[g].omega[i], v = q[n + i], x = q[i];
            sum += 0.5 * k->flow[g].inverse_s2[i] * (v * v + omega * omega * x * x);
        }
        q += 3 * n;
    }
    return sum;
}

/* A state of the scheme is displacement + κ f (docs/theory, 3.1): when h or γ changes, the displacement stays, and the
 * speed of free masses. At rest κ = 0. Another expression has another energy: the balance goes on from there. */
static void express(const gk_setup *setup, gk_data *data, const gk_coefficients *k)
{
    if (data->state_h == k->h && data->state_gamma == k->gamma) return;
    const gk_coefficients *old = data->state_h > 0.0 ? gk_flow_for(setup, data->state_h, data->state_gamma)
                                                     : &setup->work->explicit_rows;
    const double before = dynamic_energy(setup, data, old);
    gk_real *q = data->modal;
    for (int g = 0; g < 2; g++) {
        const int n = GK_LANES(setup, g);
        for (int i = 0; i < n; i++) q[i] += (k->flow[g].kappa[i] - old->flow[g].kappa[i]) * q[2 * n + i];
        q += 3 * n;
    }
    const double lead = data->state_h > 0.0 ? speed_lead(k->h, k->gamma) - speed_lead(data->state_h, data->state_gamma)
                                            : 0.0;
    for (int d = 0; d < RIGID; d++) data->v[d] += lead * setup->inverse_mass[d] * data->f_rate[d];
    for (int d = 0; d < RIGID; d++)
        data->x[d] += (k->rigid_kappa - old->rigid_kappa) * setup->inverse_mass[d] * data->f[d];
    data->ledger.baseline += dynamic_energy(setup, data, k) - before;
    data->state_h = k->h;
    data->state_gamma = k->gamma;
}

/* modal and rigid state one step ahead under the forces of the last step */
static void predict(const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    gk_work *work = setup->work;
    const gk_real *q = data->modal;
    for (int g = 0; g < 2; g++) {
        const int n = GK_LANES(setup, g);
        const gk_real *v = q + n, *f = v + n;
        const gk_flow *w = &k->flow[g];
        for (int i = 0; i < n; i++) {
            work->qp[g][i] = q[i] + (w->d11[i] * q[i] + w->a12[i] * v[i] + w->b0q[i] * f[i]);
            work->vp[g][i] = v[i] + (w->a21[i] * q[i] + w->d22[i] * v[i] + w->b0v[i] * f[i]);
        }
        work->y[g] = work->qp[g];
        if (k->curved_read) {
            for (int i = 0; i < n; i++)
                work->reading[g][i] = w->read_q[i] * work->qp[g][i] + w->read_v[i] * work->vp[g][i];
            work->y[g] = work->reading[g];
        }
        q += 3 * n;
    }
    for (int d = 0; d < RIGID; d++) {
        const double acceleration = data->f[d] * setup->inverse_mass[d];
        work->frame[d] = data->x[d] + k->h * data->v[d] + k->rigid_b0 * acceleration;
        work->speed[d] = data->v[d] + 0.5 * k->h * acceleration;
    }
}

/* a step may not carry a gear past its teeth: contact would not see it */
static int passable(const gk_model *model, const gk_data *data, const gk_work *work)
{
    if (model->kind == KIND_FLAT) return 1;
    for (int g = 0; g < 2; g++)
        if (!(fabs(work->frame[3 * g + 2] - data->x[3 * g + 2]) * model->gear[g].teeth < FARTHEST)) return 0;
    return 1;
}

/* entry of the memory that a tooth pair has, −1: none */
int gk_step_remembered(const gk_data *data, gk_key key)
{
    for (int i = 0; i < data->pairs; i++)
        if (data->memory[i].key.flank == key.flank && data->memory[i].key.tooth == key.tooth) return i;
    return -1;
}

/* λ0 without dashpots, settled: massless deflection and energy at the start; linear: forces of the step are (mix4) */
static void recall_forces(const gk_data *data, gk_system *s, int linear)
{
    const size_t size = (size_t)s->stride * sizeof(double);
    s->limit_reached = s->rounds = s->dashpots = 0;
    s->alpha = 0.0;
    double *const nothing[] = {s->direction, s->squeeze0, s->gain, s->pull, s->late, s->rest, s->held};
    for (size_t a = 0; a < sizeof nothing / sizeof *nothing; a++) memset(nothing[a], 0, size);
    memset(s->delta + s->contacts, 0, size - (size_t)s->contacts * sizeof(double)); /* links know no local law */
    memset(s->yield + s->contacts, 0, size - (size_t)s->contacts * sizeof(double));
    memset(s->potential + s->contacts, 0, size - (size_t)s->contacts * sizeof(double));
    memcpy(s->force, s->force0, size);
    if (linear)
        memcpy(s->begin, s->end0, size);
    else
        memset(s->begin, 0, size);
    for (int i = s->n - s->clutches; i < s->n; i++) {
        s->active[i] = (unsigned char)data->locked[s->link_of[i] - CLUTCH_0];
        s->slip[i - s->n + s->clutches] = s->g[i] > 0.0 ? -s->bound[i] : s->bound[i];
    }
    gk_law_apply(s);
    gk_solve_settle(s);
    s->stored0 = gk_solve_stored(s);
    gk_solve_lag(s, s->end0, s->dash0, s->lag0);
    s->held0 = 0.0;
    for (int i = 0; i < s->n; i++) s->held0 += s->lag0[i] * (s->force0[i] + 0.5 * s->end0[i]);
}

/* The start of the step as this step's compliance sees it: massless deflection and energy under λ0, gaps g0 = s0 − C′λ0
 * − δ(λ0); then the first guess of status and forces */
void gk_step_recall(const gk_setup *setup, const gk_data *data, gk_system *s)
{
    const gk_work *work = setup->work;
    int given = 0; /* forces that are not those of the last step */
    s->curved = GK_ON(setup, hertz) && s->contacts > 0;
    recall_forces(data, s, setup->integrator == MIX4);
    memcpy(s->squeeze0, s->squeeze, (size_t)s->stride * sizeof *s->squeeze);
    for (int i = 0; i < s->n; i++) {
        const int acted = s->dash0[i] != 0.0 && (i >= s->contacts || s->force0[i] > 0.0);
        s->beta[i] = acted ? 0.25 * (3.0 + MEMORY) : 0.5;
        s->tail[i] = acted ? -0.25 * (1.0 - MEMORY) * s->dash0[i] - MEMORY * s->end0[i] : 0.0;
        s->g0[i] = -gk_solve_massless(s, i);
        s->hold[i] = 0;
    }
    for (int i = 0; i < s->contacts; i++) {
        const int memory = work->place[s->place_of[i]].memory;
        s->g0[i] = memory < 0 ? s->g[i] : s->g0[i] + data->memory[memory].gap[i % GK_STRIPS(s)];
        s->active[i] = s->force0[i] > 0.0 || s->g[i] < 0.0;
        s->clip[i] = s->force0[i] > 0.0 && s->damping[i] > 0.0 ? 0 : 2;
    }
    for (int i = s->contacts; i < s->n; i++) {
        s->clip[i] = s->kind[i] == ROW_SPRING ? 0 : 2;
        if (s->kind[i] == ROW_SPRING) s->active[i] = 1;
        if (s->kind[i] == ROW_CLUTCH) s->g0[i] = s->g[i];
        if (s->kind[i] != ROW_TORQUE) continue;
        s->active[i] = 0;
        s->force[i] = work->torque[s->link_of[i] - PORT_0];
        given |= s->force[i] != s->force0[i];
    }
    gk_solve_status(s);
    if (given)
        gk_solve_settle(s);
    else if (s->dashpots) {
        memcpy(s->end, s->rest, (size_t)s->stride * sizeof *s->end);
        gk_solve_lag(s, s->end, s->dash, s->lag);
    }
    s->owed = data->ledger.owed;
    s->due = gk_clamp(s->owed, -PAYABLE * s->stored0, PAYABLE * s->stored0);
}

/* Tip corners off: did a pair that carried load end with its flank? */
static int flank_ended(const gk_data *data, const gk_work *work, int strips)
{
    for (int m = 0; m < data->pairs; m++) {
        double load = 0.0;
        int there = 0;
        for (int i = 0; i < strips; i++) load += data->memory[m].force[i];
        for (int p = 0; p < work->places; p++) there |= work->place[p].memory == m;
        if (load > 0.0 && !there) return 1;
    }
    return 0;
}

static int all_finite(const gk_system *s)
{
    const gk_quad *force = (const gk_quad *)s->force, *z = (const gk_quad *)s->z, *g = (const gk_quad *)s->g;
    gk_bits fine = ~(gk_bits){0};
    for (int q = 0; q < s->stride / 4; q++)
        fine &= (GK_MAGNITUDE(force[q]) < HUGE_FORCE) & (GK_MAGNITUDE(z[q]) < HUGE_FORCE) &
                (GK_MAGNITUDE(g[q]) < HUGE_FORCE);
    return (fine[0] & fine[1] & fine[2] & fine[3]) != 0;
}

/* Σ rows·x and Σ rows·y into lanes: modal forces of the row forces x and y on gear g */
void gk_step_scatter(const gk_setup *setup, int g, const double *x, const double *y, gk_real *out_x, gk_real *out_y)
{
    const gk_work *work = setup->work;
    const gk_system *s = &work->system;
    const int halves = 2 * GK_LANES(setup, g) / LANES;
    const gk_half *rows[MAX_BASIS];
    gk_half of_x[MAX_BASIS], of_y[MAX_BASIS];
    int count = 0;
    for (int r = 0; r < s->contacts + BORE_ROWS; r++) {
        const int row = r < s->contacts ? r : s->bore[g][r - s->contacts];
        if (row < 0 || (x[row] == 0.0 && y[row] == 0.0)) continue;
        const gk_real sign = r < s->contacts ? -1 : 1;
        of_x[count] = (gk_half){0} + sign * (gk_real)x[row];
        of_y[count] = (gk_half){0} + sign * (gk_real)y[row];
        rows[count++] = (const gk_half *)work->basis[g] + (size_t)r * halves;
    }
    for (int i = 0; i < halves; i++) {
        gk_half sum_x = {0}, sum_y = {0};
        for (int r = 0; r < count; r++) {
            const gk_half b = rows[r][i];
            sum_x += of_x[r] * b;
            sum_y += of_y[r] * b;
        }
        ((gk_half *)out_x)[i] = sum_x;
        ((gk_half *)out_y)[i] = sum_y;
    }
}

/* modal state to the end of the step; returns what modal damping took: work of the mean force minus change of energy,
 * mode by mode */
GK_INLINE double correct_modes(const gk_setup *setup, const gk_coefficients *k, int g, gk_real *q, const int damped)
{
    const gk_work *work = setup->work;
    const int n = GK_LANES(setup, g);
    gk_real *v = q + n, lane[LANES] = {0};
    const gk_real *f = v + n, half = (gk_real)0.5;
    const gk_flow *w = &k->flow[g];
    double sum = 0.0;
    for (int i = 0; i < n; i += LANES)
        for (int l = 0; l < LANES; l++) {
            const int j = i + l;
            const gk_real z = work->force[g][j], q1 = work->qp[g][j] + w->bq[j] * z, v1 = work->vp[g][j] + w->bv[j] * z;
            if (damped) {
                const gk_real energy = half * w->inverse_s2[j] *
                                       ((v1 - v[j]) * (v1 + v[j]) +
                                        setup->modal[g].omega2[j] * ((q1 - q[j]) * (q1 + q[j])));
                lane[l] += half * (f[j] + z) * (q1 - q[j]) - energy;
            } else { /* nothing but rounding, so it takes more digits to see */
                const double dq = (double)q1 - q[j], dv = (double)v1 - v[j], omega = setup->modal[g].omega[j];
                sum += 0.5 * (((double)f[j] + z) * dq -
                              w->inverse_s2[j] * (dv * ((double)v1 + v[j]) + omega * omega * dq * ((double)q1 + q[j])));
            }
            q[j] = q1;
            v[j] = v1;
        }
    for (int l = 0; l < LANES; l++) sum += lane[l];
    return sum;
}

static void correct(const gk_setup *setup, gk_data *data, const gk_coefficients *k)
{
    gk_work *work = setup->work;
    const gk_system *s = &work->system;
    gk_real *q = data->modal;
    double with_dashpots[MAX_STRIDE];
    const double *last = s->force; /* forces at the end that the next prediction is made with */
    if (setup->integrator == MIX4) {
        for (int q4 = 0; q4 < s->stride / 4; q4++)
            ((gk_quad *)with_dashpots)[q4] = ((const gk_quad *)s->force)[q4] + ((const gk_quad *)s->end)[q4];
        last = with_dashpots;
    }
    for (int g = 0; g < 2; g++) {
        const int n = GK_LANES(setup, g);
        if (n) {
            gk_real *next = work->reading[g];
            gk_step_scatter(setup, g, s->z, last, work->force[g], next);
            if (GK_ON(setup, modal_damping))
                data->ledger.dissipated += correct_modes(setup, k, g, q, 1);
            else
                work->system.owed -= correct_modes(setup, k, g, q, 0); /* what rounding gave or took */
            memcpy(q + 2 * n, next, (size_t)n * sizeof *next);
        }
        q += 3 * n;
    }
    const int coordinates = setup->link[SHAFT_0] || setup->link[SHAFT_1] ? RIGID : INERTIA_0;
    for (int d = 0; d < coordinates; d++) {
        const double z = gk_dot_quads(s->rigid[d], s->z, s->stride / 4);
        double force = gk_dot_quads(s->rigid[d], last, s->stride / 4);
        for (int i = s->n - s->clutches; i < s->n; i++) force -= s->rigid[d][i] * s->force[i];
        const double before = data->x[d];
        data->x[d] = work->frame[d] + k->rigid_bq * setup->inverse_mass[d] * z;
        data->v[d] = work->speed[d] + 0.5 * k->h * setup->inverse_mass[d] * z;
        data->f_rate[d] = (force - data->f[d]) / k->h;
        data->f[d] = force;
        work->moved[d] = data->x[d] - before;
    }
}

/* What ports brought in and what dashpots and clutches took in this step. A dashpot takes −½ η_d·Δgap; what its force
 * deflects elsewhere (lag) it holds as energy or gives back. */
static void account(const gk_setup *setup, gk_data *data)
{
    gk_work *work = setup->work;
    const gk_system *s = &work->system;
    double held = 0.0, taken = 0.0;
    for (int i = 0; i < s->n; i++) {
        const int link = s->link_of[i], port = link - PORT_0, clutch = link - CLUTCH_0;
        const double mean = gk_solve_mean(s, i);
        if (s->kind[i] == ROW_CLUTCH) {
            taken -= mean * (work->moved[INERTIA_0 + clutch] - work->moved[DISC_0 + clutch]);
            data->locked[clutch] = s->active[i];
            continue;
        }
        taken += mean * (s->lag[i] - s->lag0[i]) - 0.5 * s->dash[i] * (gk_solve_end_gap(s, i) - s->g0[i]);
        held += s->lag[i] * (s->force[i] + 0.5 * s->end[i]);
        if (s->kind[i] == ROW_TORQUE) {
            const double angle = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
            data->ledger.work += mean * (angle - data->angle[port]);
            data->angle[port] = angle;
        } else if (link == PORT_0 || link == PORT_1) {
            data->ledger.work += mean * (work->outer[port] - work->outer_before[port]);
        }
    }
    data->ledger.dissipated += taken - (held - s->held0);
    if (setup->work->another) data->ledger.baseline += s->stored0 + s->held0 - data->ledger.massless;
    data->ledger.massless = gk_solve_stored(s) + held;
}

void gk_step_remember(const gk_setup *setup, gk_data *data)
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    double deepest = 0.0;
    data->pairs = work->places;
    memset(data->memory, 0, sizeof data->memory);
    for (int p = 0; p < work->places; p++) data->memory[p].key = work->place[p].key;
    for (int i = 0; i < s->n; i++) {
        if (i >= s->contacts) {
            data->link[s->link_of[i]] = s->kind[i] == ROW_CLUTCH ? 0.5 * s->z[i] : s->force[i];
            data->link_dash[s->link_of[i]] = s->dash[i];
            data->link_end[s->link_of[i]] = s->end[i];
            continue;
        }
        gk_memory *m = &data->memory[s->place_of[i]];
        m->force[i % GK_STRIPS(s)] = s->force[i];
        m->gap[i % GK_STRIPS(s)] = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
        m->dash[i % GK_STRIPS(s)] = s->dash[i];
        m->end[i % GK_STRIPS(s)] = s->end[i];
        deepest = gk_max(deepest, -work->place[s->place_of[i]].gap);
        if (GK_ON(setup, hertz) && s->force[i] > s->local[s->place_of[i]].high * s->width[i]) data->status |= 1;
    }
    data->reach = 20e-6 + 0.5 * deepest; /* neighbours of a loaded tooth follow its deflection in part */
}

/* One step of length h with γ (γ = 0: em). GK_OK, or GK_DIVERGED / GK_PENETRATION with data unchanged. */
gk_outcome gk_step_once(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma)
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    const gk_coefficients *k = gk_flow_for(setup, h, gamma);
    GK_MARK(work);
    if (GK_ON(setup, elastic) && h == data->table_h && gamma == gk_limit_gamma(setup, data, h) &&
        !(h == work->table_h && gamma == work->table_gamma))
        gk_table_for(model, setup, k);
    work->another = data->expressed_h != h || data->expressed_gamma != gamma;
    express(setup, data, k);
    predict(setup, data, k);
    if (!passable(model, data, work)) return GK_DIVERGED;
    GK_LAP(work, PHASE_PREDICT);
    const double *where = GK_ON(setup, roll_motion) ? work->frame : data->still;
    work->places = GK_ON(setup, roll_motion) ? gk_flank_find(model, setup, where, data->reach, work->place)
                                             : gk_still_find(model, setup, where, work->frame, work->place);
    if (work->places < 0) return work->places = 0, GK_DIVERGED;
    for (int p = 0; p < work->places; p++) {
        work->place[p].memory = gk_step_remembered(data, work->place[p].key);
        if (work->place[p].gap < -model->overlap_max) return GK_PENETRATION;
    }
    GK_LAP(work, PHASE_FIND);
    gk_rows_form(model, setup, where, work);
    GK_LAP(work, PHASE_ROWS);
    gk_system_form(model, setup, data, k, work);
    gk_step_recall(setup, data, s);
    GK_LAP(work, PHASE_SYSTEM);
    if (setup->integrator == MIX4)
        gk_solve_plain(s);
    else
        gk_balance_solve(s);
    if (!all_finite(s)) return GK_DIVERGED;
    GK_LAP(work, PHASE_SOLVE);
    if (GK_HAS(tip_contact) && !setup->on.tip_contact && flank_ended(data, work, s->strips)) data->status |= 16;
    correct(setup, data, k);
    GK_LAP(work, PHASE_CORRECT);
    account(setup, data);
    gk_step_remember(setup, data);
    data->rounds += s->rounds;
    data->ledger.owed = s->owed;
    data->expressed_h = h, data->expressed_gamma = gamma;
    data->steps++;
    if (s->limit_reached) data->trouble++, data->status |= 4;
    GK_LAP(work, PHASE_REMEMBER);
    return GK_OK;
}

/* The scheme's invariant (eq. 11): ½ m v² + Σ (½ v² + ½ ω² q²)/s² + ½ λᵀC′λ + Σ Φ(λ), at the end of the last step; with
 * what dashpots hold */
double gk_step_energy(const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    return dynamic_energy(setup, data, k) + data->ledger.massless;
}
