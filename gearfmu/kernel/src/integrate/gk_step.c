/* One internal step of dg4 (docs/theory.md, 3). It reads like its description: predict, find, form, recall, solve,
 * and only if all is finite: correct and remember. Until it corrects nothing of gk_data changes but its expression for
 * another h, so a step that fails can be repeated with another h or scheme. */
#include "integrate/gk_advance.h"
#include "integrate/gk_energy.h"
#include "integrate/gk_integrate.h"
#include "problem/gk_felt.h"

static const double HUGE_FORCE = 1e15;             /* N: no gear force reaches this value */
static const double FARTHEST = 0.25 * 2.0 * GK_PI; /* a quarter of a pitch */

/* from old to k, where the force is f: q and v of a state of displacement + κ f and unit ẋ + lead ḟ + hold f */
static void express_modes(const gk_flow *k, const gk_flow *old, int n, gk_real *q)
{
    gk_real *v = q + n;
    const gk_real *f = v + n, *rate = f + n;
    for (int i = 0; i < n; i++) {
        const gk_real speed = (v[i] - old->lead[i] * rate[i] - old->hold[i] * f[i]) / old->unit[i];
        q[i] += (k->kappa[i] - old->kappa[i]) * f[i];
        v[i] = k->unit[i] * speed + k->lead[i] * rate[i] + k->hold[i] * f[i];
    }
}

/* the same of the ground group */
static void express_ground(const gk_ground_flow *k, const gk_ground_flow *old, int n, double *x)
{
    double *v = x + n;
    const double *f = v + n, *rate = f + n;
    for (int i = 0; i < n; i++) {
        const double speed = (v[i] - old->lead[i] * rate[i] - old->hold[i] * f[i]) / old->unit[i];
        x[i] += (k->kappa[i] - old->kappa[i]) * f[i];
        v[i] = k->unit[i] * speed + k->lead[i] * rate[i] + k->hold[i] * f[i];
    }
}

/* When h or γ changes, displacement and speed of the motion stay (docs/theory, 3.8); at rest they are the state.
 * Another expression has another energy: the balance goes on from there. */
static void express(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                    const gk_coefficients *k)
{
    if (data->state_h == k->h && data->state_gamma == k->gamma) return;
    const gk_coefficients *old = data->state_h > 0.0
                                     ? gk_flow_for(model, setup, &work->room, data->state_h, data->state_gamma)
                                     : &work->room.explicit_rows;
    const double before = gk_energy_dynamic(model, setup, data, old);
    express_ground(&k->ground, &old->ground, setup->base.n, gk_ground_of(data));
    for (int g = 0; g < model->gears; g++)
        express_modes(&k->flow[g], &old->flow[g], GK_LANES(setup, g), gk_modal_of(setup, data, g));
    for (int d = 0; d < setup->spins; d++) {
        const double by_force = setup->inverse_inertia[d] * GK_OF(data, f)[d];
        GK_OF(data, x)[d] += (k->rigid_kappa - old->rigid_kappa) * by_force;
        GK_OF(data, v)[d] += (k->rigid_lead - old->rigid_lead) * setup->inverse_inertia[d] * GK_OF(data, f_rate)[d];
    }
    data->energy.baseline += gk_energy_dynamic(model, setup, data, k) - before;
    data->state_h = k->h;
    data->state_gamma = k->gamma;
}

/* a step may not carry a gear past its teeth: contact would not see it */
static int passable(const gk_model *model, const gk_work *work, const gk_data *data)
{
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2 && model->engagement[e].kind != MESH_FLAT; w++) {
            const gk_gear *gear = &model->gear[model->engagement[e].gear[w]];
            const int frame = model->frame[gear->rotor];
            const double turned = frame < 0 ? 0.0 : work->spin[frame] - GK_OF(data, x)[frame];
            if (!(fabs(work->spin[gear->rotor] - GK_OF(data, x)[gear->rotor] - turned) * gear->z < FARTHEST)) return 0;
        }
    return 1;
}

/* A torque that is given anew acts from the start of the step: its mean in the step is the new value, so that the force
 * at the end that a prediction with the old one needs is as far beyond it (docs/theory.md, 3.3) */
static void find_jumps(const gk_work *work, gk_system *s)
{
    for (int i = s->contacts; i < s->n; i++)
        if (gk_row_is_given(s, i)) s->jump[i] = work->torque[s->joint.port[i]] - s->force0[i];
}

/* Tip corners off: did a pair that carried load end with its flank? */
static int flank_ended(const gk_meshing *meshing, const gk_engaged *engaged, int strips)
{
    for (int m = 0; m < meshing->pairs; m++) {
        double load = 0.0;
        int there = 0;
        for (int i = 0; i < strips; i++) load += meshing->memory[m].force[i];
        for (int p = 0; p < engaged->places; p++) there |= engaged->place[p].memory == m;
        if (load > 0.0 && !there) return 1;
    }
    return 0;
}

