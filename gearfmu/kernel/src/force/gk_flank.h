/* Which teeth may touch, at given poses of both gears (gk_flank.c). */
#ifndef GK_FLANK_H
#define GK_FLANK_H
#include "base/gk_lanes.h"
#include "force/gk_place.h"
#include "gk.h"
#include "model/gk_data.h"
#include "setup/gk_setup.h"

GK_HOT void gk_flank_clearance(const gk_model *model, const gk_setup *setup, gk_mesh *mesh);
GK_HOT void gk_flank_move(const gk_setup *setup, gk_place *place, const double delta[POSE]);
GK_HOT int gk_flank_find(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *pose,
                         double search_distance, gk_position position[2], gk_place *place);
#endif
