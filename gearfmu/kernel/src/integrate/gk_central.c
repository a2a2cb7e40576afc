/* central: explicit central differences (velocity form) in the dynamic coordinates, contact forces each step from the
 * static complementarity problem of what is massless at the new positions. The massless-boundary scheme of
 * Monjaraz-Tec, Gross and Krack (docs/theory.md, 3.7), on the same residual, law and gaps as dg4: the peer it is
 * compared with.
 *
 *     v½ = v + ½h a,   x₁ = x + h v½,   0 ≤ λ₁ ⊥ g(x₁) + C λ₁ + δ(λ₁) ≥ 0,   a₁ = M⁻¹(f + Wᵀλ₁ − K x₁ − damping at v½ +
 * ½h a),   v₁ = v½ + ½h a₁
 *
 * 2nd order while contacts keep their status; stable while ¼h²ω² + hχ < 1 with all contacts closed (eq. 16a): ω² of the
 * stiffness, χ of the dashpots, which are taken explicitly. Accelerations are kept where dg4 keeps forces. */
#include "base/gk_dense.h"
#include "integrate/gk_energy.h"
#include "integrate/gk_closed.h"
#include "integrate/gk_integrate.h"
#include "problem/gk_exchange.h"

enum { PLACES_TRIED = 8, POWER = 150 };
static const double FIRST = 1e-6; /* s: where the search for the limit begins */

/* trial state ← positions and speeds after h with the accelerations at its start */
static void approach(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    const gk_real step = (gk_real)h, half = (gk_real)(0.5 * h);
    const int width = setup->base.n;
    const double *x = gk_ground_seen(data);
    for (int d = 0; d < setup->spins; d++) {
        work->trial_spin[d] = GK_OF(data, x)[d] + h * (GK_OF(data, v)[d] + 0.5 * h * GK_OF(data, f)[d]);
        work->trial_spin[MAX_SPINS + d] = GK_OF(data, v)[d] + h * GK_OF(data, f)[d]; /* the speed that dampers see */
    }
    for (int i = 0; i < width; i++) {
        work->ground_trial[i] = x[i] + h * (x[width + i] + 0.5 * h * x[2 * width + i]);
        work->ground_trial[width + i] = x[width + i] + h * x[2 * width + i];
    }
    for (int g = 0; g < model->gears; g++) {
        const int n = setup->modal[g].n;
        const gk_real *q = gk_modal_seen(setup, data, g), *v = q + n, *a = v + n;
        for (int i = 0; i < n; i++) {
            work->trial[g][i] = q[i] + step * (v[i] + half * a[i]);
            work->trial[g][n + i] = v[i] + step * a[i];
        }
    }
}

/* positions of the trial state, speeds by the mean of both accelerations */
static void arrive(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double h)
{
    const gk_real half = (gk_real)(0.5 * h);
    const int width = setup->base.n;
    double *x = gk_ground_of(data);
    for (int d = 0; d < setup->spins; d++) {
        const double a = work->stage_spin[0][MAX_SPINS + d];
        GK_OF(data, v)[d] += 0.5 * h * (GK_OF(data, f)[d] + a);
        GK_OF(data, x)[d] = work->trial_spin[d];
        GK_OF(data, f)[d] = a;
    }
    for (int i = 0; i < width; i++) {
        const double a = work->ground_stage[0][width + i];
        x[i] = work->ground_trial[i];
        x[width + i] += 0.5 * h * (x[2 * width + i] + a);
        x[2 * width + i] = a;
    }
    for (int g = 0; g < model->gears; g++) {
        const int n = setup->modal[g].n;
        gk_real *q = gk_modal_of(setup, data, g);
        const gk_real *a = work->stage[g][0] + n;
        for (int i = 0; i < n; i++) {
            q[i] = work->trial[g][i];
            q[n + i] += half * (q[2 * n + i] + a[i]);
            q[2 * n + i] = a[i];
        }
    }
}

