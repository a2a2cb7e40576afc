/* A place where two teeth may touch, and where gears stand in the tables of their sides. */
#ifndef GK_PLACE_H
#define GK_PLACE_H
#include "base/gk_check.h"
#include "model/gk_data.h"
#include "model/gk_model.h"
#include "setup/gk_setup.h"

typedef struct gk_point { /* of a strip */
    double gap, gradient[POSE];
    double slide[POSE];        /* with friction: what gear A slides past B along the profile of A */
    double roll[2], curvature; /* length of roll on each gear, 1/ρA + 1/ρB in the normal section */
    double share;              /* of a slice's length: that of a part of a line of contact */
    double end[2];             /* of a part: its ends, z (m) */
    double moves;              /* of a part: its speed along the path of contact over that of a fixed z */
    double opens[GAPS - 1];    /* of a part: what its further gaps are more than the least, `gap`, m (gk_law.c) */
} gk_point;

typedef struct gk_place { /* a tooth pair on one flank that may touch, at the predicted poses */
    gk_key key;
    double gap;                     /* the smallest of its points' */
    gk_point point[MAX_SLICES];     /* of every strip; one for all where the model is planar */
    int tooth[2], number[2], flank; /* tooth of each gear: wrapped to 0 … z−1, and as counted */
    int candidate[2];               /* its place in the tables of both sides */
    double action;                  /* angle t of the line of action */
    int memory;                     /* its entry in the memory of the engagement, −1 if new */
} gk_place;

static inline const gk_point *gk_point_of(const gk_setup *setup, const gk_place *place, int strip)
{
    GK_ASSERT(strip >= 0 && strip < setup->strips);
    return &place->point[setup->spatial ? strip : 0];
}

/* where a side stands in its table */
typedef struct gk_position {
    int node, tooth;   /* node below; reference tooth, wrapped */
    int64_t reference; /* as counted */
    double part;       /* 0 … 1 of the way to the next node */
} gk_position;

#endif
