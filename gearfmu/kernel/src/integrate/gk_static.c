/* Static equilibrium by the same contact routine as the step (docs/theory.md, 4): the potential energy of a stage at
 * rest is least. At given outer unknowns (gk_equilibrium.c) each engagement has its contact problem, everything else
 * being compliance: the gear groups' modes too, by κ = −1/ω². Newton on the forces that are left, with the tangents of
 * the engagements. Motions that nothing holds stay where they are (gk_motions.c). Islands come to rest one after the
 * other: they know nothing of each other. */
#include "base/gk_dense.h"
#include "integrate/gk_integrate.h"
#include "integrate/gk_equilibrium.h"
#include "integrate/gk_motions.h"
#include "problem/gk_exchange.h"
#include "problem/gk_rows.h"

static const double MOBILITY = 1e-11; /* s²: divided by the inertia of a spin, rad/(N m): what a spin yields within an
                                         engagement's problem, so that no row of it is without compliance */
static const double LOOSE = 1e-4;     /* s²: the same of a motion that nothing holds, in the tangent. It is a stiffness
                                         there: beside a softer bearing it shortens every move … */
static const double MOST_LOOSE = 10.0; /* … and grows weaker then, up to here */
static const double SLOW = 0.5;        /* of the last move: a longer one than that has been shortened */
static const double TRUST = 2e-4; /* m: a move is not longer, twice that after every one that need not turn round … */
static const double MOST_TRUST = 3e-3; /* … up to here */
static const double OVERSHOT = 0.1;    /* of the force along a move: what may be left where it has turned round */
static const double SEE = 3e-3;        /* m: look this far for flanks */
static const double AT_REST = 1e-15, EXACT = 1e-11; /* m; of the deepest deflection: a move that is none */
static const double ENOUGH = 1e-11,
                    ROUNDING = 2e-7; /* the same where single precision of the rows leaves it undecided */
static const double WANDERS = 8.0;   /* of both: a long search moves to and fro between two roundings of the rows */
static const double NOTHING = 1e-18; /* J: a move that gains less; ENOUGH on a contact gains 1e-14 */
enum { REST_ITERATIONS = 100, ORDINARY = 20, BACK = 60, STATIC_SWEEPS = 400 };

/* ---- one iteration ----------------------------------------------------------------------------------------------- */
/* all engagements of the island at the present spins and ground oscillators; 0: meaningless poses */
static int press(gk_equilibrium *r)
{
    gk_work *work = r->work;
    for (int d = 0; d < r->setup.spins; d++) {
        work->spin[d] = GK_OF(r->data, x)[d] + MOBILITY * r->setup.inverse_inertia[d] * r->given[d];
        work->speed[d] = 2.0 * work->spin[d]; /* a sticking clutch keeps its angle: velocity row with h = 1 */
    }
    for (int g = 0; g < r->model->gears; g++) work->y[g] = r->soft[g] ? work->rest_modes[g] : work->room.zero;
    work->ground_y = work->rest_ground;
    for (int e = 0; e < r->model->engagements; e++)
        if (gk_equilibrium_has(r, e)) { /* given torques move the pose, not the place */
            const gk_search how = {.k = &r->k, .spin = GK_OF(r->data, x), .reach = SEE};
            if (!gk_engage(r->model, &r->setup, work, r->data, &how, e)) return 0;
            gk_memory_recall(r->model, &r->setup, work, r->data, e);
        }
    gk_coupled coupled = {.model = r->model,
                          .setup = &r->setup,
                          .work = work,
                          .k = &r->k,
                          .island = r->island,
                          .sweeps = STATIC_SWEEPS,
                          .rate = 1.0};
    const gk_island island = gk_couple_island(&coupled);
    gk_balance_plain(&island);
    return 1;
}

static double arm_of(const gk_equilibrium *r, int rotor)
{
    for (int g = 0; g < r->model->gears; g++)
        if (r->model->gear[g].rotor == rotor) return r->model->gear[g].r_b;
    return 1.0;
}

/* m: the longest way of a gear or a chain's inertia in a move */
static double length_of(const gk_equilibrium *r, const double *move)
{
    const gk_base *base = &r->setup.base;
    double longest = 0.0;
    for (int d = 0; d < r->setup.spins; d++)
        longest = gk_max(longest, fabs(move[d]) * arm_of(r, d < r->model->rotors ? d : 0));
    for (int g = 0; g < r->model->gears && base->n; g++)
        for (int c = 0; c < 3; c++)
            longest = gk_max(longest,
                             fabs(gk_dot_quads(base->centre[g] + c * base->n, move + r->setup.spins, base->n / 4)));
    return longest;
}

static double along(const gk_equilibrium *r)
{
    double sum = 0.0;
    for (int i = 0; i < r->unknowns; i++) sum += r->force[i] * r->move[i];
    return sum;
}

static int stuck(const gk_equilibrium *r)
{
    for (int e = 0; e < r->model->engagements; e++)
        if (gk_equilibrium_has(r, e) && r->work->engaged[e].system.limit_reached) return 1;
    return 0;
}

