/* One internal step of dg4 (docs/theory.md, 3). It reads like its description: predict, find, form, recall, solve,
 * and only if all is finite: correct and remember. Until `correct` nothing of gk_data changes but its expression for
 * another h, so a step that fails can be repeated with another h or scheme. */
#include "integrate/gk_integrate.h"

static const double ENERGY_SMALL = 1e-300, HUGE_FORCE = 1e15; /* N: no gear lives here */
static const double FARTHEST = 0.25 * 2.0 * GK_PI;            /* a quarter of a pitch */

/* a speed of the scheme is ẋ + lead·ḟ/m (docs/theory, 3.8) */
static double speed_lead(double h, double gamma) { return h * h * (2.0 * gk_correction(gamma) - 1.0) / 12.0; }

/* ---- state ------------------------------------------------------------------------------------------------------- */
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
static double dynamic_energy(const gk_model *model, const gk_setup *setup, const gk_data *data,
                             const gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    const double *x = gk_ground_seen(data), *v = x + base->n;
    double sum = ENERGY_SMALL;
    for (int d = 0; d < setup->spins; d++) sum += gk_kinetic(setup, d, GK_OF(data, v)[d]);
    for (int i = 0; i < base->n; i++)
        sum += 0.5 * k->ground.inverse_s2[i] * (v[i] * v[i] + base->omega2[i] * x[i] * x[i]);
    for (int g = 0; g < model->gears; g++) sum += modal_energy(setup, data, k, g);
    return sum;
}

/* A state of the scheme is displacement + κ f (docs/theory, 3.1): when h or γ changes, the displacement stays, and the
 * speed of free masses. At rest κ = 0. Another expression has another energy: the balance goes on from there. */
static void express(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                    const gk_coefficients *k)
{
    if (data->state_h == k->h && data->state_gamma == k->gamma) return;
    const gk_coefficients *old = data->state_h > 0.0 ? gk_flow_for(model, setup, work, data->state_h, data->state_gamma)
                                                     : &work->explicit_rows;
    const double before = dynamic_energy(model, setup, data, old);
    double *x = gk_ground_of(data), *f = x + 2 * setup->base.n;
    for (int i = 0; i < setup->base.n; i++) x[i] += (k->ground.kappa[i] - old->ground.kappa[i]) * f[i];
    for (int g = 0; g < model->gears; g++) {
        const int n = GK_LANES(setup, g);
        gk_real *q = gk_modal_of(setup, data, g);
        for (int i = 0; i < n; i++) q[i] += (k->flow[g].kappa[i] - old->flow[g].kappa[i]) * q[2 * n + i];
    }
    const double lead = data->state_h > 0.0 ? speed_lead(k->h, k->gamma) - speed_lead(data->state_h, data->state_gamma)
                                            : 0.0;
    for (int d = 0; d < setup->spins; d++)
        GK_OF(data, v)[d] += lead * setup->inverse_inertia[d] * GK_OF(data, f_rate)[d];
    for (int d = 0; d < setup->spins; d++)
        GK_OF(data, x)[d] += (k->rigid_kappa - old->rigid_kappa) * setup->inverse_inertia[d] * GK_OF(data, f)[d];
    data->energy.baseline += dynamic_energy(model, setup, data, k) - before;
    data->state_h = k->h;
    data->state_gamma = k->gamma;
}

/* half a step of the dashpots of the supports: speeds contract along them; what that takes */
static double damp_supports(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, double *v)
{
    const int n = setup->base.n;
    double taken = 0.0;
    for (int d = 0; d < model->dampers; d++) {
        const double *e = setup->base.damper_rows + d * n, *pulls = k->ground.pulls + d * n;
        const gk_span span = setup->base.damper_span[d];
        const double decay = k->ground.decay[d], speed = decay > 0.0 ? gk_dot_span(span, e, v) : 0.0;
        if (speed == 0.0) continue;
        gk_axpy_span(span, -decay * speed, pulls, v);
        taken += k->ground.loss[d] * speed * speed;
    }
    return taken;
}

