/* Which internal step: μ′ = largest eigenvalue of C⁻¹K over the roll positions (docs/theory.md, 3.5), C the
 * compliance that a force of alternating sign meets: outside the paths of the dashpots all of it, in them what the
 * dashpots let move, S(1 + Γ′S)⁻¹, Γ′ = 2Γ/(1 − m). A closed contact is stable up to μ′ = 1. Modes above ωh = 1.2
 * have no κ, so μ′ goes up and down with h. Default h: the largest with μ′ ≤ 0.9, at most h_max of the stage and
 * 1/40 of the mesh period at speed_max. Any other h lowers γ until μ′ = 0.9; above 1/8 of the period it is refused.
 * Friction c λ adds c C_nt to C and c K_nt to K, which are no longer symmetric: their symmetric parts decide. Contacts
 * that stick follow the gaps: C less C_nt C_tt⁻¹ C_tn, and C − K likewise. */
#include "base/gk_dense.h"
#include "integrate/gk_integrate.h"
#include "setup/gk_choose.h"
#include "setup/gk_tables.h"
#include <stdio.h>

static const double MU_MOST = 0.9;                        /* μ′ of a step */
static const double AT_NYQUIST = 2.0 / (1.0 - GK_MEMORY); /* f_d over half of η_d where forces alternate */
static const double WITHIN = 0.9,
                    BEYOND = 1.5; /* of the limit of stability: the default; from where on a step is refused */
static const double NEAR = 50e-6; /* m: flanks that count as closed */
enum { POWER_ROUNDS = 60 };

/* largest eigenvalue of C⁻¹ K, C = L Lᵀ, K symmetric positive semidefinite */
static double largest(const double *L, const double *K, int n)
{
    double x[MAX_ROWS], y[MAX_ROWS], value = 0.0;
    for (int i = 0; i < n; i++) x[i] = 1.0 + 0.3 * (i % 3);
    for (int round = 0; round < POWER_ROUNDS; round++) {
        for (int i = 0; i < n; i++) {
            y[i] = 0.0;
            for (int j = 0; j < n; j++) y[i] += K[i * n + j] * x[j];
        }
        gk_cholesky_solve(L, y, n);
        value = 0.0;
        for (int i = 0; i < n; i++) value = gk_max(value, fabs(y[i]));
        if (!(value > 0.0)) return 0.0;
        for (int i = 0; i < n; i++) x[i] = y[i] / value;
    }
    return value;
}

/* X = S (1 + Γ S)⁻¹ of a block (n, n), by Gauss elimination of (1 + S Γ) X = S */
static void yielding(const double *S, const double *damping, int n, double *X)
{
    double B[MAX_SLICES * MAX_SLICES];
    for (int i = 0; i < n * n; i++) X[i] = S[i], B[i] = S[i] * AT_NYQUIST * damping[i % n] + (i / n == i % n);
    for (int k = 0; k < n; k++)
        for (int i = 0; i < n; i++) {
            if (i == k) continue;
            const double f = B[i * n + k] / B[k * n + k];
            for (int j = 0; j < n; j++) B[i * n + j] -= f * B[k * n + j], X[i * n + j] -= f * X[k * n + j];
        }
    for (int i = 0; i < n * n; i++) X[i] /= B[i / n * n + i / n];
}

/* a row that no spring carries has no part in the limit */
static int counts(const gk_system *s, int i) { return s->kind[i] == ROW_CONTACT || s->kind[i] == ROW_SPRING; }

/* C (n, n): compliance of the quasi-static part with all contacts closed under the line load `full`, Q (n, stride)
 * without the κ part; with dashpots what yields to a force of alternating sign */
void gk_limit_compliance(const gk_system *s, const double *Q, double full, int dashpots, double *C)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(Q && C);
    const int n = s->n, strips = s->strips;
    for (int i = 0; i < n * n; i++)
        C[i] = counts(s, i / n) && counts(s, i % n) ? Q[i / n * s->stride + i % n] : i / n == i % n;
    for (int p = 0; p * strips < s->contacts; p++) {
        const int first = p * strips;
        double S[MAX_SLICES * MAX_SLICES], X[MAX_SLICES * MAX_SLICES];
        for (int a = 0; a < strips * strips; a++) S[a] = s->P[(first + a / strips) * s->stride + first + a % strips];
        for (int a = 0; a < strips; a++) S[a * strips + a] += gk_law_slope(s, first + a, full * s->width[first + a]);
        if (dashpots)
            yielding(S, s->damping + first, strips, X);
        else
            memcpy(X, S, (size_t)(strips * strips) * sizeof *X);
        for (int a = 0; a < strips * strips; a++) C[(first + a / strips) * n + first + a % strips] += X[a];
    }
    for (int i = s->contacts; i < n; i++)
        if (counts(s, i)) {
            const double spring = s->P[i * s->stride + i];
            C[i * n + i] += spring / (1.0 + (dashpots ? AT_NYQUIST * s->damping[i] * spring : 0.0));
        }
}

