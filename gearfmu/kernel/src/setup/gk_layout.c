/* Where everything of gk_setup and gk_work lies: one block each, arrays behind the head. */
#include "problem/gk_work.h"
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
/* memory is handed out twice with the same code: first counting (base NULL), then for real */
typedef struct bump {
    char *base;
    size_t used;
} bump;

static void *take(bump *b, size_t bytes)
{
    void *p = b->base ? b->base + b->used : NULL;
    b->used += (bytes + 63) / 64 * 64;
    return p;
}

static double *doubles(bump *b, size_t count) { return take(b, count * sizeof(double)); }
static gk_real *reals(bump *b, size_t count) { return take(b, count * sizeof(gk_real)); }

static int to_lanes(int n) { return (n + LANES - 1) / LANES * LANES; }

/* number of lanes a half needs: one a pair, one a single mode */
static int lanes_of(const gk_gear *gear, int modes)
{
    int lanes = 0;
    for (int k = 0; k < modes; k++) lanes += gear->member[k] != 2;
    return lanes;
}

static void lay_out_modal(bump *b, const gk_gear *gear, gk_modal *m, int modes)
{
    m->count = modes;
    m->pairs = to_lanes(lanes_of(gear, modes));
    m->n = 2 * m->pairs;
    const size_t n = (size_t)m->n, turns = (size_t)gear->z * (size_t)m->pairs;
    m->omega = doubles(b, n);
    m->zeta = doubles(b, n);
    m->omega2 = reals(b, n);
    m->lane = take(b, (size_t)modes * sizeof *m->lane);
    m->cosine = reals(b, turns);
    m->sine = reals(b, turns);
    m->turn_rate = reals(b, (size_t)m->pairs);
}

static void lay_out_flank(bump *b, const gk_model *model, gk_setup *setup, int g)
{
    const gk_gear *gear = &model->gear[g];
    const int leader = gk_spread_leader(model, g);
    const size_t cells = 2 * (size_t)(model->rolls * model->functions);
    gk_flank_tables *to = &setup->flank[g];
    *to = leader < g ? setup->flank[leader] : (gk_flank_tables){0};
    to->port = reals(b, cells * (size_t)model->ports);
    to->far = gear->far_rows ? reals(b, cells * FAR) : NULL;
    if (leader < g) return;
    to->rows = reals(b, cells * (size_t)gear->modes);
    to->low = reals(b, cells * (size_t)gear->low);
    to->node = reals(b, 3 * cells * 6);
    if (!gear->along_rows || !GK_ON(setup, friction)) return;
    to->along_rows = reals(b, cells * (size_t)gear->modes);
    to->along_low = reals(b, cells * (size_t)gear->low);
}

static void lay_out_base(bump *b, const gk_model *model, gk_base *base, int count)
{
    base->n = count;
    const size_t n = (size_t)base->n;
    base->which = take(b, n * sizeof *base->which);
    base->slot = take(b, (size_t)model->ground[base->set].n * sizeof *base->slot);
    base->omega = doubles(b, n);
    base->zeta = doubles(b, n);
    base->omega2 = doubles(b, n);
    base->damper_rows = doubles(b, n * (size_t)model->supports);
    base->support_rows = doubles(b, n * (size_t)model->supports);
    base->support_damping = doubles(b, n * (size_t)model->supports);
    base->port_rows = doubles(b, n * (size_t)model->ports);
    base->sensor_rows = doubles(b, n * (size_t)model->sensors);
    base->carried_rows = doubles(b, 2 * n * (size_t)model->carried);
    const size_t pairs = (size_t)(model->carried + model->whirls);
    base->turn_rotor = take(b, pairs * sizeof *base->turn_rotor);
    base->turn_rows = doubles(b, 2 * n * pairs);
    base->turn_span = take(b, pairs * sizeof *base->turn_span);
    base->outward = doubles(b, model->carried ? n * (size_t)model->rotors : 0);
    base->outward_support = doubles(b, (size_t)(model->carried ? model->rotors * model->supports : 0));
    for (int g = 0; g < model->gears; g++) base->centre[g] = doubles(b, 6 * n);
    for (int g = 0; g < model->gears; g++)
        base->pattern[g] = doubles(b, model->engagements > 1 ? MOST_PATTERNS * n : 0);
    for (int g = 0; g < model->gears; g++)
        base->flanks[g] = reals(b, model->engagements > 1 ? MOST_PATTERNS * (n + LANES) : 0);
}

/* may flanks feel the ground group by patterns? */
static int by_patterns(const gk_setup *setup)
{
    return setup->mesh[1].index == 1 && !GK_ON(setup, friction) && setup->base.n >= 2 * MOST_PATTERNS;
}

