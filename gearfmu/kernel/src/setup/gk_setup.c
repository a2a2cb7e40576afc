/* Level, effects, slices and step → gk_setup: which oscillators are dynamic, and their tables. */
#include "problem/gk_work.h"
#include "integrate/gk_integrate.h"
#include <stdio.h>

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

static int padded(int n) { return (n + LANES - 1) / LANES * LANES; }

/* number of lanes a half needs: one a pair, one a single mode */
static int lanes_of(const gk_gear *gear, int modes)
{
    int lanes = 0;
    for (int k = 0; k < modes; k++) lanes += gear->member[k] != 2;
    return lanes;
}

static int share_rotor(const gk_model *model, const gk_engagement *a, const gk_engagement *b)
{
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            if (model->gear[a->gear[i]].rotor == model->gear[b->gear[j]].rotor) return 1;
    return gk_frame_of(model, a) >= 0 && gk_frame_of(model, a) == gk_frame_of(model, b);
}

/* Engagements that share a rotor belong to one island */
static void find_islands(const gk_model *model, gk_setup *setup)
{
    for (int e = 0; e < model->engagements; e++) setup->mesh[e].island = -1;
    setup->islands = 0;
    for (int root = 0; root < model->engagements; root++) {
        if (setup->mesh[root].island >= 0) continue;
        setup->mesh[root].island = setup->islands;
        for (int changed = 1; changed;) {
            changed = 0;
            for (int a = 0; a < model->engagements; a++)
                for (int b = 0; b < model->engagements; b++) {
                    if (setup->mesh[a].island != setup->islands || setup->mesh[b].island >= 0) continue;
                    if (!share_rotor(model, &model->engagement[a], &model->engagement[b])) continue;
                    setup->mesh[b].island = setup->islands;
                    changed = 1;
                }
        }
        setup->islands++;
    }
}

static void count_engagements(const gk_model *model, gk_setup *setup)
{
    for (int g = 0; g < model->gears; g++) setup->engagements_of[g] = 0;
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) setup->engagements_of[model->engagement[e].gear[w]]++;
}

/* ---- layout ------------------------------------------------------------------------------------------------------ */
static void lay_out_modal(bump *b, const gk_gear *gear, gk_modal *m, int modes)
{
    m->count = modes;
    m->pairs = padded(lanes_of(gear, modes));
    m->n = 2 * m->pairs;
    const size_t n = (size_t)m->n, turns = (size_t)gear->z * (size_t)m->pairs;
    m->omega = doubles(b, n);
    m->zeta = doubles(b, n);
    m->omega2 = reals(b, n);
    m->lane = take(b, (size_t)modes * sizeof *m->lane);
    m->cosine = reals(b, turns);
    m->sine = reals(b, turns);
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
    base->damper_rows = doubles(b, n * (size_t)model->dampers);
    base->support_rows = doubles(b, n * (size_t)model->supports);
    base->port_rows = doubles(b, n * (size_t)model->ports);
    base->carried_rows = doubles(b, 2 * n * (size_t)model->carried);
    base->outward = doubles(b, model->carried ? n * (size_t)model->rotors : 0);
    base->outward_support = doubles(b, (size_t)(model->carried ? model->rotors * model->supports : 0));
    for (int g = 0; g < model->gears; g++) base->centre[g] = doubles(b, 6 * n);
}

static void lay_out_side(bump *b, const gk_model *model, const gk_setup *setup, gk_side *side)
{
    const size_t nodes = (size_t)side->nodes + 1, strips = (size_t)setup->strips, C = (size_t)side->candidates;
    const size_t points = nodes * C * strips;
    side->rows = reals(b, points * (size_t)setup->modal[side->gear].n);
    side->ground = doubles(b, points * (size_t)setup->base.n);
    side->columns = (int)((C * strips + 3) / 4 * 4 + 4);
    side->residual = reals(b, 2 * nodes * C * strips * (size_t)side->columns);
    side->path = doubles(b, points * strips);
    side->port = doubles(b, points);
    side->support = doubles(b, points * (size_t)gk_padded(model->supports));
}

