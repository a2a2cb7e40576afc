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

/* load on the patterns of every tooth by forces of the contacts */
void gk_far_push(const gk_setup *setup, gk_work *work, int e, int which, const double *force)
{
    gk_engaged *engaged = &work->engaged[e];
    const int strips = GK_STRIPS(setup);
    GK_ASSERT(which == 0 || which == 1);
    memset(engaged->given_far[which], 0, (size_t)(engaged->places * FAR) * sizeof(double));
    for (int i = 0; i < engaged->places * strips; i++)
        if (force[i] != 0.0)
            gk_axpy(force[i], engaged->far[which] + i * FAR, engaged->given_far[which] + i / strips * FAR, 0, FAR / 4);
}

/* adds what the loads of the other engagements of a gear displace at the contacts of this one */
void gk_far_read(const gk_model *model, const gk_setup *setup, gk_work *work, int e, int which, double *read)
{
    gk_engaged *engaged = &work->engaged[e];
    const int g = setup->mesh[e].side[which].gear, z = model->gear[g].z, strips = GK_STRIPS(setup);
    GK_ASSERT(setup->far_on[g]);
    for (int p = 0; p < engaged->places; p++) {
        double moved[FAR] = {0};
        for (int other = 0; other < model->engagements; other++)
            for (int w = 0; w < 2 && other != e; w++) {
                const gk_engaged *from = &work->engaged[other];
                for (int q = 0; q < from->places && setup->mesh[other].side[w].gear == g; q++) {
                    const int after = (engaged->place[p].tooth[which] - from->place[q].tooth[w] + z) % z;
                    const double *S = setup->far[g] + (size_t)after * FAR * FAR;
                    for (int i = 0; i < FAR; i++)
                        moved[i] += gk_dot_quads(S + i * FAR, from->given_far[w] + q * FAR, FAR / 4);
                }
            }
        for (int i = p * strips; i < (p + 1) * strips; i++)
            read[i] += gk_dot_quads(engaged->far[which] + i * FAR, moved, FAR / 4);
    }
}