/* ---- prediction -------------------------------------------------------------------------------------------------- */
/* where arrays are whole halves (gk_real) or quads (double): the compiler need not prove that they do not overlap */
#define HALVES(array) ((gk_half *)(array))
#define SEEN_HALVES(array) ((const gk_half *)(array))
#define QUADS(array) ((gk_quad *)(array))
#define SEEN_QUADS(array) ((const gk_quad *)(array))

static void predict_gear(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                         const gk_coefficients *k, int g)
{
    const int n = GK_LANES(setup, g), halves = 2 * n / LANES;
    const gk_half *q = SEEN_HALVES(gk_modal_seen(setup, data, g)), *v = q + halves, *f = v + halves;
    if (GK_HAS(gyroscopic) && setup->modal[g].turns) {
        gk_frame_turn_gear(&setup->modal[g], k->h * GK_OF(data, v)[model->gear[g].rotor], (const gk_real *)v,
                           work->turned_speed[g]);
        v = SEEN_HALVES(work->turned_speed[g]);
    }
    const gk_flow *w = &k->flow[g];
    const gk_half *d11 = SEEN_HALVES(w->d11), *a12 = SEEN_HALVES(w->a12), *b0q = SEEN_HALVES(w->b0q);
    const gk_half *a21 = SEEN_HALVES(w->a21), *d22 = SEEN_HALVES(w->d22), *b0v = SEEN_HALVES(w->b0v);
    gk_half *qp = HALVES(work->qp[g]), *vp = HALVES(work->vp[g]);
    for (int i = 0; i < halves; i++) {
        qp[i] = q[i] + (d11[i] * q[i] + a12[i] * v[i] + b0q[i] * f[i]);
        vp[i] = v[i] + (a21[i] * q[i] + d22[i] * v[i] + b0v[i] * f[i]);
    }
    work->y[g] = work->qp[g];
    if (!k->curved_read) return;
    for (int i = 0; i < n; i++) work->reading[g][i] = w->read_q[i] * work->qp[g][i] + w->read_v[i] * work->vp[g][i];
    work->y[g] = work->reading[g];
}

/* the ground group; its speeds have contracted by half a step of the dashpots. Returns what those take. */
static double predict_ground(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                             const gk_coefficients *k)
{
    const int n = setup->base.n;
    const double *x = gk_ground_seen(data), *f = x + 2 * n;
    const gk_ground_flow *w = &k->ground;
    double *v = work->ground_start;
    memcpy(v, x + n, (size_t)n * sizeof *v);
    const double taken = damp_supports(model, setup, k, v);
    gk_frame_turn(setup, k, data, 0, v);
    work->pressed = gk_frame_press(model, setup, k, data, v);
    const gk_quad *x4 = SEEN_QUADS(x), *v4 = SEEN_QUADS(v), *f4 = SEEN_QUADS(f);
    const gk_quad *d11 = SEEN_QUADS(w->d11), *a12 = SEEN_QUADS(w->a12), *b0q = SEEN_QUADS(w->b0q);
    const gk_quad *a21 = SEEN_QUADS(w->a21), *d22 = SEEN_QUADS(w->d22), *b0v = SEEN_QUADS(w->b0v);
    for (int i = 0; i < n / 4; i++) {
        QUADS(work->ground_q)[i] = x4[i] + (d11[i] * x4[i] + a12[i] * v4[i] + b0q[i] * f4[i]);
        QUADS(work->ground_v)[i] = v4[i] + (a21[i] * x4[i] + d22[i] * v4[i] + b0v[i] * f4[i]);
    }
    work->ground_y = work->ground_q;
    if (!k->curved_read) return taken;
    for (int i = 0; i < n; i++)
        work->ground_reading[i] = w->read_q[i] * work->ground_q[i] + w->read_v[i] * work->ground_v[i];
    work->ground_y = work->ground_reading;
    return taken;
}

/* modal state and spins one step ahead under the forces of the last step */
static double predict(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                      const gk_coefficients *k)
{
    for (int g = 0; g < model->gears; g++) predict_gear(model, setup, work, data, k, g);
    for (int d = 0; d < setup->spins; d++) {
        const double acceleration = GK_OF(data, f)[d] * setup->inverse_inertia[d];
        work->spin[d] = GK_OF(data, x)[d] + k->h * GK_OF(data, v)[d] + k->rigid_b0 * acceleration;
        work->speed[d] = GK_OF(data, v)[d] + 0.5 * k->h * acceleration;
    }
    return predict_ground(model, setup, work, data, k);
}

