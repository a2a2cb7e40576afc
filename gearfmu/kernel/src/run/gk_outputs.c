/* Outputs at the end of a communication step: forces, motions, energies, counters. */
#include "run/gk_run.h"

static const double OVER = 1.01;  /* of torque_max and speed_max: what rounding and ripple may take */
static const double BROKEN = 0.5; /* of all energy there is: what the balance may leave before a run is stopped */

/* ---- forces ------------------------------------------------------------------------------------------------------ */
static void mesh_outputs(const gk_engaged *engaged, gk_data *data, int e)
{
    const gk_system *s = &engaged->system;
    double side[2] = {0, 0}, *v = data->mesh[e];
    int pairs = 0;
    for (int i = 0; i < MAX_SLICES; i++) v[V_SLICE_1 + i] = 0.0;
    for (int p = 0; p < engaged->places; p++) {
        const double sense = engaged->place[p].flank ? -1.0 : 1.0;
        int touches = 0;
        for (int i = p * s->strips; i < (p + 1) * s->strips; i++) {
            side[engaged->place[p].flank] += gk_reported(s, i);
            v[V_SLICE_1 + i % s->strips] += sense * gk_reported(s, i);
            touches |= s->force[i] > 0.0;
        }
        pairs += touches;
    }
    v[V_FORCE_DRIVE] = side[0];
    v[V_FORCE_COAST] = side[1];
    v[V_MESH_FORCE] = side[0] - side[1];
    v[V_PAIRS] = pairs;
    v[V_CONTACT] = side[0] > 0.0 ? (side[1] > 0.0 ? 2 : 1) : side[1] > 0.0 ? -1 : 0;
    v[V_IMPACTS] = (double)data->meshing[e].impacts;
    v[V_OPEN_TIME] = data->meshing[e].open_time;
}

static void joint_outputs(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data,
                          const gk_system *s)
{
    for (int i = s->contacts; i < s->n; i++) {
        const int port = s->port_of[i], rotor = model->port[port].rotor;
        const double force = gk_reported(s, i),
                     deflection = s->force[i] * setup->joint[port][s->joint_of[i]].compliance;
        double *v = data->shaft[port], *angle = &data->rotor[rotor][V_GEAR_PHI];
        switch (s->joint_of[i]) {
        case JOINT_PORT:
            if (s->kind[i] == ROW_TORQUE) {
                *angle = data->angle[port];
            } else {
                v[V_TAU] = -force;
                if (!model->port[port].chain) *angle = work->outer[port] - deflection;
            }
            break;
        case JOINT_SHAFT:
            v[V_SHAFT_TAU] = force;
            *angle = data->x[gk_disc_of(model, port)] - deflection;
            break;
        default: v[V_CLUTCH_TAU] = -0.5 * s->z[i];
        }
    }
}

/* what moves the springs of the supports, and what their dashpots see, of the dynamic oscillators */
static void support_motion(const gk_setup *setup, const gk_work *work, const gk_data *data, double *moved,
                           double *speed)
{
    const int n = setup->base.n;
    const gk_quad *x = (const gk_quad *)gk_ground_seen(data), *v = x + n / 4, *f = v + n / 4;
    const gk_quad *kappa = (const gk_quad *)gk_flow_known(work, data->state_h, data->state_gamma)->ground.kappa;
    for (int q = 0; q < n / 4; q++) {
        ((gk_quad *)moved)[q] = x[q] - kappa[q] * f[q];
        ((gk_quad *)speed)[q] = v[q];
    }
}

/* forces on the supports by such motion (or its integral) */
static void forces_by_motion(const gk_model *model, const gk_setup *setup, const double *moved, const double *speed,
                             double *out)
{
    const gk_base *base = &setup->base;
    for (int s = 0; s < model->supports; s++) {
        out[s] = gk_dot_span(base->support_span[s], base->support_rows + s * base->n, moved);
        if (s < model->dampers)
            out[s] += model->ground[base->set].damper[s] *
                      gk_dot_span(base->damper_span[s], base->damper_rows + s * base->n, speed);
    }
}

