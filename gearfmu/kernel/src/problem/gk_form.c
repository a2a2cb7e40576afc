/* Forms the problem of an engagement in a step (docs/theory.md, eq. 10): which forces are unknown, what they do to the
 * gaps within the step (D) and at once through what is quasi-static (A, P), and the gaps without them. Rows by kind
 * (gk_row.h): strips of all tooth pairs, then the live joints of its ports. Contact forces press inward, rows measure
 * outward: a contact row is −(flank row). */
#include "problem/gk_work.h"
#include "problem/gk_exchange.h"
#include "problem/gk_far.h"
#include "problem/gk_row.h"
#include "problem/gk_rows.h"

enum { KEPT_STEPS = 4 }; /* steps for which an engagement of an island keeps D and K */

/* ---- rows -------------------------------------------------------------------------------------------------------- */
/* rows of one kind that follow each other are a block; contacts are one, with or without rows */
static void list_blocks(gk_system *s)
{
    s->block[0] = (gk_row_block){ROW_CONTACT, 0, s->contacts};
    s->blocks = 1;
    for (int i = s->contacts; i < s->n; i++) {
        gk_row_block *last = &s->block[s->blocks - 1];
        if (last->kind == s->kind[i])
            last->end++;
        else
            s->block[s->blocks++] = (gk_row_block){s->kind[i], i, i + 1};
    }
}

static void list_rows(const gk_forming *f, double h, gk_system *s)
{
    s->strips = f->setup->strips;
    s->n = s->joint.clutches = s->films = 0;
    s->film = &f->work->engaged[f->e].film;
    gk_row_contact_list(f, h, s);
    gk_row_joint_list(f, h, s);
    list_blocks(s);
    s->stride = (s->n + 3) / 4 * 4;
    for (int i = s->n; i < s->n + 4 && i < MAX_STRIDE; i++)
        s->g[i] = s->force0[i] = s->dashpot.mean0[i] = s->dashpot.end0[i] = s->dashpot.coefficient[i] =
            s->flank.width[i] = s->flank.per_width[i] = 0.0;
    for (int i = 0; i < s->stride; i++) s->dashpot.part[i] = 1.0;
    gk_clear(s->jump, s->stride / 4);
}

/* gaps: minus outward elastic displacement, then what each kind of rows reads beside the oscillators */
static void read_gaps(const gk_forming *f, double h, gk_system *s)
{
    const gk_mesh *mesh = &f->setup->mesh[f->e];
    for (int d = 0; d < mesh->spins; d++) memset(s->rigid[d], 0, (size_t)s->stride * sizeof(double));
    const gk_rows rows = gk_rows_of_gaps(f->setup, f->work, f->e);
    gk_exchange_read(&rows, f->work->y, f->work->ground_y, s->g);
    for (int b = 0; b < s->blocks; b++) gk_verbs_of(s->block[b].kind)->read(f, h, s, &s->block[b]);
}

/* d/dt of the gaps that the rows read, for given speeds, at the problem formed last */
void gk_form_rates(const gk_setup *setup, gk_work *work, int e, const gk_real *const modal_speed[],
                   const double *ground_speed, const double *speed, double *rate)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(modal_speed && speed && rate);
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_system *s = &work->engaged[e].system;
    const gk_rows rows = gk_rows_of_gaps(setup, work, e);
    gk_exchange_read(&rows, modal_speed, ground_speed, rate);
    for (int i = 0; i < s->n; i++) {
        for (int d = 0; d < mesh->spins; d++) rate[i] += s->rigid[d][i] * speed[mesh->spin[d]];
        if (gk_row_has_outer_end(s, i)) rate[i] -= work->outer_speed[s->joint.port[i]];
    }
}

/* ---- engagements of an island ------------------------------------------------------------------------------------ */
/* what is not dynamic of an engagement's own compliance: in A, and kept */
static void form_rest(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    gk_compliance_form(setup, k, work, e, NOT_DYNAMIC);
    gk_compliance_mirror(s);
    memcpy(engaged->rest, s->A, (size_t)(s->n * s->stride) * sizeof *s->A);
}

/* Takes D and K as they were some steps ago, if teeth are the same: rows read what oscillators really do (gk_pass.c),
 * so that these matrices only tell how far a move goes. */
static int recall_own(gk_engaged *engaged)
{
    gk_system *s = &engaged->system;
    gk_kept *kept = &engaged->kept;
    int same = kept->n == s->n && kept->places == engaged->places && kept->age < KEPT_STEPS;
    for (int p = 0; p < engaged->places && same; p++)
        same = kept->key[p].flank == engaged->place[p].key.flank && kept->key[p].tooth == engaged->place[p].key.tooth;
    if (!same) return 0;
    kept->age++;
    memcpy(s->D, kept->D, (size_t)(s->n * s->stride) * sizeof *s->D);
    for (int q = 0; q < s->n * s->stride / 4; q++) ((gk_quad *)s->A)[q] -= ((gk_quad *)kept->K)[q];
    return 1;
}

static void keep_own(gk_engaged *engaged)
{
    const gk_system *s = &engaged->system;
    gk_kept *kept = &engaged->kept;
    kept->n = s->n, kept->places = engaged->places, kept->age = 1;
    for (int p = 0; p < engaged->places; p++) kept->key[p] = engaged->place[p].key;
    memcpy(kept->D, s->D, (size_t)(s->n * s->stride) * sizeof *s->D);
    for (int q = 0; q < s->n * s->stride / 4; q++)
        ((gk_quad *)kept->K)[q] = ((const gk_quad *)engaged->rest)[q] - ((const gk_quad *)s->A)[q];
}

/* ---- the problem ------------------------------------------------------------------------------------------------- */
/* Forms the problem of engagement e at its places for the step k: D, A and the paths of the rows' own dampers, P and
 * 1/k; C′ = A + P. The local law is in neither (it depends on the force). */
void gk_form_system(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                    gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_is_engagement(model, e) && k->h > 0.0);
    GK_ASSERT(work->engaged[e].places >= 0 && work->engaged[e].places <= MAX_PAIRS);
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    const gk_forming f = {model, setup, data, work, e};
    list_rows(&f, k->h, s);
    s->energy.lead = gk_min(1.0, 4.0 * k->gamma - 1.0) / 24.0;
    const size_t size = (size_t)(s->stride * s->stride + 4); /* a quad may write beyond the last row */
    const int tables = work->room.table_h > 0.0 && k->h == work->room.table_h && k->gamma == work->room.table_gamma &&
                       !setup->mesh[e].joined;
    s->D = engaged->matrix;
    s->A = s->D + size;
    s->P = s->A + size;
    s->J = s->P + size;
    s->L = s->J + size;
    s->B = s->L + size;
    gk_far_form(setup, work, e);
    gk_rows_form_ground(setup, work, e);
    gk_rows_form_bores(setup, work, e);
    memset(s->others.gap, 0, (size_t)s->stride * sizeof(double));
    memset(s->others.deflection, 0, (size_t)s->stride * sizeof(double));
    read_gaps(&f, k->h, s);
    const int coupled = setup->mesh[e].coupled;
    if (coupled) form_rest(setup, k, work, e);
    engaged->kept.again = coupled && work->by_tables && recall_own(engaged);
    if (engaged->kept.again) return;
    gk_compliance_form(setup, k, work, e, tables ? BY_TABLES : BY_ROWS);
    gk_ground_add(model, setup, k, work, e, tables);
    gk_compliance_mirror(s);
    if (coupled && work->by_tables) keep_own(engaged);
}