static void lay_out_nodes(bump *b, const gk_model *model, const gk_gear *gear, gk_nodes *nodes)
{
    const size_t along = (size_t)gear->nodes[0], across = (size_t)gear->nodes[1];
    double **array[] = {&nodes->roll, &nodes->x, &nodes->y, &nodes->length};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = doubles(b, along);
    nodes->grid = take(b, along * sizeof *nodes->grid);
    nodes->z = doubles(b, across);
    nodes->width = doubles(b, across);
    for (int w = 0; w < 2; w++) nodes->functions[w] = doubles(b, across * (size_t)model->functions);
    nodes->lead = doubles(b, 2 * across);
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
        at += 3 * (size_t)setup->modal[g].n;
    }
    lay_out_base(&b, model, &setup->base, ground);
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) {
            lay_out_side(&b, model, setup, &setup->mesh[e].side[w]);
            lay_out_nodes(&b, model, &model->gear[model->engagement[e].gear[w]], &setup->mesh[e].nodes[w]);
        }
    for (int g = 0; g < model->gears; g++) {
        const size_t cells = model->gear[g].nodes[0] ? 2 * (size_t)(POINTS * model->functions) : 0;
        setup->point_rows[g].modes = reals(&b, cells * (size_t)setup->modal[g].n);
        setup->point_rows[g].ground = reals(&b, 3 * cells * (size_t)setup->base.n);
    }
    setup->amplitudes = 3 * (size_t)setup->base.n + (at * sizeof(gk_real) + sizeof(double) - 1) / sizeof(double);
    setup->state_size = sizeof(gk_data) + (setup->amplitudes + (size_t)model->amplitudes) * sizeof(double);
    return b.used;
}

static void lay_out_flow(bump *b, const gk_model *model, const gk_setup *setup, gk_coefficients *k)
{
    for (int g = 0; g < model->gears; g++) {
        gk_flow *f = &k->flow[g];
        gk_real **array[] = {&f->d11, &f->a12,      &f->a21,    &f->d22,    &f->b0q,   &f->b0v,       &f->bq,
                             &f->bv,  &f->mobility, &f->read_q, &f->read_v, &f->kappa, &f->inverse_s2};
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = reals(b, (size_t)setup->modal[g].n);
    }
    gk_ground_flow *f = &k->ground;
    double **array[] = {&f->d11, &f->a12,      &f->a21,    &f->d22,    &f->b0q,   &f->b0v,       &f->bq,
                        &f->bv,  &f->mobility, &f->read_q, &f->read_v, &f->kappa, &f->inverse_s2};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = doubles(b, (size_t)setup->base.n);
    f->pulls = doubles(b, (size_t)model->dampers * (size_t)setup->base.n);
    f->turns = doubles(b, 2 * (size_t)model->carried * (size_t)setup->base.n);
    f->turned = doubles(b, 2 * (size_t)model->carried * (size_t)setup->base.n);
    f->coupling = doubles(b, 4 * (size_t)(model->carried * model->carried));
}

static void lay_out_engaged(bump *b, const gk_setup *setup, gk_engaged *engaged, int e)
{
    const size_t contacts = MAX_PAIRS * (size_t)setup->strips, rows = contacts + MAX_JOINTS + 4;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        const size_t points = (size_t)(side->candidates * setup->strips);
        engaged->basis[w] = reals(b, contacts * (size_t)setup->modal[side->gear].n);
        const int shared = setup->engagements_of[side->gear] > 1;
        engaged->given_modes[w] = reals(b, shared ? (size_t)setup->modal[side->gear].n : 0);
        engaged->table[w].moves = reals(b, ((size_t)side->nodes + 1) * points * 4 * (size_t)side->columns);
        engaged->table[w].pulls = doubles(b, ((size_t)side->nodes + 1) * points * 2 * (size_t)gk_common(setup));
    }
    engaged->ground = doubles(b, rows * (size_t)setup->base.n);
    engaged->index = e;
    engaged->matrix = doubles(b, 6 * rows * rows);
    engaged->given_ground = doubles(b, (size_t)setup->base.n);
}

