/* One oscillator q̈ + 2ζωq̇ + ω²q = f in a step of length h whose force is ½(f_n + f_{n+1}) (docs/theory.md, 3.1, (9)).
 * A constant force in the step, half by either end, is an impulse h f at every end of a step. The state is ρ times the
 * exact response to these impulses, at the middle of an impulse; κ is the excess of its static value. With a = ½ωh,
 * b = ½Ωh, the residue ρ = sinc(a + b) sinc(a − b) sinc a/(cos a sinc² b) makes the response exact at rest and at Ω; ρ₀
 * makes it exact at rest with κ = 0, and γ < ½ goes from one to the other. Oscillators that are too fast for the step
 * yield in part at once (share θ: κ = −θ/ω²); the rest is trapezoidal, with a step of its own that makes the sum exact
 * at rest and at Ω. γ < 1 first raises θ, then makes fewer of them exponential, then weakens the correction. */
#include "setup/gk_oscillator.h"
#include "base/gk_check.h"
#include "base/gk_lanes.h"
#include "base/gk_math.h"

static const double EXPONENTIAL = 1.6, HIGH_EXPONENTIAL = 1.2; /* ωh below it; of oscillators above HIGH */
static const double HIGH = 188495.55921538758;                 /* rad/s: so that short steps keep γ = 1 */
static const double MATCHED_BELOW = 0.7;                       /* of ω of an oscillator that is too fast */
static const double SHARE = 0.7, RAISED = 0.95, WHOLE = 3.0;   /* θ; with a lower γ; from this ωh on */
static const double RAISED_AT = 0.75, FEWEST_AT = 0.5;         /* γ: θ at its most; fewest exponential ones */

static double sinc(double x)
{
    double sine, cosine;
    gk_sincos(x, &sine, &cosine);
    return x != 0.0 ? sine / x : 1.0;
}

double gk_oscillator_correction(double gamma) { return gk_min(1.0, gamma / FEWEST_AT); }

/* from 1 at γ = high to 0 at γ = low */
static double between(double gamma, double low, double high)
{
    return gk_clamp((gamma - low) / (high - low), 0.0, 1.0);
}

/* ωh from which on an oscillator is not exponential */
static double exponential_below(double gamma, double omega)
{
    return (omega < HIGH ? EXPONENTIAL : HIGH_EXPONENTIAL) * 0.5 * (1.0 + between(gamma, FEWEST_AT, RAISED_AT));
}

/* θ of an oscillator with this ωh */
static double share_at_once(double gamma, double x)
{
    const double most = RAISED + (SHARE - RAISED) * between(gamma, RAISED_AT, 1.0);
    return most * gk_clamp((x - EXPONENTIAL) / (WHOLE - EXPONENTIAL), 0.0, 1.0);
}

static gk_oscillator flow(double omega, double zeta, double h)
{
    const double damped = omega * sqrt(1.0 - zeta * zeta), e = gk_exp(-zeta * omega * h), ratio = zeta * omega / damped;
    double sine, cosine;
    gk_sincos(damped * h, &sine, &cosine);
    return (gk_oscillator){.a11 = e * (cosine + ratio * sine),
                           .a12 = e * sine / damped,
                           .a21 = -e * omega * omega / damped * sine,
                           .a22 = e * (cosine - ratio * sine),
                           .inverse_s2 = 1.0,
                           .unit = 1.0};
}

/* determinant of 1 − E: (1 − e)² + 4e sin² ½ω_d h, which keeps its digits in short steps */
static double determinant(double omega, double zeta, double h)
{
    const double e = gk_exp(-zeta * omega * h);
    double sine, cosine;
    gk_sincos(0.5 * h * omega * sqrt(1.0 - zeta * zeta), &sine, &cosine);
    return (1.0 - e) * (1.0 - e) + 4.0 * e * sine * sine;
}

/* Response to impulses h, E the flow, at the middle of an impulse: S = ½h (1 + E)⁻¹(E − 1) b, b = (0, 1), is the state
 * by the force of the moment; w the state at rest by f = 1, without S; w′ its speed while f = t, without that by f */
