/* Tangent of the active rows (docs/theory.md, 3.2) and its factors:  J = D + A + S + B Γ S,  B = D + late·A,
 * S = P + diag δ′ (links: 1/k), Γ = diag 2c/h of the rows whose dashpot is linear; a dashpot at its limit ±(λ0 + λ1) is
 * ±B instead, an end force at its limit ±λ1 is ±A with late = 0. By columns of whole quads; an inactive row is an empty
 * one. Close to symmetric positive definite: no pivoting. */
#include "problem/gk_system.h"

static const gk_quad UNIT[4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};

/* column j of B: what the dashpot of row j does to all rows */
GK_INLINE void form_dashpot(gk_system *s, int j, const int quads)
{
    const double late = s->dashpot.late[j];
    const gk_quad *D = (const gk_quad *)s->D + j * quads, *A = (const gk_quad *)s->A + j * quads;
    gk_quad *B = (gk_quad *)s->B + j * quads;
    for (int q = 0; q < quads; q++) B[q] = D[q] + late * A[q];
}

/* column j: what λ_j does to all rows; `own`: strips that share its path */
GK_INLINE void form_column(const gk_system *s, int j, double *column, const int quads, const int own)
{
    const int first = j < s->contacts ? s->flank.place_of[j] * own : j, last = j < s->contacts ? first + own : j + 1;
    const gk_quad *D = (const gk_quad *)s->D + j * quads, *A = (const gk_quad *)s->A + j * quads,
                  *P = (const gk_quad *)s->P + j * quads, *B = (const gk_quad *)s->B, *on = (const gk_quad *)s->on;
    const double *path = s->P + j * 4 * quads;
    gk_quad c[MAX_STRIDE / 4];
    for (int q = 0; q < quads; q++) c[q] = D[q] + A[q] + P[q];
    if (s->dashpot.pull[j] != 0.0)
        for (int q = 0; q < quads; q++) c[q] += s->dashpot.pull[j] * B[j * quads + q];
    if (gk_film_lift(s, j) != 0.0)
        for (int q = 0; q < quads; q++) c[q] += D[q];
    if (s->dashpot.held[j] != 0.0)
        for (int q = 0; q < quads; q++) c[q] += s->dashpot.held[j] * A[q];
    for (int e = first; e < last; e++) {
        const double moves = s->dashpot.gain[e] * (e == j ? path[e] + s->local.slope[j] : path[e]);
        if (moves == 0.0) continue;
        for (int q = 0; q < quads; q++) c[q] += moves * B[e * quads + q];
    }
    for (int q = 0; q < quads; q++) ((gk_quad *)column)[q] = c[q] * on[q];
    ((gk_quad *)column)[j / 4] += s->local.slope[j] * UNIT[j % 4];
    if (gk_film_on(s)) column[j] += s->film->yields[j];
}

GK_INLINE void columns(gk_system *s, const int quads)
{
    const int n = s->n, stride = 4 * quads, strips = GK_STRIPS(s);
    for (int j = 0; j < n; j++)
        if (s->dashpot.gain[j] != 0.0 || s->dashpot.pull[j] != 0.0) form_dashpot(s, j, quads);
    for (int j = 0; j < n; j++) {
        double *column = s->J + j * stride;
        if (s->active[j]) {
            GK_STRIPPED(strips, form_column, s, j, column, quads)
        } else {
            memset(column, 0, (size_t)stride * sizeof *column);
            column[j] = 1.0;
        }
    }
}

/* of a quad what lies below its entry k (LOWER), and what does not (UPPER) */
#define ALL UINT64_MAX
static const gk_unsigned LOWER[4] = {{0, ALL, ALL, ALL}, {0, 0, ALL, ALL}, {0, 0, 0, ALL}, {0, 0, 0, 0}};
static const gk_unsigned UPPER[4] = {{ALL, 0, 0, 0}, {ALL, ALL, 0, 0}, {ALL, ALL, ALL, 0}, {ALL, ALL, ALL, ALL}};
#undef ALL

/* pivots 4·block … of the factors: the columns right of them lose what the pivots explain */
GK_INLINE void eliminate(gk_system *s, const int quads, const int block)
{
    const int n = s->n, stride = 4 * quads, end = 4 * block + 4 < n ? 4 * block + 4 : n;
    for (int k = 4 * block; k < end; k++) {
        double *pivot = s->J + k * stride, *lower = s->L + k * stride;
        gk_quad l[MAX_STRIDE / 4];
        s->inverse[k] = 1.0 / pivot[k];
        const gk_quad first = s->inverse[k] * ((gk_quad *)pivot)[block];
        l[block] = (gk_quad)((gk_unsigned)first & LOWER[k - 4 * block]);
        for (int q = block + 1; q < quads; q++) l[q] = s->inverse[k] * ((gk_quad *)pivot)[q];
        for (int q = block; q < quads; q++) ((gk_quad *)lower)[q] = l[q];
        gk_quad *above = (gk_quad *)pivot + block;
        *above = (gk_quad)((gk_unsigned)*above & UPPER[k - 4 * block]) - UNIT[k - 4 * block];
        for (int j = k + 1; j < n; j++) {
            gk_quad *column = (gk_quad *)s->J + j * quads;
            const double f = -((double *)column)[k];
            for (int q = block; q < quads; q++) column[q] += f * l[q];
        }
    }
}

GK_INLINE void factorise(gk_system *s, const int quads)
{
    columns(s, quads);
    GK_BLOCKS(quads, eliminate, s)
}

void gk_tangent_factorise(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(s->J && s->L && s->B);
    for (int q = 0; q < s->stride / 4; q++)
        ((gk_quad *)s->local.slope)[q] = ((gk_quad *)s->local.yield)[q] * ((gk_quad *)s->on)[q];
    GK_SIZED(s->stride / 4, factorise, s)
    s->iterations++;
}

GK_INLINE void forward(const gk_system *s, double *x, const int quads, const int block)
{
    const int stride = 4 * quads, end = 4 * block + 4 < s->n ? 4 * block + 4 : s->n;
    for (int k = 4 * block; k < end; k++) {
        const gk_quad *lower = (const gk_quad *)(s->L + k * stride);
        const double f = -x[k];
        for (int q = block; q < quads; q++) ((gk_quad *)x)[q] += f * lower[q];
    }
}

/* the pivot less 1 stands in the factor, so that x_k becomes f with the others */
GK_INLINE void backward(const gk_system *s, double *x, const int quads, const int block)
{
    const int stride = 4 * quads, end = 4 * block + 4 < s->n ? 4 * block + 4 : s->n;
    for (int k = end - 1; k >= 4 * block; k--) {
        const gk_quad *column = (const gk_quad *)(s->J + k * stride);
        const double f = x[k] * s->inverse[k];
        for (int q = 0; q <= block; q++) ((gk_quad *)x)[q] -= f * column[q];
    }
}

GK_INLINE void solve(const gk_system *s, double *x, const int quads)
{
    GK_BLOCKS(quads, forward, s, x)
    GK_BLOCKS_BACK(quads, backward, s, x)
}

/* x ← J⁻¹ x; x (stride) is 0 where a row is not active */
void gk_tangent_solve(const gk_system *s, double *x)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(x);
    GK_SIZED(s->stride / 4, solve, s, x)
}
