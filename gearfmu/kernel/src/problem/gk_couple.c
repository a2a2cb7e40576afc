/* Engagements of one island (gk_islands.c). Each has a problem of its own, solved with the others' forces as they are.
 * Their effect on its gaps goes through spins, ground group, bores and the modes of shared gears, gathered and
 * scattered, never through one dense system. Block Gauss–Seidel: in M = D + C′ a rigid coordinate enters with h²/12 at
 * γ = 1: three or four sweeps suffice. The sum of all parts is exact, so is the energy they are balanced with. */
#include "problem/gk_shared.h"
#include "problem/gk_exchange.h"

enum { SWEEPS = 40, SETTLED = 20 }; /* from then on dashpots stand: they may go on limiting each other in turns */
#ifdef GK_DOUBLE_MODES
static const double TOLERANCE = 1e-11;
#else
static const double TOLERANCE = 1e-7; /* of the largest gap and deflection */
#endif
static const double NEGLIGIBLE = 1e-12; /* m, rad: of a gap and deflection that are none */

/* all that forces do to gaps in the step; their deflection at once alone, under those at the end or at the start; at
 * the start with what dampers and friction do there */
typedef enum { WHOLE, AT_ONCE, AT_START, WHOLE_START } effect;

/* a clutch knows no A; friction counts with all that forces do; what dampers deflect at far teeth is left out, so that
 * it stores nothing */
static void forces_of(const gk_setup *setup, gk_engaged *engaged, effect of)
{
    const gk_system *s = &engaged->system;
    gk_forces *f = &engaged->forces;
    const int start = of == AT_START || of == WHOLE_START; /* given torques may have changed */
    for (int i = 0; i < s->stride; i++) {
        const int row = i < s->n, clutch = row && s->kind[i] == ROW_CLUTCH;
        f->step[i] = row && of == WHOLE ? s->z[i] : 0.0;
        const double force = start ? s->force0[i] : s->force[i];
        const double damper = of == WHOLE ? s->end[i] : of == WHOLE_START ? s->end0[i] : 0.0;
        f->once[i] = row && !clutch ? force + damper : 0.0;
        f->far[i] = i < s->contacts ? force : 0.0;
        if (!GK_ON(setup, friction)) continue;
        const gk_glide *glide = engaged->glide;
        const int rubs = i < s->contacts;
        f->step_along[i] = rubs && of == WHOLE ? glide->step[i] : 0.0;
        f->once_along[i] = !rubs ? 0.0 : of == WHOLE ? glide->end[i] : of == WHOLE_START ? glide->start_end[i] : 0.0;
    }
}

/* ---- what an engagement gives ------------------------------------------------------------------------------------ */
/* sum += now − before, before = now */
static void exchange(double *sum, double *before, const double *now, int n)
{
    for (int i = 0; i < n; i++) sum[i] += now[i] - before[i], before[i] = now[i];
}

static void give_spins(const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e, const gk_forces *f)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    for (int l = 0; l < mesh->spins; l++) {
        const int d = mesh->spin[l];
        const double inverse = setup->inverse_inertia[d];
        double step = gk_dot_quads(s->rigid[l], f->step, s->stride / 4);
        double once = gk_dot_quads(s->rigid[l], f->once, s->stride / 4);
        if (GK_ON(setup, friction)) {
            step += gk_dot_quads(engaged->glide->rigid[l], f->step_along, s->stride / 4);
            once += gk_dot_quads(engaged->glide->rigid[l], f->once_along, s->stride / 4);
        }
        const double moved = k->rigid_mobility * inverse * step, yielded = k->rigid_kappa * inverse * once;
        exchange(&work->sum_spin[0][d], &engaged->given_spin[0][l], &moved, 1);
        exchange(&work->sum_spin[1][d], &engaged->given_spin[1][l], &yielded, 1);
    }
}

