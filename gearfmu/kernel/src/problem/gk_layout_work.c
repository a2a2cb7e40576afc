/* Where everything of gk_work lies: one block, arrays behind the head. */
#include "problem/gk_work.h"
#include "setup/gk_layout.h"
#include "setup/gk_tables.h"

static void lay_out_engaged(gk_bump *b, const gk_model *model, const gk_setup *setup, gk_engaged *engaged, int e)
{
    const size_t contacts = MAX_PAIRS * (size_t)setup->strips, rows = contacts + MAX_JOINTS + 4;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        engaged->basis[w] = gk_bump_reals(b, contacts * (size_t)setup->modal[side->gear].n);
        engaged->far[w] = gk_bump_reals(b, gk_far_known(model, setup, side->gear) ? contacts * LANES : 0);
    }
    engaged->ground = gk_bump_doubles(b, rows * (size_t)setup->base.n);
    engaged->near = gk_bump_reals(b, model->engagements > 1 ? rows * ((size_t)setup->base.n + 2 * LANES) : 0);
    engaged->index = e;
    engaged->matrix = gk_bump_doubles(b, 6 * rows * rows);
    const size_t several = model->engagements > 1 ? rows * rows : 0;
    engaged->rest = gk_bump_doubles(b, several);
    engaged->kept.D = gk_bump_doubles(b, several), engaged->kept.K = gk_bump_doubles(b, several);
    engaged->kept.n = -1;
    if (!GK_ON(setup, friction)) return;
    gk_glide *glide = engaged->glide = gk_bump_take(b, sizeof *glide);
    gk_glide counted, *of = glide ? glide : &counted;
    memset(of, 0, sizeof *of);
    for (int w = 0; w < 2; w++)
        of->basis[w] = gk_bump_reals(b, contacts * (size_t)setup->modal[setup->mesh[e].side[w].gear].n);
    of->ground = gk_bump_doubles(b, rows * (size_t)setup->base.n);
    of->near = gk_bump_reals(b, model->engagements > 1 ? rows * ((size_t)setup->base.n + 2 * LANES) : 0);
    of->matrix = gk_bump_doubles(b, 8 * rows * rows);
    of->small = gk_bump_doubles(b, 2 * rows * rows);
    size_t lanes = (size_t)setup->base.n + 2 * LANES; /* ground group, spins */
    for (int w = 0; w < 2; w++) lanes += (size_t)setup->modal[setup->mesh[e].side[w].gear].n;
    of->lanes = gk_bump_reals(b, (2 * rows + 4) * lanes);
}

/* pairs of teeth that may feel each other as far teeth, at most */
static int far_pairs(const gk_model *model, const gk_setup *setup)
{
    int count = 0;
    for (int g = 0; g < model->gears; g++) {
        const int n = setup->engagements_of[g];
        if (gk_far_known(model, setup, g)) count += n * (n - 1) * MAX_PAIRS * MAX_PAIRS;
    }
    return count;
}

static size_t lay_out_work(const gk_model *model, const gk_setup *setup, gk_work *work, char *base)
{
    gk_bump b = {base, 0};
    gk_layout_room(&b, model, setup, &work->room);
    size_t widest = 0, most = 0;
    const size_t ground = (size_t)setup->base.n;
    for (int g = 0; g < model->gears; g++) {
        const size_t n = (size_t)setup->modal[g].n;
        gk_real **array[] = {&work->qp[g],
                             &work->vp[g],
                             &work->force[g],
                             &work->next[g],
                             &work->reading[g],
                             &work->move_modes[WHOLE][g],
                             &work->move_modes[YIELDED][g]};
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = gk_bump_reals(&b, n);
        work->turned_speed[g] = gk_bump_doubles(&b, n);
        for (int i = 0; i < 7; i++) work->stage[g][i] = gk_bump_reals(&b, 2 * n);
        work->trial[g] = gk_bump_reals(&b, 2 * n);
        widest = n > widest ? n : widest;
        most = (size_t)model->gear[g].modes > most ? (size_t)model->gear[g].modes : most;
    }
    work->turned = gk_bump_reals(&b, widest), work->turned_next = gk_bump_reals(&b, widest);
    work->scaled = gk_bump_reals(&b, 2 * widest);
    double **array[] = {&work->ground_q,    &work->ground_v,       &work->ground_force,
                        &work->ground_next, &work->ground_reading, &work->ground_start};
    for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = gk_bump_doubles(&b, ground);
    work->ground_scaled = gk_bump_doubles(&b, 2 * ground);
    for (int i = 0; i < 7; i++) work->ground_stage[i] = gk_bump_doubles(&b, 2 * ground);
    work->ground_trial = gk_bump_doubles(&b, 2 * ground);
    work->engaged = gk_bump_take(&b, (size_t)model->engagements * sizeof *work->engaged);
    for (int e = 0; e < model->engagements; e++) {
        gk_engaged counted;
        gk_engaged *engaged = work->engaged ? &work->engaged[e] : &counted;
        lay_out_engaged(&b, model, setup, engaged, e);
        engaged->table = work->room.table[e];
    }
    work->tally = gk_bump_doubles(&b, 6 * ground);
    work->pushed = gk_bump_doubles(&b, (size_t)model->ground[setup->base.set].n + most);
    work->mode_row = gk_bump_doubles(&b, most);
    work->rest_ground = gk_bump_doubles(&b, ground);
    size_t unknowns = (size_t)(model->rotors + 2 * model->chains) + ground;
    for (int g = 0; g < model->gears; g++) {
        const int shared = setup->engagements_of[g] > 1;
        work->rest_modes[g] = gk_bump_reals(&b, shared ? (size_t)setup->modal[g].n : 0);
        unknowns += shared ? MAX_SOFT : 0;
    }
    work->rest = gk_bump_doubles(&b, (2 + unknowns) * unknowns);
    work->soft_rows = gk_bump_doubles(&b, model->engagements > 1 ? 2 * MAX_ROWS * MAX_SOFT : 0);
    work->room.columns = gk_bump_doubles(&b, gk_side_scratch(model) + (size_t)(model->engagements * LIMIT_POSITIONS) *
                                                                          MAX_STRIDE * MAX_STRIDE);
    const size_t rows = (size_t)model->engagements * (MAX_PAIRS * (size_t)setup->strips + MAX_JOINTS);
    work->island = gk_bump_doubles(&b, 2 * rows * rows);
    work->most_far_pairs = far_pairs(model, setup);
    work->far_pair = gk_bump_take(&b, (size_t)work->most_far_pairs * sizeof *work->far_pair);
    for (int t = 0; t < PUSHES; t++) work->push_ground[t] = gk_bump_reals(&b, ground + LANES);
    for (int t = 0; t < MOVES; t++) work->move_ground[t] = gk_bump_reals(&b, ground + LANES);
    for (int w = 0; w < 2; w++) {
        gk_real **of_field[] = {&work->field[w].q, &work->field[w].v, &work->field[w].f};
        for (int i = 0; i < 3; i++) *of_field[i] = gk_bump_reals(&b, widest);
    }
    return b.used;
}

size_t gk_work_size(const gk_model *model)
{
    gk_setup probe;
    gk_work nothing;
    gk_layout_largest(model, &probe);
    return 128 + sizeof(gk_work) + lay_out_work(model, &probe, &nothing, NULL);
}

void gk_layout_work(const gk_model *model, const gk_setup *setup, gk_work *work)
{
    GK_ASSERT(model && setup && work);
    GK_ASSERT(setup->base.n % 4 == 0);
    lay_out_work(model, setup, work, gk_bump_behind(work, sizeof *work));
}
