/* The stage linearised at rest (docs/theory.md, 8): the problem of a step in which no time passes, formed at the
 * equilibrium, as matrices. What a row reads is what its unit force does, so that all rows come from those functions
 * that spread the forces of a step. */
#include "problem/gk_linearise.h"
#include "problem/gk_engage.h"
#include "problem/gk_far.h"
#include "problem/gk_exchange.h"
#include "problem/gk_rows.h"

static const double DAMPER_AT_UNIT_STEP = 0.5; /* c over 2c/h, h = 1 */

typedef struct kept { /* a row of the linear model */
    int engagement, row;
} kept;

/* ---- coordinates ------------------------------------------------------------------------------------------------- */
/* coordinate of every spin; returns their number. A closed clutch makes one of two. */
static int number_spins(const gk_model *model, const gk_setup *setup, int at[MAX_SPINS])
{
    int count = model->rotors;
    for (int r = 0; r < model->rotors; r++) at[r] = r;
    for (int p = 0; p < model->ports; p++)
        if (setup->chained[p]) at[gk_inertia_of(model, p)] = at[gk_disc_of(model, p)] = count++;
    return count;
}

static int oscillators(const gk_model *model, const gk_setup *setup)
{
    int count = setup->base.count;
    for (int g = 0; g < model->gears; g++) count += setup->modal[g].count;
    return count;
}

static void describe(gk_linear *out, int i, int group, int number, double omega, double zeta)
{
    out->group[i] = group, out->number[i] = number;
    out->mass[i] = 1.0, out->omega[i] = omega, out->zeta[i] = zeta;
}

static void describe_coordinates(const gk_model *model, const gk_setup *setup, gk_linear *out)
{
    const gk_base *base = &setup->base;
    const int damped = GK_ON(setup, modal_damping);
    int at[MAX_SPINS], n = number_spins(model, setup, at);
    for (int i = 0; i < n; i++) describe(out, i, -1, i, 0.0, 0.0), out->mass[i] = 0.0;
    for (int d = 0; d < setup->spins; d++) out->mass[at[d]] += 1.0 / setup->inverse_inertia[d];
    for (int i = 0; i < base->n; i++)
        if (base->which[i] >= 0) describe(out, n++, 0, base->which[i], base->omega[i], damped ? base->zeta[i] : 0.0);
    for (int g = 0; g < model->gears; g++) {
        const gk_modal *m = &setup->modal[g];
        for (int k = 0; k < m->count; k++)
            describe(out, n++, 1 + g, k, m->omega[m->lane[k]], damped ? m->zeta[m->lane[k]] : 0.0);
    }
}

/* a row over the ground group's lanes among all coordinates, the rest 0 */
static void place_ground(const gk_setup *setup, const double *lanes, int first, int coordinates, double *out)
{
    memset(out, 0, (size_t)coordinates * sizeof *out);
    for (int i = 0; i < setup->base.n; i++)
        if (setup->base.which[i] >= 0) out[first++] = lanes[i];
}

/* ---- the problem at rest ----------------------------------------------------------------------------------------- */
static int form_all(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data)
{
    memcpy(work->spin, GK_OF(data, x), (size_t)setup->spins * sizeof *work->spin);
    memset(work->speed, 0, sizeof work->speed);
    for (int g = 0; g < model->gears; g++) work->y[g] = work->room.zero;
    work->ground_y = work->room.ground_zero;
    const gk_search how = {.k = &work->room.explicit_rows, .ground = gk_ground_seen(data)};
    for (int e = 0; e < model->engagements; e++) {
        gk_system *s = &work->engaged[e].system;
        if (!gk_engage(model, setup, work, data, &how, e)) return 0;
        memcpy(s->force, s->force0, (size_t)s->stride * sizeof *s->force);
        gk_law_apply(s);
    }
    return 1;
}

/* rows that are at work: contacts under load, springs */
static int list_kept(const gk_model *model, const gk_work *work, kept *rows)
{
    int count = 0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = 0; i < s->n; i++)
            if (gk_row_is_stiff(s, i) && (s->force0[i] != 0.0 || !gk_row_opens(s, i))) rows[count++] = (kept){e, i};
    }
    return count;
}

