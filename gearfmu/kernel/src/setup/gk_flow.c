/* Coefficients of the modal oscillators q̈ + 2ζω q̇ + ω² q = f for one internal step h (docs/theory.md, 3.1, eq. 9):
 * exponential where ωh < 1.2, which is the exact flow; trapezoidal above, with a step stretched for the mesh mode.
 * Force constant in the step, ½(f_n + f_{n+1}) with equal coefficients bq, bv at both ends. With p = min(1, 2γ),
 * σ = (sin(ωh)/(ωh))^p, s² = 1/σ, κ = (1/σ − 1)/ω² (rigid: s = 1, κ = ph²/6): the sampled system then has the exact
 * pole, residue and static value, and with ζσ for ζ the loss. The scaled row sW of the derivation is carried by bq,
 * bv and κ (each times s²): state and rows stay physical. inverse_s2 = 1/s² weighs the modal energy. A lower γ first
 * takes the stiffest modes out of the exponential ones, ωh < 1.2γ, and only below ½ weakens the correction. */
#include "problem/gk_work.h"

static const double EXPONENTIAL_BELOW = 1.2;
static const double MESH_STIFFNESS = 0.1125; /* over 2(1 − ν²)/(πE) of both gears: 20 N/(mm µm) for steel */
static const double STRETCHED_MOST = 0.6;    /* of ½Ωh */

typedef struct oscillator {
    double a11, a12, a21, a22, b0q, b0v, bq, bv, mobility, kappa, inverse_s2;
} oscillator;

static oscillator free_flow(double omega, double zeta, double h)
{
    double damped = omega * sqrt(1.0 - zeta * zeta), sine, cosine;
    gk_sincos(damped * h, &sine, &cosine);
    double e = gk_exp(-zeta * omega * h), ratio = zeta * omega / damped;
    oscillator o = {e * (cosine + ratio * sine),
                    e * sine / damped,
                    -e * omega * omega / damped * sine,
                    e * (cosine - ratio * sine),
                    0,
                    0,
                    0,
                    0,
                    0,
                    0,
                    1.0};
    return o;
}

static oscillator exponential(double omega, double zeta, double h, double power)
{
    double plain, unused, omega2 = omega * omega;
    gk_sincos(omega * h, &plain, &unused);
    const double sigma = gk_exp(power * gk_log(plain / (omega * h)));
    oscillator o = free_flow(omega, zeta * sigma, h);
    o.bq = o.b0q = o.mobility = 0.5 * (1.0 - o.a11) / (omega2 * sigma);
    o.bv = o.b0v = 0.5 * o.a12 / sigma;
    o.kappa = (1.0 / sigma - 1.0) / omega2;
    o.inverse_s2 = sigma;
    return o;
}

static oscillator trapezoidal(double omega, double zeta, double h)
{
    double c = zeta * omega * h, k = 0.25 * omega * omega * h * h, d = 1.0 + c + k, bq = 0.25 * h * h / d,
           bv = 0.5 * h / d;
    oscillator o = {(1.0 + c - k) / d, h / d, -omega * omega * h / d, (1.0 - c - k) / d, bq, bv, bq, bv, bq, 0, 1.0};
    return o;
}

/* The flow in gk_real: a11 − 1, a12, a21, a22 − 1, which keeps frequencies to 1e-7 at any h. Rounded one by one to
 * single precision the four numbers let a mode grow or fade by up to 1e-7 of its energy every step, always the same
 * way. Where damping does not cover that, the nearest values and their next neighbours, each with the a21 that belongs
 * to it, are searched for the best determinant: some 1e-9 off the exact one, e^(−2ζωh). */
static void round_flow(const oscillator *o, gk_real out[4])
{
    const double wanted = o->a11 * o->a22 - o->a12 * o->a21, ulp = 1e-7, d11 = o->a11 - 1.0, d22 = o->a22 - 1.0,
                 covered = 1e-5;
    double least = INFINITY;
    out[0] = (gk_real)d11, out[1] = (gk_real)o->a12, out[2] = (gk_real)o->a21, out[3] = (gk_real)d22;
    if (sizeof(gk_real) > sizeof(float) || 1.0 - wanted > covered) return;
    for (int choice = 0; choice < 27; choice++) {
        const gk_real a[3] = {(gk_real)(d11 * (1.0 + ulp * (choice % 3 - 1))),
                              (gk_real)(o->a12 * (1.0 + ulp * (choice / 9 - 1))),
                              (gk_real)(d22 * (1.0 + ulp * (choice / 3 % 3 - 1)))};
        const double product = (1.0 + (double)a[0]) * (1.0 + (double)a[2]) - wanted; /* what a12·a21 should be */
        const gk_real a21 = (gk_real)(product / a[1]);
        const double error = fabs(product - (double)a[1] * a21);
        if (error < least) least = error, out[0] = a[0], out[1] = a[1], out[2] = a21, out[3] = a[2];
    }
}

