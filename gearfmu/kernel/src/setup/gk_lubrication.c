/* Coefficient of friction of a contact (docs/theory.md, 2.8): constant, after Benedict and Kelley (ASLE Trans. 4, 1961)
 * or after ISO/TR 14179-2. Units of the formulas: N/mm, m/s, mPa s, mm, µm. */
#include "setup/gk_setup.h"

static const double HIGHEST = 0.2; /* the laws grow without bound towards standstill; boundary lubrication does not */

static double power(double x, double exponent) { return x > 0.0 ? gk_exp(exponent * gk_log(x)) : 0.0; }

/* µ = 0.0127·1.13/(1.13 − Ra)·log10[29660 w/(η v_s v_Σ²)] */
static double benedict_kelley(const gk_friction *f, const gk_sliding *at)
{
    const double rough = gk_min(1e6 * f->roughness, 1.0), eta = 1e3 * f->viscosity;
    const double moved = eta * gk_max(at->slides, 1e-6) * gk_max(at->rolls, 1e-6) * gk_max(at->rolls, 1e-6);
    const double load = gk_max(1e-3 * at->load, 1e-6);
    return 0.0127 * 1.13 / (1.13 - rough) * gk_log(29660.0 * load / moved) / 2.302585092994046;
}

/* µ_mz = 0.048 [F_bt/b/(v_Σc ρ_redc)]^0.2 η^−0.05 Ra^0.25, one for the engagement */
static double iso_tr_14179(const gk_friction *f, double width, const gk_sliding *at)
{
    const double v = gk_max(f->pitch_sum * fabs(at->turns), 1e-6), w = 1e-3 * at->total / width;
    return 0.048 * power(w / (v * 1e3 * f->pitch_rho), 0.2) * power(1e3 * f->viscosity, -0.05) *
           power(1e6 * f->roughness, 0.25);
}

double gk_lubrication_coefficient(const gk_friction *f, double width, const gk_sliding *at)
{
    GK_ASSERT(width > 0.0);
    GK_ASSERT(at->slides >= 0.0 && at->rolls >= 0.0);
    if (f->law == FRICTION_CONSTANT) return f->coefficient;
    const double found = f->law == FRICTION_BENEDICT_KELLEY ? benedict_kelley(f, at) : iso_tr_14179(f, width, at);
    return gk_clamp(found, 0.0, HIGHEST);
}

/* bound of the coefficient */
double gk_lubrication_most(const gk_friction *f) { return f->law == FRICTION_CONSTANT ? f->coefficient : HIGHEST; }

/* what the laws need of an engagement: its parameters, its pitch point and the ends of its path of contact */
void gk_lubrication_fill(const gk_model *model, const gk_data *data, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    const gk_engagement *e = &model->engagement[mesh->index];
    const gk_gear *a = &model->gear[e->gear[0]], *b = &model->gear[e->gear[1]];
    const double *v = GK_OF(data, mesh)[mesh->index];
    gk_friction *f = &mesh->friction;
    *f = (gk_friction){.law = (gk_friction_law)(int)v[V_FRICTION_LAW],
                       .coefficient = v[V_FRICTION_COEFFICIENT],
                       .viscosity = v[V_VISCOSITY],
                       .roughness = v[V_ROUGHNESS],
                       .sliding = 1.0,
                       .pitch_sum = 1.0,
                       .pitch_rho = 1.0};
    mesh->film_cut = v[V_FILM_CUT];
    if (e->kind == MESH_FLAT) return;
    const double sense = e->kind == MESH_INTERNAL ? -1.0 : 1.0, R = gk_base_reach(model, e);
    const double L = sqrt(mesh->distance * mesh->distance - R * R), per = a->r_b / b->r_b; /* speed of B per A's */
    const double pitch_a = L * a->r_b / R, pitch_b = L * b->r_b / R;                       /* rolls */
    const double to_tip = a->s_tip - pitch_a, from_tip = sense * (b->s_tip - pitch_b);
    f->sliding = 0.5 * (to_tip + from_tip) * (1.0 + sense * per);
    f->pitch_sum = pitch_a + per * pitch_b;
    f->pitch_rho = 1.0 / ((1.0 / pitch_a + sense / pitch_b) * mesh->cosine);
}
