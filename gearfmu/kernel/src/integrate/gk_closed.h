/* Problems of engagements whose contacts are closed at a roll position, and what they say of a step (gk_closed.c). */
#ifndef GK_CLOSED_H
#define GK_CLOSED_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_system.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

GK_HOT void gk_closed_compliance(const gk_system *s, const double *Q, double full, int dashpots, double *C);
GK_HOT int gk_closed_place(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e,
                           double position);
GK_HOT gk_keep_function gk_closed_keep;
GK_HOT gk_holds_function gk_closed_holds;
#endif
