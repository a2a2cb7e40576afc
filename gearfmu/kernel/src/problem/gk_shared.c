/* Gears that two engagements share: what forces of one do to the gaps of the other through modes of the gear and
 * through far teeth, as blocks of contacts × contacts that are formed once a step. Engagements then exchange some
 * hundred products a round instead of gathering and scattering over oscillators. */
#include "problem/gk_shared.h"
#include "force/gk_turn.h"

/* Rows of the contacts on the modes of a gear in axes of the gear, so that rows of several engagements meet */
static void turn_rows(const gk_model *model, const gk_setup *setup, gk_work *work, int e, int which)
{
    const gk_engaged *engaged = &work->engaged[e];
    const int g = setup->mesh[e].side[which].gear, z = model->gear[g].z, n = setup->modal[g].n;
    const int back = (z - engaged->position[which].tooth) % z;
    for (int i = 0; i < engaged->system.contacts * n; i += n)
        gk_turn_back(&setup->modal[g], back, engaged->basis[which] + i, engaged->turned[which] + i);
}

/* R mobility Rᵀ and −R κ Rᵀ over the modes of the gear */
static void form_modes(const gk_setup *setup, const gk_flow *flow, gk_work *work, gk_shared *s)
{
    const gk_engaged *to = &work->engaged[s->engagement[0]], *from = &work->engaged[s->engagement[1]];
    const gk_modal *m = &setup->modal[s->gear];
    const int width = 2 * m->n / LANES, half = width / 2, lanes = 2 * flow->yields / LANES, rows = to->system.contacts;
    const gk_half *a = (const gk_half *)to->turned[s->side[0]], *b = (const gk_half *)from->turned[s->side[1]];
    const gk_half *mobility = (const gk_half *)flow->mobility, *kappa = (const gk_half *)flow->kappa;
    gk_half *scaled = (gk_half *)work->scaled;
    for (int j = 0; j < from->system.contacts; j++, b += width) {
        for (int k = 0; k < width; k++) scaled[k] = b[k] * mobility[k];
        gk_multiply_rows(scaled, a, rows, width, width, s->moves + j * s->stride);
        for (int first = 0; first < width && lanes; first += half) {
            for (int k = first; k < first + lanes; k++) scaled[k] = -b[k] * kappa[k];
            gk_multiply_rows(scaled + first, a + first, rows, width, lanes, s->yielded + j * s->stride);
        }
    }
}

/* Forms the blocks of an island, −1: of all. With friction, which couples sliding too, modes are gathered and scattered
 * (gk_couple.c), and blocks hold far teeth alone. */
void gk_shared_form(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, gk_work *work, int island)
{
    GK_ASSERT(island >= -1 && island < setup->islands);
    const int modes = !k->timeless && !GK_ON(setup, friction);
    for (int e = 0; e < model->engagements && modes; e++)
        for (int w = 0; w < 2; w++)
            if ((island < 0 || setup->mesh[e].island == island) &&
                setup->engagements_of[setup->mesh[e].side[w].gear] > 1)
                turn_rows(model, setup, work, e, w);
    for (int p = 0; p < work->shareds; p++) {
        gk_shared *s = &work->shared[p];
        if (island >= 0 && setup->mesh[s->engagement[0]].island != island) continue;
        s->stride = (work->engaged[s->engagement[0]].system.contacts + 3) / 4 * 4;
        const int quads = work->engaged[s->engagement[1]].system.contacts * s->stride / 4;
        s->far_on = setup->far_on[s->gear];
        s->dynamic = modes && GK_LANES(setup, s->gear) > 0;
        s->yields = s->dynamic && k->flow[s->gear].yields > 0;
        if (s->far_on) gk_clear(s->far, quads), gk_far_between(model, setup, work, s);
        if (s->dynamic) gk_clear(s->moves, quads);
        if (s->yields) gk_clear(s->yielded, quads);
        if (s->dynamic) form_modes(setup, &k->flow[s->gear], work, s);
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

/* Adds what the forces of the other engagements do to the contacts of this one; forces of joints are 0 in the blocks.
 * at_once: forces in the step are 0 */
void gk_shared_read(const gk_work *work, int e, int at_once, double *read)
{
    for (int p = 0; p < work->shareds; p++) {
        const gk_shared *s = &work->shared[p];
        const int second = s->engagement[1] == e;
        if (!second && s->engagement[0] != e) continue;
        const gk_forces *f = &work->engaged[s->engagement[!second]].forces;
        const int columns = work->engaged[s->engagement[1]].system.contacts;
        if (s->dynamic && !at_once) add_block(s, second, s->moves, f->step, columns, read);
        if (s->yields) add_block(s, second, s->yielded, f->once, columns, read);
        if (s->far_on) add_block(s, second, s->far, f->far, columns, read);
    }
}
