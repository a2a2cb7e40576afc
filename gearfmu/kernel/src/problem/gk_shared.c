/* Gears that two engagements share: what forces of one do to the gaps of the other at once through far teeth, as blocks
 * of contacts × contacts that are formed once a step. */
#include "problem/gk_shared.h"

/* Forms the blocks of an island, −1: of all. */
void gk_shared_form(const gk_model *model, const gk_setup *setup, gk_work *work, int island)
{
    GK_ASSERT(island >= -1 && island < setup->islands);
    for (int p = 0; p < work->shareds; p++) {
        gk_shared *s = &work->shared[p];
        if (!setup->far_on[s->gear] || (island >= 0 && setup->mesh[s->engagement[0]].island != island)) continue;
        s->stride = (work->engaged[s->engagement[0]].system.contacts + 3) / 4 * 4;
        gk_clear(s->far, work->engaged[s->engagement[1]].system.contacts * s->stride / 4);
        gk_far_between(model, setup, work, s);
    }
}

/* adds block·x to the rows of the first engagement */
GK_INLINE void to_first(const double *block, const double *x, int columns, double *read, const int quads)
{
    gk_quad sum[MAX_CONTACTS / 4 + 1];
    for (int q = 0; q < quads; q++) sum[q] = ((const gk_quad *)read)[q];
    for (int j = 0; j < columns; j++) {
        if (x[j] == 0.0) continue;
        for (int q = 0; q < quads; q++) sum[q] += x[j] * ((const gk_quad *)block)[j * quads + q];
    }
    for (int q = 0; q < quads; q++) ((gk_quad *)read)[q] = sum[q];
}

/* adds blockᵀ·x to the rows of the second */
GK_INLINE void to_second(const double *block, const double *x, int columns, double *read, const int quads)
{
    for (int j = 0; j < columns; j++) read[j] += gk_dot_quads(block + 4 * j * quads, x, quads);
}

static void add_block(const gk_shared *s, int second, const double *block, const double *x, int columns, double *read)
{
    if (second) {
        GK_SIZED(s->stride / 4, to_second, block, x, columns, read)
    } else {
        GK_SIZED(s->stride / 4, to_first, block, x, columns, read)
    }
}

/* Adds what forces of other engagements do to the contacts of this one; forces of joints are 0 in the blocks. */
void gk_shared_read(const gk_setup *setup, const gk_work *work, int e, double *read)
{
    for (int p = 0; p < work->shareds; p++) {
        const gk_shared *s = &work->shared[p];
        const int second = s->engagement[1] == e;
        if (!setup->far_on[s->gear] || (!second && s->engagement[0] != e)) continue;
        const gk_forces *f = &work->engaged[s->engagement[!second]].forces;
        add_block(s, second, s->far, f->far, work->engaged[s->engagement[1]].system.contacts, read);
    }
}
