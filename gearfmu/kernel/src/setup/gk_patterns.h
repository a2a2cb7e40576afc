/* Patterns by which the flanks of a gear feel the ground group (gk_patterns.c). */
#ifndef GK_PATTERNS_H
#define GK_PATTERNS_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

/* room: doubles as in gk_side_scratch */
typedef void gk_patterns_function(const gk_model *model, gk_setup *setup, double *room);
GK_HOT gk_patterns_function gk_patterns_find;
/* between: (2, patterns of the second, of the first) of each pair of gears that meet, in the step k */
GK_HOT void gk_patterns_between(const gk_model *model, const gk_setup *setup, const gk_coefficients *k,
                                gk_real *(*between)[MAX_GEARS]);
#endif
