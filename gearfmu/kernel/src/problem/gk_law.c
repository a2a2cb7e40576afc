/* Local line contact: approach of two bodies under the line load f = λ/L of one slice, beyond what the rows over a
 * strip of half-width w already carry (docs/theory.md, eqs. 7 and 8).  With b² = β f the Hertz half-width, every body
 * gives 2(1−ν²)/(πE)·[ln(4w/b) − 1]: δ = f (c − ½ a ln βf)      for  b_low < b < w/1.5 Below b_low a parabola with the
 * same value and slope at b_low (δ(0) = 0, finite slope), above w/1.5 the tangent. δ′ > 0 everywhere, δ continuously
 * differentiable. */
#include "problem/gk_system.h"

static const double B_LOW = 5e-6;     /* m: half-width under which a flank is rough rather than Hertzian (assumed) */
static const double FOUNDATION = 6.0; /* 1/k over the sum of both bodies' 2 (1 − ν²)/(πE) */

/* secant at torque_max carried by one tooth pair: a straight line δ = c f */
static void straighten(const gk_engagement *e, gk_laws *law)
{
    const double reference = e->force_max / e->width;
    for (int l = 0; l < 4; l++)
        law->c[l] -= 0.5 * law->a[l] * gk_log(law->beta[l] * gk_clamp(reference, law->low[l], law->high[l]));
    law->a = law->low = law->high = GK_ALL(0.0);
    law->c_low = law->slope_high = law->c;
    law->q_low = law->phi_log = law->phi_high = law->delta_high = GK_ALL(0.0);
}

/* the laws of four contacts with 1/ρA + 1/ρB = curvature, per metre of length. b² at its bounds is the same for all
 * curvatures, so are the logarithms there. */
static void set_four(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *curvature,
                     gk_laws *law)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    law->a = GK_ALL(model->gear[e->gear[0]].local + model->gear[e->gear[1]].local);
    law->c = GK_ALL(mesh->strip_term);                      /* Σ local (ln 4w − 1) */
    law->beta = 2.0 * law->a / *(const gk_quad *)curvature; /* b² = 4 f R / (π E*), 1/E* = Σ (1−ν²)/E = Σ π·local/2 */
    law->low = mesh->square_low / law->beta;
    law->high = mesh->square_high / law->beta;
    if (!GK_ON(setup, hertz)) {
        straighten(e, law);
        return;
    }
    const gk_quad secant_low = law->c - 0.5 * law->a * mesh->log_low,
                  secant_high = law->c - 0.5 * law->a * mesh->log_high; /* δ/f at the bounds */
    law->c_low = secant_low + 0.5 * law->a;
    law->q_low = -0.5 * law->a / law->low;
    law->phi_log = law->low * law->low *
                   (0.5 * law->c_low + 2.0 / 3.0 * law->q_low * law->low - 0.5 * secant_low + 0.125 * law->a);
    law->delta_high = secant_high * law->high;
    law->slope_high = secant_high - 0.5 * law->a;
    law->phi_high = law->high * law->high * (0.5 * secant_high - 0.125 * law->a - 0.5 * law->slope_high) + law->phi_log;
}

/* Parts of a line of contact close place after place, in the order of their gaps 0 = d₁ ≤ d₂ …: on a foundation of
 * stiffness k per length the j-th but first closes at f = k (j/Q)(d_{j+1} − mean of d₁ … d_j), Q = GAPS places. */
static void set_closing(const gk_system *s, int i, gk_laws *law)
{
    gk_quad sum = GK_ALL(0.0);
    for (int j = 1; j < GAPS; j++) {
        const gk_quad next = *(const gk_quad *)(s->flank.opens[j - 1] + i);
        law->closes[j - 1] = (j * next - sum) / (GAPS * s->flank.yields);
        sum += next;
    }
}

/* the laws of all contacts of a problem, by their curvatures */
void gk_law_set(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, gk_system *s)
{
    GK_ASSERT(s->contacts >= 0 && s->contacts <= MAX_CONTACTS);
    s->flank.yields = mesh->yields;
    for (int i = s->contacts; i % 4; i++) {
        s->flank.curvature[i] = s->flank.curvature[0];
        for (int k = 0; k < GAPS - 1; k++) s->flank.opens[k][i] = 0.0;
    }
    for (int i = 0; i < s->contacts; i += 4) {
        set_four(model, setup, mesh, s->flank.curvature + i, &s->flank.law[i / 4]);
        s->flank.law[i / 4].yields = GK_ALL(s->flank.yields);
        if (s->flank.yields > 0.0) set_closing(s, i, &s->flank.law[i / 4]);
    }
}

/* half-widths at which the logarithm begins and ends */
void gk_law_bounds(const gk_model *model, const gk_setup *setup, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    const gk_engagement *e = &model->engagement[mesh->index];
    const double widest = gk_min(model->gear[e->gear[0]].strip, model->gear[e->gear[1]].strip) / 1.5;
    mesh->square_high = widest * widest;
    mesh->square_low = B_LOW < 0.5 * widest ? B_LOW * B_LOW : 0.25 * mesh->square_high;
    mesh->log_low = gk_log(mesh->square_low);
    mesh->log_high = gk_log(mesh->square_high);
    mesh->yields = 0.0;
    if (mesh->rides && GK_ON(setup, hertz))
        mesh->yields = FOUNDATION * (model->gear[e->gear[0]].local + model->gear[e->gear[1]].local);
}

