/* Nodes of the flanks for nodal contact (docs/theory.md, 2.7), and places on the even grid of rolls that a gear's rows are
 * stored on. */
#ifndef GK_NODAL_H
#define GK_NODAL_H
#include "model/gk_model.h"

/* where a length of roll lies on the grid: value = Σ weight value[index + i], derivative by the roll = Σ slope … */
typedef struct gk_grid {
    int index;
    double weight[4], slope[4];
} gk_grid;

/* nodes of a tooth's flank of one gear in an engagement: a grid along the flank and across the common face width */
typedef struct gk_nodes {
    int along, across;
    double *roll, *x, *y,
        *length;          /* (along): length of roll; place about the axis, base angle of a drive flank 0; arc length
                                      that the node stands for */
    gk_grid *grid;        /* (along) */
    double *z, *width;    /* (across): place; face width that the node stands for, its mirror image's included */
    double *functions[2]; /* (across, functions): (2a + 1) P_a there on gear A and on gear B */
    double *lead;         /* (2 flanks, across): what leads of both gears open, in the transverse section */
    int32_t *strip;       /* (across): strip that reports the node's force */
} gk_nodes;

gk_grid gk_grid_at(const gk_model *model, const gk_gear *gear, double roll);
#endif