/* a given torque is not that of the last step */
static int torque_jumps(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data)
{
    for (int p = 0; p < model->ports; p++)
        if (setup->given_torque[p] && work->torque[p] != GK_OF(data, joint)[p][JOINT_PORT].force) return 1;
    return 0;
}

/* One step of length h. GK_OK, or GK_DIVERGED / GK_PENETRATION with data unchanged. γ has no meaning here. */
gk_outcome gk_central_step(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h,
                           double gamma)
{
    GK_ASSERT(h > 0.0 && gk_finite(h));
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC);
    double outer[MAX_PORTS];
    (void)gamma;
    for (int p = 0; p < model->ports; p++) work->outer_speed[p] = (work->outer[p] - work->outer_before[p]) / h;
    memcpy(outer, work->outer, sizeof outer);
    /* In the first step forces of the equilibrium take the place of accelerations. A torque that is given anew acts
     * from the start of the step. */
    if (!(data->rk_h > 0.0) || torque_jumps(model, setup, work, data)) {
        approach(model, setup, work, data, 0.0);
        if (!gk_rk45_evaluate(model, setup, work, data, 0, work->outer_before)) return GK_DIVERGED;
        arrive(model, setup, work, data, 0.0);
        data->rk_h = h;
    }
    approach(model, setup, work, data, h);
    if (!gk_rk45_evaluate(model, setup, work, data, 0, outer)) return GK_DIVERGED;
    if (gk_rk45_overlaps(model, work)) return GK_PENETRATION;
    arrive(model, setup, work, data, h);
    gk_rk45_squeeze(model, setup, work, data, h);
    for (int e = 0; e < model->engagements; e++) gk_memory_keep(setup, &work->engaged[e], data, e);
    gk_rk45_angles(model, work, data);
    for (int e = 0; e < model->engagements; e++) { /* reported force: that of the end */
        gk_system *s = &work->engaged[e].system;
        data->iterations += s->iterations;
        memcpy(s->force0, s->z, sizeof s->force0);
    }
    data->steps++;
    return GK_OK;
}

#ifndef GK_WIDE
/* What the undamped scheme keeps while contacts keep their status and the law is straight: ½ v M v + V(x) − ⅛h² a M
 * a, V with the contacts' energy */
double gk_central_energy(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                         double h)
{
    GK_ASSERT(h > 0.0);
    const double *ground = gk_ground_seen(data) + 2 * setup->base.n;
    double sum = 0.0;
    for (int d = 0; d < setup->spins; d++) sum += 2.0 * gk_kinetic(setup, d, GK_OF(data, f)[d]);
    for (int i = 0; i < setup->base.n; i++) sum += ground[i] * ground[i];
    for (int g = 0; g < model->gears; g++) {
        const int n = setup->modal[g].n;
        const gk_real *a = gk_modal_seen(setup, data, g) + 2 * n;
        for (int i = 0; i < n; i++) sum += (double)a[i] * a[i];
    }
    return gk_energy_invariant(model, setup, data, &work->room.explicit_rows) - 0.125 * h * h * sum;
}

/* Cholesky factor of the whole quasi-static compliance of an engagement at a position, contacts closed under the
 * full load (that is stiffest); 0: not positive */
static int closed(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e,
                  double position)
{
    gk_system *s = &work->engaged[e].system;
    const double full = model->engagement[e].force_max / model->engagement[e].width;
    if (!gk_closed_place(model, setup, work, data, e, position)) return 0;
    for (int i = 0; i < s->n; i++) {
        s->active[i] = gk_row_is_stiff(s, i);
        s->local.slope[i] = i < s->contacts ? gk_law_slope(s, i, full * s->flank.width[i]) : 0.0;
    }
    gk_closed_compliance(s, s->A, full, 0, s->J);
    for (int i = 0; i < s->contacts && setup->nodal; i++) { /* the penalty in place of the law */
        const double slope = setup->mesh[e].compliance * s->flank.per_width[i];
        s->J[i * s->n + i] += slope - s->local.slope[i];
        s->local.slope[i] = slope;
    }
    return gk_cholesky(s->J, s->n);
}

