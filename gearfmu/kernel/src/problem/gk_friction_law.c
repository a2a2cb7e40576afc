/* Friction of an engagement as a function of its normal forces in a step (docs/theory.md, 3.12), linear about those
 * present. D contains its slopes, so that the factors of the normal forces serve until a contact changes its status. */
#include "problem/gk_work.h"

/* x ← a⁻¹ x by rows, a (n, n) close to symmetric positive definite, x (n, columns): no pivoting */
static void solve_small(double *a, int n, double *x, int columns)
{
    for (int k = 0; k < n; k++)
        for (int i = k + 1; i < n; i++) {
            const double f = a[i * n + k] / a[k * n + k];
            if (f == 0.0) continue;
            for (int j = k; j < n; j++) a[i * n + j] -= f * a[k * n + j];
            for (int c = 0; c < columns; c++) x[i * columns + c] -= f * x[k * columns + c];
        }
    for (int k = n - 1; k >= 0; k--)
        for (int c = 0; c < columns; c++) {
            for (int j = k + 1; j < n; j++) x[k * columns + c] -= a[k * n + j] * x[j * columns + c];
            x[k * columns + c] /= a[k * n + k];
        }
}

/* p̄ = mean + Σ by_z Δz, at the end of the step end + end_by_z Δz + end_by_mean Δp̄. At a limit the end is
 * µ (λ₁ + f_d), below it the mean makes Δs = −ε h p̄/(µ λ̄). The mean is that of both ends, p̄ = ½ (p₀ + p₁); where
 * the contact sticks its dashpot adds (τ/h) (p₁ − p₀); of gears that roll on coefficients have the mean
 * c̄ = (1 − θ) c₀ + θ c₁. */
typedef struct laws {
    double mean[MAX_CONTACTS], end[MAX_CONTACTS]; /* of contacts below the limit 0, and the end without its mean */
    double by_z[MAX_CONTACTS], end_by_z[MAX_CONTACTS], end_by_mean[MAX_CONTACTS];
    signed char held[MAX_CONTACTS]; /* below the limit */
} laws;

/* would the mean of both ends push along the sliding? Then there is none. */
static int turns_round(const gk_glide *glide, int j)
{
    return glide->limit[j] && !glide->rolls && glide->limit[j] * glide->start_end[j] < -glide->most_end[j];
}

static void find_laws(gk_glide *glide, const gk_system *s, laws *law)
{
    for (int j = 0; j < s->contacts; j++) {
        const int touches = glide->most_force[j] > 0.0;
        const int held = touches && !glide->limit[j] && (glide->rolls || glide->most_end[j] > 0.0);
        if (!held) glide->full[j] = 0;
        const double ratio = glide->limit[j] * glide->most[j], last = ratio + glide->full[j] * glide->most[j];
        const double end = last * (s->force[j] + s->dashpot.end[j]), by_z = s->dashpot.hold[j] ? 0.0 : last;
        const int turns = turns_round(glide, j) || (!touches && s->force0[j] > 0.0);
        const int follows = held && !glide->full[j];
        const double still = held || !touches || turns ? 0.0
                             : glide->rolls            ? 0.5 * ratio * s->force0[j]
                                                       : 0.5 * (glide->start_end[j] + end - by_z * s->z[j]);
        law->held[j] = (signed char)held;
        law->by_z[j] = turns ? 0.0 : 0.5 * ratio;
        law->mean[j] = still + law->by_z[j] * s->z[j];
        law->end_by_z[j] = by_z;
        law->end_by_mean[j] = !follows       ? 0.0
                              : glide->rolls ? glide->share[j] / glide->by_end[j]
                                             : 1.0 / (0.5 + glide->damps[j]);
        law->end[j] = !follows ? end
                      : glide->rolls
                          ? (1.0 - 1.0 / glide->by_end[j]) * glide->ratio[j] * (s->force[j] + s->dashpot.end[j])
                          : (glide->damps[j] - 0.5) * law->end_by_mean[j] * glide->start_end[j];
    }
}

/* do the slopes that D contains belong to the same status? */
static int slopes_stand(const gk_glide *glide, const laws *law, int contacts)
{
    int same = glide->expressed;
    for (int j = 0; j < contacts && same; j++)
        same = glide->held[j] == law->held[j] && glide->by_own_z[j] == law->by_z[j] &&
               glide->end_by_z[j] == law->end_by_z[j] && (glide->end_by_mean[j] != 0.0) == (law->end_by_mean[j] != 0.0);
    return same;
}

