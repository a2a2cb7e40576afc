/* Motion of the gears that the model observes, in their own axes, as outputs: rigid motion and amplitudes of all
 * stored modes of the free body, so that its displacement is their sum over the mode shapes. Patterns of nodal
 * diameter 0 and 1 are those of the ground oscillators, turned into the gear's axes; modes of the gear group are its
 * own. What is not dynamic follows the forces at once, −N λ/ω². Left out: the residual beyond all stored modes. */
#include "run/gk_run.h"
#include "setup/gk_push.h"
#include "problem/gk_rows.h"

/* forces on the strips of a tooth of one gear of an engagement: contacts press, so outward they pull */
static double strip_load(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int p, int which,
                         gk_strip_load *load)
{
    const gk_system *s = &engaged->system;
    const gk_mesh *mesh = &setup->mesh[engaged->index];
    const gk_place *place = &engaged->place[p];
    double most = 0.0;
    load->flank = place->flank, load->tooth = place->tooth[which];
    for (int strip = 0; strip < s->strips; strip++) {
        load->force[strip] = -gk_reported(s, p * s->strips + strip);
        const gk_point *point = gk_point_of(setup, place, strip);
        load->roll[strip] = point->roll[which];
        load->z[strip] = mesh->rides ? 0.5 * (point->end[0] + point->end[1]) : mesh->strip_middle[strip];
        if (mesh->rides) gk_strips_row(model, load->gear, point->end[0], point->end[1], load->width[strip]);
        most = gk_max(most, fabs(load->force[strip]));
    }
    return most;
}

/* adds the forces of the contacts of one engagement: on modes of the gear above the cut, and on the ground oscillators
 * that it reads and that are not dynamic */
void gk_amplitudes_of_contacts(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, int which,
                               double *modes, double *ground)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    const gk_engaged *engaged = &work->engaged[e];
    const int g = model->engagement[e].gear[which];
    gk_strip_load load = {.gear = g, .strips = engaged->system.strips};
    gk_strips_rows(model, setup, &model->engagement[e], g, load.width);
    for (int p = 0; p < engaged->places; p++)
        if (strip_load(model, setup, engaged, p, which, &load) > 0.0) {
            gk_node_push(model, setup, &load, setup->modal[g].count, work->mode_row, modes);
            gk_node_push_ground(model, setup, e, which, &load, ground);
        }
}

/* what moments on ports do to ground oscillators that are not dynamic */
void gk_amplitudes_of_ports(const gk_model *model, const gk_setup *setup, const gk_work *work, double *ground)
{
    GK_ASSERT(work && ground);
    const gk_ground *all = &model->ground[setup->base.set];
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = s->contacts; i < s->n; i++) {
            const double moment = gk_rows_at_bore(setup, s, i) ? gk_reported(s, i) : 0.0;
            for (int k = 0; k < all->n && moment != 0.0; k++)
                if (setup->base.slot[k] < 0) ground[k] += moment * all->port_rows[s->joint.port[i] * all->n + k];
        }
    }
}

/* displacements of the ground oscillators by forces on those that are not dynamic; dynamic ones free of the step's
 * correction */
static void ground_motion(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                          double *moved)
{
    const gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    const double *x = gk_ground_seen(data), *f = x + 2 * base->n;
    const double *kappa = gk_flow_known(&work->room, data->state_h, data->state_gamma)->ground.kappa;
    for (int k = 0; k < ground->n; k++) {
        const int slot = base->slot[k];
        moved[k] = slot >= 0 ? x[slot] - kappa[slot] * f[slot] : moved[k] / (ground->omega[k] * ground->omega[k]);
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
    gk_sincos(gear->phase + GK_OF(data, x)[gear->rotor] - (frame < 0 ? 0.0 : GK_OF(data, x)[frame]), &sine, &cosine);
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

/* modal forces of all contacts on one gear: what is not dynamic follows them at once */
static void push_static(const gk_model *model, const gk_setup *setup, const gk_work *work, int g, double *modes,
                        double *ground)
{
    if (!setup->on.residual) return;
    gk_amplitudes_of_ports(model, setup, work, ground);
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++)
            if (model->engagement[e].gear[w] == g && model->engagement[e].kind != MESH_FLAT)
                gk_amplitudes_of_contacts(model, setup, work, e, w, modes, ground);
}

void gk_amplitudes(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data)
{
    GK_ASSERT(data->amplitudes >= 0);
    if (!model->amplitudes) return;
    const gk_coefficients *k = gk_flow_known(&work->room, data->state_h, data->state_gamma);
    for (int g = 0; g < model->gears; g++) {
        const gk_gear *gear = &model->gear[g];
        const gk_observed *o = &gear->observed;
        const size_t oscillators = (size_t)model->ground[setup->base.set].n;
        double *const moved = work->pushed;
        if (!o->name) continue;
        memset(moved, 0, oscillators * sizeof *moved);
        double *own = GK_OF(data, oscillator) + data->amplitudes + o->from, *modes = own + o->own;
        memset(modes, 0, (size_t)gear->modes * sizeof *modes);
        push_static(model, setup, work, g, modes, moved);
        for (int i = setup->modal[g].count; i < gear->modes; i++)
            modes[i] *= o->scale / (gear->omega[i] * gear->omega[i]);
        ground_motion(model, setup, work, data, moved);
        own_motion(model, setup, data, g, moved, own);
        dynamic_modes(setup, k, data, g, o->scale, modes);
    }
}
