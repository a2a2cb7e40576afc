/* Static equilibrium by the same contact routine as the step (docs/theory.md, 4): the potential energy of a stage at
 * rest is least. Outer unknowns are the spins, the dynamic oscillators of the ground group and the soft modes of
 * gears with several engagements, through which these meet; at given ones each engagement has its contact problem,
 * everything else being compliance: the gear groups' modes too, by κ = −1/ω². Newton on the forces that are left,
 * with the tangents of the engagements, K = diag(0, ω²) + Σ Wᵀ J⁻¹ W; islands come to rest one after the other: they
 * know nothing of each other. */
#include "base/gk_dense.h"
#include "integrate/gk_integrate.h"
#include "setup/gk_kinematics.h"

static const double MOBILITY = 1e-11; /* s²: divided by the inertia of a spin, rad/(N m): what a spin yields within an
                                         engagement's problem, so that no row of it is without compliance */
static const double LOOSE = 1e-4;     /* s²: the same of a motion that nothing holds, in the tangent. It is a stiffness
                                         there: beside a softer bearing it shortens every move … */
static const double MOST_LOOSE = 10.0; /* … and grows weaker then, up to here */
static const double SLOW = 0.5;        /* of the last move: a longer one than that has been shortened */
static const double FLOATS = 1e-11;    /* s²: of a motion that must not be moved */
static const double TRUST = 2e-4; /* m: a move is not longer, twice that after every one that need not turn round … */
static const double MOST_TRUST = 3e-3; /* … up to here */
static const double OVERSHOT = 0.1;    /* of the force along a move: what may be left where it has turned round */
static const double SEE = 3e-3;        /* m: look this far for flanks */
static const double AT_REST = 1e-15, EXACT = 1e-11; /* m; of the deepest deflection: a move that is none */
static const double ENOUGH = 1e-11,
                    ROUNDING = 2e-7; /* the same where single precision of the rows leaves it undecided */
static const double NOTHING = 1e-18; /* J: a move that gains less; ENOUGH on a contact gains 1e-14 */
enum { REST_ITERATIONS = 100, ORDINARY = 20, BACK = 60, STATIC_SWEEPS = 400 };

typedef struct rest { /* a search for rest */
    const gk_model *model;
    gk_setup setup; /* as of the model, but for joints */
    gk_work *work;
    gk_data *data;
    const gk_boundary *boundary;
    gk_coefficients k;
    gk_motions motion;      /* of the spins without deformation, no two of those that float alike in kinetic energy */
    int floats[MAX_ROTORS]; /* motions that nothing holds */
    int leader[MAX_ROTORS]; /* port that decides where a motion begins, −1: none */
    double given[MAX_SPINS], before[MAX_SPINS];
    int island;                              /* that comes to rest now */
    int unknowns;                            /* spins, lanes of the ground group, soft modes gear by gear */
    int soft[MAX_GEARS], soft_at[MAX_GEARS]; /* how many of a gear; number of the first among the unknowns */
    int32_t lane[MAX_GEARS][MAX_SOFT];
    double *force, *move; /* of them */
    double *tangent;      /* (unknowns, unknowns) */
    double trust;         /* m: how far the next move may go */
    double loose;         /* s²: LOOSE … MOST_LOOSE */
    double gain;          /* J: force along the whole of the last move */
} rest;

static int searched(const rest *r, int e) { return r->setup.mesh[e].island == r->island; }

/* does a spin belong to the island that comes to rest now? */
static int moves(const rest *r, int d)
{
    for (int e = 0; e < r->model->engagements; e++)
        for (int l = 0; l < r->setup.mesh[e].spins && searched(r, e); l++)
            if (r->setup.mesh[e].spin[l] == d) return 1;
    return 0;
}

static int any_moves(const rest *r, int motion)
{
    for (int d = 0; d < r->setup.spins; d++)
        if (r->motion.turn[motion][d] != 0.0 && moves(r, d)) return 1;
    return 0;
}

