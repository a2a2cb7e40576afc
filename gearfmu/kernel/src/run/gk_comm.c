/* Communication steps: start from equilibrium, inputs carried through the step (docs/theory.md, 5), guards around the
 * internal step, outputs at its end. */
#include "model/gk_core.h"

static const double ULP = 2.220446049250313e-16;
static const double BROKEN = 0.5; /* of all energy there is: what the balance may leave before a run is stopped */
enum { HALVINGS = 3 };

double gk_time(const gk_data *data) { return data->time_base + (double)data->count * data->step_H; }

static gk_motion motion_in(const gk_data *data, int g)
{
    gk_motion m = {data->value[GK_OF_SHAFT(PHI_IN, g)] - data->hold[g], data->value[GK_OF_SHAFT(W_IN, g)],
                   data->value[GK_OF_SHAFT(A_IN, g)]};
    return m;
}

/* outer end of a port at τ after the start of the communication step: φ + wτ + ½aτ² plus the jump of the inputs, faded
 * out over H with continuous angle and speed */
static gk_motion carried(gk_motion m, gk_motion jump, double tau, double H)
{
    const double x = tau / H, r = 1.0 - x;
    gk_motion at = {m.phi + tau * (m.w + 0.5 * m.a * tau) + jump.phi * r * r * (1.0 + 2.0 * x) + jump.w * H * x * r * r,
                    m.w + m.a * tau - jump.phi * 6.0 * x * r / H + jump.w * r * (1.0 - 3.0 * x), m.a};
    return at;
}

/* ---- outputs
 * ----------------------------------------------------------------------------------------------------------------------------------------
 */
static double reported(const gk_system *s, int i) { return s->force[i] + 0.5 * s->eta[i]; }

static void mesh_outputs(const gk_setup *setup, gk_data *data)
{
    const gk_work *work = setup->work;
    const gk_system *s = &work->system;
    double side[2] = {0, 0};
    int pairs = 0;
    for (int p = 0; p < work->places; p++) {
        int touches = 0;
        for (int i = p * s->strips; i < (p + 1) * s->strips; i++) {
            side[work->place[p].flank] += reported(s, i);
            touches |= s->force[i] > 0.0;
        }
        pairs += touches;
    }
    double *v = data->value;
    v[V_M_FORCE_DRIVE] = side[0];
    v[V_M_FORCE_COAST] = side[1];
    v[V_M_MESH_FORCE] = side[0] - side[1];
    v[V_M_PAIRS] = pairs;
    v[V_M_CONTACT] = side[0] > 0.0 ? (side[1] > 0.0 ? 2 : 1) : side[1] > 0.0 ? -1 : 0;
}

static void shaft_outputs(const gk_model *model, const gk_setup *setup, gk_data *data)
{
    const gk_system *s = &setup->work->system;
    double *v = data->value;
    for (int i = s->contacts; i < s->n; i++) {
        const int link = s->link_of[i], g = link < PORT_0 ? link / 2 : (link - PORT_0) % 2;
        const double force = reported(s, i);
        switch (link) {
        case BEARING_0X:
        case BEARING_1X:
            v[GK_OF_SHAFT(FX, g)] = -force;
            v[GK_OF_SHAFT(GEAR_X, g)] = -s->force[i] * setup->link_c[link];
            break;
        case BEARING_0Y:
        case BEARING_1Y:
            v[GK_OF_SHAFT(FY, g)] = -force;
            v[GK_OF_SHAFT(GEAR_Y, g)] = -s->force[i] * setup->link_c[link];
            break;
        case PORT_0:
        case PORT_1:
            if (s->kind[i] == ROW_TORQUE) {
                v[GK_OF_SHAFT(GEAR_PHI, g)] = data->angle[g];
            } else {
                v[GK_OF_SHAFT(TAU, g)] = -force;
                if (!model->port[g].chain)
                    v[GK_OF_SHAFT(GEAR_PHI, g)] = setup->work->outer[g] - s->force[i] * setup->link_c[link];
            }
            break;
        case SHAFT_0:
        case SHAFT_1:
            v[GK_OF_SHAFT(SHAFT_TAU, g)] = force;
            v[GK_OF_SHAFT(GEAR_PHI, g)] = data->x[DISC_0 + g] - s->force[i] * setup->link_c[link];
            break;
        default: v[GK_OF_SHAFT(CLUTCH_TAU, g)] = -0.5 * s->z[i];
        }
    }
}

