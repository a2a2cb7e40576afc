/* Places of contact for conservation tests (effect.roll_motion off): teeth, rolls, normals and curvatures stay those of
 * the start, gaps are linear in the coordinates. Then rows and C′ are constant, the mesh does no work of its own, and
 * the scheme's invariant (docs/theory.md, eq. 11) must hold exactly. */
#include "problem/gk_work.h"

static const double FROZEN_RANGE =
    0.4e-3; /* m: every flank that the motion of a test can close is among the places all the time */

/* All places at the poses `frozen`, their gaps moved on to `pose` along the gradients; −1 when the poses are
 * meaningless */
int gk_frozen_find(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *frozen,
                   const double *pose, gk_position position[2], gk_place *place)
{
    GK_ASSERT(frozen && pose && frozen != pose);
    const int found = gk_flank_find(model, setup, mesh, frozen, FROZEN_RANGE, position, place);
    double moved[POSE];
    for (int d = 0; d < POSE; d++) moved[d] = pose[d] - frozen[d];
    for (int p = 0; p < found; p++) gk_flank_move(setup, &place[p], moved);
    return found;
}
