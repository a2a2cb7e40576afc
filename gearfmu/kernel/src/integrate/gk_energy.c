/* Energy of a stage (docs/theory.md, eq. 11), and the accounts of a step: what ports brought in, what dampers,
 * clutches, friction and films took. Another h, γ or setup has another energy for the same motion: the baseline takes
 * the difference, which is no error of the step. */
#include "integrate/gk_energy.h"

static const double ENERGY_SMALL = 1e-300;

/* Σ (½ v² + ½ ω² q²)/s² of a gear group, summed in double in fixed lanes */
static double modal_energy(const gk_setup *setup, const gk_data *data, const gk_coefficients *k, int g)
{
    const int n = GK_LANES(setup, g);
    const gk_real *q = gk_modal_seen(setup, data, g), *v = q + n, *weight = k->flow[g].inverse_s2;
    const double *omega = setup->modal[g].omega;
    gk_quad sum = {0};
    for (int i = 0; i < n; i += 4) {
        const gk_quad speed = {v[i], v[i + 1], v[i + 2], v[i + 3]}, at = {q[i], q[i + 1], q[i + 2], q[i + 3]};
        const gk_quad w = {weight[i], weight[i + 1], weight[i + 2], weight[i + 3]};
        const gk_quad strain = *(const gk_quad *)(omega + i) * at;
        sum += w * (speed * speed + strain * strain);
    }
    return 0.5 * ((sum[0] + sum[2]) + (sum[1] + sum[3]));
}

/* energy of the dynamic coordinates in a state expressed for k */
double gk_energy_dynamic(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    GK_ASSERT(k && data);
    const gk_base *base = &setup->base;
    const double *x = gk_ground_seen(data), *v = x + base->n;
    double sum = ENERGY_SMALL;
    for (int d = 0; d < setup->spins; d++) sum += gk_kinetic(setup, d, GK_OF(data, v)[d]);
    for (int i = 0; i < base->n; i++)
        sum += 0.5 * k->ground.inverse_s2[i] * (v[i] * v[i] + base->omega2[i] * x[i] * x[i]);
    for (int g = 0; g < model->gears; g++) sum += modal_energy(setup, data, k, g);
    return sum;
}

/* The scheme's invariant (eq. 11): ½ J w² + Σ (½ v² + ½ ω² q²)/s² + ½ λᵀC′λ + Σ Φ(λ), at the end of the last step; with
 * what dampers hold */
double gk_energy_invariant(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    GK_ASSERT(k && data);
    return gk_energy_dynamic(model, setup, data, k) + data->energy.quasi_static;
}

static void feed(gk_energy *energy, double work)
{
    energy->work += work;
    energy->through += fabs(work);
}

/* What ports brought in and what dampers and clutches took in this step. A damper takes −½ η_d·Δgap; what its force
 * deflects elsewhere (lag) it holds as energy or gives back. Returns the energy of the quasi-static part. */
static double account(const gk_model *model, const gk_work *work, gk_data *data, const gk_system *s)
{
    double held = 0.0, taken = 0.0;
    for (int i = 0; i < s->n; i++) {
        const int port = s->joint.port[i];
        const double mean = gk_solve_mean(s, i);
        if (!gk_row_yields(s, i)) {
            taken -= mean * (work->moved[gk_inertia_of(model, port)] - work->moved[gk_disc_of(model, port)]);
            GK_OF(data, locked)[port] = s->active[i];
            continue;
        }
        taken += mean * (s->dashpot.lag[i] - s->dashpot.lag0[i]) -
                 0.5 * s->dashpot.mean[i] * (gk_solve_end_gap(s, i) - s->g0[i]);
        held += s->dashpot.lag[i] * (s->force[i] + 0.5 * s->dashpot.end[i]);
        if (gk_row_is_given(s, i)) {
            const double angle = gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i);
            const double yielded = gk_solve_quasi_static(s, i) + s->g0[i];
            feed(&data->energy, mean * (angle - GK_OF(data, angle)[port]) - 0.5 * s->jump[i] * yielded);
            GK_OF(data, angle)[port] = angle;
        } else if (s->joint.which[i] == JOINT_PORT) {
            feed(&data->energy, mean * (work->outer[port] - work->outer_before[port]));
        }
    }
    data->energy.dissipated += taken - (held - s->energy.held0);
    if (work->another) data->energy.baseline += s->energy.stored0 + s->energy.held0 - s->energy.shift0;
    return gk_solve_stored(s) + held - s->energy.shift;
}

/* Books what friction took in an engagement; returns what it holds. */
static double account_friction(const gk_work *work, gk_data *data, int e)
{
    const gk_glide *glide = work->engaged[e].glide;
    data->energy.dissipated += glide->taken;
    GK_OF(data, meshing)[e].rubbed += glide->taken;
    if (work->another) data->energy.baseline += glide->held0;
    return gk_friction_held(glide, &work->engaged[e].system);
}

/* Books what a film took; it holds nothing. */
static void account_film(const gk_work *work, gk_data *data, int e)
{
    const double lost = gk_film_on(&work->engaged[e].system) ? gk_film_lost(&work->engaged[e].system) : 0.0;
    data->energy.dissipated += lost;
    GK_OF(data, meshing)[e].squeezed += lost;
}

/* Books the step: dissipation, work of the ports, energy of what is quasi-static. */
void gk_energy_settle(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    GK_ASSERT(data->magic == GK_DATA_MAGIC);
    const double before = data->energy.quasi_static;
    int unsolved = 0;
    data->energy.quasi_static = 0.0;
    if (work->another) data->energy.baseline -= before;
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        data->energy.quasi_static += account(model, work, data, s);
        if (GK_ON(setup, friction)) data->energy.quasi_static += account_friction(work, data, e);
        if (GK_ON(setup, film)) account_film(work, data, e);
        data->iterations += s->iterations;
        unsolved |= s->limit_reached;
    }
    if (unsolved) data->retried++, data->status |= STATUS_LIMIT;
}
