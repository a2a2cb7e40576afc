/* A run that goes on with another setup: the physical motion of the old state, expressed in the oscillators that are
 * dynamic now. An oscillator that was compliance had the displacement f/ω² of its modal force f, and its speed is taken
 * as zero; one that becomes compliance is left out, for the residual holds its static part. Contacts keep forces, gaps
 * and the energy that they owe; where another number of strips is in use they begin as new ones do, which disturbs as
 * much as half a step without contact. */
#include "run/gk_run.h"
#include <stddef.h>

typedef struct passage { /* from where to where */
    const gk_model *model;
    const gk_setup *old, *setup;
    const gk_work *work; /* of the old run */
    const gk_data *from;
    gk_data *data;
    const gk_coefficients *k; /* that the old state is expressed for */
} passage;

static int allowed(const gk_setup *old, const gk_data *from, const gk_setup *setup, const gk_data *data)
{
    return old->magic == GK_SETUP_MAGIC && setup->magic == GK_SETUP_MAGIC && from->magic == GK_DATA_MAGIC &&
           data->magic == GK_DATA_MAGIC && from->phase == PHASE_RUNNING && data->phase == PHASE_NEW &&
           from->steps > 0 && !gk_scheme_of(old->integrator)->is_explicit &&
           !gk_scheme_of(setup->integrator)->is_explicit && old->base.set == setup->base.set;
}

/* all that does not depend on the setup; the energy balance begins anew */
static void take_head(const passage *c)
{
    gk_vars_take(c->model, c->data, c->from);
    const size_t start = offsetof(gk_data, time_base), from = c->data->at[OF_x];
    memcpy((char *)c->data + start, (const char *)c->from + start, sizeof(gk_data) - start);
    memcpy(c->data->tail + from, c->from->tail + from, (c->data->at[OF_oscillator] - from) * sizeof(double));
    c->data->phase = PHASE_RUNNING;
    c->data->status = c->from->status;
    c->data->amplitudes = (int64_t)c->setup->amplitudes;
    c->data->state_h = c->data->state_gamma = c->data->expressed_h = c->data->expressed_gamma = 0.0;
    c->data->table_h = c->data->rk_h = 0.0;
    c->data->steps = 0;
    c->data->energy = (gk_energy){0};
    for (int e = 0; e < c->model->engagements && c->old->strips != c->setup->strips; e++)
        GK_OF(c->data, meshing)[e].pairs = 0;
}

/* rigid rotations: what the scheme adds to displacement and speed is taken off */
static void take_spins(const passage *c)
{
    for (int d = 0; d < c->old->spins; d++) GK_OF(c->data, x)
    [d] -= c->k->rigid_kappa * c->old->inverse_inertia[d] * GK_OF(c->from, f)[d],
        GK_OF(c->data, v)[d] -= c->k->rigid_lead * c->old->inverse_inertia[d] * GK_OF(c->from, f_rate)[d];
}

/* displacement, speed and force of the ground oscillators; pushed: modal forces on those that were compliance */
static void take_ground(const passage *c, const double *pushed)
{
    const gk_base *was = &c->old->base, *is = &c->setup->base;
    const gk_ground *ground = &c->model->ground[is->set];
    const gk_ground_flow *k = &c->k->ground;
    const double *x = gk_ground_seen(c->from), *v = x + was->n, *f = v + was->n, *rate = f + was->n;
    double *out = gk_ground_of(c->data);
    memset(out, 0, OSCILLATOR_STATE * (size_t)is->n * sizeof *out);
    for (int i = 0; i < ground->n; i++) {
        const int a = was->slot[i], b = is->slot[i];
        if (b < 0) continue;
        out[b] = a >= 0 ? x[a] - k->kappa[a] * f[a] : pushed[i] / (ground->omega[i] * ground->omega[i]);
        out[is->n + b] = a >= 0 ? (v[a] - k->lead[a] * rate[a] - k->hold[a] * f[a]) / k->unit[a] : 0.0;
        out[2 * is->n + b] = a >= 0 ? f[a] : pushed[i];
        out[3 * is->n + b] = a >= 0 ? rate[a] : 0.0;
    }
}

/* the same of the modes of a gear group */
static void take_gear(const passage *c, int g, const double *pushed)
{
    const gk_modal *was = &c->old->modal[g], *is = &c->setup->modal[g];
    const double *omega = c->model->gear[g].omega;
    const gk_flow *k = &c->k->flow[g];
    const gk_real *q = gk_modal_seen(c->old, c->from, g), *v = q + was->n, *f = v + was->n, *rate = f + was->n;
    gk_real *out = gk_modal_of(c->setup, c->data, g);
    memset(out, 0, OSCILLATOR_STATE * (size_t)is->n * sizeof *out);
    for (int i = 0; i < is->count; i++) {
        const int b = is->lane[i], known = i < was->count, a = known ? was->lane[i] : 0;
        out[b] = known ? q[a] - k->kappa[a] * f[a] : (gk_real)(pushed[i] / (omega[i] * omega[i]));
        out[is->n + b] = known ? (v[a] - k->lead[a] * rate[a] - k->hold[a] * f[a]) / k->unit[a] : (gk_real)0;
        out[2 * is->n + b] = known ? f[a] : (gk_real)pushed[i];
        out[3 * is->n + b] = known ? rate[a] : (gk_real)0;
    }
}

/* modal forces of contacts on what was compliance, of one gear */
static void push_gear(const passage *c, int g, double *modes, double *ground)
{
    memset(modes, 0, (size_t)c->model->gear[g].modes * sizeof *modes);
    for (int e = 0; e < c->model->engagements && c->old->on.residual; e++)
        for (int w = 0; w < 2; w++)
            if (c->model->engagement[e].gear[w] == g && c->model->engagement[e].kind != MESH_FLAT)
                gk_amplitudes_of_contacts(c->model, c->old, c->work, e, w, modes, ground);
}

gk_outcome gk_adopt(const gk_model *model, const gk_setup *from_setup, const gk_work *from_work, const gk_data *from,
                    const gk_setup *setup, gk_data *data)
{
    GK_ASSERT(model && from_setup && from_work && from && setup && data);
    if (!allowed(from_setup, from, setup, data)) return GK_BAD_CALL;
    const gk_coefficients *k = gk_flow_known(&from_work->room, from->state_h, from->state_gamma);
    const passage c = {model, from_setup, setup, from_work, from, data, k};
    const size_t oscillators = (size_t)model->ground[from_setup->base.set].n;
    double *const ground = from_work->pushed, *const modes = ground + oscillators;
    memset(ground, 0, oscillators * sizeof *ground);
    take_head(&c);
    take_spins(&c);
    for (int g = 0; g < model->gears; g++) {
        push_gear(&c, g, modes, ground);
        take_gear(&c, g, modes);
    }
    if (from_setup->on.residual) gk_amplitudes_of_ports(model, from_setup, from_work, ground);
    take_ground(&c, ground);
    return GK_OK;
}
