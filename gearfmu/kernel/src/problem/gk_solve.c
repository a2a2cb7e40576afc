/* The complementarity problem of a step (docs/theory.md, eq. 10):
 *
 *   closed contact, bilateral row, sticking clutch:  gap + deflection = 0;   open contact: λ = 0 and gap + deflection ≥
 * 0;   slipping clutch: z = ±bound gap = g + D z + lag,   deflection = Aλ + Pλ + δ(λ),   z = λ + η,   η = α·direction +
 * η_d dashpot of a row closed at either end: η_d = 2c/h times the change of its path Pλ + δ (links: λ/k), limited to
 * |λ0 + λ1| (no pull), of a contact that closes or opens to what it may do while it touches
 *
 * Active-set Newton with chord steps, in an island with one factorisation as long as no status changes. All violated
 * rows flip at once, after four rounds without progress only the last one (block principal pivoting, Júdice & Pires
 * 1994). */
#include "problem/gk_row.h"

enum { ROUND_LIMIT = 40, CHORD_LIMIT = 12, FILM_LIMIT = 40 };
/* SOLVED: of the last move; what is left after it is some hundredths of that. PART_KNOWN: of λ0 + λ1, damper of a
 * contact that closes or opens */
#ifdef GK_DOUBLE_MODES
enum { DASHPOT_ROUNDS = 24 };
static const double SOLVED = 1e-11, PART_KNOWN = 1e-12;
#else
enum { DASHPOT_ROUNDS = 8 };
static const double SOLVED = 1e-7, PART_KNOWN = 1e-5;
#endif

GK_INLINE void times(const gk_system *s, const double *matrix, const double *x, double *y, const int quads)
{
    gk_quad sum[MAX_STRIDE / 4];
    for (int q = 0; q < quads; q++) sum[q] = (gk_quad){0};
    for (int j = 0; j < s->n; j++) {
        const gk_quad *row = (const gk_quad *)(matrix + j * 4 * quads);
        for (int q = 0; q < quads; q++) sum[q] += x[j] * row[q];
    }
    memcpy(y, sum, (size_t)quads * sizeof *sum);
}

/* y = matrix x; the matrix is symmetric, so its rows are its columns */
void gk_solve_times(const gk_system *s, const double *matrix, const double *x, double *y)
{
    GK_ASSERT(matrix && x && y && x != y);
    GK_SIZED(s->stride / 4, times, s, matrix, x, y)
}

void gk_solve_path(const gk_system *s, const double *x, double *y)
{
    GK_ASSERT(x != y);
    gk_solve_times(s, s->P, x, y);
}

/* D z, Aλ and A f in one pass over both matrices; without dashpots f deflects nothing */
GK_INLINE void products(const gk_system *s, const double *f, const int dashpots, double *lag, double *Dz, double *Al,
                        const int quads)
{
    gk_quad moved[MAX_STRIDE / 4], yielded[MAX_STRIDE / 4], lagged[MAX_STRIDE / 4];
    for (int q = 0; q < quads; q++) moved[q] = yielded[q] = lagged[q] = (gk_quad){0};
    for (int j = 0; j < s->n; j++) {
        const gk_quad *D = (const gk_quad *)(s->D + j * 4 * quads), *A = (const gk_quad *)(s->A + j * 4 * quads);
        for (int q = 0; q < quads; q++) {
            moved[q] += s->z[j] * D[q];
            yielded[q] += s->force[j] * A[q];
            if (dashpots) lagged[q] += f[j] * A[q];
        }
    }
    memcpy(Dz, moved, (size_t)quads * sizeof *moved);
    memcpy(Al, yielded, (size_t)quads * sizeof *yielded);
    memcpy(lag, lagged, (size_t)quads * sizeof *lagged);
}

