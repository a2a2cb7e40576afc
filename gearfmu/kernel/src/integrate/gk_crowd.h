/* Half steps of many turning pairs and dashpots of the ground group. */
#ifndef GK_CROWD_H
#define GK_CROWD_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

GK_HOT void gk_crowd_turn(const gk_base *base, const gk_coefficients *k, const gk_data *data, double *v);
GK_HOT double gk_crowd_damp(const gk_model *model, const gk_base *base, const gk_coefficients *k, const double *f,
                            double *v);
#endif
