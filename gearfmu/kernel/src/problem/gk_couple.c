/* Engagements of one island (gk_islands.c). Each has a problem of its own, solved with what the others do as it is: all
 * at once, then a pass over the rows of the island tells what their new forces do (gk_pass.c). Block Jacobi: in M = D +
 * C′ a rigid coordinate enters with h²/12 at γ = 1, so that a pass leaves some thousandths of the error. Where a step
 * is so long that they hold each other more than themselves, they take turns, with a pass after each (Gauss–Seidel).
 * An engagement's own matrices may be of some steps ago: rows read what forces really do, its own included, and what
 * its matrices know of that it does not take twice. */
#include "problem/gk_pass.h"
#include "problem/gk_far.h"

/* SETTLED: from then on dashpots stand: they may go on limiting each other. TURNS: passes that tell whether one after
 * the other is better. */
enum { PASSES = 40, SETTLED = 20, TURNS = 6 };
static const double SLOW = 0.4; /* rate of change from which they take turns */
#ifdef GK_DOUBLE_MODES
static const double TOLERANCE = 1e-11, AT_REST_TOLERANCE = 1e-11, FRICTION_TOLERANCE = 1e-11;
#else
static const double TOLERANCE = 3e-7;          /* of the largest gap and deflection */
static const double AT_REST_TOLERANCE = 2e-8;  /* of statics */
static const double FRICTION_TOLERANCE = 1e-7; /* of the largest normal force */
#endif
static const double SOON = 1e-4; /* from here on the next pass may be the last, and reads what stores energy */
static const double BENT = 0.01, ROUGHLY = 1e-5; /* of what others do anew, of all: what a local law may bend yet */
static const double NEGLIGIBLE = 1e-9; /* m, rad: of a gap and deflection of which a pass reads nothing but rounding */

/* Takes what a pass has read, less what the engagement's own matrices say. Returns how much that has changed, against
 * the largest gap and deflection: of contacts where there are any, else of joints. A joint's gap may be the angle of a
 * port, which grows as it turns. */
static double take_whole(const gk_coupled *c, int e)
{
    gk_engaged *engaged = &c->work->engaged[e];
    gk_system *s = &engaged->system;
    const int judged = s->contacts ? s->contacts : s->n;
    double own[MAX_STRIDE] = {0}, along[MAX_STRIDE], change = 0.0, scale = NEGLIGIBLE;
    const int rubs = GK_ON(c->setup, friction);
    if (rubs) {
        gk_solve_times(s, engaged->glide->D, s->z, own);
        gk_glide_own(engaged->glide, s, &engaged->forces, own, along);
        for (int i = 0; i < s->contacts; i++) engaged->glide->others[i] = engaged->glide->moved_along[i] - along[i];
    }
    for (int i = 0; i < s->n; i++) {
        const double others = engaged->moved[WHOLE][i] - ((rubs ? own[i] : s->Dz[i]) + s->dashpot.lag[i] + s->Al[i]);
        if (i < judged) {
            change = gk_max(change, fabs(others - s->others.gap[i] - s->others.deflection[i]));
            scale = gk_max(scale, fabs(s->Dz[i]) + fabs(s->Al[i]) + (s->contacts ? fabs(s->g[i]) : 0.0));
        }
        s->others.gap[i] = others - s->others.deflection[i];
    }
    return change / scale;
}

/* tells the deflection at once from the rest of what was taken */
static void part_at_once(gk_engaged *engaged)
{
    gk_system *s = &engaged->system;
    double own[MAX_STRIDE];
    gk_solve_times(s, s->A, engaged->forces.of[AT_ONCE], own);
    for (int i = 0; i < s->n; i++) {
        const double beyond = !gk_row_yields(s, i) ? 0.0 : engaged->moved[YIELDED][i] - own[i];
        s->others.gap[i] += s->others.deflection[i] - beyond;
        s->others.deflection[i] = beyond;
    }
}

static void part_all(const gk_coupled *c)
{
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) part_at_once(&c->work->engaged[e]);
}

/* contacts and friction of an engagement once; returns how much friction has changed. Where it is at its limits is
 * found without the scalar of the step's energy. */
static double solve_own(const gk_coupled *c, int e, int round, double enough)
{
    gk_engaged *engaged = &c->work->engaged[e];
    engaged->system.dashpot.stand = round >= SETTLED;
    if (GK_ON(c->setup, friction))
        return gk_friction_solve(engaged->glide, &engaged->system, round, engaged->system.alpha != 0.0, enough);
    gk_solve_contacts(&engaged->system);
    return 0.0;
}

/* Is what friction still changes by nothing beside the largest normal force of the island? In a mesh that is only
 * grazed it may go on changing sides. */
static int hardly_rubs(const gk_coupled *c)
{
    double moved = 0.0, largest = 0.0;
    for (int e = 0; e < c->model->engagements; e++) {
        const gk_system *s = &c->work->engaged[e].system;
        if (!gk_is_within(c, e)) continue;
        if (GK_ON(c->setup, friction)) moved = gk_max(moved, c->work->engaged[e].glide->moved);
        for (int i = 0; i < s->contacts; i++) largest = gk_max(largest, fabs(s->force[i]));
    }
    return moved < FRICTION_TOLERANCE * largest;
}

static void account_all(const gk_coupled *c)
{
    for (int e = 0; e < c->model->engagements && GK_ON(c->setup, friction); e++)
        if (gk_is_within(c, e)) gk_friction_account(c->work->engaged[e].glide, &c->work->engaged[e].system);
}

