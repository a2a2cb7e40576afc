/* Static equilibrium by the same contact routine as the step (docs/theory.md, 4): proximal points. Every spin may move by
 * mobility × torque (an implicit "step" of a viscous body), everything else is compliance: the dynamic oscillators too, by
 * κ = −1/ω². Repeated until nothing moves. The mobility is large against all compliances, so a few iterations suffice;
 * each is a monotone complementarity problem. Islands come to rest one after the other: they know nothing of each other. */
#include "integrate/gk_integrate.h"

static const double MOBILITY = 1e-4; /* s²: divided by the inertia of a spin, rad/(N m) */
static const double SEE = 3e-3;      /* m: look this far for flanks */
static const double AT_REST = 1e-11; /* m: movement at MOBILITY that counts as none: some 1e-8 N are left … */
static const double ROUNDING =
    2e-7; /* … and what single precision of the rows leaves undecided of the deepest deflection */
enum { REST_ITERATIONS = 150 };

typedef struct rest { /* a search for rest */
    const gk_model *model;
    gk_setup setup; /* as of the model, but for joints */
    gk_work *work;
    gk_data *data;
    const gk_boundary *boundary;
    gk_coefficients k;
    double turn[MAX_SPINS]; /* speed of a spin per unit speed of the train, without deformation */
    int train[MAX_SPINS], trains,
        floats[MAX_ROTORS]; /* which spins turn together, −1: none; trains that nothing holds */
    double given[MAX_SPINS], before[MAX_SPINS];
    int island;     /* that comes to rest now */
    int32_t status; /* of the run before that */
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

static int train_moves(const rest *r, int train)
{
    for (int d = 0; d < r->setup.spins; d++)
        if (r->train[d] == train && moves(r, d)) return 1;
    return 0;
}

/* ---- trains ------------------------------------------------------------------------------------------------------- */
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

/* which rotors turn together, and how fast */
static void find_trains(rest *r)
{
    const gk_model *m = r->model;
    for (int d = 0; d < r->setup.spins; d++) r->train[d] = -1, r->turn[d] = 0.0;
    for (int root = 0; root < m->rotors; root++) {
        if (r->train[root] >= 0) continue;
        r->train[root] = r->trains, r->turn[root] = 1.0;
        for (int changed = 1; changed;) {
            changed = 0;
            for (int e = 0; e < m->engagements; e++) {
                const gk_gear *gear[2] = {&m->gear[m->engagement[e].gear[0]], &m->gear[m->engagement[e].gear[1]]};
                if (m->engagement[e].kind == MESH_FLAT) continue;
                for (int w = 0; w < 2; w++) {
                    const int from = gear[w]->rotor, to = gear[1 - w]->rotor;
                    if (r->train[from] != r->trains || r->train[to] >= 0) continue;
                    r->train[to] = r->trains, changed = 1;
                    r->turn[to] = -m->engagement[e].kind * r->turn[from] * gear[w]->r_b / gear[1 - w]->r_b;
                }
            }
        }
        r->trains++;
    }
    for (int t = 0; t < r->trains; t++) r->floats[t] = 1;
    for (int p = 0; p < m->ports; p++) {
        const int train = r->train[m->port[p].rotor];
        if (grounded(r, p)) r->floats[train] = 0;
        if (r->setup.chained[p])
            r->train[gk_disc_of(m, p)] = train, r->turn[gk_disc_of(m, p)] = r->turn[m->port[p].rotor];
    }
    for (int e = 0; e < m->engagements; e++)
        if (m->engagement[e].kind == MESH_FLAT)
            for (int w = 0; w < 2; w++) r->floats[r->train[m->gear[m->engagement[e].gear[w]].rotor]] = 0;
}

/* where to begin: a grounded port decides, the others of its train follow without load */
static void begin(rest *r)
{
    const gk_model *m = r->model;
    gk_data *data = r->data;
    double at[MAX_ROTORS] = {0};
    int known[MAX_ROTORS] = {0};
    memset(r->work->rest_ground, 0, (size_t)r->setup.base.n * sizeof(double));
    for (int e = 0; e < m->engagements; e++)
        if (searched(r, e)) data->meshing[e].pairs = 0;
    for (int p = 0; p < m->ports; p++) {
        const int rotor = m->port[p].rotor, train = r->train[rotor];
        if (r->boundary[p].kind == PORT_TORQUE || known[train]) continue;
        known[train] = 1, at[train] = r->boundary[p].phi / r->turn[rotor];
    }
    for (int d = 0; d < r->setup.spins; d++)
        if (moves(r, d)) data->x[d] = r->train[d] >= 0 ? at[r->train[d]] * r->turn[d] : 0.0;
    for (int p = 0; p < m->ports; p++)
        if (r->setup.chained[p] && moves(r, gk_inertia_of(m, p))) data->x[gk_inertia_of(m, p)] = r->boundary[p].phi;
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

/* when nothing holds the rotation of a train: take the net torque along it as inertial torques of a uniform acceleration */
static void balance_rotation(rest *r, int solved)
{
    for (int t = 0; t < r->trains; t++) {
        double net = 0.0, inertia = 0.0;
        if (!r->floats[t] || !train_moves(r, t)) continue;
        for (int d = 0; d < r->setup.spins; d++) {
            if (r->train[d] != t) continue;
            net += r->turn[d] * torque_on(r, d, solved);
            inertia += r->turn[d] * r->turn[d] / r->setup.inverse_inertia[d];
        }
        for (int d = 0; d < r->setup.spins; d++)
            if (r->train[d] == t) r->given[d] -= r->turn[d] * net / (inertia * r->setup.inverse_inertia[d]);
    }
}

/* a train that nothing holds stays where it is: take its common rotation out of the last move */
static void unroll(rest *r)
{
    for (int t = 0; t < r->trains; t++) {
        double momentum = 0.0, inertia = 0.0;
        if (!r->floats[t] || !train_moves(r, t)) continue;
        for (int d = 0; d < r->setup.spins; d++) {
            if (r->train[d] != t) continue;
            momentum += r->turn[d] * (r->data->x[d] - r->before[d]) / r->setup.inverse_inertia[d];
            inertia += r->turn[d] * r->turn[d] / r->setup.inverse_inertia[d];
        }
        for (int d = 0; d < r->setup.spins; d++)
            if (r->train[d] == t) r->data->x[d] -= r->turn[d] * momentum / inertia;
    }
}

/* ---- one iteration -------------------------------------------------------------------------------------------------- */
static int form(rest *r, int e)
{
    gk_work *work = r->work;
    gk_engaged *engaged = &work->engaged[e];
    double here[POSE], spun[POSE], moved[POSE];
    gk_rows_pose(r->model, &r->setup, e, work->spin, work->ground_zero, spun);
    gk_rows_pose(r->model, &r->setup, e, work->spin, work->rest_ground, engaged->pose);
    gk_rows_pose(r->model, &r->setup, e, r->data->x, work->rest_ground, here);
    for (int d = 0; d < POSE;
         d++) /* given torques move the pose, not the place; rigid motion by the oscillators is part of
                                      the compliance */
        moved[d] = spun[d] - here[d];
    engaged->places = gk_flank_find(r->model, &r->setup, &r->setup.mesh[e], here, SEE, engaged->position,
                                    engaged->place);
    if (engaged->places < 0) return engaged->places = 0;
    for (int p = 0; p < engaged->places; p++) {
        gk_place *place = &engaged->place[p];
        gk_flank_move(&r->setup, place, moved);
        place->memory = gk_step_remembered(&r->data->meshing[e], place->key);
    }
    gk_rows_form(&r->setup, work, e);
    gk_form_system(r->model, &r->setup, r->data, &r->k, work, e);
    gk_step_recall(&r->setup, work, r->data, e, &engaged->system);
    return 1;
}

/* the dynamic ground oscillators under the forces of the rows: returns how far their gears move by it */
static double settle_ground(rest *r)
{
    const gk_base *base = &r->setup.base;
    gk_work *work = r->work;
    double moved = 0.0, change[MAX_GROUND + 4];
    gk_rows_scatter(r->model, &r->setup, work, gk_step_force, gk_step_force);
    for (int i = 0; i < base->n; i++) {
        const double x = base->omega2[i] > 0.0 ? work->ground_force[i] / base->omega2[i] : 0.0;
        change[i] = x - work->rest_ground[i];
        work->rest_ground[i] = x;
    }
    for (int g = 0; g < r->model->gears && base->n; g++)
        for (int c = 0; c < 2; c++)
            moved = gk_max(moved, fabs(gk_dot_quads(base->centre[g] + c * base->n, change, base->n / 4)));
    return moved;
}

static double relax(rest *r)
{
    gk_work *work = r->work;
    const double mobility = r->k.rigid_mobility;
    double z[MAX_SPINS] = {0};
    int stuck = 0;
    for (int d = 0; d < r->setup.spins; d++) {
        work->spin[d] = r->data->x[d] + mobility * r->setup.inverse_inertia[d] * r->given[d];
        work->speed[d] = 2.0 * work->spin[d]; /* a sticking clutch keeps its angle: velocity row with h = 1 */
    }
    for (int g = 0; g < r->model->gears; g++) work->y[g] = work->zero;
    work->ground_y = work->ground_zero;
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e) && !form(r, e)) return NAN;
    gk_coupled coupled = {r->model, &r->setup, work, &r->k, r->island};
    const gk_island island = gk_couple_island(&coupled);
    gk_balance_plain(&island);
    for (int e = 0; e < r->model->engagements; e++) {
        if (!searched(r, e)) continue;
        const gk_mesh *mesh = &r->setup.mesh[e];
        const gk_system *s = &work->engaged[e].system;
        stuck |= s->limit_reached;
        for (int l = 0; l < mesh->spins; l++)
            for (int i = 0; i < s->n; i++) z[mesh->spin[l]] += s->rigid[l][i] * s->z[i];
    }
    double moved = settle_ground(r);
    memcpy(r->before, r->data->x, sizeof r->before);
    for (int d = 0; d < r->setup.spins; d++) {
        if (!moves(r, d)) continue;
        r->data->x[d] = work->spin[d] + mobility * r->setup.inverse_inertia[d] * z[d];
        if (!gk_finite(r->data->x[d])) return NAN;
    }
    unroll(r);
    for (int d = 0; d < r->setup.spins; d++)
        moved = gk_max(moved, fabs(r->data->x[d] - r->before[d]) * arm_of(r, d < r->model->rotors ? d : 0));
    r->data->status = r->status; /* what an iteration on the way saw is not what is at rest */
    for (int e = 0; e < r->model->engagements; e++)
        if (searched(r, e)) gk_step_remember(&r->setup, &work->engaged[e], r->data, e);
    return stuck ? gk_max(moved, 1.0) : moved;
}

