/* Opens inner functions of the kernel to tests: places of contact with gap and gradient, the local law. Compiled
 * together with gearfmu/kernel/src. */
#include "integrate/gk_closed.h"
#include "integrate/gk_integrate.h"
#include "setup/gk_oscillator.h"

/* planar: x, y, φ of both gears; out: per place {flank, tooth, gap, gradient[6], roll A, roll B, curvature} */
GK_API int probe_places(const gk_model *model, const gk_setup *setup, const double *planar, double reach, double *out)
{
    gk_place place[MAX_PAIRS];
    gk_position position[2];
    double pose[POSE] = {0};
    for (int c = 0; c < 2 * PLANE; c++) pose[SPACE * (c / PLANE) + c % PLANE] = planar[c];
    int found = gk_flank_find(model, setup, &setup->mesh[0], pose, reach, position, place);
    for (int i = 0; i < found; i++, out += 12) {
        const gk_point *point = &place[i].point[0];
        out[0] = place[i].flank;
        out[1] = place[i].key.tooth;
        out[2] = place[i].gap;
        for (int c = 0; c < 2 * PLANE; c++) out[3 + c] = point->gradient[SPACE * (c / PLANE) + c % PLANE];
        out[9] = point->roll[0];
        out[10] = point->roll[1];
        out[11] = point->curvature;
    }
    return found;
}

/* pose (12) of the gears of engagement e; out: per place and slice {flank, slice, z of its middle, gradient[12],
 * slide[12]} */
GK_API int probe_rows(const gk_model *model, const gk_setup *setup, int e, const double *pose, double reach,
                      double *out)
{
    gk_place place[MAX_PAIRS];
    gk_position position[2];
    int rows = 0;
    const int found = gk_flank_find(model, setup, &setup->mesh[e], pose, reach, position, place);
    for (int i = 0; i < found; i++)
        for (int strip = 0; strip < setup->strips; strip++, rows++, out += 3 + 2 * POSE) {
            const gk_point *point = gk_point_of(setup, &place[i], strip);
            const gk_mesh *mesh = &setup->mesh[e];
            out[0] = place[i].flank, out[1] = strip;
            out[2] = mesh->rides ? 0.5 * (point->end[0] + point->end[1]) : mesh->strip_middle[strip];
            memcpy(out + 3, point->gradient, sizeof point->gradient);
            memcpy(out + 3 + POSE, point->slide, sizeof point->slide);
        }
    return rows;
}

/* out: {approach, slope, energy} of one slice at `force` */
GK_API void probe_law(const gk_model *model, const gk_setup *setup, double curvature, double force, double *out)
{
    gk_system s;
    memset(&s, 0, sizeof s);
    s.contacts = s.n = 1, s.stride = 4;
    s.flank.curvature[0] = curvature, s.force[0] = force;
    s.flank.width[0] = model->engagement[0].width / setup->slices;
    s.flank.per_width[0] = 1.0 / s.flank.width[0];
    gk_law_set(model, setup, &setup->mesh[0], &s);
    gk_law_apply(&s);
    out[0] = s.local.delta[0];
    out[1] = s.local.yield[0];
    out[2] = s.local.potential[0];
}

/* the same of a part of a line of contact; opens: what its further gaps are more than the least */
GK_API void probe_part(const gk_model *model, const gk_setup *setup, const double *opens, double force, double *out)
{
    gk_system s;
    memset(&s, 0, sizeof s);
    s.contacts = s.n = 1, s.stride = 4;
    s.flank.curvature[0] = 100.0, s.force[0] = force;
    s.flank.width[0] = s.flank.per_width[0] = 1.0;
    for (int k = 0; k < GAPS - 1; k++) s.flank.opens[k][0] = opens[k];
    gk_law_set(model, setup, &setup->mesh[0], &s);
    gk_law_apply(&s);
    out[0] = s.local.delta[0], out[1] = s.local.yield[0], out[2] = s.local.potential[0], out[3] = setup->mesh[0].yields;
}

/* ends of the line of contact (z) where both rolls at mid-width are these, then of every part, and the means of the
 * width functions over it on gear A */