static size_t lay_out_work(const gk_model *model, const gk_setup *setup, gk_work *work, char *base)
{
    bump b = {base, 0};
    size_t widest = 0;
    const size_t ground = (size_t)setup->base.n;
    for (int g = 0; g < model->gears; g++) {
        const size_t n = (size_t)setup->modal[g].n;
        gk_real **array[] = {&work->qp[g], &work->vp[g], &work->force[g], &work->next[g], &work->reading[g]};
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = reals(&b, n);
        for (int i = 0; i < 7; i++) work->stage[g][i] = reals(&b, 2 * n);
        work->trial[g] = reals(&b, 2 * n);
        widest = n > widest ? n : widest;
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
        lay_out_engaged(&b, setup, work->engaged ? &work->engaged[e] : &counted, e);
    }
    work->rest_ground = doubles(&b, ground);
    size_t unknowns = (size_t)(model->rotors + 2 * model->chains) + ground;
    for (int g = 0; g < model->gears; g++) {
        const int shared = setup->engagements_of[g] > 1;
        work->rest_modes[g] = reals(&b, shared ? (size_t)setup->modal[g].n : 0);
        unknowns += shared ? MAX_SOFT : 0;
    }
    work->rest = doubles(&b, (2 + unknowns) * unknowns);
    work->columns = doubles(&b, gk_side_scratch(model));
    work->sum_ground = doubles(&b, ground);
    for (int w = 0; w < 2; w++) {
        gk_real **of_field[] = {&work->field[w].q, &work->field[w].v, &work->field[w].f};
        for (int i = 0; i < 3; i++) *of_field[i] = reals(&b, widest);
    }
    return b.used;
}

/* the largest setup of a model: all modes, most slices */
static size_t largest(const gk_model *model, gk_setup *setup)
{
    int modes[MAX_GEARS], ground = 0;
    memset(setup, 0, sizeof *setup);
    setup->slices = MAX_SLICES;
    setup->strips = gk_strips_count(model, MAX_SLICES);
    setup->spatial = model->spatial; /* tables of joint motion are wider then: gk_common */
    setup->on.tip_contact = 1;
    for (int g = 0; g < model->gears; g++) modes[g] = model->gear[g].modes;
    for (int s = 0; s < model->sets; s++)
        if (model->ground[s].n > ground) ground = model->ground[s].n, setup->base.set = s;
    find_islands(model, setup);
    count_engagements(model, setup);
    ground = (ground + 3) / 4 * 4 + 4 * MAX_ROTORS; /* every rotor's part is padded */
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) gk_side_plan(model, setup, e, &setup->mesh[e].side[w], w);
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

size_t gk_state_size(const gk_setup *setup) { return setup->state_size; }

/* ---- which oscillators are dynamic ------------------------------------------------------------------------------- */
/* number of modes below the wished cut, moved to the widest relative gap within 15 %: never inside a cluster, never
 * inside a pair */
static int modes_below(const gk_gear *gear, double cut_hz)
{
    double cut = 2.0 * GK_PI * cut_hz, widest = 0.0;
    int best = 0;
    while (best < gear->modes && gear->omega[best] < cut) best++;
    if (best == gear->modes) return best;
    for (int k = 1; k < gear->modes; k++) {
        if (gear->member[k] == 2 || gear->omega[k] < 0.85 * cut || gear->omega[k - 1] > 1.15 * cut) continue;
        double gap = gear->omega[k] / gear->omega[k - 1] - 1.0;
        if (gap > widest) widest = gap, best = k;
    }
    if (best < gear->modes && gear->member[best] == 2) best++;
    return best;
}

/* Modes below a share of the cut of level fast by which engagements of one gear feel each other (the ovals of a ring
 * between planets) are dynamic at every level: what is static is known within an engagement alone. */
static const double SHARED_BELOW = 0.25;