/* movement at MOBILITY below which the solution cannot be told from rest */
static double rest_limit(const rest *r)
{
    double deepest = 0.0;
    for (int e = 0; e < r->model->engagements; e++)
        for (int p = 0; p < r->work->engaged[e].places && searched(r, e); p++)
            deepest = gk_max(deepest, -r->work->engaged[e].place[p].gap);
    return AT_REST + ROUNDING * deepest;
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
    for (int i = 0; i < n; i++) {
        x[i] = setup->base.omega2[i] > 0.0 ? work->ground_force[i] / setup->base.omega2[i] : 0.0;
        x[n + i] = 0.0;
        x[2 * n + i] = work->ground_force[i];
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
    memset(data->f, 0, sizeof data->f);
    memset(data->f_rate, 0, sizeof data->f_rate);
    for (int e = 0; e < r->model->engagements; e++) {
        const gk_mesh *mesh = &setup->mesh[e];
        const gk_system *s = &work->engaged[e].system;
        for (int l = 0; l < mesh->spins; l++)
            for (int i = 0; i < s->n; i++)
                if (s->kind[i] != ROW_CLUTCH) data->f[mesh->spin[l]] += s->rigid[l][i] * s->force[i];
        gk_rows_pose(r->model, setup, e, data->x, work->rest_ground, data->meshing[e].still);
    }
}

/* ---- the search -------------------------------------------------------------------------------------------------------- */
/* κ = −1/ω² puts the dynamic oscillators into C′ too */
static void set_compliance(rest *r)
{
    r->k = r->work->explicit_rows;
    r->k.timeless = 0;
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &r->setup.modal[g];
        r->k.flow[g].exact = m->pairs;
        for (int i = 0; i < m->n; i++)
            r->k.flow[g].kappa[i] = m->omega[i] > 0.0 ? (gk_real)(-1.0 / (m->omega[i] * m->omega[i])) : 0;
    }
    for (int i = 0; i < r->setup.base.n; i++)
        r->k.ground.kappa[i] = r->setup.base.omega2[i] > 0.0 ? -1.0 / r->setup.base.omega2[i] : 0.0;
}

