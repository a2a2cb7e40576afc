/* Displacement of the flank of one tooth along its outward normal, at a few points and by width function, and the loads
 * that press on it there (gk_field.c). */
#ifndef GK_FIELD_H
#define GK_FIELD_H
#include "base/gk_lanes.h"
#include "model/gk_model.h"
#include "setup/gk_grid.h"
#include "setup/gk_setup.h"

typedef struct gk_field {
    const gk_setup *setup;
    int gear, flank, tooth, functions; /* tooth: wrapped number */
    double cosine, sine;               /* of the angle of the tooth */
    const double *ground;              /* displacements of the ground group, then speeds */
    double at[POINTS * MAX_FUNCTIONS], rate[POINTS * MAX_FUNCTIONS], load[POINTS * MAX_FUNCTIONS];
    unsigned char known[POINTS]; /* what no node has asked for is not known */
    gk_real *q, *v, *f;          /* lanes: gear group in the frame of the tooth; force on it */
} gk_field;

typedef struct gk_reading { /* at one length of roll, by width function */
    double at[MAX_FUNCTIONS], slope[MAX_FUNCTIONS], rate[MAX_FUNCTIONS];
} gk_reading;

GK_HOT void gk_field_begin(gk_field *f, const gk_real *y, const gk_real *speed);
GK_HOT gk_reading gk_field_read(gk_field *f, const gk_grid *grid);
GK_HOT void gk_field_load(gk_field *f, const gk_grid *grid, const double *load);
GK_HOT void gk_field_end(const gk_field *f, const gk_real *zero, gk_real *sum[2], double *ground_force);
#endif
