/* Communication steps: start from equilibrium, inputs carried through the step (docs/theory.md, 5), guards around the
 * internal step. */
#include "run/gk_run.h"
#include "setup/gk_kinematics.h"

static const double ULP = 2.220446049250313e-16;
static const double JUMP = 10.0;      /* rad/s: an input that begins to move faster than that was not there before */
static const double MOST_TURNS = 1e9; /* more an input cannot be given */
enum { HALVINGS = 3 };

double gk_time(const gk_data *data)
{
    GK_ASSERT(data);
    return data->time_base + (double)data->count * data->step_H;
}

static gk_motion motion_in(const gk_data *data, int p)
{
    const double *v = GK_OF(data, shaft)[p];
    return (gk_motion){v[V_PHI_IN] - GK_OF(data, hold)[p], v[V_W_IN], v[V_A_IN]};
}

/* outer end of a port at τ after the start of the communication step: φ + wτ + ½aτ² plus the jump of the inputs,
 * faded out over H with continuous angle and speed */
static gk_motion carried(gk_motion m, gk_motion jump, double tau, double H)
{
    const double x = tau / H, r = 1.0 - x;
    return (gk_motion){m.phi + tau * (m.w + 0.5 * m.a * tau) + jump.phi * r * r * (1.0 + 2.0 * x) +
                           jump.w * H * x * r * r,
                       m.w + m.a * tau - jump.phi * 6.0 * x * r / H + jump.w * r * (1.0 - 3.0 * x), m.a};
}

/* Phase profile: names and cycles since gk_prepare (zero unless built with GK_PROFILE) */
int gk_profile(const gk_work *work, int phase, const char **name, uint64_t *cycles)
{
    GK_ASSERT(work && name && cycles);
    static const char *const names[PHASES] = {"predict", "find", "rows",    "system",
                                              "solve",   "pass", "correct", "remember"};
    if (phase < 0 || phase >= PHASES) return 0;
    *name = names[phase];
    *cycles = work->cycles[phase];
    return 1;
}

/* ---- start ------------------------------------------------------------------------------------------------------- */
static double start_speed(const gk_model *model, const gk_data *data, int p)
{
    const double *v = GK_OF(data, shaft)[p];
    return model->port[p].kind == PORT_TORQUE ? v[V_W_START] : model->port[p].kind == PORT_SPRING ? v[V_W_IN] : 0.0;
}

static void start_speeds(const gk_model *model, gk_data *data)
{
    int known[MAX_ROTORS];
    for (int r = 0; r < model->rotors; r++) known[r] = model->inertia[r] == 0.0;
    memset(GK_OF(data, v), 0, (size_t)(model->rotors + 2 * model->chains) * sizeof(double));
    for (int p = 0; p < model->ports; p++) {
        const gk_port *port = &model->port[p];
        double w = start_speed(model, data, p);
        if (port->chain) {
            GK_OF(data, v)[gk_inertia_of(model, p)] = w;
            GK_OF(data, v)[gk_disc_of(model, p)] = w = GK_OF(data, shaft)[p][V_DISC_W_START];
            GK_OF(data, locked)
            [p] = GK_OF(data, v)[gk_inertia_of(model, p)] == w && GK_OF(data, shaft)[p][V_CAPACITY] > 0.0;
        }
        GK_OF(data, v)[port->rotor] = w;
        known[port->rotor] = 1;
    }
    gk_kinematics_follow(model, known, GK_OF(data, v)); /* rotors without a port */
}

static gk_outcome start(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data)
{
    gk_boundary b[MAX_PORTS];
    start_speeds(model, data);
    for (int p = 0; p < model->ports; p++) {
        const gk_port *port = &model->port[p];
        const double *v = GK_OF(data, shaft)[p];
        GK_OF(data, hold)[p] = data->stage[V_REFERENCE] != 0.0 && port->kind == PORT_SPRING ? v[V_PHI_IN] : 0.0;
        GK_OF(data, input)[p] = motion_in(data, p);
        b[p].kind = port->kind == PORT_FIXED ? PORT_SPRING : port->kind;
        b[p].torque = port->kind == PORT_TORQUE ? v[V_TAU_IN] : 0.0;
        b[p].phi = port->kind == PORT_SPRING ? GK_OF(data, input)[p].phi : 0.0;
        b[p].k = port->k;
    }
    const gk_outcome outcome = gk_static_solve(model, setup, work, data, b, 0);
    if (outcome == GK_OK) gk_rk45_angles(model, work, data);
    return outcome;
}

/* a communication step in whole internal ones, at least as short as that of the setup: ceil, guarded against rounding
 * of H / h; 0 where they are too many */
static double internal_step(const gk_setup *setup, double H, int64_t *steps)
{
    const double count = H / setup->h * (1.0 - 1e-12);
    if (!(count < 1e9)) return 0.0;
    const int64_t whole = 1 + (int64_t)count;
    if (steps) *steps = whole;
    return H / (double)whole;
}

/* Tables of the internal step that communication steps of the usual length have, so that the first one costs no more
 * than others. After a communication step of another length they are made anew. */