/* displacement of the engagement's own part of the ground group */
static void give_ground(const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e, const gk_forces *f)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_quad moved[(MAX_GROUND + 4 * MAX_ROTORS) / 4], yielded[(MAX_GROUND + 4 * MAX_ROTORS) / 4];
    gk_clear((double *)moved, mesh->local / 4), gk_clear((double *)yielded, mesh->local / 4);
    const gk_rows gaps = gk_rows_of_gaps(setup, work, e);
    gk_exchange_push_local(&gaps, f->step, f->once, (double *)moved, (double *)yielded);
    if (GK_ON(setup, friction)) {
        const gk_rows sliding = gk_rows_of_sliding(setup, work, e);
        gk_exchange_push_local(&sliding, f->step_along, f->once_along, (double *)moved, (double *)yielded);
    }
    for (int w = 0, at = 0; w < 2; w++) {
        const gk_span part = mesh->part[w];
        const gk_quad *mobility = (const gk_quad *)(k->ground.mobility + part.from);
        const gk_quad *kappa = (const gk_quad *)(k->ground.kappa + part.from);
        gk_quad *sum = (gk_quad *)(work->sum_ground + part.from), *given = (gk_quad *)engaged->given_ground;
        for (int q = 0; q < part.width / 4; q++, at++) {
            const gk_quad now = mobility[q] * moved[at] - kappa[q] * yielded[at];
            sum[q] += now - given[at];
            given[at] = now;
        }
    }
}

/* displacement of the modes of a gear that other engagements read too */
static void give_modes(const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e, int w, const gk_forces *f)
{
    const int g = setup->mesh[e].side[w].gear, n = setup->modal[g].n;
    gk_real *given = work->engaged[e].given_modes[w], *yielded = work->scaled;
    memset(given, 0, (size_t)n * sizeof *given);
    memset(yielded, 0, (size_t)n * sizeof *yielded);
    const gk_rows gaps = gk_rows_of_gaps(setup, work, e), sliding = gk_rows_of_sliding(setup, work, e);
    gk_exchange_push_modes(&gaps, w, f->step, f->once, given, yielded);
    gk_exchange_push_modes(&sliding, w, f->step_along, f->once_along, given, yielded);
    for (int i = 0; i < n; i++) given[i] = k->flow[g].mobility[i] * given[i] - k->flow[g].kappa[i] * yielded[i];
}

static void give_bores(const gk_setup *setup, gk_work *work, int e, const double *once)
{
    gk_bores bores = {{0}, {0}}, *given = &work->engaged[e].given_bores;
    gk_exchange_push_bores(setup, &work->engaged[e], once, &bores);
    exchange(work->sum_bores.moment, given->moment, bores.moment, MAX_PORTS);
    exchange(work->sum_bores.turned, given->turned, bores.turned, MAX_PORTS);
}

/* what an engagement's forces do to spins, ground group and bores; with friction to the modes of shared gears too */
static void give_forces(const gk_coupled *c, int e)
{
    const gk_forces *f = &c->work->engaged[e].forces;
    give_spins(c->setup, c->work, c->k, e, f);
    give_ground(c->setup, c->work, c->k, e, f);
    give_bores(c->setup, c->work, e, f->once);
    for (int w = 0; w < 2 && GK_ON(c->setup, friction); w++)
        if (c->setup->engagements_of[c->setup->mesh[e].side[w].gear] > 1) give_modes(c->setup, c->work, c->k, e, w, f);
}

static void give(const gk_coupled *c, int e, effect of)
{
    forces_of(c->setup, &c->work->engaged[e], of);
    give_forces(c, e);
}

static int within(const gk_coupled *c, int e) { return c->setup->mesh[e].island == c->island; }

/* nothing has been given yet */
static void forget_all(const gk_coupled *c)
{
    gk_work *work = c->work;
    memset(work->sum_spin, 0, sizeof work->sum_spin);
    memset(work->sum_ground, 0, (size_t)c->setup->base.n * sizeof *work->sum_ground);
    memset(&work->sum_bores, 0, sizeof work->sum_bores);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_engaged *engaged = &work->engaged[e];
        if (!within(c, e)) continue;
        memset(engaged->given_spin, 0, sizeof engaged->given_spin);
        memset(engaged->given_ground, 0, (size_t)c->setup->mesh[e].local * sizeof *engaged->given_ground);
        memset(&engaged->given_bores, 0, sizeof engaged->given_bores);
    }
}

