/* What the forces of an island do to all of its rows: pushed to spins, ground group, modes and far teeth, and read by
 * the same numbers. Rows read what their own engagement does with the rest; its matrices only tell that apart
 * (gk_couple.c). Forces come as those of the step, z; λ + f_d, under which what is quasi-static in it yields; λ alone,
 * whose deflection stores energy. */
#include "problem/gk_pass.h"
#include "problem/gk_exchange.h"
#include "problem/gk_far.h"
#include "problem/gk_felt.h"
#include "problem/gk_pass_read.h"

/* ---- forces ------------------------------------------------------------------------------------------------------ */
/* a clutch knows no A; friction counts with all that forces do */
static void forces_of(const gk_setup *setup, gk_engaged *engaged, gk_moment when)
{
    const gk_system *s = &engaged->system;
    gk_forces *f = &engaged->forces;
    const int start = when == ALONG_START;
    const double *late = when == PRESENT ? s->force : s->force0; /* given torques may have changed */
    for (int i = 0; i < s->stride; i++) {
        const int row = i < s->n, yields = row && gk_row_yields(s, i);
        f->of[STEP][i] = row && !start ? s->z[i] : 0.0;
        f->of[ONCE][i] = !yields ? 0.0 : start ? s->force0[i] + s->dashpot.end0[i] : s->force[i] + s->dashpot.end[i];
        f->of[AT_ONCE][i] = yields ? late[i] : 0.0;
        if (!GK_ON(setup, friction)) continue;
        const gk_glide *glide = engaged->glide;
        const int rubs = i < s->contacts;
        f->along[STEP][i] = rubs && !start ? glide->step[i] : 0.0;
        f->along[ONCE][i] = !rubs ? 0.0 : start ? glide->start_end[i] : glide->end[i];
    }
}

void gk_pass_forces(const gk_coupled *c, gk_moment when)
{
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) forces_of(c->setup, &c->work->engaged[e], when);
}

/* ---- pushing ----------------------------------------------------------------------------------------------------- */
/* where forces on a side's part of the ground group are summed: patterns or oscillators */
static gk_real *pushed_of(const gk_coupled *c, const gk_engaged *engaged, int w, int t)
{
    const gk_mesh *mesh = &c->setup->mesh[engaged->index];
    gk_work *work = c->work;
    return engaged->by_patterns[w] ? work->push_pattern[t][mesh->side[w].gear]
                                   : work->push_ground[t] + mesh->part[w].from;
}

static void clear_halves(gk_real *x, int n)
{
    for (int k = 0; k < gk_halves(n); k++) ((gk_half *)x)[k] = (gk_half){0};
}

/* gear by gear: nothing has been pushed yet */
static void clear_gear(const gk_coupled *c, int g)
{
    gk_work *work = c->work;
    const gk_base *base = &c->setup->base;
    for (int t = 0; t < PUSHES; t++)
        if (work->by_tables && base->patterns[g])
            clear_halves(work->push_pattern[t][g], base->patterns[g]);
        else
            memset(work->push_ground[t] + base->from[g], 0, (size_t)base->width[g] * sizeof(gk_real));
    for (int t = 0; t < MOVES; t++) clear_halves(work->move_modes[t][g], GK_LANES(c->setup, g));
}

static void push_spins(const gk_coupled *c, int e, int first, int last)
{
    const gk_mesh *mesh = &c->setup->mesh[e];
    const gk_engaged *engaged = &c->work->engaged[e];
    const int quads = engaged->system.stride / 4;
    for (int t = first; t <= last; t++)
        for (int l = 0; l < mesh->spins; l++) {
            double *to = &c->work->push_spin[t][mesh->spin[l]];
            *to += gk_dot_quads(engaged->system.rigid[l], engaged->forces.of[t], quads);
            if (GK_ON(c->setup, friction) && t != AT_ONCE)
                *to += gk_dot_quads(engaged->glide->rigid[l], engaged->forces.along[t], quads);
        }
}

typedef struct acting { /* forces of rows, those of contacts first; kinds that are not pushed are not read */
    int count, contacts, any;
    gk_real by[PUSHES][MAX_ROWS];
} acting;