/* Contacts below the limit: the mean of their friction, and with `slopes` how it follows the normal forces */
static void hold(gk_glide *glide, const gk_system *s, laws *law, int slopes)
{
    const int columns = slopes ? s->n + 1 : 1;
    int held[MAX_CONTACTS], n = 0;
    for (int j = 0; j < s->contacts; j++) held[n] = j, n += law->held[j] != 0;
    double *const all_a = glide->small, *const all_x = all_a + n * n;
    for (int k = 0; k < n; k++) { /* Δs without friction of these contacts */
        const int i = held[k];
        const double *moved = glide->gap_moves + i * s->stride, *yielded = glide->gap_yields + i * s->stride;
        double rest = gk_friction_slid(glide, i), *a = all_a + k * n, *x = all_x + k * columns;
        for (int r = 0; r < columns - 1; r++) x[r] = -(moved[r] + yielded[r]);
        for (int j = 0; j < s->contacts; j++) {
            const int at = j * s->stride + i;
            const double moves = 2.0 * glide->moves[at], yields = glide->yields[at];
            rest += moves * (law->mean[j] - glide->mean[j]) + yields * (law->end[j] - glide->end[j]);
            if (slopes) x[j] -= moves * law->by_z[j] + yields * law->end_by_z[j];
        }
        x[columns - 1] = -rest;
        for (int j = 0; j < n; j++) {
            const int at = held[j] * s->stride + i;
            a[j] = 2.0 * glide->moves[at] + law->end_by_mean[held[j]] * glide->yields[at];
        }
        a[k] += glide->creep[i] / glide->most_force[i];
    }
    solve_small(all_a, n, all_x, columns);
    for (int k = 0; k < n; k++) {
        const int j = held[k];
        law->mean[j] = all_x[k * columns + columns - 1];
        law->end[j] += law->end_by_mean[j] * law->mean[j];
        if (slopes) memcpy(glide->by_z + j * s->stride, all_x + k * columns, (size_t)s->n * sizeof(double));
    }
}

/* what friction follows of the present z in its mean */
static double followed(const gk_glide *glide, const gk_system *s, int j)
{
    if (!glide->held[j]) return glide->by_own_z[j] * s->z[j];
    double sum = 0.0;
    for (int r = 0; r < s->n; r++) sum += glide->by_z[j * s->stride + r] * s->z[r];
    return sum;
}

/* D with friction as a function of the forces in the step */
static void apply_slopes(const gk_glide *glide, gk_system *s)
{
    const int quads = s->stride / 4;
    memcpy(s->D, glide->D, (size_t)(s->n * s->stride) * sizeof *s->D);
    for (int j = 0; j < s->contacts; j++) {
        const double *moved = glide->gap_moves + j * s->stride, *yielded = glide->gap_yields + j * s->stride;
        double each[MAX_STRIDE];
        for (int i = 0; i < s->stride; i++) each[i] = 2.0 * moved[i] + glide->end_by_mean[j] * yielded[i];
        if (glide->end_by_z[j] != 0.0) gk_axpy(glide->end_by_z[j], yielded, s->D + j * s->stride, 0, quads);
        if (!glide->held[j] && glide->by_own_z[j] != 0.0)
            gk_axpy(glide->by_own_z[j], each, s->D + j * s->stride, 0, quads);
        for (int r = 0; r < s->n && glide->held[j]; r++)
            gk_axpy(glide->by_z[j * s->stride + r], each, s->D + r * s->stride, 0, quads);
    }
}

/* Gaps with friction, less the part in D; D where it has other slopes: its factors then no longer serve */
void gk_friction_apply(gk_glide *glide, gk_system *s)
{
    GK_ASSERT(glide && glide->expressed);
    GK_ASSERT(gk_system_is_sound(s));
    const int quads = s->stride / 4;
    memcpy(s->g, glide->gap, (size_t)s->stride * sizeof *s->g);
    for (int j = 0; j < s->contacts; j++) {
        const double moves = 2.0 * glide->fixed[j] - glide->start[j];
        const double yields = glide->end_fixed[j] + glide->end_by_mean[j] * glide->fixed[j];
        if (moves != 0.0) gk_axpy(moves, glide->gap_moves + j * s->stride, s->g, 0, quads);
        if (yields != 0.0) gk_axpy(yields, glide->gap_yields + j * s->stride, s->g, 0, quads);
    }
    if (glide->anew) {
        apply_slopes(glide, s);
        s->factored = 0;
        gk_solve_settle(s);
    }
    glide->anew = 0;
}

/* Friction as a function of the normal forces; returns how far it is from what they were solved with, N */
double gk_friction_express(gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide);
    GK_ASSERT(gk_system_is_sound(s));
    laws law;
    double largest = 0.0;
    find_laws(glide, s, &law);
    const int stand = slopes_stand(glide, &law, s->contacts);
    hold(glide, s, &law, !stand);
    glide->anew |= !stand;
    glide->expressed = 1;
    for (int j = 0; j < s->contacts; j++) {
        if (!stand) {
            glide->held[j] = law.held[j], glide->by_own_z[j] = law.by_z[j];
            glide->end_by_z[j] = law.end_by_z[j], glide->end_by_mean[j] = law.end_by_mean[j];
        }
        glide->fixed[j] = law.mean[j] - followed(glide, s, j);
        glide->end_fixed[j] = law.end[j] - glide->end_by_z[j] * s->z[j] - glide->end_by_mean[j] * law.mean[j];
        largest = gk_max(largest, gk_max(fabs(law.mean[j] - glide->mean[j]), fabs(law.end[j] - glide->end[j])));
    }
    return largest;
}

/* Mean friction by the present forces; returns the largest change */
double gk_friction_follow(gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && glide->expressed);
    GK_ASSERT(gk_system_is_sound(s));
    double largest = 0.0;
    for (int j = 0; j < s->contacts; j++) {
        const double before = glide->mean[j], end = glide->end[j];
        glide->mean[j] = glide->fixed[j] + followed(glide, s, j);
        glide->step[j] = 2.0 * glide->mean[j] - glide->start[j];
        glide->end[j] = glide->end_fixed[j] + glide->end_by_z[j] * s->z[j] + glide->end_by_mean[j] * glide->mean[j];
        largest = gk_max(largest, gk_max(fabs(glide->mean[j] - before), fabs(glide->end[j] - end)));
    }
    return largest;
}