static void give_all(const gk_coupled *c, effect of)
{
    forget_all(c);
    for (int e = 0; e < c->model->engagements; e++)
        if (within(c, e)) give(c, e, of);
}

/* ---- what it takes ----------------------------------------------------------------------------------------------- */
static void take_spins(const gk_coupled *c, int e, double *read)
{
    const gk_engaged *engaged = &c->work->engaged[e];
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_system *s = &engaged->system;
    for (int l = 0; l < mesh->spins; l++) {
        const double moved = c->work->sum_spin[0][mesh->spin[l]] - engaged->given_spin[0][l];
        const double yielded = c->work->sum_spin[1][mesh->spin[l]] - engaged->given_spin[1][l];
        gk_axpy(moved - yielded, s->rigid[l], read, 0, s->stride / 4);
        for (int i = s->n - s->clutches; i < s->n; i++) read[i] += yielded * s->rigid[l][i];
    }
}

/* what all others displace of the engagement's own part of the ground group */
static void others_ground(const gk_coupled *c, int e, double *others)
{
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_quad *given = (const gk_quad *)c->work->engaged[e].given_ground;
    for (int w = 0, at = 0; w < 2; w++) {
        const gk_quad *sum = (const gk_quad *)(c->work->sum_ground + mesh->part[w].from);
        for (int q = 0; q < mesh->part[w].width / 4; q++, at++) ((gk_quad *)others)[at] = sum[q] - given[at];
    }
}

static void take_ground(const gk_coupled *c, const gk_rows *rows, double *read)
{
    double others[MAX_GROUND + 4 * MAX_ROTORS];
    others_ground(c, rows->engaged->index, others);
    gk_exchange_read_local(rows, others, read);
}

static void take_bores(const gk_coupled *c, int e, double *read)
{
    const gk_bores *sum = &c->work->sum_bores, *own = &c->work->engaged[e].given_bores;
    gk_bores others;
    for (int p = 0; p < MAX_PORTS; p++) {
        others.moment[p] = sum->moment[p] - own->moment[p];
        others.turned[p] = sum->turned[p] - own->turned[p];
    }
    gk_exchange_read_bores(c->setup, &c->work->engaged[e], &others, read);
}

/* by the modes of a gear that other engagements read too */
static void take_modes(const gk_coupled *c, const gk_rows *rows, int which, double *read)
{
    gk_work *work = c->work;
    const int e = rows->engaged->index;
    const int g = c->setup->mesh[e].side[which].gear, n = c->setup->modal[g].n;
    gk_real *sum = work->scaled;
    memset(sum, 0, (size_t)n * sizeof *sum);
    for (int other = 0; other < c->model->engagements; other++)
        for (int w = 0; w < 2 && other != e; w++) {
            const gk_real *given = work->engaged[other].given_modes[w];
            for (int i = 0; i < n && c->setup->mesh[other].side[w].gear == g; i++) sum[i] += given[i];
        }
    gk_exchange_read_modes(rows, which, sum, read);
}

/* what the others do to the rows of an engagement; at_once: their forces in the step are 0 */
static void take(const gk_coupled *c, int e, int at_once, double *read)
{
    const gk_rows gaps = gk_rows_of_gaps(c->setup, c->work, e);
    take_ground(c, &gaps, read);
    take_spins(c, e, read);
    take_bores(c, e, read);
    gk_shared_read(c->work, e, at_once, read);
    for (int w = 0; w < 2 && GK_ON(c->setup, friction); w++)
        if (c->setup->engagements_of[c->setup->mesh[e].side[w].gear] > 1) take_modes(c, &gaps, w, read);
}

