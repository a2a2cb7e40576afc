/* rk45: Dormand–Prince 5(4) with ode45's error control (relative 1e-6, absolute 1e-9 of the largest state of its kind),
 * the paper's way, as a reference and for level paper. Explicit in the dynamic coordinates; the quasi-static part is
 * solved in every evaluation: g + C λ + δ(λ) = 0. Local error per step ~h⁵; step limited by stability at the highest
 * mode. */
#include "integrate/gk_integrate.h"
#include "problem/gk_nodal.h"
#include "problem/gk_exchange.h"

static const double RELATIVE = 1e-6, SMALLEST = 1e-12, POSITION = 1e-10, SPEED = 1e-6;
enum { STAGES = 7, TRIALS = 20000 };
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
void gk_rk45_resist(const gk_setup *setup, const gk_mesh *mesh, const gk_system *s, double *y)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(y);
    double path[MAX_STRIDE];
    for (int pass = 0; pass < 2; pass++) {
        gk_solve_path(s, y, path);
        for (int i = 0; i < s->n; i++) {
            const double of_strip = GK_ON(setup, contact_damping) ? mesh->damping * mesh->cosine * s->flank.width[i]
                                                                  : 0.0;
            const double c = !s->active[i]     ? 0.0
                             : i < s->contacts ? of_strip
                                               : setup->joint[s->joint.port[i]][s->joint.which[i]].damping;
            y[i] = (path[i] + s->local.slope[i] * y[i]) * (pass ? s->active[i] : c);
        }
    }
}

/* Dashpots on the rows' paths P + δ in series with A: with λ̇ = −J⁻¹ġ, J = A + S, their force is S c S λ̇, passed on
 * through J⁻¹ (first order in c; A does not follow its rate). Contacts never pull. */
static void add_dashpots(const gk_setup *setup, const gk_mesh *mesh, gk_system *s, const double *rate)
{
    double y[MAX_STRIDE];
    gk_tangent_factorise(s); /* at the λ found */
    for (int i = 0; i < s->stride; i++) y[i] = i < s->n && s->active[i] ? -rate[i] : 0.0;
    gk_tangent_solve(s, y);
    gk_rk45_resist(setup, mesh, s, y);
    gk_tangent_solve(s, y);
    for (int i = 0; i < s->n; i++) {
        if (!s->active[i]) continue;
        const double dashpot = i < s->contacts ? gk_clamp(y[i], -s->force[i], s->force[i]) : y[i];
        s->z[i] = s->force[i] + dashpot;
        s->dashpot.end[i] = dashpot;
    }
}

/* problem of an engagement at the trial state; 0 when the poses mean nothing */
static int engage(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e)
{
    const gk_search how = {.k = &work->room.explicit_rows, .reach = 50e-6};
    gk_system *s = &work->engaged[e].system;
    if (!gk_engage(model, setup, work, data, &how, e)) return 0;
    for (int r = 0; r < s->contacts; r++) s->dashpot.coefficient[r] = 0.0;
    if (setup->nodal) gk_nodal_leave(s);
    gk_memory_recall(model, setup, work, data, e);
    for (int r = s->contacts; r < s->n; r++) s->dashpot.clip[r] = 2;
    gk_solve_status(s);
    return 1;
}

/* contacts of all engagements at the trial state, then what dashpots add */
static void solve_contacts(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_real *const speed[])
{
    double rate[MAX_STRIDE];
    for (int e = 0; e < model->engagements && GK_ON(setup, film); e++) {
        gk_form_rates(setup, work, e, speed, work->ground_trial + setup->base.n, work->speed, rate);
        gk_film_begin_rates(setup, work, e, rate);
    }
    for (int i = 0; i < setup->islands; i++) {
        gk_coupled coupled = {.model = model,
                              .setup = setup,
                              .work = work,
                              .k = &work->room.explicit_rows,
                              .island = i,
                              .rate = GK_FIRST_RATE};
        const gk_island island = gk_couple_island(&coupled);
        gk_balance_plain(&island);
    }
    for (int e = 0; e < model->engagements; e++) {
        gk_form_rates(setup, work, e, speed, work->ground_trial + setup->base.n, work->speed, rate);
        add_dashpots(setup, &setup->mesh[e], &work->engaged[e].system, rate);
    }
}

static void spin_rates(const gk_model *model, const gk_setup *setup, gk_work *work, int i)
{
    double force[MAX_SPINS] = {0};
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int l = 0; l < setup->mesh[e].spins; l++)
            for (int r = 0; r < s->n; r++) force[setup->mesh[e].spin[l]] += s->rigid[l][r] * s->z[r];
    }
    for (int d = 0; d < setup->spins; d++) {
        work->stage_spin[i][d] = work->speed[d];
        work->stage_spin[i][MAX_SPINS + d] = force[d] * setup->inverse_inertia[d];
    }
}