static void lay_out_side(bump *b, const gk_model *model, const gk_setup *setup, gk_side *side)
{
    const size_t nodes = (size_t)side->nodes + 1, strips = (size_t)setup->strips, C = (size_t)side->candidates;
    const size_t points = nodes * C * strips;
    side->rows = reals(b, points * (size_t)setup->modal[side->gear].n);
    side->ground = doubles(b, points * (size_t)setup->base.n);
    side->shares = doubles(b, by_patterns(setup) ? points * MOST_PATTERNS : 0);
    side->columns = (int)((C * strips + 3) / 4 * 4 + 4);
    side->residual = reals(b, 2 * nodes * C * strips * (size_t)side->columns);
    side->path = doubles(b, points * strips);
    side->port = doubles(b, points);
    side->far = doubles(b, gk_far_known(model, setup, side->gear) ? points * FAR : 0);
    side->support = doubles(b, points * (size_t)gk_padded(model->supports));
    if (!GK_ON(setup, friction)) return;
    side->along.rows = reals(b, points * (size_t)setup->modal[side->gear].n);
    side->along.ground = doubles(b, points * (size_t)setup->base.n);
    side->along.normal = reals(b, points * (size_t)side->columns);
    side->along.own = reals(b, points * (size_t)side->columns);
    side->along.support = doubles(b, points * (size_t)model->supports);
}

static void lay_out_nodes(bump *b, const gk_model *model, const gk_gear *const pair[2], int which, gk_nodes *nodes)
{
    const gk_gear *gear = pair[which];
    const size_t along = (size_t)gear->nodes[0], across = (size_t)gear->nodes[1];
    double **array[] = {&nodes->roll, &nodes->x, &nodes->y, &nodes->length};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = doubles(b, along);
    nodes->grid = take(b, along * sizeof *nodes->grid);
    nodes->z = doubles(b, across);
    nodes->width = doubles(b, across);
    for (int w = 0; w < 2; w++) nodes->functions[w] = doubles(b, across * (size_t)model->functions);
    nodes->lead = doubles(b, 2 * across);
    for (int w = 0; w < 2; w++)
        nodes->deviation[w].depth = doubles(b, across ? gk_deviation_size(pair[w], (int)across) : 0);
    nodes->strip = take(b, across * sizeof *nodes->strip);
}

