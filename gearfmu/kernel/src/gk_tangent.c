/* Tangent of the active rows (docs/theory.md, 3.2) and its factors:  J = D + A + S + B Γ S,  B = D + ½A + (β − ½)Q,  S = P + diag δ′ (links: 1/k), Γ = diag 2c/h of the rows whose dashpot is linear; a dashpot at its
 * limit ±(λ0 + λ1) is ±B instead. By columns of whole quads; an inactive row is an empty one. Close to symmetric positive definite: no pivoting. */
#include "gk_core.h"

/* column j of B: what the dashpot of row j does to all rows */
GK_INLINE void form_dashpot(gk_system *s, int j, const int quads)
{
    const double later = s->beta[j] - 0.5;
    const gk_quad *D = (const gk_quad *)s->D + j * quads, *A = (const gk_quad *)s->A + j * quads, *Q = (const gk_quad *)s->Q + j * quads;
    gk_quad *B = (gk_quad *)s->B + j * quads;
    for (int q = 0; q < quads; q++) B[q] = D[q] + 0.5 * A[q] + later * Q[q];
}

/* column j: what λ_j does to all rows */
GK_INLINE void form_column(const gk_system *s, int j, const double *mask, double *column, const int quads)
{
    const int strips = GK_STRIPS(s), contact = j < s->contacts;
    const int place = contact ? s->place_of[j] : 0, first = contact ? place * strips : j, count = contact ? strips : 1;
    const gk_quad *D = (const gk_quad *)s->D + j * quads, *A = (const gk_quad *)s->A + j * quads, *B = (const gk_quad *)s->B, *on = (const gk_quad *)mask;
    gk_quad c[MAX_STRIDE / 4];
    double own[MAX_SLICES];
    for (int q = 0; q < quads; q++) c[q] = D[q] + A[q];
    if (s->clip[j] == 1 || s->clip[j] == -1)
        for (int q = 0; q < quads; q++) c[q] += s->clip[j] * B[j * quads + q];
    for (int e = first; e < first + count; e++) {
        own[e - first] = !s->active[e] ? 0.0 : contact ? s->path[place][(e - first) * strips + j - first] + (e == j ? s->slope[j] : 0.0) : s->spring[j];
        const double moves = s->clip[e] == 0 ? s->damping[e] * own[e - first] : 0.0;
        if (moves == 0.0) continue;
        for (int q = 0; q < quads; q++) c[q] += moves * B[e * quads + q];
    }
    for (int q = 0; q < quads; q++) ((gk_quad *)column)[q] = c[q] * on[q];
    for (int e = 0; e < count; e++) column[first + e] += own[e];
}

GK_INLINE void factorise(gk_system *s, const int quads)
{
    const int n = s->n, stride = 4 * quads;
    double mask[MAX_STRIDE];
    for (int i = 0; i < stride; i++) mask[i] = i < n && s->active[i];
    for (int j = 0; j < n; j++)
        if (s->active[j] && s->clip[j] != 2) form_dashpot(s, j, quads);
    for (int j = 0; j < n; j++)
        if (s->active[j]) form_column(s, j, mask, s->J + j * stride, quads);
    for (int k = 0; k < n; k++) {
        if (!s->active[k]) continue;
        double *pivot = s->J + k * stride, *lower = s->L + k * stride;
        const double inverse = 1.0 / pivot[k];
        for (int q = k / 4; q < quads; q++) ((gk_quad *)lower)[q] = inverse * ((gk_quad *)pivot)[q];
        for (int i = k / 4 * 4; i <= k; i++) lower[i] = 0.0;
        for (int i = k + 1; i < (k / 4 + 1) * 4; i++) pivot[i] = 0.0;
        for (int j = k + 1; j < n; j++)
            if (s->active[j]) gk_axpy(-s->J[j * stride + k], lower, s->J + j * stride, k / 4, quads);
    }
}

void gk_tangent_factorise(gk_system *s)
{
    for (int i = 0; i < s->contacts; i++) s->slope[i] = s->active[i] ? s->law[i].slope : 0.0;
    GK_SIZED(s->stride / 4, factorise, s)
    s->rounds++;
}

GK_INLINE void solve(const gk_system *s, double *x, const int quads)
{
    const int n = s->n, stride = 4 * quads;
    for (int k = 0; k < n; k++)
        if (s->active[k]) gk_axpy(-x[k], s->L + k * stride, x, k / 4, quads);
    for (int k = n - 1; k >= 0; k--) {
        if (!s->active[k]) continue;
        const double *column = s->J + k * stride, f = x[k] / column[k];
        gk_axpy(-f, column, x, 0, k / 4 + 1);
        x[k] = f;
    }
}

/* x ← J⁻¹ x; x (stride) is 0 where a row is not active */
void gk_tangent_solve(const gk_system *s, double *x) { GK_SIZED(s->stride / 4, solve, s, x) }