/* adds the forces on the supports that contacts, joints and turning axes make directly, beside the oscillators */
static void add_direct_forces(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                              double *out)
{
    for (int e = 0; e < model->engagements; e++) {
        const gk_engaged *engaged = &work->engaged[e];
        const gk_system *system = &engaged->system;
        double force[MAX_ROWS];
        for (int i = 0; i < system->n; i++) force[i] = gk_reported(system, i);
        for (int w = 0; w < 2; w++) {
            const gk_side *side = &setup->mesh[e].side[w];
            const gk_position *at = &engaged->position[w];
            const size_t width = (size_t)side->held.width, next = (size_t)(side->candidates * setup->strips) * width;
            const double *node = side->support + (size_t)at->node * next, high = at->part, low = 1.0 - high;
            for (size_t s = 0; s < width; s++) {
                double sum = 0.0;
                for (int p = 0, i = 0; p < engaged->places; p++) {
                    const double *table = node + (size_t)(engaged->place[p].candidate[w] * setup->strips) * width + s;
                    for (int strip = 0; strip < setup->strips; strip++, i++, table += width)
                        sum += force[i] * (low * table[0] + high * table[next]);
                }
                out[(size_t)side->held.from + s] -= sum;
            }
        }
        for (int i = system->contacts; i < system->n; i++)
            if (gk_rows_at_bore(setup, system, i))
                for (int s = 0; s < model->supports; s++)
                    out[s] += force[i] * setup->port_support[system->port_of[i]][s];
    }
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        for (int i = 0; i < model->supports; i++)
            out[i] += data->v[r] * data->v[r] * setup->base.outward_support[r * model->supports + i];
}

/* forces on the supports at the end of the step */
static void support_forces(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                           double *out)
{
    double moved[MAX_GROUND + 4 * MAX_ROTORS], speed[MAX_GROUND + 4 * MAX_ROTORS];
    support_motion(setup, work, data, moved, speed);
    forces_by_motion(model, setup, moved, speed, out);
    add_direct_forces(model, setup, work, data, out);
}

/* forces on the ground that are kept in the axes of a carrier, turned into those of the ground (sense 1), or back
 * (−1) */
static void turn_supports(const gk_model *model, const gk_data *data, double sense, double *force)
{
    for (int s = 0; model->support_turn && s < model->supports; s++) {
        const int turn = model->support_turn[s];
        double sine, cosine;
        if (turn < 0 || turn % 2) continue;
        gk_sincos(sense * data->x[turn / 2], &sine, &cosine);
        const double x = force[s], y = force[s + 1];
        force[s] = cosine * x - sine * y, force[s + 1] = sine * x + cosine * y;
    }
}

static void support_outputs(const gk_model *model, const gk_setup *setup, gk_data *data, const double *force)
{
    for (int s = 0; s < model->supports; s++) {
        data->support[s][V_FORCE] = force[s];
        data->support[s][V_MOVED] = force[s] * model->ground[setup->base.set].support_compliance[s];
    }
}

/* ---- motion ------------------------------------------------------------------------------------------------------ */
/* speed of the bore's node: spin and dynamic oscillators */
static double bore_speed(const gk_model *model, const gk_setup *setup, const gk_data *data, int p)
{
    const int n = setup->base.n;
    const double *v = gk_ground_seen(data) + n;
    return data->v[model->port[p].rotor] + (n ? gk_dot_quads(v, setup->base.port_rows + p * n, n / 4) : 0.0);
}

void gk_outputs_bores(const gk_model *model, const gk_setup *setup, gk_data *data)
{
    for (int p = 0; p < model->ports; p++) data->v_bore[p] = bore_speed(model, setup, data, p);
}

