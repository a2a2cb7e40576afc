/* Rows of an engagement and the oscillators: what they read, and what their forces do (gk_exchange.c). */
#ifndef GK_EXCHANGE_H
#define GK_EXCHANGE_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_rows.h"
#include "problem/gk_system.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

typedef struct gk_rows { /* of the gaps of an engagement, or of the sliding of its contacts */
    const gk_setup *setup;
    gk_work *work; /* for states in the frame of a tooth */
    const gk_engaged *engaged;
    gk_real *const *basis; /* of both sides: (contacts, n) on the gear groups */
    const double *ground;  /* (count, local part) on the ground group */
    int count;
} gk_rows;

GK_HOT gk_rows gk_rows_of_gaps(const gk_setup *setup, gk_work *work, int e);
GK_HOT gk_rows gk_rows_of_sliding(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_exchange_read_ground(const gk_rows *rows, const double *ground, double *read);
GK_HOT void gk_exchange_read_modes(const gk_rows *rows, int which, const gk_real *y, double *read);
GK_HOT void gk_exchange_read(const gk_rows *rows, const gk_real *const y[], const double *ground, double *read);
GK_HOT void gk_exchange_push_modes(const gk_rows *rows, int which, const double *x, const double *y, gk_real *out_x,
                                   gk_real *out_y);
GK_HOT void gk_exchange_scatter(const gk_model *model, const gk_setup *setup, gk_work *work,
                                const double *(*x)(const gk_system *), const double *(*y)(const gk_system *));
/* between flanks and bores at once: moments on ports, and what contacts turn the bores */
GK_HOT void gk_exchange_push_bores(const gk_setup *setup, const gk_engaged *engaged, const double *x, gk_bores *sum);
GK_HOT void gk_exchange_read_bores(const gk_setup *setup, const gk_engaged *engaged, const gk_bores *bores,
                                   double *read);
#endif
