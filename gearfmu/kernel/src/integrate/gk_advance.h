/* Oscillators and spins of a step: ahead under the old forces, to its end under the new ones (gk_advance.c). */
#ifndef GK_ADVANCE_H
#define GK_ADVANCE_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_data.h"
#include "problem/gk_work.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

GK_HOT double gk_advance_predict(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                                 const gk_coefficients *k);
GK_HOT void gk_advance_correct(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                               const gk_coefficients *k);
#endif