static int modes_at_level(const gk_model *model, const gk_setup *setup, int g)
{
    const gk_gear *gear = &model->gear[g];
    switch (setup->level) {
    case LEVEL_RIGID: return setup->engagements_of[g] > 1 ? modes_below(gear, SHARED_BELOW * model->cut[0]) : 0;
    case LEVEL_FAST: return modes_below(gear, model->cut[0]);
    case LEVEL_STANDARD: return modes_below(gear, model->cut[1]);
    default: return gear->modes;
    }
}

/* what moves rigidly is dynamic at every level; of the rest what lies below the cut. Rigid gears whose bores are
 * held do not move. */
static int is_dynamic(const gk_model *model, const gk_setup *setup, int k)
{
    const gk_ground *ground = &model->ground[setup->base.set];
    if (!setup->on.elastic && !setup->on.bearings) return 0;
    if (ground->rigid_share[k] > 0.5) return 1;
    if (!setup->on.elastic || setup->level == LEVEL_RIGID) return 0;
    if (setup->level != LEVEL_FAST && setup->level != LEVEL_STANDARD) return 1;
    return ground->omega[k] < 2.0 * GK_PI * model->cut[setup->level == LEVEL_STANDARD];
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
static int list_ground(const gk_model *model, const gk_setup *setup, int32_t *which)
{
    int n = 0;
    for (int r = 0; r < model->rotors; r++) {
        for (int k = 0; k < model->ground[setup->base.set].n; k++)
            if (is_dynamic(model, setup, k) && rotor_of(model, setup->base.set, k) == r) which[n++] = k;
        while (n % 4) which[n++] = -1;
    }
    return n;
}

/* ---- filling ----------------------------------------------------------------------------------------------------- */
static void fill_modal(const gk_gear *gear, gk_modal *m)
{
    const int P = m->pairs, n = m->n;
    int lane = -1;
    memset(m->omega, 0, (size_t)n * sizeof(double));
    memset(m->zeta, 0, (size_t)n * sizeof(double));
    memset(m->omega2, 0, (size_t)n * sizeof(gk_real));
    memset(m->cosine, 0, (size_t)gear->z * (size_t)P * sizeof(gk_real));
    memset(m->sine, 0, (size_t)gear->z * (size_t)P * sizeof(gk_real));
    for (int k = 0; k < m->count; k++) {
        if (gear->member[k] != 2) lane++;
        const int to = gear->member[k] == 2 ? P + lane : lane;
        m->lane[k] = to;
        m->omega[to] = gear->omega[k];
        m->omega2[to] = (gk_real)(gear->omega[k] * gear->omega[k]);
        m->zeta[to] = gear->zeta[k];
        for (int j = 0; j < gear->z && gear->member[k] != 2; j++) {
            double sine, cosine;
            gk_sincos(2.0 * GK_PI * (double)((int64_t)gear->diameter[k] * j % gear->z) / gear->z, &sine, &cosine);
            m->cosine[(size_t)j * (size_t)P + (size_t)lane] = (gk_real)cosine;
            m->sine[(size_t)j * (size_t)P + (size_t)lane] = gear->member[k] == 0 ? 0 : (gk_real)sine;
        }
    }
}

/* the dynamic columns of rows over all ground oscillators */
static void select_rows(const gk_base *base, const double *rows, int count, int all, double *out)
{
    for (int i = 0; i < count; i++)
        for (int k = 0; k < base->n; k++)
            out[i * base->n + k] = base->which[k] >= 0 ? rows[i * all + base->which[k]] : 0.0;
}

/* rigid motion of a gear by the dynamic oscillators, and the part of them that it reads */
static void fill_centre(const gk_model *model, gk_base *base, int directions, int g)
{
    const gk_gear *gear = &model->gear[g];
    const int reads = gear->ground[base->set].reads;
    int from = base->n, to = 0;
    memset(base->centre[g], 0, 6 * (size_t)base->n * sizeof(double));
    for (int k = 0; k < reads; k++) {
        const int slot = base->slot[gear->ground[base->set].list[k]];
        if (slot < 0) continue;
        from = slot < from ? slot : from, to = slot >= to ? slot + 1 : to;
        for (int c = 0; c < 6; c++) base->centre[g][c * base->n + slot] = gear->ground[base->set].centre[c * reads + k];
    }
    base->from[g] = from < to ? from / 4 * 4 : 0;
    base->width[g] = from < to ? (to + 3) / 4 * 4 - base->from[g] : 0;
    base->motions[g] = 0;
    for (int c = 0; c < SPACE; c++) {
        const double *moved = base->centre[g] + GK_RIGID_ROW[c] * base->n + base->from[g];
        double size = 0.0;
        for (int k = 0; k < base->width[g]; k++) size += fabs(moved[k]);
        base->moved[g][c] = moved;
        if (size > 0.0 && c < directions) base->motion[g][base->motions[g]++] = c;
    }
}

static gk_span span_of(const double *row, int n)
{
    int from = n, to = 0;
    for (int k = 0; k < n; k++)
        if (row[k] != 0.0) from = k < from ? k : from, to = k + 1;
    return from < to ? (gk_span){from / 4 * 4, (to + 3) / 4 * 4 - from / 4 * 4} : (gk_span){0, 0};
}

/* what turns with rotors: rows of the masses, and the load outward */
static void fill_carried(const gk_model *model, gk_base *base)
{
    const gk_ground *ground = &model->ground[base->set];
    if (!model->carried) return;
    select_rows(base, ground->carried_rows, 2 * model->carried, ground->n, base->carried_rows);
    memset(base->outward, 0, (size_t)(model->rotors * base->n) * sizeof *base->outward);
    for (int i = 0; i < 2 * model->carried; i++)
        gk_axpy(model->carried_place[i], base->carried_rows + i * base->n,
                base->outward + model->carried_frame[i / 2] * base->n, 0, base->n / 4);
    memset(base->outward_support, 0, (size_t)(model->rotors * model->supports) * sizeof *base->outward_support);
    for (int k = 0; k < ground->n; k++)
        for (int i = 0; i < 2 * model->carried && base->slot[k] < 0; i++) {
            const double q = model->carried_place[i] * ground->carried_rows[i * ground->n + k] /
                             (ground->omega[k] * ground->omega[k]);
            double *to = base->outward_support + model->carried_frame[i / 2] * model->supports;
            for (int s = 0; s < model->supports && q != 0.0; s++)
                for (int t = 0; t < model->supports; t++)
                    to[s] += ground->kappa[s * model->supports + t] * ground->support_rows[t * ground->n + k] * q;
        }
}

static void fill_base(const gk_model *model, gk_setup *setup, const int32_t *which)
{
    gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    for (int k = 0; k < ground->n; k++) base->slot[k] = -1;
    for (int i = 0; i < base->n; i++) {
        base->which[i] = which[i];
        if (which[i] >= 0) base->slot[which[i]] = i, base->count++;
    }
    select_rows(base, ground->omega, 1, ground->n, base->omega);
    select_rows(base, ground->zeta, 1, ground->n, base->zeta);
    for (int i = 0; i < base->n; i++) base->omega2[i] = base->omega[i] * base->omega[i];
    select_rows(base, ground->damper_rows, model->dampers, ground->n, base->damper_rows);
    select_rows(base, ground->port_rows, model->ports, ground->n, base->port_rows);
    fill_carried(model, base);
    for (int s = 0; s < model->supports; s++) /* the force there: κ times the displacement */
        for (int k = 0; k < base->n; k++) {
            double sum = 0.0;
            for (int t = 0; t < model->supports && which[k] >= 0; t++)
                sum += ground->kappa[s * model->supports + t] * ground->support_rows[t * ground->n + which[k]];
            base->support_rows[s * base->n + k] = sum;
        }
    for (int d = 0; d < model->dampers; d++) base->damper_span[d] = span_of(base->damper_rows + d * base->n, base->n);
    for (int s = 0; s < model->supports; s++)
        base->support_span[s] = span_of(base->support_rows + s * base->n, base->n);
    for (int p = 0; p < model->ports; p++) base->port_span[p] = span_of(base->port_rows + p * base->n, base->n);
    for (int g = 0; g < model->gears; g++) fill_centre(model, base, gk_directions(setup), g);
}

static gk_span hull(gk_span a, gk_span b)
{
    if (!a.width || !b.width) return a.width ? a : b;
    const int from = a.from < b.from ? a.from : b.from;
    const int to = a.from + a.width > b.from + b.width ? a.from + a.width : b.from + b.width;
    return (gk_span){from, to - from};
}

static int meet(gk_span a, gk_span b)
{
    return a.width && b.width && a.from < b.from + b.width && b.from < a.from + a.width;
}

/* the parts of the ground group that the rows of an engagement read: its gears, and the ports among its joints */
static void fill_parts(const gk_model *model, const gk_base *base, gk_mesh *mesh)
{
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear;
        mesh->part[w] = (gk_span){base->from[g], base->width[g]};
        for (int p = 0; p < mesh->ports; p++)
            if (gk_port_of(model, g) == mesh->port[p])
                mesh->part[w] = hull(mesh->part[w], base->port_span[mesh->port[p]]);
    }
    gk_span *a = &mesh->part[0], *b = &mesh->part[1];
    mesh->joined = meet(*a, *b);
    if (mesh->joined) *a = hull(*a, *b), *b = (gk_span){0, 0};
    mesh->local = a->width + b->width;
    mesh->at[0] = base->from[mesh->side[0].gear] - a->from;
    mesh->at[1] = base->from[mesh->side[1].gear] - (b->width ? b->from - a->width : a->from);
}