/* ln x of four normal numbers, as gk_log */
GK_INLINE void log_of_four(const gk_quad *x, gk_quad *out)
{
    const gk_unsigned b = (gk_unsigned)*x + ((uint64_t)0x95f62 << 32), biased = (b >> 52) | 0x4330000000000000;
    const gk_quad m = (gk_quad)((b & (UINT64_MAX >> 12)) + ((uint64_t)0x3fe6a09e << 32)),
                  n = (gk_quad)biased - (0x1p52 + 1023.0);
    const gk_quad f = m - 1.0, s = f / (2.0 + f), z = s * s, half_square = 0.5 * f * f;
    gk_quad r = GK_ALL(GK_LOG[6]);
    for (int i = 5; i >= 0; i--) r = r * z + GK_LOG[i];
    *out = n * GK_LN2_HIGH - ((half_square - (s * (half_square + z * r) + n * GK_LN2_LOW)) - f);
}

/* Adds what parts yield of which j of Q places have closed, (Q/j − 1) f/k + mean of d₁ … d_j, as a sum over the
 * intervals of f between closings; slope and ∫ f dδ likewise. */
GK_INLINE void add_closing(const gk_laws *law, const gk_quad *f, gk_quad *d, gk_quad *slope, gk_quad *energy)
{
    gk_quad from = GK_ALL(0.0);
    for (int j = 1; j < GAPS; j++) {
        const gk_quad yield = law->yields * ((double)GAPS / j - 1.0);
        const gk_quad to = law->closes[j - 1], least = GK_CHOOSE(*f < to, *f, to);
        const gk_quad here = j > 1 ? GK_CHOOSE(least > from, least, from) : least;
        *d += yield * (here - from);
        *energy += 0.5 * yield * (here * here - from * from);
        *slope += GK_CHOOSE((*f < to) & (here == *f), yield, GK_ALL(0.0));
        from = to;
    }
}

/* δ, δ′ and ∫ λ dδ of four contacts of lengths `width` (per_width: their inverse, 0 where there is none); λ ≤ 0 follows
 * the straight line through the origin, for iterates only */
GK_INLINE void law_of_four(const gk_laws *law, const double *force, const double *width, const double *per_width,
                           double *delta, double *yield, double *potential)
{
    const gk_quad per = *(const gk_quad *)per_width, f = *(const gk_quad *)force * per;
    gk_quad d = law->delta_high + law->slope_high * (f - law->high), slope = law->slope_high,
            energy = law->phi_high + 0.5 * law->slope_high * f * f;
    if (GK_HAS(hertz) && law->a[0] != 0.0) {
        const gk_bits low = f <= law->low, high = f >= law->high;
        const gk_quad q = GK_CHOOSE(f > 0.0, law->q_low, GK_ALL(0.0));
        gk_quad square = law->beta * GK_CHOOSE(low, law->low, f); /* b² */
        log_of_four(&square, &square);
        const gk_quad secant = law->c - 0.5 * law->a * square;
        d = GK_CHOOSE(low, f * (law->c_low + q * f), GK_CHOOSE(high, d, f * secant));
        slope = GK_CHOOSE(low, law->c_low + 2.0 * q * f, GK_CHOOSE(high, slope, secant - 0.5 * law->a));
        energy = GK_CHOOSE(low, f * f * (0.5 * law->c_low + 2.0 / 3.0 * q * f),
                           GK_CHOOSE(high, energy, f * f * (0.5 * secant - 0.125 * law->a) + law->phi_log));
    }
    if (law->yields[0] > 0.0) add_closing(law, &f, &d, &slope, &energy);
    *(gk_quad *)delta = d;
    *(gk_quad *)yield = slope * per;
    *(gk_quad *)potential = energy * *(const gk_quad *)width;
}

/* δ′ of a contact at a force that it does not have */
double gk_law_slope(const gk_system *s, int i, double force)
{
    GK_ASSERT(i >= 0 && i < s->contacts);
    const int first = i / 4 * 4;
    const gk_quad forces = GK_ALL(force);
    double delta[4], yield[4], potential[4];
    law_of_four(&s->flank.law[i / 4], (const double *)&forces, s->flank.width + first, s->flank.per_width + first,
                delta, yield, potential);
    return yield[i % 4];
}

/* the law of every contact at its present λ; what a quad writes beyond the contacts is 0: links have no width */
void gk_law_apply(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    for (int i = 0; i < s->contacts; i += 4)
        law_of_four(&s->flank.law[i / 4], s->force + i, s->flank.width + i, s->flank.per_width + i, s->local.delta + i,
                    s->local.yield + i, s->local.potential + i);
}