static gk_oscillator exponential(const gk_pace *pace, double omega, double zeta)
{
    const double h = pace->h, omega2 = omega * omega, a = 0.5 * omega * h, b = 0.5 * pace->matched * h;
    gk_oscillator o = flow(omega, zeta, h);
    const double p = 1.0 + o.a11, q = 1.0 + o.a22, plus = p * q - o.a12 * o.a21, minus = determinant(omega, zeta, h);
    const double e2 = o.a11 * o.a22 - o.a12 * o.a21;
    const double S_q = 0.5 * h * o.a12 * (q - (o.a22 - 1.0)) / plus;
    const double S_v = 0.5 * h * (p * (o.a22 - 1.0) - o.a21 * o.a12) / plus;
    const double w_q = h * o.a12 / minus, w_v = h * (0.5 * (1.0 - e2) - zeta * omega * o.a12) / minus;
    const double rate = h * ((1.0 - o.a11) * (0.5 * h - w_v) - o.a21 * w_q) / minus;
    double sine, cosine;
    gk_sincos(a, &sine, &cosine);
    const double matched = sinc(a + b) * sinc(a - b) * sinc(a) / (cosine * sinc(b) * sinc(b));
    const double rest = 1.0 / (omega2 * (S_q + w_q)), part = gk_oscillator_correction(pace->gamma);
    const double softer = part < 1.0 ? gk_exp(part * gk_log(matched / rest)) : matched / rest, rho = rest * softer;
    o.bq = o.b0q = o.mobility = rho * S_q;
    o.bv = o.b0v = rho * (0.5 * h + S_v);
    o.kappa = (softer - 1.0) / omega2;
    o.inverse_s2 = sinc(omega * h) / rho;
    o.lead = rho * rate - 1.0 / omega2;
    o.hold = rho * (S_v + w_v);
    return o;
}

static gk_oscillator trapezoidal(double omega, double zeta, double h)
{
    const double c = zeta * omega * h, k = 0.25 * omega * omega * h * h, d = 1.0 + c + k;
    const double bq = 0.25 * h * h / d, bv = 0.5 * h / d;
    return (gk_oscillator){.a11 = (1.0 + c - k) / d,
                           .a12 = h / d,
                           .a21 = -omega * omega * h / d,
                           .a22 = (1.0 - c - k) / d,
                           .b0q = bq,
                           .b0v = bv,
                           .bq = bq,
                           .bv = bv,
                           .mobility = bq,
                           .inverse_s2 = 1.0,
                           .unit = 1.0};
}

/* θ of the compliance at once, the rest trapezoidal with the step h̃ = h (tan b/b) √(1 − θ + θu), u = (Ω/ω)²; its
 * damping ζh̃/(h(1 − θ)) keeps the loss at low frequencies, its speeds are in units of h/h̃ */
static gk_oscillator partly_at_once(const gk_pace *pace, double omega, double zeta)
{
    const double theta = share_at_once(pace->gamma, omega * pace->h), left = 1.0 - theta;
    const double Omega = gk_min(pace->matched, MATCHED_BELOW * omega), u = Omega * Omega / (omega * omega);
    double sine, cosine;
    gk_sincos(0.5 * Omega * pace->h, &sine, &cosine);
    const double longer = sinc(0.5 * Omega * pace->h) / cosine * sqrt(left + theta * u); /* h̃/h */
    gk_oscillator o = trapezoidal(omega, zeta * longer / left, longer * pace->h);
    o.bq *= left, o.bv *= left, o.b0q *= left, o.b0v *= left, o.mobility *= left;
    o.inverse_s2 = 1.0 / left;
    o.kappa = -theta / (omega * omega);
    o.unit = 1.0 / longer;
    o.lead = o.kappa / longer;
    return o;
}

gk_oscillator gk_oscillator_of(const gk_pace *pace, double omega, double zeta)
{
    GK_ASSERT(pace && pace->h > 0.0 && omega > 0.0 && zeta >= 0.0);
    const int slow = omega * pace->h < exponential_below(pace->gamma, omega);
    return slow ? exponential(pace, omega, zeta) : partly_at_once(pace, omega, zeta);
}

/* κ of a free mass, per 1/m: ¼h² + 1/Ω² − ¼h²/sin² ½Ωh, which is h²/6 where Ω = 0 */
double gk_oscillator_free_kappa(const gk_pace *pace)
{
    static const double SMALL = 0.05; /* of ½Ωh: below it by its series */
    const double b = 0.5 * pace->matched * pace->h, b2 = b * b;
    double sine, cosine;
    gk_sincos(b, &sine, &cosine);
    const double beyond = b > SMALL ? 1.0 / (sine * sine) - 1.0 / b2
                                    : 1.0 / 3.0 + b2 * (1.0 / 15.0 + b2 * (2.0 / 189.0 + b2 / 675.0));
    return gk_oscillator_correction(pace->gamma) * 0.25 * pace->h * pace->h * (1.0 - beyond);
}