static void add_joint(gk_setup *setup, int port, int which, int live, double k, double c)
{
    setup->joint[port][which] = (gk_joint){live, live && k > 0.0 ? 1.0 / k : 0.0, live ? c : 0.0};
}

/* residual of the bore angle: of the free body, less what the supports answer, plus the ground oscillators that are not
 * dynamic */
static double bore_residual(const gk_model *model, const gk_setup *setup, int p)
{
    const gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    const double *to = model->port_support + p * model->supports, *row = ground->port_rows + p * ground->n;
    double sum = model->port_residual[p * model->ports + p];
    if (!setup->on.residual) return 0.0;
    for (int s = 0; s < model->supports; s++)
        for (int t = 0; t < model->supports; t++) sum -= to[s] * ground->kappa[s * model->supports + t] * to[t];
    for (int k = 0; k < ground->n; k++)
        if (base->slot[k] < 0) sum += row[k] * row[k] / (ground->omega[k] * ground->omega[k]);
    return sum;
}

/* what a moment at the port does at once to the forces on the supports */
static void fill_port_support(const gk_model *model, gk_setup *setup, int p)
{
    const gk_ground *ground = &model->ground[setup->base.set];
    const double *row = ground->port_rows + p * ground->n;
    double moved[MAX_SUPPORTS];
    for (int s = 0; s < model->supports; s++) {
        moved[s] = setup->on.residual ? model->port_support[p * model->supports + s] : 0.0;
        for (int k = 0; k < ground->n && setup->on.residual; k++)
            if (setup->base.slot[k] < 0)
                moved[s] += ground->support_rows[s * ground->n + k] * row[k] / (ground->omega[k] * ground->omega[k]);
    }
    for (int s = 0; s < model->supports; s++) {
        setup->port_support[p][s] = 0.0;
        for (int t = 0; t < model->supports; t++)
            setup->port_support[p][s] += ground->kappa[s * model->supports + t] * moved[t];
    }
}

