/* The complementarity problem of a step (docs/theory.md, eq. 10):
 *
 *   closed contact, bilateral row, sticking clutch:  gap + deflection = 0;   open contact: λ = 0 and gap + deflection ≥ 0;   slipping clutch: z = ±bound
 *   gap = g + D z + lag,   deflection = Aλ + Pλ + δ(λ),   z = λ + η,   η = α·direction + η_d
 *   dashpot of a row: η_d = 2c/h times the change of its path Pλ + δ (links: λ/k), limited to |λ0 + λ1| (no pull); its path is straight while a contact is open
 *
 * Active-set Newton with chord steps; all violated rows flip at once, after four rounds without progress only the last one (block principal pivoting, Júdice & Pires 1994). */
#include "gk_core.h"

enum { ROUND_LIMIT = 40, CHORD_LIMIT = 12 };
#ifdef GK_DOUBLE_MODES
static const double SOLVED = 1e-11;
#else
static const double SOLVED = 1e-7; /* of the last move: what is left after it is some hundredths of that */
#endif

static int is_contact(const gk_system *s, int i) { return s->kind[i] == ROW_CONTACT; }
static int is_clutch(const gk_system *s, int i) { return s->kind[i] == ROW_CLUTCH; }

GK_INLINE void times(const gk_system *s, const double *matrix, const double *x, double *y, const int quads)
{
    gk_quad sum[MAX_STRIDE / 4];
    for (int q = 0; q < quads; q++) sum[q] = (gk_quad){0};
    for (int j = 0; j < s->n; j++) {
        const gk_quad *row = (const gk_quad *)(matrix + j * 4 * quads);
        if (x[j] != 0.0)
            for (int q = 0; q < quads; q++) sum[q] += x[j] * row[q];
    }
    memcpy(y, sum, (size_t)quads * sizeof *sum);
}

/* y = matrix x; the matrix is symmetric, so its rows are its columns */
void gk_solve_times(const gk_system *s, const double *matrix, const double *x, double *y) { GK_SIZED(s->stride / 4, times, s, matrix, x, y) }

/* what the dashpots' force deflects outside their paths: Q·end − ½K·dash, K = Q − A */
void gk_solve_lag(const gk_system *s, const double *end, const double *dash, double *lag)
{
    double later[MAX_STRIDE], mean[MAX_STRIDE], part[MAX_STRIDE];
    for (int i = 0; i < s->n; i++) mean[i] = 0.5 * dash[i], later[i] = end[i] - mean[i];
    gk_solve_times(s, s->Q, later, lag);
    gk_solve_times(s, s->A, mean, part);
    for (int i = 0; i < s->n; i++) lag[i] += part[i];
}

GK_INLINE void along_paths(const gk_system *s, const double *x, double *y, const int strips)
{
    for (int first = 0, p = 0; first < s->contacts; first += strips, p++)
        for (int a = 0; a < strips; a++) {
            double sum = 0.0;
            for (int b = 0; b < strips; b++) sum += s->path[p][a * strips + b] * x[first + b];
            y[first + a] = sum;
        }
}

/* P x */
void gk_solve_path(const gk_system *s, const double *x, double *y)
{
    GK_STRIPPED(GK_STRIPS(s), along_paths, s, x, y)
    for (int i = s->contacts; i < s->n; i++) y[i] = s->spring[i] * x[i];
}

/* a contact that let go in this step: its path springs back, against the dashpot, as far as that does not pull */
static int opened(const gk_system *s, int i) { return is_contact(s, i) && !s->active[i] && s->force0[i] > 0.0; }

void gk_solve_set(gk_system *s, int i, double force)
{
    s->force[i] = force;
    if (is_contact(s, i)) s->law[i] = gk_law_at(&s->local[s->place_of[i]], s->width[i], force);
}

/* everything that follows from λ, α and the status of rows and dashpots */
void gk_solve_settle(gk_system *s)
{
    int dashpots = 0;
    gk_solve_path(s, s->force, s->linear);
    for (int i = 0; i < s->n; i++) {
        s->squeeze[i] = s->linear[i] + (is_contact(s, i) ? s->law[i].delta : 0.0);
        s->dash[i] = opened(s, i) ? gk_max(-s->damping[i] * s->squeeze0[i], -s->force0[i]) : 0.0;
        if (s->active[i] && s->clip[i] != 2) s->dash[i] = s->clip[i] ? s->clip[i] * (s->force0[i] + s->force[i]) : s->damping[i] * (s->squeeze[i] - s->squeeze0[i]);
        s->end[i] = s->clip[i] == 2 ? 0.0 : s->beta[i] * s->dash[i] + s->tail[i];
        dashpots |= s->end[i] != 0.0 || s->dash[i] != 0.0;
        s->eta[i] = s->alpha * s->direction[i] + s->dash[i];
        if (!is_clutch(s, i)) s->z[i] = s->force[i] + s->eta[i];
        else if (s->active[i]) s->z[i] = s->force[i];
    }
    gk_solve_times(s, s->D, s->z, s->Dz);
    gk_solve_times(s, s->A, s->force, s->Al);
    if (dashpots) gk_solve_lag(s, s->end, s->dash, s->lag);
    else memset(s->lag, 0, (size_t)s->n * sizeof *s->lag);
}

static void residual(const gk_system *s, double *r)
{
    for (int i = 0; i < s->stride; i++) r[i] = i < s->n && s->active[i] ? -(gk_solve_end_gap(s, i) + gk_solve_massless(s, i)) : 0.0;
}