/* ---- motions ----------------------------------------------------------------------------------------------------- */
static int grounded(const rest *r, int p)
{
    return r->boundary[p].kind != PORT_TORQUE && (!r->setup.chained[p] || r->setup.joint[p][JOINT_CLUTCH].live);
}

static double arm_of(const rest *r, int rotor)
{
    for (int g = 0; g < r->model->gears; g++)
        if (r->model->gear[g].rotor == rotor) return r->model->gear[g].r_b;
    return 1.0;
}

/* Σ J turn turn over the spins of two motions */
static double inertia_of(const rest *r, int a, int b)
{
    double sum = 0.0;
    for (int d = 0; d < r->setup.spins; d++)
        if (r->motion.turn[a][d] != 0.0 && r->motion.turn[b][d] != 0.0)
            sum += r->motion.turn[a][d] * r->motion.turn[b][d] / r->setup.inverse_inertia[d];
    return sum;
}

/* takes away from a motion what it has of another */
static void take_away(rest *r, int from, int other, double share)
{
    for (int d = 0; d < r->setup.spins && share != 0.0; d++)
        r->motion.turn[from][d] -= share * r->motion.turn[other][d];
}

/* a rotor whose angle is given decides one of the motions that turn it; the others leave it at rest */
static int decide(rest *r, int rotor)
{
    int first = -1;
    for (int t = 0; t < r->motion.count; t++) {
        const double turn = r->motion.turn[t][rotor];
        if (turn == 0.0 || r->leader[t] >= 0) continue;
        if (first < 0)
            first = t;
        else
            take_away(r, t, first, turn / r->motion.turn[first][rotor]);
    }
    return first;
}

/* the motions of the spins: which ones ports decide, which ones nothing holds */
static void find_motions(rest *r)
{
    const gk_model *m = r->model;
    gk_kinematics_find(m, &r->motion);
    for (int t = 0; t < r->motion.count; t++) r->floats[t] = 1, r->leader[t] = -1;
    for (int p = 0; p < m->ports; p++)
        for (int t = 0; t < r->motion.count && r->setup.chained[p]; t++)
            r->motion.turn[t][gk_disc_of(m, p)] = r->motion.turn[t][m->port[p].rotor];
    for (int p = 0; p < m->ports; p++) {
        const int motion = r->boundary[p].kind == PORT_TORQUE ? -1 : decide(r, m->port[p].rotor);
        if (motion >= 0) r->leader[motion] = p;
    }
    for (int p = 0; p < m->ports; p++)
        for (int t = 0; t < r->motion.count; t++)
            if (grounded(r, p) && r->motion.turn[t][m->port[p].rotor] != 0.0) r->floats[t] = 0;
    for (int e = 0; e < m->engagements; e++)
        for (int t = 0; t < r->motion.count && m->engagement[e].kind == MESH_FLAT; t++)
            for (int w = 0; w < 2; w++)
                if (r->motion.turn[t][m->gear[m->engagement[e].gear[w]].rotor] != 0.0) r->floats[t] = 0;
    for (int t = 0; t < r->motion.count; t++)
        for (int other = 0; other < t; other++)
            if (r->floats[t] && r->floats[other])
                take_away(r, t, other, inertia_of(r, t, other) / inertia_of(r, other, other));
}

/* how far a motion has gone where it begins: by its leader, whose rotor later motions leave at rest */
static double begins_at(const rest *r, int t)
{
    const int rotor = r->model->port[r->leader[t]].rotor;
    double phi = r->boundary[r->leader[t]].phi;
    for (int other = 0; other < r->motion.count; other++)
        if (other != t && r->leader[other] >= 0 && r->motion.turn[other][rotor] != 0.0)
            phi -= begins_at(r, other) * r->motion.turn[other][rotor];
    return phi / r->motion.turn[t][rotor];
}

