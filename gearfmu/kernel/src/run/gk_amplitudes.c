/* Motion of the gears that the model observes, in their own axes, as outputs: rigid motion and amplitudes of all stored
 * modes of the free body, so that its displacement is their sum over the mode shapes. Patterns of nodal diameter 0 and 1
 * are those of the ground oscillators, turned into the gear's axes; modes of the gear group are its own. What is not
 * dynamic follows the forces at once: of the gear group −N λ/ω², of the ground oscillators those that several engagements
 * hear of, whose rows a step has. Left out: the other ground oscillators above the cut (of a gear with one engagement),
 * and the residual beyond all stored modes. */
#include "run/gk_run.h"

/* displacements of all ground oscillators: dynamic ones free of the step's correction; others by the far rows, W/Ω */
static void ground_motion(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                          double *moved)
{
    const gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    const double *x = gk_ground_seen(data), *f = x + 2 * base->n;
    const double *kappa = gk_flow_known(work, data->state_h, data->state_gamma)->ground.kappa;
    double far[MAX_FAR] = {0};
    for (int e = 0; e < model->engagements && setup->far && setup->on.residual; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = 0; i < s->n; i++) {
            const double *row = work->engaged[e].far + (size_t)i * (size_t)setup->far, force = gk_reported(s, i);
            for (int c = 0; c < setup->far_supports; c++) far[c] += force * row[c];
        }
    }
    for (int k = 0; k < ground->n; k++) {
        const int slot = base->slot[k], column = setup->far ? setup->far_slot[k] : -1;
        moved[k] = slot >= 0 ? x[slot] - kappa[slot] * f[slot] : column >= 0 ? far[column] / ground->omega[k] : 0.0;
    }
}

/* rigid motion and patterns of nodal diameter 0 and 1 */
static void own_motion(const gk_model *model, const gk_setup *setup, const gk_data *data, int g, const double *moved,
                       double *out)
{
    const gk_gear *gear = &model->gear[g];
    const gk_observed *o = &gear->observed;
    const gk_base *base = &setup->base;
    const int reads = gear->ground[base->set].reads, frame = model->frame[gear->rotor];
    const int32_t *list = gear->ground[base->set].list;
    for (int i = 0; i < o->own; i++) {
        const double *row = o->rows[base->set] + (size_t)i * (size_t)reads;
        out[i] = 0.0;
        for (int k = 0; k < reads; k++) out[i] += row[k] * moved[list[k]];
    }
    double sine, cosine;
    gk_sincos(gear->phase + data->x[gear->rotor] - (frame < 0 ? 0.0 : data->x[frame]), &sine, &cosine);
    for (int i = 0; i < o->own; i++)
        if (o->member[i] == 1) {
            const double a = out[i], b = out[i + 1];
            out[i] = cosine * a + sine * b, out[i + 1] = cosine * b - sine * a;
        }
}

static void dynamic_modes(const gk_setup *setup, const gk_coefficients *k, const gk_data *data, int g, double scale,
                          double *out)
{
    const gk_modal *m = &setup->modal[g];
    const gk_real *q = gk_modal_seen(setup, data, g), *f = q + 2 * m->n, *kappa = k->flow[g].kappa;
    for (int i = 0; i < m->count; i++) {
        const int lane = m->lane[i];
        out[i] = scale * ((double)q[lane] - (double)kappa[lane] * (double)f[lane]);
    }
}

/* adds the modal forces of the contacts of one engagement on modes above the cut */
static void push_contacts(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, int which,
                          double *force)
{
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    const int g = model->engagement[e].gear[which];
    gk_strip_load load = {.gear = g, .strips = s->strips};
    gk_strips_rows(model, setup, &model->engagement[e], g, load.width);
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        double most = 0.0;
        load.flank = place->flank, load.tooth = place->tooth[which];
        for (int strip = 0; strip < s->strips; strip++) {
            load.force[strip] = -gk_reported(s, p * s->strips + strip); /* contacts press */
            load.roll[strip] = gk_point_of(setup, place, strip)->roll[which];
            most = gk_max(most, fabs(load.force[strip]));
        }
        if (most > 0.0) gk_side_push(model, &load, setup->modal[g].count, force);
    }
}

static void static_modes(const gk_model *model, const gk_setup *setup, const gk_work *work, int g, double *out)
{
    const gk_gear *gear = &model->gear[g];
    const int first = setup->modal[g].count;
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++)
            if (model->engagement[e].gear[w] == g && model->engagement[e].kind != MESH_FLAT)
                push_contacts(model, setup, work, e, w, out);
    for (int k = first; k < gear->modes; k++) out[k] *= gear->observed.scale / (gear->omega[k] * gear->omega[k]);
}

void gk_amplitudes(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    if (!model->amplitudes) return;
    const gk_coefficients *k = gk_flow_known(work, data->state_h, data->state_gamma);
    double moved[MAX_GROUND];
    ground_motion(model, setup, work, data, moved);
    for (int g = 0; g < model->gears; g++) {
        const gk_observed *o = &model->gear[g].observed;
        if (!o->name) continue;
        double *own = data->oscillator + data->amplitudes + o->from, *modes = own + o->own;
        own_motion(model, setup, data, g, moved, own);
        memset(modes, 0, (size_t)model->gear[g].modes * sizeof *modes);
        dynamic_modes(setup, k, data, g, o->scale, modes);
        if (setup->on.residual) static_modes(model, setup, work, g, modes);
    }
}