/* accelerations of the ground group, its dashpots explicit */
static void ground_rates(const gk_model *model, const gk_setup *setup, gk_work *work, int i)
{
    const gk_base *base = &setup->base;
    const int n = base->n;
    const double *x = work->ground_trial, *speed = x + n;
    double *v = work->ground_stage[i], *a = v + n;
    for (int j = 0; j < n; j++) {
        const double damping = GK_ON(setup, modal_damping) ? 2.0 * base->zeta[j] * base->omega[j] : 0.0;
        v[j] = speed[j];
        a[j] = work->ground_force[j] - damping * speed[j] - base->omega2[j] * x[j];
    }
    for (int d = 0; d < model->supports; d++) {
        const double *e = base->damper_rows + d * n, c = model->ground[base->set].damper[d];
        const double force = n && c > 0.0 ? c * gk_dot_quads(e, speed, n / 4) : 0.0;
        for (int j = 0; j < n; j++) a[j] -= force * e[j];
    }
    gk_frame_rates(model, setup, work->speed, speed, a);
}

/* forces and accelerations at the trial state; 0 when they are not finite; outer ends given; result in stage i */
int gk_rk45_evaluate(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int i,
                     const double *outer)
{
    GK_ASSERT(i >= 0 && i < STAGES && outer);
    const gk_real *speed[MAX_GEARS];
    double check = 0.0;
    for (int d = 0; d < setup->spins; d++)
        work->spin[d] = work->trial_spin[d], work->speed[d] = work->trial_spin[MAX_SPINS + d];
    for (int g = 0; g < model->gears; g++) work->y[g] = work->trial[g], speed[g] = work->trial[g] + setup->modal[g].n;
    for (int p = 0; p < model->ports; p++) work->outer[p] = outer[p];
    work->ground_y = work->ground_trial;
    for (int e = 0; e < model->engagements; e++)
        if (!engage(model, setup, work, data, e)) return 0;
    solve_contacts(model, setup, work, speed);
    spin_rates(model, setup, work, i);
    gk_exchange_scatter(model, setup, work, gk_step_z, gk_step_z);
    if (setup->nodal) gk_nodal_press(model, setup, work, data, speed, work->stage_spin[i] + MAX_SPINS);
    ground_rates(model, setup, work, i);
    for (int g = 0; g < model->gears; g++) {
        const gk_modal *m = &setup->modal[g];
        gk_real *v = work->stage[g][i], *a = v + m->n;
        for (int j = 0; j < m->n; j++) {
            const gk_real damping = GK_ON(setup, modal_damping) ? (gk_real)(2.0 * m->zeta[j] * m->omega[j]) : 0;
            v[j] = speed[g][j];
            a[j] = work->force[g][j] - damping * speed[g][j] - m->omega2[j] * work->trial[g][j];
        }
        if (GK_HAS(gyroscopic) && m->turns) gk_frame_gear_rates(m, work->speed[model->gear[g].rotor], speed[g], a);
    }
    for (int d = 0; d < setup->spins; d++) check += (work->stage_spin[i][d] + work->stage_spin[i][MAX_SPINS + d]) * 0.0;
    return check == 0.0;
}

int gk_rk45_overlaps(const gk_model *model, const gk_work *work)
{
    int found = 0;
    for (int e = 0; e < model->engagements; e++) found |= gk_engage_overlaps(model, work, e);
    return found;
}

/* trial = state + h Σ weight_i stage_i over the first `count` stages */
static void combine(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                    const double *weight, int count, double h)
{
    const double *ground = gk_ground_seen(data);
    for (int d = 0; d < setup->spins; d++) {
        double x = 0.0, v = 0.0;
        for (int i = 0; i < count; i++)
            x += weight[i] * work->stage_spin[i][d], v += weight[i] * work->stage_spin[i][MAX_SPINS + d];
        work->trial_spin[d] = GK_OF(data, x)[d] + h * x;
        work->trial_spin[MAX_SPINS + d] = GK_OF(data, v)[d] + h * v;
    }
    for (int j = 0; j < 2 * setup->base.n; j++) {
        double sum = 0.0;
        for (int i = 0; i < count; i++) sum += weight[i] * work->ground_stage[i][j];
        work->ground_trial[j] = ground[j] + h * sum;
    }
    for (int g = 0; g < model->gears; g++) {
        const gk_real *q = gk_modal_seen(setup, data, g);
        for (int j = 0; j < 2 * setup->modal[g].n; j++) {
            gk_real sum = 0;
            for (int i = 0; i < count; i++) sum += (gk_real)weight[i] * work->stage[g][i][j];
            work->trial[g][j] = q[j] + (gk_real)h * sum;
        }
    }
}