/* where to begin: ports decide, the other rotors follow without load */
static void begin(rest *r)
{
    const gk_model *m = r->model;
    gk_data *data = r->data;
    memset(r->work->rest_ground, 0, (size_t)r->setup.base.n * sizeof(double));
    for (int g = 0; g < m->gears; g++)
        if (r->soft[g]) memset(r->work->rest_modes[g], 0, (size_t)r->setup.modal[g].n * sizeof(gk_real));
    for (int e = 0; e < m->engagements; e++)
        if (searched(r, e)) GK_OF(data, meshing)[e].pairs = 0;
    for (int d = 0; d < r->setup.spins; d++) {
        if (!moves(r, d)) continue;
        GK_OF(data, x)[d] = 0.0;
        for (int t = 0; t < r->motion.count; t++)
            if (r->leader[t] >= 0 && r->motion.turn[t][d] != 0.0)
                GK_OF(data, x)[d] += begins_at(r, t) * r->motion.turn[t][d];
    }
    for (int p = 0; p < m->ports; p++)
        if (r->setup.chained[p] && moves(r, gk_inertia_of(m, p)))
            GK_OF(data, x)[gk_inertia_of(m, p)] = r->boundary[p].phi;
}

/* torque on every spin by given torques and, after a first solution, by all rows */
static double torque_on(const rest *r, int d, int solved)
{
    const gk_model *m = r->model;
    double sum = r->given[d];
    for (int p = 0; p < m->ports && !solved; p++)
        if (m->port[p].rotor == d && !r->setup.chained[p]) sum += r->boundary[p].torque;
    for (int e = 0; e < m->engagements && solved; e++) {
        const gk_mesh *mesh = &r->setup.mesh[e];
        const gk_system *s = &r->work->engaged[e].system;
        for (int l = 0; l < mesh->spins; l++)
            for (int i = 0; i < s->n && mesh->spin[l] == d; i++) sum += s->rigid[l][i] * s->z[i];
    }
    return sum;
}

/* when nothing holds a motion: take the net torque along it as inertial torques of a uniform acceleration */
static void balance_rotation(rest *r, int solved)
{
    for (int t = 0; t < r->motion.count; t++) {
        const double *turn = r->motion.turn[t];
        double net = 0.0;
        if (!r->floats[t] || !any_moves(r, t)) continue;
        for (int d = 0; d < r->setup.spins; d++)
            if (turn[d] != 0.0) net += turn[d] * torque_on(r, d, solved);
        const double inertia = inertia_of(r, t, t);
        for (int d = 0; d < r->setup.spins; d++)
            if (turn[d] != 0.0) r->given[d] -= turn[d] * net / (inertia * r->setup.inverse_inertia[d]);
    }
}

/* what nothing holds stays where it is: take the motion out of the last move */
static void unroll(rest *r)
{
    for (int t = 0; t < r->motion.count; t++) {
        const double *turn = r->motion.turn[t];
        double momentum = 0.0;
        if (!r->floats[t] || !any_moves(r, t)) continue;
        for (int d = 0; d < r->setup.spins; d++)
            if (turn[d] != 0.0)
                momentum += turn[d] * (GK_OF(r->data, x)[d] - r->before[d]) / r->setup.inverse_inertia[d];
        const double inertia = inertia_of(r, t, t);
        for (int d = 0; d < r->setup.spins; d++)
            if (turn[d] != 0.0) GK_OF(r->data, x)[d] -= turn[d] * momentum / inertia;
    }
}

/* ---- one iteration ----------------------------------------------------------------------------------------------- */
/* all engagements of the island at the present spins and ground oscillators; 0: meaningless poses */
static int press(rest *r)
{
    gk_work *work = r->work;
    for (int d = 0; d < r->setup.spins; d++) {
        work->spin[d] = GK_OF(r->data, x)[d] + MOBILITY * r->setup.inverse_inertia[d] * r->given[d];
        work->speed[d] = 2.0 * work->spin[d]; /* a sticking clutch keeps its angle: velocity row with h = 1 */
    }
    for (int g = 0; g < r->model->gears; g++) work->y[g] = r->soft[g] ? work->rest_modes[g] : work->zero;
    work->ground_y = work->rest_ground;
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e)) { /* given torques move the pose, not the place */
            const gk_search how = {.k = &r->k, .spin = GK_OF(r->data, x), .reach = SEE};
            if (!gk_engage(r->model, &r->setup, work, r->data, &how, e)) return 0;
            gk_memory_recall(&r->setup, work, r->data, e, &work->engaged[e].system);
        }
    gk_coupled coupled = {r->model, &r->setup, work, &r->k, r->island, 0, STATIC_SWEEPS, 1.0};
    const gk_island island = gk_couple_island(&coupled);
    gk_balance_plain(&island);
    return 1;
}

