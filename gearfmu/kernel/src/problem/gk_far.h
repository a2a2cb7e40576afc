/* Far teeth of gears with several engagements (gk_far.c). */
#ifndef GK_FAR_H
#define GK_FAR_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"

GK_HOT void gk_far_form(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_far_rest(const gk_setup *setup, gk_engaged *engaged);
GK_HOT void gk_far_push(const gk_setup *setup, gk_engaged *engaged, const double *force);
GK_HOT void gk_far_list(const gk_coupled *c);
GK_HOT void gk_far_move(const gk_work *work);
GK_HOT void gk_far_read(const gk_setup *setup, const gk_engaged *engaged, double *read);
#endif