/* rows and dashpots as numbers, after their status has changed */
void gk_solve_status(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    s->factored = 0;
    gk_bits any = {0};
    for (int i = s->n; i < s->stride; i++) s->active[i] = 0, s->dashpot.clip[i] = 2, s->dashpot.hold[i] = 0;
    for (int q = 0; q < s->stride / 4; q++) {
        const unsigned char *active = s->active + 4 * q;
        const signed char *clip = s->dashpot.clip + 4 * q, *hold = s->dashpot.hold + 4 * q;
        const gk_bits clips = {clip[0], clip[1], clip[2], clip[3]}, holds = {hold[0], hold[1], hold[2], hold[3]};
        const gk_bits acts = clips != 2, lasts = acts & (holds == 0), linear = clips == 0;
        const gk_quad gain = GK_CHOOSE(linear, ((gk_quad *)s->dashpot.coefficient)[q], GK_ALL(0.0));
        const gk_quad pull = GK_CHOOSE(acts, __builtin_convertvector(clips, gk_quad) * ((gk_quad *)s->dashpot.part)[q],
                                       GK_ALL(0.0));
        const gk_quad rest = GK_CHOOSE(lasts, ((gk_quad *)s->dashpot.tail)[q], GK_ALL(0.0));
        ((gk_quad *)s->on)[q] = (gk_quad){active[0], active[1], active[2], active[3]};
        ((gk_quad *)s->dashpot.gain)[q] = gain;
        ((gk_quad *)s->dashpot.pull)[q] = pull;
        ((gk_quad *)s->dashpot.late)[q] = GK_CHOOSE(lasts, ((gk_quad *)s->dashpot.beta)[q], GK_ALL(0.0));
        ((gk_quad *)s->dashpot.rest)[q] = rest;
        ((gk_quad *)s->dashpot.held)[q] = __builtin_convertvector(holds, gk_quad);
        any |= (gain != 0.0) | (pull != 0.0) | (rest != 0.0);
    }
    s->dashpot.any = (any[0] | any[1] | any[2] | any[3]) != 0;
}

/* films: what they carry is a mean of the step */
GK_INLINE void dashpots_and_sums(gk_system *s, const int films, const int quads)
{
#define OF(array) ((gk_quad *)s->array)
    for (int q = 0; q < quads; q++) {
        OF(approach)[q] = OF(linear)[q] + OF(local.delta)[q];
        gk_quad force = OF(force)[q];
        if (films) {
            const gk_quad closes = OF(film->closes)[q], sinks = OF(film->sinks)[q];
            const gk_quad carried = GK_CHOOSE(force < closes, force, closes);
            OF(film->lift)[q] = GK_CHOOSE(force < closes, sinks, GK_ALL(0.0));
            force += sinks * (carried - OF(force0)[q]);
        }
        OF(dashpot.mean)
        [q] = OF(dashpot.gain)[q] * (OF(approach)[q] - OF(approach0)[q]) +
              OF(dashpot.pull)[q] * (OF(force0)[q] + OF(force)[q]);
        OF(dashpot.end)
        [q] = OF(dashpot.late)[q] * OF(dashpot.mean)[q] + OF(dashpot.rest)[q] + OF(dashpot.held)[q] * OF(force)[q];
        OF(eta)[q] = s->alpha * OF(direction)[q] + OF(dashpot.mean)[q];
        OF(z)[q] = force + OF(eta)[q] + OF(jump)[q];
    }
#undef OF
    for (int i = s->n - s->joint.clutches; i < s->n; i++) s->z[i] = s->active[i] ? s->force[i] : s->joint.slip[i];
    if (s->dashpot.any)
        products(s, s->dashpot.end, 1, s->dashpot.lag, s->Dz, s->Al, quads);
    else
        products(s, s->dashpot.end, 0, s->dashpot.lag, s->Dz, s->Al, quads);
}

/* everything that follows from λ, α and the status of rows and dashpots; the law has been applied */
void gk_solve_settle(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    gk_solve_path(s, s->force, s->linear);
    if (gk_film_on(s)) {
        dashpots_and_sums(s, 1, s->stride / 4);
        gk_film_apply(s);
        return;
    }
    GK_SIZED(s->stride / 4, dashpots_and_sums, s, 0)
}

