/* Gears whose flanks feel the ground group by patterns (setup/gk_patterns.c), as planets do their carrier: in a step
 * with tables a row is its gradient by rigid motion, ports and shares of the patterns. Forces are summed by patterns;
 * what they move is read by the same numbers. Gears that meet feel each other once a round. */
#include "problem/gk_felt.h"
#include "problem/gk_rows.h"

static int patterns_of(const gk_setup *setup, int e, int w)
{
    return setup->base.patterns[setup->mesh[e].side[w].gear];
}

/* predicted displacement of all patterns */
void gk_felt_see(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    const gk_base *base = &setup->base;
    for (int g = 0; g < model->gears; g++) {
        gk_clear(work->seen[g], base->patterns[g] / 4);
        gk_times_rows(base->pattern[g], base->patterns[g], base->width[g], work->ground_y + base->from[g],
                      work->seen[g]);
    }
}

/* how wide rows of an engagement are in this step */
void gk_felt_plan(const gk_setup *setup, const gk_work *work, gk_engaged *engaged)
{
    const gk_mesh *mesh = &setup->mesh[engaged->index];
    engaged->local = 0;
    for (int w = 0; w < 2; w++) {
        const int patterns = work->by_tables ? patterns_of(setup, engaged->index, w) : 0;
        engaged->by_patterns[w] = patterns > 0;
        engaged->local += engaged->wide[w] = patterns ? patterns : mesh->part[w].width;
    }
    engaged->halves = gk_halves(engaged->wide[0]) + gk_halves(engaged->wide[1]);
}

/* Fills the rows of contacts and joints on the patterns of a side */
void gk_felt_rows(const gk_setup *setup, gk_work *work, int e, int w)
{
    GK_ASSERT(gk_is_mesh(setup, e) && work->engaged[e].by_patterns[w]);
    gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    const gk_side *side = &setup->mesh[e].side[w];
    const gk_position *at = &engaged->position[w];
    const int strips = GK_STRIPS(setup), quads = (engaged->wide[w] - FIRST_PATTERN) / 4, local = engaged->local / 4;
    const size_t points = (size_t)(side->candidates * strips);
    gk_quad *to = (gk_quad *)(engaged->ground + (w ? engaged->wide[0] : 0));
    for (int p = 0; p < engaged->places; p++) {
        const size_t first = (size_t)at->node * points + (size_t)(engaged->place[p].candidate[w] * strips);
        const gk_quad *low = (const gk_quad *)side->shares + first * (size_t)quads,
                      *high = low + points * (size_t)quads;
        for (int i = 0; i < strips; i++, to += local, low += quads, high += quads) {
            const double *g = gk_point_of(setup, &engaged->place[p], i)->gradient + SPACE * w;
            const gk_quad rest = {g[4], g[5], 0.0, 0.0};
            to[0] = *(const gk_quad *)g, to[1] = rest;
            for (int q = 0; q < quads; q++) to[2 + q] = -(low[q] + at->part * (high[q] - low[q]));
        }
    }
    for (int i = s->contacts; i < s->n; i++, to += local) {
        const int slot = gk_rows_at_bore(setup, s, i) ? setup->base.port_slot[side->gear][s->port_of[i]] : -1;
        gk_clear((double *)to, 2 + quads);
        if (slot >= 0) ((double *)to)[slot] = 1.0;
    }
}

typedef struct between { /* from the patterns of one gear to those of another */
    const gk_real *matrix;
    int rows, columns;
} between;

static between between_of(const gk_setup *setup, const gk_work *work, int to, int from)
{
    return (between){work->between[to][from], setup->base.patterns[from], setup->base.patterns[to]};
}

static void add_between(between b, const gk_real *x, int kind, gk_real *y)
{
    gk_sum_rows(b.matrix + (size_t)(kind * b.rows * b.columns), 2 * b.columns / LANES, x, b.rows, y);
}

/* what forces on the patterns of all gears do to those of each: in the step, at once */
void gk_felt_move(const gk_coupled *c, int whole, int at_once)
{
    const gk_base *base = &c->setup->base;
    gk_work *work = c->work;
    for (int to = 0; to < c->model->gears; to++) {
        gk_real *moved[MOVES] = {work->move_pattern[WHOLE][to], work->move_pattern[YIELDED][to]};
        for (int t = 0; t < MOVES; t++) memset(moved[t], 0, (size_t)base->patterns[to] * sizeof(gk_real));
        for (int from = 0; from < c->model->gears; from++) {
            const between b = between_of(c->setup, work, to, from);
            if (!base->patterns[to] || !gk_patterns_meet(base, to, from)) continue;
            if (whole) add_between(b, work->push_pattern[STEP][from], 0, moved[WHOLE]);
            if (whole) add_between(b, work->push_pattern[ONCE][from], 1, moved[WHOLE]);
            if (at_once) add_between(b, work->push_pattern[AT_ONCE][from], 1, moved[YIELDED]);
        }
    }
}

/* adds forces on the patterns of a gear to those on its oscillators, `wide` quads of these from `first` on */
GK_INLINE void scatter_quads(const gk_base *base, int g, const double (*by)[MAX_GEARS][MOST_PATTERNS], int first,
                             gk_quad *const to[2], const int wide)
{
    gk_quad sum[2][4];
    for (int t = 0; t < 2; t++)
        for (int q = 0; q < wide; q++) sum[t][q] = to[t][first + q];
    for (int i = 0; i < base->patterns[g]; i++) {
        const gk_quad *pattern = (const gk_quad *)(base->pattern[g] + i * base->width[g]) + first;
        for (int t = 0; t < 2; t++)
            for (int q = 0; q < wide; q++) sum[t][q] += by[t][g][i] * pattern[q];
    }
    for (int t = 0; t < 2; t++)
        for (int q = 0; q < wide; q++) to[t][first + q] = sum[t][q];
}

/* forces that were pushed on patterns act on the oscillators */
void gk_felt_scatter(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    const gk_base *base = &setup->base;
    for (int g = 0; g < model->gears; g++) {
        const int from = base->from[g], quads = base->patterns[g] ? base->width[g] / 4 : 0;
        gk_quad *const to[2] = {(gk_quad *)(work->ground_force + from), (gk_quad *)(work->ground_next + from)};
        const double (
            *by)[MAX_GEARS][MOST_PATTERNS] = (const double (*)[MAX_GEARS][MOST_PATTERNS])work->scatter_pattern;
        int q = 0;
        for (; q + 4 <= quads; q += 4) scatter_quads(base, g, by, q, to, 4);
        for (; q < quads; q++) scatter_quads(base, g, by, q, to, 1);
    }
}
