/* Sections in space, and the parts of a line of contact (gk_parts.c). */
#ifndef GK_PARTS_H
#define GK_PARTS_H
#include "base/gk_lanes.h"
#include "force/gk_place.h"
#include "force/gk_section.h"

/* a section at z: gap, gradient and curvature along the normal in space; with friction, its sliding */
GK_HOT void gk_parts_lean(const gk_posed *q, double sg, const gk_touch *t, double z, gk_point *p);
GK_HOT void gk_parts_glide(const gk_posed *q, double sg, const gk_touch *t, double z, gk_point *p);
/* points of all parts of a tooth pair's line of contact; 0 when none comes within `search_distance` */
GK_HOT int gk_parts_find(const gk_posed *q, gk_tooth_flanks *f, const double roll[2], double search_distance,
                         gk_place *place);
#endif
