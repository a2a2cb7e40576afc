/* What rows of an engagement read of all that the forces of an island have moved: of spins, ground group and modes, of
 * bores and far teeth. */
#include "problem/gk_pass_read.h"
#include "force/gk_turn.h"
#include "problem/gk_exchange.h"
#include "problem/gk_far.h"
#include "problem/gk_pass.h"

/* what has moved of a side's part of the ground group: patterns or oscillators */
static const gk_real *moved_of(const gk_coupled *c, const gk_engaged *engaged, int w, int t)
{
    const gk_mesh *mesh = &c->setup->mesh[engaged->index];
    const gk_work *work = c->work;
    return engaged->by_patterns[w] ? work->move_pattern[t][mesh->side[w].gear]
                                   : work->move_ground[t] + mesh->part[w].from;
}

typedef struct seen { /* displacements, and rows on them, `width` halves each */
    const gk_half *row, *y;
    int width, halves;
} seen;

/* `each` rows side by side, whose sums do not wait for each other */
GK_INLINE void read_some(const seen *parts, int count, int i, double *read, const int each)
{
    gk_half sum[5];
    for (int l = 0; l < each; l++) sum[l] = (gk_half){0};
    for (int p = 0; p < count; p++) {
        const int width = parts[p].width;
        const gk_half *rows = parts[p].row + i * width, *y = parts[p].y;
        int k = 0;
        for (; k + 2 <= parts[p].halves; k += 2)
            for (int l = 0; l < each; l++)
                sum[l] = (sum[l] + rows[l * width + k] * y[k]) + rows[l * width + k + 1] * y[k + 1];
        for (int l = 0; l < each && k < parts[p].halves; l++) sum[l] += rows[l * width + k] * y[k];
    }
    for (int l = 0; l < each; l++) read[i + l] += gk_across(&sum[l]);
}

static void read_parts(const seen *parts, int count, int i, int end, double *read)
{
    for (; i + 5 <= end; i += 5) read_some(parts, count, i, read, 5);
    for (; i + 3 <= end; i += 3) read_some(parts, count, i, read, 3);
    for (; i < end; i++) read_some(parts, count, i, read, 1);
}

/* adds what rows read of ground group and modes: those of the gaps, joints included, or of the sliding */
static void read_group(const gk_coupled *c, const gk_engaged *engaged, int t, int along, double *read)
{
    gk_work *work = c->work;
    gk_real *const *basis = along ? engaged->glide->basis : engaged->basis,
                   *turned[2] = {work->turned, work->turned_next};
    const gk_system *s = &engaged->system;
    seen parts[6];
    int count = 0, at = 0;
    for (int w = 0; w < 2; w++) {
        const int g = c->setup->mesh[engaged->index].side[w].gear, width = 2 * GK_LANES(c->setup, g) / LANES;
        const int yields = gk_halves(c->k->flow[g].softest);
        const gk_half *row = (const gk_half *)basis[w], *y = (const gk_half *)turned[w];
        if (!width || c->k->timeless || (t == YIELDED && !yields)) continue;
        gk_turn_back(&c->setup->modal[g], engaged->position[w].tooth, work->move_modes[t][g], turned[w]);
        if (t == WHOLE) {
            parts[count++] = (seen){row, y, width, width};
            continue;
        }
        parts[count++] = (seen){row, y, width, yields};
        parts[count++] = (seen){row + width / 2, y + width / 2, width, yields};
    }
    const int modes = count;
    for (int w = 0; w < 2; at += gk_halves(engaged->wide[w++])) {
        const gk_half *y = (const gk_half *)moved_of(c, engaged, w, t);
        const gk_half *row = (const gk_half *)(along ? engaged->glide->near : engaged->near) + at;
        parts[count++] = (seen){row, y, engaged->halves, gk_halves(engaged->wide[w])};
    }
    read_parts(parts, count, 0, s->contacts, read);
    if (!along) read_parts(parts + modes, count - modes, s->contacts, s->n, read);
}

static void read_bores(const gk_coupled *c, const gk_engaged *engaged, int t, double *read)
{
    gk_bores others;
    for (int p = 0; p < c->model->ports; p++) {
        others.moment[p] = c->work->push_bores[t].moment[p] - engaged->own_bores[t].moment[p];
        others.turned[p] = c->work->push_bores[t].turned[p] - engaged->own_bores[t].turned[p];
    }
    gk_exchange_read_bores(c->setup, engaged, &others, read);
}

/* adds what rows of an engagement read of spins, ground group and modes: WHOLE or YIELDED */
static void read_dynamic(const gk_coupled *c, const gk_engaged *engaged, int t, double *read)
{
    const gk_mesh *mesh = &c->setup->mesh[engaged->index];
    const gk_system *s = &engaged->system;
    read_group(c, engaged, t, 0, read);
    for (int l = 0; l < mesh->spins; l++) {
        gk_axpy(c->work->move_spin[t][mesh->spin[l]], s->rigid[l], read, 0, s->stride / 4);
        for (int i = s->n - s->joint.clutches; i < s->n && t == WHOLE; i++)
            read[i] += c->work->yield_spin[mesh->spin[l]] * s->rigid[l][i];
    }
}

/* adds what they read of bores and, in `far`, of far teeth */
static void read_static(const gk_coupled *c, const gk_engaged *engaged, int t, const double *far, double *read)
{
    read_bores(c, engaged, t, read);
    gk_axpy(1.0, far, read, 0, engaged->system.stride / 4);
}

/* what rows of an engagement read: WHOLE or YIELDED; far: of far teeth */
void gk_pass_read(const gk_coupled *c, int e, int t, const double *far)
{
    GK_ASSERT(gk_is_within(c, e) && far);
    gk_engaged *engaged = &c->work->engaged[e];
    double *read = engaged->moved[t];
    gk_solve_times(&engaged->system, engaged->rest, engaged->forces.of[t == WHOLE ? ONCE : AT_ONCE], read);
    read_dynamic(c, engaged, t, read);
    read_static(c, engaged, t, far, read);
}

/* what the sliding of contacts reads, without what is not dynamic in their own engagement */
void gk_pass_read_along(const gk_coupled *c, int e)
{
    GK_ASSERT(gk_is_within(c, e));
    gk_engaged *engaged = &c->work->engaged[e];
    const gk_mesh *mesh = &c->setup->mesh[e];
    gk_clear(engaged->glide->moved_along, engaged->system.stride / 4);
    read_group(c, engaged, WHOLE, 1, engaged->glide->moved_along);
    for (int l = 0; l < mesh->spins; l++)
        gk_axpy(c->work->move_spin[WHOLE][mesh->spin[l]], engaged->glide->rigid[l], engaged->glide->moved_along, 0,
                engaged->system.stride / 4);
}

void gk_pass_read_unit(const gk_coupled *c, int e)
{
    gk_engaged *engaged = &c->work->engaged[e];
    double far[MAX_STRIDE], *all = engaged->moved[YIELDED], *fixed = engaged->moved[WHOLE];
    GK_ASSERT(gk_is_within(c, e));
    gk_far_read(c->setup, engaged, far);
    gk_clear(all, engaged->system.stride / 4), gk_clear(fixed, engaged->system.stride / 4);
    read_dynamic(c, engaged, YIELDED, all);
    read_static(c, engaged, YIELDED, far, all);
    read_static(c, engaged, YIELDED, far, fixed);
}
