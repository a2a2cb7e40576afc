/* What a run is made of: level, integrator, effects and contact that go together, and the oscillators that are dynamic
 * then. */
#include "setup/gk_choose.h"
#include "setup/gk_setup.h"
#include <stdio.h>

static const double RESOLVED = 4.0; /* ωh up to which the step follows an oscillator */

/* the longest step that a run is given which asks for none, s */
double gk_longest_step(const gk_model *model) { return gk_min(model->h_max, model->period_min / 16.0); }

/* ---- level and integrator ---------------------------------------------------------------------------------------- */
static int has_nodes(const gk_model *model, const gk_data *data)
{
    int all = model->engagements > 0;
    for (int e = 0; e < model->engagements; e++) {
        all &= GK_OF(data, mesh)[e][V_PENALTY] > 0.0;
        for (int w = 0; w < 2; w++) all &= model->gear[model->engagement[e].gear[w]].nodes[0] > 0;
    }
    return all;
}

/* contact by nodes, where it is asked for or the way of the level; needs an explicit integrator */
static gk_outcome choose_contact(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE])
{
    const gk_contact_law law = (gk_contact_law)(int)data->stage[V_CONTACT_LAW];
    const int is_explicit = gk_scheme_of(setup->integrator)->is_explicit, there = has_nodes(model, data);
    setup->nodal = law == CONTACT_NODAL ||
                   (law == CONTACT_BY_LEVEL && setup->level == LEVEL_PAPER && is_explicit && there);
    if (!setup->nodal) return GK_OK;
    if (!there) {
        snprintf(
            message, GK_MESSAGE,
            "contact nodal: this model has no flank nodes, or contact_penalty is 0; make the model again with this "
            "version of gearfmu, or give contact_penalty");
        return GK_BAD_VALUE;
    }
    if (!is_explicit) {
        snprintf(message, GK_MESSAGE,
                 "contact nodal is a force that follows from positions: use integrator rk45 or central (levels paper, "
                 "explicit) and a stage without a clutch in its ports, or contact line");
        return GK_BAD_VALUE;
    }
    setup->on.residual = 0;
    snprintf(message, GK_MESSAGE,
             "contact nodal leaves the static compliance of all higher modes out: teeth are too stiff, and nodes make "
             "noise; use "
             "it for comparison only");
    return GK_OK;
}

/* an effect that is on and misses what it needs (gk_effects.inc) is refused */
static gk_outcome check_needs(const gk_setup *setup, char message[GK_MESSAGE])
{
    enum { NOTHING, SOLVED, LINES };
    const int there[] = {
        [NOTHING] = 1, [SOLVED] = setup->integrator == DG4 || setup->integrator == EM, [LINES] = !setup->nodal};
    const struct {
        int wanted, needs;
        const char *refusal;
    } rows[] = {
#define GK_EFFECT(name, variable, needs, refusal) {setup->on.name, needs, refusal},
#define GK_PART(name)
#include "model/gk_effects.inc"
#undef GK_EFFECT
#undef GK_PART
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (rows[i].wanted && !there[rows[i].needs]) {
            snprintf(message, GK_MESSAGE, "%s", rows[i].refusal);
            return GK_BAD_VALUE;
        }
    return GK_OK;
}

/* bodies must know how they yield along the profile */
static gk_outcome check_friction(const gk_model *model, const gk_setup *setup, char message[GK_MESSAGE])
{
    for (int g = 0; g < model->gears && setup->on.elastic && setup->on.friction; g++)
        if (!model->gear[g].along_rows) {
            snprintf(message, GK_MESSAGE,
                     "effect.friction: gear %d of this model does not know how it yields along the profile; reduce its "
                     "body again with this version of gearfmu, or set effect.friction = false",
                     g + 1);
            return GK_BAD_VALUE;
        }
    return GK_OK;
}

/* ω up to which oscillators beyond those of level standard are dynamic at level full, rad/s. Faster ones would only
 * ring with the step: they follow their forces at once, as those above the cut of other levels do. */
static double highest_of(const gk_model *model, const gk_data *data, const gk_setup *setup)
{
    const double wished = data->stage[V_H];
    if (setup->level != LEVEL_FULL || gk_scheme_of(setup->integrator)->is_explicit) return INFINITY;
    return RESOLVED / (wished > 0.0 ? wished : gk_longest_step(model));
}

/* level, integrator and effects that go together; `paper` is the paper's way: truncated modes, no residual, nodal
 * contact, rk45 (dg4 and lines of contact where a clutch hangs on a port) */
gk_outcome gk_choose(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE])
{
    GK_ASSERT(model && setup && message);
    GK_ASSERT(data && data->magic == GK_DATA_MAGIC);
    double damping = 0.0;
    setup->level = (gk_level)(int)data->stage[V_LEVEL];
    setup->integrator = (gk_integrator)(int)data->stage[V_INTEGRATOR];
    setup->on = gk_effects_of(data);
    setup->slices = (int)data->stage[V_SLICES];
    setup->spatial = model->spatial;
    setup->strips = gk_strips_count(model, setup->slices);
    for (int e = 0; e < model->engagements; e++) damping = gk_max(damping, GK_OF(data, mesh)[e][V_DAMPING]);
    if (damping == 0.0) setup->on.contact_damping = 0;
    setup->base.set = model->sets > 1 && !setup->on.bearings ? 1 : model->housed && !GK_ON(setup, housing) ? 2 : 0;
    if (setup->level == LEVEL_EXPLICIT && setup->integrator == DG4) setup->integrator = CENTRAL;
    if (gk_scheme_of(setup->integrator)->is_explicit && model->chains) {
        snprintf(message, GK_MESSAGE,
                 "integrators rk45 and central (level explicit) know no clutch: use dg4, or export the stage without "
                 "the chain");
        return GK_BAD_VALUE;
    }
    if (setup->level == LEVEL_PAPER && setup->integrator == DG4 && !model->chains) setup->integrator = RK45;
    setup->highest = highest_of(model, data, setup);
    gk_outcome outcome = choose_contact(model, data, setup, message);
    if (!outcome) outcome = check_needs(setup, message);
    if (!outcome) outcome = check_friction(model, setup, message);
    if (outcome || setup->nodal) return outcome;
    if (setup->level == LEVEL_PAPER) {
        setup->on.residual = 0;
        snprintf(message, GK_MESSAGE,
                 "level paper leaves the static compliance of all higher modes out: tooth stiffness is 15 to 40 %% too "
                 "high; use it for comparison only");
    } else if (!setup->on.elastic) {
        setup->on.residual = 0;
    } else if (!setup->on.residual) {
        snprintf(message, GK_MESSAGE,
                 "effect.residual = false leaves the static compliance of all higher modes out: allowed at level paper "
                 "only");
        return GK_BAD_VALUE;
    }
    return GK_OK;
}

