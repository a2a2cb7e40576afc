/* Local line contact: approach of two bodies under the line load of one slice, beyond what the rows over a strip of half-width w already carry
 * (docs/theory: local law).  With b² = β λ the Hertz half-width, every body gives 2(1−ν²)/(πEL)·[ln(4w/b) − 1]:
 *     δ(λ) = λ (c − ½ a ln βλ)      for  b_low < b < w/1.5
 * Below b_low a parabola with the same value and slope at b_low (δ(0) = 0, finite slope), above w/1.5 the tangent. δ′ > 0 everywhere, δ continuously differentiable. */
#include "gk_core.h"

static const double B_LOW = 5e-6; /* m: half-width under which a flank is rough rather than Hertzian (assumed) */

static double log_approach(const gk_local *law, double force) { return force * (law->c - 0.5 * law->a * gk_log(law->beta * force)); }
static double log_energy(const gk_local *law, double force) { return 0.5 * force * log_approach(law, force) - 0.125 * law->a * force * force; }

void gk_law_set(const gk_model *model, const gk_setup *setup, double curvature, gk_local *law)
{
    double strip = 1.0, length = 0.0;
    law->a = law->c = 0.0;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = &model->gear[i];
        double compliance = gear->local / setup->slice_width[i];
        law->a += compliance;
        law->c += compliance * (gk_log(4.0 * gear->strip) - 1.0);
        strip = i == 0 || gear->strip < strip ? gear->strip : strip;
        length = i == 0 || setup->slice_width[i] < length ? setup->slice_width[i] : length;
    }
    /* b² = 4 F′ R / (π E*), 1/E* = Σ (1−ν²)/E = Σ π·local/2 */
    law->beta = 2.0 * (model->gear[0].local + model->gear[1].local) / (length * curvature);
    double widest = strip / 1.5;
    law->high = widest * widest / law->beta;
    law->low = B_LOW < 0.5 * widest ? B_LOW * B_LOW / law->beta : 0.25 * law->high;
    if (!setup->on.hertz) { /* secant at torque_max carried by one tooth pair */
        double reference = model->torque_max / (model->gear[0].r_b * setup->slices);
        law->c -= 0.5 * law->a * gk_log(law->beta * gk_clamp(reference, law->low, law->high));
        law->a = 0.0;
        law->low = law->high = 0.0; /* a straight line: δ = c λ */
        law->c_low = law->slope_high = law->c;
        law->q_low = law->phi_log = law->phi_high = law->delta_high = 0.0;
        return;
    }
    double at_low = log_approach(law, law->low), slope_low = at_low / law->low - 0.5 * law->a;
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
    if (force <= law->low) {
        double q = force > 0.0 ? law->q_low : 0.0;
        *slope = law->c_low + 2.0 * q * force;
        return force * (law->c_low + q * force);
    }
    if (force >= law->high) {
        *slope = law->slope_high;
        return law->delta_high + law->slope_high * (force - law->high);
    }
    double approach = log_approach(law, force);
    *slope = approach / force - 0.5 * law->a;
    return approach;
}

/* ∫ λ δ′(λ) dλ: energy stored in the local contact */
double gk_law_energy(const gk_local *law, double force)
{
    if (force <= law->low) {
        double q = force > 0.0 ? law->q_low : 0.0;
        return force * force * (0.5 * law->c_low + 2.0 / 3.0 * q * force);
    }
    if (force >= law->high) return law->phi_high + 0.5 * law->slope_high * force * force;
    return log_energy(law, force) + law->phi_log;
}