static void port_outputs(const gk_model *model, const gk_setup *setup, gk_data *data, int p, double h)
{
    double *v = data->shaft[p];
    if (setup->given_torque[p]) {
        v[V_PHI] = data->angle[p];
        v[V_W] = bore_speed(model, setup, data, p);
        v[V_A] = h > 0.0 ? (v[V_W] - data->v_bore[p]) / h : 0.0;
    }
    if (!model->port[p].chain) return;
    const double inertia = data->v[gk_inertia_of(model, p)], disc = data->v[gk_disc_of(model, p)];
    v[V_CLUTCH_LOCKED] = data->locked[p];
    v[V_INERTIA_W] = inertia;
    v[V_DISC_W] = disc;
    v[V_CLUTCH_SLIP] = inertia - disc;
}

/* transmission error of an engagement, from the bores of its rotors */
static double transmission_error(const gk_model *model, const gk_data *data, int e)
{
    const gk_engagement *engagement = &model->engagement[e];
    const gk_gear *A = &model->gear[engagement->gear[0]], *B = &model->gear[engagement->gear[1]];
    const double sense = engagement->kind == MESH_INTERNAL ? -1.0 : 1.0;
    const int f = gk_frame_of(model, engagement);
    const double frame = f < 0 ? 0.0 : data->x[f];
    return A->r_b * (data->rotor[A->rotor][V_GEAR_PHI] - frame) +
           sense * B->r_b * (data->rotor[B->rotor][V_GEAR_PHI] - frame);
}

static void outputs(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double h)
{
    double *v = data->stage, force[MAX_SUPPORTS];
    int dynamic = setup->base.count;
    for (int r = 0; r < model->rotors; r++)
        data->rotor[r][V_GEAR_W] = data->v[r], data->rotor[r][V_GEAR_PHI] = data->x[r];
    for (int e = 0; e < model->engagements; e++) {
        mesh_outputs(&work->engaged[e], data, e);
        joint_outputs(model, setup, work, data, &work->engaged[e].system);
    }
    for (int p = 0; p < model->ports; p++) port_outputs(model, setup, data, p, h);
    support_forces(model, setup, work, data, force);
    turn_supports(model, data, 1.0, force);
    support_outputs(model, setup, data, force);
    for (int e = 0; e < model->engagements; e++) data->mesh[e][V_TE] = transmission_error(model, data, e);
    gk_amplitudes(model, setup, work, data);
    for (int g = 0; g < model->gears; g++) dynamic += setup->modal[g].count;
    v[V_WORK] = data->ledger.work;
    v[V_DISSIPATED] = data->ledger.dissipated;
    v[V_STEPS] = (double)data->steps;
    v[V_ROUNDS] = (double)data->rounds;
    v[V_TROUBLE] = (double)data->trouble;
    const int lowered = h > 0.0 && gk_scheme_of(setup->integrator)->corrected &&
                        gk_limit_gamma(setup, work, data, h) < 1.0;
    v[V_STATUS] = data->status | (lowered ? STATUS_GAMMA : 0);
    v[V_STEP_USED] = h;
    v[V_NDYN] = dynamic;
}

/* ---- energy ------------------------------------------------------------------------------------------------------ */
static double stored(const gk_model *model, const gk_work *work)
{
    double sum = 0.0;
    for (int e = 0; e < model->engagements; e++) sum += gk_solve_stored(&work->engaged[e].system);
    return sum;
}

/* stored energy and what the balance does not close, from the first step on; 0 when that is more than the model can
 * mean */
