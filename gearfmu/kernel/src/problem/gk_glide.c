/* What friction does: friction of every contact to all gaps and to the sliding of all contacts, in the step (D of the
 * rows along the profile) and at once (C − K), from tables, modes, ground group and spins (docs/theory.md, 3.12). */
#include "problem/gk_work.h"
#include "problem/gk_exchange.h"
#include "problem/gk_rows.h"

/* adds what is not dynamic, from the tables of a side, linear between nodes */
static void slide_residual(const gk_engaged *engaged, const gk_side *side, gk_glide *glide)
{
    const gk_system *s = &engaged->system;
    const gk_position *at = &engaged->position[side->which];
    const int strips = GK_STRIPS(s);
    const size_t columns = (size_t)side->columns, next = (size_t)(side->candidates * strips) * columns;
    const size_t node = (size_t)at->node * next;
    for (int i = 0; i < s->contacts; i++)
        for (int j = 0; j < s->contacts; j++) {
            const gk_place *p = &engaged->place[s->flank.place_of[i]], *q = &engaged->place[s->flank.place_of[j]];
            const size_t row = (size_t)(p->candidate[side->which] * strips + i % strips);
            const size_t cell = node + row * columns + (size_t)(q->candidate[side->which] * strips + j % strips);
            const gk_real *normal = side->along.normal + cell, *own = side->along.own + cell;
            glide->gap_yields[j * s->stride + i] += normal[0] + at->part * ((double)normal[next] - normal[0]);
            glide->yields[j * s->stride + i] += own[0] + at->part * ((double)own[next] - own[0]);
        }
}

/* adds the modes of a gear group */
static void slide_modes(const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e, int which)
{
    const int g = setup->mesh[e].side[which].gear, width = GK_LANES(setup, g) * 2 / LANES, half = width / 2;
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    gk_glide *glide = engaged->glide;
    const gk_flow *flow = &k->flow[g];
    const gk_half *mobility = (const gk_half *)flow->mobility, *kappa = (const gk_half *)flow->kappa;
    const gk_half *gaps = (const gk_half *)engaged->basis[which], *slides = (const gk_half *)glide->basis[which];
    gk_half *scaled = (gk_half *)work->scaled;
    const int lanes = 2 * flow->yields / LANES;
    for (int j = 0; j < s->contacts && width; j++) {
        const gk_half *row = slides + (size_t)(j * width);
        const int at = j * s->stride;
        for (int l = 0; l < width; l++) scaled[l] = row[l] * mobility[l];
        gk_multiply_rows(scaled, gaps, s->contacts, width, width, glide->gap_moves + at);
        gk_multiply_rows(scaled, slides, s->contacts, width, width, glide->moves + at);
        for (int first = 0; first < width && lanes; first += half) { /* κ is 0 beyond */
            for (int l = first; l < first + lanes; l++) scaled[l] = -row[l] * kappa[l];
            gk_multiply_rows(scaled + first, gaps + first, s->contacts, width, lanes, glide->gap_yields + at);
            gk_multiply_rows(scaled + first, slides + first, s->contacts, width, lanes, glide->yields + at);
        }
    }
}

/* adds the ground group */
static void slide_ground(const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    gk_glide *glide = engaged->glide;
    const int width = mesh->local;
    double mobility[MAX_GROUND + 4 * MAX_ROTORS], kappa[MAX_GROUND + 4 * MAX_ROTORS];
    double *moves = work->ground_scaled, *yields = moves + width;
    gk_local_gather(mesh, k->ground.mobility, mobility);
    gk_local_gather(mesh, k->ground.kappa, kappa);
    for (int j = 0; j < s->contacts && width; j++) {
        const double *row = glide->ground + (size_t)(j * width);
        const int at = j * s->stride;
        for (int l = 0; l < width; l++) moves[l] = row[l] * mobility[l], yields[l] = -row[l] * kappa[l];
        gk_times_rows(engaged->ground, s->n, width, moves, glide->gap_moves + at);
        gk_times_rows(engaged->ground, s->n, width, yields, glide->gap_yields + at);
        gk_times_rows(glide->ground, s->contacts, width, moves, glide->moves + at);
        gk_times_rows(glide->ground, s->contacts, width, yields, glide->yields + at);
    }
}