/* everything after the setup itself; returns the bytes used */
static size_t lay_out_setup(const gk_model *model, gk_setup *setup, char *base, const int *modes, int ground)
{
    bump b = {base, 0};
    size_t at = 0;
    for (int g = 0; g < model->gears; g++) {
        lay_out_modal(&b, &model->gear[g], &setup->modal[g], modes[g]);
        setup->modal[g].at = at;
        at += OSCILLATOR_STATE * (size_t)setup->modal[g].n;
    }
    for (int g = 0; g < model->gears; g++)
        setup->far[g] = reals(&b, gk_far_known(model, setup, g) ? (size_t)model->gear[g].z * FAR * LANES : 0);
    for (int g = 0; g < model->gears; g++) lay_out_flank(&b, model, setup, g);
    lay_out_base(&b, model, &setup->base, ground);
    for (int e = 0; e < model->engagements; e++) {
        gk_mesh *mesh = &setup->mesh[e];
        const int *number = model->engagement[e].gear;
        const gk_gear *const pair[2] = {&model->gear[number[0]], &model->gear[number[1]]};
        for (int w = 0; w < 2; w++) {
            lay_out_side(&b, model, setup, &mesh->side[w]);
            lay_out_nodes(&b, model, pair, w, &mesh->nodes[w]);
            mesh->deviation[w].depth = doubles(&b, gk_deviation_size(pair[w], setup->strips));
        }
    }
    for (int g = 0; g < model->gears; g++) {
        const size_t cells = model->gear[g].nodes[0] ? 2 * (size_t)(POINTS * model->functions) : 0;
        setup->point_rows[g].modes = reals(&b, cells * (size_t)setup->modal[g].n);
        setup->point_rows[g].ground = reals(&b, 3 * cells * (size_t)setup->base.n);
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

static void lay_out_flow(bump *b, const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    for (int g = 0; g < model->gears; g++) {
        gk_flow *f = &k->flow[g];
        gk_real **array[] = FLOW_ARRAYS(f);
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = reals(b, (size_t)setup->modal[g].n);
    }
    gk_ground_flow *f = &k->ground;
    double **array[] = FLOW_ARRAYS(f);
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = doubles(b, (size_t)setup->base.n);
    f->press = doubles(b, (size_t)setup->base.n);
    f->pulls = doubles(b, (size_t)model->supports * (size_t)setup->base.n);
    f->holds = doubles(b, (size_t)model->supports * (size_t)setup->base.n);
    const size_t turning = 2 * (size_t)(model->carried + model->whirls) * (size_t)setup->base.n;
    f->turns = doubles(b, turning);
    f->turned = doubles(b, turning);
    f->products = doubles(b, 3 * (size_t)(model->carried + model->whirls));
    const int pairs = model->carried + model->whirls;
    const size_t width = pairs < LEAST_CROWD ? 0 : (size_t)gk_whole_halves(setup->base.n),
                 rows = 2 * (size_t)gk_whole_halves(pairs < MOST_CROWD ? pairs : MOST_CROWD),
                 dashpots = (size_t)gk_whole_halves(model->supports);
    gk_crowd_flow *crowd = &f->crowd;
    crowd->turns = reals(b, width * rows), crowd->turned = reals(b, width * rows);
    crowd->turning = reals(b, width ? rows * rows : 0);
    crowd->damps = reals(b, width * dashpots), crowd->holds = reals(b, width * dashpots);
    crowd->pulls = reals(b, width * dashpots), crowd->pulled = reals(b, width ? dashpots * dashpots : 0);
}

static void lay_out_engaged(bump *b, const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e)
{
    const size_t contacts = MAX_PAIRS * (size_t)setup->strips, rows = contacts + MAX_JOINTS + 4;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        const size_t points = (size_t)(side->candidates * setup->strips), n = (size_t)setup->modal[side->gear].n;
        engaged->basis[w] = reals(b, contacts * n);
        engaged->table[w].moves = reals(b, ((size_t)side->nodes + 1) * points * 4 * (size_t)side->columns);
        engaged->table[w].pulls = doubles(b, ((size_t)side->nodes + 1) * points * 2 * (size_t)gk_common(setup));
        engaged->far[w] = reals(b, gk_far_known(model, setup, side->gear) ? contacts * LANES : 0);
    }
    engaged->ground = doubles(b, rows * (size_t)setup->base.n);
    engaged->near = reals(b, model->engagements > 1 ? rows * ((size_t)setup->base.n + 2 * LANES) : 0);
    engaged->index = e;
    engaged->matrix = doubles(b, 6 * rows * rows);
    const size_t several = model->engagements > 1 ? rows * rows : 0;
    engaged->rest = doubles(b, several);
    engaged->kept.D = doubles(b, several), engaged->kept.K = doubles(b, several);
    engaged->kept.n = -1;
    if (!GK_ON(setup, friction)) return;
    gk_glide *glide = engaged->glide = take(b, sizeof *glide);
    gk_glide counted, *of = glide ? glide : &counted;
    memset(of, 0, sizeof *of);
    for (int w = 0; w < 2; w++) of->basis[w] = reals(b, contacts * (size_t)setup->modal[setup->mesh[e].side[w].gear].n);
    of->ground = doubles(b, rows * (size_t)setup->base.n);
    of->near = reals(b, model->engagements > 1 ? rows * ((size_t)setup->base.n + 2 * LANES) : 0);
    of->matrix = doubles(b, 8 * rows * rows);
    of->small = doubles(b, 2 * rows * rows);
    const size_t modes = (size_t)setup->modal[setup->mesh[e].side[0].gear].n +
                         (size_t)setup->modal[setup->mesh[e].side[1].gear].n;
    of->lanes = reals(b, (2 * rows + 4) * (modes + (size_t)setup->mesh[e].local + 2 * LANES));
}

/* pairs of teeth that may feel each other as far teeth, at most */
static int far_pairs(const gk_model *model, const gk_setup *setup)
{
    int count = 0;
    for (int g = 0; g < model->gears; g++) {
        const int n = setup->engagements_of[g];
        if (gk_far_known(model, setup, g)) count += n * (n - 1) * MAX_PAIRS * MAX_PAIRS;
    }
    return count;
}

static size_t lay_out_work(const gk_model *model, const gk_setup *setup, gk_work *work, char *base)
{
    bump b = {base, 0};
    size_t widest = 0, most = 0;
    const size_t ground = (size_t)setup->base.n;
    for (int g = 0; g < model->gears; g++) {
        const size_t n = (size_t)setup->modal[g].n;
        gk_real **array[] = {&work->qp[g],
                             &work->vp[g],
                             &work->force[g],
                             &work->next[g],
                             &work->reading[g],
                             &work->move_modes[WHOLE][g],
                             &work->move_modes[YIELDED][g]};
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = reals(&b, n);
        work->turned_speed[g] = doubles(&b, n);
        for (int i = 0; i < 7; i++) work->stage[g][i] = reals(&b, 2 * n);
        work->trial[g] = reals(&b, 2 * n);
        widest = n > widest ? n : widest;
        most = (size_t)model->gear[g].modes > most ? (size_t)model->gear[g].modes : most;
    }
    work->turned = reals(&b, widest), work->turned_next = reals(&b, widest), work->zero = reals(&b, widest);
    work->scaled = reals(&b, 2 * widest);
    double **array[] = {&work->ground_q,       &work->ground_v,    &work->ground_force, &work->ground_next,
                        &work->ground_reading, &work->ground_zero, &work->ground_start};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = doubles(&b, ground);
    work->ground_scaled = doubles(&b, 2 * ground);
    for (int i = 0; i < 7; i++) work->ground_stage[i] = doubles(&b, 2 * ground);
    work->ground_trial = doubles(&b, 2 * ground);
    for (int i = 0; i < CACHE; i++) lay_out_flow(&b, model, setup, &work->cache[i]);
    lay_out_flow(&b, model, setup, &work->explicit_rows);
    work->engaged = take(&b, (size_t)model->engagements * sizeof *work->engaged);
    for (int e = 0; e < model->engagements; e++) {
        gk_engaged counted;
        lay_out_engaged(&b, model, setup, work->engaged ? &work->engaged[e] : &counted, e);
    }
    work->tally = doubles(&b, 6 * ground);
    work->pushed = doubles(&b, (size_t)model->ground[setup->base.set].n + most);
    work->mode_row = doubles(&b, most);
    work->rest_ground = doubles(&b, ground);
    size_t unknowns = (size_t)(model->rotors + 2 * model->chains) + ground;
    for (int g = 0; g < model->gears; g++) {
        const int shared = setup->engagements_of[g] > 1;
        work->rest_modes[g] = reals(&b, shared ? (size_t)setup->modal[g].n : 0);
        unknowns += shared ? MAX_SOFT : 0;
    }
    work->rest = doubles(&b, (2 + unknowns) * unknowns);
    work->soft_rows = doubles(&b, model->engagements > 1 ? 2 * MAX_ROWS * MAX_SOFT : 0);
    work->columns = doubles(&b, gk_side_scratch(model) +
                                    (size_t)(model->engagements * LIMIT_POSITIONS) * MAX_STRIDE * MAX_STRIDE);
    size_t blocks;
    work->spread = doubles(&b, gk_spread_scratch(model, &blocks));
    work->blocks = reals(&b, blocks);
    const size_t rows = (size_t)model->engagements * (MAX_PAIRS * (size_t)setup->strips + MAX_JOINTS);
    work->island = doubles(&b, 2 * rows * rows);
    work->most_far_pairs = far_pairs(model, setup);
    work->far_pair = take(&b, (size_t)work->most_far_pairs * sizeof *work->far_pair);
    for (int t = 0; t < PUSHES; t++) work->push_ground[t] = reals(&b, ground + LANES);
    for (int t = 0; t < MOVES; t++) work->move_ground[t] = reals(&b, ground + LANES);
    for (int g = 0; g < model->gears; g++)
        for (int f = 0; f < model->gears; f++)
            work->between[g][f] = reals(&b, by_patterns(setup) ? 2 * MOST_PATTERNS * MOST_PATTERNS : 0);
    for (int w = 0; w < 2; w++) {
        gk_real **of_field[] = {&work->field[w].q, &work->field[w].v, &work->field[w].f};
        for (int i = 0; i < 3; i++) *of_field[i] = reals(&b, widest);
    }
    return b.used;
}

/* ---- sizes, and places behind the heads -------------------------------------------------------------------------- */
/* the largest setup of a model: all modes, most slices */
static size_t largest(const gk_model *model, gk_setup *setup)
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
    return 128 + sizeof(gk_setup) + largest(model, &probe);
}