/* speed of the bore's averaging node: frame and dynamic modes */
static double bore_speed(const gk_setup *setup, const gk_data *data, int g)
{
    const int n = setup->modal[g].n;
    const gk_real *v = data->modal + (g ? 3 * setup->modal[0].n : 0) + n;
    return data->v[3 * g + 2] + (n ? gk_dot(v, setup->modal[g].bore + BORE_RZ * n, n) : 0.0);
}

static void outputs(const gk_model *model, const gk_setup *setup, gk_data *data, double h)
{
    double *v = data->value;
    mesh_outputs(setup, data);
    shaft_outputs(model, setup, data);
    for (int g = 0; g < 2; g++) {
        v[GK_OF_SHAFT(GEAR_W, g)] = data->v[3 * g + 2];
        if (setup->given_torque[g]) {
            v[GK_OF_SHAFT(PHI, g)] = data->angle[g];
            v[GK_OF_SHAFT(W, g)] = bore_speed(setup, data, g);
            v[GK_OF_SHAFT(A, g)] = h > 0.0 ? (v[GK_OF_SHAFT(W, g)] - data->v_bore[g]) / h : 0.0;
        }
        if (model->port[g].chain) {
            v[GK_OF_SHAFT(CLUTCH_LOCKED, g)] = data->locked[g];
            v[GK_OF_SHAFT(INERTIA_W, g)] = data->v[INERTIA_0 + g];
            v[GK_OF_SHAFT(DISC_W, g)] = data->v[DISC_0 + g];
            v[GK_OF_SHAFT(CLUTCH_SLIP, g)] = data->v[INERTIA_0 + g] - data->v[DISC_0 + g];
        }
    }
    v[V_M_TE] = model->gear[0].r_b * v[V_0_GEAR_PHI] + model->gear[1].r_b * v[V_1_GEAR_PHI];
    v[V_M_WORK] = data->ledger.work;
    v[V_M_DISSIPATED] = data->ledger.dissipated;
    v[V_M_IMPACTS] = (double)data->impacts;
    v[V_M_OPEN_TIME] = data->open_time;
    v[V_M_STEPS] = (double)data->steps;
    v[V_M_ROUNDS] = (double)data->rounds;
    v[V_M_TROUBLE] = (double)data->trouble;
    v[V_M_STATUS] = data->status |
                    (h > 0.0 && setup->integrator == DG4 && gk_limit_gamma(setup, data, h) < 1.0 ? 8 : 0);
    v[V_M_STEP_USED] = h;
    v[V_M_NDYN] = setup->modal[0].count + setup->modal[1].count;
}

static int is_explicit(const gk_setup *setup) { return setup->integrator == RK45 || setup->integrator == CENTRAL; }

/* stored energy and what the balance does not close, from the first step on; 0 when that is more than the model can
 * mean */
static int balance(const gk_setup *setup, gk_data *data, double h)
{
    double *v = data->value;
    if (is_explicit(setup)) { /* keeps no account of works: no balance */
        data->ledger.massless = gk_solve_stored(&setup->work->system);
        v[V_M_ENERGY] = setup->integrator == CENTRAL ? gk_central_energy(setup, data, h)
                                                     : gk_step_energy(setup, data, &setup->work->explicit_rows);
        return 1;
    }
    const double stored = gk_step_energy(setup, data, gk_flow_for(setup, data->state_h, data->state_gamma));
    if (data->steps == 1) data->ledger.baseline = stored - data->ledger.work + data->ledger.dissipated;
    v[V_M_ENERGY] = stored;
    v[V_M_RESIDUAL] = stored - data->ledger.baseline - data->ledger.work + data->ledger.dissipated;
    return gk_finite(stored) &&
           !(fabs(v[V_M_RESIDUAL]) > BROKEN * (stored + fabs(data->ledger.work) + data->ledger.dissipated) + 1e-6);
}

/* Phase profile: names and cycles since gk_prepare (zero unless built with GK_PROFILE) */
int gk_profile(const gk_setup *setup, int phase, const char **name, uint64_t *cycles)
{
    static const char *const names[PHASES] = {"predict", "find", "rows", "system", "solve", "correct", "remember"};
    if (phase < 0 || phase >= PHASES) return 0;
    *name = names[phase];
    *cycles = setup->work->cycles[phase];
    return 1;
}

/* ---- start
 * -------------------------------------------------------------------------------------------------------------------------------------------
 */
