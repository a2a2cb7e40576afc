/* Places on even grids along the flanks of a gear (gk_grid.c), and what nodal contact needs there (docs/theory.md,
 * 2.7). */
#ifndef GK_GRID_H
#define GK_GRID_H
#include "base/gk_lanes.h"
#include "model/gk_model.h"

/* where a length of roll lies on the grid: value = Σ weight value[index + i], derivative by the roll = Σ slope … */
typedef struct gk_grid {
    int index;
    double weight[4], slope[4];
} gk_grid;

enum { POINTS = 20 }; /* of a flank, even in arc length, at which displacements are read */

/* Deviations of the flanks of a gear as an engagement reads them */
typedef struct gk_deviation {
    const gk_gear *gear;  /* NULL: involutes */
    int lines;            /* across the width, strips or layers of nodes; 1: all alike */
    double *depth;        /* (teeth, 2 flanks, lines, rolls) m */
    const double *shared; /* the same by the places of the gear's own field, NULL: not used */
} gk_deviation;

/* Outward displacement at the points of a gear's flanks by its dynamic oscillators */
typedef struct gk_point_rows {
    gk_real *modes;  /* (2 flanks, points, functions, lanes) of the gear group, tooth 0 */
    gk_real *ground; /* (3, 2 flanks, points, functions, width of the gear) c0, c_c, c_s of the ground group (eq. 2c) */
} gk_point_rows;

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
    gk_deviation deviation[2]; /* of gear A and of gear B at the places across */
    int32_t *strip;            /* (across): strip that reports the node's force */
} gk_nodes;

gk_grid gk_grid_points(const gk_gear *gear, double roll);
gk_grid gk_grid_flank(const gk_gear *gear, int count, double roll);
gk_grid gk_grid_at(const gk_model *model, const gk_gear *gear, double roll);
#endif
