/* One internal step of dg4 (docs/theory.md, 3). It reads like its description: predict, find, form, recall, solve, and only if all is finite: correct and remember.
 * Until `correct` nothing of gk_data changes but its expression for another h, so a step that fails can be repeated with another h or scheme. */
#include "gk_core.h"

static const double PAYABLE = 1e-4; /* of the energy of the massless part: what a contact that only grazes cannot repay waits */
static const double ENERGY_SMALL = 1e-300, HUGE_FORCE = 1e15; /* N: no gear lives here */
static const double FARTHEST = 0.25 * 2.0 * GK_PI; /* a quarter of a pitch */

/* a speed of the scheme is ẋ + lead·ḟ/m (docs/theory, 3.8) */
static double speed_lead(double h, double gamma) { return h * h * (2.0 * gamma - 1.0) / 12.0; }

/* A state of the scheme is displacement + κ f (docs/theory, 3.1): when h or γ changes, the displacement stays, and the speed of free masses. At rest κ = 0. */
static void express(const gk_setup *setup, gk_data *data, const gk_coefficients *k)
{
    if (data->state_h == k->h && data->state_gamma == k->gamma) return;
    const gk_coefficients *old = data->state_h > 0.0 ? gk_flow_for(setup, data->state_h, data->state_gamma) : &setup->work->explicit_rows;
    gk_real *q = data->modal;
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        for (int i = 0; i < n; i++) q[i] += (k->flow[g].kappa[i] - old->flow[g].kappa[i]) * q[2 * n + i];
        q += 3 * n;
    }
    const double lead = data->state_h > 0.0 ? speed_lead(k->h, k->gamma) - speed_lead(data->state_h, data->state_gamma) : 0.0;
    for (int d = 0; d < RIGID; d++) data->v[d] += lead * setup->inverse_mass[d] * data->f_rate[d];
    for (int d = 0; d < RIGID; d++) data->x[d] += (k->rigid_kappa - old->rigid_kappa) * setup->inverse_mass[d] * data->f[d];
    data->state_h = k->h;
    data->state_gamma = k->gamma;
}