int gk_outputs_balance(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h, int first)
{
    double *v = data->stage;
    if (gk_scheme_of(setup->integrator)->is_explicit) { /* keeps no account of works: no balance */
        data->ledger.massless = stored(model, work);
        v[V_ENERGY] = setup->integrator == CENTRAL ? gk_central_energy(model, setup, work, data, h)
                                                   : gk_step_energy(model, setup, data, &work->explicit_rows);
        return 1;
    }
    const double energy = gk_step_energy(model, setup, data,
                                         gk_flow_for(model, setup, work, data->state_h, data->state_gamma));
    if (first) data->ledger.baseline = energy - data->ledger.work + data->ledger.dissipated;
    v[V_ENERGY] = energy;
    v[V_RESIDUAL] = energy - data->ledger.baseline - data->ledger.work + data->ledger.dissipated;
    const double there = energy + fabs(data->ledger.work) + data->ledger.dissipated;
    return gk_finite(energy) && !(fabs(v[V_RESIDUAL]) > BROKEN * there + 1e-6);
}

/* ---- over a communication step ----------------------------------------------------------------------------------- */
/* angle of gear A of an engagement in the axes that carry it */
static double carried_angle(const gk_model *model, const gk_data *data, int e)
{
    const gk_engagement *engagement = &model->engagement[e];
    const int f = gk_frame_of(model, engagement);
    return data->x[model->gear[engagement->gear[0]].rotor] - (f < 0 ? 0.0 : data->x[f]);
}

static void begin_pitch(const gk_model *model, gk_data *data, int e)
{
    data->meshing[e].pitch_angle = carried_angle(model, data, e);
    data->meshing[e].pitch_time = data->meshing[e].pitch_impulse = 0.0;
}

/* Over every tooth pitch that passes: is the mean force beyond that of torque_max, the speed beyond speed_max? */
static void watch_limits(const gk_model *model, gk_data *data, int e, double H, double impulse)
{
    const gk_engagement *engagement = &model->engagement[e];
    gk_meshing *meshing = &data->meshing[e];
    const double turned = fabs(carried_angle(model, data, e) - meshing->pitch_angle),
                 pitches = turned * model->gear[engagement->gear[0]].z / (2.0 * GK_PI);
    meshing->pitch_time += H;
    meshing->pitch_impulse += impulse;
    if (pitches < 1.0) return;
    if (fabs(meshing->pitch_impulse) > OVER * engagement->force_max * meshing->pitch_time)
        data->status |= STATUS_TORQUE;
    if (meshing->pitch_time * OVER < pitches * model->period_min) data->status |= STATUS_SPEED;
    begin_pitch(model, data, e);
}

void gk_outputs_start(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    outputs(model, setup, work, data, 0.0);
    for (int p = 0; p < model->ports; p++) {
        double *v = data->shaft[p];
        v[V_TAU_MEAN] = v[V_TAU_NEXT] = v[V_TAU];
    }
    for (int s = 0; s < model->supports; s++) data->support[s][V_FORCE_MEAN] = data->support[s][V_FORCE];
    for (int e = 0; e < model->engagements; e++) {
        double *v = data->mesh[e];
        v[V_MESH_FORCE_MEAN] = v[V_MESH_FORCE];
        v[V_FORCE_MAX] = gk_max(v[V_FORCE_DRIVE], v[V_FORCE_COAST]);
        data->meshing[e].apart = v[V_CONTACT] == 0.0;
        begin_pitch(model, data, e);
    }
    data->stage[V_ENERGY] = stored(model, work); /* elastic: at rest C′ holds all of it */
    for (int d = 0; d < setup->spins; d++) data->stage[V_ENERGY] += gk_kinetic(setup, d, data->v[d]);
}

void gk_outputs_begin(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, gk_tally *tally)
{
    const size_t size = (size_t)setup->base.n * sizeof(double);
    memset(tally, 0, offsetof(gk_tally, moved));
    memset(tally->moved, 0, size);
    memset(tally->speed, 0, size);
    if (data->state_h > 0.0) gk_flow_for(model, setup, work, data->state_h, data->state_gamma); /* a restored state */
    support_motion(setup, work, data, tally->last_moved, tally->last_speed);
    forces_by_motion(model, setup, tally->last_moved, tally->last_speed, tally->last);
    double now[MAX_SUPPORTS];
    for (int s = 0; s < model->supports; s++) now[s] = data->support[s][V_FORCE];
    turn_supports(model, data, -1.0, now);
    for (int s = 0; s < model->supports; s++) tally->last[s] = now[s] - tally->last[s];
}

