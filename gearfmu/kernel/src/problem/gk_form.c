/* Forms the problem of an engagement in a step (docs/theory.md, eq. 10): which forces are unknown, what they do to the
 * gaps within the step (D) and at once through what is quasi-static (A, P), and the gaps without them. Rows: strips of
 * all tooth pairs, then the live joints of its ports (springs, shafts, clutches). Contact forces press inward, rows
 * measure outward: a contact row is −(flank row). */
#include "problem/gk_work.h"
#include "problem/gk_exchange.h"
#include "problem/gk_far.h"
#include "problem/gk_rows.h"

enum { KEPT_STEPS = 4 }; /* steps for which an engagement of an island keeps D and K */

/* ---- rows -------------------------------------------------------------------------------------------------------- */
static void list_contacts(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work,
                          int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_meshing *meshing = &GK_OF(data, meshing)[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    static const gk_memory fresh;
    const double damping = GK_ON(setup, contact_damping) ? 2.0 * mesh->damping / h : 0.0;
    const double slice = setup->slices / model->engagement[e].width, per_cosine = 1.0 / mesh->cosine;
    int n = 0;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        const gk_memory *memory = place->memory < 0 ? &fresh : &meshing->memory[place->memory];
        for (int i = 0; i < GK_STRIPS(s); i++, n++) {
            const gk_point *point = gk_point_of(setup, place, i);
            const double width = mesh->strip_width[i] * point->share;
            s->kind[n] = ROW_CONTACT;
            s->port_of[n] = s->joint_of[n] = -1;
            s->place_of[n] = p;
            s->force0[n] = memory->force[i];
            s->end0[n] = memory->end[i];
            s->damper0[n] = memory->damper[i];
            s->damping[n] = damping * width;
            s->bound[n] = 0.0;
            s->weight[n] = width * slice;
            s->width[n] = width * per_cosine;
            s->per_width[n] = 1.0 / s->width[n];
            s->curvature[n] = point->curvature;
            for (int k = 0; k < GAPS - 1 && mesh->rides; k++) s->opens[k][n] = point->opens[k];
        }
    }
    s->contacts = s->n = n;
    gk_law_set(model, setup, mesh, s);
}

static void list_joint(const gk_setup *setup, const gk_data *data, double h, gk_system *s, int port, int joint)
{
    const gk_joint_state *state = &GK_OF(data, joint)[port][joint];
    const int clutch = joint == JOINT_CLUTCH, torque = joint == JOINT_PORT && setup->given_torque[port];
    s->kind[s->n] = clutch ? ROW_CLUTCH : torque ? ROW_TORQUE : ROW_SPRING;
    s->port_of[s->n] = port, s->joint_of[s->n] = joint;
    s->weight[s->n] = 1.0;
    s->force0[s->n] = clutch ? 0.0 : state->force;
    s->end0[s->n] = state->end;
    s->damper0[s->n] = state->damper;
    s->damping[s->n] = 2.0 * setup->joint[port][joint].damping / h;
    s->bound[s->n] = clutch ? 2.0 * GK_OF(data, shaft)[port][V_CAPACITY] : 0.0;
    s->width[s->n] = s->per_width[s->n] = 0.0;
    s->clutches += clutch;
    s->n++;
}

static void list_rows(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_system *s = &work->engaged[e].system;
    s->strips = setup->strips;
    s->n = s->clutches = s->films = 0;
    s->film = &work->engaged[e].film;
    list_contacts(model, setup, data, h, work, e);
    for (int joint = 0; joint < JOINTS; joint++) /* clutches last */
        for (int p = 0; p < mesh->ports; p++)
            if (setup->joint[mesh->port[p]][joint].live) list_joint(setup, data, h, s, mesh->port[p], joint);
    s->stride = (s->n + 3) / 4 * 4;
    for (int i = s->n; i < s->n + 4 && i < MAX_STRIDE; i++)
        s->g[i] = s->force0[i] = s->damper0[i] = s->end0[i] = s->damping[i] = s->width[i] = s->per_width[i] = 0.0;
    for (int i = 0; i < s->stride; i++) s->part[i] = 1.0;
    gk_clear(s->jump, s->stride / 4);
}