static void fill_ports(const gk_model *model, gk_setup *setup)
{
    setup->spins = model->rotors + 2 * model->chains;
    for (int r = 0; r < model->rotors; r++)
        setup->inverse_inertia[r] = model->inertia[r] > 0.0 ? 1.0 / model->inertia[r] : 0.0;
    for (int p = 0; p < model->ports; p++) {
        const gk_port *port = &model->port[p];
        const int torque = port->kind == PORT_TORQUE;
        setup->chained[p] = port->chain > 0;
        setup->given_torque[p] = torque;
        add_joint(setup, p, JOINT_PORT, 1, torque ? 0.0 : port->k, torque ? 0.0 : port->c);
        add_joint(setup, p, JOINT_SHAFT, port->chain > 0, port->shaft_k, port->shaft_c);
        add_joint(setup, p, JOINT_CLUTCH, port->chain > 0, 0.0, 0.0);
        setup->clutches += port->chain > 0;
        setup->port_own[p] = bore_residual(model, setup, p);
        fill_port_support(model, setup, p);
        if (!port->chain) continue;
        setup->inverse_inertia[gk_inertia_of(model, p)] = 1.0 / port->inertia;
        setup->inverse_inertia[gk_disc_of(model, p)] = 1.0 / port->disc;
    }
}

