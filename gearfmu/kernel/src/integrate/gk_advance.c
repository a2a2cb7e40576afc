/* Motion in a step (docs/theory.md, 3.1): every oscillator of the gear groups and of the ground group and every spin,
 * as if alone and in closed form. Predicted with the forces of the last step, corrected with those that were found.
 * Around both, half a step each, what turns speeds or damps supports (Strang). */
#include "integrate/gk_advance.h"
#include "integrate/gk_crowd.h"
#include "integrate/gk_integrate.h"
#include "problem/gk_exchange.h"

/* where arrays are whole halves (gk_real) or quads (double): the compiler need not prove that they do not overlap */
#define HALVES(array) ((gk_half *)(array))
#define SEEN_HALVES(array) ((const gk_half *)(array))
#define QUADS(array) ((gk_quad *)(array))
#define SEEN_QUADS(array) ((const gk_quad *)(array))

/* Displacements (m·√kg) and speeds (m/s·√kg) of damped oscillators end where they are less than these: products of the
 * next step are then not denormal, squares in sums of energy included. STILL of gear groups, far below their rounding;
 * UNTURNED: angle of a gear in a step. */
static const gk_real STILL = 1e-15f;
static const double GROUND_STILL = 1e-140, UNTURNED = 1e-12;

/* Half a step of the dashpots of the supports: speeds contract along them to those at rest under f; what that takes */
static double damp_supports(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, const double *f,
                            double *v)
{
    const int n = setup->base.n;
    double taken = setup->base.crowd_dampers ? gk_crowd_damp(model, &setup->base, k, f, v) : 0.0;
    for (int d = 0; d < model->supports; d++) {
        const double *e = setup->base.damper_rows + d * n, *pulls = k->ground.pulls + d * n;
        const gk_span span = setup->base.damper_span[d];
        if (!(k->ground.decay[d] > 0.0) || gk_in_crowd(&setup->base, span)) continue;
        const double held = gk_dot_span(span, k->ground.holds + d * n, f), speed = gk_dot_span(span, e, v) - held;
        gk_axpy_span(span, -k->ground.decay[d] * speed, pulls, v);
        taken += speed * (k->ground.loss[d] * speed + k->ground.gain[d] * held);
    }
    return taken;
}

/* ---- prediction -------------------------------------------------------------------------------------------------- */
/* pairs of a gear group that Coriolis forces couple */
static int turns(const gk_setup *setup, int g) { return GK_HAS(gyroscopic) ? setup->modal[g].turns : 0; }

/* Ωh of a gear */
static double angle_of(const gk_model *model, const gk_data *data, const gk_coefficients *k, int g)
{
    const double angle = k->h * GK_OF(data, v)[model->gear[g].rotor];
    return fabs(angle) < UNTURNED ? 0.0 : angle;
}

/* predicts oscillators of a gear group as if alone, those of n from `from` to the end of a part */
static void predict_modes(const gk_modal *m, const gk_flow *w, const gk_real *state, int from, gk_real *displaced,
                          gk_real *speeds)
{
    const int halves = 2 * m->n / LANES, end = 2 * (from / m->pairs + 1) * m->pairs / LANES;
    const gk_half *q = SEEN_HALVES(state), *v = q + halves, *f = v + halves;
    const gk_half *d11 = SEEN_HALVES(w->d11), *a12 = SEEN_HALVES(w->a12), *b0q = SEEN_HALVES(w->b0q);
    const gk_half *a21 = SEEN_HALVES(w->a21), *d22 = SEEN_HALVES(w->d22), *b0v = SEEN_HALVES(w->b0v);
    gk_half *qp = HALVES(displaced), *vp = HALVES(speeds);
    for (int i = 2 * from / LANES; i < end; i++) {
        qp[i] = q[i] + (d11[i] * q[i] + a12[i] * v[i] + b0q[i] * f[i]);
        vp[i] = v[i] + (a21[i] * q[i] + d22[i] * v[i] + b0v[i] * f[i]);
    }
}

static void predict_gear(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                         const gk_coefficients *k, int g)
{
    const int n = GK_LANES(setup, g), pairs = setup->modal[g].pairs, turned = turns(setup, g);
    const gk_flow *w = &k->flow[g];
    const gk_real *state = gk_modal_seen(setup, data, g);
    if (turned) gk_frame_predict(&setup->modal[g], w, angle_of(model, data, k, g), state, work, g);
    for (int i = 0; i < n; i += pairs)
        if (turned < pairs) predict_modes(&setup->modal[g], w, state, i + turned, work->qp[g], work->vp[g]);
    work->y[g] = work->qp[g];
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
    const double taken = damp_supports(model, setup, k, f, v);
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
    return taken;
}

/* Moves modal states and spins one step ahead under the forces of the last step, into the scratch. Returns what the
 * dashpots of the supports took. */
double gk_advance_predict(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                          const gk_coefficients *k)
{
    GK_ASSERT(k->h > 0.0);
    for (int g = 0; g < model->gears; g++) predict_gear(model, setup, work, data, k, g);
    for (int d = 0; d < setup->spins; d++) {
        const double acceleration = GK_OF(data, f)[d] * setup->inverse_inertia[d];
        work->spin[d] = GK_OF(data, x)[d] + k->h * GK_OF(data, v)[d] + k->rigid_mobility * acceleration;
        work->speed[d] = GK_OF(data, v)[d] + 0.5 * k->h * acceleration;
    }
    return predict_ground(model, setup, work, data, k);
}