typedef struct quotient {
    double stiff, damped;
} quotient; /* ω², χ of a shape */

typedef struct shape { /* of all coordinates, its energy and its product with the operator */
    double up_stiff, up_damped, down, size, next[MAX_SPINS];
} shape;

/* C⁻¹ of what the rows of an engagement read of the trial speeds (y), and with the dashpots (c, both) */
static void press(const gk_model *model, const gk_setup *setup, gk_work *work, int e, double h, shape *of)
{
    gk_system *s = &work->engaged[e].system;
    const gk_real *u[MAX_GEARS];
    double rate[MAX_STRIDE], *y = s->force, *both = s->z, *c = s->eta;
    for (int g = 0; g < model->gears; g++) u[g] = work->trial[g] + setup->modal[g].n;
    gk_form_rates(setup, work, e, u, work->ground_trial + setup->base.n, work->trial_spin + MAX_SPINS, rate);
    for (int i = 0; i < s->n; i++) y[i] = s->active[i] ? rate[i] : 0.0;
    gk_cholesky_solve(s->J, y, s->n);
    memcpy(c, y, (size_t)s->n * sizeof *c);
    gk_rk45_resist(setup, &setup->mesh[e], s, c);
    for (int i = 0; i < s->n; i++) of->up_damped += y[i] * c[i];
    gk_cholesky_solve(s->J, c, s->n);
    for (int i = 0; i < s->n; i++) both[i] = 0.25 * h * h * y[i] + h * c[i];
}

static void spin_round(const gk_setup *setup, const gk_work *work, int e, shape *of)
{
    const gk_system *s = &work->engaged[e].system;
    const gk_mesh *mesh = &setup->mesh[e];
    const double *r = work->trial_spin + MAX_SPINS;
    for (int l = 0; l < mesh->spins; l++) {
        const int d = mesh->spin[l];
        double force = 0.0, next = 0.0;
        for (int i = 0; i < s->n; i++) force += s->rigid[l][i] * s->force[i], next += s->rigid[l][i] * s->z[i];
        of->next[d] = next * setup->inverse_inertia[d];
        of->up_stiff += r[d] * force;
        of->down += 2.0 * gk_kinetic(setup, d, r[d]);
        of->size += 2.0 * gk_kinetic(setup, d, of->next[d]);
    }
}

static void ground_round(const gk_model *model, const gk_setup *setup, gk_work *work, double h, shape *of)
{
    const gk_base *base = &setup->base;
    const int n = base->n;
    const double *u = work->ground_trial + n, stiff = 0.25 * h * h;
    double *a = work->ground_stage[0];
    for (int j = 0; j < n; j++) {
        const double of_mode = GK_ON(setup, modal_damping) ? 2.0 * base->zeta[j] * base->omega[j] : 0.0;
        a[j] = work->ground_next[j] + (stiff * base->omega2[j] + h * of_mode) * u[j];
        of->up_stiff += (base->omega2[j] * u[j] + work->ground_force[j]) * u[j];
        of->up_damped += of_mode * u[j] * u[j];
        of->down += u[j] * u[j];
    }
    for (int d = 0; d < model->supports && n; d++) {
        const double c = model->ground[base->set].damper[d];
        if (c == 0.0) continue;
        const double *e = base->damper_rows + d * n, speed = gk_dot_quads(e, u, n / 4);
        of->up_damped += c * speed * speed;
        for (int j = 0; j < n; j++) a[j] += h * c * speed * e[j];
    }
    for (int j = 0; j < n; j++) of->size += a[j] * a[j];
}