static void start_speeds(const gk_model *model, gk_data *data)
{
    const double *v = data->value;
    memset(data->v, 0, sizeof data->v);
    for (int g = 0; g < 2; g++) {
        const gk_port *port = &model->port[g];
        double w = port->kind == PORT_TORQUE   ? v[GK_OF_SHAFT(W_START, g)]
                   : port->kind == PORT_SPRING ? v[GK_OF_SHAFT(W_IN, g)]
                                               : 0.0;
        if (port->chain) {
            data->v[INERTIA_0 + g] = w;
            data->v[DISC_0 + g] = w = v[GK_OF_SHAFT(DISC_W_START, g)];
            data->locked[g] = data->v[INERTIA_0 + g] == w && v[GK_OF_SHAFT(CAPACITY, g)] > 0.0;
        }
        data->v[model->kind == KIND_FLAT ? 3 * g : 3 * g + 2] = w;
    }
}

gk_outcome gk_initialize(const gk_model *model, const gk_setup *setup, gk_data *data, double time)
{
    if (setup->magic != GK_SETUP_MAGIC || data->magic != GK_DATA_MAGIC || data->phase != PHASE_NEW) return GK_BAD_CALL;
    if (!gk_finite(time)) return GK_BAD_VALUE;
    gk_boundary b[2];
    start_speeds(model, data);
    for (int g = 0; g < 2; g++) {
        const gk_port *port = &model->port[g];
        data->hold[g] = data->value[V_M_REFERENCE] != 0.0 && port->kind == PORT_SPRING
                            ? data->value[GK_OF_SHAFT(PHI_IN, g)]
                            : 0.0;
        data->input[g] = motion_in(data, g);
        b[g].kind = port->kind == PORT_FIXED ? PORT_SPRING : port->kind;
        b[g].torque = port->kind == PORT_TORQUE ? data->value[GK_OF_SHAFT(TAU_IN, g)] : 0.0;
        b[g].phi = port->kind == PORT_SPRING ? data->input[g].phi : 0.0;
        b[g].k = port->k;
    }
    gk_outcome outcome = gk_static_solve(model, setup, data, b, 0);
    if (outcome) return outcome;
    for (int g = 0; g < 2; g++) {
        const gk_system *s = &setup->work->system;
        for (int i = s->contacts; i < s->n; i++)
            if (s->link_of[i] == PORT_0 + g && s->kind[i] == ROW_TORQUE)
                data->angle[g] = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
    }
    data->apart = 0;
    data->phase = PHASE_RUNNING;
    data->time_base = time;
    data->step_H = 0.0;
    data->count = 0;
    outputs(model, setup, data, 0.0);
    for (int g = 0; g < 2; g++) {
        data->value[GK_OF_SHAFT(TAU_MEAN, g)] = data->value[GK_OF_SHAFT(TAU_NEXT, g)] =
            data->value[GK_OF_SHAFT(TAU, g)];
        data->value[GK_OF_SHAFT(FX_MEAN, g)] = data->value[GK_OF_SHAFT(FX, g)];
        data->value[GK_OF_SHAFT(FY_MEAN, g)] = data->value[GK_OF_SHAFT(FY, g)];
    }
    data->value[V_M_FORCE_MEAN] = data->value[V_M_MESH_FORCE];
    data->value[V_M_ENERGY] = gk_solve_stored(&setup->work->system); /* elastic: at rest C′ holds all of it */
    for (int d = 0; d < RIGID; d++)
        if (setup->inverse_mass[d] > 0.0)
            data->value[V_M_ENERGY] += 0.5 * data->v[d] * data->v[d] / setup->inverse_mass[d];
    data->value[V_M_FORCE_MAX] = gk_max(data->value[V_M_FORCE_DRIVE], data->value[V_M_FORCE_COAST]);
    data->apart = data->value[V_M_CONTACT] == 0.0;
    return GK_OK;
}

/* ---- guarded internal step
 * -------------------------------------------------------------------------------------------------------------------------------
 */
typedef struct span {
    double start, H;
    gk_motion jump[2];
    double capacity[2];
} span; /* the communication step an internal step belongs to; capacities at its start */