/* largest local error over tolerance; positions and speeds each measured against the largest of their kind */
static double error_ratio(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                          double h)
{
    double worst = 0.0;
    for (int half = 0; half < 2; half++) {
        double scale = half ? SPEED : POSITION, error = 0.0;
        const double *ground = gk_ground_seen(data) + half * setup->base.n;
        for (int j = 0; j < setup->base.n; j++) {
            double e = 0.0;
            for (int i = 0; i < STAGES; i++) e += ERROR[i] * work->ground_stage[i][half * setup->base.n + j];
            error = gk_max(error, fabs(h * e));
            scale = gk_max(scale, RELATIVE * fabs(ground[j]));
        }
        for (int g = 0; g < model->gears; g++) {
            const int n = setup->modal[g].n;
            const gk_real *state = gk_modal_seen(setup, data, g) + half * n;
            for (int j = 0; j < n; j++) {
                double e = 0.0;
                for (int i = 0; i < STAGES; i++) e += ERROR[i] * work->stage[g][i][half * n + j];
                error = gk_max(error, fabs(h * e));
                scale = gk_max(scale, RELATIVE * fabs((double)state[j]));
            }
        }
        worst = gk_max(worst, error / scale);
        for (int d = 0; d < setup->spins; d++) {
            double e = 0.0;
            for (int i = 0; i < STAGES; i++) e += ERROR[i] * work->stage_spin[i][half * MAX_SPINS + d];
            worst = gk_max(worst, fabs(h * e) / (half ? 1e-6 : 1e-11));
        }
    }
    return worst;
}

static void keep(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    for (int d = 0; d < setup->spins; d++) {
        GK_OF(data, x)[d] = work->trial_spin[d];
        GK_OF(data, v)[d] = work->trial_spin[MAX_SPINS + d];
    }
    memcpy(gk_ground_of(data), work->ground_trial, 2 * (size_t)setup->base.n * sizeof(double));
    for (int g = 0; g < model->gears; g++)
        memcpy(gk_modal_of(setup, data, g), work->trial[g], 2 * (size_t)setup->modal[g].n * sizeof(gk_real));
}

/* what films take in an inner step, by the power at its end: these integrators keep no account but this */
void gk_rk45_squeeze(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double step)
{
    GK_ASSERT(step > 0.0);
    for (int e = 0; e < model->engagements && GK_ON(setup, film); e++)
        GK_OF(data, meshing)[e].squeezed += gk_film_power(&work->engaged[e].system) * step;
}

/* angles of the bores with a given torque, quasi-static part included */
void gk_rk45_angles(const gk_model *model, const gk_work *work, gk_data *data)
{
    GK_ASSERT(model && work && data);
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = s->contacts; i < s->n; i++)
            if (gk_row_is_given(s, i))
                GK_OF(data, angle)[s->joint.port[i]] = gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i);
    }
}

/* Over h, in as many inner steps as the error control wants; outer ends move linearly between outer_before and outer. γ
 * has no meaning here. GK_OK, GK_PENETRATION, or GK_DIVERGED: inner steps of less than a picosecond, or more than
 * TRIALS of them. */
gk_outcome gk_rk45_step(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h,
                        double gamma)
{
    GK_ASSERT(h > 0.0 && gk_finite(h));
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC);
    double from[MAX_PORTS], to[MAX_PORTS], outer[MAX_PORTS];
    double done = 0.0, step = data->rk_h > 0.0 ? gk_min(data->rk_h, h) : 1e-3 * h;
    (void)gamma;
    memcpy(from, work->outer_before, sizeof from);
    memcpy(to, work->outer, sizeof to);
    for (int p = 0; p < model->ports; p++) work->outer_speed[p] = (to[p] - from[p]) / h;
    for (int trial = 0; done < h; trial++) {
        if (trial == TRIALS) return GK_DIVERGED;
        step = gk_min(step, h - done);
        int good = 1;
        for (int i = 0; i < STAGES && good; i++) {
            combine(model, setup, work, data, A[i], i, step);
            const double part = (done + NODE[i] * step) / h;
            for (int p = 0; p < model->ports; p++) outer[p] = from[p] + part * (to[p] - from[p]);
            good = gk_rk45_evaluate(model, setup, work, data, i, outer);
        }
        const double ratio = good ? error_ratio(model, setup, work, data, step) : 32.0;
        const double factor = gk_clamp(ratio > 0.0 ? 0.8 * gk_exp(-0.2 * gk_log(ratio)) : 5.0, 0.2, 5.0);
        if (ratio <= 1.0) {
            if (gk_rk45_overlaps(model, work)) return GK_PENETRATION;
            keep(model, setup, work, data);
            gk_rk45_squeeze(model, setup, work, data, step);
            done = done + step >= h * (1.0 - 1e-12) ? h : done + step;
            data->steps++;
        } else if (step < SMALLEST) {
            return GK_DIVERGED;
        }
        if (done < h || ratio > 1.0) step *= factor;
        if (ratio <= 1.0 && done < h) data->rk_h = step;
    }
    memcpy(work->outer_before, from, sizeof from);
    memcpy(work->outer, to, sizeof to);
    for (int e = 0; e < model->engagements; e++) gk_memory_keep(setup, &work->engaged[e], data, e);
    gk_rk45_angles(model, work, data);
    for (int e = 0; e < model->engagements; e++) { /* the mean over so short a time is its end */
        gk_system *s = &work->engaged[e].system;
        memcpy(s->force0, s->z, sizeof s->force0);
    }
    return GK_OK;
}