static void gear_round(const gk_setup *setup, gk_work *work, int g, double h, shape *of)
{
    const gk_modal *m = &setup->modal[g];
    const gk_real *u = work->trial[g] + m->n;
    for (int j = 0; j < m->n; j++) {
        const double of_mode = GK_ON(setup, modal_damping) ? 2.0 * m->zeta[j] * m->omega[j] : 0.0, x = u[j];
        const double a = work->next[g][j] + (0.25 * h * h * m->omega2[j] + h * of_mode) * x;
        of->up_stiff += ((double)m->omega2[j] * x + work->force[g][j]) * x;
        of->up_damped += of_mode * x * x;
        of->down += x * x, of->size += a * a;
        work->stage[g][0][j] = (gk_real)a;
    }
}

/* One round of power iteration with ¼h² M⁻¹(K + WᵀC⁻¹W) + h M⁻¹(damping + WᵀC⁻¹ S c S C⁻¹W) on the trial speeds;
 * returns Rayleigh's quotients of both parts */
static quotient round_of_power(const gk_model *model, const gk_setup *setup, gk_work *work, double h)
{
    shape of = {0};
    memset(work->outer_speed, 0, sizeof work->outer_speed);
    for (int e = 0; e < model->engagements; e++) press(model, setup, work, e, h, &of);
    for (int e = 0; e < model->engagements; e++) spin_round(setup, work, e, &of);
    gk_exchange_scatter(model, setup, work, gk_step_force, gk_step_z);
    ground_round(model, setup, work, h, &of);
    for (int g = 0; g < model->gears; g++) gear_round(setup, work, g, h, &of);
    const double scale = of.size > 0.0 ? 1.0 / sqrt(of.size) : 0.0;
    for (int d = 0; d < setup->spins; d++) work->trial_spin[MAX_SPINS + d] = of.next[d] * scale;
    for (int j = 0; j < setup->base.n; j++) work->ground_trial[setup->base.n + j] = work->ground_stage[0][j] * scale;
    for (int g = 0; g < model->gears; g++)
        for (int j = 0; j < setup->modal[g].n; j++)
            work->trial[g][setup->modal[g].n + j] = (gk_real)(work->stage[g][0][j] * scale);
    return of.down > 0.0 ? (quotient){of.up_stiff / of.down, of.up_damped / of.down} : (quotient){0.0, 0.0};
}

static void first_shape(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    for (int d = 0; d < setup->spins; d++) work->trial_spin[MAX_SPINS + d] = sqrt(setup->inverse_inertia[d]);
    for (int j = 0; j < setup->base.n; j++)
        work->ground_trial[setup->base.n + j] = setup->base.omega[j] > 0.0 ? 1.0 + 0.1 * (j % 7) : 0.0;
    for (int g = 0; g < model->gears; g++)
        for (int j = 0; j < setup->modal[g].n; j++)
            work->trial[g][setup->modal[g].n + j] = setup->modal[g].omega[j] > 0.0 ? (gk_real)(1.0 + 0.1 * (j % 7)) : 0;
}

/* Largest stable step over the roll positions, all candidate contacts closed (fewer are softer): ¼h²ω² + hχ = 1 (eq.
 * 16a) for the shape that is worst at this h */
double gk_central_limit(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data)
{
    GK_ASSERT(setup->integrator == CENTRAL && work);
    double smallest = INFINITY;
    for (int i = 0; i < PLACES_TRIED; i++) {
        double h = FIRST;
        int all = model->engagements > 0;
        for (int e = 0; e < model->engagements; e++)
            all &= closed(model, setup, work, data, e, (double)i / PLACES_TRIED);
        if (!all) continue;
        first_shape(model, setup, work);
        for (int round = 0; round < POWER; round++) {
            const quotient of = round_of_power(model, setup, work, h);
            h = of.stiff > 0.0 ? 2.0 / (sqrt(of.stiff + of.damped * of.damped) + of.damped) : INFINITY;
            if (!(h < INFINITY)) break;
        }
        smallest = gk_min(smallest, h);
    }
    return smallest;
}
#endif
