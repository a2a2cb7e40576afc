/* Where everything of gk_setup lies: one block, arrays behind the head; and of the part of gk_work that setup knows. */
#include "setup/gk_layout.h"
#include "setup/gk_islands.h"
#include "setup/gk_tables.h"

/* ---- the plan ---------------------------------------------------------------------------------------------------- */
/* what sizes depend on once level and effects are chosen: islands, engagements of a gear, candidates of a side */
void gk_layout_plan(const gk_model *model, gk_setup *setup)
{
    GK_ASSERT(model->engagements >= 0 && model->engagements <= MAX_ENGAGEMENTS);
    GK_ASSERT(setup->strips >= 1 && setup->strips <= MAX_SLICES);
    gk_islands_find(model, setup);
    for (int g = 0; g < model->gears; g++) setup->engagements_of[g] = 0;
    for (int e = 0; e < model->engagements; e++) {
        setup->mesh[e].index = e;
        for (int w = 0; w < 2; w++) setup->engagements_of[model->engagement[e].gear[w]]++;
    }
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) gk_side_plan(model, setup, e, &setup->mesh[e].side[w], w);
}

/* ---- arrays ------------------------------------------------------------------------------------------------------ */
static int to_lanes(int n) { return (n + LANES - 1) / LANES * LANES; }

/* number of lanes a half needs: one a pair, one a single mode */
static int lanes_of(const gk_gear *gear, int modes)
{
    int lanes = 0;
    for (int k = 0; k < modes; k++) lanes += gear->member[k] != 2;
    return lanes;
}

static void lay_out_modal(gk_bump *b, const gk_gear *gear, gk_modal *m, int modes)
{
    m->count = modes;
    m->pairs = to_lanes(lanes_of(gear, modes));
    m->n = 2 * m->pairs;
    const size_t n = (size_t)m->n, turns = (size_t)gear->z * (size_t)m->pairs;
    m->omega = gk_bump_doubles(b, n);
    m->zeta = gk_bump_doubles(b, n);
    m->omega2 = gk_bump_reals(b, n);
    m->lane = gk_bump_take(b, (size_t)modes * sizeof *m->lane);
    m->cosine = gk_bump_reals(b, turns);
    m->sine = gk_bump_reals(b, turns);
    m->turn_rate = gk_bump_reals(b, (size_t)m->pairs);
}

static void lay_out_flank(gk_bump *b, const gk_model *model, gk_setup *setup, int g)
{
    const gk_gear *gear = &model->gear[g];
    const int leader = gk_spread_leader(model, g);
    const size_t cells = 2 * (size_t)(model->rolls * model->functions);
    gk_flank_tables *to = &setup->flank[g];
    *to = leader < g ? setup->flank[leader] : (gk_flank_tables){0};
    to->port = gk_bump_reals(b, cells * (size_t)model->ports);
    to->far = gear->far_rows ? gk_bump_reals(b, cells * FAR) : NULL;
    if (leader < g) return;
    to->rows = gk_bump_reals(b, cells * (size_t)gear->modes);
    to->low = gk_bump_reals(b, cells * (size_t)gear->low);
    to->node = gk_bump_reals(b, 3 * cells * 6);
    if (!gear->along_rows || !GK_ON(setup, friction)) return;
    to->along_rows = gk_bump_reals(b, cells * (size_t)gear->modes);
    to->along_low = gk_bump_reals(b, cells * (size_t)gear->low);
}