/* ---- rows -------------------------------------------------------------------------------------------------------- */
static void describe_row(const gk_setup *setup, const gk_work *work, kept row, int r, gk_linear *out)
{
    const gk_engaged *engaged = &work->engaged[row.engagement];
    const gk_system *s = &engaged->system;
    const int i = row.row, contact = i < s->contacts;
    int32_t *label = out->label + 4 * r;
    out->force[r] = s->force0[i];
    out->dashpot[r] = DAMPER_AT_UNIT_STEP * s->dashpot.coefficient[i];
    out->te[r] = 0.0;
    label[0] = contact ? row.engagement : -1, label[1] = s->joint.port[i], label[2] = s->joint.which[i], label[3] = 0;
    if (!contact) return;
    const gk_place *place = &engaged->place[s->flank.place_of[i]];
    label[1] = place->key.flank, label[2] = place->key.tooth, label[3] = i % GK_STRIPS(s);
    out->te[r] = (place->key.flank ? 1.0 : -1.0) * setup->mesh[row.engagement].cosine;
}

/* S between two rows: the path of a tooth pair and its local law; 1/k */
static double own_compliance(const gk_system *s, int i, int j)
{
    return s->P[i * s->stride + j] + (i == j && i < s->contacts ? s->local.yield[i] : 0.0);
}

/* what a unit force of one row does at once to all rows of its own engagement, and between bores and flanks to those of
 * others */
static void fill_compliance(const gk_model *model, const gk_setup *setup, gk_work *work, const kept *rows, int r,
                            gk_linear *out)
{
    const gk_system *s = &work->engaged[rows[r].engagement].system;
    double unit[MAX_STRIDE] = {0}, read[MAX_STRIDE];
    int of = -1;
    unit[rows[r].row] = 1.0;
    gk_bores bores = {{0}, {0}};
    gk_exchange_push_bores(setup, &work->engaged[rows[r].engagement], unit, &bores);
    const gk_coupled coupled = {
        .model = model, .setup = setup, .work = work, .island = setup->mesh[rows[r].engagement].island};
    static const double none[MAX_STRIDE];
    for (int e = 0; e < model->engagements; e++)
        gk_far_push(setup, &work->engaged[e], e == rows[r].engagement ? unit : none);
    gk_far_list(&coupled);
    gk_far_move(work);
    for (int c = 0; c < out->rows; c++) {
        const int e = rows[c].engagement, same = e == rows[r].engagement;
        double *Q = out->Q + (size_t)r * (size_t)out->room + (size_t)c;
        if (!same && e != of) {
            of = e;
            gk_far_read(setup, &work->engaged[e], read);
            gk_exchange_read_bores(setup, &work->engaged[e], &bores, read);
        }
        *Q = same ? s->A[rows[r].row * s->stride + rows[c].row]
             : setup->mesh[e].island == setup->mesh[rows[r].engagement].island ? read[rows[c].row]
                                                                               : 0.0;
        out->S[(size_t)r * (size_t)out->room + (size_t)c] = same ? own_compliance(s, rows[r].row, rows[c].row) : 0.0;
    }
}

/* what a unit force of one row does to every coordinate */
static void fill_row(const gk_model *model, const gk_setup *setup, gk_work *work, kept row, double *W)
{
    const gk_mesh *mesh = &setup->mesh[row.engagement];
    gk_system *s = &work->engaged[row.engagement].system;
    int at[MAX_SPINS], n = number_spins(model, setup, at);
    s->force[row.row] = 1.0;
    gk_exchange_scatter(model, setup, work, gk_step_force, gk_step_force);
    s->force[row.row] = 0.0;
    place_ground(setup, work->ground_force, n, n + oscillators(model, setup), W);
    for (int l = 0; l < mesh->spins; l++) W[at[mesh->spin[l]]] += s->rigid[l][row.row];
    n += setup->base.count;
    for (int g = 0; g < model->gears; g++)
        for (int k = 0; k < setup->modal[g].count; k++) W[n++] = (double)work->force[g][setup->modal[g].lane[k]];
}

