/* What turning does to masses beside the conservative step (docs/theory.md, 3.10, 3.11), half a step each beside the
 * dashpots of the supports. Coriolis forces on what a carrier carries (17f) and gyroscopic forces of tilting and
 * elastic bodies (17l): pairs of rows x, y that turn into each other, v̇ = −2Ω (y x·v − x y·v), each an exact rotation
 * by Cayley's form, without energy; one after the other, in the other half step in the other order. Centrifugal load
 * m Ω² a (17g). */
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
    const double p = gk_dot_span(span, x, v), q = gk_dot_span(span, y, v);
    const double scale = 2.0 * half / (1.0 + a * b - c * c);
    gk_axpy_span(span, -scale * ((1.0 - c) * p + a * q), to_y, v);
    gk_axpy_span(span, scale * ((1.0 + c) * q - b * p), to_x, v);
}

/* half a step of all pairs on the speeds of the ground group; back: in the other order */
void gk_frame_turn(const gk_setup *setup, const gk_coefficients *k, const gk_data *data, int back, double *v)
{
    GK_ASSERT(k->h > 0.0 && v);
    const gk_base *base = &setup->base;
    for (int j = 0; j < base->turns; j++) {
        const int i = back ? base->turns - 1 - j : j;
        const double speed = GK_OF(data, v)[base->turn_rotor[i]];
        if (speed != 0.0) turn_pair(setup, &k->ground, 0.5 * k->h * speed, i, v);
    }
}

/* Speeds of a gear group turned by half a step of Coriolis forces, member into member of every pair (17j): by the angle
 * Ωh times its rate, with the cosine and sine of Cayley's form. angle: Ωh. */
void gk_frame_turn_gear(const gk_modal *m, double angle, const gk_real *from, gk_real *to)
{
    GK_ASSERT(m->turns && m->pairs % LANES == 0);
    const int halves = 2 * m->pairs / LANES;
    const gk_real half = (gk_real)(0.5 * angle);
    const gk_half *rate = (const gk_half *)m->turn_rate, *v = (const gk_half *)from, *w = v + halves;
    gk_half *first = (gk_half *)to, *second = first + halves;
    for (int i = 0; i < halves; i++) {
        const gk_half t = half * rate[i], s = (t + t) / (1 + t * t), a = v[i], b = w[i];
        first[i] = a + s * (b - t * a);
        second[i] = b - s * (a + t * b);
    }
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
    double work = 0.0;
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++) {
        const double *outward = base->outward + r * base->n, speed2 = GK_OF(data, v)[r] * GK_OF(data, v)[r];
        for (int i = 0; i < base->n && carries(model, r); i++) {
            if (outward[i] == 0.0 || !(f->a12[i] != 0.0)) continue;
            const double kick = -f->d11[i] / (f->a12[i] * base->omega2[i]) * speed2 * outward[i];
            work += f->inverse_s2[i] * (v[i] + 0.5 * kick) * kick;
            v[i] += kick;
        }
    }
    return work;
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