/* inputs of the internal step from tau to tau + h: outer ends at its end, capacities in its middle */
static void ports_at(gk_data *data, gk_work *work, const span *c, const gk_model *model, double tau, double h)
{
    for (int g = 0; g < 2; g++) {
        if (model->port[g].chain)
            data->value[GK_OF_SHAFT(CAPACITY, g)] = gk_max(
                0.0, c->capacity[g] + data->value[GK_OF_SHAFT(CAPACITY_RATE, g)] * (tau + 0.5 * h));
        work->outer_before[g] = work->outer[g];
        work->outer[g] = model->port[g].kind == PORT_SPRING ? carried(data->input[g], c->jump[g], tau + h, c->H).phi
                                                            : 0.0;
        work->torque[g] = model->port[g].kind == PORT_TORQUE ? data->value[GK_OF_SHAFT(TAU_IN, g)] : 0.0;
    }
}

/* from tau to tau + h; on trouble two halves, then the conservative fallback em, then a named outcome */
static gk_outcome advance(const gk_model *model, const gk_setup *setup, gk_data *data, const span *c, double tau,
                          double h, int depth)
{
    gk_work *work = setup->work;
    const double before[2] = {work->outer[0], work->outer[1]};
    ports_at(data, work, c, model, tau, h);
    gk_outcome outcome = setup->integrator == RK45 ? gk_rk45_advance(model, setup, data, h)
                                                   : setup->step(model, setup, data, h, gk_limit_gamma(setup, data, h));
    if (outcome == GK_OK || is_explicit(setup)) return outcome;
    data->trouble++;
    work->outer[0] = before[0], work->outer[1] = before[1];
    if (depth < HALVINGS) {
        outcome = advance(model, setup, data, c, tau, 0.5 * h, depth + 1);
        return outcome ? outcome : advance(model, setup, data, c, tau + 0.5 * h, 0.5 * h, depth + 1);
    }
    data->status |= 2;
    ports_at(data, work, c, model, tau, h);
    outcome = setup->step(model, setup, data, h, 0.0);
    if (outcome) work->outer[0] = before[0], work->outer[1] = before[1];
    return outcome;
}

typedef struct tally {
    double force, port[2], bearing[4], highest;
} tally;

static void count_step(const gk_setup *setup, gk_data *data, double h, tally *t)
{
    const gk_work *work = setup->work;
    const gk_system *s = &work->system;
    double side[2] = {0, 0};
    int touches = 0;
    for (int i = 0; i < s->n; i++) {
        const double mean = gk_solve_mean(s, i);
        if (i < s->contacts) {
            side[work->place[s->place_of[i]].flank] += mean;
            touches |= s->force[i] > 0.0;
        } else if (s->link_of[i] == PORT_0 || s->link_of[i] == PORT_1) {
            t->port[s->link_of[i] - PORT_0] -= mean * h;
        } else if (s->link_of[i] <= BEARING_1Y) {
            t->bearing[s->link_of[i]] -= mean * h;
        }
    }
    t->force += (side[0] - side[1]) * h;
    t->highest = gk_max(t->highest, gk_max(side[0], side[1]));
    if (touches) {
        data->impacts += data->apart;
        data->apart = 0;
    } else {
        data->apart = 1;
        data->open_time += h;
    }
}

/* the step as it is counted: a later H that differs by rounding only is the last H again */
static gk_outcome accept_step(gk_data *data, double time, double H)
{
    if (data->magic != GK_DATA_MAGIC || data->phase != PHASE_RUNNING) return GK_BAD_CALL;
    if (!gk_finite(time) || !gk_finite(H) || !(H > 0.0) || H > 1e6) return GK_BAD_STEP;
    const double now = gk_time(data);
    if (fabs(time - now) > 1e-3 * H + 64.0 * ULP * fabs(now)) return GK_BAD_STEP;
    if (data->step_H > 0.0 && fabs(H - data->step_H) <= 8.0 * ULP * (fabs(time) + H)) return GK_OK;
    data->time_base = now;
    data->count = 0;
    data->step_H = H;
    return GK_OK;
}