/* K (n, n): κ part */
static void kappa_part(const gk_system *s, const double *Q, double *K)
{
    const int n = s->n;
    for (int i = 0; i < n * n; i++) {
        const int at = i / n * s->stride + i % n;
        K[i] = counts(s, i / n) && counts(s, i % n) ? Q[at] - s->A[at] : 0.0;
    }
}

/* Forms the problem of engagement e at a position (in pitches) of its gears, unloaded, all places near contact; 0 when
 * there is none */
int gk_limit_place(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                   const gk_coefficients *k, int e, double position)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_is_engagement(model, e));
    GK_ASSERT(position >= 0.0 && position <= 1.0);
    const gk_engagement *engagement = &model->engagement[e];
    const gk_gear *A = &model->gear[engagement->gear[0]], *B = &model->gear[engagement->gear[1]];
    const double turned = 2.0 * GK_PI * position / A->z;
    const gk_search near = {.k = k, .reach = NEAR, .anew = 1};
    memset(work->spin, 0, sizeof work->spin);
    memset(work->speed, 0, sizeof work->speed);
    work->spin[A->rotor] = turned;
    work->spin[B->rotor] = -engagement->kind * turned * A->r_b / B->r_b;
    if (engagement->kind == MESH_FLAT) {
        work->spin[A->rotor] = 0.0;
        work->spin[B->rotor] = engagement->position[0][0] - engagement->position[1][0];
    }
    for (int g = 0; g < model->gears; g++) work->y[g] = work->zero;
    work->ground_y = work->ground_zero;
    return gk_engage(model, setup, work, data, &near, e);
}

static double *kept_at(const gk_work *work, int e, int i)
{
    return work->columns + (size_t)(e * LIMIT_POSITIONS + i) * MAX_STRIDE * MAX_STRIDE;
}

static int positions_of(const gk_engagement *e) { return e->kind == MESH_FLAT ? 1 : LIMIT_POSITIONS; }

static void keep_all(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data)
{
    for (int e = 0; e < model->engagements; e++)
        for (int i = 0; i < positions_of(&model->engagement[e]); i++) {
            const gk_system *s = &work->engaged[e].system;
            if (!gk_limit_place(model, setup, work, data, &work->explicit_rows, e, (double)i / LIMIT_POSITIONS))
                continue;
            memcpy(kept_at(work, e, i), s->A, (size_t)(s->n * s->stride) * sizeof *s->A);
        }
}

/* the share of the normal force that slides every contact, gear A turning forwards */
static void friction_of(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int e, double *share)
{
    const gk_engagement *engagement = &model->engagement[e];
    const double most = gk_lubrication_most(&setup->mesh[e].friction);
    const double ratio = model->gear[engagement->gear[0]].r_b / model->gear[engagement->gear[1]].r_b;
    for (int i = 0; i < engaged->system.contacts; i++) {
        const double *slide =
            gk_point_of(setup, &engaged->place[engaged->system.place_of[i]], i % GK_STRIPS(setup))->slide;
        const double speed = slide[PHIA] - engagement->kind * ratio * slide[PHIB];
        share[i] = speed > 0.0 ? -most : most;
    }
}

/* M (n, n) += ½ sign (Y c + c Yᵀ), Y (contacts, stride): what friction does to the gaps */
static void add_symmetric(const gk_system *s, const double *Y, const double *share, double sign, double *M)
{
    for (int j = 0; j < s->contacts; j++)
        for (int i = 0; i < s->n; i++) {
            const double half = counts(s, i) ? 0.5 * sign * share[j] * Y[j * s->stride + i] : 0.0;
            M[i * s->n + j] += half, M[j * s->n + i] += half;
        }
}

/* M (n, n) += sign Yᵀ T⁻¹ Y, Y (contacts, stride): what contacts that stick take from the gaps; L: factor of T, what
 * they yield along the profile */