/* moves the active λ by x; e: what the local law bends away from its tangent. Returns whether the change still matters. */
static int move(gk_system *s, const double *x, double *e, double *change)
{
    double size = 0.0;
    *change = 0.0;
    for (int i = 0; i < s->n; i++) {
        if (!s->active[i]) continue;
        if (is_contact(s, i)) {
            const double before = s->law[i].delta;
            gk_solve_set(s, i, s->force[i] + x[i]);
            e[i] = s->law[i].delta - before - s->slope[i] * x[i];
        } else {
            s->force[i] += x[i];
        }
        *change = gk_max(*change, fabs(x[i]));
        size = gk_max(size, fabs(s->force[i]));
    }
    return GK_HAS(hertz) && s->curved && *change > SOLVED * size;
}

/* what the law's bend e leaves in the equations: −(e + B Γ e) */
static void bend(const gk_system *s, const double *e, double *r)
{
    const int quads = s->stride / 4;
    memset(r, 0, (size_t)s->stride * sizeof *r);
    for (int j = 0; j < s->contacts; j++) {
        if (!s->active[j] || s->clip[j] != 0 || s->damping[j] == 0.0) continue;
        gk_axpy(-s->damping[j] * e[j], s->B + j * s->stride, r, 0, quads);
    }
    for (int i = 0; i < s->n; i++) r[i] = !s->active[i] ? 0.0 : i < s->contacts ? r[i] - e[i] : r[i];
}

/* λ of the active rows for the present set. Only the local law and its dashpots are not linear, so that after the first residual only their bend is left. */
static void newton(gk_system *s)
{
    double x[MAX_STRIDE], e[MAX_CONTACTS], change, last = INFINITY;
    gk_tangent_factorise(s);
    residual(s, x);
    for (int round = 0; round < CHORD_LIMIT; round++) {
        gk_tangent_solve(s, x);
        if (!move(s, x, e, &change)) break;
        if (change > 0.2 * last) { /* slow: a new tangent */
            gk_solve_settle(s);
            gk_tangent_factorise(s);
            residual(s, x);
        } else {
            bend(s, e, x);
        }
        last = change;
    }
    gk_solve_settle(s);
}

/* one row's verdict: does it contradict its status? */
static int violated(const gk_system *s, int i)
{
    if (is_contact(s, i)) return s->active[i] ? s->force[i] < 0.0 : gk_solve_end_gap(s, i) + gk_solve_massless(s, i) < 0.0;
    if (!is_clutch(s, i)) return 0;
    if (s->active[i]) return fabs(s->z[i]) > s->bound[i];
    return s->bound[i] > 0.0 && s->z[i] * gk_solve_end_gap(s, i) > 0.0; /* friction must oppose slip */
}

static void flip(gk_system *s, int i)
{
    s->active[i] = !s->active[i];
    if (is_clutch(s, i)) {
        if (!s->active[i]) s->z[i] = s->force[i] > 0.0 ? s->bound[i] : -s->bound[i];
        s->force[i] = 0.0;
    } else {
        if (!s->active[i]) s->clip[i] = 2; /* linear dashpots belong to closed contacts */
        gk_solve_set(s, i, s->active[i] ? s->force[i] : 0.0);
    }
}

/* dashpots of closed contacts: limited so that they never pull */
static int limit_dashpots(gk_system *s)
{
    int changed = 0;
    for (int i = 0; i < s->contacts; i++) {
        signed char clip = 2;
        if (s->active[i] && s->damping[i] > 0.0) {
            const double free = s->damping[i] * (s->squeeze[i] - s->squeeze0[i]), limit = s->force0[i] + s->force[i];
            clip = free > limit ? 1 : free < -limit ? -1 : 0;
        }
        changed |= clip != s->clip[i];
        s->clip[i] = clip;
    }
    return changed;
}

/* λ and z for the present α; starts from the present active set, settled */
void gk_solve_contacts(gk_system *s)
{
    int fewest = MAX_ROWS + 1, patience = 4, dashpot_rounds = 3;
    for (int round = 0; round < ROUND_LIMIT; round++) {
        newton(s);
        unsigned char wrong[MAX_ROWS];
        int count = 0, last = -1;
        for (int i = 0; i < s->n; i++) {
            wrong[i] = (unsigned char)violated(s, i);
            if (wrong[i]) count++, last = i;
        }
        if (count) {
            if (count < fewest) fewest = count, patience = 4;
            else patience--;
            if (patience < 0) flip(s, last);
            else
                for (int i = 0; i < s->n; i++)
                    if (wrong[i]) flip(s, i);
        } else if (dashpot_rounds-- <= 0 || !limit_dashpots(s)) {
            return;
        }
        gk_solve_settle(s);
    }
    s->limit_reached = 1;
}

/* Contacts alone, without the scalar: η is the dashpots' */
void gk_solve_plain(gk_system *s)
{
    const int stale = s->alpha != 0.0;
    s->alpha = 0.0;
    memset(s->direction, 0, (size_t)s->n * sizeof *s->direction);
    if (stale) gk_solve_settle(s);
    gk_solve_contacts(s);
}

/* stored energy of the massless part at the present λ: ½ λᵀ(A + P)λ + Σ Φ(λ) */
double gk_solve_stored(const gk_system *s)
{
    double sum = 0.0;
    for (int i = 0; i < s->n; i++)
        if (s->force[i] != 0.0) sum += 0.5 * s->force[i] * (s->Al[i] + s->linear[i]) + (is_contact(s, i) ? s->law[i].energy : 0.0);
    return sum;
}