/* the forces that are left */
static void find_forces(rest *r)
{
    const gk_base *base = &r->setup.base;
    const int spins = r->setup.spins;
    for (int d = 0; d < spins; d++) r->force[d] = r->given[d];
    for (int e = 0; e < r->model->engagements; e++) {
        const gk_mesh *mesh = &r->setup.mesh[e];
        const gk_system *s = &r->work->engaged[e].system;
        for (int l = 0; l < mesh->spins && searched(r, e); l++)
            r->force[mesh->spin[l]] += gk_dot_quads(s->rigid[l], s->z, s->stride / 4);
    }
    for (int d = 0; d < spins; d++)
        if (!moves(r, d)) r->force[d] = 0.0;
    gk_rows_scatter(r->model, &r->setup, r->work, gk_step_force, gk_step_force);
    gk_frame_load(r->model, &r->setup, r->data, r->work->ground_force);
    for (int i = 0; i < base->n; i++)
        r->force[spins + i] = r->work->ground_force[i] - base->omega2[i] * r->work->rest_ground[i];
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++) {
            const int lane = r->lane[g][i];
            const double omega = r->setup.modal[g].omega[lane];
            r->force[r->soft_at[g] + i] = (double)r->work->force[g][lane] -
                                          omega * omega * (double)r->work->rest_modes[g][lane];
        }
}

/* row of an engagement on the soft modes of a side's gear */
static double *soft_row(const rest *r, int w, int row) { return r->work->soft_rows + (w * MAX_ROWS + row) * MAX_SOFT; }

static void find_soft_rows(rest *r, int e)
{
    const gk_system *s = &r->work->engaged[e].system;
    for (int w = 0; w < 2; w++) {
        const int g = r->setup.mesh[e].side[w].gear, n = r->setup.modal[g].n;
        for (int row = 0; row < s->contacts && r->soft[g]; row++) {
            double unit[MAX_STRIDE] = {0};
            gk_real *out = r->work->trial[g];
            memset(out, 0, 2 * (size_t)n * sizeof *out);
            unit[row] = 1.0;
            gk_rows_push_modes(&r->setup, r->work, e, w, unit, unit, out, out + n);
            for (int i = 0; i < r->soft[g]; i++) soft_row(r, w, row)[i] = (double)out[r->lane[g][i]];
        }
    }
}

/* the unknowns that an engagement's rows read: spins, lanes of its part of the ground group, soft modes of both
 * gears */
static int own_unknowns(const rest *r, int e)
{
    const gk_mesh *mesh = &r->setup.mesh[e];
    return mesh->spins + mesh->local + r->soft[mesh->side[0].gear] + r->soft[mesh->side[1].gear];
}

/* Column of one of them, 0 in rows that are not active. Returns its number among all. */
static int own_unknown(const rest *r, int e, int local, double *column)
{
    const gk_mesh *mesh = &r->setup.mesh[e];
    const gk_engaged *engaged = &r->work->engaged[e];
    const gk_system *s = &engaged->system;
    const int lane = local - mesh->spins, mode = lane - mesh->local, first = r->soft[mesh->side[0].gear];
    const int w = mode >= first, width = mesh->part[0].width;
    for (int i = 0; i < s->stride; i++) column[i] = 0.0;
    for (int i = 0; i < s->n; i++) {
        if (!s->active[i]) continue;
        if (lane < 0)
            column[i] = s->rigid[local][i];
        else if (mode < 0)
            column[i] = engaged->ground[(size_t)i * mesh->local + lane];
        else if (i < s->contacts)
            column[i] = soft_row(r, w, i)[mode - w * first];
    }
    if (lane < 0) return mesh->spin[local];
    if (mode >= 0) return r->soft_at[mesh->side[w].gear] + mode - w * first;
    return r->setup.spins + (lane < width ? mesh->part[0].from + lane : mesh->part[1].from + lane - width);
}

