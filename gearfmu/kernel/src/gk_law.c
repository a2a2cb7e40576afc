/* Local line contact: approach of two bodies under the line load f = λ/L of one slice, beyond what the rows over a strip of half-width w already carry
 * (docs/theory.md, eqs. 7 and 8).  With b² = β f the Hertz half-width, every body gives 2(1−ν²)/(πE)·[ln(4w/b) − 1]:
 *     δ = f (c − ½ a ln βf)      for  b_low < b < w/1.5
 * Below b_low a parabola with the same value and slope at b_low (δ(0) = 0, finite slope), above w/1.5 the tangent. δ′ > 0 everywhere, δ continuously differentiable. */
#include "gk_core.h"

static const double B_LOW = 5e-6; /* m: half-width under which a flank is rough rather than Hertzian (assumed) */

static double log_approach(const gk_local *law, double f) { return f * (law->c - 0.5 * law->a * gk_log(law->beta * f)); }
static double log_energy(const gk_local *law, double f) { return 0.5 * f * log_approach(law, f) - 0.125 * law->a * f * f; }

/* the law of a contact with 1/ρA + 1/ρB = curvature, per metre of length; law->width is the row's */
void gk_law_set(const gk_model *model, const gk_setup *setup, double curvature, gk_local *law)
{
    const gk_gear *A = &model->gear[0], *B = &model->gear[1];
    law->a = A->local + B->local;
    law->c = setup->strip_term; /* Σ local (ln 4w − 1) */
    law->beta = 2.0 * law->a / curvature; /* b² = 4 f R / (π E*), 1/E* = Σ (1−ν²)/E = Σ π·local/2 */
    const double widest = gk_min(A->strip, B->strip) / 1.5;
    law->high = widest * widest / law->beta;
    law->low = B_LOW < 0.5 * widest ? B_LOW * B_LOW / law->beta : 0.25 * law->high;
    if (!setup->on.hertz) { /* secant at torque_max carried by one tooth pair: a straight line δ = c f */
        const double reference = model->torque_max / (A->r_b * setup->width);
        law->c -= 0.5 * law->a * gk_log(law->beta * gk_clamp(reference, law->low, law->high));
        law->a = law->low = law->high = 0.0;
        law->c_low = law->slope_high = law->c;
        law->q_low = law->phi_log = law->phi_high = law->delta_high = 0.0;
        return;
    }
    const double at_low = log_approach(law, law->low), slope_low = at_low / law->low - 0.5 * law->a;
    law->c_low = 2.0 * at_low / law->low - slope_low;
    law->q_low = (slope_low - law->c_low) / (2.0 * law->low);
    law->phi_log = law->low * law->low * (0.5 * law->c_low + 2.0 / 3.0 * law->q_low * law->low) - log_energy(law, law->low);
    law->delta_high = log_approach(law, law->high);
    law->slope_high = law->delta_high / law->high - 0.5 * law->a;
    law->phi_high = log_energy(law, law->high) + law->phi_log - 0.5 * law->slope_high * law->high * law->high;
}

/* δ(λ) and δ′(λ); λ ≤ 0 follows the straight line through the origin, for iterates only */
double gk_law_approach(const gk_local *law, double force, double *slope)
{
    const double f = force / law->width;
    if (f <= law->low) {
        const double q = f > 0.0 ? law->q_low : 0.0;
        *slope = (law->c_low + 2.0 * q * f) / law->width;
        return f * (law->c_low + q * f);
    }
    if (f >= law->high) {
        *slope = law->slope_high / law->width;
        return law->delta_high + law->slope_high * (f - law->high);
    }
    const double approach = log_approach(law, f);
    *slope = (approach / f - 0.5 * law->a) / law->width;
    return approach;
}

/* ∫ λ δ′(λ) dλ: energy stored in the local contact */
double gk_law_energy(const gk_local *law, double force)
{
    const double f = force / law->width;
    if (f <= law->low) {
        const double q = f > 0.0 ? law->q_low : 0.0;
        return law->width * f * f * (0.5 * law->c_low + 2.0 / 3.0 * q * f);
    }
    if (f >= law->high) return law->width * (law->phi_high + 0.5 * law->slope_high * f * f);
    return law->width * (log_energy(law, f) + law->phi_log);
}
