/* Compliance of what is not dynamic between the points of a node (gk_residual.c). */
#ifndef GK_RESIDUAL_H
#define GK_RESIDUAL_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_block.h"
#include "setup/gk_grounded.h"
#include "setup/gk_node.h"

typedef struct gk_residual {
    double *whole, *taken;  /* (points, points): of the gear group, all of it; what its dynamic modes carry of that */
    double *normal, *along; /* with friction: normal displacement and that along the profile by force along it */
    double *middle, *share; /* (points, lanes): rows halfway to the next node times 2, and a quarter of that */
    double *patches;        /* (strips, strips): gk_slices_fill */
    double *square;         /* (lanes): ω² of the dynamic modes, 1 in padding */
    double *loaded;         /* (points, stride): what the ground oscillators yield under a load at every point */
} gk_residual;

GK_HOT size_t gk_residual_size(const gk_model *model, const gk_gear *gear, size_t points);
/* takes its place; returns what is left */
GK_HOT double *gk_residual_begin(gk_residual *r, const gk_node *n, double *room);
/* of the gear group, at a node or halfway to the next: the same for twins */
GK_HOT void gk_residual_gather(gk_residual *r, const gk_node *n, int at, int halfway);
GK_HOT void gk_residual_gather_along(gk_residual *r, const gk_node *n);
/* of a side, with its ground oscillators and supports */
GK_HOT void gk_residual_store(gk_residual *r, const gk_node *n, int at, int halfway, const gk_grounded *g);
GK_HOT void gk_residual_store_along(gk_residual *r, const gk_node *n, int at, const gk_grounded *g);
#endif
