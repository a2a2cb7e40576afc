/* Energy of the friction of an engagement in a step (docs/theory.md, 3.12): what it holds in what is quasi-static, what
 * it takes, and what the forces of the step leave of both for the scalar of the step's energy. */
#include "problem/gk_work.h"

/* energy that friction holds in what is quasi-static, with normal forces `force` + `more` */
static double held(const gk_glide *glide, const gk_system *s, const double *force, const double *more,
                   const double *friction)
{
    double sum = 0.0;
    for (int j = 0; j < s->contacts; j++) {
        double deflection = 0.0;
        for (int i = 0; i < s->n; i++) deflection += glide->gap_yields[j * s->stride + i] * (force[i] + more[i]);
        for (int i = 0; i < s->contacts; i++) deflection += 0.5 * glide->yields[j * s->stride + i] * friction[i];
        sum += friction[j] * deflection;
    }
    return sum;
}

double gk_friction_held0(const gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && s);
    return held(glide, s, s->force0, s->dashpot.end0, glide->start_end);
}

double gk_friction_held(const gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && s);
    return held(glide, s, s->force, s->dashpot.end, glide->end);
}

/* What a mean of friction that is not that of both ends leaves of the energy it holds along the profile: taken where it
 * is less than nothing */
static double faded(const gk_glide *glide, const gk_system *s)
{
    double sum = 0.0;
    for (int j = 0; j < s->contacts; j++) {
        const double *own = glide->yields + j * s->stride;
        const double off = 0.5 * (glide->start_end[j] + glide->end[j]) - glide->mean[j];
        for (int k = 0; k < s->contacts && off != 0.0; k++) sum += off * own[k] * (glide->end[k] - glide->start_end[k]);
    }
    return gk_min(sum, 0.0);
}

/* What the forces of the step leave of the energy that friction holds in what is quasi-static, because they are no
 * means of those at its ends: the step's one scalar balances it (docs/theory.md, eq. 12) */
double gk_friction_defect(const gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && s);
    double sum = gk_friction_held(glide, s) - glide->held0 - faded(glide, s);
    for (int j = 0; j < s->contacts; j++) {
        const double *gap = glide->gap_yields + j * s->stride, *own = glide->yields + j * s->stride;
        const double moved = glide->end[j] - glide->start_end[j];
        for (int i = 0; i < s->n; i++)
            sum -= gap[i] * (gk_solve_static_mean(s, i) * moved +
                             glide->mean[j] * (s->force[i] + s->dashpot.end[i] - s->force0[i] - s->dashpot.end0[i]));
        for (int k = 0; k < s->contacts; k++) sum -= glide->mean[k] * own[k] * moved;
    }
    return sum;
}

/* what friction takes in the step; its sliding is known */
double gk_friction_taken(const gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && s);
    double taken = -faded(glide, s);
    for (int j = 0; j < s->contacts; j++) taken -= glide->mean[j] * gk_friction_slid(glide, j);
    return taken;
}
