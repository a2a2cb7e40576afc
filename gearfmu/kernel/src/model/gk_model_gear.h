/* A gear of a blob (gk_model_gear.c). */
#ifndef GK_MODEL_GEAR_H
#define GK_MODEL_GEAR_H
#include "model/gk_model.h"
#include "model/gk_read.h"

void gk_model_gear(gk_reader *r, gk_model *m, int i);
#endif
