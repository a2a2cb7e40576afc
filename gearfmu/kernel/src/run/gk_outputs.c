/* Outputs at the end of a communication step: forces, motions, energies, counters. */
#include "integrate/gk_energy.h"
#include "problem/gk_row.h"
#include "run/gk_run.h"
#include "run/gk_sensors.h"

static const double OVER = 1.01;  /* of torque_max and speed_max: what rounding and ripple may take */
static const double BROKEN = 0.5; /* of all energy there is: what the balance may leave before a run is stopped … */
static const double LEAK = 0.01;  /* … beside this of what passed the ports: what is left grows with that in any run */

/* ---- forces ------------------------------------------------------------------------------------------------------ */
enum { EVERY_SLICE_IS_A_VARIABLE = 1 / (V_SLICE_20 - V_SLICE_1 + 1 == MAX_SLICES) }; /* gk_variables.inc */

/* adds the force of a contact to those of the slices of the width */
static void add_slice(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int i, double force,
                      double *slice)
{
    const int strips = engaged->system.strips, e = engaged->index;
    if (setup->mesh[e].rides)
        gk_strips_spread(setup, &model->engagement[e], engaged->place[i / strips].point[i % strips].end, force, slice);
    else
        slice[i % strips] += force;
}

static void mesh_outputs(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, gk_data *data, int e)
{
    const gk_system *s = &engaged->system;
    double side[2] = {0, 0}, *v = GK_OF(data, mesh)[e];
    int pairs = 0, touched[2] = {0, 0};
    for (int i = 0; i < MAX_SLICES; i++) v[V_SLICE_1 + i] = 0.0;
    for (int p = 0; p < engaged->places; p++) {
        const double sense = engaged->place[p].flank ? -1.0 : 1.0;
        int touches = 0;
        for (int i = p * s->strips; i < (p + 1) * s->strips; i++) {
            side[engaged->place[p].flank] += gk_reported(s, i);
            add_slice(model, setup, engaged, i, sense * gk_reported(s, i), v + V_SLICE_1);
            touches |= gk_solve_touches(s, i);
        }
        pairs += touches;
        if (touches) touched[engaged->place[p].flank] = 1;
    }
    v[V_FORCE_DRIVE] = side[0];
    v[V_FORCE_COAST] = side[1];
    v[V_MESH_FORCE] = side[0] - side[1];
    v[V_PAIRS] = pairs;
    v[V_CONTACT] = side[0] > 0.0 ? (side[1] > 0.0 ? 2 : 1) : side[1] > 0.0 ? -1 : 0;
    if (gk_film_on(s)) v[V_CONTACT] = touched[0] ? (touched[1] ? 2 : 1) : touched[1] ? -1 : 0;
    v[V_FILM_LOSS] = GK_OF(data, meshing)[e].squeezed;
    v[V_IMPACTS] = (double)GK_OF(data, meshing)[e].impacts;
    v[V_OPEN_TIME] = GK_OF(data, meshing)[e].open_time;
}

/* friction on the flanks of gear A, and over the normal force of all contacts */
static void friction_outputs(const gk_engaged *engaged, gk_data *data, int e)
{
    const gk_system *s = &engaged->system;
    double force = 0.0, normal = 0.0, most = 0.0, *v = GK_OF(data, mesh)[e];
    for (int i = 0; i < s->contacts; i++) {
        force += engaged->glide->end[i];
        normal += gk_reported(s, i);
        most += engaged->glide->most[i] * gk_reported(s, i);
    }
    v[V_FRICTION_FORCE] = force;
    v[V_FRICTION_RATIO] = normal > 0.0 ? most / normal : 0.0;
    v[V_FRICTION_LOSS] = GK_OF(data, meshing)[e].rubbed;
}

static void joint_outputs(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data,
                          const gk_system *s)
{
    for (int i = s->contacts; i < s->n; i++) {
        const int port = s->joint.port[i], rotor = model->port[port].rotor;
        const double force = gk_reported(s, i);
        double *v = GK_OF(data, shaft)[port], *angle = &GK_OF(data, rotor)[rotor][V_GEAR_PHI];
        switch (s->joint.which[i]) {
        case JOINT_PORT:
            if (gk_row_is_given(s, i)) {
                *angle = GK_OF(data, angle)[port];
            } else {
                v[V_TAU] = -force;
                if (!model->port[port].chain) *angle = work->outer[port] - gk_verbs_of(s->kind[i])->twist(setup, s, i);
            }
            break;
        case JOINT_SHAFT:
            v[V_SHAFT_TAU] = force;
            *angle = GK_OF(data, x)[gk_disc_of(model, port)] - gk_verbs_of(s->kind[i])->twist(setup, s, i);
            break;
        default: v[V_CLUTCH_TAU] = -0.5 * s->z[i];
        }
    }
}

