/* Integrals over a communication step: forces of meshes, ports and supports. */
#include "run/gk_run.h"
#include "run/gk_sensors.h"

void gk_tally_begin(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, gk_tally *tally)
{
    GK_ASSERT(tally && setup->base.n % 4 == 0);
    const size_t n = (size_t)setup->base.n;
    double **array[] = {&tally->moved,      &tally->speed,  &tally->last_moved,
                        &tally->last_speed, &tally->now[0], &tally->now[1]};
    memset(tally, 0, sizeof *tally);
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = work->tally + i * n;
    memset(tally->moved, 0, 2 * n * sizeof *tally->moved);
    if (data->state_h > 0.0)
        gk_flow_for(model, setup, &work->room, data->state_h, data->state_gamma); /* a restored state */
    gk_supports_motion(setup, work, data, tally->last_moved, tally->last_speed);
    setup->supports(model, setup, tally->last_moved, tally->last_speed, tally->last);
    gk_sensors_speed(model, setup, tally->last_speed, tally->sensed);
    double now[MAX_SUPPORTS];
    for (int s = 0; s < model->supports; s++) now[s] = GK_OF(data, support)[s][V_FORCE];
    gk_supports_turn(model, data, -1.0, now);
    for (int s = 0; s < model->supports; s++) tally->last[s] = now[s] - tally->last[s];
}

static void count_mesh(const gk_engaged *engaged, gk_data *data, int e, double h, gk_tally *tally)
{
    const gk_system *s = &engaged->system;
    gk_meshing *meshing = &GK_OF(data, meshing)[e];
    double side[2] = {0, 0};
    int touches = 0;
    for (int i = 0; i < s->contacts; i++) {
        side[engaged->place[s->flank.place_of[i]].flank] += gk_solve_mean(s, i);
        touches |= gk_solve_touches(s, i);
    }
    for (int i = s->contacts; i < s->n; i++)
        if (s->joint.which[i] == JOINT_PORT) tally->port[s->joint.port[i]] -= gk_solve_mean(s, i) * h;
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
void gk_tally_count(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double h,
                    gk_tally *tally)
{
    GK_ASSERT(tally && h > 0.0);
    double *const moved = tally->now[0], *const speed = tally->now[1], direct[MAX_SUPPORTS];
    for (int e = 0; e < model->engagements; e++) count_mesh(&work->engaged[e], data, e, h, tally);
    gk_supports_motion(setup, work, data, moved, speed);
    integrate(tally->moved, tally->last_moved, moved, setup->base.n, h);
    integrate(tally->speed, tally->last_speed, speed, setup->base.n, h);
    memset(direct, 0, (size_t)model->supports * sizeof *direct);
    gk_supports_add_direct(model, setup, work, data, direct);
    for (int s = 0; s < model->supports; s++) {
        tally->support[s] += 0.5 * h * (tally->last[s] + direct[s]);
        tally->last[s] = direct[s];
    }
}

/* means of the communication step of length H */
void gk_tally_means(const gk_model *model, const gk_setup *setup, gk_data *data, double H, const gk_tally *tally)
{
    GK_ASSERT(tally && H > 0.0);
    for (int p = 0; p < model->ports; p++)
        if (!setup->given_torque[p]) GK_OF(data, shaft)[p][V_TAU_MEAN] = tally->port[p] / H;
    double force[MAX_SUPPORTS];
    setup->supports(model, setup, tally->moved, tally->speed, force);
    for (int s = 0; s < model->supports; s++) force[s] = (force[s] + tally->support[s]) / H;
    gk_supports_turn(model, data, 1.0, force);
    for (int s = 0; s < model->supports; s++) GK_OF(data, support)[s][V_FORCE_MEAN] = force[s];
    for (int e = 0; e < model->engagements; e++) {
        GK_OF(data, mesh)[e][V_MESH_FORCE_MEAN] = tally->mesh[e] / H;
        GK_OF(data, mesh)[e][V_FORCE_MAX] = tally->highest[e];
    }
}