/* adds Wᵀ J⁻¹ W of an engagement */
static void add_tangent(rest *r, int e)
{
    gk_system *s = &r->work->engaged[e].system;
    const int own = own_unknowns(r, e);
    double column[MAX_STRIDE], other[MAX_STRIDE];
    if (!s->n) return;
    gk_tangent_factorise(s);
    find_soft_rows(r, e);
    for (int a = 0; a < own; a++) {
        const int i = own_unknown(r, e, a, column);
        gk_tangent_solve(s, column);
        for (int b = 0; b <= a; b++) {
            const int j = own_unknown(r, e, b, other);
            const double k = gk_dot_quads(column, other, s->stride / 4);
            r->tangent[(size_t)i * r->unknowns + j] += k;
            if (a != b) r->tangent[(size_t)j * r->unknowns + i] += k;
        }
    }
}

static void find_tangent(rest *r)
{
    const int n = r->unknowns, spins = r->setup.spins;
    memset(r->tangent, 0, (size_t)(n * n) * sizeof *r->tangent);
    for (int d = 0; d < spins; d++) {
        const double inverse = r->setup.inverse_inertia[d];
        r->tangent[(size_t)d * n + d] = moves(r, d) && inverse > 0.0 ? 1.0 / (r->loose * inverse) : 1.0;
    }
    for (int i = 0; i < r->setup.base.n; i++)
        r->tangent[(size_t)(spins + i) * n + spins + i] = r->setup.base.omega2[i] > 0.0 ? r->setup.base.omega2[i] : 1.0;
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++) {
            const double omega = r->setup.modal[g].omega[r->lane[g][i]];
            r->tangent[(size_t)(r->soft_at[g] + i) * (size_t)(n + 1)] = omega * omega;
        }
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e)) add_tangent(r, e);
    for (int t = 0; t < r->motion.count; t++) { /* what nothing holds */
        const double *turn = r->motion.turn[t];
        if (!r->floats[t] || !any_moves(r, t)) continue;
        const double stiff = 1.0 / (FLOATS * inertia_of(r, t, t));
        for (int a = 0; a < spins; a++)
            for (int b = 0; b < spins && turn[a] != 0.0; b++)
                if (turn[b] != 0.0)
                    r->tangent[(size_t)a * n + b] += stiff * turn[a] * turn[b] /
                                                     (r->setup.inverse_inertia[a] * r->setup.inverse_inertia[b]);
    }
    for (int d = 0; d < spins; d++) { /* what stands */
        if (moves(r, d) && r->setup.inverse_inertia[d] > 0.0) continue;
        for (int i = 0; i < n; i++) r->tangent[(size_t)d * n + i] = r->tangent[(size_t)i * n + d] = i == d;
        r->force[d] = 0.0;
    }
}

/* m: the longest way of a gear or a chain's inertia in a move */
static double length_of(const rest *r, const double *move)
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

static void go(rest *r, double share)
{
    const int spins = r->setup.spins;
    for (int d = 0; d < spins; d++) GK_OF(r->data, x)[d] += share * r->move[d];
    for (int i = 0; i < r->setup.base.n; i++) r->work->rest_ground[i] += share * r->move[spins + i];
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++)
            r->work->rest_modes[g][r->lane[g][i]] += (gk_real)(share * r->move[r->soft_at[g] + i]);
}

static double along(const rest *r)
{
    double sum = 0.0;
    for (int i = 0; i < r->unknowns; i++) sum += r->force[i] * r->move[i];
    return sum;
}

static int stuck(const rest *r)
{
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e) && r->work->engaged[e].system.limit_reached) return 1;
    return 0;
}

/* Goes along a move; where the force along it turns round, back to where it is gone (regula falsi, Illinois): contacts
 * that close on the way are closed there, and the next tangent knows them. 0: meaningless poses. */
