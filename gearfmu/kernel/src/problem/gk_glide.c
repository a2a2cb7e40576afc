/* What friction does: friction of every contact to all gaps and to the sliding of all contacts, in the step (D of the
 * rows along the profile) and at once (C − K), from tables, modes, ground group and spins (docs/theory.md, 3.12). */
#include "problem/gk_work.h"
#include "problem/gk_exchange.h"
#include "problem/gk_rows.h"

/* of a side in a step: its two nodes, linear between them */
typedef struct slide_nodes {
    const gk_real *normal, *own;
    size_t columns, next;
    double part;
    int candidate[MAX_PAIRS];
} slide_nodes;

static slide_nodes nodes_of(const gk_engaged *engaged, const gk_side *side)
{
    const gk_position *at = &engaged->position[side->which];
    slide_nodes n = {.columns = (size_t)side->columns, .part = at->part};
    n.next = (size_t)(side->candidates * GK_STRIPS(&engaged->system)) * n.columns;
    n.normal = side->along.normal + (size_t)at->node * n.next, n.own = side->along.own + (size_t)at->node * n.next;
    for (int p = 0; p < engaged->places; p++) n.candidate[p] = engaged->place[p].candidate[side->which];
    return n;
}

GK_INLINE double slid_between(const gk_real *low, size_t next, double part)
{
    return low[0] + part * ((double)low[next] - low[0]);
}

/* what friction yields that is not dynamic, from the tables of both sides */
GK_INLINE void slide_residual(const slide_nodes side[2], int places, int stride, gk_glide *glide, const int strips)
{
    const size_t next[2] = {side[0].next, side[1].next};
    const double part[2] = {side[0].part, side[1].part};
    for (int p = 0, i = 0; p < places; p++)
        for (int a = 0; a < strips; a++, i++) {
            double *gap = glide->gap_yields + i, *own = glide->yields + i;
            for (int q = 0; q < places; q++) {
                size_t at[2];
                for (int w = 0; w < 2; w++)
                    at[w] = (size_t)(side[w].candidate[p] * strips + a) * side[w].columns +
                            (size_t)(side[w].candidate[q] * strips);
                const gk_real *const normal[2] = {side[0].normal + at[0], side[1].normal + at[1]};
                const gk_real *const along[2] = {side[0].own + at[0], side[1].own + at[1]};
                for (int b = 0; b < strips; b++, gap += stride, own += stride) {
                    *gap = slid_between(normal[0] + b, next[0], part[0]) +
                           slid_between(normal[1] + b, next[1], part[1]);
                    *own = slid_between(along[0] + b, next[0], part[0]) + slid_between(along[1] + b, next[1], part[1]);
                }
            }
        }
}

/* rows of gaps and sliding on all lanes: modes of both gears, ground group, spins; in halves */
typedef struct slide_lanes {
    int modes[2], ground, all;
    gk_half *gaps, *slides, *moves, *yields; /* (rows, all), (contacts, all); of a row times mobility, −κ */
    const gk_half *mobility, *kappa;
} slide_lanes;

static slide_lanes lanes_of(const gk_setup *setup, const gk_mesh *mesh, const gk_system *s, const gk_glide *glide)
{
    slide_lanes l = {.ground = gk_halves(mesh->local)};
    for (int w = 0; w < 2; w++) l.modes[w] = GK_LANES(setup, mesh->side[w].gear) * 2 / LANES;
    l.all = l.modes[0] + l.modes[1] + l.ground + gk_halves(MAX_LOCAL);
    l.moves = (gk_half *)glide->lanes + 2 * l.all;
    l.yields = l.moves + l.all;
    l.gaps = l.yields + l.all;
    l.slides = l.gaps + s->n * l.all;
    l.mobility = (const gk_half *)glide->lanes, l.kappa = l.mobility + l.all;
    return l;
}

