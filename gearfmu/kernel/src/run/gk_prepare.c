/* Level, effects, slices and step → gk_setup with all its tables. */
#include "run/gk_wide.h"
#include "force/gk_flank.h"
#include "model/gk_vars.h"
#include "setup/gk_choose.h"
#include "setup/gk_layout.h"
#include "setup/gk_patterns.h"
#include "setup/gk_tables.h"
#include <stdio.h>

/* the sides of gears of body g */
static gk_twins sides_of(const gk_model *model, int g)
{
    gk_twins sides = {.count = 0};
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) {
            if (gk_spread_leader(model, model->engagement[e].gear[w]) != g) continue;
            sides.engagement[sides.count] = e, sides.which[sides.count++] = w;
        }
    return sides;
}

/* moves the first of these sides and its twins to `out` */
static void take_twins(const gk_model *model, gk_twins *sides, gk_twins *out)
{
    const int e = sides->engagement[0], w = sides->which[0], all = sides->count;
    out->count = sides->count = 0;
    for (int i = 0; i < all; i++) {
        const int f = sides->engagement[i], v = sides->which[i];
        gk_twins *to = w == v && gk_side_twins(model, e, f) ? out : sides;
        to->engagement[to->count] = f, to->which[to->count++] = v;
    }
}

/* gear by gear, those of one body together: each body's compliances are spread once, each place on it is read once */
static void fill_sides(const gk_model *model, gk_setup *setup, gk_room *room, gk_fill_function *fill)
{
    for (int g = 0; g < model->gears; g++) {
        if (gk_spread_leader(model, g) != g) continue;
        gk_twins sides = sides_of(model, g), twins;
        if (setup->on.residual) gk_spread_compliance(model, setup, g, room->spread, room->blocks, &room->compliance);
        while (sides.count) {
            take_twins(model, &sides, &twins);
            fill(model, setup, room, &twins);
        }
    }
}

gk_outcome gk_defaults(const gk_model *model, gk_data *data)
{
    GK_ASSERT(model && data);
    const size_t size = gk_data_size(model);
    memset(data, 0, size);
    gk_data_plan(model, data->at);
    data->amplitudes = (int64_t)((size - sizeof *data) / sizeof(double)) - data->at[OF_oscillator] -
                       model->amplitudes; /* until they have their place */
    data->magic = GK_DATA_MAGIC;
    data->phase = PHASE_NEW;
    gk_vars_start(model, data);
    return GK_OK;
}

gk_outcome gk_prepare(const gk_model *model, const gk_data *data, gk_setup *setup, gk_work *work,
                      char message[GK_MESSAGE])
{
    GK_ASSERT(model && data && setup && work && message);
    static const gk_hot baseline = GK_HOT_FUNCTIONS;
    const gk_hot *const wide = gk_wide(), *const hot = wide ? wide : &baseline;
    int modes[MAX_GEARS];
    int32_t which[MAX_GROUND + 4 * MAX_ROTORS];
    message[0] = 0;
    if (data->magic != GK_DATA_MAGIC) {
        snprintf(message, GK_MESSAGE, "gk_prepare before gk_defaults");
        return GK_BAD_CALL;
    }
    memset(setup, 0, sizeof *setup);
    gk_outcome outcome = gk_choose(model, data, setup, message);
    if (outcome) return outcome;
    gk_layout_plan(model, setup);
    for (int g = 0; g < model->gears; g++) modes[g] = setup->on.elastic ? gk_choose_modes(model, setup, g) : 0;
    gk_layout_setup(model, setup, modes, gk_choose_ground(model, setup, which));
    memset(work, 0, sizeof *work);
    gk_layout_work(model, setup, work);
    setup->step = hot->step[setup->integrator], setup->count = hot->count, setup->moves = hot->moves;
    setup->supports = hot->supports, setup->keep = hot->keep, setup->holds = hot->holds;
    gk_setup_fill(model, setup, &work->room, data, which);
    for (int e = 0; e < model->engagements; e++) {
        gk_law_bounds(model, setup, &setup->mesh[e]);
        if (model->engagement[e].kind != MESH_FLAT) gk_flank_clearance(model, setup, &setup->mesh[e]);
    }
    fill_sides(model, setup, &work->room, hot->fill);
    hot->patterns(model, setup, work->room.columns);
    outcome = gk_limit_choose(model, setup, work, data, message);
    if (outcome == GK_OK) setup->magic = GK_SETUP_MAGIC;
    return outcome;
}
