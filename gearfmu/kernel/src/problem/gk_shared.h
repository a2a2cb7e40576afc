/* What engagements of one gear do to each other (gk_shared.c). */
#ifndef GK_SHARED_H
#define GK_SHARED_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

GK_HOT void gk_shared_form(const gk_model *model, const gk_setup *setup, gk_work *work, int island);
GK_HOT void gk_shared_read(const gk_setup *setup, const gk_work *work, int e, double *read);
#endif
