/* Is a step stable where contacts stay closed? With the contacts of an island closed at a roll position, C the
 * compliance that a force of alternating sign meets, outside the paths of the dashpots all of it, in them what these
 * let move, S(1 + Γ′S)⁻¹, Γ′ = 2Γ/(1 − m), and K what the oscillators take off it within the step (negative where they
 * yield at once), it is up to μ′ = 1, the largest eigenvalue of C⁻¹K: μC − K is positive for μ > μ′ (docs/theory.md,
 * 3.5). Friction cλ adds c C_nt to C and c K_nt to K, which are no longer symmetric: their symmetric parts decide.
 * Contacts that stick follow the gaps: C less C_nt C_tt⁻¹ C_tn, and C − K likewise. */
#include "base/gk_dense.h"
#include "integrate/gk_closed.h"
#include "problem/gk_engage.h"
#include "problem/gk_far.h"
#include "problem/gk_pass.h"
#include "setup/gk_kinematics.h"
#include "setup/gk_tables.h"

static const double AT_NYQUIST = 2.0 / (1.0 - GK_MEMORY); /* f_d over half of η_d where forces alternate */
static const double NEAR = 50e-6;                         /* m: flanks that count as closed */

/* ---- an engagement ----------------------------------------------------------------------------------------------- */
/* Compliance beside dampers, X = S (1 + Γ S)⁻¹ of a block (n, n), by Gauss elimination of (1 + S Γ) X = S */
static void against_dampers(const double *S, const double *damping, int n, double *X)
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

/* C (n, n): compliance of the quasi-static part with all contacts closed under the line load `full`, Q (n, stride)
 * without the κ part; with dashpots what yields to a force of alternating sign */
void gk_closed_compliance(const gk_system *s, const double *Q, double full, int dashpots, double *C)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(Q && C);
    const int n = s->n, strips = s->strips;
    for (int i = 0; i < n * n; i++)
        C[i] = gk_row_is_stiff(s, i / n) && gk_row_is_stiff(s, i % n) ? Q[i / n * s->stride + i % n] : i / n == i % n;
    for (int p = 0; p * strips < s->contacts; p++) {
        const int first = p * strips;
        double S[MAX_SLICES * MAX_SLICES], X[MAX_SLICES * MAX_SLICES];
        for (int a = 0; a < strips * strips; a++) S[a] = s->P[(first + a / strips) * s->stride + first + a % strips];
        for (int a = 0; a < strips; a++)
            S[a * strips + a] += gk_law_slope(s, first + a, full * s->flank.width[first + a]);
        if (dashpots)
            against_dampers(S, s->dashpot.coefficient + first, strips, X);
        else
            memcpy(X, S, (size_t)(strips * strips) * sizeof *X);
        for (int a = 0; a < strips * strips; a++) C[(first + a / strips) * n + first + a % strips] += X[a];
    }
    for (int i = s->contacts; i < n; i++)
        if (gk_row_is_stiff(s, i)) {
            const double spring = s->P[i * s->stride + i];
            C[i * n + i] += spring / (1.0 + (dashpots ? AT_NYQUIST * s->dashpot.coefficient[i] * spring : 0.0));
        }
}

/* K (n, n): κ part */
static void kappa_part(const gk_system *s, const double *Q, double *K)
{
    const int n = s->n;
    for (int i = 0; i < n * n; i++) {
        const int at = i / n * s->stride + i % n;
        K[i] = gk_row_is_stiff(s, i / n) && gk_row_is_stiff(s, i % n) ? Q[at] - s->A[at] : 0.0;
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
            gk_point_of(setup, &engaged->place[engaged->system.flank.place_of[i]], i % GK_STRIPS(setup))->slide;
        const double speed = slide[PHIA] - engagement->kind * ratio * slide[PHIB];
        share[i] = speed > 0.0 ? -most : most;
    }
}

/* M (n, n) += ½ sign (Y c + c Yᵀ), Y (contacts, stride): what friction does to the gaps */
static void add_symmetric(const gk_system *s, const double *Y, const double *share, double sign, double *M)
{
    for (int j = 0; j < s->contacts; j++)
        for (int i = 0; i < s->n; i++) {
            const double half = gk_row_is_stiff(s, i) ? 0.5 * sign * share[j] * Y[j * s->stride + i] : 0.0;
            M[i * s->n + j] += half, M[j * s->n + i] += half;
        }
}

/* M (n, n) += sign Yᵀ T⁻¹ Y, Y (contacts, stride): what contacts that stick take from the gaps; L: factor of T, what
 * they yield along the profile */
static void add_stuck(const gk_system *s, const double *Y, const double *L, double sign, double *M)
{
    double y[MAX_CONTACTS];
    for (int k = 0; k < s->n; k++) {
        for (int j = 0; j < s->contacts; j++) y[j] = gk_row_is_stiff(s, k) ? Y[j * s->stride + k] : 0.0;
        gk_cholesky_solve(L, y, s->contacts);
        for (int i = 0; i < s->n; i++)
            for (int j = 0; j < s->contacts && gk_row_is_stiff(s, i); j++)
                M[i * s->n + k] += sign * Y[j * s->stride + i] * y[j];
    }
}