/* the start of a step, before rows and dashpots have a status: what follows from λ0 and from what dampers did last */
void gk_solve_begin(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    const int quads = s->stride / 4;
    gk_solve_path(s, s->force, s->linear);
    for (int q = 0; q < quads; q++) {
        ((gk_quad *)s->approach)[q] = ((gk_quad *)s->linear)[q] + ((gk_quad *)s->local.delta)[q];
        ((gk_quad *)s->approach0)[q] = ((gk_quad *)s->approach)[q];
        ((gk_quad *)s->z)[q] = ((gk_quad *)s->force)[q];
        ((gk_quad *)s->dashpot.mean)[q] = ((gk_quad *)s->dashpot.end)[q] = ((gk_quad *)s->dashpot.lag)[q] = (gk_quad){
            0};
    }
    for (int i = s->n - s->joint.clutches; i < s->n; i++) s->z[i] = s->active[i] ? s->force[i] : s->joint.slip[i];
    GK_SIZED(quads, products, s, s->dashpot.end0, 1, s->dashpot.lag0, s->Dz, s->Al)
}

/* and what is left of these at its end */
void gk_solve_begin_dashpots(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    if (!s->dashpot.any) return;
    memcpy(s->dashpot.end, s->dashpot.rest, (size_t)s->stride * sizeof *s->dashpot.end);
    gk_solve_times(s, s->A, s->dashpot.end, s->dashpot.lag);
}

static void residual(const gk_system *s, double *r)
{
    const gk_quad *outer = (const gk_quad *)s->others.gap, *beyond = (const gk_quad *)s->others.deflection;
    const gk_quad *g = (const gk_quad *)s->g, *Dz = (const gk_quad *)s->Dz, *lag = (const gk_quad *)s->dashpot.lag,
                  *Al = (const gk_quad *)s->Al, *approach = (const gk_quad *)s->approach, *on = (const gk_quad *)s->on;
    for (int q = 0; q < s->stride / 4; q++)
        ((gk_quad *)r)[q] = -(g[q] + Dz[q] + lag[q] + Al[q] + approach[q] + outer[q] + beyond[q]) * on[q];
    if (!gk_film_on(s)) return;
    for (int q = 0; q < s->stride / 4; q++) ((gk_quad *)r)[q] += ((gk_quad *)s->film->left)[q] * on[q];
}

/* moves the active λ by x; e: what the local law bends away from its tangent. Returns whether the change still matters.
 */
static int move(gk_system *s, const double *x, double *e, double *change)
{
    const int quads = s->stride / 4;
    const gk_quad *by = (const gk_quad *)x, *on = (const gk_quad *)s->on, *slope = (const gk_quad *)s->local.slope,
                  *delta = (const gk_quad *)s->local.delta;
    gk_quad most = {0}, size = {0}, *force = (gk_quad *)s->force, *bent = (gk_quad *)e;
    for (int q = 0; q < quads; q++) {
        force[q] += by[q];
        bent[q] = -delta[q] - slope[q] * by[q];
        const gk_quad moved = GK_MAGNITUDE(by[q]), now = GK_MAGNITUDE(force[q] * on[q]);
        most = GK_LARGER(most, moved);
        size = GK_LARGER(size, now);
    }
    gk_law_apply(s);
    gk_quad worst = {0}, deepest = {0};
    for (int q = 0; q < quads; q++) {
        bent[q] += delta[q];
        const gk_quad off = GK_MAGNITUDE(bent[q]), deep = GK_MAGNITUDE(delta[q]);
        worst = GK_LARGER(worst, off);
        deepest = GK_LARGER(deepest, deep);
    }
    *change = gk_largest(&most);
    if (s->others.bends > 0.0 && !gk_film_on(s)) return gk_largest(&worst) > s->others.bends * gk_largest(&deepest);
    return ((GK_HAS(hertz) && s->flank.curved) || gk_film_on(s)) && *change > SOLVED * gk_largest(&size);
}