static int go_along(rest *r)
{
    const double pull = along(r);
    double from = 0.0, behind = pull, to = 1.0, at = 1.0, ahead = 0.0;
    int back = 0;
    go(r, 1.0);
    for (; back <= BACK; back++) {
        if (!press(r)) return 0;
        find_forces(r);
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
        go(r, next - at);
        at = next;
    }
    r->trust = back ? gk_max(0.5 * r->trust, TRUST) : gk_min(2.0 * r->trust, MOST_TRUST);
    if (back) r->loose = gk_max(0.1 * r->loose, LOOSE);
    return 1;
}

/* One move, the problem solved before and after it. Returns how long it would have been, NAN where there is none. */
static double relax(rest *r)
{
    memcpy(r->before, GK_OF(r->data, x), (size_t)r->setup.spins * sizeof *r->before);
    find_forces(r);
    find_tangent(r);
    memcpy(r->move, r->force, (size_t)r->unknowns * sizeof *r->move);
    if (!gk_cholesky(r->tangent, r->unknowns)) return NAN;
    gk_cholesky_solve(r->tangent, r->move, r->unknowns);
    const double length = length_of(r, r->move), least = gk_min(1.0, r->trust / gk_max(length, 1e-300));
    if (!gk_finite(length)) return NAN;
    r->gain = along(r);
    for (int i = 0; i < r->unknowns; i++) r->move[i] *= least;
    if (!go_along(r)) return NAN;
    unroll(r);
    return stuck(r) ? gk_max(length, 1.0) : length;
}

/* m: how deep teeth overlap without deformation */
static double deepest_of(const rest *r)
{
    double deepest = 0.0;
    for (int e = 0; e < r->model->engagements; e++)
        for (int p = 0; p < r->work->engaged[e].places && searched(r, e); p++)
            deepest = gk_max(deepest, -r->work->engaged[e].place[p].gap);
    return deepest;
}

/* oscillators take the static share of the forces that hold the equilibrium */
static void spread(rest *r)
{
    const gk_setup *setup = &r->setup;
    gk_work *work = r->work;
    gk_data *data = r->data;
    const int n = setup->base.n;
    double *x = gk_ground_of(data);
    data->state_h = data->state_gamma = 0.0;
    gk_rows_scatter(r->model, setup, work, gk_step_force, gk_step_force);
    memcpy(x + 2 * n, work->ground_force, (size_t)n * sizeof *x);
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
        }
    }
    memset(GK_OF(data, f), 0, (size_t)setup->spins * sizeof(double));
    memset(GK_OF(data, f_rate), 0, (size_t)setup->spins * sizeof(double));
    for (int e = 0; e < r->model->engagements; e++) {
        const gk_mesh *mesh = &setup->mesh[e];
        const gk_system *s = &work->engaged[e].system;
        for (int l = 0; l < mesh->spins; l++)
            for (int i = 0; i < s->n; i++)
                if (s->kind[i] != ROW_CLUTCH) GK_OF(data, f)[mesh->spin[l]] += s->rigid[l][i] * s->force[i];
        gk_rows_pose(r->model, setup, e, GK_OF(data, x), work->rest_ground, GK_OF(data, meshing)[e].frozen);
    }
}

/* ---- the search -------------------------------------------------------------------------------------------------- */
/* Modes of a gear with several engagements through which these feel each other: softer, with the gear's own mass,
 * than a few per cent of a contact */
static void find_soft(rest *r)
{
    const gk_base *base = &r->setup.base;
    int count = r->setup.spins + base->n;
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &r->setup.modal[g];
        const double *x = base->centre[g] + base->from[g], mobility = gk_dot_quads(x, x, base->width[g] / 4);
        const double yields = r->model->gear[g].local / r->model->gear[g].width;
        r->soft[g] = 0, r->soft_at[g] = count;
        for (int i = 0; i < m->n && r->setup.engagements_of[g] > 1 && r->soft[g] < MAX_SOFT; i++)
            if (m->omega[i] > 0.0 && mobility > yields * m->omega[i] * m->omega[i]) r->lane[g][r->soft[g]++] = i;
        count += r->soft[g];
    }
    r->unknowns = count;
}