static void make_tables(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data)
{
    const double h = internal_step(setup, GK_USUAL_H, NULL);
    if (!GK_ON(setup, elastic) || gk_scheme_of(setup->integrator)->is_explicit) return;
    gk_limit_run(model, setup, work, data, h);
    const double gamma = gk_scheme_of(setup->integrator)->corrected ? work->run_gamma : 0.0;
    if (work->room.table_h == h && work->room.table_gamma == gamma) return;
    setup->moves(model, setup, &work->room, gk_flow_for(model, setup, &work->room, h, gamma));
}

gk_outcome gk_initialize(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double time)
{
    GK_ASSERT(model && setup && work && data);
    if (setup->magic != GK_SETUP_MAGIC || data->magic != GK_DATA_MAGIC || data->phase != PHASE_NEW) return GK_BAD_CALL;
    if (!gk_finite(time)) return GK_BAD_VALUE;
    make_tables(model, setup, work, data);
    const gk_outcome outcome = start(model, setup, work, data);
    if (outcome) return outcome;
    data->phase = PHASE_RUNNING;
    data->time_base = time;
    data->step_H = 0.0;
    data->count = 0;
    data->amplitudes = (int64_t)setup->amplitudes;
    gk_outputs_start(model, setup, work, data);
    if (gk_finite(data->stage[V_ENERGY])) return GK_OK;
    data->phase = PHASE_NEW;
    return GK_NO_EQUILIBRIUM;
}

/* ---- guarded internal step --------------------------------------------------------------------------------------- */
typedef struct span {
    double start, H;
    gk_motion jump[MAX_PORTS];
    double capacity[MAX_PORTS];
} span; /* the communication step an internal step belongs to; capacities at its start */

/* inputs of the internal step from tau to tau + h: outer ends at its end, capacities in its middle */
static void set_ports(const gk_model *model, gk_work *work, gk_data *data, const span *c, double tau, double h)
{
    for (int p = 0; p < model->ports; p++) {
        double *v = GK_OF(data, shaft)[p];
        if (model->port[p].chain) v[V_CAPACITY] = gk_max(0.0, c->capacity[p] + v[V_CAPACITY_RATE] * (tau + 0.5 * h));
        work->outer_before[p] = work->outer[p];
        work->outer[p] = model->port[p].kind == PORT_SPRING
                             ? carried(GK_OF(data, input)[p], c->jump[p], tau + h, c->H).phi
                             : 0.0;
        work->torque[p] = model->port[p].kind == PORT_TORQUE ? v[V_TAU_IN] : 0.0;
    }
}

/* from tau to tau + h; when that fails two halves, then the conservative fallback em, then a named outcome */
static gk_outcome advance(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, const span *c,
                          double tau, double h, int depth)
{
    double before[MAX_PORTS];
    memcpy(before, work->outer, sizeof before);
    set_ports(model, work, data, c, tau, h);
    gk_outcome outcome = setup->step(model, setup, work, data, h, gk_limit_gamma(setup, work, data, h));
    if (outcome == GK_OK || gk_scheme_of(setup->integrator)->is_explicit) return outcome;
    data->retried++;
    memcpy(work->outer, before, sizeof before);
    if (depth < HALVINGS) {
        outcome = advance(model, setup, work, data, c, tau, 0.5 * h, depth + 1);
        return outcome ? outcome : advance(model, setup, work, data, c, tau + 0.5 * h, 0.5 * h, depth + 1);
    }
    data->status |= STATUS_FALLBACK;
    set_ports(model, work, data, c, tau, h);
    outcome = setup->step(model, setup, work, data, h, 0.0);
    if (outcome) memcpy(work->outer, before, sizeof before);
    return outcome;
}

/* ---- communication step ------------------------------------------------------------------------------------------ */
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

/* Inputs that were not given before the start: what stood then moves at the first step, and not by its acceleration */
static int starts_late(const gk_model *model, const gk_data *data)
{
    for (int p = 0; p < model->ports; p++) {
        const gk_motion was = GK_OF(data, input)[p], next = motion_in(data, p);
        const double gained = fabs(next.w) - 2.0 * fabs(next.a) * data->step_H;
        if (model->port[p].kind == PORT_SPRING && was.w == 0.0 && gained > JUMP) return 1;
    }
    return 0;
}

/* A host may give an angle of a spring port but for whole turns: it is taken as the one nearest to where speed and
 * acceleration carried the outer end. */
static void unwrap(gk_data *data, int p)
{
    const double turns = (GK_OF(data, input)[p].phi - motion_in(data, p).phi) / (2.0 * GK_PI);
    if (fabs(turns) > 0.5 && fabs(turns) < MOST_TURNS) GK_OF(data, hold)[p] -= 2.0 * GK_PI * gk_floor(turns + 0.5);
}

/* takes the inputs over; what they jump by is faded out over the step */
static span begin(const gk_model *model, gk_work *work, gk_data *data)
{
    span c = {.start = gk_time(data), .H = data->step_H};
    for (int p = 0; p < model->ports; p++) {
        if (model->port[p].kind == PORT_SPRING) unwrap(data, p);
        const gk_motion next = motion_in(data, p), was = GK_OF(data, input)[p];
        c.jump[p] = (gk_motion){was.phi - next.phi, was.w - next.w, 0.0};
        c.capacity[p] = GK_OF(data, shaft)[p][V_CAPACITY];
        work->outer[p] = was.phi;
        GK_OF(data, input)[p] = next;
    }
    return c;
}