/* modal and rigid state one step ahead under the forces of the last step */
static void predict(const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    gk_work *work = setup->work;
    const gk_real *q = data->modal;
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        const gk_real *v = q + n, *f = v + n;
        const gk_flow *w = &k->flow[g];
        for (int i = 0; i < n; i++) {
            work->qp[g][i] = q[i] + (w->d11[i] * q[i] + w->a12[i] * v[i] + w->b0q[i] * f[i]);
            work->vp[g][i] = v[i] + (w->a21[i] * q[i] + w->d22[i] * v[i] + w->b0v[i] * f[i]);
        }
        work->y[g] = work->qp[g];
        if (k->curved_read) {
            for (int i = 0; i < n; i++) work->reading[g][i] = w->read_q[i] * work->qp[g][i] + w->read_v[i] * work->vp[g][i];
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

static int remembered(const gk_data *data, gk_key key)
{
    for (int i = 0; i < data->pairs; i++)
        if (data->memory[i].key.flank == key.flank && data->memory[i].key.tooth == key.tooth) return i;
    return -1;
}

/* status and forces at the start of the step; gaps as this step's C′ sees them: g0 = s0 − C′λ0 − δ(λ0) */
void gk_step_recall(const gk_setup *setup, const gk_data *data, gk_system *s)
{
    s->limit_reached = s->rounds = s->rank = 0;
    s->alpha = s->stored0 = 0.0;
    memset(s->direction, 0, sizeof s->direction);
    s->curved = setup->on.hertz && s->contacts > 0;
    for (int i = 0; i < s->n; i++) {
        const double *c = s->C + (size_t)i * s->n;
        const double *kappa = s->K + (size_t)i * s->n;
        double sum = 0.0, plain = 0.0, approach = 0.0, slope;
        const int link = s->link_of[i];
        for (int j = 0; j < s->n; j++) sum += c[j] * s->force0[j], plain += kappa[j] * s->force0[j];
        if (s->kind[i] == ROW_CONTACT && s->force0[i] > 0.0) approach = gk_law_approach(&s->local[i], s->force0[i], &slope);
        s->squeeze0[i] = sum + plain + approach;
        s->stored0 += 0.5 * sum * s->force0[i] + (s->kind[i] == ROW_CONTACT && s->force0[i] > 0.0 ? gk_law_energy(&s->local[i], s->force0[i]) : 0.0);
        s->force[i] = s->z[i] = s->force0[i];
        s->eta[i] = 0.0;
        s->clip[i] = 2;
        s->g0[i] = -sum;
        s->active[i] = s->kind[i] == ROW_SPRING;
        switch (s->kind[i]) {
        case ROW_CONTACT: {
            const gk_place *p = &setup->work->place[s->place_of[i]];
            const gk_memory *m = p->memory < 0 ? NULL : &data->memory[p->memory];
            s->g0[i] = m ? m->gap[i % s->strips] - sum - approach : s->g[i];
            s->active[i] = s->force0[i] > 0.0 || s->g[i] < 0.0;
            if (s->force0[i] > 0.0 && s->damping[i] > 0.0) s->clip[i] = 0;
            break;
        }
        case ROW_SPRING: s->clip[i] = 0; break;
        case ROW_TORQUE: s->force[i] = s->z[i] = setup->work->torque[link - PORT_0]; break;
        case ROW_CLUTCH:
            s->g0[i] = s->g[i];
            s->active[i] = (unsigned char)data->locked[link - CLUTCH_0];
            s->force[i] = 0.0;
            s->z[i] = s->active[i] ? 0.0 : s->g[i] > 0.0 ? -s->bound[i] : s->bound[i];
        }
    }
    s->owed = data->ledger.owed;
    s->due = gk_clamp(s->owed, -PAYABLE * s->stored0, PAYABLE * s->stored0);
}

static int all_finite(const gk_system *s)
{
    for (int i = 0; i < s->n; i++)
        if (!(fabs(s->force[i]) < HUGE_FORCE && fabs(s->z[i]) < HUGE_FORCE && fabs(s->g[i]) < HUGE_FORCE)) return 0;
    return 1;
}

/* Σ rows·x into lanes: modal force of the row forces x on gear g */
void gk_step_scatter(const gk_setup *setup, int g, const double *x, gk_real *out)
{
    const gk_work *work = setup->work;
    const gk_system *s = &work->system;
    const int n = setup->modal[g].n;
    memset(out, 0, (size_t)n * sizeof *out);
    for (int r = 0; r < s->contacts + BORE_ROWS; r++) {
        const int row = r < s->contacts ? r : s->bore[g][r - s->contacts];
        if (row < 0 || x[row] == 0.0) continue;
        const gk_real w = (gk_real)(r < s->contacts ? -x[row] : x[row]), *b = work->basis[g] + (size_t)r * n;
        for (int i = 0; i < n; i++) out[i] += w * b[i];
    }
}

/* modal state to the end of the step; returns what modal damping took: work of the mean force minus change of energy, mode by mode */
static double correct_modes(const gk_setup *setup, const gk_coefficients *k, int g, gk_real *q)
{
    const gk_work *work = setup->work;
    const int n = setup->modal[g].n;
    gk_real *v = q + n, lane[LANES] = {0};
    const gk_real *f = v + n, half = (gk_real)0.5;
    const gk_flow *w = &k->flow[g];
    for (int i = 0; i < n; i += LANES)
        for (int l = 0; l < LANES; l++) {
            const int j = i + l;
            const gk_real z = work->force[g][j], q1 = work->qp[g][j] + w->bq[j] * z, v1 = work->vp[g][j] + w->bv[j] * z;
            const gk_real energy = half * w->inverse_s2[j] * ((v1 - v[j]) * (v1 + v[j]) + setup->modal[g].omega2[j] * ((q1 - q[j]) * (q1 + q[j])));
            lane[l] += half * (f[j] + z) * (q1 - q[j]) - energy;
            q[j] = q1;
            v[j] = v1;
        }
    double sum = 0.0;
    for (int l = 0; l < LANES; l++) sum += lane[l];
    return sum;
}

static void correct(const gk_setup *setup, gk_data *data, const gk_coefficients *k)
{
    gk_work *work = setup->work;
    const gk_system *s = &work->system;
    gk_real *q = data->modal;
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        if (n) {
            gk_step_scatter(setup, g, s->z, work->force[g]);
            double lost = correct_modes(setup, k, g, q);
            if (setup->on.modal_damping) data->ledger.dissipated += lost;
            gk_step_scatter(setup, g, s->force, q + 2 * n);
        }
        q += 3 * n;
    }
    for (int d = 0; d < RIGID; d++) {
        double z = 0.0, force = 0.0;
        for (int i = 0; i < s->n; i++) {
            z += s->rigid[i][d] * s->z[i];
            if (s->kind[i] != ROW_CLUTCH) force += s->rigid[i][d] * s->force[i];
        }
        const double before = data->x[d];
        data->x[d] = work->frame[d] + k->rigid_bq * setup->inverse_mass[d] * z;
        data->v[d] = work->speed[d] + 0.5 * k->h * setup->inverse_mass[d] * z;
        data->f_rate[d] = (force - data->f[d]) / k->h;
        data->f[d] = force;
        work->moved[d] = data->x[d] - before;
    }
}

/* what ports brought in and what dashpots and clutches took in this step */
static void account(const gk_setup *setup, gk_data *data)
{
    gk_work *work = setup->work;
    const gk_system *s = &work->system;
    for (int i = 0; i < s->n; i++) {
        const int link = s->link_of[i], port = link - PORT_0, clutch = link - CLUTCH_0;
        const double mean = 0.5 * (s->force0[i] + s->z[i]);
        switch (s->kind[i]) {
        case ROW_CLUTCH:
            data->ledger.dissipated -= mean * (work->moved[INERTIA_0 + clutch] - work->moved[DISC_0 + clutch]);
            data->locked[clutch] = s->active[i];
            break;
        case ROW_TORQUE: {
            const double angle = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
            data->ledger.work += mean * (angle - data->angle[port]);
            data->angle[port] = angle;
            break;
        }
        default:
            if (s->active[i] && s->clip[i] != 2) data->ledger.dissipated -= 0.5 * (s->eta[i] - s->alpha * s->direction[i]) * (gk_solve_end_gap(s, i) - s->g0[i]);
            if (link == PORT_0 || link == PORT_1) data->ledger.work += mean * (work->outer[port] - work->outer_before[port]);
        }
    }
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
            continue;
        }
        gk_memory *m = &data->memory[s->place_of[i]];
        m->force[i % s->strips] = s->force[i];
        m->gap[i % s->strips] = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
        deepest = gk_max(deepest, -work->place[s->place_of[i]].gap);
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
    express(setup, data, k);
    predict(setup, data, k);
    if (!passable(model, data, work)) return GK_DIVERGED;
    GK_LAP(work, PHASE_PREDICT);
    const double *where = setup->on.roll_motion ? work->frame : data->still;
    work->places = setup->on.roll_motion ? gk_flank_find(model, setup, where, data->reach, work->place) : gk_still_find(model, setup, where, work->frame, work->place);
    if (work->places < 0) return work->places = 0, GK_DIVERGED;
    for (int p = 0; p < work->places; p++) {
        work->place[p].memory = remembered(data, work->place[p].key);
        if (work->place[p].gap < -model->overlap_max) return GK_PENETRATION;
    }
    GK_LAP(work, PHASE_FIND);
    gk_rows_form(model, setup, where, work);
    GK_LAP(work, PHASE_ROWS);
    gk_system_form(model, setup, data, k, work);
    gk_step_recall(setup, data, s);
    GK_LAP(work, PHASE_SYSTEM);
    if (setup->integrator == MIX4) gk_solve_plain(s);
    else gk_solve_energy(s);
    if (!all_finite(s)) return GK_DIVERGED;
    GK_LAP(work, PHASE_SOLVE);
    correct(setup, data, k);
    GK_LAP(work, PHASE_CORRECT);
    account(setup, data);
    gk_step_remember(setup, data);
    data->rounds += s->rounds;
    data->ledger.owed = s->owed;
    data->steps++;
    if (s->limit_reached) data->trouble++, data->status |= 4;
    GK_LAP(work, PHASE_REMEMBER);
    return GK_OK;
}

/* The scheme's invariant (eq. 11): ½ m v² + Σ (½ v² + ½ ω² q²)/s² + ½ λᵀC′λ + Σ Φ(λ), at the system of the last step */
double gk_step_energy(const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    const gk_system *s = &setup->work->system;
    const gk_real *q = data->modal;
    double sum = ENERGY_SMALL;
    for (int d = 0; d < RIGID; d++)
        if (setup->inverse_mass[d] > 0.0) sum += 0.5 * data->v[d] * data->v[d] / setup->inverse_mass[d];
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        for (int i = 0; i < n; i++) {
            const double omega = setup->modal[g].omega[i], v = q[n + i], x = q[i];
            sum += 0.5 * k->flow[g].inverse_s2[i] * (v * v + omega * omega * x * x);
        }
        q += 3 * n;
    }
    return sum + gk_solve_stored(s, s->force);
}
