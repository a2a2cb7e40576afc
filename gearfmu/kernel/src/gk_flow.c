/* Coefficients of the modal oscillators q̈ + 2ζω q̇ + ω² q = f for one internal step h (docs/theory: the step).
 *
 *   exponential where ωh < 1.2: exact flow; trapezoidal above. Force constant in the step, ½(f_n + f_{n+1}) with equal coefficients bq, bv at both ends.
 *   σ = sin(ωh)/(ωh), s = σ^(−γ/2), κ = (σ^(−γ) − 1)/ω² (rigid: s = 1, κ = γh²/6): the sampled system then has the exact pole, residue and static value.
 * The scaled row sW of the derivation is carried by bq, bv and κ (each times s²): state and rows stay physical. inverse_s2 = 1/s² weighs the modal energy. */
#include "gk_core.h"

static const double EXPONENTIAL_BELOW = 1.2;

typedef struct oscillator { double a11, a12, a21, a22, bq, bv, kappa, inverse_s2; } oscillator;

static oscillator exponential(double omega, double zeta, double h, double gamma)
{
    double decay = zeta * omega, damped = omega * sqrt(1.0 - zeta * zeta), sine, cosine, plain, unused;
    gk_sincos(damped * h, &sine, &cosine);
    gk_sincos(omega * h, &plain, &unused);
    double e = gk_exp(-decay * h), ratio = decay / damped, sigma = gk_exp(gamma * gk_log(plain / (omega * h)));
    oscillator o = {e * (cosine + ratio * sine), e * sine / damped, -e * omega * omega / damped * sine, e * (cosine - ratio * sine), 0, 0, 0, sigma};
    o.bq = 0.5 * (1.0 - o.a11) / (omega * omega * sigma);
    o.bv = 0.5 * o.a12 / sigma;
    o.kappa = (1.0 / sigma - 1.0) / (omega * omega);
    return o;
}

static oscillator trapezoidal(double omega, double zeta, double h)
{
    double c = zeta * omega * h, k = 0.25 * omega * omega * h * h, d = 1.0 + c + k;
    oscillator o = {(1.0 + c - k) / d, h / d, -omega * omega * h / d, (1.0 - c - k) / d, 0.25 * h * h / d, 0.5 * h / d, 0.0, 1.0};
    return o;
}

static void fill(const gk_setup *setup, gk_coefficients *k, int g)
{
    const gk_modal *modal = &setup->modal[g];
    gk_flow *flow = &k->flow[g];
    int exact = 0;
    for (int i = 0; i < modal->n; i++) {
        double omega = modal->omega[i], zeta = setup->on.modal_damping ? modal->zeta[i] : 0.0;
        oscillator o = {0, 0, 0, 0, 0, 0, 0, 0};
        if (omega > 0.0) {
            int exponential_mode = omega * k->h < EXPONENTIAL_BELOW;
            o = exponential_mode ? exponential(omega, zeta, k->h, k->gamma) : trapezoidal(omega, zeta, k->h);
            if (exponential_mode && i % modal->pairs + 1 > exact) exact = i % modal->pairs + 1;
        }
        flow->a11[i] = (gk_real)o.a11, flow->a12[i] = (gk_real)o.a12, flow->a21[i] = (gk_real)o.a21, flow->a22[i] = (gk_real)o.a22;
        flow->bq[i] = (gk_real)o.bq, flow->bv[i] = (gk_real)o.bv, flow->kappa[i] = (gk_real)o.kappa, flow->inverse_s2[i] = (gk_real)o.inverse_s2;
    }
    flow->exact = (exact + LANES - 1) / LANES * LANES;
}

/* A pure function of (model, level, bits of h, γ), kept in a small cache: no state */
const gk_coefficients *gk_flow_for(const gk_setup *setup, double h, double gamma)
{
    gk_work *work = setup->work;
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
    oldest->rigid_mobility = 0.25 * h * h;
    oldest->rigid_kappa = gamma * h * h / 6.0;
    for (int g = 0; g < 2; g++) fill(setup, oldest, g);
    oldest->age = ++work->clock;
    return oldest;
}
