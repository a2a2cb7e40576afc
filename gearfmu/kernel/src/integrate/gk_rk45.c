/* rk45: Dormand–Prince 5(4) with ode45's error control (relative 1e-6, absolute 1e-9 of the largest state of its kind),
 * the paper's way, as a reference and for level paper. Explicit in the dynamic coordinates; the massless part is solved
 * in every evaluation: g + C λ + δ(λ) = 0. Local error per step ~h⁵; step limited by stability at the highest mode. */
#include "model/gk_core.h"

static const double RELATIVE = 1e-6, SMALLEST = 1e-12, POSITION = 1e-10, SPEED = 1e-6;
enum { STAGES = 7 };
static const double NODE[STAGES] = {0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1, 1};
static const double A[STAGES][6] = {{0},
                                    {0.2},
                                    {3.0 / 40, 9.0 / 40},
                                    {44.0 / 45, -56.0 / 15, 32.0 / 9},
                                    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
                                    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
                                    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
static const double ERROR[STAGES] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                     -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

/* y ← S c S y on the active rows: what dashpots c on the paths S = P + δ′ make of the rate of λ */
void gk_rk45_resist(const gk_setup *setup, const gk_system *s, double *y)
{
    double path[MAX_STRIDE];
    for (int pass = 0; pass < 2; pass++) {
        gk_solve_path(s, y, path);
        for (int i = 0; i < s->n; i++) {
            const int contact = s->kind[i] == ROW_CONTACT;
            const double c = !s->active[i] ? 0.0
                             : contact
                                 ? (GK_ON(setup, contact_damping) ? setup->damping * setup->strip_width[i % s->strips]
                                                                  : 0.0)
                                 : setup->link_d[s->link_of[i]];
            y[i] = (path[i] + s->slope[i] * y[i]) * (pass ? s->active[i] : c);
        }
    }
}

/* Dashpots on the rows' paths P + δ in series with A: with λ̇ = −J⁻¹ġ, J = A + S, their force is S c S λ̇, passed on
 * through J⁻¹ (first order in c; A does not follow its rate). Contacts never pull. */
static void add_dashpots(const gk_setup *setup, gk_system *s, const double *rate)
{
    double y[MAX_STRIDE];
    gk_tangent_factorise(s); /* at the λ found */
    for (int i = 0; i < s->stride; i++) y[i] = i < s->n && s->active[i] ? -rate[i] : 0.0;
    gk_tangent_solve(s, y);
    gk_rk45_resist(setup, s, y);
    gk_tangent_solve(s, y);
    for (int i = 0; i < s->n; i++) {
        if (!s->active[i]) continue;
        const double dashpot = s->kind[i] == ROW_CONTACT ? gk_clamp(y[i], -s->force[i], s->force[i]) : y[i];
        s->z[i] = s->force[i] + dashpot;
        s->eta[i] = 2.0 * dashpot; /* reported force: λ + η/2 */
    }
}

/* forces and accelerations at work->trial, trial_rigid; 0 when they are not finite; outer ends at `part` of the step;
 * result in stage i */
int gk_rk45_evaluate(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k, int i,
                     const double outer[2])
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    const gk_real *speed[2];
    double rate[MAX_ROWS];
    for (int d = 0; d < RIGID; d++)
        work->frame[d] = work->trial_rigid[d], work->speed[d] = work->trial_rigid[RIGID + d];
    for (int g = 0; g < 2; g++) {
        work->y[g] = work->trial[g];
        speed[g] = work->trial[g] + setup->modal[g].n;
        work->outer[g] = outer[g];
    }
    const double *where = setup->on.roll_motion ? work->frame : data->still;
    work->places = setup->on.roll_motion ? gk_flank_find(model, setup, where, gk_max(data->reach, 50e-6), work->place)
                                         : gk_still_find(model, setup, where, work->frame, work->place);
    if (work->places < 0) return work->places = 0, 0;
    for (int p = 0; p < work->places; p++) work->place[p].memory = gk_step_remembered(data, work->place[p].key);
    gk_rows_form(model, setup, where, work);
    gk_system_form(model, setup, data, k, work);
    for (int r = 0; r < s->contacts; r++) s->damping[r] = 0.0;
    gk_step_recall(setup, data, s);
    for (int r = 0; r < s->n; r++)
        if (s->kind[r] == ROW_SPRING) s->clip[r] = 2;
    gk_solve_status(s);
    gk_solve_plain(s);
    gk_system_rates(setup, work, speed, work->speed, rate);
    add_dashpots(setup, s, rate);
    for (int d = 0; d < RIGID; d++) {
        double force = 0.0;
        for (int r = 0; r < s->n; r++) force += s->rigid[d][r] * s->z[r];
        work->stage_rigid[i][d] = work->speed[d];
        work->stage_rigid[i][RIGID + d] = force * setup->inverse_mass[d];
    }
    for (int g = 0; g < 2; g++) {
        const gk_modal *m = &setup->modal[g];
        gk_real *v = work->stage[g][i], *a = v + m->n;
        if (m->n) gk_step_scatter(setup, g, s->z, s->z, work->force[g], work->reading[g]);
        for (int j = 0; j < m->n; j++) {
            const gk_real zeta = GK_ON(setup, modal_damping) ? (gk_real)(2.0 * m->zeta[j] * m->omega[j]) : 0;
            v[j] = speed[g][j];
            a[j] = work->force[g][j] - zeta * speed[g][j] - m->omega2[j] * work->trial[g][j];
        }
    }
    double check = 0.0;
    for (int d = 0; d < 2 * RIGID; d++) check += work->stage_rigid[i][d] * 0.0;
    return check == 0.0;
}