/* T ← factor of what contacts yield along the profile, with their local laws */
static int factorise_along(const gk_system *s, const double *yields, double *T)
{
    for (int i = 0; i < s->contacts; i++)
        for (int j = 0; j < s->contacts; j++)
            T[i * s->contacts + j] = yields[i * s->stride + j] + (i == j) * gk_friction_local_yield(s, i);
    return gk_cholesky(T, s->contacts);
}

/* Forms the problem of engagement e where the rotors stand (work->spin), unloaded, all places near contact; 0 when
 * there is none */
static int form(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                const gk_coefficients *k, int e)
{
    const gk_search near = {.k = k, .reach = NEAR, .anew = 1};
    for (int g = 0; g < model->gears; g++) work->y[g] = work->room.zero;
    work->ground_y = work->room.ground_zero;
    return gk_engage(model, setup, work, data, &near, e);
}

/* Turns gear A of an engagement by a position (in pitches), everything that rolls on it too, frames standing */
static void roll(const gk_model *model, gk_work *work, int e, double position)
{
    const gk_engagement *engagement = &model->engagement[e];
    const int rotor = model->gear[engagement->gear[0]].rotor, other = model->gear[engagement->gear[1]].rotor;
    int known[MAX_ROTORS];
    memset(work->spin, 0, sizeof work->spin);
    memset(work->speed, 0, sizeof work->speed);
    if (engagement->kind == MESH_FLAT) {
        work->spin[other] = engagement->position[0][0] - engagement->position[1][0];
        return;
    }
    for (int r = 0; r < model->rotors; r++) known[r] = model->inertia[r] == 0.0;
    for (int r = 0; r < model->rotors; r++)
        if (model->frame[r] >= 0) known[model->frame[r]] = 1;
    const int root = known[rotor] ? other : rotor;
    work->spin[root] = 2.0 * GK_PI * position / model->gear[engagement->gear[root != rotor]].z;
    known[root] = 1;
    gk_kinematics_follow(model, known, work->spin);
}

/* Forms the problem of engagement e at a position of its gears */
int gk_closed_place(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e,
                    double position)
{
    GK_ASSERT(gk_is_mesh(setup, e) && gk_is_engagement(model, e));
    GK_ASSERT(position >= 0.0 && position <= 1.0);
    roll(model, work, e, position);
    return form(model, setup, work, data, &work->room.explicit_rows, e);
}

/* ---- an island at a position ------------------------------------------------------------------------------------- */
typedef struct island { /* its rows behind each other */
    const gk_model *model;
    const gk_setup *setup;
    gk_work *work;
    const gk_data *data;
    int number, first, position, rows, at[MAX_ENGAGEMENTS]; /* first: of its engagements */
} island;

static int within(const island *of, int e) { return of->setup->mesh[e].island == of->number; }

static double *kept_at(const gk_work *work, int e, int position)
{
    return work->room.columns + (size_t)(e * LIMIT_POSITIONS + position) * MAX_STRIDE * MAX_STRIDE;
}

/* forms all problems of the island, with rows along the profile where there is friction */
static int form_island(island *of, const gk_coefficients *k)
{
    of->rows = 0;
    roll(of->model, of->work, of->first, (double)of->position / LIMIT_POSITIONS);
    for (int e = 0; e < of->model->engagements; e++) {
        if (!within(of, e)) continue;
        if (!form(of->model, of->setup, of->work, of->data, k, e)) return 0;
        if (GK_ON(of->setup, friction)) gk_glide_rows(of->setup, of->work, e);
        of->at[e] = of->rows, of->rows += of->work->engaged[e].system.n;
    }
    return 1;
}

/* next position of the island, or the first of the next one; 0: there is none */
static int next_place(island *of)
{
    const int flat = of->first >= 0 && of->model->engagement[of->first].kind == MESH_FLAT;
    if (of->first >= 0 && !flat && ++of->position < LIMIT_POSITIONS) return 1;
    of->number++, of->position = 0;
    for (of->first = 0; of->first < of->model->engagements; of->first++)
        if (within(of, of->first)) return 1;
    return 0;
}

/* Keeps the compliance without κ of every engagement at all positions, for gk_closed_holds */
void gk_closed_keep(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data)
{
    GK_ASSERT(model && setup && work && data);
    island of = {.model = model, .setup = setup, .work = work, .data = data, .number = -1, .first = -1};
    while (next_place(&of)) {
        if (!form_island(&of, &work->room.explicit_rows)) continue;
        for (int e = 0; e < model->engagements; e++) {
            const gk_system *s = &work->engaged[e].system;
            if (within(&of, e)) memcpy(kept_at(work, e, of.position), s->A, (size_t)(s->n * s->stride) * sizeof *s->A);
        }
    }
}

/* what the contacts of an engagement do: nothing along the profile, slide forwards, backwards, or stick */
typedef enum { FRICTIONLESS, FORWARDS, BACKWARDS, STICKING } motion;