/* ---- which oscillators are dynamic ------------------------------------------------------------------------------- */
/* how many modes of a gear group are dynamic, from the first on (stage/assembly/levels.py has their order) */
int gk_choose_modes(const gk_model *model, const gk_setup *setup, int g)
{
    GK_ASSERT(gk_is_gear(model, g));
    const gk_gear *gear = &model->gear[g];
    int all = gear->level_modes[2];
    switch (setup->level) {
    case LEVEL_RIGID: return setup->engagements_of[g] > 1 ? gear->level_modes[0] : 0;
    case LEVEL_FAST: return gear->level_modes[1];
    case LEVEL_STANDARD: return gear->level_modes[2];
    default:
        while (all < gear->modes && (gear->omega[all] <= setup->highest || gear->member[all] == 2)) all++;
        return all;
    }
}

/* do engagements act on each other through what is compliance at level rigid, a gear or a housing? */
static int shares(const gk_model *model, const gk_setup *setup)
{
    if (model->housed && setup->base.set == 0) return model->engagements > 1;
    for (int g = 0; g < model->gears; g++)
        if (setup->engagements_of[g] > 1) return 1;
    return 0;
}

/* what moves rigidly is dynamic at every level; of the rest what lies below the cut. Rigid gears whose bores are
 * held do not move. */
static int is_dynamic(const gk_model *model, const gk_setup *setup, int k)
{
    const gk_ground *ground = &model->ground[setup->base.set];
    if (!setup->on.elastic && !setup->on.bearings) return 0;
    if (ground->rigid_share[k] > 0.5) return 1;
    if (!setup->on.elastic) return 0;
    if (setup->level == LEVEL_RIGID)
        return shares(model, setup) && ground->omega[k] < GK_SHARED_BELOW * 2.0 * GK_PI * model->cut[0];
    const double cut = 2.0 * GK_PI * model->cut[setup->level != LEVEL_FAST];
    return ground->omega[k] < cut || (setup->level > LEVEL_STANDARD && ground->omega[k] <= setup->highest);
}

/* the rotor whose part of the ground group an oscillator belongs to: of the first gear that reads it */
static int rotor_of(const gk_model *model, int set, int k)
{
    for (int g = 0; g < model->gears; g++)
        for (int i = 0; i < model->gear[g].ground[set].reads; i++)
            if (model->gear[g].ground[set].list[i] == k) return model->gear[g].rotor;
    return model->rotors - 1;
}

/* dynamic oscillators in order, rotor by rotor, each padded to quads with −1; returns their number */
int gk_choose_ground(const gk_model *model, const gk_setup *setup, int32_t *which)
{
    GK_ASSERT(which && setup->base.set >= 0 && setup->base.set < model->sets);
    int n = 0;
    for (int r = 0; r < model->rotors; r++) {
        for (int k = 0; k < model->ground[setup->base.set].n; k++)
            if (is_dynamic(model, setup, k) && rotor_of(model, setup->base.set, k) == r) which[n++] = k;
        while (n % 4) which[n++] = -1;
    }
    return n;
}
