/* The one place that finds contacts: pose → candidates → memory → rows → system. What an engagement remembers from step
 * to step: forces, gaps and dampers of its tooth pairs and joints; the start of the step with them.
 *
 * Places of contact for conservation tests (effect.roll_motion off): teeth, rolls, normals and curvatures stay those of
 * the start, gaps are linear in the coordinates. Then rows and C′ are constant, the mesh does no work of its own, and
 * the scheme's invariant (docs/theory.md, eq. 11) must hold exactly. */
#include "problem/gk_engage.h"
#include "problem/gk_row.h"
#include "problem/gk_rows.h"

static const double PAYABLE = 1e-4; /* of the energy of the quasi-static part: what a contact that only grazes cannot
                                       repay waits */
static const double FROZEN_RANGE = 0.4e-3; /* m: every flank that the motion of a test can close is always there */

/* entry of the memory that a tooth pair has, −1: none */
static int remembered(const gk_meshing *meshing, gk_key key)
{
    GK_ASSERT(meshing->pairs >= 0 && meshing->pairs <= MAX_PAIRS);
    for (int i = 0; i < meshing->pairs; i++)
        if (meshing->memory[i].key.flank == key.flank && meshing->memory[i].key.tooth == key.tooth) return i;
    return -1;
}

/* Finds the contacts of engagement e at work->spin and forms its problem; 0 when the poses mean nothing. Places that
 * are found at another pose move to this one along their gradients. */
int gk_engage(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, const gk_search *how,
              int e)
{
    GK_ASSERT(gk_is_mesh(setup, e) && how && how->k);
    const gk_meshing *meshing = &GK_OF(data, meshing)[e];
    const double *const ground = how->ground ? how->ground : work->ground_y;
    gk_engaged *engaged = &work->engaged[e];
    const int frozen = !how->anew && !setup->on.roll_motion;
    const double least = gk_max(how->reach, GK_ON(setup, film) ? GK_FILM_REACH : 0.0);
    const double reach = how->anew ? how->reach : frozen ? FROZEN_RANGE : gk_max(meshing->search_distance, least);
    double there[POSE], moved[POSE];
    GK_MARK(work);
    gk_rows_pose(setup, work, e, work->spin, ground, engaged->pose);
    const double *at = frozen ? meshing->frozen : how->spin ? there : engaged->pose;
    if (how->spin) gk_rows_pose(setup, work, e, how->spin, ground, there);
    engaged->places = gk_flank_find(model, setup, &setup->mesh[e], at, reach, engaged->position, engaged->place);
    if (engaged->places < 0) return engaged->places = 0;
    for (int d = 0; d < POSE && at != engaged->pose; d++) moved[d] = engaged->pose[d] - at[d];
    for (int p = 0; p < engaged->places; p++) {
        gk_place *place = &engaged->place[p];
        if (at != engaged->pose) gk_flank_move(setup, place, moved);
        place->memory = how->anew ? -1 : remembered(meshing, place->key);
    }
    GK_LAP(work, PHASE_FIND);
    gk_rows_form(setup, work, e);
    GK_LAP(work, PHASE_ROWS);
    gk_form_system(model, setup, data, how->k, work, e);
    return 1;
}

/* do teeth overlap beyond what the model can mean? */
int gk_engage_overlaps(const gk_model *model, const gk_work *work, int e)
{
    GK_ASSERT(gk_is_engagement(model, e));
    for (int p = 0; p < work->engaged[e].places; p++)
        if (work->engaged[e].place[p].gap < -model->engagement[e].overlap_max) return 1;
    return 0;
}