/* doubles in whole halves; their count is a multiple of four */
static void round_lanes(const double *from, int count, gk_half *to)
{
    const int whole = count / 8;
    for (int k = 0; k < whole; k++) to[k] = GK_ROUNDED(((const gk_eight *)from)[k]);
    if (count % 8 == 0) return;
    to[whole] = (gk_half){0};
    *(gk_four *)(to + whole) = __builtin_convertvector(*(const gk_quad *)(from + 8 * whole), gk_four);
}

static void fill_lanes(const slide_lanes *l, const gk_rows *rows, const double (*rigid)[MAX_STRIDE], gk_half *to)
{
    const gk_mesh *mesh = &rows->setup->mesh[rows->engaged->index];
    const int contacts = rows->engaged->system.contacts;
    gk_half *lane = to;
    for (int w = 0; w < 2; lane += l->modes[w++]) {
        const gk_half *from = (const gk_half *)rows->basis[w];
        for (int i = 0; i < contacts; i++, from += l->modes[w])
            for (int k = 0; k < l->modes[w]; k++) lane[i * l->all + k] = from[k];
        for (int i = contacts; i < rows->count; i++)
            for (int k = 0; k < l->modes[w]; k++) lane[i * l->all + k] = (gk_half){0};
    }
    for (int i = 0; i < rows->count; i++, lane += l->all) {
        round_lanes(rows->ground + (size_t)(i * mesh->local), mesh->local, lane);
        lane[l->ground] = (gk_half){0};
        for (int d = 0; d < mesh->spins; d++) lane[l->ground][d] = (gk_real)rigid[d][i];
    }
}

/* mobility and κ of all lanes */
static void fill_coefficients(const slide_lanes *l, const gk_setup *setup, const gk_mesh *mesh,
                              const gk_coefficients *k, gk_half *to, int kappa)
{
    double ground[MAX_GROUND + 4 * MAX_ROTORS];
    gk_local_gather(mesh, kappa ? k->ground.kappa : k->ground.mobility, ground);
    for (int w = 0; w < 2; to += l->modes[w++]) {
        const gk_flow *flow = &k->flow[mesh->side[w].gear];
        memcpy(to, kappa ? flow->kappa : flow->mobility, (size_t)l->modes[w] * sizeof *to);
    }
    round_lanes(ground, mesh->local, to);
    to[l->ground] = (gk_half){0};
    for (int d = 0; d < mesh->spins; d++)
        to[l->ground][d] = (gk_real)((kappa ? k->rigid_kappa : k->rigid_mobility) *
                                     setup->inverse_inertia[mesh->spin[d]]);
}

/* What friction does through oscillators and spins in the step k: (contacts, stride) of the gaps and, symmetric, of the
 * sliding */
void gk_glide_moves(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e) && work->engaged[e].glide);
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    gk_glide *glide = engaged->glide;
    const int contacts = s->contacts, quads = s->stride / 4;
    const slide_lanes l = lanes_of(setup, mesh, s, glide);
    fill_coefficients(&l, setup, mesh, k, (gk_half *)glide->lanes, 0);
    fill_coefficients(&l, setup, mesh, k, (gk_half *)glide->lanes + l.all, 1);
    const gk_rows gaps = gk_rows_of_gaps(setup, work, e), sliding = gk_rows_of_sliding(setup, work, e);
    fill_lanes(&l, &gaps, s->rigid, l.gaps);
    fill_lanes(&l, &sliding, glide->rigid, l.slides);
    for (int j = 0; j < contacts; j++) {
        const gk_half *row = l.slides + j * l.all;
        double *const to[4] = {glide->gap_moves + j * s->stride, glide->gap_kappa + j * s->stride,
                               glide->moves + j * s->stride, glide->kappa + j * s->stride};
        for (int i = 0; i < l.all; i++) l.moves[i] = row[i] * l.mobility[i], l.yields[i] = -row[i] * l.kappa[i];
        for (int m = 0; m < 4; m++) gk_clear(to[m], quads);
        gk_multiply_rows(l.moves, l.gaps, s->n, l.all, l.all, to[0]);
        gk_multiply_rows(l.yields, l.gaps, s->n, l.all, l.all, to[1]);
        gk_multiply_rows(l.moves, row, contacts - j, l.all, l.all, to[2] + j);
        gk_multiply_rows(l.yields, row, contacts - j, l.all, l.all, to[3] + j);
        for (int i = 0; i < j; i++)
            to[2][i] = glide->moves[i * s->stride + j], to[3][i] = glide->kappa[i * s->stride + j];
        for (int i = s->n - s->joint.clutches; i < s->n; i++)
            to[1][i] = 0.0; /* a row of speeds: nothing yields at once */
    }
}