/* ports of the rotors that this engagement is the first to engage, and the spins that its rows read */
static void fill_spins(const gk_model *model, gk_mesh *mesh)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    mesh->spins = 2;
    for (int w = 0; w < 2; w++) mesh->spin[w] = model->gear[e->gear[w]].rotor;
    mesh->frame = gk_frame_of(model, e);
    if (mesh->frame >= 0) mesh->spin[mesh->spins++] = mesh->frame;
    for (int p = 0; p < model->ports; p++) {
        int first = -1;
        for (int i = 0; i < model->engagements && first < 0; i++)
            for (int w = 0; w < 2; w++)
                if (gk_port_of(model, model->engagement[i].gear[w]) == p) first = i;
        if (first != mesh->index || mesh->ports == 2) continue;
        const int slot = mesh->ports++;
        mesh->port[slot] = p;
        mesh->joint_spin[slot][0] = mesh->joint_spin[slot][1] = -1;
        if (!model->port[p].chain) continue;
        mesh->joint_spin[slot][0] = mesh->spins, mesh->spin[mesh->spins++] = gk_inertia_of(model, p);
        mesh->joint_spin[slot][1] = mesh->spins, mesh->spin[mesh->spins++] = gk_disc_of(model, p);
    }
}

static void fill_mesh(const gk_model *model, gk_setup *setup, const gk_data *data, int e)
{
    gk_mesh *mesh = &setup->mesh[e];
    const gk_engagement *engagement = &model->engagement[e];
    const double *a = engagement->position[0], *b = engagement->position[1];
    const double distance = sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
    fill_spins(model, mesh);
    fill_parts(model, &setup->base, mesh);
    mesh->damping = data->mesh[e][V_DAMPING];
    if (engagement->kind != MESH_FLAT)
        mesh->allowance = (data->mesh[e][V_BACKLASH] - engagement->nominal_backlash) *
                          gk_base_reach(model, engagement) / distance;
    gk_strips_fill(model, setup, mesh);
    gk_law_bounds(model, mesh);
    if (engagement->kind != MESH_FLAT) gk_flank_clearance(model, setup, mesh);
    if (setup->nodal) gk_nodal_fill(model, setup, data, mesh);
}

/* coefficients of problems in which no time passes: C′ is the quasi-static part alone */
static void fill_explicit(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    gk_coefficients *k = &work->explicit_rows;
    const size_t ground = (size_t)setup->base.n * sizeof(double);
    k->h = 1.0, k->gamma = k->rigid_kappa = k->rigid_mobility = k->rigid_b0 = k->rigid_bq = 0.0;
    k->curved_read = 0, k->timeless = 1;
    for (int g = 0; g < model->gears; g++) {
        const size_t size = (size_t)setup->modal[g].n * sizeof(gk_real);
        memset(k->flow[g].mobility, 0, size);
        memset(k->flow[g].kappa, 0, size);
        for (int i = 0; i < setup->modal[g].n; i++) k->flow[g].inverse_s2[i] = 1;
        memset(work->zero, 0, size);
        k->flow[g].exact = 0;
    }
    memset(k->ground.mobility, 0, ground);
    memset(k->ground.kappa, 0, ground);
    for (int i = 0; i < setup->base.n; i++) k->ground.inverse_s2[i] = 1.0;
    memset(work->ground_zero, 0, ground);
}