static void add_stuck(const gk_system *s, const double *Y, const double *L, double sign, double *M)
{
    double y[MAX_CONTACTS];
    for (int k = 0; k < s->n; k++) {
        for (int j = 0; j < s->contacts; j++) y[j] = counts(s, k) ? Y[j * s->stride + k] : 0.0;
        gk_cholesky_solve(L, y, s->contacts);
        for (int i = 0; i < s->n; i++)
            for (int j = 0; j < s->contacts && counts(s, i); j++) M[i * s->n + k] += sign * Y[j * s->stride + i] * y[j];
    }
}

/* μ′ where all contacts stick: friction follows the gaps */
static double mu_stuck(const gk_model *model, gk_work *work, const double *Q, int e)
{
    const gk_engagement *engagement = &model->engagement[e];
    const gk_system *s = &work->engaged[e].system;
    gk_glide *glide = work->engaged[e].glide;
    double *const C = work->engaged[e].system.J, *const K = work->engaged[e].system.L, *T = glide->moves;
    for (int i = 0; i < s->contacts; i++)
        for (int j = 0; j < s->contacts; j++)
            T[i * s->contacts + j] = glide->yields[i * s->stride + j] + (i == j) * gk_friction_local_yield(s, i);
    if (!gk_cholesky(T, s->contacts)) return INFINITY;
    gk_limit_compliance(s, Q, engagement->force_max / engagement->width, 1, C);
    kappa_part(s, Q, K);
    add_stuck(s, glide->D, T, -1.0, C);
    add_stuck(s, glide->D, T, -1.0, K), add_stuck(s, glide->gap_yields, T, 1.0, K);
    return gk_cholesky(C, s->n) ? largest(C, K, s->n) : INFINITY;
}

/* μ′ of the problem that is formed, Q without the κ part; `sign` of the direction in which gear A turns, 0: no friction
 */
static double mu_of(const gk_model *model, const gk_setup *setup, gk_work *work, const double *Q, int e, double sign)
{
    const gk_engagement *engagement = &model->engagement[e];
    gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    double *const C = s->J, *const K = s->L;
    gk_limit_compliance(s, Q, engagement->force_max / engagement->width, 1, C);
    kappa_part(s, Q, K);
    if (sign != 0.0) {
        double share[MAX_CONTACTS];
        const double *yields = engaged->glide->D, *all = engaged->glide->gap_yields;
        friction_of(model, setup, engaged, e, share);
        add_symmetric(s, yields, share, sign, C);
        add_symmetric(s, yields, share, sign, K), add_symmetric(s, all, share, -sign, K);
    }
    return gk_cholesky(C, s->n) ? largest(C, K, s->n) : INFINITY;
}

static double mu_at(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                    const gk_coefficients *k, int e, int i)
{
    const double position = (double)i / LIMIT_POSITIONS;
    const double *Q = kept_at(work, e, i);
    if (!gk_limit_place(model, setup, work, data, k, e, position)) return INFINITY;
    if (!GK_ON(setup, friction)) return mu_of(model, setup, work, Q, e, 0.0);
    const gk_system *s = &work->engaged[e].system;
    gk_glide *glide = work->engaged[e].glide;
    gk_glide_rows(setup, work, e);
    memcpy(glide->D, glide->gap_yields, (size_t)(s->contacts * s->stride) * sizeof *glide->D); /* C_nt */
    gk_glide_moves(setup, k, work, e);                                                         /* C_nt − K_nt */
    const double slides = gk_max(mu_of(model, setup, work, Q, e, 1.0), mu_of(model, setup, work, Q, e, -1.0));
    return gk_max(slides, mu_stuck(model, work, Q, e));
}

static double limit_mu(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h,
                       double gamma)
{
    GK_ASSERT(h > 0.0 && gk_finite(h));
    GK_ASSERT(gamma >= 0.0 && gamma <= 1.0);
    const gk_coefficients *k = gk_flow_for(model, setup, work, h, gamma);
    double worst = 0.0;
    for (int e = 0; e < model->engagements; e++)
        for (int i = 0; i < positions_of(&model->engagement[e]); i++)
            worst = gk_max(worst, mu_at(model, setup, work, data, k, e, i));
    return worst;
}

/* μ′ of a step of length h with γ */
double gk_limit_mu(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h,
                   double gamma)
{
    GK_ASSERT(gk_scheme_of(setup->integrator)->corrected);
    keep_all(model, setup, work, data);
    return limit_mu(model, setup, work, data, h, gamma);
}