/* a step may not carry a gear past its teeth: contact would not see it */
static int passable(const gk_model *model, const gk_work *work, const gk_data *data)
{
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2 && model->engagement[e].kind != MESH_FLAT; w++) {
            const gk_gear *gear = &model->gear[model->engagement[e].gear[w]];
            const int frame = model->frame[gear->rotor];
            const double turned = frame < 0 ? 0.0 : work->spin[frame] - GK_OF(data, x)[frame];
            if (!(fabs(work->spin[gear->rotor] - GK_OF(data, x)[gear->rotor] - turned) * gear->z < FARTHEST)) return 0;
        }
    return 1;
}

/* A torque that is given anew acts from the start of the step: its mean in the step is the new value, so that the force
 * at the end that a prediction with the old one needs is as far beyond it (docs/theory.md, 3.3) */
static void find_jumps(const gk_setup *setup, const gk_work *work, gk_system *s)
{
    if (gk_scheme_of(setup->integrator)->linear_force) return; /* mix4: forces are linear in the step */
    for (int i = s->contacts; i < s->n; i++)
        if (s->kind[i] == ROW_TORQUE) s->jump[i] = work->torque[s->port_of[i]] - s->force0[i];
}

/* Tip corners off: did a pair that carried load end with its flank? */
static int flank_ended(const gk_meshing *meshing, const gk_engaged *engaged, int strips)
{
    for (int m = 0; m < meshing->pairs; m++) {
        double load = 0.0;
        int there = 0;
        for (int i = 0; i < strips; i++) load += meshing->memory[m].force[i];
        for (int p = 0; p < engaged->places; p++) there |= engaged->place[p].memory == m;
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

/* ---- the end of the step ----------------------------------------------------------------------------------------- */
/* forces at the end that the next prediction is made with, where forces are linear in the step */
static const double *force_with_dampers(const gk_system *s) { return s->last; }

/* Where Coriolis forces turn the speeds of a gear group: predicted speeds to the end of the step, turned by half a
 * step. Returns what the force of this step has still to do to them. */
static const gk_real *finish_speeds(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                                    const gk_coefficients *k, int g)
{
    const gk_modal *m = &setup->modal[g];
    if (!GK_HAS(gyroscopic) || !m->turns) return k->flow[g].bv;
    gk_real *v = work->vp[g];
    for (int i = 0; i < m->n; i++) v[i] += k->flow[g].bv[i] * work->force[g][i];
    gk_frame_turn_gear(m, k->h * GK_OF(data, v)[model->gear[g].rotor], v, v);
    return work->zero;
}

/* modal state to the end of the step; returns what modal damping took: work of the mean force minus change of
 * energy, mode by mode */
static double correct_damped(const gk_setup *setup, const gk_work *work, const gk_coefficients *k, int g,
                             const gk_real *bv_left, gk_real *state)
{
    const int halves = 2 * GK_LANES(setup, g) / LANES;
    gk_half *q = HALVES(state), *v = q + halves, sum = {0};
    const gk_half *f = v + halves, *z = SEEN_HALVES(work->force[g]), *qp = SEEN_HALVES(work->qp[g]);
    const gk_half *vp = SEEN_HALVES(work->vp[g]), *omega2 = SEEN_HALVES(setup->modal[g].omega2);
    const gk_half *bq = SEEN_HALVES(k->flow[g].bq), *bv = SEEN_HALVES(bv_left);
    const gk_half *weight = SEEN_HALVES(k->flow[g].inverse_s2);
    for (int i = 0; i < halves; i++) {
        const gk_half q1 = qp[i] + bq[i] * z[i], v1 = vp[i] + bv[i] * z[i], moved = q1 - q[i];
        sum += (f[i] + z[i]) * moved - weight[i] * ((v1 - v[i]) * (v1 + v[i]) + omega2[i] * (moved * (q1 + q[i])));
        q[i] = q1;
        v[i] = v1;
    }
    return 0.5 * (((double)sum[0] + sum[4]) + ((double)sum[2] + sum[6]) + ((double)sum[1] + sum[5]) +
                  ((double)sum[3] + sum[7]));
}

/* the same without damping: nothing but rounding, so it takes more digits to see */
static double correct_undamped(const gk_setup *setup, const gk_work *work, const gk_coefficients *k, int g,
                               const gk_real *bv_left, gk_real *q)
{
    const int n = GK_LANES(setup, g);
    const gk_flow *w = &k->flow[g];
    gk_real *v = q + n;
    const gk_real *f = v + n;
    double sum = 0.0;
    for (int j = 0; j < n; j++) {
        const gk_real z = work->force[g][j], q1 = work->qp[g][j] + w->bq[j] * z, v1 = work->vp[g][j] + bv_left[j] * z;
        const double dq = (double)q1 - q[j], dv = (double)v1 - v[j], omega = setup->modal[g].omega[j];
        sum += 0.5 * (((double)f[j] + z) * dq -
                      w->inverse_s2[j] * (dv * ((double)v1 + v[j]) + omega * omega * dq * ((double)q1 + q[j])));
        q[j] = q1;
        v[j] = v1;
    }
    return sum;
}

/* an engagement that knows the gear: it owes what rounding did to the gear's modes */
static int engagement_of(const gk_model *model, int g)
{
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++)
            if (model->engagement[e].gear[w] == g) return e;
    return -1;
}

/* the ground group to the end of the step: returns what damping took, that of the supports included */
static double correct_ground(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                             const gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    const int n = base->n, damped = GK_ON(setup, modal_damping);
    const gk_ground_flow *w = &k->ground;
    double *v = gk_ground_of(data) + n;
    gk_quad *x4 = QUADS(gk_ground_of(data)), *v4 = QUADS(v), *f4 = QUADS(v + n), sum = {0};
    const gk_quad *qp = SEEN_QUADS(work->ground_q), *vp = SEEN_QUADS(work->ground_v),
                  *z = SEEN_QUADS(work->ground_force);
    const gk_quad *v0 = SEEN_QUADS(work->ground_start), *next = SEEN_QUADS(work->ground_next);
    const gk_quad *bq = SEEN_QUADS(w->bq), *bv = SEEN_QUADS(w->bv), *weight = SEEN_QUADS(w->inverse_s2);
    const gk_quad *omega2 = SEEN_QUADS(base->omega2);
    for (int i = 0; i < n / 4; i++) {
        const gk_quad x1 = qp[i] + bq[i] * z[i], v1 = vp[i] + bv[i] * z[i], moved = x1 - x4[i];
        sum += (f4[i] + z[i]) * moved - weight[i] * ((v1 - v0[i]) * (v1 + v0[i]) + omega2[i] * moved * (x1 + x4[i]));
        x4[i] = x1;
        v4[i] = v1;
        f4[i] = next[i];
    }
    const double taken = damped ? 0.5 * ((sum[0] + sum[2]) + (sum[1] + sum[3])) : 0.0;
    data->energy.work += work->pressed + gk_frame_press(model, setup, k, data, v);
    gk_frame_turn(setup, k, data, 1, v);
    return taken + damp_supports(model, setup, k, v);
}

static void correct_spins(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                          const gk_coefficients *k)
{
    double z[MAX_SPINS], force[MAX_SPINS];
    for (int d = 0; d < setup->spins; d++) z[d] = force[d] = 0.0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_mesh *mesh = &setup->mesh[e];
        const gk_system *s = &work->engaged[e].system;
        for (int l = 0; l < mesh->spins; l++) {
            double last = gk_dot_quads(s->rigid[l], s->last, s->stride / 4);
            for (int i = s->n - s->clutches; i < s->n; i++) last -= s->rigid[l][i] * s->force[i];
            z[mesh->spin[l]] += gk_dot_quads(s->rigid[l], s->z, s->stride / 4);
            force[mesh->spin[l]] += last;
            if (!GK_ON(setup, friction)) continue;
            const gk_glide *glide = work->engaged[e].glide;
            for (int i = 0; i < s->contacts; i++) {
                z[mesh->spin[l]] += glide->rigid[l][i] * glide->step[i];
                force[mesh->spin[l]] += glide->rigid[l][i] * glide->last[i];
            }
        }
    }
    for (int d = 0; d < setup->spins; d++) {
        const double before = GK_OF(data, x)[d];
        GK_OF(data, x)[d] = work->spin[d] + k->rigid_bq * setup->inverse_inertia[d] * z[d];
        GK_OF(data, v)[d] = work->speed[d] + 0.5 * k->h * setup->inverse_inertia[d] * z[d];
        GK_OF(data, f_rate)[d] = (force[d] - GK_OF(data, f)[d]) / k->h;
        GK_OF(data, f)[d] = force[d];
        work->moved[d] = GK_OF(data, x)[d] - before;
    }
}