static int all_finite(const gk_system *s)
{
    const gk_quad *force = (const gk_quad *)s->force, *z = (const gk_quad *)s->z, *g = (const gk_quad *)s->g;
    gk_bits fine = ~(gk_bits){0};
    for (int q = 0; q < s->stride / 4; q++)
        fine &= (GK_MAGNITUDE(force[q]) < HUGE_FORCE) & (GK_MAGNITUDE(z[q]) < HUGE_FORCE) &
                (GK_MAGNITUDE(g[q]) < HUGE_FORCE);
    return (fine[0] & fine[1] & fine[2] & fine[3]) != 0;
}

/* problems of all engagements, island by island */
static gk_outcome solve_all(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                            const gk_coefficients *k)
{
    for (int i = 0; i < setup->islands; i++) {
        gk_coupled coupled = {.model = model, .setup = setup, .work = work, .k = k, .island = i, .rate = GK_FIRST_RATE};
        const gk_island island = gk_couple_island(&coupled);
        if (island.count > 1) gk_couple_recall(&coupled);
        gk_balance_solve(&island);
        if (coupled.unsettled) island.member[0]->limit_reached = 1;
    }
    for (int e = 0; e < model->engagements; e++) {
        gk_system *s = &work->engaged[e].system;
        if (!all_finite(s)) return GK_DIVERGED;
        if (GK_HAS(tip_contact) && !setup->on.tip_contact &&
            flank_ended(&GK_OF(data, meshing)[e], &work->engaged[e], s->strips))
            data->status |= STATUS_TIP_ENDED;
    }
    return GK_OK;
}

/* One step of length h with γ (γ = 0: em). GK_OK, or GK_DIVERGED / GK_PENETRATION with data unchanged. */
static gk_outcome step_once(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h,
                            double gamma)
{
    GK_ASSERT(h > 0.0 && gk_finite(h));
    GK_ASSERT(gamma >= 0.0 && gamma <= 1.0);
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC && data->magic == GK_DATA_MAGIC);
    const gk_coefficients *k = gk_flow_for(model, setup, &work->room, h, gamma);
    gk_outcome outcome;
    GK_MARK(work);
    if (GK_ON(setup, elastic) && h == data->table_h && gamma == gk_limit_gamma(setup, work, data, h) &&
        !(h == work->room.table_h && gamma == work->room.table_gamma))
        gk_side_step(model, setup, &work->room, k);
    work->another = data->expressed_h != h || data->expressed_gamma != gamma;
    express(model, setup, work, data, k);
    const double damped = gk_advance_predict(model, setup, work, data, k);
    if (!passable(model, work, data)) return GK_DIVERGED;
    work->by_tables = work->room.table_h > 0.0 && h == work->room.table_h && gamma == work->room.table_gamma;
    if (work->by_tables) gk_felt_see(model, setup, work);
    GK_LAP(work, PHASE_PREDICT);
    const gk_search how = {.k = k};
    for (int e = 0; e < model->engagements; e++) {
        if (!gk_engage(model, setup, work, data, &how, e)) return GK_DIVERGED;
        if (gk_engage_overlaps(model, work, e)) return GK_PENETRATION;
        if (GK_ON(setup, friction)) gk_friction_form(model, setup, data, k, work, e);
        find_jumps(work, &work->engaged[e].system);
        gk_memory_recall(model, setup, work, data, e);
        if (GK_ON(setup, film)) gk_film_begin(setup, work, e, k->h);
        GK_LAP(work, PHASE_SYSTEM);
    }
    if (GK_ON(setup, friction)) gk_glide_ride(model, setup, data, k, work);
    if ((outcome = solve_all(model, setup, work, data, k)) != GK_OK) return outcome;
    GK_LAP(work, PHASE_SOLVE);
    data->energy.dissipated += damped;
    gk_advance_correct(model, setup, work, data, k);
    GK_LAP(work, PHASE_CORRECT);
    gk_energy_settle(model, setup, work, data);
    for (int e = 0; e < model->engagements; e++) {
        gk_memory_keep(setup, &work->engaged[e], data, e);
        if (GK_ON(setup, friction)) gk_friction_watch(setup, data, h, e);
    }
    data->expressed_h = h, data->expressed_gamma = gamma, data->steps++;
    GK_LAP(work, PHASE_REMEMBER);
    return GK_OK;
}

gk_outcome gk_step_once(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h,
                        double gamma)
{
    const gk_outcome outcome = step_once(model, setup, work, data, h, gamma);
    work->by_tables = 0;
    return outcome;
}