size_t gk_work_size(const gk_model *model)
{
    gk_setup probe;
    gk_work nothing;
    largest(model, &probe);
    return 128 + sizeof(gk_work) + lay_out_work(model, &probe, &nothing, NULL);
}

size_t gk_data_size(const gk_model *model)
{
    gk_setup probe;
    largest(model, &probe);
    return probe.state_size;
}

size_t gk_state_size(const gk_setup *setup)
{
    GK_ASSERT(setup && setup->state_size >= sizeof(gk_data));
    return setup->state_size;
}

static char *behind(void *block, size_t size) { return (char *)(((uintptr_t)block + size + 63) / 64 * 64); }

/* modes: dynamic ones of every gear; ground: dynamic ground oscillators, padded */
void gk_layout_setup(const gk_model *model, gk_setup *setup, const int *modes, int ground)
{
    GK_ASSERT(modes && ground >= 0 && ground % 4 == 0);
    GK_ASSERT(ground <= MAX_GROUND + 4 * MAX_ROTORS);
    lay_out_setup(model, setup, behind(setup, sizeof *setup), modes, ground);
}

void gk_layout_work(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    GK_ASSERT(model && setup && work);
    GK_ASSERT(setup->base.n % 4 == 0);
    lay_out_work(model, setup, work, behind(work, sizeof *work));
}
