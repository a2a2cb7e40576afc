/* What a run is made of (gk_choose.c). */
#ifndef GK_CHOOSE_H
#define GK_CHOOSE_H
#include "gk.h"

gk_outcome gk_choose(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE]);
double gk_longest_step(const gk_model *model);
int gk_choose_modes(const gk_model *model, const gk_setup *setup, int g);
int gk_choose_ground(const gk_model *model, const gk_setup *setup, int32_t *which);
#endif
