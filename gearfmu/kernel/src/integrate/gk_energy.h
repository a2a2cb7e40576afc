/* Energy of a stage, and what a step changes of it (gk_energy.c). */
#ifndef GK_ENERGY_H
#define GK_ENERGY_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_data.h"
#include "problem/gk_work.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

GK_HOT double gk_energy_dynamic(const gk_model *model, const gk_setup *setup, const gk_data *data,
                                const gk_coefficients *k);
GK_HOT double gk_energy_invariant(const gk_model *model, const gk_setup *setup, const gk_data *data,
                                  const gk_coefficients *k);
GK_HOT void gk_energy_settle(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data);
#endif