/* ---- level and integrator ---------------------------------------------------------------------------------------- */
static int has_nodes(const gk_model *model, const gk_data *data)
{
    int all = model->engagements > 0;
    for (int e = 0; e < model->engagements; e++) {
        all &= data->mesh[e][V_PENALTY] > 0.0;
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

/* level, integrator and effects that go together; `paper` is the paper's way: truncated modes, no residual, nodal
 * contact, rk45 (dg4 and lines of contact where a clutch hangs on a port) */
static gk_outcome choose(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE])
{
    double damping = 0.0;
    setup->level = (gk_level)(int)data->stage[V_LEVEL];
    setup->integrator = (gk_integrator)(int)data->stage[V_INTEGRATOR];
    setup->on = gk_effects_of(data);
    setup->slices = (int)data->stage[V_SLICES];
    setup->spatial = model->spatial;
    setup->strips = gk_strips_count(model, setup->slices);
    for (int e = 0; e < model->engagements; e++) damping = gk_max(damping, data->mesh[e][V_DAMPING]);
    if (damping == 0.0) setup->on.contact_damping = 0;
    setup->base.set = model->sets > 1 && !setup->on.bearings;
    if (setup->level == LEVEL_EXPLICIT && setup->integrator == DG4) setup->integrator = CENTRAL;
    if (gk_scheme_of(setup->integrator)->is_explicit && model->chains) {
        snprintf(message, GK_MESSAGE,
                 "integrators rk45 and central (level explicit) know no clutch: use dg4, or export the stage without "
                 "the chain");
        return GK_BAD_VALUE;
    }
    if (setup->level == LEVEL_PAPER && setup->integrator == DG4 && !model->chains) setup->integrator = RK45;
    const gk_outcome outcome = choose_contact(model, data, setup, message);
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

static char *behind(void *block, size_t size) { return (char *)(((uintptr_t)block + size + 63) / 64 * 64); }

gk_outcome gk_prepare(const gk_model *model, const gk_data *data, gk_setup *setup, gk_work *work,
                      char message[GK_MESSAGE])
{
    int modes[MAX_GEARS];
    int32_t which[MAX_GROUND + 4 * MAX_ROTORS];
    message[0] = 0;
    if (data->magic != GK_DATA_MAGIC) {
        snprintf(message, GK_MESSAGE, "gk_prepare before gk_defaults");
        return GK_BAD_CALL;
    }
    memset(setup, 0, sizeof *setup);
    gk_outcome outcome = choose(model, data, setup, message);
    if (outcome) return outcome;
    count_engagements(model, setup);
    for (int g = 0; g < model->gears; g++) modes[g] = setup->on.elastic ? modes_at_level(model, setup, g) : 0;
    for (int e = 0; e < model->engagements; e++) {
        setup->mesh[e].index = e;
        for (int w = 0; w < 2; w++) gk_side_plan(model, setup, e, &setup->mesh[e].side[w], w);
    }
    find_islands(model, setup);
    lay_out_setup(model, setup, behind(setup, sizeof *setup), modes, list_ground(model, setup, which));
    memset(work, 0, sizeof *work);
    lay_out_work(model, setup, work, behind(work, sizeof *work));
    setup->step = gk_wide_step(1, setup->integrator);
    setup->count = gk_wide_count(1);
    for (int g = 0; g < model->gears; g++) fill_modal(&model->gear[g], &setup->modal[g]);
    fill_base(model, setup, which);
    fill_ports(model, setup);
    for (int e = 0; e < model->engagements; e++) fill_mesh(model, setup, data, e);
    for (int g = 0; g < model->gears && setup->nodal; g++) gk_nodal_rows(model, setup, g);
    for (int e = 0; e < model->engagements; e++)
        for (int w = 0; w < 2; w++) gk_side_fill(model, setup, work, e, w);
    fill_explicit(model, setup, work);
    outcome = gk_limit_choose(model, setup, work, data->stage[V_H], message);
    if (outcome == GK_OK) setup->magic = GK_SETUP_MAGIC;
    return outcome;
}