/* stands at the last good time; the outside may restore or stop */
static void stand_at(gk_data *data, double time)
{
    data->time_base = time;
    data->count = 0;
    data->step_H = 0.0;
}

gk_outcome gk_step(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double time,
                   double wished)
{
    GK_ASSERT(model && setup && work && data);
    if (setup->magic != GK_SETUP_MAGIC) return GK_BAD_CALL;
    gk_outcome outcome = accept_step(data, time, wished);
    if (outcome) return outcome;
    int64_t steps = 0;
    const double h = internal_step(setup, data->step_H, &steps);
    if (!steps) return GK_BAD_STEP;
    if (data->steps == 0 && starts_late(model, data)) data->status |= STATUS_JUMP;
    const span c = begin(model, work, data);
    int first = data->steps == 0; /* the balance begins after the run's first whole step */
    gk_tally tally;
    gk_tally_begin(model, setup, work, data, &tally);
    for (int e = 0; e < model->engagements; e++) work->engaged[e].kept.n = -1; /* a restored state has none */
    if (!(data->table_h > 0.0)) data->table_h = h;
    gk_limit_run(model, setup, work, data, data->table_h);
    for (int64_t i = 0; i < steps; i++) {
        if (i + 1 == steps) gk_outputs_bores(model, setup, work, data);
        outcome = advance(model, setup, work, data, &c, (double)i * h, h, 0);
        for (int p = 0; p < model->ports; p++) GK_OF(data, shaft)[p][V_CAPACITY] = c.capacity[p];
        if (outcome) {
            stand_at(data, c.start + (double)i * h);
            return outcome;
        }
        setup->count(model, setup, work, data, h, &tally);
        if (first) gk_outputs_balance(model, setup, work, data, h, 1);
        first = 0;
    }
    data->count++;
    for (int p = 0; p < model->ports; p++)
        GK_OF(data, input)[p] = carried(GK_OF(data, input)[p], (gk_motion){0, 0, 0}, c.H, c.H);
    gk_outputs_end(model, setup, work, data, c.H, h, &tally);
    if (gk_outputs_balance(model, setup, work, data, h, 0)) return GK_OK;
    data->phase = PHASE_FAILED; /* no state to go on from: only a restored one */
    stand_at(data, c.start);
    return GK_ENERGY;
}

/* ---- states from outside ----------------------------------------------------------------------------------------- */
static int all_small(const double *v, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(fabs(v[i]) < 1e100)) return 0;
    return 1;
}

static int good_meshing(const gk_meshing *m)
{
    int good = m->pairs >= 0 && m->pairs <= MAX_PAIRS && all_small(m->frozen, POSE) && gk_finite(m->search_distance) &&
               gk_finite(m->open_time) && gk_finite(m->squeezed) && gk_finite(m->energy_error) && gk_finite(m->shift) &&
               all_small(&m->pitch_angle, 1) && all_small(&m->pitch_time, 1) && all_small(&m->pitch_impulse, 1);
    for (int p = 0; good && p < m->pairs; p++)
        good = (m->memory[p].key.flank == 0 || m->memory[p].key.flank == 1) &&
               all_small(m->memory[p].force, 4 * MAX_SLICES);
    return good;
}

static int good_head(const gk_model *model, const gk_data *d)
{
    uint32_t at[ARRAYS];
    gk_data_plan(model, at);
    int good = d->magic == GK_DATA_MAGIC && !memcmp(d->at, at, sizeof at) && d->phase >= PHASE_NEW &&
               d->phase <= PHASE_FAILED && d->count >= 0 && all_small(d->stage, STAGE_VARS) &&
               gk_finite(d->time_base) && gk_finite(d->step_H) && gk_finite(d->table_h) &&
               all_small(d->tail, at[OF_locked]);
    for (int p = 0; good && p < model->ports; p++) good = GK_OF(d, locked)[p] == 0 || GK_OF(d, locked)[p] == 1;
    for (int e = 0; good && e < model->engagements; e++) good = good_meshing(&GK_OF(d, meshing)[e]);
    return good;
}

/* size, kind, counters and numbers of a state that comes from outside; that it belongs to this model the bearer must
 * know (the FMI face keeps the hash). Bytes are aligned to 8. */
gk_outcome gk_state_check(const gk_model *model, const gk_setup *setup, const void *bytes, size_t size)
{
    GK_ASSERT(model && setup && (bytes || !size));
    if (setup->magic != GK_SETUP_MAGIC || size != setup->state_size || size > gk_data_size(model) ||
        size < sizeof(gk_data) || (uintptr_t)bytes % 8)
        return GK_BAD_VALUE;
    const gk_data *data = bytes;
    return good_head(model, data) && data->amplitudes == (int64_t)setup->amplitudes ? GK_OK : GK_BAD_VALUE;
}
