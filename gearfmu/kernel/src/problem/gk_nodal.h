/* Nodal contact (gk_nodal.c). */
#ifndef GK_NODAL_H
#define GK_NODAL_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_data.h"
#include "problem/gk_system.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

GK_HOT void gk_nodal_leave(gk_system *s);
GK_HOT void gk_nodal_press(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                           const gk_real *const speed[], double spin_rate[]);
#endif