/* what the law's bend e leaves in the equations: −(e + B Γ e) */
static void bend(const gk_system *s, const double *e, double *r)
{
    const int quads = s->stride / 4;
    const gk_quad *bent = (const gk_quad *)e, *on = (const gk_quad *)s->on;
    for (int q = 0; q < quads; q++) ((gk_quad *)r)[q] = -bent[q];
    for (int j = 0; j < s->contacts; j++)
        if (s->dashpot.gain[j] != 0.0) gk_axpy(-s->dashpot.gain[j] * e[j], s->B + j * s->stride, r, 0, quads);
    for (int q = 0; q < quads; q++) ((gk_quad *)r)[q] *= on[q];
}

/* λ of the active rows for the present set. Only the local law and its dashpots are not linear, so that after the first
 * residual only their bend is left. */
static void newton(gk_system *s)
{
    double x[MAX_STRIDE], e[MAX_STRIDE], change, last = INFINITY;
    const int films = gk_film_on(s), most = films ? FILM_LIMIT : CHORD_LIMIT;
    if (!s->factored) gk_tangent_factorise(s);
    residual(s, x);
    for (int round = 0; round < most; round++) {
        gk_tangent_solve(s, x);
        if (!move(s, x, e, &change)) break;
        if (films || change > 0.2 * last) { /* slow, or bent by films: a new tangent */
            gk_solve_settle(s);
            gk_tangent_factorise(s);
            residual(s, x);
        } else {
            bend(s, e, x);
        }
        last = change;
    }
    s->factored = (s->others.coupled || s->rubs) && !films;
    gk_solve_settle(s);
}

/* how many rows contradict their status, and which */
static int contradictions(const gk_system *s, unsigned char *wrong)
{
    int count = 0;
    for (const gk_row_block *b = s->block; b < s->block + s->blocks; b++) {
        const gk_row_verbs *verbs = gk_verbs_of(b->kind);
        if (verbs->contradict)
            count += verbs->contradict(s, b, wrong);
        else
            for (int i = b->from; i < b->end; i++) wrong[i] = 0;
    }
    return count;
}

static void flip(gk_system *s, int i) { gk_verbs_of(s->kind[i])->flip(s, i); }

static int beyond(double x, double limit) { return x > limit ? 1 : x < -limit ? -1 : 0; }

/* from one limit to the other by way of what lies between */
static signed char towards(int old, int new) { return (signed char)(old * new == -1 ? 0 : new); }

/* does a contact close (1) or open (−1) in the step? */
static int passes(const gk_system *s, int i) { return (s->active[i] != 0) - (s->force0[i] > 0.0); }

/* what a contact deflects, when closed, by those that close or open with it */
static double deflected_by_these(const gk_system *s, int i)
{
    const int way = passes(s, i);
    const double *force = way > 0 ? s->force : s->force0;
    double sum = way > 0 ? s->local.delta[i] : s->approach0[i];
    for (int j = 0; j < s->contacts; j++) {
        const int at = j * s->stride + i;
        if (way < 0) sum -= s->P[at] * force[j];
        if (passes(s, j) == way) sum += (s->A[at] + s->P[at]) * force[j];
    }
    return sum;
}

/* distance when it is open */
static double open_distance(const gk_system *s, int i)
{
    return gk_max(0.0, passes(s, i) > 0 ? s->dashpot.apart[i] : gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i));
}

/* The part of the step in which such a contact touches, by even motion: its deflection when closed, over that and the
 * distance when open. The scalar of the step's energy gives its mean force that part. */
static double touching(const gk_system *s, int i)
{
    const double own = deflected_by_these(s, i);
    return own > 0.0 ? own / (own + open_distance(s, i)) : 1.0;
}