/* trial = state + h Σ weight_i stage_i over the first `count` stages */
static void combine(const gk_setup *setup, const gk_data *data, const double *weight, int count, double h)
{
    gk_work *work = setup->work;
    const gk_real *q = data->modal;
    for (int d = 0; d < RIGID; d++) {
        double x = 0.0, v = 0.0;
        for (int i = 0; i < count; i++)
            x += weight[i] * work->stage_rigid[i][d], v += weight[i] * work->stage_rigid[i][RIGID + d];
        work->trial_rigid[d] = data->x[d] + h * x;
        work->trial_rigid[RIGID + d] = data->v[d] + h * v;
    }
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        for (int j = 0; j < 2 * n; j++) {
            gk_real sum = 0;
            for (int i = 0; i < count; i++) sum += (gk_real)weight[i] * work->stage[g][i][j];
            work->trial[g][j] = q[j] + (gk_real)h * sum;
        }
        q += 3 * n;
    }
}

/* largest local error over tolerance; positions and speeds each measured against the largest of their kind */
static double error_ratio(const gk_setup *setup, const gk_data *data, double h)
{
    const gk_work *work = setup->work;
    const gk_real *q = data->modal;
    double worst = 0.0;
    for (int half = 0; half < 2; half++) {
        double scale = half ? SPEED : POSITION, error = 0.0;
        for (int g = 0; g < 2; g++) {
            const int n = setup->modal[g].n;
            const gk_real *state = q + (g ? 3 * setup->modal[0].n : 0) + half * n;
            for (int j = 0; j < n; j++) {
                double e = 0.0;
                for (int i = 0; i < STAGES; i++) e += ERROR[i] * work->stage[g][i][half * n + j];
                error = gk_max(error, fabs(h * e));
                scale = gk_max(scale, RELATIVE * fabs((double)state[j]));
            }
        }
        worst = gk_max(worst, error / scale);
        for (int d = half * RIGID; d < (half + 1) * RIGID; d++) {
            double e = 0.0;
            for (int i = 0; i < STAGES; i++) e += ERROR[i] * work->stage_rigid[i][d];
            worst = gk_max(worst, fabs(h * e) / (half ? 1e-6 : 1e-11));
        }
    }
    return worst;
}

static void keep(const gk_setup *setup, gk_data *data)
{
    const gk_work *work = setup->work;
    gk_real *q = data->modal;
    for (int d = 0; d < RIGID; d++) {
        data->x[d] = work->trial_rigid[d];
        data->v[d] = work->trial_rigid[RIGID + d];
    }
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        memcpy(q, work->trial[g], 2 * (size_t)n * sizeof *q);
        q += 3 * n;
    }
}

/* angles of the bores with a given torque, massless part included */
void gk_rk45_angles(const gk_setup *setup, gk_data *data)
{
    const gk_system *s = &setup->work->system;
    for (int i = s->contacts; i < s->n; i++)
        if (s->kind[i] == ROW_TORQUE)
            data->angle[s->link_of[i] - PORT_0] = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
}

/* Over h, in as many inner steps as the error control wants; outer ends move linearly between outer_before and outer.
 * GK_OK or GK_DIVERGED. */
gk_outcome gk_rk45_advance(const gk_model *model, const gk_setup *setup, gk_data *data, double h)
{
    gk_work *work = setup->work;
    const gk_coefficients *k = &work->explicit_rows;
    const double from[2] = {work->outer_before[0], work->outer_before[1]}, to[2] = {work->outer[0], work->outer[1]};
    double done = 0.0, step = data->rk_h > 0.0 ? gk_min(data->rk_h, h) : 1e-3 * h;
    for (int g = 0; g < 2; g++) work->outer_speed[g] = (to[g] - from[g]) / h;
    while (done < h) {
        step = gk_min(step, h - done);
        int good = 1;
        for (int i = 0; i < STAGES && good; i++) {
            combine(setup, data, A[i], i, step);
            const double part = (done + NODE[i] * step) / h,
                         outer[2] = {from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])};
            good = gk_rk45_evaluate(model, setup, data, k, i, outer);
        }
        const double ratio = good ? error_ratio(setup, data, step) : 32.0;
        const double factor = gk_clamp(ratio > 0.0 ? 0.8 * gk_exp(-0.2 * gk_log(ratio)) : 5.0, 0.2, 5.0);
        if (ratio <= 1.0) {
            keep(setup, data);
            done = done + step >= h * (1.0 - 1e-12) ? h : done + step;
            data->steps++;
        } else if (step < SMALLEST) {
            return GK_DIVERGED;
        }
        if (done < h || ratio > 1.0) step *= factor;
        if (ratio <= 1.0 && done < h) data->rk_h = step;
    }
    for (int g = 0; g < 2; g++) work->outer_before[g] = from[g], work->outer[g] = to[g];
    gk_step_remember(setup, data);
    gk_rk45_angles(setup, data);
    memcpy(work->system.force0, work->system.z, sizeof work->system.z); /* the mean over so short a time is its end */
    return GK_OK;
}
