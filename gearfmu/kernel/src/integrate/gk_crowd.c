/* Half steps of what turns or damps the speeds of the ground group, where many turning pairs and dashpots have the same
 * oscillators, as those of a flexible carrier: all pairs at once, by the rows of all (docs/theory.md, 3.10). Their
 * products are in single precision; what they change is added in double. */
#include "integrate/gk_crowd.h"
#include "model/gk_data.h"

enum { MOST_ROWS = 2 * MOST_CROWD, MOST_WIDE = MAX_GROUND + 4 * MAX_ROTORS + LANES, ROUNDS = 30 };
static const double TURNED = sizeof(gk_real) == sizeof(float) ? 3e-8 : 1e-15; /* of the largest reading: left of it */

/* sums of rows by oscillators */
static void read_crowd(const gk_base *base, const gk_real *rows, int lanes, const double *x, gk_real *read)
{
    gk_real seen[MOST_WIDE];
    for (int i = 0; i < base->crowd.width; i++) seen[i] = (gk_real)x[base->crowd.from + i];
    memset(read, 0, (size_t)lanes * sizeof *read);
    gk_sum_rows(rows, 2 * lanes / LANES, seen, base->crowd.width, read);
}

/* adds to speeds what numbers on rows do to them */
static void move_crowd(const gk_base *base, const gk_real *moves, int lanes, const gk_real *by, double *v)
{
    gk_real sum[MOST_WIDE];
    const int wide = gk_whole_halves(base->crowd.width);
    memset(sum, 0, (size_t)wide * sizeof *sum);
    gk_sum_rows(moves, 2 * wide / LANES, by, lanes, sum);
    gk_quad *to = (gk_quad *)(v + base->crowd.from);
    for (int q = 0; q < base->crowd.width / 4; q++) to[q] += GK_WIDENED(((const gk_four *)sum)[q]);
}

/* Half a step of all pairs: v changes by Σ −½θ (y (x·m) − x (y·m)), m = v + v′, θ = Ωh, the rule of one pair
 * (gk_frame.c) for all together: m·rows is found by iteration, each round leaves about θ of what was wrong. */
void gk_crowd_turn(const gk_base *base, const gk_coefficients *k, const gk_data *data, double *v)
{
    GK_ASSERT(base->crowd_pairs <= MOST_CROWD && k->h > 0.0 && v);
    const gk_crowd_flow *f = &k->ground.crowd;
    const int lanes = gk_whole_halves(base->crowd_pairs), rows = 2 * lanes;
    gk_real twice[MOST_ROWS], sum[MOST_ROWS], next[MOST_ROWS], by[MOST_ROWS], half[MOST_CROWD] = {0};
    double change = INFINITY, last;
    for (int i = 0, at = 0; i < base->turns; i++)
        if (gk_in_crowd(base, base->turn_span[i]))
            half[at++] = (gk_real)(0.5 * k->h * GK_OF(data, v)[base->turn_rotor[i]]);
    read_crowd(base, f->turns, rows, v, twice);
    for (int i = 0; i < rows; i++) sum[i] = twice[i] += twice[i];
    for (int round = 0; round < ROUNDS; round++) {
        for (int i = 0; i < lanes; i++) by[i] = half[i] * sum[lanes + i], by[lanes + i] = -half[i] * sum[i];
        memcpy(next, twice, (size_t)rows * sizeof *next);
        gk_sum_rows(f->turning, 2 * rows / LANES, by, rows, next);
        gk_half most = {0}, size = {0};
        for (int q = 0; q < 2 * rows / LANES; q++) {
            const gk_half now = ((gk_half *)next)[q], moved = now - ((gk_half *)sum)[q];
            most = GK_HALF_LARGER(most, GK_HALF_MAGNITUDE(moved)), size = GK_HALF_LARGER(size, GK_HALF_MAGNITUDE(now));
            ((gk_half *)sum)[q] = now;
        }
        last = change, change = gk_half_largest(&most);
        const double largest = gk_half_largest(&size), left = round ? change * gk_min(1.0, change / last) : change;
        if (!(left > TURNED * largest)) break;
    }
    for (int i = 0; i < lanes; i++) by[i] = half[i] * sum[lanes + i], by[lanes + i] = -half[i] * sum[i];
    move_crowd(base, f->turned, rows, by, v);
}

/* Half a step of all dashpots, one after the other: speeds contract along them to those at rest under f. Returns what
 * that takes. */
double gk_crowd_damp(const gk_model *model, const gk_base *base, const gk_coefficients *k, const double *f, double *v)
{
    GK_ASSERT(base->crowd_dampers <= MAX_SUPPORTS && v);
    const gk_crowd_flow *c = &k->ground.crowd;
    const int lanes = gk_whole_halves(base->crowd_dampers);
    gk_real speed[MAX_SUPPORTS + LANES], held[MAX_SUPPORTS + LANES], by[MAX_SUPPORTS + LANES] = {0};
    double taken = 0.0;
    read_crowd(base, c->damps, lanes, v, speed);
    read_crowd(base, c->holds, lanes, f, held);
    for (int d = 0, r = 0; d < model->supports; d++) {
        if (!gk_in_crowd(base, base->damper_span[d])) continue;
        const double along = (double)speed[r] - held[r];
        taken += along * (k->ground.loss[d] * along + k->ground.gain[d] * held[r]);
        by[r] = (gk_real)(-k->ground.decay[d] * along);
        gk_sum_rows(c->pulled + r * lanes, 2 * lanes / LANES, by + r, 1, speed);
        r++;
    }
    move_crowd(base, c->pulls, lanes, by, v);
    return taken;
}