/* adds the spins */
static void slide_spins(const gk_setup *setup, const gk_coefficients *k, const gk_mesh *mesh, const gk_system *s,
                        gk_glide *glide)
{
    for (int l = 0; l < mesh->spins; l++) {
        const double inverse = setup->inverse_inertia[mesh->spin[l]];
        for (int j = 0; j < s->contacts; j++) {
            const double moves = k->rigid_mobility * inverse * glide->rigid[l][j];
            const double yields = k->rigid_kappa * inverse * glide->rigid[l][j];
            for (int i = 0; i < s->n && moves != 0.0; i++) {
                const int at = j * s->stride + i;
                glide->gap_moves[at] += moves * s->rigid[l][i], glide->gap_yields[at] -= yields * s->rigid[l][i];
                if (i >= s->contacts) continue;
                glide->moves[at] += moves * glide->rigid[l][i], glide->yields[at] -= yields * glide->rigid[l][i];
            }
        }
    }
}

/* Rows along the profile, and what friction yields at the gaps and along itself without the oscillators: C_nt, C_tt */
void gk_glide_rows(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system) && work->engaged[e].glide);
    gk_engaged *engaged = &work->engaged[e];
    gk_glide *glide = engaged->glide;
    const size_t size = (size_t)(engaged->system.contacts * engaged->system.stride);
    double **matrix[] = {&glide->gap_moves, &glide->gap_yields, &glide->moves, &glide->yields,
                         &glide->by_z,      &glide->gap_rests,  &glide->rests, &glide->D}; /* D is the largest */
    for (size_t i = 0; i < 8; i++) *matrix[i] = glide->matrix + i * size;
    memset(glide->matrix, 0, 4 * size * sizeof(double));
    gk_rows_form_along(setup, work, e);
    for (int w = 0; w < 2 && GK_ON(setup, residual); w++) slide_residual(engaged, &setup->mesh[e].side[w], glide);
    memcpy(glide->gap_rests, glide->gap_yields, size * sizeof(double));
    memcpy(glide->rests, glide->yields, size * sizeof(double));
}

/* What forces of an engagement itself do through the oscillators: of friction to its gaps, added; of all to the sliding
 * of its contacts. Before its local yield is in `yields`, or without it. */
void gk_glide_own(const gk_glide *glide, const gk_system *s, const gk_forces *f, double *gaps, double *along)
{
    GK_ASSERT(glide && gaps && along);
    gk_clear(along, s->stride / 4);
    for (int j = 0; j < s->contacts; j++) {
        const int at = j * s->stride;
        const double step = f->along[STEP][j], once = f->along[ONCE][j];
        for (int i = 0; i < s->n; i++) {
            const double yields = glide->gap_yields[at + i] - glide->gap_rests[at + i];
            gaps[i] += step * glide->gap_moves[at + i] + once * yields;
            along[j] += f->of[STEP][i] * glide->gap_moves[at + i] + f->of[ONCE][i] * yields;
        }
        for (int i = 0; i < s->contacts; i++) {
            const double local = i == j ? gk_friction_local_yield(s, i) : 0.0;
            along[i] += step * glide->moves[at + i] + once * (glide->yields[at + i] - local - glide->rests[at + i]);
        }
    }
}

/* Adds what the oscillators and spins do in the step k */
void gk_glide_moves(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e) && work->engaged[e].glide);
    const gk_system *s = &work->engaged[e].system;
    gk_glide *glide = work->engaged[e].glide;
    for (int w = 0; w < 2; w++) slide_modes(setup, work, k, e, w);
    slide_ground(setup, work, k, e);
    slide_spins(setup, k, &setup->mesh[e], s, glide);
    for (int j = 0; j < s->contacts; j++) /* a clutch is a row of speeds, without what yields at once */
        for (int i = s->n - s->joint.clutches; i < s->n; i++) glide->gap_yields[j * s->stride + i] = 0.0;
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
