/* Forces on the supports: by what the ground oscillators move them, and what contacts, joints and turning axes put on
 * them directly. */
#include "run/gk_run.h"
#include "problem/gk_rows.h"

/* displacement that loads the springs of the supports, and speed that their dashpots see, of the dynamic oscillators */
void gk_supports_motion(const gk_setup *setup, const gk_work *work, const gk_data *data, double *moved, double *speed)
{
    GK_ASSERT(moved && speed && moved != speed);
    const int n = setup->base.n;
    const gk_quad *x = (const gk_quad *)gk_ground_seen(data), *v = x + n / 4, *f = v + n / 4;
    const gk_ground_flow *flow = &gk_flow_known(&work->room, data->state_h, data->state_gamma)->ground;
    const gk_quad *kappa = (const gk_quad *)flow->kappa, *unit = (const gk_quad *)flow->unit,
                  *lead = (const gk_quad *)flow->lead, *hold = (const gk_quad *)flow->hold, *rate = f + n / 4;
    for (int q = 0; q < n / 4; q++) {
        ((gk_quad *)moved)[q] = x[q] - kappa[q] * f[q];
        ((gk_quad *)speed)[q] = (v[q] - lead[q] * rate[q] - hold[q] * f[q]) / unit[q];
    }
}

/* forces on the supports by such motion (or its integral) */
void gk_supports_by_motion(const gk_model *model, const gk_setup *setup, const double *moved, const double *speed,
                           double *out)
{
    GK_ASSERT(out && moved != speed);
    const gk_base *base = &setup->base;
    for (int s = 0; s < model->supports; s++) {
        out[s] = gk_dot_span(base->support_span[s], base->support_rows + s * base->n, moved) +
                 gk_dot_span(base->support_damping_span[s], base->support_damping + s * base->n, speed);
    }
}

/* adds the forces on the supports that contacts make directly through one gear, four supports side by side */
static void add_pressed(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, const double *force,
                        double *out)
{
    const gk_position *at = &engaged->position[side->which];
    const int quads = gk_padded(side->held.width) / 4, strips = setup->strips;
    const size_t next = (size_t)(side->candidates * strips * quads);
    const gk_quad *node = (const gk_quad *)side->support + (size_t)at->node * next;
    const double high = at->part, low = 1.0 - high;
    for (int q = 0; q < quads; q++) {
        gk_quad sum = {0};
        for (int p = 0, i = 0; p < engaged->places; p++) {
            const gk_quad *table = node + engaged->place[p].candidate[side->which] * strips * quads + q;
            for (int strip = 0; strip < strips; strip++, i++, table += quads)
                sum += force[i] * (low * table[0] + high * table[next]);
        }
        for (int s = 4 * q; s < 4 * q + 4 && s < side->held.width; s++) out[side->held.from + s] -= sum[s % 4];
    }
}

/* the same of friction */
static void add_rubbed(const gk_model *model, const gk_engaged *engaged, const gk_side *side, double *out)
{
    const gk_position *at = &engaged->position[side->which];
    const int supports = model->supports, strips = engaged->system.strips;
    const size_t next = (size_t)(side->candidates * strips * supports);
    const double *node = side->along.support + (size_t)at->node * next;
    for (int i = 0; i < engaged->system.contacts; i++) {
        const gk_place *place = &engaged->place[engaged->system.flank.place_of[i]];
        const double *low = node + (place->candidate[side->which] * strips + i % strips) * supports;
        for (int s = 0; s < supports; s++)
            out[s] -= engaged->glide->end[i] * (low[s] + at->part * (low[next + (size_t)s] - low[s]));
    }
}

/* adds the forces on the supports that contacts, joints and turning axes make directly, beside the oscillators */
void gk_supports_add_direct(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                            double *out)
{
    GK_ASSERT(out);
    for (int e = 0; e < model->engagements; e++) {
        const gk_engaged *engaged = &work->engaged[e];
        const gk_system *system = &engaged->system;
        double force[MAX_ROWS];
        for (int i = 0; i < system->n; i++) force[i] = gk_reported(system, i);
        for (int w = 0; w < 2; w++) add_pressed(setup, engaged, &setup->mesh[e].side[w], force, out);
        for (int w = 0; w < 2 && GK_ON(setup, friction); w++) add_rubbed(model, engaged, &setup->mesh[e].side[w], out);
        for (int i = system->contacts; i < system->n; i++)
            if (gk_rows_at_bore(setup, system, i))
                for (int s = 0; s < model->supports; s++)
                    out[s] += force[i] * setup->port_support[system->joint.port[i]][s];
    }
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        for (int i = 0; i < model->supports; i++)
            out[i] += GK_OF(data, v)[r] * GK_OF(data, v)[r] * setup->base.outward_support[r * model->supports + i];
}

/* forces on the supports at the end of the step; of_spring: without those of their own dashpots */
void gk_supports_forces(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                        double *out, double *of_spring)
{
    GK_ASSERT(out && of_spring && out != of_spring);
    const gk_base *base = &setup->base;
    double *const moved = work->tally + 4 * base->n, *const speed = moved + base->n;
    gk_supports_motion(setup, work, data, moved, speed);
    setup->supports(model, setup, moved, speed, out);
    gk_supports_add_direct(model, setup, work, data, out);
    for (int s = 0; s < model->supports; s++)
        of_spring[s] = out[s] - model->ground[base->set].damper[s] *
                                    gk_dot_span(base->damper_span[s], base->damper_rows + s * base->n, speed);
}

/* forces on the ground that are kept in the axes of a carrier, turned into those of the ground (sense 1), or back
 * (−1) */
void gk_supports_turn(const gk_model *model, const gk_data *data, double sense, double *force)
{
    GK_ASSERT(sense == 1.0 || sense == -1.0);
    for (int s = 0; model->support_turn && s < model->supports; s++) {
        const int turn = model->support_turn[s];
        double sine, cosine;
        if (turn < 0 || turn % 2) continue;
        gk_sincos(sense * GK_OF(data, x)[turn / 2], &sine, &cosine);
        const double x = force[s], y = force[s + 1];
        force[s] = cosine * x - sine * y, force[s + 1] = sine * x + cosine * y;
    }
}
