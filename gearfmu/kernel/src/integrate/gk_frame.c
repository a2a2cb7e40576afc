/* What turning does to masses beside the conservative step (docs/theory.md, 3.10, 3.11), half a step each beside the
 * dashpots of the supports. Coriolis forces on what a carrier carries (17f) and gyroscopic forces of tilting and
 * elastic bodies (17l): pairs of rows x, y that turn into each other, v̇ = −2Ω (y x·v − x y·v), each an exact rotation
 * by Cayley's form, without energy; one after the other, in the other half step in the other order. Centrifugal load
 * m Ω² a (17g). */
#include "integrate/gk_crowd.h"
#include "integrate/gk_integrate.h"

static int carries(const gk_model *model, int rotor)
{
    for (int i = 0; i < model->carried; i++)
        if (model->carried_frame[i] == rotor) return 1;
    return 0;
}

/* half a step of one pair: v changes by −½θ (y (x·v + x·v′) − x (y·v + y·v′)), θ = Ωh */
static void turn_pair(const gk_setup *setup, const gk_ground_flow *f, double half, int i, double *v)
{
    const int n = setup->base.n;
    const double *x = f->turns + 2 * i * n, *y = x + n, *to_x = f->turned + 2 * i * n, *to_y = to_x + n;
    const gk_span span = setup->base.turn_span[i];
    const double a = half * f->products[3 * i], b = half * f->products[3 * i + 1], c = half * f->products[3 * i + 2];
    const int from = span.from / 4, to = from + span.width / 4;
    gk_quad px = {0}, py = {0}, *speed = (gk_quad *)v;
    for (int k = from; k < to; k++) px += ((const gk_quad *)x)[k] * speed[k], py += ((const gk_quad *)y)[k] * speed[k];
    const double p = (px[0] + px[2]) + (px[1] + px[3]), q = (py[0] + py[2]) + (py[1] + py[3]);
    const double scale = 2.0 * half / (1.0 + a * b - c * c);
    const double by_y = -scale * ((1.0 - c) * p + a * q), by_x = scale * ((1.0 + c) * q - b * p);
    for (int k = from; k < to; k++)
        speed[k] = (speed[k] + by_y * ((const gk_quad *)to_y)[k]) + by_x * ((const gk_quad *)to_x)[k];
}

/* half a step of all pairs on the speeds of the ground group; back: in the other order */
void gk_frame_turn(const gk_setup *setup, const gk_coefficients *k, const gk_data *data, int back, double *v)
{
    GK_ASSERT(k->h > 0.0 && v);
    const gk_base *base = &setup->base;
    if (base->crowd.width && !back) gk_crowd_turn(base, k, data, v);
    for (int j = 0; j < base->turns; j++) {
        const int i = back ? base->turns - 1 - j : j;
        const double speed = GK_OF(data, v)[base->turn_rotor[i]];
        if (speed != 0.0 && !gk_in_crowd(base, base->turn_span[i]))
            turn_pair(setup, &k->ground, 0.5 * k->h * speed, i, v);
    }
    if (base->crowd.width && back) gk_crowd_turn(base, k, data, v);
}

/* ---- gear groups ------------------------------------------------------------------------------------------------- */
/* A slow gear turns by less than the last place of a speed in single precision: rounded after its turn, the small
 * member of a pair would gain energy and the large one not lose it. So speeds are in double from the first turn of a
 * step to the second, and rounded once with all that changes them. */

/* turns members v, w of eight pairs by half a step (17j): by the angle Ωh times the rate, with the cosine and sine of
 * Cayley's form. half: ½Ωh. */
GK_INLINE void turn_members(gk_real half, const gk_real *rate, gk_eight *v, gk_eight *w)
{
    const gk_half tangent = half * *(const gk_half *)rate, sine = (tangent + tangent) / (1 + tangent * tangent);
    gk_eight t = GK_WIDER(tangent), s = GK_WIDER(sine);
    for (int j = 0; j < 2; j++) {
        const gk_quad x = GK_QUAD_OF(*v, j), y = GK_QUAD_OF(*w, j);
        GK_QUAD_OF(*v, j) = x + GK_QUAD_OF(s, j) * (y - GK_QUAD_OF(t, j) * x);
        GK_QUAD_OF(*w, j) = y - GK_QUAD_OF(s, j) * (x + GK_QUAD_OF(t, j) * y);
    }
}

/* predicts eight oscillators of a gear group, from the i-th on, whose speeds are v */
GK_INLINE void predict_members(const gk_flow *w, const gk_real *q, const gk_real *f, int i, gk_eight *v, gk_eight *to)
{
    const gk_half x = *(const gk_half *)(q + i), force = *(const gk_half *)(f + i);
    gk_eight a12 = GK_WIDER(*(const gk_half *)(w->a12 + i)), d22 = GK_WIDER(*(const gk_half *)(w->d22 + i));
    gk_eight moved = GK_WIDER(*(const gk_half *)(w->d11 + i) * x + *(const gk_half *)(w->b0q + i) * force);
    gk_eight pushed = GK_WIDER(*(const gk_half *)(w->a21 + i) * x + *(const gk_half *)(w->b0v + i) * force);
    gk_eight from = GK_WIDER(x);
    for (int j = 0; j < 2; j++) {
        const gk_quad speed = GK_QUAD_OF(*v, j);
        GK_QUAD_OF(to[0], j) = GK_QUAD_OF(from, j) + (GK_QUAD_OF(moved, j) + GK_QUAD_OF(a12, j) * speed);
        GK_QUAD_OF(to[1], j) = speed + (GK_QUAD_OF(pushed, j) + GK_QUAD_OF(d22, j) * speed);
    }
}