/* what the others do to the sliding of its contacts */
static void take_along(const gk_coupled *c, int e, double *read)
{
    gk_work *work = c->work;
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_engaged *engaged = &work->engaged[e];
    const gk_rows sliding = gk_rows_of_sliding(c->setup, work, e);
    take_ground(c, &sliding, read);
    for (int l = 0; l < mesh->spins; l++) {
        const double moved = work->sum_spin[0][mesh->spin[l]] - engaged->given_spin[0][l];
        const double yielded = work->sum_spin[1][mesh->spin[l]] - engaged->given_spin[1][l];
        gk_axpy(moved - yielded, engaged->glide->rigid[l], read, 0, engaged->system.stride / 4);
    }
    for (int w = 0; w < 2; w++)
        if (c->setup->engagements_of[mesh->side[w].gear] > 1) take_modes(c, &sliding, w, read);
}

/* Takes all that the others do; returns how much that has changed, against the largest gap and deflection: of contacts
 * where there are any, else of joints. A joint's gap may be the angle of a port, which grows as it turns. */
static double take_whole(const gk_coupled *c, int e)
{
    gk_system *s = &c->work->engaged[e].system;
    const int judged = s->contacts ? s->contacts : s->n;
    double read[MAX_STRIDE], change = 0.0, scale = NEGLIGIBLE;
    take(c, e, 0, read);
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
static void part_at_once(const gk_coupled *c, effect of)
{
    give_all(c, of);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        double read[MAX_STRIDE];
        if (!within(c, e)) continue;
        take(c, e, 1, read);
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
        if (!within(c, e)) continue;
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
    give_all(c, WHOLE);
    for (int round = 0; round < (c->sweeps ? c->sweeps : SWEEPS) && !(next < TOLERANCE); round++) {
        const double last = change;
        change = gaps = 0.0;
        for (int e = 0; e < c->model->engagements; e++) {
            if (!within(c, e)) continue;
            gaps = gk_max(gaps, take_whole(c, e));
            if (GK_ON(c->setup, friction)) take_along(c, e, c->work->engaged[e].glide->others);
            change = gk_max(change, solve_own(c, e, round));
            give(c, e, WHOLE);
        }
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
        if (within(c, e)) island.member[island.count++] = &c->work->engaged[e].system, c->alone = e;
    if (island.count > 1) gk_shared_form(c->model, c->setup, c->k, c->work, c->island);
    island.sweep = island.count > 1 ? sweep : GK_ON(c->setup, friction) ? rub : NULL;
    return island;
}

/* what others deflect along the profile at the start of the step */
static void recall_along(const gk_coupled *c)
{
    give_all(c, WHOLE_START);
    for (int e = 0; e < c->model->engagements; e++)
        if (within(c, e)) take_along(c, e, c->work->engaged[e].glide->others_start);
}

/* the start of the step: under λ0 the others deflect too */
void gk_couple_recall(gk_coupled *c)
{
    GK_ASSERT(c->island >= 0 && c->island < c->setup->islands);
    if (GK_ON(c->setup, friction)) recall_along(c);
    part_at_once(c, AT_START);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        if (!within(c, e)) continue;
        for (int i = 0; i < s->n; i++) {
            s->outer[i] = 0.0;
            if (s->kind[i] == ROW_CLUTCH) continue;
            const int entered = i < s->contacts && !s->recalled[i];
            s->g0[i] = entered ? gk_max(s->g[i], -gk_solve_quasi_static(s, i)) : s->g0[i] - s->beyond[i];
            s->stored0 += 0.5 * s->force0[i] * s->beyond[i];
        }
    }
}

/* Gives a unit force of one row, acting at once, and nothing else. */
void gk_couple_unit(const gk_coupled *c, int from, int row)
{
    GK_ASSERT(within(c, from) && row < c->work->engaged[from].system.n);
    forget_all(c);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_forces *f = &c->work->engaged[e].forces;
        memset(f, 0, sizeof *f);
        if (e == from) f->once[row] = 1.0, f->far[row] = row < c->work->engaged[e].system.contacts;
        if (within(c, e)) give_forces(c, e);
    }
}

/* what was given does at once to the rows of another engagement */
void gk_couple_read(const gk_coupled *c, int to, double *read)
{
    GK_ASSERT(within(c, to));
    memset(read, 0, (size_t)c->work->engaged[to].system.stride * sizeof *read);
    take(c, to, 1, read);
}