static void lay_out_base(gk_bump *b, const gk_model *model, gk_base *base, int count)
{
    base->n = count;
    const size_t n = (size_t)base->n;
    base->which = gk_bump_take(b, n * sizeof *base->which);
    base->slot = gk_bump_take(b, (size_t)model->ground[base->set].n * sizeof *base->slot);
    base->omega = gk_bump_doubles(b, n);
    base->zeta = gk_bump_doubles(b, n);
    base->omega2 = gk_bump_doubles(b, n);
    base->damper_rows = gk_bump_doubles(b, n * (size_t)model->supports);
    base->support_rows = gk_bump_doubles(b, n * (size_t)model->supports);
    base->support_damping = gk_bump_doubles(b, n * (size_t)model->supports);
    base->port_rows = gk_bump_doubles(b, n * (size_t)model->ports);
    base->sensor_rows = gk_bump_doubles(b, n * (size_t)model->sensors);
    base->carried_rows = gk_bump_doubles(b, 2 * n * (size_t)model->carried);
    const size_t pairs = (size_t)(model->carried + model->whirls);
    base->turn_rotor = gk_bump_take(b, pairs * sizeof *base->turn_rotor);
    base->turn_rows = gk_bump_doubles(b, 2 * n * pairs);
    base->turn_span = gk_bump_take(b, pairs * sizeof *base->turn_span);
    base->outward = gk_bump_doubles(b, model->carried ? n * (size_t)model->rotors : 0);
    base->outward_support = gk_bump_doubles(b, (size_t)(model->carried ? model->rotors * model->supports : 0));
    for (int g = 0; g < model->gears; g++) base->centre[g] = gk_bump_doubles(b, 6 * n);
    for (int g = 0; g < model->gears; g++)
        base->pattern[g] = gk_bump_doubles(b, model->engagements > 1 ? MOST_PATTERNS * n : 0);
    for (int g = 0; g < model->gears; g++)
        base->flanks[g] = gk_bump_reals(b, model->engagements > 1 ? MOST_PATTERNS * (n + LANES) : 0);
}

int gk_layout_by_patterns(const gk_setup *setup)
{
    return setup->mesh[1].index == 1 && !GK_ON(setup, friction) && setup->base.n >= 2 * MOST_PATTERNS;
}

static void lay_out_side(gk_bump *b, const gk_model *model, const gk_setup *setup, gk_side *side)
{
    const size_t nodes = (size_t)side->nodes + 1, strips = (size_t)setup->strips, C = (size_t)side->candidates;
    const size_t points = nodes * C * strips;
    side->rows = gk_bump_reals(b, points * (size_t)setup->modal[side->gear].n);
    side->ground = gk_bump_doubles(b, points * (size_t)setup->base.n);
    side->shares = gk_bump_doubles(b, gk_layout_by_patterns(setup) ? points * MOST_PATTERNS : 0);
    side->columns = (int)((C * strips + 3) / 4 * 4 + 4);
    side->residual = gk_bump_reals(b, 2 * nodes * C * strips * (size_t)side->columns);
    side->path = gk_bump_doubles(b, points * strips);
    side->port = gk_bump_doubles(b, points);
    side->far = gk_bump_doubles(b, gk_far_known(model, setup, side->gear) ? points * FAR : 0);
    side->support = gk_bump_doubles(b, points * (size_t)gk_padded(model->supports));
    if (!GK_ON(setup, friction)) return;
    side->along.rows = gk_bump_reals(b, points * (size_t)setup->modal[side->gear].n);
    side->along.ground = gk_bump_doubles(b, points * (size_t)setup->base.n);
    side->along.normal = gk_bump_reals(b, points * (size_t)side->columns);
    side->along.own = gk_bump_reals(b, points * (size_t)side->columns);
    side->along.support = gk_bump_doubles(b, points * (size_t)model->supports);
}

static void lay_out_nodes(gk_bump *b, const gk_model *model, const gk_gear *const pair[2], int which, gk_nodes *nodes)
{
    const gk_gear *gear = pair[which];
    const size_t along = (size_t)gear->nodes[0], across = (size_t)gear->nodes[1];
    double **array[] = {&nodes->roll, &nodes->x, &nodes->y, &nodes->length};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = gk_bump_doubles(b, along);
    nodes->grid = gk_bump_take(b, along * sizeof *nodes->grid);
    nodes->z = gk_bump_doubles(b, across);
    nodes->width = gk_bump_doubles(b, across);
    for (int w = 0; w < 2; w++) nodes->functions[w] = gk_bump_doubles(b, across * (size_t)model->functions);
    nodes->lead = gk_bump_doubles(b, 2 * across);
    for (int w = 0; w < 2; w++)
        nodes->deviation[w].depth = gk_bump_doubles(b, across ? gk_deviation_size(pair[w], (int)across) : 0);
    nodes->strip = gk_bump_take(b, across * sizeof *nodes->strip);
}

