/* Motions of a stage at rest: how its spins turn together without deformation (gk_kinematics.c). Ports decide where
 * some of them begin; others nothing holds: their net torque is taken as that of a uniform acceleration, and they stay
 * where they are. */
#include "integrate/gk_motions.h"

static const double FLOATS = 1e-11; /* s²: what a motion that must not be moved yields in the tangent */

static int any_moves(const gk_equilibrium *r, int motion)
{
    for (int d = 0; d < r->setup.spins; d++)
        if (r->motion.turn[motion][d] != 0.0 && gk_equilibrium_moves(r, d)) return 1;
    return 0;
}

static int grounded(const gk_equilibrium *r, int p)
{
    return r->boundary[p].kind != PORT_TORQUE && (!r->setup.chained[p] || r->setup.joint[p][JOINT_CLUTCH].live);
}

/* Σ J turn turn over the spins of two motions */
static double inertia_of(const gk_equilibrium *r, int a, int b)
{
    double sum = 0.0;
    for (int d = 0; d < r->setup.spins; d++)
        if (r->motion.turn[a][d] != 0.0 && r->motion.turn[b][d] != 0.0)
            sum += r->motion.turn[a][d] * r->motion.turn[b][d] / r->setup.inverse_inertia[d];
    return sum;
}

/* takes away from a motion what it has of another */
static void take_away(gk_equilibrium *r, int from, int other, double share)
{
    for (int d = 0; d < r->setup.spins && share != 0.0; d++)
        r->motion.turn[from][d] -= share * r->motion.turn[other][d];
}

/* a rotor whose angle is given decides one of the motions that turn it; the others leave it at rest */
static int decide(gk_equilibrium *r, int rotor)
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

/* Finds the motions of the spins: which ones ports decide, which ones nothing holds. */
void gk_motions_find(gk_equilibrium *r)
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
static double begins_at(const gk_equilibrium *r, int t)
{
    const int rotor = r->model->port[r->leader[t]].rotor;
    double phi = r->boundary[r->leader[t]].phi;
    for (int other = 0; other < r->motion.count; other++)
        if (other != t && r->leader[other] >= 0 && r->motion.turn[other][rotor] != 0.0)
            phi -= begins_at(r, other) * r->motion.turn[other][rotor];
    return phi / r->motion.turn[t][rotor];
}

/* puts the island where its search begins: ports decide, the other rotors follow without load */
void gk_motions_begin(gk_equilibrium *r)
{
    const gk_model *m = r->model;
    gk_data *data = r->data;
    memset(r->work->rest_ground, 0, (size_t)r->setup.base.n * sizeof(double));
    for (int g = 0; g < m->gears; g++)
        if (r->soft[g]) memset(r->work->rest_modes[g], 0, (size_t)r->setup.modal[g].n * sizeof(gk_real));
    for (int e = 0; e < m->engagements; e++)
        if (gk_equilibrium_has(r, e)) GK_OF(data, meshing)[e].pairs = 0;
    for (int d = 0; d < r->setup.spins; d++) {
        if (!gk_equilibrium_moves(r, d)) continue;
        GK_OF(data, x)[d] = 0.0;
        for (int t = 0; t < r->motion.count; t++)
            if (r->leader[t] >= 0 && r->motion.turn[t][d] != 0.0)
                GK_OF(data, x)[d] += begins_at(r, t) * r->motion.turn[t][d];
    }
    for (int p = 0; p < m->ports; p++)
        if (r->setup.chained[p] && gk_equilibrium_moves(r, gk_inertia_of(m, p)))
            GK_OF(data, x)[gk_inertia_of(m, p)] = r->boundary[p].phi;
}

/* torque on every spin by given torques and, after a first solution, by all rows */
static double torque_on(const gk_equilibrium *r, int d, int solved)
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

/* Takes the net torque along motions that nothing holds as inertial torques of a uniform acceleration. solved: by the
 * rows' forces, else by the ports' torques */
void gk_motions_balance(gk_equilibrium *r, int solved)
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

/* takes motions that nothing holds out of the last move: they stay where they are */
void gk_motions_unroll(gk_equilibrium *r)
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

/* holds motions that nothing else holds by a stiffness in the tangent */
void gk_motions_hold(gk_equilibrium *r)
{
    for (int t = 0; t < r->motion.count; t++) {
        const double *turn = r->motion.turn[t];
        if (!r->floats[t] || !any_moves(r, t)) continue;
        const double stiff = 1.0 / (FLOATS * inertia_of(r, t, t));
        for (int a = 0; a < r->setup.spins; a++)
            for (int b = 0; b < r->setup.spins && turn[a] != 0.0; b++)
                if (turn[b] != 0.0)
                    r->tangent[(size_t)a * r->unknowns + b] +=
                        stiff * turn[a] * turn[b] / (r->setup.inverse_inertia[a] * r->setup.inverse_inertia[b]);
    }
}