/* ---- memory ------------------------------------------------------------------------------------------------------ */
/* λ0 without dashpots: quasi-static deflection and energy at the start */
static void recall_forces(gk_system *s)
{
    const int quads = s->stride / 4, whole = s->contacts / 4, joints = quads - whole; /* quads with joints in them */
    s->limit_reached = s->iterations = s->dashpot.any = s->dashpot.stand = 0;
    s->alpha = s->others.bends = 0.0;
    gk_clear(s->direction, quads);
    gk_clear(s->local.delta + 4 * whole, joints); /* links know no local law */
    gk_clear(s->local.yield + 4 * whole, joints);
    gk_clear(s->local.potential + 4 * whole, joints);
    memcpy(s->force, s->force0, (size_t)quads * sizeof(gk_quad));
    gk_law_apply(s);
    gk_solve_begin(s);
    s->energy.stored0 = gk_solve_stored(s);
    s->energy.held0 = 0.0;
    for (int i = 0; i < s->n; i++) s->energy.held0 += s->dashpot.lag0[i] * (s->force0[i] + 0.5 * s->dashpot.end0[i]);
}

/* The start of the step as this step's compliance sees it: quasi-static deflection and energy under λ0, gaps
 * g0 = s0 − C′λ0 − δ(λ0); then the first guess of status and forces */
void gk_memory_recall(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    const gk_forming f = {model, setup, data, work, e};
    gk_system *s = &work->engaged[e].system;
    GK_ASSERT(gk_system_is_sound(s));
    int given = 0; /* forces that are not those of the last step */
    s->flank.curved = GK_ON(setup, hertz) && s->contacts > 0;
    s->rubs = GK_ON(setup, friction) && s->contacts > 0;
    s->energy.rubbing = s->energy.rubbed = s->energy.unbalanced = 0.0;
    recall_forces(s);
    for (int i = 0; i < s->n; i++) {
        const int acted = s->dashpot.mean0[i] != 0.0 && (i >= s->contacts || s->force0[i] > 0.0);
        s->dashpot.beta[i] = acted ? 0.25 * (3.0 + GK_MEMORY) : 0.5;
        s->dashpot.tail[i] = acted ? -0.25 * (1.0 - GK_MEMORY) * s->dashpot.mean0[i] - GK_MEMORY * s->dashpot.end0[i]
                                   : 0.0;
        s->g0[i] = -gk_solve_quasi_static(s, i);
        s->dashpot.hold[i] = 0;
    }
    for (int b = 0; b < s->blocks; b++) given |= gk_verbs_of(s->block[b].kind)->begin(&f, s, &s->block[b]);
    gk_solve_status(s);
    if (given)
        gk_solve_settle(s);
    else
        gk_solve_begin_dashpots(s);
    s->energy.error = GK_OF(data, meshing)[e].energy_error;
    s->energy.shift = s->energy.shift0 = GK_OF(data, meshing)[e].shift;
    s->energy.correction = gk_clamp(s->energy.error, -PAYABLE * s->energy.stored0, PAYABLE * s->energy.stored0);
}

void gk_memory_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, int e)
{
    GK_ASSERT(engaged && engaged->index == e);
    GK_ASSERT(engaged->places >= 0 && engaged->places <= MAX_PAIRS);
    const gk_system *s = &engaged->system;
    gk_meshing *meshing = &GK_OF(data, meshing)[e];
    double deepest = 0.0;
    const int most = meshing->pairs > engaged->places ? meshing->pairs : engaged->places;
    memset(meshing->memory, 0, (size_t)most * sizeof *meshing->memory);
    meshing->pairs = engaged->places;
    for (int p = 0; p < engaged->places; p++) meshing->memory[p].key = engaged->place[p].key;
    for (int p = 0; p < engaged->places; p++) deepest = gk_max(deepest, -engaged->place[p].gap);
    for (int b = 0; b < s->blocks; b++) gk_verbs_of(s->block[b].kind)->keep(setup, engaged, data, &s->block[b]);
    meshing->search_distance = 20e-6 + 0.5 * deepest; /* neighbours of a loaded tooth follow its deflection in part */
    meshing->energy_error = s->energy.error;
    meshing->shift = s->energy.shift;
}

/* an engagement without rows */
void gk_memory_forget(gk_engaged *engaged)
{
    GK_ASSERT(engaged);
    engaged->places = 0;
    engaged->system.n = engaged->system.contacts = engaged->system.stride = engaged->system.joint.clutches = 0;
    engaged->system.blocks = 0;
}