/* rows along the profile, and what friction yields at the gaps and along itself without the oscillators: C_nt, C_tt */
void gk_glide_rows(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system) && work->engaged[e].glide);
    gk_engaged *engaged = &work->engaged[e];
    gk_glide *glide = engaged->glide;
    const int stride = engaged->system.stride;
    const size_t size = (size_t)(engaged->system.contacts * stride);
    double **matrix[] = {&glide->gap_moves,  &glide->gap_kappa, &glide->moves, &glide->kappa,
                         &glide->gap_yields, &glide->yields,    &glide->by_z,  &glide->D}; /* D is the largest */
    for (size_t i = 0; i < 8; i++) *matrix[i] = glide->matrix + i * size;
    for (size_t i = 0; i < size; i += 4) gk_clear(glide->gap_yields + i, 1), gk_clear(glide->yields + i, 1);
    gk_rows_form_along(setup, work, e);
    if (!GK_ON(setup, residual)) return;
    const slide_nodes side[2] = {nodes_of(engaged, &setup->mesh[e].side[0]),
                                 nodes_of(engaged, &setup->mesh[e].side[1])};
    GK_STRIPPED(GK_STRIPS(setup), slide_residual, side, engaged->places, stride, glide)
}

/* adds what oscillators and spins yield */
void gk_glide_yields(const gk_system *s, gk_glide *glide)
{
    GK_ASSERT(gk_system_is_sound(s) && glide);
    const int quads = s->contacts * s->stride / 4;
    gk_axpy(1.0, glide->gap_kappa, glide->gap_yields, 0, quads);
    gk_axpy(1.0, glide->kappa, glide->yields, 0, quads);
}

/* What forces of an engagement itself do through the oscillators, by its matrices: of friction to its gaps, added; of
 * all to the sliding of its contacts */
void gk_glide_own(const gk_glide *glide, const gk_system *s, const gk_forces *f, double *gaps, double *along)
{
    GK_ASSERT(glide && gaps && along);
    const int quads = s->stride / 4;
    gk_clear(along, quads);
    for (int j = 0; j < s->contacts; j++) {
        const int at = j * s->stride;
        const double step = f->along[STEP][j], once = f->along[ONCE][j];
        gk_axpy(step, glide->gap_moves + at, gaps, 0, quads);
        gk_axpy(once, glide->gap_kappa + at, gaps, 0, quads);
        gk_axpy(step, glide->moves + at, along, 0, quads);
        gk_axpy(once, glide->kappa + at, along, 0, quads);
    }
    for (int j = 0; j < s->contacts; j++)
        along[j] += gk_dot_quads(glide->gap_moves + j * s->stride, f->of[STEP], quads) +
                    gk_dot_quads(glide->gap_kappa + j * s->stride, f->of[ONCE], quads);
}

