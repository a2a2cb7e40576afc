/* Which internal step: μ′ = 1 − λ_min(C^−½ C′ C^−½) over the roll positions (docs/theory.md, 3.5). Energy is conserved while C′ > 0, accuracy wants μ′ ≤ ½.
 * Default h: the largest with μ′(h′) ≤ ½ for all h′ ≤ h, at most h_max of the stage and 1/40 of the mesh period at speed_max. A larger h lowers γ; above 1/8 of the period it is refused. */
#include <stdio.h>
#include "gk_core.h"

static const double MU = 0.5, WITHIN = 0.9, BEYOND = 1.5; /* of the limit of stability: the default; from where on a step is refused */
enum { POSITIONS = 8, POWER_ROUNDS = 60 };

/* Cholesky of a (n, n), in place, lower; 0 when not positive */
int gk_limit_cholesky(double *a, int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = a[i * n + j];
            for (int k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
            if (i != j) a[i * n + j] = sum / a[j * n + j];
            else if (!(sum > 0.0)) return 0;
            else a[i * n + i] = sqrt(sum);
        }
    return 1;
}

/* x ← (L Lᵀ)⁻¹ x */
void gk_limit_solve(const double *L, double *x, int n)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) x[i] -= L[i * n + k] * x[k];
        x[i] /= L[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) x[i] -= L[k * n + i] * x[k];
        x[i] /= L[i * n + i];
    }
}

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
        gk_limit_solve(L, y, n);
        value = 0.0;
        for (int i = 0; i < n; i++) value = gk_max(value, fabs(y[i]));
        if (!(value > 0.0)) return 0.0;
        for (int i = 0; i < n; i++) x[i] = y[i] / value;
    }
    return value;
}

static double mu_at(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma, double position)
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    double frame[RIGID] = {0}, slope;
    frame[PHIA] = 2.0 * GK_PI * position / model->gear[0].teeth;
    frame[PHIB] = -frame[PHIA] * model->gear[0].r_b / model->gear[1].r_b;
    if (model->kind == KIND_FLAT) frame[XB] = -model->distance, frame[PHIA] = frame[PHIB] = 0.0;
    memcpy(work->frame, frame, sizeof frame);
    memset(work->speed, 0, sizeof work->speed);
    work->y[0] = work->zero[0], work->y[1] = work->zero[1];
    work->places = gk_flank_find(model, setup, frame, 50e-6, work->place);
    if (work->places < 0) return INFINITY;
    for (int p = 0; p < work->places; p++) work->place[p].memory = -1;
    gk_rows_form(model, setup, frame, work);
    gk_system_form(model, setup, data, gk_flow_for(setup, h, gamma), work);
    const int n = s->n;
    double *C = s->J, *K = C + n * n, full = model->torque_max / (model->gear[0].r_b * setup->width);
    memcpy(K, s->C, (size_t)n * n * sizeof *K);
    gk_coefficients plain = *gk_flow_for(setup, h, gamma);
    plain.rigid_kappa = 0.0;
    plain.flow[0].exact = plain.flow[1].exact = 0;
    gk_system_form(model, setup, data, &plain, work);
    for (int i = 0; i < n * n; i++) {
        C[i] = s->C[i];
        K[i] = C[i] - K[i];
    }
    for (int i = 0; i < n; i++) {
        if (i < s->contacts) gk_law_approach(&s->local[i], full * s->local[i].width, &slope), C[i * n + i] += slope;
        if (s->kind[i] == ROW_CLUTCH || s->kind[i] == ROW_TORQUE) {
            for (int j = 0; j < n; j++) C[i * n + j] = C[j * n + i] = K[i * n + j] = K[j * n + i] = 0.0;
            C[i * n + i] = 1.0;
        }
    }
    return gk_limit_cholesky(C, n) ? largest(C, K, n) : INFINITY;
}

double gk_limit_mu(const gk_model *model, const gk_setup *setup, double h, double gamma)
{
    double worst = 0.0;
    gk_data empty;
    memset(&empty, 0, sizeof empty);
    for (int i = 0; i < (model->kind == KIND_FLAT ? 1 : POSITIONS); i++) worst = gk_max(worst, mu_at(model, setup, &empty, h, gamma, (double)i / POSITIONS));
    return worst;
}

/* γ for which μ′ stays at its bound */
static double gamma_for(const gk_model *model, const gk_setup *setup, double h)
{
    if (gk_limit_mu(model, setup, h, 1.0) <= MU) return 1.0;
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 12; i++) {
        double middle = 0.5 * (low + high);
        if (gk_limit_mu(model, setup, h, middle) <= MU) low = middle;
        else high = middle;
    }
    return low;
}

gk_outcome gk_limit_choose(const gk_model *model, gk_setup *setup, double wished, char message[GK_MESSAGE])
{
    static const double ladder[] = {0.5e-6, 1e-6, 1.5e-6, 2e-6, 2.5e-6, 3e-6, 4e-6, 5e-6, 6e-6, 7.5e-6, 10e-6, 12.5e-6, 15e-6, 20e-6};
    const double period = 2.0 * GK_PI / (model->speed_max * model->gear[0].teeth);
    const int variational = setup->integrator == DG4;
    const double stable = setup->integrator == CENTRAL ? gk_central_limit(model, setup) : INFINITY; /* explicit: a limit of stability */
    double limit = gk_min(gk_min(model->h_max, period / 40.0), WITHIN * stable), h = wished;
    if (!(wished > 0.0)) {
        h = gk_min(ladder[0], limit);
        for (int i = 0; i < (int)(sizeof ladder / sizeof *ladder); i++) {
            double next = gk_min(ladder[i], limit);
            if (variational && gk_limit_mu(model, setup, next, 1.0) > MU) break;
            h = next;
            if (ladder[i] >= limit) break;
        }
    }
    if (h > period / 8.0) {
        snprintf(message, GK_MESSAGE, "h = %.3g s is more than 1/8 of the mesh period at speed_max; use h <= %.3g s", h, period / 8.0);
        return GK_STEP_TOO_LARGE;
    }
    if (h > stable) {
        snprintf(message, GK_MESSAGE, "h = %.3g s is above the limit of stability of central for this model at this level; use h <= %.3g s", h, WITHIN * stable);
        if (h > BEYOND * stable) return GK_STEP_TOO_LARGE;
    }
    setup->h = h;
    setup->gamma = variational ? gamma_for(model, setup, h) : 0.0;
    if (variational && setup->gamma < 0.7)
        snprintf(message, GK_MESSAGE, "h = %.3g s exceeds the accuracy limit of dg4 for this model: gamma lowered to %.2f; a smaller h is more accurate", h, setup->gamma);
    return GK_OK;
}