static void support_outputs(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    double force[MAX_SUPPORTS], of_spring[MAX_SUPPORTS];
    gk_supports_forces(model, setup, work, data, force, of_spring);
    gk_supports_turn(model, data, 1.0, force);
    gk_supports_turn(model, data, 1.0, of_spring);
    const gk_ground *ground = &model->ground[setup->base.set];
    for (int s = 0; s < model->supports; s++) {
        GK_OF(data, support)[s][V_FORCE] = force[s];
        GK_OF(data, support)[s][V_MOVED] = of_spring[s] * ground->support_compliance[s];
        for (int t = 0; ground->support_coupling && t < model->supports; t++)
            GK_OF(data, support)[s][V_MOVED] += of_spring[t] * ground->support_coupling[s * model->supports + t];
    }
}

/* ---- motion ------------------------------------------------------------------------------------------------------ */
/* speeds of the bores' nodes: spins and dynamic oscillators */
static void bore_speeds(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                        double *out)
{
    const int n = setup->base.n;
    double *const moved = work->tally + 4 * n, *const speed = moved + n;
    if (n) gk_supports_motion(setup, work, data, moved, speed);
    for (int p = 0; p < model->ports; p++)
        out[p] = GK_OF(data, v)[model->port[p].rotor] +
                 (n ? gk_dot_quads(speed, setup->base.port_rows + p * n, n / 4) : 0.0);
}

void gk_outputs_bores(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    GK_ASSERT(model->ports <= MAX_PORTS);
    bore_speeds(model, setup, work, data, GK_OF(data, v_bore));
}

static void port_outputs(const gk_model *model, const gk_setup *setup, gk_data *data, int p, double speed, double h)
{
    double *v = GK_OF(data, shaft)[p];
    if (setup->given_torque[p]) {
        v[V_PHI] = GK_OF(data, angle)[p];
        v[V_W] = speed;
        v[V_A] = h > 0.0 ? (v[V_W] - GK_OF(data, v_bore)[p]) / h : 0.0;
    }
    if (!model->port[p].chain) return;
    const double inertia = GK_OF(data, v)[gk_inertia_of(model, p)], disc = GK_OF(data, v)[gk_disc_of(model, p)];
    v[V_CLUTCH_LOCKED] = GK_OF(data, locked)[p];
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
    const double frame = f < 0 ? 0.0 : GK_OF(data, x)[f];
    return A->r_b * (GK_OF(data, rotor)[A->rotor][V_GEAR_PHI] - frame) +
           sense * B->r_b * (GK_OF(data, rotor)[B->rotor][V_GEAR_PHI] - frame);
}

static void outputs(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double h)
{
    double *v = data->stage, bore[MAX_PORTS];
    int dynamic = setup->base.count;
    for (int r = 0; r < model->rotors; r++)
        GK_OF(data, rotor)[r][V_GEAR_W] = GK_OF(data, v)[r], GK_OF(data, rotor)[r][V_GEAR_PHI] = GK_OF(data, x)[r];
    for (int e = 0; e < model->engagements; e++) {
        mesh_outputs(model, setup, &work->engaged[e], data, e);
        if (GK_ON(setup, friction)) friction_outputs(&work->engaged[e], data, e);
        joint_outputs(model, setup, work, data, &work->engaged[e].system);
    }
    bore_speeds(model, setup, work, data, bore);
    for (int p = 0; p < model->ports; p++) port_outputs(model, setup, data, p, bore[p], h);
    support_outputs(model, setup, work, data);
    for (int e = 0; e < model->engagements; e++) GK_OF(data, mesh)[e][V_TE] = transmission_error(model, data, e);
    gk_amplitudes(model, setup, work, data);
    for (int g = 0; g < model->gears; g++) dynamic += setup->modal[g].count;
    v[V_WORK] = data->energy.work;
    v[V_DISSIPATED] = data->energy.dissipated;
    v[V_STEPS] = (double)data->steps;
    v[V_ITERATIONS] = (double)data->iterations;
    v[V_RETRIED] = (double)data->retried;
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
    GK_ASSERT(h > 0.0);
    double *v = data->stage;
    if (gk_scheme_of(setup->integrator)->is_explicit) { /* keeps no account of works: no balance */
        data->energy.quasi_static = stored(model, work);
        v[V_ENERGY] = setup->integrator == CENTRAL ? gk_central_energy(model, setup, work, data, h)
                                                   : gk_energy_invariant(model, setup, data, &work->room.explicit_rows);
        return gk_finite(v[V_ENERGY]);
    }
    const double energy = gk_energy_invariant(model, setup, data,
                                              gk_flow_for(model, setup, &work->room, data->state_h, data->state_gamma));
    if (first) data->energy.baseline = energy - data->energy.work + data->energy.dissipated;
    v[V_ENERGY] = energy;
    v[V_RESIDUAL] = energy - data->energy.baseline - data->energy.work + data->energy.dissipated;
    const double there = energy + fabs(data->energy.work) + data->energy.dissipated;
    return gk_finite(energy) && !(fabs(v[V_RESIDUAL]) > BROKEN * there + LEAK * data->energy.through + 1e-6);
}