static void list_acting(const double (*by)[MAX_STRIDE], int kinds, const gk_system *s, acting *p)
{
    p->contacts = s->contacts, p->count = kinds == PUSHES ? s->n : s->contacts, p->any = 0;
    for (int t = 0; t < kinds; t++)
        for (int i = 0; i < p->count; i++) p->by[t][i] = (gk_real)by[t][i], p->any |= by[t][i] != 0.0;
}

/* the first halves of a gear's lanes, of each part, that κ reaches; one more is cheaper pushed with them */
static int yielding(const gk_coupled *c, int g)
{
    const int half = GK_LANES(c->setup, g) / LANES, yields = gk_halves(c->k->flow[g].softest);
    return yields && yields + 1 == half ? half : yields;
}

typedef struct half_block { /* the first `count` rows on some oscillators, `width` halves each */
    const gk_half *row;
    int width, count;
    const acting *by;
} half_block;

/* sums of rows over `wide` halves from `at` on, with forces of the kinds `first` … `last`, two rows at once */
GK_INLINE void sum_halves(half_block of, int at, gk_half *const out[PUSHES], const int wide, const int first,
                          const int last)
{
    gk_half sum[PUSHES][8];
    const gk_half *row = of.row + at, *next = row + of.width;
    int r = 0;
    for (int t = first; t <= last; t++)
        for (int k = 0; k < wide; k++) sum[t][k] = (gk_half){0};
    for (; r + 2 <= of.count; r += 2, row += 2 * of.width, next += 2 * of.width)
        for (int t = first; t <= last; t++)
            for (int k = 0; k < wide; k++)
                sum[t][k] = (sum[t][k] + of.by->by[t][r] * row[k]) + of.by->by[t][r + 1] * next[k];
    for (int t = first; t <= last; t++)
        for (int k = 0; k < wide; k++) {
            if (r < of.count) sum[t][k] += of.by->by[t][r] * row[k];
            out[t][at + k] = sum[t][k];
        }
}

GK_INLINE void sum_blocks(half_block of, gk_span halves, gk_half *const out[PUSHES], const int first, const int last)
{
    const int end = halves.from + halves.width;
    int at = halves.from;
    if (first == last)
        for (; at + 8 <= end; at += 8) sum_halves(of, at, out, 8, first, last);
    for (; at + 4 <= end; at += 4) sum_halves(of, at, out, 4, first, last);
    if (end - at == 3) sum_halves(of, at, out, 3, first, last), at += 3;
    if (at + 2 <= end) sum_halves(of, at, out, 2, first, last), at += 2;
    if (at < end) sum_halves(of, at, out, 1, first, last);
}

/* sums of the kinds that a pass asks for */
static void sum_all(half_block of, gk_span halves, gk_half *const out[PUSHES], int parts)
{
    switch (parts) {
    case 1: sum_blocks(of, halves, out, STEP, ONCE); break;
    case 2: sum_blocks(of, halves, out, AT_ONCE, AT_ONCE); break;
    default: sum_blocks(of, halves, out, STEP, AT_ONCE);
    }
}

/* what a gear's modes move by the sums, turned from the tooth to its axes: all lanes by mobility, the first of either
 * half by κ too */
static void move_modes(const gk_coupled *c, int e, int w, gk_half *const sum[PUSHES], int parts)
{
    const int g = c->setup->mesh[e].side[w].gear;
    const gk_modal *m = &c->setup->modal[g];
    const gk_flow *flow = &c->k->flow[g];
    const int half = m->n / LANES, yields = yielding(c, g), tooth = c->work->engaged[e].position[w].tooth;
    const gk_half *cosine = (const gk_half *)m->cosine + tooth * half, *sine = (const gk_half *)m->sine + tooth * half;
    const gk_half *mobility = (const gk_half *)flow->mobility, *kappa = (const gk_half *)flow->kappa;
    gk_half *to = (gk_half *)c->work->move_modes[WHOLE][g], *once = (gk_half *)c->work->move_modes[YIELDED][g];
    for (int k = 0; k < half && (parts & 1); k++) {
        gk_half a = mobility[k] * sum[STEP][k], b = mobility[half + k] * sum[STEP][half + k];
        if (k < yields) a -= kappa[k] * sum[ONCE][k], b -= kappa[half + k] * sum[ONCE][half + k];
        to[k] += a * cosine[k] - b * sine[k];
        to[half + k] += a * sine[k] + b * cosine[k];
    }
    for (int k = 0; k < yields && (parts & 2); k++) {
        const gk_half a = -kappa[k] * sum[AT_ONCE][k], b = -kappa[half + k] * sum[AT_ONCE][half + k];
        once[k] += a * cosine[k] - b * sine[k];
        once[half + k] += a * sine[k] + b * cosine[k];
    }
}