/* Half the jump of the invariant where contacts close and open, by even motion (docs/theory.md, 12c) */
double gk_solve_jump(const gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    double sum = 0.0;
    for (int i = 0; i < s->contacts && !gk_film_on(s); i++) {
        const int way = passes(s, i);
        const double own = way ? deflected_by_these(s, i) : 0.0;
        if (!(own > 0.0)) continue;
        const double moved = own + open_distance(s, i);
        sum -= way * (way > 0 ? s->force[i] : s->force0[i]) / own * moved * moved;
    }
    return s->energy.lead * sum;
}

/* |η_d| of such a contact per λ0 + λ1. By even motion its damper is at its limit, the force, until that has grown to
 * c·speed: free − free²/(4 most), at most `most`. */
static double passing(const gk_system *s, int i, double free)
{
    const double most = touching(s, i), share = fabs(free) / (s->force0[i] + s->force[i]);
    return share < 2.0 * most ? share * (1.0 - 0.25 * share / most) : most;
}

/* Where the dashpots of contacts that are closed at either end stand: they never pull, so η_d is limited by ±(λ0 + λ1)
 * and f_d by ±λ1; a contact lets go without force */
static int limit_dashpots(gk_system *s)
{
    int changed = 0;
    for (int i = 0; i < s->contacts; i++) {
        signed char clip = 2, hold = 0;
        double part = 1.0;
        if (s->dashpot.coefficient[i] > 0.0 && (s->active[i] || s->force0[i] > 0.0)) {
            const double free = s->dashpot.coefficient[i] * (s->approach[i] - s->approach0[i]),
                         limit = s->force0[i] + s->force[i];
            const int turns = passes(s, i) && limit > 0.0;
            if (turns) part = passing(s, i, free);
            clip = turns ? (free < 0.0 ? -1 : 1) : towards(s->dashpot.clip[i], beyond(free, limit));
            const double mean = gk_clamp(free, -part * limit, part * limit);
            hold = s->active[i] ? towards(s->dashpot.hold[i],
                                          beyond(s->dashpot.beta[i] * mean + s->dashpot.tail[i], s->force[i]))
                                : 1;
            changed |= fabs(part - s->dashpot.part[i]) > PART_KNOWN;
        }
        changed |= clip != s->dashpot.clip[i] || hold != s->dashpot.hold[i];
        s->dashpot.part[i] = part;
        s->dashpot.clip[i] = clip;
        s->dashpot.hold[i] = hold;
    }
    return changed;
}

/* λ and z for the present α; starts from the present active set, settled */
void gk_solve_contacts(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    int fewest = MAX_ROWS + 1, patience = 4, dashpot_rounds = s->dashpot.stand ? 0 : DASHPOT_ROUNDS;
    s->limit_reached = 0; /* of the solution that is used in the end */
    for (int round = 0; round < ROUND_LIMIT; round++) {
        newton(s);
        unsigned char wrong[MAX_ROWS];
        const int count = contradictions(s, wrong);
        if (count) {
            if (count < fewest)
                fewest = count, patience = 4;
            else
                patience--;
            for (int i = s->n - 1, left = patience < 0 ? 1 : s->n; i >= 0 && left; i--)
                if (wrong[i]) flip(s, i), left--;
            gk_law_apply(s);
        } else if (dashpot_rounds-- <= 0 || !limit_dashpots(s)) {
            return;
        }
        gk_solve_status(s);
        gk_solve_settle(s);
    }
    s->limit_reached = 1;
}

/* back to α = 0: η is the dampers' */
void gk_solve_clear(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    const int stale = s->alpha != 0.0;
    s->alpha = 0.0;
    memset(s->direction, 0, (size_t)s->n * sizeof *s->direction);
    if (stale) gk_solve_settle(s);
}

/* stored energy of the quasi-static part at the present λ: ½ λᵀ(A + P)λ + Σ Φ(λ) */
double gk_solve_stored(const gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    double sum = 0.0;
    for (int i = 0; i < s->n; i++)
        if (s->force[i] != 0.0)
            sum += 0.5 * s->force[i] * (s->Al[i] + s->others.deflection[i] + s->linear[i]) + s->local.potential[i];
    return sum;
}
