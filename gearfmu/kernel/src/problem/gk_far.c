/* Engagements of one gear feel each other at once through what is not dynamic in it: FAR patterns on a tooth, S between
 * two teeth (setup/gk_far_fill.c). A contact presses inward and its row measures outward, on both sides, so that the
 * signs cancel: a force opens the gaps of the others. */
#include "problem/gk_work.h"

/* patterns of the contacts, between two nodes */
void gk_far_form(const gk_setup *setup, gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    const int strips = GK_STRIPS(setup);
    GK_ASSERT(engaged->places >= 0 && engaged->places <= MAX_PAIRS);
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        const gk_position *at = &engaged->position[w];
        const size_t points = (size_t)(side->candidates * strips);
        for (int p = 0; p < engaged->places && setup->far_on[side->gear]; p++) {
            const size_t point = (size_t)at->node * points + (size_t)(engaged->place[p].candidate[w] * strips);
            const double *low = side->far + point * FAR, *high = low + points * FAR;
            double *to = engaged->far[w] + (size_t)(p * strips * FAR);
            for (int i = 0; i < strips * FAR; i++) to[i] = low[i] + at->part * (high[i] - low[i]);
        }
    }
}

/* Adds to a block what forces of the contacts of s->engagement[1] displace at those of s->engagement[0]: U S Uᵀ. The
 * same block is read in both directions, so that it is symmetric whatever S is rounded to. */
void gk_far_between(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_shared *s)
{
    const gk_engaged *to = &work->engaged[s->engagement[0]], *from = &work->engaged[s->engagement[1]];
    const double *U = to->far[s->side[0]], *V = from->far[s->side[1]];
    const int z = model->gear[s->gear].z, strips = GK_STRIPS(setup), stride = s->stride;
    GK_ASSERT(setup->far_on[s->gear]);
    for (int q = 0; q < from->places; q++)
        for (int p = 0; p < to->places; p++) {
            const int before = (from->place[q].tooth[s->side[1]] - to->place[p].tooth[s->side[0]] + z) % z;
            const double *S = setup->far[s->gear] +
                              (size_t)before * FAR * FAR; /* its rows: columns of the other sense */
            for (int j = q * strips; j < (q + 1) * strips; j++) {
                gk_quad moved[FAR / 4] = {{0}};
                for (int k = 0; k < FAR; k++)
                    for (int n = 0; n < FAR / 4; n++) moved[n] += V[j * FAR + k] * ((const gk_quad *)(S + k * FAR))[n];
                for (int i = p * strips; i < (p + 1) * strips; i++)
                    s->far[j * stride + i] = gk_dot_quads(U + i * FAR, (const double *)moved, FAR / 4);
            }
        }
}