static void count_mesh(const gk_engaged *engaged, gk_data *data, int e, double h, gk_tally *tally)
{
    const gk_system *s = &engaged->system;
    gk_meshing *meshing = &data->meshing[e];
    double side[2] = {0, 0};
    int touches = 0;
    for (int i = 0; i < s->contacts; i++) {
        side[engaged->place[s->place_of[i]].flank] += gk_solve_mean(s, i);
        touches |= s->force[i] > 0.0;
    }
    for (int i = s->contacts; i < s->n; i++)
        if (s->joint_of[i] == JOINT_PORT) tally->port[s->port_of[i]] -= gk_solve_mean(s, i) * h;
    tally->mesh[e] += (side[0] - side[1]) * h;
    tally->highest[e] = gk_max(tally->highest[e], gk_max(side[0], side[1]));
    if (touches) {
        meshing->impacts += meshing->apart;
        meshing->apart = 0;
    } else {
        meshing->apart = 1;
        meshing->open_time += h;
    }
}

/* trapezoid of a vector over a step: sum += ½h (last + now), last ← now */
static void integrate(double *sum, double *last, const double *now, int n, double h)
{
    const double half = 0.5 * h;
    for (int q = 0; q < n / 4; q++) {
        const gk_quad x = ((const gk_quad *)now)[q];
        ((gk_quad *)sum)[q] += half * (((gk_quad *)last)[q] + x);
        ((gk_quad *)last)[q] = x;
    }
}

/* one internal step */
void gk_outputs_count(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double h,
                      gk_tally *tally)
{
    double moved[MAX_GROUND + 4 * MAX_ROTORS], speed[MAX_GROUND + 4 * MAX_ROTORS], direct[MAX_SUPPORTS];
    for (int e = 0; e < model->engagements; e++) count_mesh(&work->engaged[e], data, e, h, tally);
    support_motion(setup, work, data, moved, speed);
    integrate(tally->moved, tally->last_moved, moved, setup->base.n, h);
    integrate(tally->speed, tally->last_speed, speed, setup->base.n, h);
    memset(direct, 0, (size_t)model->supports * sizeof *direct);
    add_direct_forces(model, setup, work, data, direct);
    for (int s = 0; s < model->supports; s++) {
        tally->support[s] += 0.5 * h * (tally->last[s] + direct[s]);
        tally->last[s] = direct[s];
    }
}

void gk_outputs_end(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double H, double h,
                    const gk_tally *tally)
{
    for (int p = 0; p < model->ports; p++)
        if (!setup->given_torque[p]) data->shaft[p][V_TAU_MEAN] = tally->port[p] / H;
    double force[MAX_SUPPORTS];
    forces_by_motion(model, setup, tally->moved, tally->speed, force);
    for (int s = 0; s < model->supports; s++) force[s] = (force[s] + tally->support[s]) / H;
    turn_supports(model, data, 1.0, force);
    for (int s = 0; s < model->supports; s++) data->support[s][V_FORCE_MEAN] = force[s];
    for (int e = 0; e < model->engagements; e++) {
        data->mesh[e][V_MESH_FORCE_MEAN] = tally->mesh[e] / H;
        data->mesh[e][V_FORCE_MAX] = tally->highest[e];
        watch_limits(model, data, e, H, tally->mesh[e]);
    }
    outputs(model, setup, work, data, h);
    for (int p = 0; p < model->ports; p++) {
        double *v = data->shaft[p];
        v[V_TAU_NEXT] = 2.0 * v[V_TAU] - v[V_TAU_MEAN];
    }
}