static void clear_compliance(rest *r)
{
    for (int g = 0; g < r->model->gears; g++)
        memset(r->k.flow[g].kappa, 0, (size_t)r->setup.modal[g].n * sizeof(gk_real));
    memset(r->k.ground.kappa, 0, (size_t)r->setup.base.n * sizeof(double));
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
        if (!r->setup.chained[p] || r->data->locked[p]) continue;
        const int inertia = gk_inertia_of(r->model, p), disc = gk_disc_of(r->model, p);
        const double slip = r->data->v[inertia] - r->data->v[disc];
        const double friction = r->data->shaft[p][V_CAPACITY] * (slip > 0.0 ? 1.0 : slip < 0.0 ? -1.0 : 0.0);
        r->setup.joint[p][JOINT_CLUTCH].live = 0;
        r->given[inertia] = -friction;
        r->given[disc] = friction;
    }
}

static int search(rest *r)
{
    int solved = 0;
    balance_rotation(r, solved);
    /* where the linearised gaps lead in circles, once more with smaller moves */
    for (double mobility = MOBILITY; mobility > 1e-4 * MOBILITY; mobility *= 0.01) {
        double moved = INFINITY;
        r->k.rigid_mobility = mobility;
        for (int i = 0; i < REST_ITERATIONS && moved > 1e-14; i++) {
            moved = relax(r);
            if (!gk_finite(moved)) return 0;
            balance_rotation(r, solved = 1);
        }
        if (moved * (MOBILITY / mobility) <= rest_limit(r)) return 1;
        if (moved * (MOBILITY / mobility) > SEE) begin(r); /* out of sight of all flanks: from the start again */
    }
    return 0;
}