/* Goes along a move; where the force along it turns round, back to where it is gone (regula falsi, Illinois): contacts
 * that close on the way are closed there, and the next tangent knows them. 0: meaningless poses. */
static int go_along(gk_equilibrium *r)
{
    const double pull = along(r);
    double from = 0.0, behind = pull, to = 1.0, at = 1.0, ahead = 0.0;
    int back = 0;
    gk_equilibrium_go(r, 1.0);
    for (; back <= BACK; back++) {
        if (!press(r)) return 0;
        gk_equilibrium_forces(r);
        const double left = along(r);
        if (fabs(left) < OVERSHOT * pull || (!back && !(left < 0.0)) || back == BACK) break;
        if (left < 0.0) {
            if (back && ahead < 0.0) behind *= 0.5;
            to = at, ahead = left;
        } else {
            ahead *= 0.5;
            from = at, behind = left;
        }
        const double chord = behind / (behind - ahead), next = from + (to - from) * (back % 3 == 2 ? 0.5 : chord);
        gk_equilibrium_go(r, next - at);
        at = next;
    }
    r->trust = back ? gk_max(0.5 * r->trust, TRUST) : gk_min(2.0 * r->trust, MOST_TRUST);
    if (back) r->loose = gk_max(0.1 * r->loose, LOOSE);
    return 1;
}

/* One move, the problem solved before and after it. Returns how long it would have been, NAN where there is none. */
static double relax(gk_equilibrium *r)
{
    memcpy(r->before, GK_OF(r->data, x), (size_t)r->setup.spins * sizeof *r->before);
    gk_equilibrium_forces(r);
    gk_equilibrium_tangent(r);
    memcpy(r->move, r->force, (size_t)r->unknowns * sizeof *r->move);
    if (!gk_cholesky(r->tangent, r->unknowns)) return NAN;
    gk_cholesky_solve(r->tangent, r->move, r->unknowns);
    const double length = length_of(r, r->move), least = gk_min(1.0, r->trust / gk_max(length, 1e-300));
    if (!gk_finite(length)) return NAN;
    r->gain = along(r);
    for (int i = 0; i < r->unknowns; i++) r->move[i] *= least;
    if (!go_along(r)) return NAN;
    gk_motions_unroll(r);
    return stuck(r) ? gk_max(length, 1.0) : length;
}

/* ---- the search -------------------------------------------------------------------------------------------------- */
/* m: how deep teeth overlap without deformation */
static double deepest_of(const gk_equilibrium *r)
{
    double deepest = 0.0;
    for (int e = 0; e < r->model->engagements; e++)
        for (int p = 0; p < r->work->engaged[e].places && gk_equilibrium_has(r, e); p++)
            deepest = gk_max(deepest, -r->work->engaged[e].place[p].gap);
    return deepest;
}

static int close_to_rest(const gk_equilibrium *r, double length, int iterations)
{
    const double enough = ENOUGH + ROUNDING * deepest_of(r);
    return length <= (iterations < ORDINARY ? enough : WANDERS * enough) || r->gain < NOTHING;
}

static int search(gk_equilibrium *r)
{
    const int shared = r->setup.islands < r->model->engagements; /* rotors */
    double length = INFINITY;
    int i = 0;
    r->trust = TRUST, r->loose = LOOSE;
    gk_motions_balance(r, 0);
    if (!press(r)) return 0;
    for (; i < REST_ITERATIONS; i++) {
        gk_motions_balance(r, 1);
        const double last = length;
        length = relax(r);
        if (!gk_finite(length)) return 0;
        if (length <= AT_REST + EXACT * deepest_of(r)) break;
        if (i >= ORDINARY && length > SLOW * last) r->loose = gk_min(10.0 * r->loose, MOST_LOOSE);
        if (shared && close_to_rest(r, length, i) && length > 0.5 * last) break; /* rounding of the rows is left */
    }
    for (int e = 0; e < r->model->engagements; e++)
        if (gk_equilibrium_has(r, e)) gk_memory_keep(&r->setup, &r->work->engaged[e], r->data, e);
    return close_to_rest(r, length, i);
}

/* κ = −1/ω² puts the dynamic modes of the gear groups into C′ too */
static void set_compliance(gk_equilibrium *r)
{
    r->k = r->work->room.explicit_rows;
    r->k.timeless = 0;
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &r->setup.modal[g];
        r->k.flow[g].yields = r->k.flow[g].softest = m->pairs;
        for (int i = 0; i < m->n; i++)
            r->k.flow[g].kappa[i] = m->omega[i] > 0.0 ? (gk_real)(-1.0 / (m->omega[i] * m->omega[i])) : 0;
        for (int i = 0; i < r->soft[g]; i++) r->k.flow[g].kappa[r->lane[g][i]] = 0;
    }
    r->k.rigid_mobility = MOBILITY;
}

static void clear_compliance(gk_equilibrium *r)
{
    for (int g = 0; g < r->model->gears; g++)
        memset(r->k.flow[g].kappa, 0, (size_t)r->setup.modal[g].n * sizeof(gk_real));
}