/* forces on modes of both gears and on the ground group, by the rows of the gaps or of the sliding */
static void push_rows(const gk_coupled *c, const gk_engaged *engaged, const acting *p, int along, int parts)
{
    gk_work *work = c->work;
    gk_half *const sum[PUSHES] = {(gk_half *)work->turned, (gk_half *)work->turned_next, (gk_half *)work->scaled};
    gk_real *const *basis = along ? engaged->glide->basis : engaged->basis;
    int at = 0;
    for (int w = 0; w < 2; w++) {
        const int g = c->setup->mesh[engaged->index].side[w].gear, half = GK_LANES(c->setup, g) / LANES;
        const int yields = yielding(c, g);
        const half_block modes = {(const gk_half *)basis[w], 2 * half, p->contacts, p};
        if (!half || c->k->timeless || (parts == 2 && !yields)) continue;
        for (int from = 0; from < 2 * half; from += half) {
            sum_all(modes, (gk_span){from, yields}, sum, parts);
            if (parts & 1) sum_blocks(modes, (gk_span){from + yields, half - yields}, sum, STEP, STEP);
        }
        move_modes(c, engaged->index, w, sum, parts);
    }
    for (int w = 0; w < 2; at += gk_halves(engaged->wide[w++])) {
        gk_half by[PUSHES][MAX_NEAR], *const out[PUSHES] = {by[0] - at, by[1] - at, by[2] - at};
        const half_block ground = {(const gk_half *)(along ? engaged->glide->near : engaged->near), engaged->halves,
                                   p->count, p};
        const int halves = gk_halves(engaged->wide[w]);
        sum_all(ground, (gk_span){at, halves}, out, parts);
        for (int t = parts == 2 ? AT_ONCE : STEP; t <= (parts & 2 ? AT_ONCE : ONCE); t++) {
            gk_half *to = (gk_half *)pushed_of(c, engaged, w, t);
            for (int k = 0; k < halves; k++) to[k] += by[t][k];
        }
    }
}

static void push_bores(const gk_coupled *c, gk_engaged *engaged, int t)
{
    gk_bores *own = &engaged->own_bores[t];
    memset(own, 0, sizeof *own);
    gk_exchange_push_bores(c->setup, engaged, engaged->forces.of[t == WHOLE ? ONCE : AT_ONCE], own);
    for (int p = 0; p < c->model->ports; p++) {
        c->work->push_bores[t].moment[p] += own->moment[p];
        c->work->push_bores[t].turned[p] += own->turned[p];
    }
}

/* parts: 1 in the step, 2 at once */
static void push_engagement(const gk_coupled *c, int e, int parts)
{
    gk_engaged *engaged = &c->work->engaged[e];
    const gk_forces *f = &engaged->forces;
    acting p;
    push_spins(c, e, parts == 2 ? AT_ONCE : STEP, parts & 2 ? AT_ONCE : ONCE);
    for (int t = 0; t < MOVES; t++)
        if (parts & (1 << t)) push_bores(c, engaged, t);
    gk_far_push(c->setup, engaged, f->of[AT_ONCE]);
    list_acting(f->of, PUSHES, &engaged->system, &p);
    if (p.any) push_rows(c, engaged, &p, 0, parts);
    if (!GK_ON(c->setup, friction) || !(parts & 1)) return;
    list_acting(f->along, AT_ONCE, &engaged->system, &p);
    if (p.any) push_rows(c, engaged, &p, 1, 1);
}