/* Equilibrium under the given boundary: for each port a spring of stiffness k at angle phi, a held angle (PORT_FIXED, k =
 * ∞: the bore is held) or a torque. bare: the boundary acts on the bores, without the ports' chains. keep: start from the
 * present angles instead of from the unloaded mesh. */
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                           const gk_boundary *boundary, int bare, int keep)
{
    rest r = {.model = model, .setup = *setup, .work = work, .data = data, .boundary = boundary};
    for (int p = 0; p < model->ports && bare; p++) {
        r.setup.chained[p] = 0;
        r.setup.joint[p][JOINT_SHAFT].live = r.setup.joint[p][JOINT_CLUTCH].live = 0;
    }
    r.setup.on.contact_damping = 0;
    r.setup.on.roll_motion = 1;
    work->another = 0;
    set_joints(&r);
    set_compliance(&r);
    find_trains(&r);
    for (int e = 0; e < model->engagements; e++) gk_step_forget(&work->engaged[e]);
    if (!keep) memset(data->x, 0, sizeof data->x);
    int found = 1;
    for (r.island = 0; r.island < r.setup.islands && found; r.island++) {
        if (!keep) begin(&r);
        r.status = data->status;
        found = search(&r);
    }
    clear_compliance(&r);
    if (!found) return GK_NO_EQUILIBRIUM;
    spread(&r);
    return GK_OK;
}

/* angle of the first port's bore under its torque: what the rows move it by comes on top of the spin */
static double driven_angle(const gk_model *model, const gk_work *work)
{
    double angle = 0.0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = s->contacts; i < s->n; i++)
            if (s->port_of[i] == 0 && s->joint_of[i] == JOINT_PORT)
                angle = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
    }
    return angle;
}

/* Quasi-static transmission (eq. 13): torque on the bore of the first port, the bore of the second held at phi_out, other
 * ports free; what chains the ports have is left out. out: te (m) of engagement e, angle (rad) of the first port's bore,
 * then for every tooth pair of e {flank, tooth of gear A, force of each slice}; room for 2 + MAX_PAIRS·(2 + MAX_SLICES)
 * numbers. `keep` continues from the last call. */
gk_outcome gk_te(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double phi_out,
                 double torque, int e, int keep, double *out, int *places)
{
    gk_boundary b[MAX_PORTS] = {{PORT_TORQUE, torque, 0.0, 0.0}, {PORT_FIXED, 0.0, phi_out, 0.0}};
    double angle[MAX_ROTORS];
    if (model->ports < 2 || e < 0 || e >= model->engagements) return GK_BAD_CALL;
    for (int p = 2; p < model->ports; p++) b[p] = (gk_boundary){PORT_TORQUE, 0.0, 0.0, 0.0};
    gk_outcome outcome = gk_static_solve(model, setup, work, data, b, 1, keep);
    if (outcome) return outcome;
    for (int r = 0; r < model->rotors; r++) angle[r] = data->x[r];
    angle[model->port[0].rotor] = driven_angle(model, work);
    angle[model->port[1].rotor] = phi_out;
    const gk_engagement *mesh = &model->engagement[e];
    const gk_gear *A = &model->gear[mesh->gear[0]], *B = &model->gear[mesh->gear[1]];
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    *out++ = A->r_b * angle[A->rotor] + mesh->kind * B->r_b * angle[B->rotor];
    *out++ = angle[model->port[0].rotor];
    *places = engaged->places;
    for (int p = 0; p < *places; p++, out += 2 + setup->slices) {
        out[0] = engaged->place[p].key.flank;
        out[1] = engaged->place[p].key.tooth;
        for (int i = 0; i < setup->slices; i++) {
            const int strip = i < s->strips ? i : setup->slices - 1 - i;
            out[2 + i] = s->force[p * s->strips + strip] * mesh->width /
                         (setup->slices * setup->mesh[e].strip_width[strip]);
        }
    }
    return GK_OK;
}