/* κ = −1/ω² puts the dynamic modes of the gear groups into C′ too */
static void set_compliance(rest *r)
{
    r->k = r->work->explicit_rows;
    r->k.timeless = 0;
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &r->setup.modal[g];
        r->k.flow[g].exact = m->pairs;
        for (int i = 0; i < m->n; i++)
            r->k.flow[g].kappa[i] = m->omega[i] > 0.0 ? (gk_real)(-1.0 / (m->omega[i] * m->omega[i])) : 0;
        for (int i = 0; i < r->soft[g]; i++) r->k.flow[g].kappa[r->lane[g][i]] = 0;
    }
    r->k.rigid_mobility = MOBILITY;
}

static void clear_compliance(rest *r)
{
    for (int g = 0; g < r->model->gears; g++)
        memset(r->k.flow[g].kappa, 0, (size_t)r->setup.modal[g].n * sizeof(gk_real));
}

/* joints as the boundary wants them: no dampers; a clutch that slips at the start gives its friction torque */
static void set_joints(rest *r)
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

static int close_to_rest(const rest *r, double length)
{
    return length <= ENOUGH + ROUNDING * deepest_of(r) || r->gain < NOTHING;
}

static int search(rest *r)
{
    const int shared = r->setup.islands < r->model->engagements; /* rotors */
    double length = INFINITY;
    r->trust = TRUST, r->loose = LOOSE;
    balance_rotation(r, 0);
    if (!press(r)) return 0;
    for (int i = 0; i < REST_ITERATIONS; i++) {
        balance_rotation(r, 1);
        const double last = length;
        length = relax(r);
        if (!gk_finite(length)) return 0;
        if (length <= AT_REST + EXACT * deepest_of(r)) break;
        if (i >= ORDINARY && length > SLOW * last) r->loose = gk_min(10.0 * r->loose, MOST_LOOSE);
        if (shared && close_to_rest(r, length) && length > 0.5 * last) break; /* rounding of the rows is left */
    }
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e)) gk_memory_keep(&r->setup, &r->work->engaged[e], r->data, e);
    return close_to_rest(r, length);
}

/* Equilibrium under the given boundary: for each port a spring of stiffness k at angle phi, a held angle
 * (PORT_FIXED, k = ∞: the bore is held) or a torque. bare: the boundary acts on the bores, without the ports'
 * chains. keep: start from the present angles instead of from the unloaded mesh. */
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                           const gk_boundary *boundary, int bare, int keep)
{
    GK_ASSERT(boundary);
    GK_ASSERT(setup->magic == GK_SETUP_MAGIC);
    rest r = {.model = model, .setup = *setup, .work = work, .data = data, .boundary = boundary};
    find_soft(&r);
    r.force = work->rest, r.move = r.force + r.unknowns, r.tangent = r.move + r.unknowns;
    for (int p = 0; p < model->ports && bare; p++) {
        r.setup.chained[p] = 0;
        r.setup.joint[p][JOINT_SHAFT].live = r.setup.joint[p][JOINT_CLUTCH].live = 0;
    }
    r.setup.on.contact_damping = r.setup.on.friction = r.setup.on.film = 0;
    r.setup.on.roll_motion = 1;
    work->another = 0;
    set_joints(&r);
    set_compliance(&r);
    find_motions(&r);
    for (int e = 0; e < model->engagements; e++) gk_memory_forget(&work->engaged[e]);
    if (!keep) memset(GK_OF(data, x), 0, (size_t)setup->spins * sizeof(double));
    int found = 1;
    for (r.island = 0; r.island < r.setup.islands && found; r.island++) {
        if (!keep) begin(&r);
        found = search(&r);
    }
    clear_compliance(&r);
    if (!found) return GK_NO_EQUILIBRIUM;
    spread(&r);
    return GK_OK;
}