/* ---- gaps -------------------------------------------------------------------------------------------------------- */
/* derivatives of a joint's row by the spins of the engagement; its reading of spins x */
static double joint_reading(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, gk_system *s, int i,
                            const double *x)
{
    const int port = s->port_of[i], slot = mesh->port[0] == port ? 0 : 1, chain = setup->chained[port];
    const int *chained = mesh->joint_spin[slot];
    int plus = 0, minus = -1;
    while (mesh->spin[plus] != model->port[port].rotor) plus++;
    if (s->joint_of[i] == JOINT_SHAFT) minus = chained[1];
    if (s->joint_of[i] == JOINT_CLUTCH) plus = chained[0], minus = chained[1];
    if (s->joint_of[i] == JOINT_PORT && chain) plus = chained[0];
    s->rigid[plus][i] = 1.0;
    if (minus >= 0) s->rigid[minus][i] = -1.0;
    return x[mesh->spin[plus]] - (minus >= 0 ? x[mesh->spin[minus]] : 0.0);
}

/* Undeformed gap at the predicted poses, which contain what the ground group moves the gears rigidly, minus outward
 * elastic displacement. Springs measure relative to their outer ends; clutches read half a step of slip. */
static void gaps(const gk_model *model, const gk_setup *setup, double h, gk_work *work, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    for (int d = 0; d < mesh->spins; d++) memset(s->rigid[d], 0, (size_t)s->stride * sizeof(double));
    const gk_rows rows = gk_rows_of_gaps(setup, work, e);
    gk_exchange_read(&rows, work->y, work->ground_y, s->g);
    gk_rows_without_rigid(setup, work, e, work->ground_y, s->g);
    for (int p = 0, i = 0; p < engaged->places; p++)
        for (int strip = 0; strip < GK_STRIPS(s); strip++, i++) {
            const gk_point *point = gk_point_of(setup, &engaged->place[p], strip);
            s->g[i] += point->gap;
            s->rigid[0][i] = point->gradient[PHIA], s->rigid[1][i] = point->gradient[PHIB];
            if (mesh->frame >= 0) s->rigid[2][i] = -point->gradient[PHIA] - point->gradient[PHIB];
        }
    for (int i = s->contacts; i < s->n; i++) {
        const int clutch = s->kind[i] == ROW_CLUTCH;
        const double reading = joint_reading(model, setup, mesh, s, i, clutch ? work->speed : work->spin);
        s->g[i] += clutch ? 0.5 * h * reading : reading;
        if (s->kind[i] == ROW_SPRING && s->joint_of[i] == JOINT_PORT) s->g[i] -= work->outer[s->port_of[i]];
    }
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
        if (s->kind[i] == ROW_SPRING && s->joint_of[i] == JOINT_PORT) rate[i] -= work->outer_speed[s->port_of[i]];
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
    list_rows(model, setup, data, k->h, work, e);
    const size_t size = (size_t)(s->stride * s->stride + 4); /* a quad may write beyond the last row */
    const int tables = work->table_h > 0.0 && k->h == work->table_h && k->gamma == work->table_gamma &&
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
    memset(s->outer, 0, (size_t)s->stride * sizeof(double));
    memset(s->beyond, 0, (size_t)s->stride * sizeof(double));
    gaps(model, setup, k->h, work, e);
    const int coupled = setup->mesh[e].coupled;
    if (coupled) form_rest(setup, k, work, e);
    engaged->kept.again = coupled && work->by_tables && recall_own(engaged);
    if (engaged->kept.again) return;
    gk_compliance_form(setup, k, work, e, tables ? BY_TABLES : BY_ROWS);
    gk_ground_add(model, setup, k, work, e, tables);
    gk_compliance_mirror(s);
    if (coupled && work->by_tables) keep_own(engaged);
}