GK_API void probe_line(const gk_model *model, const gk_setup *setup, double sg, const double *roll, double *out)
{
    const gk_line line = gk_strips_line(model, &setup->mesh[0], sg, roll);
    out[0] = line.end[0], out[1] = line.end[1];
    out += 2;
    for (int i = 0; i < setup->strips; i++, out += 2 + model->functions) {
        const gk_part part = gk_strips_part(setup, &line, i);
        out[0] = part.end[0], out[1] = part.end[1];
        gk_strips_row(model, model->engagement[0].gear[0], part.end[0], part.end[1], out + 2);
    }
}

/* adds a force that is even between two places of the width to its slices */
GK_API void probe_spread(const gk_model *model, const gk_setup *setup, const double *end, double force, double *out)
{
    gk_strips_spread(setup, &model->engagement[0], end, force, out);
}

/* μ′: least for which the limit holds */
GK_API double probe_mu(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h,
                       double gamma)
{
    const gk_coefficients *k = gk_flow_for(model, setup, &work->room, h, gamma);
    double low = 0.0, high = 16.0;
    gk_closed_keep(model, setup, work, data);
    for (int i = 0; i < 30; i++) {
        const double middle = 0.5 * (low + high);
        if (middle > 0.0 && gk_closed_holds(model, setup, work, data, k, middle))
            high = middle;
        else
            low = middle;
    }
    return high;
}

/* a prepared setup keeps this γ, whatever its limit is */
GK_API void probe_set_gamma(gk_setup *setup, double gamma)
{
    for (int i = 0; i < GAMMAS; i++) setup->gamma_at[i] = gamma;
}

/* coefficient of friction; given: law (1: Benedict and Kelley, 2: ISO/TR 14179-2), viscosity, roughness, sum of the
 * rolling speeds at the pitch point per speed of gear A and relative radius there, width; load per length, total force,
 * sliding speed, sum of the rolling speeds, speed of gear A */
GK_API double probe_friction(const double *given)
{
    const gk_friction law = {.law = (gk_friction_law)(int)given[0],
                             .viscosity = given[1],
                             .roughness = given[2],
                             .pitch_sum = given[3],
                             .pitch_rho = given[4]};
    const gk_sliding at = {
        .load = given[6], .total = given[7], .slides = given[8], .rolls = given[9], .turns = given[10]};
    return gk_lubrication_coefficient(&law, given[5], &at);
}

/* out: number of the first of four nodes on a grid of `count` from `form` to `tip`, their weights and slopes */
GK_API void probe_grid(double form, double tip, int count, double roll, double *out)
{
    gk_gear gear;
    memset(&gear, 0, sizeof gear);
    gear.s_form = form, gear.s_tip = tip;
    const gk_grid grid = gk_grid_flank(&gear, count, roll);
    *out++ = grid.index;
    memcpy(out, grid.weight, sizeof grid.weight);
    memcpy(out + 4, grid.slope, sizeof grid.slope);
}

/* pose (12), in place: where both toothings of engagement 0 stand; motion (12), in place: how they move there */
GK_API void probe_runout(const gk_model *model, const gk_setup *setup, double *pose, double *motion)
{
    double turn[POSE];
    gk_runout_move(model, setup, &model->engagement[0], pose, turn);
    gk_runout_follow(turn, motion);
}

/* pace (3): h, γ, matched Ω; out: flow (4), bq, bv, κ, weight of the energy, unit, lead and hold of the speed, κ of a
 * free mass */
GK_API void probe_oscillator(const double *pace, double omega, double zeta, double *out)
{
    const gk_pace of = {pace[0], pace[1], pace[2]};
    const gk_oscillator o = gk_oscillator_of(&of, omega, zeta);
    const double all[] = {o.a11,   o.a12,        o.a21,  o.a22,  o.bq,   o.bv,
                          o.kappa, o.inverse_s2, o.unit, o.lead, o.hold, gk_oscillator_free_kappa(&of)};
    memcpy(out, all, sizeof all);
}
