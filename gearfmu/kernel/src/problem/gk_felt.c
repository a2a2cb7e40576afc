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
        const int patterns = work->by_patterns ? patterns_of(setup, engaged->index, w) : 0;
        engaged->by_patterns[w] = patterns > 0;
        engaged->local += engaged->wide[w] = patterns ? patterns : mesh->part[w].width;
    }
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

/* y += forces x by the columns of a matrix (rows, columns) */
GK_INLINE void add_columns(const gk_real *matrix, const gk_real *x, int rows, int columns, gk_real *y, const int halves)
{
    gk_half sum[MOST_PATTERNS * 2 / LANES];
    for (int k = 0; k < halves; k++) sum[k] = ((gk_half *)y)[k];
    for (int i = 0; i < rows; i++) {
        const gk_half *row = (const gk_half *)(matrix + i * columns);
        for (int k = 0; k < halves; k++) sum[k] += x[i] * row[k];
    }
    for (int k = 0; k < halves; k++) ((gk_half *)y)[k] = sum[k];
}

typedef struct between { /* from the patterns of one gear to those of another */
    const gk_real *matrix;
    int rows, columns;
} between;

static between between_of(const gk_setup *setup, const gk_work *work, int to, int from)
{
    return (between){work->between[to][from], setup->base.patterns[from], setup->base.patterns[to]};
}

static void add_between(between b, const gk_felt *forces, int at_once, gk_real *y)
{
    for (int kind = at_once; kind < 2; kind++) {
        const gk_real *x = kind ? forces->yielded : forces->moved, *m = b.matrix + (size_t)(kind * b.rows * b.columns);
        switch (2 * b.columns / LANES) {
        case 4: add_columns(m, x, b.rows, b.columns, y, 4); break;
        case 5: add_columns(m, x, b.rows, b.columns, y, 5); break;
        default: add_columns(m, x, b.rows, b.columns, y, 2 * b.columns / LANES);
        }
    }
}

static void gather(gk_real *sum, gk_real *before, const gk_real *now, int n)
{
    gk_half *s = (gk_half *)sum, *b = (gk_half *)before;
    for (int k = 0; k < 2 * n / LANES; k++) s[k] += ((const gk_half *)now)[k] - b[k], b[k] = ((const gk_half *)now)[k];
}

/* forces of an engagement on the patterns of a side */
void gk_felt_give(const gk_coupled *c, int e, int w, const double *moved, const double *yielded)
{
    const int g = c->setup->mesh[e].side[w].gear, n = patterns_of(c->setup, e, w);
    gk_felt now, *given = &c->work->engaged[e].pattern[w], *sum = &c->work->sum_patterns[g];
    for (int i = 0; i < n; i += 4) {
        *(gk_four *)(now.moved + i) = __builtin_convertvector(*(const gk_quad *)(moved + i), gk_four);
        *(gk_four *)(now.yielded + i) = __builtin_convertvector(*(const gk_quad *)(yielded + i), gk_four);
    }
    gather(sum->moved, given->moved, now.moved, n);
    gather(sum->yielded, given->yielded, now.yielded, n);
}

/* what the forces on all other gears do to the patterns of each */
void gk_felt_others(const gk_coupled *c, int at_once)
{
    const gk_base *base = &c->setup->base;
    for (int to = 0; to < c->model->gears; to++) {
        memset(c->work->by_others[to], 0, (size_t)base->patterns[to] * sizeof(gk_real));
        for (int from = 0; from < c->model->gears; from++)
            if (from != to && gk_patterns_meet(base, to, from))
                add_between(between_of(c->setup, c->work, to, from), &c->work->sum_patterns[from], at_once,
                            c->work->by_others[to]);
    }
}

/* what others displace of the patterns of a side; at_once: their forces in the step are 0 */
void gk_felt_take(const gk_setup *setup, const gk_work *work, int e, int w, int at_once, double *others)
{
    const int g = setup->mesh[e].side[w].gear, n = setup->base.patterns[g];
    const gk_felt *own = &work->engaged[e].pattern[w], *sum = &work->sum_patterns[g];
    gk_felt rest = {{0}, {0}};
    gk_real felt[MOST_PATTERNS];
    for (int i = 0; i < n; i += LANES / 2) {
        *(gk_half *)(rest.moved + i) = *(const gk_half *)(sum->moved + i) - *(const gk_half *)(own->moved + i);
        *(gk_half *)(rest.yielded + i) = *(const gk_half *)(sum->yielded + i) - *(const gk_half *)(own->yielded + i);
        *(gk_half *)(felt + i) = *(const gk_half *)(work->by_others[g] + i);
    }
    add_between(between_of(setup, work, g, g), &rest, at_once, felt);
    for (int i = 0; i < n; i += 4) *(gk_quad *)(others + i) = GK_WIDENED(*(const gk_four *)(felt + i));
}

/* forces that were pushed on patterns act on the oscillators */
void gk_felt_scatter(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    const gk_base *base = &setup->base;
    for (int g = 0; g < model->gears; g++) {
        const int quads = base->width[g] / 4;
        gk_quad *z = (gk_quad *)(work->ground_force + base->from[g]),
                *next = (gk_quad *)(work->ground_next + base->from[g]);
        for (int i = 0; i < base->patterns[g]; i++) {
            const gk_quad *pattern = (const gk_quad *)(base->pattern[g] + i * base->width[g]);
            const double x = work->pushed_z[g][i], y = work->pushed_next[g][i];
            if (x == 0.0 && y == 0.0) continue;
            for (int q = 0; q < quads; q++) z[q] += x * pattern[q], next[q] += y * pattern[q];
        }
    }
}