/* ---- over a communication step ----------------------------------------------------------------------------------- */
/* angle of gear A of an engagement in the axes that carry it */
static double carried_angle(const gk_model *model, const gk_data *data, int e)
{
    const gk_engagement *engagement = &model->engagement[e];
    const int f = gk_frame_of(model, engagement);
    return GK_OF(data, x)[model->gear[engagement->gear[0]].rotor] - (f < 0 ? 0.0 : GK_OF(data, x)[f]);
}

static void begin_pitch(const gk_model *model, gk_data *data, int e)
{
    GK_OF(data, meshing)[e].pitch_angle = carried_angle(model, data, e);
    GK_OF(data, meshing)[e].pitch_time = GK_OF(data, meshing)[e].pitch_impulse = 0.0;
}

/* Over every tooth pitch that passes: is the mean force beyond that of torque_max, the speed beyond speed_max? */
static void watch_limits(const gk_model *model, gk_data *data, int e, double H, double impulse)
{
    const gk_engagement *engagement = &model->engagement[e];
    gk_meshing *meshing = &GK_OF(data, meshing)[e];
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
    GK_ASSERT(data->phase == PHASE_RUNNING);
    outputs(model, setup, work, data, 0.0);
    for (int p = 0; p < model->ports; p++) {
        double *v = GK_OF(data, shaft)[p];
        v[V_TAU_MEAN] = v[V_TAU_NEXT] = v[V_TAU];
    }
    for (int s = 0; s < model->supports; s++) GK_OF(data, support)[s][V_FORCE_MEAN] = GK_OF(data, support)[s][V_FORCE];
    for (int e = 0; e < model->engagements; e++) {
        double *v = GK_OF(data, mesh)[e];
        v[V_MESH_FORCE_MEAN] = v[V_MESH_FORCE];
        v[V_FORCE_MAX] = gk_max(v[V_FORCE_DRIVE], v[V_FORCE_COAST]);
        GK_OF(data, meshing)[e].apart = v[V_CONTACT] == 0.0;
        begin_pitch(model, data, e);
    }
    data->stage[V_ENERGY] = stored(model, work); /* elastic: at rest C′ holds all of it */
    for (int d = 0; d < setup->spins; d++) data->stage[V_ENERGY] += gk_kinetic(setup, d, GK_OF(data, v)[d]);
}

void gk_outputs_end(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double H, double h,
                    const gk_tally *tally)
{
    GK_ASSERT(H > 0.0 && h > 0.0 && tally);
    gk_tally_means(model, setup, data, H, tally);
    for (int e = 0; e < model->engagements && GK_ON(setup, friction); e++) GK_OF(data, mesh)
    [e][V_FRICTION_POWER] = (GK_OF(data, meshing)[e].rubbed - GK_OF(data, mesh)[e][V_FRICTION_LOSS]) / H;
    for (int e = 0; e < model->engagements; e++) watch_limits(model, data, e, H, tally->mesh[e]);
    outputs(model, setup, work, data, h);
    gk_sensors_means(model, setup, work, data, H, tally->sensed);
    for (int p = 0; p < model->ports; p++) {
        double *v = GK_OF(data, shaft)[p];
        v[V_TAU_NEXT] = 2.0 * v[V_TAU] - v[V_TAU_MEAN];
    }
}