/* Tells whether an island has not settled. The search for the scalar takes friction's statuses as they were found
 * without it, and cannot tell whether these are right: the step does, by `unsettled`. */
static void tell_unsettled(gk_coupled *c, const gk_island *island, int open)
{
    if (open) island->member[0]->limit_reached = 1;
    if (!(fabs(island->member[0]->alpha) > 0.0)) c->unsettled = open;
}

/* an engagement that is alone: normal forces and friction in turns */
static void rub(const gk_island *island)
{
    gk_coupled *c = island->context;
    const int e = (int)c->alone;
    double change = INFINITY;
    for (int round = 0; round < PASSES && !(change < FRICTION_TOLERANCE); round++)
        change = solve_own(c, e, round, 0.5 * FRICTION_TOLERANCE);
    account_all(c);
    island->member[0]->dashpot.stand = 0;
    tell_unsettled(c, island, !(change < FRICTION_TOLERANCE) && !hardly_rubs(c));
}

static void read_all(gk_coupled *c, int at_once)
{
    gk_pass_forces(c, PRESENT);
    gk_pass(c, 1, at_once);
    if (at_once) part_all(c);
}

/* Solves all engagements, each with the others as they were, or one after the other. Returns how much friction has
 * changed; gaps: how much what they take of each other has. */
static double solve_each(gk_coupled *c, int round, int in_turn, double *gaps)
{
    double change = 0.0;
    *gaps = 0.0;
    for (int e = 0; e < c->model->engagements; e++) {
        if (!gk_is_within(c, e)) continue;
        if (in_turn) read_all(c, 0);
        const double taken = take_whole(c, e), enough = c->sweeps ? AT_REST_TOLERANCE : TOLERANCE;
        *gaps = gk_max(*gaps, taken);
        if (!GK_ON(c->setup, friction))
            c->work->engaged[e].system.others.bends = gk_clamp(BENT * taken, 0.1 * enough, ROUGHLY);
        change = gk_max(change, solve_own(c, e, round, 0.0));
    }
    return change;
}

/* passes until what engagements do to each other no longer changes; the last move is too small for another */
static void sweep(const gk_island *island)
{
    gk_coupled *c = island->context;
    const int first = !c->known; /* what they do to each other is not known yet: its change says nothing */
    const double enough = c->sweeps ? AT_REST_TOLERANCE : TOLERANCE;
    double change = INFINITY, next = INFINITY, gaps = INFINITY;
    int parted = 0, in_turn = 0;
    for (int round = 0; round < (c->sweeps ? c->sweeps : PASSES) && !(next < enough); round++) {
        const double last = change;
        parted = !in_turn && (next < SOON || (!first && !round));
        if (!c->read && !in_turn) read_all(c, parted);
        c->read = 0;
        change = gk_max(solve_each(c, round, in_turn, &gaps), 0.0);
        change = gk_max(change, gaps);
        if (round > first) c->rate = gk_clamp(change / last, 1e-3, 1.0);
        next = round || !first ? change * c->rate : INFINITY; /* what another pass would find */
        in_turn |= round >= TURNS && c->rate > SLOW;
    }
    c->known = 1;
    for (int m = 0; m < island->count; m++) island->member[m]->dashpot.stand = 0;
    if (!parted) {
        gk_pass_forces(c, PRESENT);
        gk_pass(c, 0, 1);
        part_all(c);
    }
    account_all(c);
    tell_unsettled(c, island, !(next < enough) && !(gaps < enough && hardly_rubs(c)));
}

gk_island gk_couple_island(gk_coupled *c)
{
    GK_ASSERT(c->island >= 0 && c->island < c->setup->islands);
    gk_island island = {.context = c};
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) island.member[island.count++] = &c->work->engaged[e].system, c->alone = e;
    if (island.count > 1) gk_far_list(c);
    for (int m = 0; m < island.count; m++) island.member[m]->others.coupled = island.count > 1;
    island.sweep = island.count > 1 ? sweep : GK_ON(c->setup, friction) ? rub : NULL;
    return island;
}

/* what others deflect along the profile at the start of the step */
static void recall_along(const gk_coupled *c)
{
    gk_pass_forces(c, ALONG_START);
    gk_pass(c, 1, 0);
    for (int e = 0; e < c->model->engagements; e++) {
        double gaps[MAX_STRIDE] = {0}, along[MAX_STRIDE];
        const gk_engaged *engaged = &c->work->engaged[e];
        if (!gk_is_within(c, e)) continue;
        gk_glide_own(engaged->glide, &engaged->system, &engaged->forces, gaps, along);
        for (int i = 0; i < engaged->system.contacts; i++)
            engaged->glide->others_start[i] = engaged->glide->moved_along[i] - along[i];
    }
}

/* The start of the step: under λ0 the others deflect too. Reads what the first guess does with it. */
void gk_couple_recall(gk_coupled *c)
{
    GK_ASSERT(c->island >= 0 && c->island < c->setup->islands);
    if (GK_ON(c->setup, friction)) recall_along(c);
    gk_pass_forces(c, FROM_START);
    gk_pass(c, 1, 1);
    part_all(c);
    c->read = 1;
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        if (!gk_is_within(c, e)) continue;
        for (int i = 0; i < s->n; i++) {
            s->others.gap[i] = 0.0;
            if (!gk_row_yields(s, i)) continue;
            const int entered = i < s->contacts && !s->flank.recalled[i];
            s->g0[i] = entered ? gk_max(s->g[i], -gk_solve_quasi_static(s, i)) : s->g0[i] - s->others.deflection[i];
            s->energy.stored0 += 0.5 * s->force0[i] * s->others.deflection[i];
        }
    }
}