static void fill_rows(const gk_model *model, const gk_setup *setup, gk_work *work, const kept *rows, gk_linear *out)
{
    for (int r = 0; r < out->rows; r++) {
        describe_row(setup, work, rows[r], r, out);
        fill_compliance(model, setup, work, rows, r, out);
    }
    for (int e = 0; e < model->engagements; e++)
        memset(work->engaged[e].system.force, 0, sizeof work->engaged[e].system.force);
    for (int r = 0; r < out->rows; r++)
        fill_row(model, setup, work, rows[r], out->W + (size_t)r * (size_t)out->coordinates);
}

/* ---- supports ---------------------------------------------------------------------------------------------------- */
/* what a unit force of one row does at once to the force on a support: one side's part of a contact */
static double pressed(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, int i, int support)
{
    const gk_position *at = &engaged->position[side->which];
    const size_t points = (size_t)(side->candidates * setup->strips), width = (size_t)gk_padded(side->held.width);
    const int candidate = engaged->place[engaged->system.flank.place_of[i]].candidate[side->which];
    const size_t point = (size_t)at->node * points + (size_t)(candidate * setup->strips + i % setup->strips);
    if (support < side->held.from || support >= side->held.from + side->held.width) return 0.0;
    const double *low = side->support + point * width + (support - side->held.from);
    return low[0] + at->part * (low[points * width] - low[0]);
}

static void fill_supports(const gk_model *model, const gk_setup *setup, const gk_work *work, const kept *rows,
                          gk_linear *out)
{
    const gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    int at[MAX_SPINS];
    const int spins = number_spins(model, setup, at), n = out->coordinates;
    for (int s = 0; s < model->supports; s++) {
        const size_t row = (size_t)s * (size_t)n;
        out->support_compliance[s] = ground->support_compliance[s], out->damper[s] = ground->damper[s];
        place_ground(setup, base->support_rows + s * base->n, spins, n, out->support_rows + row);
        place_ground(setup, base->support_damping + s * base->n, spins, n, out->support_damping + row);
        place_ground(setup, base->damper_rows + s * base->n, spins, n, out->damper_rows + row);
        for (int r = 0; r < out->rows; r++) {
            const gk_engaged *engaged = &work->engaged[rows[r].engagement];
            const gk_system *system = &engaged->system;
            const gk_side *side = setup->mesh[rows[r].engagement].side;
            double force = 0.0;
            if (rows[r].row < system->contacts)
                for (int w = 0; w < 2; w++) force -= pressed(setup, engaged, &side[w], rows[r].row, s);
            else if (gk_rows_at_bore(setup, system, rows[r].row))
                force = setup->port_support[system->joint.port[rows[r].row]][s];
            out->support_forces[(size_t)s * (size_t)out->room + (size_t)r] = force;
        }
    }
}

/* ---- all of it --------------------------------------------------------------------------------------------------- */
gk_outcome gk_linearise_room(const gk_model *model, const gk_setup *setup, gk_linear *out)
{
    GK_ASSERT(model && setup && out);
    int at[MAX_SPINS];
    if (setup->magic != GK_SETUP_MAGIC) return GK_BAD_CALL;
    out->coordinates = number_spins(model, setup, at) + oscillators(model, setup);
    out->room = model->engagements * MAX_PAIRS * setup->strips + JOINTS * model->ports;
    out->supports = model->supports;
    out->engagements = model->engagements;
    out->rows = 0;
    return GK_OK;
}

gk_outcome gk_linearise(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                        gk_linear *out)
{
    GK_ASSERT(model && setup && work && data && out);
    kept rows[MAX_ENGAGEMENTS * MAX_ROWS];
    if (setup->magic != GK_SETUP_MAGIC || data->magic != GK_DATA_MAGIC || data->state_h != 0.0) return GK_BAD_CALL;
    if (!form_all(model, setup, work, data)) return GK_DIVERGED;
    out->rows = list_kept(model, work, rows);
    describe_coordinates(model, setup, out);
    fill_supports(model, setup, work, rows, out);
    fill_rows(model, setup, work, rows, out);
    return GK_OK;
}