/* γ for which μ′ stays at its bound */
static double gamma_for(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    if (limit_mu(model, setup, work, data, h, 1.0) <= MU_MOST) return 1.0;
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 12; i++) {
        double middle = 0.5 * (low + high);
        if (limit_mu(model, setup, work, data, h, middle) <= MU_MOST)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static const double QUARTER_OCTAVE = 0.84089641525371454; /* 2^(−1/4) */

/* γ of any h: exact for the internal step of the run, else the smaller of its neighbours on the scale; a pure function
 * of setup, state and h */
double gk_limit_gamma(const gk_setup *setup, const gk_work *work, const gk_data *data, double h)
{
    GK_ASSERT(h > 0.0);
    GK_ASSERT(setup->h > 0.0);
    double at = setup->h;
    int i = 0;
    if (!gk_scheme_of(setup->integrator)->corrected) return 0.0;
    if (h == data->table_h && h == work->run_h) return work->run_gamma;
    while (i < GAMMAS - 1 && h < at * (1.0 - 1e-9)) at *= QUARTER_OCTAVE, i++;
    return i && h > at * (1.0 + 1e-9) ? gk_min(setup->gamma_at[i - 1], setup->gamma_at[i]) : setup->gamma_at[i];
}

/* γ of the internal step of the run */
void gk_limit_run(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    GK_ASSERT(h > 0.0);
    if (!gk_scheme_of(setup->integrator)->corrected || work->run_h == h) return;
    if (h != setup->h) keep_all(model, setup, work, data);
    work->run_gamma = h == setup->h ? setup->gamma_at[0] : gamma_for(model, setup, work, data, h);
    work->run_h = h;
}

/* The largest step of the ladder, and at most `limit`, that meets the bound with γ = 1; where none does, the one that
 * comes nearest: below it stiff modes count with their κ, which lowers γ further. */
static double default_step(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                           double limit, int corrected)
{
    GK_ASSERT(limit > 0.0);
    static const double ladder[] = {20e-6, 15e-6, 12.5e-6, 10e-6, 7.5e-6, 6e-6, 5e-6,
                                    4e-6,  3e-6,  2.5e-6,  2e-6,  1.5e-6, 1e-6, 0.5e-6};
    const int rungs = (int)(sizeof ladder / sizeof *ladder);
    double nearest = INFINITY, h = limit;
    for (int i = 0; i < rungs; i++) {
        if (i + 1 < rungs && ladder[i + 1] >= limit) continue;
        const double rung = gk_min(ladder[i], limit);
        const double mu = corrected ? limit_mu(model, setup, work, data, rung, 1.0) : 0.0;
        if (mu <= MU_MOST) return rung;
        if (mu < nearest) nearest = mu, h = rung;
    }
    return h;
}

gk_outcome gk_limit_choose(const gk_model *model, gk_setup *setup, gk_work *work, const gk_data *data,
                           char message[GK_MESSAGE])
{
    GK_ASSERT(message && model->period_min > 0.0);
    const double wished = data->stage[V_H];
    GK_ASSERT(!(wished < 0.0));
    const double period = model->period_min;
    const int corrected = gk_scheme_of(setup->integrator)->corrected;
    const double stable = setup->integrator == CENTRAL ? gk_central_limit(model, setup, work, data)
                                                       : INFINITY; /* explicit: a limit of stability */
    double limit = gk_min(gk_longest_step(model), WITHIN * stable), h = wished;
    if (corrected) keep_all(model, setup, work, data);
    if (!(wished > 0.0)) h = default_step(model, setup, work, data, limit, corrected);
    if (h > period / 8.0) {
        snprintf(message, GK_MESSAGE, "h = %.3g s is more than 1/8 of the mesh period at speed_max; use h <= %.3g s", h,
                 period / 8.0);
        return GK_STEP_TOO_LARGE;
    }
    if (h > stable) {
        snprintf(message, GK_MESSAGE,
                 "h = %.3g s is above the limit of stability of central for this model at this level; use h <= %.3g s",
                 h, WITHIN * stable);
        if (h > BEYOND * stable) return GK_STEP_TOO_LARGE;
    }
    setup->h = h;
    double at = h;
    for (int i = 0; i < GAMMAS; i++, at *= QUARTER_OCTAVE)
        setup->gamma_at[i] = corrected ? gamma_for(model, setup, work, data, at) : 0.0;
    if (corrected && setup->gamma_at[0] < 0.7)
        snprintf(message, GK_MESSAGE,
                 wished > 0.0
                     ? "h = %.3g s exceeds the accuracy limit of dg4 for this model: gamma lowered to %.2f; the "
                       "default h, where 0 is given, comes nearest to the limit"
                     : "no step meets the accuracy limit of dg4 for this model: h = %.3g s comes nearest, gamma "
                       "lowered to %.2f; less contact damping or more modes bring it down",
                 h, setup->gamma_at[0]);
    return GK_OK;
}