static void store(gk_flow *f, int i, const oscillator *o)
{
    gk_real a[4] = {0, 0, 0, 0};
    if (o->a12 != 0.0) round_flow(o, a);
    f->d11[i] = a[0], f->a12[i] = a[1], f->a21[i] = a[2], f->d22[i] = a[3];
    f->b0q[i] = (gk_real)o->b0q, f->b0v[i] = (gk_real)o->b0v, f->bq[i] = (gk_real)o->bq, f->bv[i] = (gk_real)o->bv;
    f->mobility[i] = (gk_real)o->mobility;
    f->kappa[i] = (gk_real)o->kappa, f->inverse_s2[i] = (gk_real)o->inverse_s2;
}

/* Σ centre² over the dynamic ground oscillators: 1/mass that a gear's own motion in row c meets */
static double mobility_of_centre(const gk_base *base, int g, int c)
{
    const double *row = base->centre[g] + c * base->n + base->from[g];
    return gk_dot_quads(row, row, base->width[g] / 4);
}

/* rad/s: the highest mesh mode of the engagements, gears as rigid bodies on the mesh stiffness of ISO 6336-1 */
static double mesh_mode(const gk_model *model, const gk_setup *setup)
{
    double highest = 0.0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_engagement *engagement = &model->engagement[e];
        double mobility = 0.0, soft = 0.0;
        if (engagement->kind == MESH_FLAT) continue;
        for (int w = 0; w < 2; w++) {
            const int g = engagement->gear[w];
            const gk_gear *gear = &model->gear[g];
            const double turns = setup->inverse_inertia[gear->rotor] + mobility_of_centre(&setup->base, g, 5);
            mobility += gear->r_b * gear->r_b * turns;
            mobility += 0.5 * (mobility_of_centre(&setup->base, g, 0) + mobility_of_centre(&setup->base, g, 1));
            soft += gear->local;
        }
        highest = gk_max(highest, sqrt(MESH_STIFFNESS / soft * engagement->width * mobility));
    }
    return highest;
}

/* h tan x/x, x = ½Ωh, Ω: the mesh mode (docs/theory.md, 3.1) */
static double stretched(const gk_model *model, const gk_setup *setup, double h)
{
    const double x = gk_min(0.5 * h * mesh_mode(model, setup), STRETCHED_MOST);
    double sine, cosine;
    gk_sincos(x, &sine, &cosine);
    return x > 0.0 ? h * sine / (cosine * x) : h;
}

static oscillator oscillator_of(const gk_setup *setup, const gk_coefficients *k, double omega, double zeta)
{
    const oscillator nothing = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    if (!GK_ON(setup, modal_damping)) zeta = 0.0;
    if (!(omega > 0.0)) return nothing;
    if (omega * k->h >= EXPONENTIAL_BELOW * gk_max(k->gamma, 0.5)) return trapezoidal(omega, zeta, k->stretched_h);
    return exponential(omega, zeta, k->h, gk_correction(k->gamma));
}

static void fill_gear(const gk_setup *setup, gk_coefficients *k, int g)
{
    const gk_modal *modal = &setup->modal[g];
    int exact = 0;
    for (int i = 0; i < modal->n; i++) {
        const oscillator o = oscillator_of(setup, k, modal->omega[i], modal->zeta[i]);
        if (o.kappa != 0.0 && i % modal->pairs + 1 > exact) exact = i % modal->pairs + 1;
        store(&k->flow[g], i, &o);
    }
    k->flow[g].exact = (exact + LANES - 1) / LANES * LANES;
}

/* what half a step leaves of the speed along every dashpot of the supports, an exact contraction of the invariant's
 * speeds (docs/theory.md, 3.4): v ← v − (s²e/n)(1 − e^(−dh/2))(e·v), n = Σ s²e², d = c n */
