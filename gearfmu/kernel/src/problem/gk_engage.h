/* Contacts of an engagement, and what it remembers of them from step to step (gk_engage.c). */
#ifndef GK_ENGAGE_H
#define GK_ENGAGE_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_system.h"
#include "problem/gk_work.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

typedef struct gk_search {    /* how contacts are looked for */
    const gk_coefficients *k; /* of the problem that is formed */
    const double *spin;       /* angles at which flanks are looked for; NULL: those of the pose */
    const double *ground;     /* ground oscillators that move the pose; NULL: those that the rows read */
    double reach;             /* m: look this far at least */
    int anew;                 /* this far exactly, and nothing is remembered */
} gk_search;

GK_HOT int gk_engage(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                     const gk_search *how, int e);
GK_HOT int gk_engage_overlaps(const gk_model *model, const gk_work *work, int e);
GK_HOT void gk_memory_recall(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int e);
GK_HOT void gk_memory_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, int e);
GK_HOT void gk_memory_forget(gk_engaged *engaged);
#endif
