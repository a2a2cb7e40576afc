/* Forces of strips on modes and ground oscillators, row by row (gk_push.c). */
#ifndef GK_PUSH_H
#define GK_PUSH_H
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_setup.h"

typedef struct gk_strip_load { /* outward forces on the strips of one tooth */
    int gear, flank, tooth, strips;
    double force[MAX_SLICES], roll[MAX_SLICES], z[MAX_SLICES];
    gk_strip_weights width;
} gk_strip_load;

void gk_node_push(const gk_model *model, const gk_setup *setup, const gk_strip_load *load, int first, double *row,
                  double *sum);
void gk_node_push_ground(const gk_model *model, const gk_setup *setup, int e, int which, const gk_strip_load *load,
                         double *sum);
#endif
