/* Islands: engagements that act on each other within a step and are solved in turns (gk_couple.c). */
#include "setup/gk_islands.h"

/* Do two gears turn together, or read a common ground oscillator? Their lists ascend. */
static int share_coordinates(const gk_gear *a, const gk_gear *b, int set)
{
    if (a->rotor == b->rotor) return 1;
    for (int i = 0, j = 0; i < a->ground[set].reads && j < b->ground[set].reads;) {
        const int32_t one = a->ground[set].list[i], other = b->ground[set].list[j];
        if (one == other) return 1;
        i += one < other, j += other < one;
    }
    return 0;
}

static int are_coupled(const gk_model *model, int set, const gk_engagement *a, const gk_engagement *b)
{
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            if (share_coordinates(&model->gear[a->gear[i]], &model->gear[b->gear[j]], set)) return 1;
    return gk_frame_of(model, a) >= 0 && gk_frame_of(model, a) == gk_frame_of(model, b);
}

/* Engagements that share coordinates belong to one island */
void gk_islands_find(const gk_model *model, gk_setup *setup)
{
    GK_ASSERT(setup->base.set >= 0 && setup->base.set < model->sets);
    for (int e = 0; e < model->engagements; e++) setup->mesh[e].island = -1;
    setup->islands = 0;
    for (int root = 0; root < model->engagements; root++) {
        if (setup->mesh[root].island >= 0) continue;
        setup->mesh[root].island = setup->islands;
        for (int changed = 1; changed;) {
            changed = 0;
            for (int a = 0; a < model->engagements; a++)
                for (int b = 0; b < model->engagements; b++) {
                    if (setup->mesh[a].island != setup->islands || setup->mesh[b].island >= 0) continue;
                    if (!are_coupled(model, setup->base.set, &model->engagement[a], &model->engagement[b])) continue;
                    setup->mesh[b].island = setup->islands;
                    changed = 1;
                }
        }
        setup->islands++;
    }
    for (int a = 0; a < model->engagements; a++) {
        setup->mesh[a].coupled = 0;
        for (int b = 0; b < model->engagements; b++)
            setup->mesh[a].coupled |= a != b && setup->mesh[a].island == setup->mesh[b].island;
    }
}
