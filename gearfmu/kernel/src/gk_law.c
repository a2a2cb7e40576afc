/* Local line contact: approach of two bodies under the line load f = λ/L of one slice, beyond what the rows over a strip of half-width w already carry
 * (docs/theory.md, eqs. 7 and 8).  With b² = β f the Hertz half-width, every body gives 2(1−ν²)/(πE)·[ln(4w/b) − 1]:
 *     δ = f (c − ½ a ln βf)      for  b_low < b < w/1.5
 * Below b_low a parabola with the same value and slope at b_low (δ(0) = 0, finite slope), above w/1.5 the tangent. δ′ > 0 everywhere, δ continuously differentiable. */
#include "gk_core.h"

static const double B_LOW = 5e-6; /* m: half-width under which a flank is rough rather than Hertzian (assumed) */

/* the law of a contact with 1/ρA + 1/ρB = curvature, per metre of length. b² at its bounds is the same for all curvatures, so are the logarithms there. */
void gk_law_set(const gk_model *model, const gk_setup *setup, double curvature, gk_local *law)
{
    const gk_gear *A = &model->gear[0], *B = &model->gear[1];
    law->a = A->local + B->local;
    law->c = setup->strip_term; /* Σ local (ln 4w − 1) */
    law->beta = 2.0 * law->a / curvature; /* b² = 4 f R / (π E*), 1/E* = Σ (1−ν²)/E = Σ π·local/2 */
    law->low = setup->square_low / law->beta;
    law->high = setup->square_high / law->beta;
    if (!GK_ON(setup, hertz)) { /* secant at torque_max carried by one tooth pair: a straight line δ = c f */
        const double reference = model->torque_max / (A->r_b * setup->width);
        law->c -= 0.5 * law->a * gk_log(law->beta * gk_clamp(reference, law->low, law->high));
        law->a = law->low = law->high = 0.0;
        law->c_low = law->slope_high = law->c;
        law->q_low = law->phi_log = law->phi_high = law->delta_high = 0.0;
        return;
    }
    const double secant_low = law->c - 0.5 * law->a * setup->log_low, secant_high = law->c - 0.5 * law->a * setup->log_high; /* δ/f at the bounds */
    law->c_low = secant_low + 0.5 * law->a;
    law->q_low = -0.5 * law->a / law->low;
    law->phi_log = law->low * law->low * (0.5 * law->c_low + 2.0 / 3.0 * law->q_low * law->low - 0.5 * secant_low + 0.125 * law->a);
    law->delta_high = secant_high * law->high;
    law->slope_high = secant_high - 0.5 * law->a;
    law->phi_high = law->high * law->high * (0.5 * secant_high - 0.125 * law->a - 0.5 * law->slope_high) + law->phi_log;
}

/* half-widths at which the logarithm begins and ends */
void gk_law_bounds(const gk_model *model, gk_setup *setup)
{
    const double widest = gk_min(model->gear[0].strip, model->gear[1].strip) / 1.5;
    setup->square_high = widest * widest;
    setup->square_low = B_LOW < 0.5 * widest ? B_LOW * B_LOW : 0.25 * setup->square_high;
    setup->log_low = gk_log(setup->square_low);
    setup->log_high = gk_log(setup->square_high);
}

/* δ, δ′ and ∫ λ dδ of a strip of length `width`; λ ≤ 0 follows the straight line through the origin, for iterates only */
gk_approach gk_law_at(const gk_local *law, double width, double force)
{
    const double f = force / width;
    gk_approach at;
    if (GK_HAS(hertz) && f <= law->low) {
        const double q = f > 0.0 ? law->q_low : 0.0;
        at.delta = f * (law->c_low + q * f);
        at.slope = (law->c_low + 2.0 * q * f) / width;
        at.energy = width * f * f * (0.5 * law->c_low + 2.0 / 3.0 * q * f);
    } else if (!GK_HAS(hertz) || f >= law->high) {
        at.delta = law->delta_high + law->slope_high * (f - law->high);
        at.slope = law->slope_high / width;
        at.energy = width * (law->phi_high + 0.5 * law->slope_high * f * f);
    } else {
        const double secant = law->c - 0.5 * law->a * gk_log(law->beta * f);
        at.delta = f * secant;
        at.slope = (secant - 0.5 * law->a) / width;
        at.energy = width * (f * f * (0.5 * secant - 0.125 * law->a) + law->phi_log);
    }
    return at;
}