/* C and K (n, n) of an engagement, Q its compliance without κ; 0 when contacts that stick leave no compliance */
static int form_block(const island *of, const gk_coefficients *k, int e, motion slides, double *C, double *K)
{
    const gk_engagement *engagement = &of->model->engagement[e];
    gk_engaged *engaged = &of->work->engaged[e];
    const gk_system *s = &engaged->system;
    const double *Q = kept_at(of->work, e, of->position);
    double share[MAX_CONTACTS];
    gk_closed_compliance(s, Q, engagement->force_max / engagement->width, 1, C);
    kappa_part(s, Q, K);
    if (slides == FRICTIONLESS) return 1;
    gk_glide *glide = engaged->glide;
    double *const T = glide->small;
    gk_glide_rows(of->setup, of->work, e);
    if (slides == STICKING) {
        if (!factorise_along(s, glide->yields, T)) return 0;
        add_stuck(s, glide->gap_yields, T, -1.0, C), add_stuck(s, glide->gap_yields, T, -1.0, K);
        gk_glide_moves(of->setup, k, of->work, e);
        gk_glide_yields(s, glide); /* C_nt − K_nt, C_tt − K_tt */
        if (!factorise_along(s, glide->yields, T)) return 0;
        add_stuck(s, glide->gap_yields, T, 1.0, K);
        return 1;
    }
    const double sign = slides == FORWARDS ? 1.0 : -1.0;
    friction_of(of->model, of->setup, engaged, e, share);
    add_symmetric(s, glide->gap_yields, share, sign, C), add_symmetric(s, glide->gap_yields, share, sign, K);
    gk_glide_moves(of->setup, k, of->work, e);
    gk_glide_yields(s, glide);
    add_symmetric(s, glide->gap_yields, share, -sign, K);
    return 1;
}

/* M (rows, rows) ← μC − K between engagements: what a force of a row does at once to the rows of those before its own,
 * and μ − 1 times what of that no oscillator does */
static void fill_coupling(const island *of, const gk_coefficients *k, double mu, double *M)
{
    const gk_coupled coupled = {.model = of->model, .setup = of->setup, .work = of->work, .k = k, .island = of->number};
    gk_far_list(&coupled);
    memset(M, 0, (size_t)of->rows * (size_t)of->rows * sizeof *M);
    for (int from = 0; from < of->model->engagements; from++)
        for (int i = 0; within(of, from) && from > of->first && i < of->work->engaged[from].system.n; i++) {
            if (!gk_row_is_stiff(&of->work->engaged[from].system, i)) continue;
            gk_pass_unit(&coupled, from, i);
            for (int to = 0; to < from; to++) {
                const gk_system *s = &of->work->engaged[to].system;
                if (!within(of, to)) continue;
                const double *read = of->work->engaged[to].moved[YIELDED], *fixed = of->work->engaged[to].moved[WHOLE];
                double *row = M + (size_t)(of->at[from] + i) * (size_t)of->rows + of->at[to];
                for (int j = 0; j < s->n; j++)
                    if (gk_row_is_stiff(s, j)) row[j] = read[j] + (mu - 1.0) * fixed[j];
            }
        }
}

/* Is μC − K positive, between engagements as in `coupling`? L: room */
static int positive(const island *of, const gk_coefficients *k, double mu, motion slides, double *L)
{
    for (int e = 0; e < of->model->engagements; e++) {
        const gk_system *s = &of->work->engaged[e].system;
        double *const C = of->work->engaged[e].system.J, *const K = of->work->engaged[e].system.L;
        if (!within(of, e)) continue;
        if (!form_block(of, k, e, slides, C, K)) return 0;
        for (int i = 0; i < s->n; i++)
            for (int j = 0; j < s->n; j++)
                L[(size_t)(of->at[e] + i) * of->rows + of->at[e] + j] = mu * C[i * s->n + j] - K[i * s->n + j];
        if (!gk_cholesky(C, s->n)) return 0;
    }
    return gk_cholesky(L, of->rows);
}

static int holds_at(island *of, const gk_coefficients *k, double mu)
{
    const int rubs = GK_ON(of->setup, friction);
    if (!form_island(of, k)) return 0;
    const size_t size = (size_t)of->rows * (size_t)of->rows;
    double *const coupling = of->work->island, *const L = coupling + size;
    fill_coupling(of, k, mu, coupling);
    for (motion slides = rubs ? FORWARDS : FRICTIONLESS; slides <= (rubs ? STICKING : FRICTIONLESS); slides++) {
        memcpy(L, coupling, size * sizeof *L);
        if (!positive(of, k, mu, slides, L)) return 0;
    }
    return 1;
}

/* Is μ′ < mu for a step of length h with γ, at all positions of all islands? After gk_closed_keep */
int gk_closed_holds(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                    const gk_coefficients *k, double mu)
{
    GK_ASSERT(k->h > 0.0 && mu > 0.0);
    island of = {.model = model, .setup = setup, .work = work, .data = data, .number = -1, .first = -1};
    while (next_place(&of))
        if (!holds_at(&of, k, mu)) return 0;
    return 1;
}