/* Predicts the oscillators of gear group g that Coriolis forces couple, after the first half step of these. angle: Ωh;
 * state: q, v, f. */
void gk_frame_predict(const gk_modal *m, const gk_flow *w, double angle, const gk_real *state, gk_work *work, int g)
{
    GK_ASSERT(m->turns <= m->pairs && m->turns % (LANES / 2) == 0);
    const gk_real *v = state + m->n;
    for (int i = 0; i < m->turns; i += LANES / 2) {
        gk_eight speed[2] = {GK_WIDER(*(const gk_half *)(v + i)), GK_WIDER(*(const gk_half *)(v + m->pairs + i))};
        turn_members((gk_real)(0.5 * angle), m->turn_rate + i, &speed[0], &speed[1]);
        for (int part = 0; part < 2; part++) {
            const int k = part * m->pairs + i;
            gk_eight to[2];
            predict_members(w, state, state + 2 * m->n, k, &speed[part], to);
            *(gk_half *)(work->qp[g] + k) = GK_ROUNDED(to[0]);
            *(gk_half *)(work->vp[g] + k) = GK_ROUNDED(to[1]);
            for (int j = 0; j < 2; j++) ((gk_quad *)(work->turned_speed[g] + k))[j] = GK_QUAD_OF(to[1], j);
        }
    }
}

/* eight predicted speeds, from the i-th on, with what the forces z of the step give them */
GK_INLINE void push_members(const gk_real *bv, const gk_real *z, const double *predicted, int i, gk_eight *v)
{
    *v = GK_WIDER(*(const gk_half *)(bv + i) * *(const gk_half *)(z + i));
    for (int j = 0; j < 2; j++) GK_QUAD_OF(*v, j) += ((const gk_quad *)(predicted + i))[j];
}

/* Brings predicted speeds of gear group g to the end of the step, with the second half step of Coriolis forces. angle:
 * Ωh. */
void gk_frame_finish(const gk_modal *m, const gk_flow *w, double angle, gk_work *work, int g)
{
    const gk_real *z = work->force[g];
    gk_real *to = work->vp[g];
    for (int i = 0; i < m->turns; i += LANES / 2) {
        gk_eight v[2];
        for (int part = 0; part < 2; part++)
            push_members(w->bv, z, work->turned_speed[g], part * m->pairs + i, &v[part]);
        turn_members((gk_real)(0.5 * angle), m->turn_rate + i, &v[0], &v[1]);
        for (int part = 0; part < 2; part++) *(gk_half *)(to + part * m->pairs + i) = GK_ROUNDED(v[part]);
    }
    for (int i = m->turns; i < m->pairs; i += LANES / 2)
        for (int k = i; k < m->n; k += m->pairs)
            *(gk_half *)(to + k) += *(const gk_half *)(w->bv + k) * *(const gk_half *)(z + k);
}

/* adds the same as accelerations, for explicit integrators */
void gk_frame_gear_rates(const gk_modal *m, double speed, const gk_real *v, gk_real *a)
{
    GK_ASSERT(m->turns && v != a);
    for (int i = 0; i < m->pairs; i++) {
        const gk_real twice = (gk_real)(2.0 * speed) * m->turn_rate[i];
        a[i] += twice * v[m->pairs + i];
        a[m->pairs + i] -= twice * v[i];
    }
}

/* Half a step of centrifugal loads: the kick that at rest gives the displacement F/ω² at the ends of steps. Returns its
 * work; it comes from outside, the carrier's spin does not feel it. */
double gk_frame_press(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, const gk_data *data,
                      double *v)
{
    GK_ASSERT(k && v);
    const gk_base *base = &setup->base;
    const gk_ground_flow *f = &k->ground;
    gk_quad work = {0}, *to = (gk_quad *)v;
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++) {
        const gk_quad *outward = (const gk_quad *)(base->outward + r * base->n), *press = (const gk_quad *)f->press,
                      *weight = (const gk_quad *)f->inverse_s2;
        const double speed2 = GK_OF(data, v)[r] * GK_OF(data, v)[r];
        if (!carries(model, r)) continue;
        for (int q = 0; q < base->n / 4; q++) {
            const gk_quad kick = press[q] * speed2 * outward[q];
            work += weight[q] * (to[q] + 0.5 * kick) * kick;
            to[q] += kick;
        }
    }
    return (work[0] + work[2]) + (work[1] + work[3]);
}

/* adds the centrifugal loads themselves */
void gk_frame_load(const gk_model *model, const gk_setup *setup, const gk_data *data, double *force)
{
    GK_ASSERT(force);
    const gk_base *base = &setup->base;
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        if (carries(model, r))
            gk_axpy(GK_OF(data, v)[r] * GK_OF(data, v)[r], base->outward + r * base->n, force, 0, base->n / 4);
}

/* the accelerations of both, for explicit integrators: speeds of the spins and v of the ground group */
void gk_frame_rates(const gk_model *model, const gk_setup *setup, const double *spin, const double *v, double *a)
{
    GK_ASSERT(v != a || !setup->base.n);
    const gk_base *base = &setup->base;
    const int n = base->n;
    for (int i = 0; i < base->turns; i++) {
        const double *x = base->turn_rows + 2 * i * n, *y = x + n, twice = 2.0 * spin[base->turn_rotor[i]];
        const gk_span span = base->turn_span[i];
        const double along = gk_dot_span(span, x, v), across = gk_dot_span(span, y, v);
        gk_axpy_span(span, twice * across, x, a);
        gk_axpy_span(span, -twice * along, y, a);
    }
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        if (carries(model, r)) gk_axpy(spin[r] * spin[r], base->outward + r * n, a, 0, n / 4);
}