static void correct(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                    const gk_coefficients *k)
{
    const int linear = gk_scheme_of(setup->integrator)->linear_force;
    for (int e = 0; e < model->engagements; e++) {
        gk_system *s = &work->engaged[e].system;
        memcpy(s->last, s->force, (size_t)s->stride * sizeof *s->last);
        for (int i = 0; linear && i < s->stride; i++) s->last[i] += s->end[i];
        if (GK_ON(setup, friction)) work->engaged[e].glide->taken = gk_friction_settle(work->engaged[e].glide, s);
    }
    gk_rows_scatter(model, setup, work, gk_step_z, force_with_dampers);
    for (int g = 0; g < model->gears; g++) {
        const int n = GK_LANES(setup, g), e = engagement_of(model, g);
        gk_real *q = gk_modal_of(setup, data, g);
        if (!n || e < 0) continue;
        const gk_real *bv_left = finish_speeds(model, setup, work, data, k, g);
        if (GK_ON(setup, modal_damping))
            data->energy.dissipated += correct_damped(setup, work, k, g, bv_left, q);
        else /* what rounding gave or took */
            work->engaged[e].system.energy_error -= correct_undamped(setup, work, k, g, bv_left, q);
        memcpy(q + 2 * n, work->next[g], (size_t)n * sizeof *q);
    }
    data->energy.dissipated += correct_ground(model, setup, work, data, k);
    correct_spins(model, setup, work, data, k);
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
        const int port = s->port_of[i];
        const double mean = gk_solve_mean(s, i);
        if (s->kind[i] == ROW_CLUTCH) {
            taken -= mean * (work->moved[gk_inertia_of(model, port)] - work->moved[gk_disc_of(model, port)]);
            GK_OF(data, locked)[port] = s->active[i];
            continue;
        }
        taken += mean * (s->lag[i] - s->lag0[i]) - 0.5 * s->damper[i] * (gk_solve_end_gap(s, i) - s->g0[i]);
        held += s->lag[i] * (s->force[i] + 0.5 * s->end[i]);
        if (s->kind[i] == ROW_TORQUE) {
            const double angle = gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i);
            const double yielded = gk_solve_quasi_static(s, i) + s->g0[i];
            feed(&data->energy, mean * (angle - GK_OF(data, angle)[port]) - 0.5 * s->jump[i] * yielded);
            GK_OF(data, angle)[port] = angle;
        } else if (s->joint_of[i] == JOINT_PORT) {
            feed(&data->energy, mean * (work->outer[port] - work->outer_before[port]));
        }
    }
    data->energy.dissipated += taken - (held - s->held0);
    if (work->another) data->energy.baseline += s->stored0 + s->held0;
    return gk_solve_stored(s) + held;
}

