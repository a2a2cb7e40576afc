/* Energy of the friction of an engagement in a step (docs/theory.md, 3.12): what it holds in what is quasi-static, what
 * it takes, and what the forces of the step leave of both for the scalar of the step's energy. */
#include "problem/gk_work.h"

/* energy that friction holds in what is quasi-static, with normal forces `force` + `more` */
static double held(const gk_glide *glide, const gk_system *s, const double *force, const double *more,
                   const double *friction)
{
    const int quads = s->stride / 4, across = (s->contacts + 3) / 4;
    double sum = 0.0, normal[MAX_STRIDE], half[MAX_STRIDE];
    for (int i = 0; i < s->stride; i++) {
        normal[i] = i < s->n ? force[i] + more[i] : 0.0;
        half[i] = i < s->contacts ? 0.5 * friction[i] : 0.0;
    }
    for (int j = 0; j < s->contacts; j++)
        if (friction[j] != 0.0)
            sum += friction[j] * (gk_dot_quads(glide->gap_yields + j * s->stride, normal, quads) +
                                  gk_dot_quads(glide->yields + j * s->stride, half, across));
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
        const double off = 0.5 * (glide->start_end[j] + glide->end[j]) - glide->mean[j];
        if (off != 0.0) sum += off * gk_dot_quads(glide->yields + j * s->stride, glide->grown, (s->contacts + 3) / 4);
    }
    return gk_min(sum, 0.0);
}

/* What the forces of the step leave of the energy that friction holds in what is quasi-static, because they are no
 * means of those at its ends: the step's one scalar balances it (docs/theory.md, eq. 12) */
double gk_friction_defect(const gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide && s);
    const int quads = s->stride / 4, across = (s->contacts + 3) / 4;
    double sum = gk_friction_held(glide, s) - glide->held0 - faded(glide, s), mean[MAX_STRIDE], more[MAX_STRIDE];
    for (int i = 0; i < s->stride; i++) {
        mean[i] = i < s->n ? gk_solve_static_mean(s, i) : 0.0;
        more[i] = i < s->n ? s->force[i] + s->dashpot.end[i] - s->force0[i] - s->dashpot.end0[i] : 0.0;
    }
    for (int j = 0; j < s->contacts; j++) {
        const double *gap = glide->gap_yields + j * s->stride;
        if (glide->grown[j] != 0.0) sum -= glide->grown[j] * gk_dot_quads(gap, mean, quads);
        if (glide->mean[j] != 0.0)
            sum -= glide->mean[j] *
                   (gk_dot_quads(gap, more, quads) + gk_dot_quads(glide->yields + j * s->stride, glide->grown, across));
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