/* everything after the setup itself; returns the bytes used */
static size_t lay_out_setup(const gk_model *model, gk_setup *setup, char *base, const int *modes, int ground)
{
    gk_bump b = {base, 0};
    size_t at = 0;
    for (int g = 0; g < model->gears; g++) {
        lay_out_modal(&b, &model->gear[g], &setup->modal[g], modes[g]);
        setup->modal[g].at = at;
        at += OSCILLATOR_STATE * (size_t)setup->modal[g].n;
    }
    for (int g = 0; g < model->gears; g++)
        setup->far[g] = gk_bump_reals(&b, gk_far_known(model, setup, g) ? (size_t)model->gear[g].z * FAR * LANES : 0);
    for (int g = 0; g < model->gears; g++) lay_out_flank(&b, model, setup, g);
    lay_out_base(&b, model, &setup->base, ground);
    for (int e = 0; e < model->engagements; e++) {
        gk_mesh *mesh = &setup->mesh[e];
        const int *number = model->engagement[e].gear;
        const gk_gear *const pair[2] = {&model->gear[number[0]], &model->gear[number[1]]};
        for (int w = 0; w < 2; w++) {
            lay_out_side(&b, model, setup, &mesh->side[w]);
            lay_out_nodes(&b, model, pair, w, &mesh->nodes[w]);
            mesh->deviation[w].depth = gk_bump_doubles(&b, gk_deviation_size(pair[w], setup->strips));
        }
    }
    for (int g = 0; g < model->gears; g++) {
        const size_t cells = model->gear[g].nodes[0] ? 2 * (size_t)(POINTS * model->functions) : 0;
        setup->point_rows[g].modes = gk_bump_reals(&b, cells * (size_t)setup->modal[g].n);
        setup->point_rows[g].ground = gk_bump_reals(&b, 3 * cells * (size_t)setup->base.n);
    }
    setup->amplitudes = OSCILLATOR_STATE * (size_t)setup->base.n +
                        (at * sizeof(gk_real) + sizeof(double) - 1) / sizeof(double);
    uint32_t arrays[ARRAYS];
    gk_data_plan(model, arrays);
    setup->state_size = sizeof(gk_data) +
                        (arrays[OF_oscillator] + setup->amplitudes + (size_t)model->amplitudes) * sizeof(double);
    return b.used;
}

#define FLOW_ARRAYS(f)                                                                                                 \
    {&f->d11, &f->a12,      &f->a21,   &f->d22,        &f->b0q,  &f->b0v,  &f->bq,                                     \
     &f->bv,  &f->mobility, &f->kappa, &f->inverse_s2, &f->unit, &f->lead, &f->hold}

static void lay_out_flow(gk_bump *b, const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    for (int g = 0; g < model->gears; g++) {
        gk_flow *f = &k->flow[g];
        gk_real **array[] = FLOW_ARRAYS(f);
        for (size_t i = 0; i < sizeof array / sizeof *array; i++)
            *array[i] = gk_bump_reals(b, (size_t)setup->modal[g].n);
    }
    gk_ground_flow *f = &k->ground;
    double **array[] = FLOW_ARRAYS(f);
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = gk_bump_doubles(b, (size_t)setup->base.n);
    f->press = gk_bump_doubles(b, (size_t)setup->base.n);
    f->pulls = gk_bump_doubles(b, (size_t)model->supports * (size_t)setup->base.n);
    f->holds = gk_bump_doubles(b, (size_t)model->supports * (size_t)setup->base.n);
    const size_t turning = 2 * (size_t)(model->carried + model->whirls) * (size_t)setup->base.n;
    f->turns = gk_bump_doubles(b, turning);
    f->turned = gk_bump_doubles(b, turning);
    f->products = gk_bump_doubles(b, 3 * (size_t)(model->carried + model->whirls));
    const int pairs = model->carried + model->whirls;
    const size_t width = pairs < LEAST_CROWD ? 0 : (size_t)gk_whole_halves(setup->base.n),
                 rows = 2 * (size_t)gk_whole_halves(pairs < MOST_CROWD ? pairs : MOST_CROWD),
                 dashpots = (size_t)gk_whole_halves(model->supports);
    gk_crowd_flow *crowd = &f->crowd;
    crowd->turns = gk_bump_reals(b, width * rows), crowd->turned = gk_bump_reals(b, width * rows);
    crowd->turning = gk_bump_reals(b, width ? rows * rows : 0);
    crowd->damps = gk_bump_reals(b, width * dashpots), crowd->holds = gk_bump_reals(b, width * dashpots);
    crowd->pulls = gk_bump_reals(b, width * dashpots),
    crowd->pulled = gk_bump_reals(b, width ? dashpots * dashpots : 0);
}