/* ---- the step ---------------------------------------------------------------------------------------------------- */
/* problems of all engagements, island by island */
static gk_outcome solve_all(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                            const gk_coefficients *k)
{
    const int balanced = !gk_scheme_of(setup->integrator)->linear_force;
    for (int i = 0; i < setup->islands; i++) {
        gk_coupled coupled = {model, setup, work, k, i, 0, 0, 1.0};
        const gk_island island = gk_couple_island(&coupled);
        if (island.count > 1) gk_couple_recall(&coupled);
        if (balanced)
            gk_balance_solve(&island);
        else
            gk_balance_plain(&island);
    }
    for (int e = 0; e < model->engagements; e++) {
        gk_system *s = &work->engaged[e].system;
        if (!all_finite(s)) return GK_DIVERGED;
        if (GK_HAS(tip_contact) && !setup->on.tip_contact &&
            flank_ended(&GK_OF(data, meshing)[e], &work->engaged[e], s->strips))
            data->status |= STATUS_TIP_ENDED;
    }
    return GK_OK;
}

/* the same of friction */
static double account_friction(const gk_work *work, gk_data *data, int e)
{
    const gk_glide *glide = work->engaged[e].glide;
    data->energy.dissipated += glide->taken;
    GK_OF(data, meshing)[e].rubbed += glide->taken;
    if (work->another) data->energy.baseline += glide->held0;
    return gk_friction_held(glide, &work->engaged[e].system);
}