/* joints as the boundary wants them: no dampers; a clutch that slips at the start gives its friction torque */
static void set_joints(gk_equilibrium *r)
{
    for (int p = 0; p < r->model->ports; p++) {
        const gk_boundary *b = &r->boundary[p];
        for (int j = 0; j < JOINTS; j++) r->setup.joint[p][j].damping = 0.0;
        r->setup.given_torque[p] = b->kind == PORT_TORQUE;
        r->setup.joint[p][JOINT_PORT].compliance = b->kind == PORT_SPRING ? 1.0 / b->k : 0.0;
        r->work->outer[p] = b->phi;
        r->work->torque[p] = b->torque;
        if (!r->setup.chained[p] || GK_OF(r->data, locked)[p]) continue;
        const int inertia = gk_inertia_of(r->model, p), disc = gk_disc_of(r->model, p);
        const double slip = GK_OF(r->data, v)[inertia] - GK_OF(r->data, v)[disc];
        const double friction = GK_OF(r->data, shaft)[p][V_CAPACITY] * (slip > 0.0 ? 1.0 : slip < 0.0 ? -1.0 : 0.0);
        r->setup.joint[p][JOINT_CLUTCH].live = 0;
        r->given[inertia] = -friction;
        r->given[disc] = friction;
    }
}

/* oscillators take the static share of the forces that hold the equilibrium */
static void spread(gk_equilibrium *r)
{
    const gk_setup *setup = &r->setup;
    gk_work *work = r->work;
    gk_data *data = r->data;
    const int n = setup->base.n;
    double *x = gk_ground_of(data);
    data->state_h = data->state_gamma = 0.0;
    gk_exchange_scatter(r->model, setup, work, gk_step_force, gk_step_force);
    memcpy(x + 2 * n, work->ground_force, (size_t)n * sizeof *x);
    memset(x + 3 * n, 0, (size_t)n * sizeof *x);
    gk_frame_load(r->model, setup, data, work->ground_force);
    for (int i = 0; i < n; i++) {
        x[i] = setup->base.omega2[i] > 0.0 ? work->ground_force[i] / setup->base.omega2[i] : 0.0;
        x[n + i] = 0.0;
    }
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &setup->modal[g];
        gk_real *q = gk_modal_of(setup, data, g);
        for (int i = 0; i < m->n; i++) {
            q[i] = m->omega2[i] > 0 ? work->force[g][i] / m->omega2[i] : 0;
            q[m->n + i] = 0;
            q[2 * m->n + i] = work->force[g][i];
            q[3 * m->n + i] = 0;
        }
    }
    memset(GK_OF(data, f), 0, (size_t)setup->spins * sizeof(double));
    memset(GK_OF(data, f_rate), 0, (size_t)setup->spins * sizeof(double));
    for (int e = 0; e < r->model->engagements; e++) {
        const gk_mesh *mesh = &setup->mesh[e];
        const gk_system *s = &work->engaged[e].system;
        for (int l = 0; l < mesh->spins; l++)
            for (int i = 0; i < s->n; i++)
                if (gk_row_yields(s, i)) GK_OF(data, f)[mesh->spin[l]] += s->rigid[l][i] * s->force[i];
        gk_rows_pose(setup, work, e, GK_OF(data, x), work->rest_ground, GK_OF(data, meshing)[e].frozen);
    }
}

/* Equilibrium under the given boundary: for each port a spring of stiffness k at angle phi, a held angle
 * (PORT_FIXED, k = ∞: the bore is held) or a torque. how: 0, or a sum of STATIC_… */
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                           const gk_boundary *boundary, int how)
{
    GK_ASSERT(boundary);
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC);
    gk_equilibrium r = {.model = model, .setup = *setup, .work = work, .data = data, .boundary = boundary};
    gk_equilibrium_unknowns(&r);
    r.force = work->rest, r.move = r.force + r.unknowns, r.tangent = r.move + r.unknowns;
    for (int p = 0; p < model->ports && how & STATIC_BARE; p++) {
        r.setup.chained[p] = 0;
        r.setup.joint[p][JOINT_SHAFT].live = r.setup.joint[p][JOINT_CLUTCH].live = 0;
    }
    r.setup.on.contact_damping = r.setup.on.friction = r.setup.on.film = 0;
    r.setup.on.roll_motion = 1;
    work->another = 0;
    set_joints(&r);
    set_compliance(&r);
    gk_motions_find(&r);
    for (int e = 0; e < model->engagements; e++) gk_memory_forget(&work->engaged[e]);
    const int keep = how & STATIC_KEEP;
    if (!keep) memset(GK_OF(data, x), 0, (size_t)setup->spins * sizeof(double));
    int found = 1;
    for (r.island = 0; r.island < r.setup.islands && found; r.island++) {
        if (!keep) gk_motions_begin(&r);
        found = search(&r);
    }
    clear_compliance(&r);
    if (!found) return GK_NO_EQUILIBRIUM;
    spread(&r);
    return GK_OK;
}
