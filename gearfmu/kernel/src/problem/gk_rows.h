/* Rows of an engagement on the oscillators (gk_rows.c). */
#ifndef GK_ROWS_H
#define GK_ROWS_H
#include "base/gk_check.h"
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_data.h"
#include "model/gk_model.h"
#include "problem/gk_system.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

/* does a joint pull at the bore of its port's rotor? */
static inline int gk_rows_at_bore(const gk_setup *setup, const gk_system *s, int i)
{
    GK_ASSERT(i >= s->contacts && i < s->n);
    GK_ASSERT(s->joint.port[i] >= 0 && s->joint.port[i] < MAX_PORTS);
    return s->joint.which[i] == (setup->chained[s->joint.port[i]] ? JOINT_SHAFT : JOINT_PORT);
}

GK_HOT void gk_rows_pose(const gk_setup *setup, const gk_work *work, int e, const double *spin, const double *ground,
                         double *pose);
GK_HOT void gk_rows_without_rigid(const gk_setup *setup, const gk_work *work, int e, const double *ground,
                                  double *read);
GK_HOT void gk_rows_form(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_rows_form_ground(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_rows_form_along(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_rows_form_bores(const gk_setup *setup, gk_work *work, int e);
#endif