/* the same of films, which hold none */
static void account_film(const gk_work *work, gk_data *data, int e)
{
    const double lost = gk_film_on(&work->engaged[e].system) ? gk_film_lost(&work->engaged[e].system) : 0.0;
    data->energy.dissipated += lost;
    GK_OF(data, meshing)[e].squeezed += lost;
}

static void settle_accounts(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    const double before = data->energy.quasi_static;
    data->energy.quasi_static = 0.0;
    if (work->another) data->energy.baseline -= before;
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        data->energy.quasi_static += account(model, work, data, s);
        if (GK_ON(setup, friction)) data->energy.quasi_static += account_friction(work, data, e);
        if (GK_ON(setup, film)) account_film(work, data, e);
        data->iterations += s->iterations;
        if (s->limit_reached) data->retried++, data->status |= STATUS_LIMIT;
    }
}

/* One step of length h with γ (γ = 0: em). GK_OK, or GK_DIVERGED / GK_PENETRATION with data unchanged. */
gk_outcome gk_step_once(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h,
                        double gamma)
{
    GK_ASSERT(h > 0.0 && gk_finite(h));
    GK_ASSERT(gamma >= 0.0 && gamma <= 1.0);
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC && data->magic == GK_DATA_MAGIC);
    const gk_coefficients *k = gk_flow_for(model, setup, work, h, gamma);
    gk_outcome outcome;
    GK_MARK(work);
    if (GK_ON(setup, elastic) && h == data->table_h && gamma == gk_limit_gamma(setup, work, data, h) &&
        !(h == work->table_h && gamma == work->table_gamma))
        gk_side_step(model, setup, work, k);
    work->another = data->expressed_h != h || data->expressed_gamma != gamma;
    express(model, setup, work, data, k);
    const double damped = predict(model, setup, work, data, k);
    if (!passable(model, work, data)) return GK_DIVERGED;
    GK_LAP(work, PHASE_PREDICT);
    const gk_search how = {.k = k};
    for (int e = 0; e < model->engagements; e++) {
        if (!gk_engage(model, setup, work, data, &how, e)) return GK_DIVERGED;
        if (gk_engage_overlaps(model, work, e)) return GK_PENETRATION;
        if (GK_ON(setup, friction)) gk_friction_form(model, setup, data, k, work, e);
        find_jumps(setup, work, &work->engaged[e].system);
        gk_memory_recall(setup, work, data, e, &work->engaged[e].system);
        if (GK_ON(setup, film)) gk_film_begin(setup, work, e, k->h);
        GK_LAP(work, PHASE_SYSTEM);
    }
    if ((outcome = solve_all(model, setup, work, data, k)) != GK_OK) return outcome;
    GK_LAP(work, PHASE_SOLVE);
    data->energy.dissipated += damped;
    correct(model, setup, work, data, k);
    GK_LAP(work, PHASE_CORRECT);
    settle_accounts(model, setup, work, data);
    for (int e = 0; e < model->engagements; e++) {
        gk_memory_keep(setup, &work->engaged[e], data, e);
        if (GK_ON(setup, friction)) gk_friction_watch(setup, data, h, e);
    }
    data->expressed_h = h, data->expressed_gamma = gamma, data->steps++;
    GK_LAP(work, PHASE_REMEMBER);
    return GK_OK;
}

/* The scheme's invariant (eq. 11): ½ J w² + Σ (½ v² + ½ ω² q²)/s² + ½ λᵀC′λ + Σ Φ(λ), at the end of the last step; with
 * what dampers hold */
double gk_step_energy(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k)
{
    GK_ASSERT(k && data);
    return dynamic_energy(model, setup, data, k) + data->energy.quasi_static;
}
