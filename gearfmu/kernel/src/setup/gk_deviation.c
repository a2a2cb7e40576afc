/* Flanks that are no nominal involutes, and toothings that do not run true (docs/theory.md, 2.2 and 2.1): tables that
 * an engagement reads, and what a gear's angle does to the place of its teeth. */
#include "setup/gk_setup.h"

/* ---- deviations of flanks ---------------------------------------------------------------------------------------- */
size_t gk_deviation_size(const gk_gear *gear, int lines)
{
    GK_ASSERT(gear && lines > 0);
    const gk_field_of_flanks *field = &gear->flanks;
    return field->depth ? 2 * (size_t)(field->teeth * field->rolls * (field->places > 1 ? lines : 1)) : 0;
}

/* adds `share` of the field's line at x, −1 … 1 of the half-width; between two places straight */
static void add_line(const gk_field_of_flanks *field, const double *depth, double x, double share, double *line)
{
    const double u = gk_clamp(0.5 * (x + 1.0), 0.0, 1.0) * (field->places - 1);
    const int at = (int)u < field->places - 1 ? (int)u : field->places - 2;
    const double *low = depth + at * field->rolls, *high = low + field->rolls, part = u - at;
    for (int i = 0; i < field->rolls; i++) line[i] += share * (low[i] + part * (high[i] - low[i]));
}

void gk_deviation_fill(const gk_setup *setup, const gk_gear *gear, int lines, const double *from, const double *to,
                       gk_deviation *d)
{
    GK_ASSERT(gear && d && lines > 0 && from && to);
    enum { SAMPLES = 16 };
    const gk_field_of_flanks *field = &gear->flanks;
    const int on = GK_ON(setup, flank_deviations) && field->depth, samples = from == to ? 1 : SAMPLES;
    d->gear = on ? gear : NULL;
    d->shared = NULL;
    d->lines = field->places > 1 ? lines : 1;
    for (int tooth = 0; on && tooth < 2 * field->teeth; tooth++)
        for (int j = 0; j < d->lines; j++) {
            const double *depth = field->depth + (size_t)(tooth * field->places) * (size_t)field->rolls;
            double *line = d->depth + (size_t)(tooth * d->lines + j) * (size_t)field->rolls;
            memset(line, 0, (size_t)field->rolls * sizeof *line);
            for (int i = 0; i < samples && field->places > 1; i++)
                add_line(field, depth, from[j] + (to[j] - from[j]) * (i + 0.5) / samples, 1.0 / samples, line);
            if (field->places == 1) memcpy(line, depth, (size_t)field->rolls * sizeof *line);
        }
}

void gk_deviation_share(const gk_setup *setup, const gk_gear *gear, gk_deviation *d)
{
    GK_ASSERT(gear && d);
    d->gear = GK_ON(setup, flank_deviations) && gear->flanks.depth ? gear : NULL;
    d->lines = gear->flanks.places;
    d->shared = gear->flanks.depth;
}

const double *gk_deviation_line(const gk_deviation *d, int tooth, int flank, int line)
{
    GK_ASSERT((flank == 0 || flank == 1) && line >= 0);
    GK_ASSERT(!d->gear || (tooth >= 0 && tooth < d->gear->z));
    if (!GK_HAS(flank_deviations) || !d->gear) return NULL;
    const gk_field_of_flanks *field = &d->gear->flanks;
    const int row = ((field->teeth > 1 ? 2 * tooth : 0) + flank) * d->lines + (d->lines > 1 ? line : 0);
    return (d->shared ? d->shared : d->depth) + (size_t)row * (size_t)field->rolls;
}

double gk_deviation_at(const gk_gear *gear, const double *line, double roll, double *slope)
{
    GK_ASSERT(gear && line && slope && gear->flanks.rolls >= 4);
    const double low = gk_min(gear->s_form, gear->s_tip), high = gk_max(gear->s_form, gear->s_tip);
    const double inside = gk_clamp(roll, low, high);
    const gk_grid at = gk_grid_flank(gear, gear->flanks.rolls, inside);
    double depth = 0.0;
    *slope = 0.0;
    for (int i = 0; i < 4; i++) depth += at.weight[i] * line[at.index + i], *slope += at.slope[i] * line[at.index + i];
    return depth + (roll - inside) * *slope;
}

/* ---- toothings that do not run true ------------------------------------------------------------------------------ */
int gk_runout_move(const gk_model *model, const gk_setup *setup, const gk_engagement *e, double *pose, double *turn)
{
    GK_ASSERT(e && pose && turn && pose != turn);
    int any = 0;
    memset(turn, 0, POSE * sizeof *turn);
    for (int w = 0; w < 2 && GK_ON(setup, runout); w++) {
        const gk_gear *gear = &model->gear[e->gear[w]];
        double sine, cosine, *at = pose + SPACE * w, *rate = turn + SPACE * w;
        if (!gear->runout) continue;
        gk_sincos(at[PHIA] + gear->phase, &sine, &cosine);
        for (int c = 0; c < 2; c++) {
            const double x = gear->runout[2 * c], y = gear->runout[2 * c + 1];
            const double there[2] = {cosine * x - sine * y, sine * x + cosine * y};
            const int to = c ? RXA : XA;
            at[to] += there[0], at[to + 1] += there[1];
            rate[to] = -there[1], rate[to + 1] = there[0];
        }
        any = 1;
    }
    return any;
}

static const int TURNING[] = {XA, YA, RXA, RYA}; /* parts of a pose that a toothing's runout moves */

void gk_runout_follow(const double *turn, double *motion)
{
    GK_ASSERT(turn && motion && turn != motion);
    for (int w = 0; w < 2; w++)
        for (int i = 0; i < 4; i++)
            motion[SPACE * w + TURNING[i]] += turn[SPACE * w + TURNING[i]] * motion[SPACE * w + PHIA];
}

void gk_runout_turn(const double *turn, double *gradient)
{
    GK_ASSERT(turn && gradient && turn != gradient);
    for (int w = 0; w < 2; w++)
        for (int i = 0; i < 4; i++)
            gradient[SPACE * w + PHIA] += turn[SPACE * w + TURNING[i]] * gradient[SPACE * w + TURNING[i]];
}