/* sliding in the step of length h without its forces */
void gk_glide_freely(const gk_setup *setup, const gk_data *data, gk_work *work, double h, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e) && work->engaged[e].glide && h > 0.0);
    const gk_mesh *mesh = &setup->mesh[e];
    gk_glide *glide = work->engaged[e].glide;
    const double *x = gk_ground_seen(data);
    const int contacts = work->engaged[e].system.contacts;
    for (int i = 0; i < setup->base.n; i++) work->ground_reading[i] = work->ground_q[i] - x[i];
    const gk_rows rows = gk_rows_of_sliding(setup, work, e);
    gk_exchange_read_ground(&rows, work->ground_reading, glide->free);
    gk_exchange_read_ground(&rows, work->ground_start, glide->begin);
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear, n = GK_LANES(setup, g);
        const gk_real *q = gk_modal_seen(setup, data, g);
        for (int k = 0; k < n; k++) work->reading[g][k] = work->qp[g][k] - q[k];
        gk_exchange_read_modes(&rows, w, work->reading[g], glide->free);
        gk_exchange_read_modes(&rows, w, q + n, glide->begin);
    }
    for (int l = 0; l < mesh->spins; l++) {
        const double turned = work->spin[mesh->spin[l]] - GK_OF(data, x)[mesh->spin[l]];
        for (int i = 0; i < contacts; i++) {
            glide->free[i] += turned * glide->rigid[l][i];
            glide->begin[i] += GK_OF(data, v)[mesh->spin[l]] * glide->rigid[l][i];
        }
    }
    for (int i = 0; i < contacts; i++) glide->begin[i] *= h;
}

/* What the sliding by the row at the end of the step is ahead of that in the step: contacts move along the line of
 * action, parts of a line at a speed of their own, so that rolling gears change their row in the step. speed: of both
 * gears on their carrier */
double gk_glide_lead(const gk_mesh *mesh, const gk_point *point, const double speed[2], double h)
{
    GK_ASSERT(h > 0.0);
    const double grows = point->slide[PHIA] < 0.0 ? point->gradient[PHIA] : -point->gradient[PHIA];
    const double moves = mesh->rides ? point->moves : 1.0;
    return mesh->cosine > 0.0 ? 0.5 * h * h * moves * grows / mesh->cosine * speed[0] * (speed[0] - speed[1]) : 0.0;
}

static const double *start_forces(const gk_system *s) { return s->force0; }

/* Parts of lines of contact ride over the flanks, and with them what modes yield at once: a state contains κ times the
 * force on the rows of the last step. Their sliding in the step is what they really move, so what rows that ride along
 * make of it, κ(T₀p₀ + W₀λ₀) less κ(T₁p₀ + W₁λ₀), is taken off with the lead. */
void gk_glide_ride(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                   gk_work *work)
{
    GK_ASSERT(k->h > 0.0);
    const double *f = gk_ground_seen(data) + 2 * setup->base.n;
    int ride = 0;
    for (int e = 0; e < model->engagements; e++) ride |= setup->mesh[e].rides && work->engaged[e].glide->rolls;
    if (!ride) return;
    gk_exchange_scatter(model, setup, work, start_forces, start_forces); /* friction of the start is in `last` */
    for (int i = 0; i < setup->base.n; i++)
        work->ground_reading[i] = k->ground.kappa[i] * (f[i] - work->ground_next[i]);
    for (int g = 0; g < model->gears; g++) {
        const int n = GK_LANES(setup, g);
        const gk_real *force = gk_modal_seen(setup, data, g) + 2 * n;
        for (int i = 0; i < n; i++) work->reading[g][i] = k->flow[g].kappa[i] * (force[i] - work->next[g][i]);
    }
    for (int e = 0; e < model->engagements; e++) {
        gk_glide *glide = work->engaged[e].glide;
        double moved[MAX_STRIDE];
        if (!setup->mesh[e].rides || !glide->rolls) continue;
        const gk_rows rows = gk_rows_of_sliding(setup, work, e);
        gk_exchange_read_ground(&rows, work->ground_reading, moved);
        for (int w = 0; w < 2; w++) gk_exchange_read_modes(&rows, w, work->reading[setup->mesh[e].side[w].gear], moved);
        for (int i = 0; i < rows.count; i++) glide->lead[i] -= moved[i];
    }
}
