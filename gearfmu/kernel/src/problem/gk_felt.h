/* Engagements and the ground group by patterns (gk_felt.c). */
#ifndef GK_FELT_H
#define GK_FELT_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_exchange.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

GK_HOT void gk_felt_see(const gk_model *model, const gk_setup *setup, gk_work *work);
GK_HOT void gk_felt_plan(const gk_setup *setup, const gk_work *work, gk_engaged *engaged);
GK_HOT void gk_felt_rows(const gk_setup *setup, gk_work *work, int e, int w);
GK_HOT void gk_felt_give(const gk_coupled *c, int e, int w, const double *moved, const double *yielded);
GK_HOT void gk_felt_others(const gk_coupled *c, int at_once);
GK_HOT void gk_felt_take(const gk_setup *setup, const gk_work *work, int e, int w, int at_once, double *others);
GK_HOT void gk_felt_scatter(const gk_model *model, const gk_setup *setup, gk_work *work);
#endif
