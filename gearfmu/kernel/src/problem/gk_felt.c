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
        const int slot = gk_rows_at_bore(setup, s, i) ? setup->base.port_slot[side->gear][s->joint.port[i]] : -1;
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
    return (between){work->room.between[to][from], setup->base.patterns[from], setup->base.patterns[to]};
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
        for (int t = 0; t < MOVES; t++)
            for (int k = 0; k < gk_halves(base->patterns[to]); k++) ((gk_half *)moved[t])[k] = (gk_half){0};
        for (int from = 0; from < c->model->gears; from++) {
            const between b = between_of(c->setup, work, to, from);
            if (!base->patterns[to] || !gk_patterns_meet(base, to, from)) continue;
            if (whole) add_between(b, work->push_pattern[STEP][from], 0, moved[WHOLE]);
            if (whole) add_between(b, work->push_pattern[ONCE][from], 1, moved[WHOLE]);
            if (at_once) add_between(b, work->push_pattern[AT_ONCE][from], 1, moved[YIELDED]);
        }
    }
}

/* Forces that were pushed on patterns act on the oscillators: those of flanks in single precision, rigid motion and
 * ports, few of which are loaded, in double */
void gk_felt_scatter(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    const gk_base *base = &setup->base;
    for (int g = 0; g < model->gears; g++)
        for (int t = 0; t < 2 && base->patterns[g]; t++) {
            const int width = base->width[g], wide = gk_whole_halves(width), flanks = base->patterns[g] - FIRST_PATTERN;
            const double *by = work->scatter_pattern[t][g];
            double *to = (t ? work->ground_next : work->ground_force) + base->from[g];
            gk_real sum[MAX_GROUND + 4 * MAX_ROTORS + LANES], x[MOST_PATTERNS];
            for (int i = 0; i < flanks; i++) x[i] = (gk_real)by[FIRST_PATTERN + i];
            memset(sum, 0, (size_t)wide * sizeof *sum);
            gk_sum_rows(base->flanks[g], 2 * wide / LANES, x, flanks, sum);
            for (int q = 0; q < width / 4; q++) ((gk_quad *)to)[q] += GK_WIDENED(((const gk_four *)sum)[q]);
            for (int i = 0; i < FIRST_PATTERN; i++)
                if (by[i] != 0.0) gk_axpy(by[i], base->pattern[g] + i * width, to, 0, width / 4);
        }
}
