/* What engagements of an island do to each other: forces go to spins, ground group, bores and modes of shared gears,
 * and each engagement reads what all others have displaced: the sum less what is its own. */
#include "problem/gk_give.h"
#include "problem/gk_exchange.h"
#include "problem/gk_felt.h"
#include "problem/gk_shared.h"

/* a clutch knows no A; friction counts with all that forces do; what dampers deflect at far teeth is left out, so that
 * it stores nothing */
static void forces_of(const gk_setup *setup, gk_engaged *engaged, gk_effect of)
{
    const gk_system *s = &engaged->system;
    gk_forces *f = &engaged->forces;
    const int start = of == AT_START || of == WHOLE_START; /* given torques may have changed */
    f->at_once = of != WHOLE;
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
static void give_ground(const gk_coupled *c, int e, const gk_forces *f)
{
    const gk_setup *setup = c->setup;
    gk_work *work = c->work;
    const gk_coefficients *k = c->k;
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_quad moved[(MAX_GROUND + 4 * MAX_ROTORS) / 4], yielded[(MAX_GROUND + 4 * MAX_ROTORS) / 4];
    gk_clear((double *)moved, engaged->local / 4), gk_clear((double *)yielded, engaged->local / 4);
    const gk_rows gaps = gk_rows_of_gaps(setup, work, e);
    if (f->at_once)
        gk_exchange_push_once(&gaps, f->once, (double *)yielded);
    else
        gk_exchange_push_local(&gaps, f->step, f->once, (double *)moved, (double *)yielded);
    if (GK_ON(setup, friction)) {
        const gk_rows sliding = gk_rows_of_sliding(setup, work, e);
        if (!f->at_once)
            gk_exchange_push_local(&sliding, f->step_along, f->once_along, (double *)moved, (double *)yielded);
    }
    for (int w = 0, at = 0; w < 2; w++) {
        const gk_span part = mesh->part[w];
        if (engaged->by_patterns[w]) {
            gk_felt_give(c, e, w, (double *)(moved + at), (double *)(yielded + at));
            at += engaged->wide[w] / 4;
            continue;
        }
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
static void give_modes(const gk_coupled *c, int e, int w, const gk_forces *f)
{
    gk_work *work = c->work;
    const int g = c->setup->mesh[e].side[w].gear, n = GK_LANES(c->setup, g);
    const gk_flow *flow = &c->k->flow[g];
    gk_half *sum = (gk_half *)work->sum_modes[g], *given = (gk_half *)work->engaged[e].given_modes[w];
    gk_half *now = (gk_half *)work->scaled;
    memset(now, 0, (size_t)n * sizeof(gk_real));
    const gk_rows gaps = gk_rows_of_gaps(c->setup, work, e);
    gk_exchange_displace(&gaps, w, flow, f->at_once ? NULL : f->step, f->once, work->scaled);
    if (GK_ON(c->setup, friction)) {
        const gk_rows sliding = gk_rows_of_sliding(c->setup, work, e);
        gk_exchange_displace(&sliding, w, flow, f->at_once ? NULL : f->step_along, f->once_along, work->scaled);
    }
    for (int i = 0; i < 2 * n / LANES; i++) sum[i] += now[i] - given[i], given[i] = now[i];
}

/* whose modes an engagement feels through others: gears that others read too, in a step in which forces move them */
static int feels(const gk_coupled *c, int e, int w)
{
    return !c->k->timeless && c->setup->engagements_of[c->setup->mesh[e].side[w].gear] > 1;
}

static void give_bores(const gk_setup *setup, gk_work *work, int e, const double *once)
{
    gk_bores bores = {{0}, {0}}, *given = &work->engaged[e].given_bores;
    gk_exchange_push_bores(setup, &work->engaged[e], once, &bores);
    exchange(work->sum_bores.moment, given->moment, bores.moment, MAX_PORTS);
    exchange(work->sum_bores.turned, given->turned, bores.turned, MAX_PORTS);
}

/* what an engagement's forces do to spins, ground group, bores and the modes of shared gears */
static void give_forces(const gk_coupled *c, int e)
{
    const gk_forces *f = &c->work->engaged[e].forces;
    give_spins(c->setup, c->work, c->k, e, f);
    give_ground(c, e, f);
    give_bores(c->setup, c->work, e, f->once);
    for (int w = 0; w < 2; w++)
        if (feels(c, e, w)) give_modes(c, e, w, f);
}

void gk_give(const gk_coupled *c, int e, gk_effect of)
{
    forces_of(c->setup, &c->work->engaged[e], of);
    give_forces(c, e);
}

/* nothing has been given yet */
static void forget_all(const gk_coupled *c)
{
    gk_work *work = c->work;
    memset(work->sum_spin, 0, sizeof work->sum_spin);
    memset(work->sum_ground, 0, (size_t)c->setup->base.n * sizeof *work->sum_ground);
    memset(&work->sum_bores, 0, sizeof work->sum_bores);
    memset(work->sum_patterns, 0, (size_t)c->model->gears * sizeof *work->sum_patterns);
    for (int g = 0; g < c->model->gears; g++)
        memset(work->sum_modes[g], 0, (size_t)GK_LANES(c->setup, g) * sizeof(gk_real));
    for (int e = 0; e < c->model->engagements; e++) {
        gk_engaged *engaged = &work->engaged[e];
        if (!gk_is_within(c, e)) continue;
        memset(engaged->given_spin, 0, sizeof engaged->given_spin);
        memset(engaged->given_ground, 0, (size_t)engaged->local * sizeof *engaged->given_ground);
        for (int w = 0; w < 2; w++)
            if (engaged->by_patterns[w]) memset(&engaged->pattern[w], 0, sizeof engaged->pattern[w]);
        memset(&engaged->given_bores, 0, sizeof engaged->given_bores);
        for (int w = 0; w < 2; w++)
            if (feels(c, e, w))
                memset(engaged->given_modes[w], 0,
                       (size_t)GK_LANES(c->setup, c->setup->mesh[e].side[w].gear) * sizeof(gk_real));
    }
}

void gk_give_all(const gk_coupled *c, gk_effect of)
{
    forget_all(c);
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) gk_give(c, e, of);
    if (c->work->by_patterns) gk_felt_others(c, of != WHOLE);
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
static void others_ground(const gk_coupled *c, int e, int at_once, double *others)
{
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_quad *given = (const gk_quad *)c->work->engaged[e].given_ground;
    for (int w = 0, at = 0; w < 2; w++) {
        const gk_quad *sum = (const gk_quad *)(c->work->sum_ground + mesh->part[w].from);
        if (c->work->engaged[e].by_patterns[w]) {
            gk_felt_take(c->setup, c->work, e, w, at_once, others + 4 * at);
            at += c->work->engaged[e].wide[w] / 4;
            continue;
        }
        for (int q = 0; q < mesh->part[w].width / 4; q++, at++) ((gk_quad *)others)[at] = sum[q] - given[at];
    }
}

static void take_ground(const gk_coupled *c, const gk_rows *rows, int at_once, double *read)
{
    double others[MAX_GROUND + 4 * MAX_ROTORS];
    others_ground(c, rows->engaged->index, at_once, others);
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
static void take_modes(const gk_coupled *c, const gk_rows *rows, int which, int at_once, double *read)
{
    const int e = rows->engaged->index, g = c->setup->mesh[e].side[which].gear;
    const gk_half *sum = (const gk_half *)c->work->sum_modes[g],
                  *given = (const gk_half *)rows->engaged->given_modes[which];
    gk_half *others = (gk_half *)c->work->scaled; /* against the rows, which measure outward */
    for (int i = 0; i < 2 * GK_LANES(c->setup, g) / LANES; i++) others[i] = given[i] - sum[i];
    gk_exchange_feel(rows, which, c->work->scaled, &c->k->flow[g], at_once, read);
}

/* what the others do to the rows of an engagement; at_once: their forces in the step are 0 */
void gk_take(const gk_coupled *c, int e, int at_once, double *read)
{
    const gk_rows gaps = gk_rows_of_gaps(c->setup, c->work, e);
    take_ground(c, &gaps, at_once, read);
    take_spins(c, e, read);
    take_bores(c, e, read);
    gk_shared_read(c->setup, c->work, e, read);
    for (int w = 0; w < 2; w++)
        if (feels(c, e, w)) take_modes(c, &gaps, w, at_once, read);
}

/* what the others do to the sliding of its contacts */
void gk_take_along(const gk_coupled *c, int e, double *read)
{
    gk_work *work = c->work;
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_engaged *engaged = &work->engaged[e];
    const gk_rows sliding = gk_rows_of_sliding(c->setup, work, e);
    take_ground(c, &sliding, 0, read);
    for (int l = 0; l < mesh->spins; l++) {
        const double moved = work->sum_spin[0][mesh->spin[l]] - engaged->given_spin[0][l];
        const double yielded = work->sum_spin[1][mesh->spin[l]] - engaged->given_spin[1][l];
        gk_axpy(moved - yielded, engaged->glide->rigid[l], read, 0, engaged->system.stride / 4);
    }
    for (int w = 0; w < 2; w++)
        if (feels(c, e, w)) take_modes(c, &sliding, w, 0, read);
}

/* Gives a unit force of one row, acting at once, and nothing else. */
void gk_give_unit(const gk_coupled *c, int from, int row)
{
    GK_ASSERT(gk_is_within(c, from) && row < c->work->engaged[from].system.n);
    forget_all(c);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_forces *f = &c->work->engaged[e].forces;
        memset(f, 0, sizeof *f);
        f->at_once = 1;
        if (e == from) f->once[row] = 1.0, f->far[row] = row < c->work->engaged[e].system.contacts;
        if (gk_is_within(c, e)) give_forces(c, e);
    }
}

/* what was given does at once to the rows of another engagement */
void gk_take_given(const gk_coupled *c, int to, double *read)
{
    GK_ASSERT(gk_is_within(c, to));
    memset(read, 0, (size_t)c->work->engaged[to].system.stride * sizeof *read);
    gk_take(c, to, 1, read);
}
