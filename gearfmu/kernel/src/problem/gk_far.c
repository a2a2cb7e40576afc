/* Engagements of one gear feel each other at once through what is not dynamic in it: FAR patterns on a tooth, S between
 * two teeth (setup/gk_far_fill.c), which is the transpose of S the other way round. A contact presses inward and its
 * row measures outward, on both sides, so that the signs cancel: a force opens the gaps of the others. */
#include "problem/gk_far.h"

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
            for (int i = 0; i < strips; i++, low += FAR, high += FAR) {
                gk_four *to = (gk_four *)(engaged->far[w] + (size_t)(p * strips + i) * LANES);
                for (int n = 0; n < FAR / 4; n++) {
                    const gk_quad a = ((const gk_quad *)low)[n], b = ((const gk_quad *)high)[n];
                    to[n] = __builtin_convertvector(a + at->part * (b - a), gk_four);
                }
                to[FAR / 4] = (gk_four){0};
            }
        }
    }
}

/* no loads: nothing has moved */
void gk_far_rest(const gk_setup *setup, gk_engaged *engaged)
{
    for (int w = 0; w < 2; w++)
        for (int p = 0; p < engaged->places && setup->far_on[setup->mesh[engaged->index].side[w].gear]; p++) {
            gk_far_tooth *tooth = &engaged->far_tooth[w][p];
            tooth->loaded = 0;
            ((gk_half *)tooth->moved)[0] = ((gk_half *)tooth->moved)[1] = (gk_half){0};
        }
}

/* forces of contacts as loads on the patterns of their teeth */
void gk_far_push(const gk_setup *setup, gk_engaged *engaged, const double *force)
{
    GK_ASSERT(force);
    const int strips = GK_STRIPS(setup);
    for (int w = 0; w < 2; w++) {
        const gk_half *U = (const gk_half *)engaged->far[w];
        for (int p = 0, i = 0; p < engaged->places && setup->far_on[setup->mesh[engaged->index].side[w].gear]; p++) {
            gk_far_tooth *tooth = &engaged->far_tooth[w][p];
            gk_half low = {0}, high = {0};
            tooth->loaded = 0;
            for (int strip = 0; strip < strips; strip++, i++, U += 2) {
                const gk_real x = (gk_real)force[i];
                tooth->loaded |= x != 0;
                low += x * U[0], high += x * U[1];
            }
            ((gk_half *)tooth->load)[0] = low, ((gk_half *)tooth->load)[1] = high;
            ((gk_half *)tooth->moved)[0] = ((gk_half *)tooth->moved)[1] = (gk_half){0};
        }
    }
}

/* teeth of two engagements on one gear */
static void list_teeth(const gk_coupled *c, gk_engaged *from, int v, gk_engaged *to, int w)
{
    gk_work *work = c->work;
    const int g = c->setup->mesh[to->index].side[w].gear, z = c->model->gear[g].z;
    for (int q = 0; q < from->places; q++)
        for (int p = 0; p < to->places; p++) {
            const int before = (from->place[q].tooth[v] - to->place[p].tooth[w] + z) % z;
            GK_ASSERT(work->far_pairs < work->most_far_pairs);
            work->far_pair[work->far_pairs++] = (gk_far_pair){c->setup->far[g] + (size_t)before * FAR * LANES,
                                                              &from->far_tooth[v][q], &to->far_tooth[w][p]};
        }
}

/* Lists pairs of teeth that feel each other in an island */
void gk_far_list(const gk_coupled *c)
{
    c->work->far_pairs = 0;
    for (int g = 0; g < c->model->gears; g++) {
        int side[2 * MAX_ENGAGEMENTS], count = 0;
        for (int i = 0; i < 2 * c->model->engagements && c->setup->far_on[g]; i++) {
            const gk_mesh *mesh = &c->setup->mesh[i / 2];
            if (mesh->island == c->island && mesh->side[i % 2].gear == g) side[count++] = i;
        }
        for (int i = 0; i < count; i++)
            for (int j = 0; j < count; j++)
                if (side[i] / 2 != side[j] / 2)
                    list_teeth(c, &c->work->engaged[side[j] / 2], side[j] % 2, &c->work->engaged[side[i] / 2],
                               side[i] % 2);
    }
}

/* what loads on teeth move at those that were listed */
void gk_far_move(const gk_work *work)
{
    for (int i = 0; i < work->far_pairs; i++) {
        const gk_far_pair *p = &work->far_pair[i];
        const gk_half *S = (const gk_half *)p->S;
        gk_half *moved = (gk_half *)p->to->moved, low = moved[0], high = moved[1];
        if (!p->from->loaded) continue;
        for (int k = 0; k < FAR; k++) low += p->from->load[k] * S[2 * k], high += p->from->load[k] * S[2 * k + 1];
        moved[0] = low, moved[1] = high;
    }
}

/* Fills what contacts read of it, 0 in joints */
void gk_far_read(const gk_setup *setup, const gk_engaged *engaged, double *read)
{
    GK_ASSERT(read);
    const int strips = GK_STRIPS(setup);
    gk_half sum[MAX_CONTACTS];
    int any = 0;
    gk_clear(read, engaged->system.stride / 4);
    for (int w = 0; w < 2; w++) {
        const gk_half *U = (const gk_half *)engaged->far[w];
        if (!setup->far_on[setup->mesh[engaged->index].side[w].gear]) continue;
        for (int p = 0, i = 0; p < engaged->places; p++) {
            const gk_half *moved = (const gk_half *)engaged->far_tooth[w][p].moved, low = moved[0], high = moved[1];
            for (const int end = i + strips; i < end;) {
                const gk_half here = low * U[2 * i] + high * U[2 * i + 1];
                if (any)
                    sum[i++] += here;
                else
                    sum[i++] = here;
            }
        }
        any = 1;
    }
    for (int i = 0; i < engaged->system.contacts && any; i++) read[i] = gk_across(&sum[i]);
}