static void fill_dampers(const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int d = 0; d < model->supports; d++) {
        const double *e = base->damper_rows + d * base->n;
        double mass = 0.0;
        for (int i = 0; i < base->n; i++)
            if (base->omega[i] > 0.0) mass += e[i] * e[i] / f->inverse_s2[i];
        f->decay[d] = 1.0 - gk_exp(-0.5 * model->ground[base->set].damper[d] * mass * k->h);
        f->loss[d] = mass > 0.0 ? 0.5 * f->decay[d] * (2.0 - f->decay[d]) / mass : 0.0;
        for (int i = 0; i < base->n; i++)
            f->pulls[d * base->n + i] = base->omega[i] > 0.0 && mass > 0.0 ? e[i] / (f->inverse_s2[i] * mass) : 0.0;
    }
}

/* rows that turn into each other, on the invariant's speeds y = v/s (gk_frame.c) */
static void fill_turns(const gk_setup *setup, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int r = 0; r < 2 * base->turns; r++)
        for (int i = 0; i < base->n; i++) {
            const double row = base->turn_rows[r * base->n + i], s = sqrt(f->inverse_s2[i]);
            f->turns[r * base->n + i] = row * s;
            f->turned[r * base->n + i] = row / s;
        }
    for (int i = 0; i < base->turns; i++) {
        const double *x = f->turns + 2 * i * base->n, *to_x = f->turned + 2 * i * base->n, *to_y = to_x + base->n;
        f->products[3 * i] = gk_dot_quads(x, to_x, base->n / 4);
        f->products[3 * i + 1] = gk_dot_quads(x + base->n, to_y, base->n / 4);
        f->products[3 * i + 2] = gk_dot_quads(x, to_y, base->n / 4);
    }
}

static void fill_ground(const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    const gk_base *base = &setup->base;
    gk_ground_flow *f = &k->ground;
    for (int i = 0; i < base->n; i++) {
        const oscillator o = oscillator_of(setup, k, base->omega[i], base->zeta[i]);
        const int there = base->omega[i] > 0.0;
        f->d11[i] = there ? o.a11 - 1.0 : 0.0, f->a12[i] = o.a12, f->a21[i] = o.a21,
        f->d22[i] = there ? o.a22 - 1.0 : 0.0;
        f->b0q[i] = o.b0q, f->b0v[i] = o.b0v, f->bq[i] = o.bq, f->bv[i] = o.bv;
        f->mobility[i] = o.mobility;
        f->kappa[i] = o.kappa, f->inverse_s2[i] = there ? o.inverse_s2 : 1.0;
    }
    fill_dampers(model, setup, k);
    fill_turns(setup, k);
}

/* A pure function of (model, level, bits of h, γ), kept in a small cache: no state */
const gk_coefficients *gk_flow_for(const gk_model *model, const gk_setup *setup, gk_work *work, double h, double gamma)
{
    GK_ASSERT(h > 0.0); /* γ may be that of a restored state */
    gk_coefficients *oldest = &work->cache[0];
    for (int i = 0; i < CACHE; i++) {
        gk_coefficients *k = &work->cache[i];
        if (k->age && k->h == h && k->gamma == gamma) {
            k->age = ++work->clock;
            return k;
        }
        if (k->age < oldest->age) oldest = k;
    }
    oldest->h = h;
    oldest->gamma = gamma;
    oldest->timeless = 0;
    oldest->stretched_h = stretched(model, setup, h);
    oldest->rigid_mobility = 0.25 * h * h;
    oldest->rigid_kappa = gk_correction(gamma) * h * h / 6.0;
    for (int g = 0; g < model->gears; g++) fill_gear(setup, oldest, g);
    fill_ground(model, setup, oldest);
    oldest->age = ++work->clock;
    return oldest;
}

/* coefficients in use, without making any: those of the explicit forms for h = 0 */
const gk_coefficients *gk_flow_known(const gk_work *work, double h, double gamma)
{
    GK_ASSERT(work);
    for (int i = 0; i < CACHE; i++)
        if (work->cache[i].age && work->cache[i].h == h && work->cache[i].gamma == gamma) return &work->cache[i];
    return &work->explicit_rows;
}
