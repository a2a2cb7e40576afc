/* The state of a gear group in the frame of a tooth (gk_turn.c). */
#ifndef GK_TURN_H
#define GK_TURN_H
#include "base/gk_lanes.h"
#include "setup/gk_setup.h"

GK_HOT void gk_turn_back(const gk_modal *m, int tooth, const gk_real *y, gk_real *out);
GK_HOT void gk_turn_forth(const gk_modal *m, int tooth, const gk_real *f[2], gk_real *sum[2]);
GK_HOT void gk_turn_add(const gk_modal *m, int tooth, int lanes, const gk_real *y, gk_real *sum);
#endif