/* ---- the end of the step ----------------------------------------------------------------------------------------- */
/* forces at the end that the next prediction is made with, where forces are linear in the step */
static const double *force_with_dampers(const gk_system *s) { return s->last; }

/* Where Coriolis forces turn the speeds of a gear group: predicted speeds to the end of the step, turned by half a
 * step. Returns what the force of this step has still to do to them. */
static const gk_real *finish_speeds(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                                    const gk_coefficients *k, int g)
{
    if (!turns(setup, g)) return k->flow[g].bv;
    gk_frame_finish(&setup->modal[g], &k->flow[g], angle_of(model, data, k, g), work, g);
    return work->room.zero;
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
        gk_half q1 = qp[i] + bq[i] * z[i], v1 = vp[i] + bv[i] * z[i];
        q1 = GK_HALF_FADED(q1, STILL), v1 = GK_HALF_FADED(v1, STILL);
        const gk_half moved = q1 - q[i];
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

/* modal force at the end of the step and its rate */
static void take_force(const gk_real *next, int n, double h, gk_real *force)
{
    const gk_half *from = SEEN_HALVES(next);
    gk_half *f = HALVES(force), *rate = HALVES(force + n);
    const gk_real per_step = (gk_real)(1.0 / h);
    for (int i = 0; i < 2 * n / LANES; i++) rate[i] = (from[i] - f[i]) * per_step, f[i] = from[i];
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
    gk_quad *x4 = QUADS(gk_ground_of(data)), *v4 = QUADS(v), *f4 = QUADS(v + n), *rate4 = f4 + n / 4, sum = {0};
    const gk_quad *qp = SEEN_QUADS(work->ground_q), *vp = SEEN_QUADS(work->ground_v),
                  *z = SEEN_QUADS(work->ground_force);
    const gk_quad *v0 = SEEN_QUADS(work->ground_start), *next = SEEN_QUADS(work->ground_next);
    const gk_quad *bq = SEEN_QUADS(w->bq), *bv = SEEN_QUADS(w->bv), *weight = SEEN_QUADS(w->inverse_s2);
    const gk_quad *omega2 = SEEN_QUADS(base->omega2);
    for (int i = 0; i < n / 4; i++) {
        gk_quad x1 = qp[i] + bq[i] * z[i], v1 = vp[i] + bv[i] * z[i];
        x1 = GK_QUAD_FADED(x1, GROUND_STILL), v1 = GK_QUAD_FADED(v1, GROUND_STILL);
        const gk_quad moved = x1 - x4[i];
        sum += (f4[i] + z[i]) * moved - weight[i] * ((v1 - v0[i]) * (v1 + v0[i]) + omega2[i] * moved * (x1 + x4[i]));
        x4[i] = x1;
        v4[i] = v1;
        rate4[i] = (next[i] - f4[i]) / k->h;
        f4[i] = next[i];
    }
    const double taken = damped ? 0.5 * ((sum[0] + sum[2]) + (sum[1] + sum[3])) : 0.0;
    data->energy.work += work->pressed + gk_frame_press(model, setup, k, data, v);
    gk_frame_turn(setup, k, data, 1, v);
    return taken + damp_supports(model, setup, k, v + n, v);
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
            for (int i = s->n - s->joint.clutches; i < s->n; i++) last -= s->rigid[l][i] * s->force[i];
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
        GK_OF(data, x)[d] = work->spin[d] + k->rigid_mobility * setup->inverse_inertia[d] * z[d];
        GK_OF(data, v)[d] = work->speed[d] + 0.5 * k->h * setup->inverse_inertia[d] * z[d];
        GK_OF(data, f_rate)[d] = (force[d] - GK_OF(data, f)[d]) / k->h;
        GK_OF(data, f)[d] = force[d];
        work->moved[d] = GK_OF(data, x)[d] - before;
    }
}

/* Moves modal states and spins to the end of the step, in the data. */
void gk_advance_correct(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                        const gk_coefficients *k)
{
    GK_ASSERT(work->ground_y && k->h > 0.0);
    for (int e = 0; e < model->engagements; e++) {
        gk_system *s = &work->engaged[e].system;
        memcpy(s->last, s->force, (size_t)s->stride * sizeof *s->last);
        if (GK_ON(setup, friction)) work->engaged[e].glide->taken = gk_friction_settle(work->engaged[e].glide, s);
    }
    gk_exchange_scatter(model, setup, work, gk_step_z, force_with_dampers);
    for (int g = 0; g < model->gears; g++) {
        const int n = GK_LANES(setup, g), e = engagement_of(model, g);
        gk_real *q = gk_modal_of(setup, data, g);
        if (!n || e < 0) continue;
        const gk_real *bv_left = finish_speeds(model, setup, work, data, k, g);
        if (GK_ON(setup, modal_damping))
            data->energy.dissipated += correct_damped(setup, work, k, g, bv_left, q);
        else /* what rounding gave or took */
            work->engaged[e].system.energy.error -= correct_undamped(setup, work, k, g, bv_left, q);
        take_force(work->next[g], n, k->h, q + 2 * n);
    }
    data->energy.dissipated += correct_ground(model, setup, work, data, k);
    correct_spins(model, setup, work, data, k);
}