gk_outcome gk_step(const gk_model *model, const gk_setup *setup, gk_data *data, double time, double wished)
{
    if (setup->magic != GK_SETUP_MAGIC) return GK_BAD_CALL;
    gk_outcome outcome = accept_step(data, time, wished);
    if (outcome) return outcome;
    gk_work *work = setup->work;
    span c = {
        gk_time(data), data->step_H, {{0, 0, 0}, {0, 0, 0}}, {data->value[V_0_CAPACITY], data->value[V_1_CAPACITY]}};
    const double count = c.H / setup->h * (1.0 - 1e-12);
    if (!(count < 1e9)) return GK_BAD_STEP;
    const int64_t steps = 1 + (int64_t)count; /* ceil, guarded against rounding of H / h */
    const double h = c.H / (double)steps;
    for (int g = 0; g < 2; g++) {
        const gk_motion next = motion_in(data, g), was = data->input[g];
        c.jump[g].phi = was.phi - next.phi;
        c.jump[g].w = was.w - next.w;
        work->outer[g] = was.phi;
        data->input[g] = next;
    }
    tally t = {0, {0, 0}, {0, 0, 0, 0}, 0};
    if (!(data->table_h > 0.0)) data->table_h = h;
    gk_limit_run(model, setup, data);
    for (int64_t i = 0; i < steps; i++) {
        if (i + 1 == steps)
            for (int g = 0; g < 2; g++) data->v_bore[g] = bore_speed(setup, data, g);
        outcome = advance(model, setup, data, &c, (double)i * h, h, 0);
        for (int g = 0; g < 2; g++) data->value[GK_OF_SHAFT(CAPACITY, g)] = c.capacity[g];
        if (outcome) { /* stands at the last good time; the outside may restore or stop */
            data->time_base = c.start + (double)i * h;
            data->count = 0;
            data->step_H = 0.0;
            return outcome;
        }
        count_step(setup, data, h, &t);
        if (data->steps == 1) balance(setup, data, h);
    }
    data->count++;
    for (int g = 0; g < 2; g++) {
        const gk_motion none = {0, 0, 0};
        data->input[g] = carried(data->input[g], none, c.H, c.H);
        if (!setup->given_torque[g]) data->value[GK_OF_SHAFT(TAU_MEAN, g)] = t.port[g] / c.H;
        data->value[GK_OF_SHAFT(FX_MEAN, g)] = t.bearing[BEARING_0X + 2 * g] / c.H;
        data->value[GK_OF_SHAFT(FY_MEAN, g)] = t.bearing[BEARING_0Y + 2 * g] / c.H;
    }
    data->value[V_M_FORCE_MEAN] = t.force / c.H;
    data->value[V_M_FORCE_MAX] = t.highest;
    outputs(model, setup, data, h);
    for (int g = 0; g < 2; g++)
        data->value[GK_OF_SHAFT(TAU_NEXT, g)] = 2.0 * data->value[GK_OF_SHAFT(TAU, g)] -
                                                data->value[GK_OF_SHAFT(TAU_MEAN, g)];
    if (balance(setup, data, h)) return GK_OK;
    data->phase = PHASE_FAILED; /* no state to go on from: only a restored one */
    data->time_base = c.start, data->count = 0, data->step_H = 0.0;
    return GK_ENERGY;
}

static int all_small(const double *v, int count)
{
    for (int i = 0; i < count; i++)
        if (!(fabs(v[i]) < 1e100)) return 0;
    return 1;
}

/* size, kind, counters and numbers of a state that comes from outside; that it belongs to this model the bearer must
 * know (the FMI face keeps the hash) */
gk_outcome gk_state_check(const gk_model *model, const gk_setup *setup, const void *bytes, size_t size)
{
    gk_data head;
    if (setup->magic != GK_SETUP_MAGIC || size != setup->state_size || size > gk_data_size(model) || size < sizeof head)
        return GK_BAD_VALUE;
    memcpy(&head, bytes, sizeof head);
    int good = head.magic == GK_DATA_MAGIC && head.phase >= PHASE_NEW && head.phase <= PHASE_FAILED &&
               head.pairs >= 0 && head.pairs <= MAX_PAIRS && head.count >= 0 && all_small(head.value, GK_VARS) &&
               all_small(head.x, RIGID) && all_small(head.v, RIGID) && all_small(head.f, RIGID) &&
               all_small(head.f_rate, RIGID) && all_small(head.still, RIGID) && all_small(head.link, LINKS) &&
               all_small(head.link_end, LINKS) && all_small(head.link_dash, LINKS) && gk_finite(head.time_base) &&
               gk_finite(head.step_H) && gk_finite(head.reach) && gk_finite(head.table_h);
    for (int p = 0; good && p < head.pairs; p++)
        good = (head.memory[p].key.flank == 0 || head.memory[p].key.flank == 1) &&
               all_small(head.memory[p].force, MAX_SLICES) && all_small(head.memory[p].gap, MAX_SLICES) &&
               all_small(head.memory[p].end, MAX_SLICES) && all_small(head.memory[p].dash, MAX_SLICES);
    return good ? GK_OK : GK_BAD_VALUE;
}
