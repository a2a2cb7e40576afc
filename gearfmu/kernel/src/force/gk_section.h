/* One transverse section of a tooth pair (gk_section.c). */
#ifndef GK_SECTION_H
#define GK_SECTION_H
#include "base/gk_check.h"
#include "base/gk_lanes.h"
#include "force/gk_place.h"
#include "gk.h"
#include "model/gk_data.h"
#include "model/gk_model.h"
#include "setup/gk_setup.h"

#define GK_OPEN 1e-3 /* m: gap of a strip that has left its flanks */

typedef struct gk_posed { /* the gears of an engagement at their poses */
    const gk_model *model;
    const gk_setup *setup;
    const gk_engagement *e;
    const gk_mesh *mesh;
    const gk_gear *gear[2];
    const double *pose;
    double allowance;
} gk_posed;

typedef struct gk_action {         /* line of action of one side */
    double sg, L, sine, cosine, t; /* of t */
    double nx, ny;                 /* n */
    double dt_x, dt_y;             /* ∂t/∂(C_B − C_A) */
} gk_action;

typedef struct gk_flank_side { /* one side of the teeth: base angles and lengths of roll of the teeth 0 */
    int flank, shift, step;    /* step: B's tooth is shift + step·k */
    double sg, pitch[2], p_b, base[2], roll[2], gap, beyond, allowance;
    gk_action l;
} gk_flank_side;

/* The flanks of a tooth pair in one transverse section */
typedef struct gk_tooth_flanks {
    const gk_flank_side *side;
    double beta[2], closer; /* base angles; what the gap loses by the places of the teeth */
    const double *depth[2]; /* along the roll, beside involute and tip relief (eq. 5a); NULL: nothing */
    const double *next[2];  /* the same at the next place across the width, NULL: at all places … */
    double part[2];         /* … and the share of the way to it */
    double open;            /* gap past ends of flanks whose tip edges do not carry, m */
} gk_tooth_flanks;

/* Where a transverse section touches: direction of the force on B, and the point halfway between the teeth from the
 * axis of either gear, the same for both */
typedef struct gk_touch {
    double n[2], at[2][2];
} gk_touch;

static inline int gk_is_internal(const gk_posed *q)
{
    GK_ASSERT(q->e);
    return q->e->kind == MESH_INTERNAL;
}
/* from the axis of A to that of B */
static inline void gk_apart(const gk_posed *q, double d[2])
{
    GK_ASSERT(q->e && q->pose);
    for (int c = 0; c < 2; c++)
        d[c] = q->e->position[1][c] + q->pose[XB + c] - (q->e->position[0][c] + q->pose[XA + c]);
}
/* R: sum of the base radii, difference where A is in a ring */
static inline double gk_base_distance(const gk_posed *q)
{
    GK_ASSERT(q->gear[0] && q->gear[1]);
    return q->gear[1]->r_b + (gk_is_internal(q) ? -1.0 : 1.0) * q->gear[0]->r_b;
}

GK_HOT gk_flank_side gk_section_side(const gk_posed *q, int flank);
/* what a flank has lost to relief and deviations at a length of roll, and its slope */
GK_HOT double gk_section_depth(const gk_posed *q, const gk_tooth_flanks *f, int which, double s, double *slope);
GK_HOT int gk_section(const gk_posed *q, const gk_tooth_flanks *f, gk_point *p, gk_touch *t);
GK_HOT void gk_section_at(const gk_posed *q, const gk_tooth_flanks *f, const double roll[2], double z, gk_point *p,
                          gk_touch *t);
#endif