static void lay_out_step(gk_bump *b, const gk_setup *setup, const gk_side *side, gk_step_side *table)
{
    const size_t points = ((size_t)side->nodes + 1) * (size_t)(side->candidates * setup->strips);
    table->moves = gk_bump_reals(b, points * 4 * (size_t)side->columns);
    table->pulls = gk_bump_doubles(b, points * 2 * (size_t)gk_common(setup));
}

void gk_layout_room(gk_bump *b, const gk_model *model, const gk_setup *setup, gk_room *room)
{
    GK_ASSERT(model && setup && room);
    size_t widest = 0, blocks;
    for (int g = 0; g < model->gears; g++)
        widest = (size_t)setup->modal[g].n > widest ? (size_t)setup->modal[g].n : widest;
    for (int i = 0; i < CACHE; i++) lay_out_flow(b, model, setup, &room->cache[i]);
    lay_out_flow(b, model, setup, &room->explicit_rows);
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) lay_out_step(b, setup, &setup->mesh[e].side[w], &room->table[e][w]);
    for (int g = 0; g < model->gears; g++)
        for (int f = 0; f < model->gears; f++)
            room->between[g][f] = gk_bump_reals(b,
                                                gk_layout_by_patterns(setup) ? 2 * MOST_PATTERNS * MOST_PATTERNS : 0);
    room->zero = gk_bump_reals(b, widest);
    room->ground_zero = gk_bump_doubles(b, (size_t)setup->base.n);
    room->spread = gk_bump_doubles(b, gk_spread_scratch(model, &blocks));
    room->blocks = gk_bump_reals(b, blocks);
}

/* ---- sizes, and places behind the heads -------------------------------------------------------------------------- */
/* all modes, most slices */
size_t gk_layout_largest(const gk_model *model, gk_setup *setup)
{
    int modes[MAX_GEARS], ground = 0;
    memset(setup, 0, sizeof *setup);
    setup->slices = MAX_SLICES;
    setup->strips = gk_strips_count(model, MAX_SLICES);
    setup->spatial = model->spatial; /* tables of joint motion are wider then: gk_common */
    setup->on.tip_contact = setup->on.friction = 1;
    for (int g = 0; g < model->gears; g++) modes[g] = model->gear[g].modes;
    for (int s = 0; s < model->sets; s++)
        if (model->ground[s].n > ground) ground = model->ground[s].n, setup->base.set = s;
    gk_layout_plan(model, setup);
    ground = gk_padded(ground) + 4 * MAX_ROTORS; /* every rotor's part is padded */
    return lay_out_setup(model, setup, NULL, modes, ground);
}

size_t gk_setup_size(const gk_model *model)
{
    gk_setup probe;
    return 128 + sizeof(gk_setup) + gk_layout_largest(model, &probe);
}

size_t gk_data_size(const gk_model *model)
{
    gk_setup probe;
    gk_layout_largest(model, &probe);
    return probe.state_size;
}

size_t gk_state_size(const gk_setup *setup)
{
    GK_ASSERT(setup && setup->state_size >= sizeof(gk_data));
    return setup->state_size;
}

void gk_layout_setup(const gk_model *model, gk_setup *setup, const int *modes, int ground)
{
    GK_ASSERT(modes && ground >= 0 && ground % 4 == 0);
    GK_ASSERT(ground <= MAX_GROUND + 4 * MAX_ROTORS);
    lay_out_setup(model, setup, gk_bump_behind(setup, sizeof *setup), modes, ground);
}
