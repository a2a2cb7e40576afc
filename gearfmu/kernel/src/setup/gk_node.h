/* One node of a side's tables (gk_node.c): what its points read of all stored modes and of every ground oscillator. */
#ifndef GK_NODE_H
#define GK_NODE_H
#include "base/gk_check.h"
#include "problem/gk_work.h"

typedef struct gk_spot { /* a candidate's strip at a node */
    int flank, offset;
    gk_grid grid;                   /* of where contact is */
    double middle, nominal, roll;   /* length of roll on the line of action at mid-width, here; where contact is */
    double z, width[MAX_FUNCTIONS]; /* middle of the part that carries; its weights on the width functions */
} gk_spot;

typedef struct gk_node { /* what a node's tables are made from */
    const gk_model *model;
    const gk_setup *setup;
    const gk_engagement *e;
    const gk_gear *gear;
    const gk_side *side;
    const gk_flank_tables *flank;
    const gk_compliance *compliance;
    int points;                              /* candidates × strips */
    gk_spot at[MAX_CANDIDATES * MAX_SLICES]; /* points */
    gk_strip_weights weight;
    double length;   /* of the line of action between the base circles, nominal */
    double *rows;    /* (points, modes): all stored modes, tooth offset included */
    double *ground;  /* (points, reads): outward, rigid motion included, of every ground oscillator */
    double *rigid;   /* (points, reads): the part of it that is rigid motion */
    double *support; /* (points, supports): C_fs */
    double *along_rows, *along_ground, *along_rigid; /* rows, ground and rigid along the profile (gk_along) */
    double *port;                                    /* (points) */
    double *flexibility;                             /* (modes) 1/ω² of the dynamic ones */
} gk_node;

gk_node gk_node_begin(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, const gk_side *side);
/* `position`: share of the pitch */
void gk_node_gather(gk_node *n, double position);
/* out (width) = Σ over the four rolls and the width functions of a table (2, rolls, functions, width) at one point */
void gk_node_blend(const gk_node *n, const gk_real *table, const gk_spot *p, int width, double *out);
/* sense of growing roll on this side against the direction in which gear B slides past A */
static inline double gk_node_along(const gk_node *n)
{
    GK_ASSERT(n->side && n->e);
    return n->side->which == 1 && n->e->kind == MESH_INTERNAL ? 1.0 : -1.0;
}
/* (−1)^degree of a width function: what half a turn about the middle line of a tooth does to it */
static inline double gk_width_sign(const gk_model *model, int function)
{
    return model->degree[function] % 2 ? -1.0 : 1.0;
}
/* length of roll of a candidate on the line of action at mid-width */
double gk_node_roll(const gk_side *side, int flank, double position, int offset);
double gk_node_tan(double angle);
#endif
