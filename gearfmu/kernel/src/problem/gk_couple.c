/* Engagements of one island (gk_islands.c). Each has a problem of its own, solved with the others' forces as they are.
 * Their effect on its gaps goes through spins, ground group, bores and the modes of shared gears, gathered and
 * scattered, never through one dense system. Block Gauss–Seidel: in M = D + C′ a rigid coordinate enters with h²/12 at
 * γ = 1: three or four sweeps suffice. The sum of all parts is exact, so is the energy they are balanced with. */
#include "problem/gk_give.h"
#include "problem/gk_felt.h"
#include "problem/gk_shared.h"

enum { SWEEPS = 40, SETTLED = 20 }; /* from then on dashpots stand: they may go on limiting each other in turns */
#ifdef GK_DOUBLE_MODES
static const double TOLERANCE = 1e-11;
#else
static const double TOLERANCE = 1e-7; /* of the largest gap and deflection */
#endif
static const double NEGLIGIBLE = 1e-12; /* m, rad: of a gap and deflection that are none */

/* Takes all that the others do; returns how much that has changed, against the largest gap and deflection: of contacts
 * where there are any, else of joints. A joint's gap may be the angle of a port, which grows as it turns. */
static double take_whole(const gk_coupled *c, int e)
{
    gk_system *s = &c->work->engaged[e].system;
    const int judged = s->contacts ? s->contacts : s->n;
    double read[MAX_STRIDE], change = 0.0, scale = NEGLIGIBLE;
    gk_take(c, e, 0, read);
    for (int i = 0; i < s->n; i++) {
        if (i < judged) {
            change = gk_max(change, fabs(read[i] - s->outer[i] - s->beyond[i]));
            scale = gk_max(scale, fabs(s->Dz[i]) + fabs(s->Al[i]) + (s->contacts ? fabs(s->g[i]) : 0.0));
        }
        s->outer[i] = read[i] - s->beyond[i];
    }
    return change / scale;
}

/* tells the deflection at once from the rest of what was taken */
static void part_at_once(const gk_coupled *c, gk_effect of)
{
    gk_give_all(c, of);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        double read[MAX_STRIDE];
        if (!gk_is_within(c, e)) continue;
        gk_take(c, e, 1, read);
        for (int i = 0; i < s->n; i++) {
            const double beyond = s->kind[i] == ROW_CLUTCH ? 0.0 : read[i];
            s->outer[i] += s->beyond[i] - beyond;
            s->beyond[i] = beyond;
        }
    }
}

/* contacts and friction of an engagement once; returns how much friction has changed. Where it is at its limits is
 * found without the scalar of the step's energy. */
static double solve_own(const gk_coupled *c, int e, int round)
{
    gk_engaged *engaged = &c->work->engaged[e];
    engaged->system.dashpots_stand = round >= SETTLED;
    if (GK_ON(c->setup, friction))
        return gk_friction_solve(engaged->glide, &engaged->system, round, engaged->system.alpha != 0.0);
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
    return moved < TOLERANCE * largest;
}

/* an engagement that is alone: normal forces and friction in turns */
static void rub(const gk_island *island)
{
    gk_coupled *c = island->context;
    const int e = (int)c->alone;
    double change = INFINITY;
    for (int round = 0; round < SWEEPS && !(change < TOLERANCE); round++) change = solve_own(c, e, round);
    island->member[0]->dashpots_stand = 0;
    if (!(change < TOLERANCE) && !hardly_rubs(c)) island->member[0]->limit_reached = 1;
}

/* sweeps until what engagements do to each other no longer changes */
static void sweep(const gk_island *island)
{
    gk_coupled *c = island->context;
    double change = INFINITY, next = INFINITY, gaps = INFINITY;
    gk_give_all(c, WHOLE);
    for (int round = 0; round < (c->sweeps ? c->sweeps : SWEEPS) && !(next < TOLERANCE); round++) {
        const double last = change;
        change = gaps = 0.0;
        for (int e = 0; e < c->model->engagements; e++) {
            if (!gk_is_within(c, e)) continue;
            gaps = gk_max(gaps, take_whole(c, e));
            if (GK_ON(c->setup, friction)) gk_take_along(c, e, c->work->engaged[e].glide->others);
            change = gk_max(change, solve_own(c, e, round));
            gk_give(c, e, WHOLE);
        }
        if (c->work->by_patterns) gk_felt_others(c, 0);
        change = gk_max(change, gaps);
        if (round) c->rate = gk_min(1.0, change / last);
        next = change * c->rate; /* what another sweep would find */
    }
    for (int m = 0; m < island->count; m++) island->member[m]->dashpots_stand = 0;
    part_at_once(c, AT_ONCE);
    if (!(next < TOLERANCE) && !(gaps < TOLERANCE && hardly_rubs(c))) island->member[0]->limit_reached = 1;
}

gk_island gk_couple_island(gk_coupled *c)
{
    GK_ASSERT(c->island >= 0 && c->island < c->setup->islands);
    gk_island island = {.context = c};
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) island.member[island.count++] = &c->work->engaged[e].system, c->alone = e;
    if (island.count > 1) gk_shared_form(c->model, c->setup, c->work, c->island);
    island.sweep = island.count > 1 ? sweep : GK_ON(c->setup, friction) ? rub : NULL;
    return island;
}

/* what others deflect along the profile at the start of the step */
static void recall_along(const gk_coupled *c)
{
    gk_give_all(c, WHOLE_START);
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) gk_take_along(c, e, c->work->engaged[e].glide->others_start);
}

/* the start of the step: under λ0 the others deflect too */
void gk_couple_recall(gk_coupled *c)
{
    GK_ASSERT(c->island >= 0 && c->island < c->setup->islands);
    if (GK_ON(c->setup, friction)) recall_along(c);
    part_at_once(c, AT_START);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        if (!gk_is_within(c, e)) continue;
        for (int i = 0; i < s->n; i++) {
            s->outer[i] = 0.0;
            if (s->kind[i] == ROW_CLUTCH) continue;
            const int entered = i < s->contacts && !s->recalled[i];
            s->g0[i] = entered ? gk_max(s->g[i], -gk_solve_quasi_static(s, i)) : s->g0[i] - s->beyond[i];
            s->stored0 += 0.5 * s->force0[i] * s->beyond[i];
        }
    }
}