/* ---- what moves -------------------------------------------------------------------------------------------------- */
static void move_spins(const gk_coupled *c)
{
    gk_work *work = c->work;
    for (int d = 0; d < c->setup->spins; d++) {
        const double mobility = c->k->rigid_mobility * c->setup->inverse_inertia[d];
        const double kappa = c->k->rigid_kappa * c->setup->inverse_inertia[d];
        work->yield_spin[d] = kappa * work->push_spin[ONCE][d];
        work->move_spin[WHOLE][d] = mobility * work->push_spin[STEP][d] - work->yield_spin[d];
        work->move_spin[YIELDED][d] = -kappa * work->push_spin[AT_ONCE][d];
    }
}

static void move_ground(const gk_coupled *c, gk_span span)
{
    gk_work *work = c->work;
    const gk_ground_flow *flow = &c->k->ground;
#define FOUR(array) (((gk_four *)(array))[i])
    for (int i = span.from / 4; i < (span.from + span.width) / 4; i++) {
        const gk_four mobility = __builtin_convertvector(((const gk_quad *)flow->mobility)[i], gk_four);
        const gk_four kappa = __builtin_convertvector(((const gk_quad *)flow->kappa)[i], gk_four);
        FOUR(work->move_ground[WHOLE]) = mobility * FOUR(work->push_ground[STEP]) -
                                         kappa * FOUR(work->push_ground[ONCE]);
        FOUR(work->move_ground[YIELDED]) = -kappa * FOUR(work->push_ground[AT_ONCE]);
    }
#undef FOUR
}

/* ---- the pass ---------------------------------------------------------------------------------------------------- */
static void push_nothing(const gk_coupled *c)
{
    gk_work *work = c->work;
    memset(work->push_spin, 0, sizeof work->push_spin);
    memset(work->push_bores, 0, sizeof work->push_bores);
    for (int g = 0; g < c->model->gears; g++) clear_gear(c, g);
}

static void move_all(const gk_coupled *c, int whole, int at_once)
{
    const gk_base *base = &c->setup->base;
    move_spins(c);
    for (int g = 0; g < c->model->gears; g++)
        if (!c->work->by_tables || !base->patterns[g]) move_ground(c, (gk_span){base->from[g], base->width[g]});
    if (c->work->by_tables) gk_felt_move(c, whole, at_once);
    gk_far_move(c->work);
}

void gk_pass(const gk_coupled *c, int whole, int at_once)
{
    GK_ASSERT(whole || at_once);
    GK_LAP(c->work, PHASE_SOLVE);
    push_nothing(c);
    for (int e = 0; e < c->model->engagements; e++)
        if (gk_is_within(c, e)) push_engagement(c, e, whole + 2 * at_once);
    move_all(c, whole, at_once);
    for (int e = 0; e < c->model->engagements; e++) {
        double far[MAX_STRIDE];
        if (!gk_is_within(c, e)) continue;
        gk_far_read(c->setup, &c->work->engaged[e], far);
        if (whole) gk_pass_read(c, e, WHOLE, far);
        if (at_once) gk_pass_read(c, e, YIELDED, far);
        if (whole && GK_ON(c->setup, friction)) gk_pass_read_along(c, e);
    }
    GK_LAP(c->work, PHASE_PASS);
}

void gk_pass_unit(const gk_coupled *c, int from, int row)
{
    GK_ASSERT(gk_is_within(c, from) && row < c->work->engaged[from].system.n);
    gk_engaged *pushed = &c->work->engaged[from];
    memset(&pushed->forces, 0, sizeof pushed->forces);
    pushed->forces.of[AT_ONCE][row] = 1.0;
    push_nothing(c);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_engaged *engaged = &c->work->engaged[e];
        if (!gk_is_within(c, e)) continue;
        gk_far_rest(c->setup, engaged);
        memset(engaged->own_bores, 0, sizeof engaged->own_bores);
    }
    push_engagement(c, from, 2);
    move_all(c, 0, 1);
    for (int e = 0; e < from; e++)
        if (gk_is_within(c, e)) gk_pass_read_unit(c, e);
}
