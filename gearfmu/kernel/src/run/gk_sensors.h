/* Points of the housing as outputs. */
#ifndef GK_SENSORS_H
#define GK_SENSORS_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"

GK_HOT void gk_sensors_speed(const gk_model *model, const gk_setup *setup, const double *speed, double *out);
GK_HOT void gk_sensors_means(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double H,
                             const double *before);
#endif
