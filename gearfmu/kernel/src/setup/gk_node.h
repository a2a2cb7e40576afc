/* One node of a side's tables (gk_node.c): what its points read of all stored modes and of every ground oscillator. */
#ifndef GK_NODE_H
#define GK_NODE_H
#include "base/gk_check.h"
#include "base/gk_lanes.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"
#include "setup/gk_grid.h"
#include "setup/gk_spread.h"

typedef struct gk_spot { /* a candidate's strip at a node */
    int flank, offset;
    gk_grid grid;                 /* of where contact is */
    double middle, nominal, roll; /* length of roll on the line of action at mid-width, here; where contact is */
    double z, length, width[MAX_FUNCTIONS]; /* part that carries: middle, length, weights on the width functions */
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
    double length;  /* of the line of action between the base circles, nominal */
    double *rows;   /* (points, modes): all stored modes, tooth offset included */
    double *motion; /* (points, gk_node_motions): what ground oscillators displace outward is motion · M */
    double *along_rows, *along_motion; /* rows and motion along the profile (gk_node_along) */
    double *still, *along_still;       /* what motion is turned from: (points, gk_node_still), (points, low) */
    double *port;                      /* (points) */
    double *flexibility;               /* (modes) 1/ω² */
    double *cells;                     /* (functions, modes): rows at one length of roll */
    double *cosine, *sine;             /* (candidates, modes) of the turn to a candidate's tooth */
    double helix_cosine, helix_sine, helix_tan;
    int beyond[MAX_CANDIDATES]; /* there is a tooth too far from this one for the tables of compliance */
} gk_node;

enum { GK_NODE_PARTS = 18 }; /* three of the node: c0, c_c, c_s */

/* Motion at a flank by ground oscillators is a row of 12 + low numbers times M (12 + low, reads): rigid motion of the
 * gear (centre), modes of nodal diameter 0 and 1 (low), and forces on its node (node). */
static inline int gk_node_motions(const gk_gear *gear) { return 12 + gear->low; }
/* row i of M, over what the gear reads */
static inline const double *gk_node_motion(const gk_gear *gear, int set, int i)
{
    const int reads = gear->ground[set].reads;
    if (i < 6) return gear->ground[set].centre + i * reads;
    i -= 6;
    return i < gear->low ? gear->ground[set].low + (size_t)i * (size_t)reads
                         : gear->ground[set].node + (i - gear->low) * reads;
}
static inline int gk_node_still(const gk_gear *gear) { return gear->low + GK_NODE_PARTS; }
static inline int gk_node_offset(const gk_side *side, int candidate)
{
    const int flank = candidate >= side->count[0];
    return side->first[flank] + side->step * (flank ? candidate - side->count[0] : candidate);
}
GK_HOT gk_node gk_node_begin(const gk_model *model, const gk_setup *setup, const gk_room *of, int e,
                             const gk_side *side);
/* goes on to another side whose points lie at the same places of a gear of the same body */
GK_HOT void gk_node_take(gk_node *n, int e, const gk_side *side);
/* doubles of a node; the scratch that is left for what is made of it */
GK_HOT size_t gk_node_size(const gk_model *model, const gk_gear *gear);
GK_HOT double *gk_node_room(const gk_node *n);
/* `position`: share of the pitch */
GK_HOT void gk_node_gather(gk_node *n, double position, int all);
GK_HOT void gk_node_turn(gk_node *n, int along);
/* motion outward at a point of a gear in an engagement, by the node's angles of helix alone */
GK_HOT void gk_node_motion_at(const gk_node *n, const gk_spot *p, double *motion);
/* out (width) = Σ over the four rolls and the width functions of a table (2, rolls, functions, width) at one point */
GK_HOT void gk_node_blend(const gk_node *n, const gk_real *table, const gk_spot *p, int width, double *out);
/* sense of growing roll on this side against the direction in which gear B slides past A */
static inline double gk_node_along(const gk_node *n)
{
    GK_ASSERT(n->side && n->e);
    return n->side->which == 1 && n->e->kind == MESH_INTERNAL ? 1.0 : -1.0;
}
/* Σ a b, in four lanes */
static inline double gk_node_dot(const double *a, const double *b, int n)
{
    double lane[4] = {0, 0, 0, 0};
    int k = 0;
    for (; k + 4 <= n; k += 4)
        for (int l = 0; l < 4; l++) lane[l] += a[k + l] * b[k + l];
    for (; k < n; k++) lane[0] += a[k] * b[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}
/* (−1)^degree of a width function: what half a turn about the middle line of a tooth does to it */
static inline double gk_width_sign(const gk_model *model, int function)
{
    return model->degree[function] % 2 ? -1.0 : 1.0;
}
/* length of roll of a candidate on the line of action at mid-width */
GK_HOT double gk_node_roll(const gk_side *side, int flank, double position, int offset);
GK_HOT double gk_node_tan(double angle);
#endif
