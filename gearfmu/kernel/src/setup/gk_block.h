/* Compliance between two points of a gear's flanks (gk_block.c). */
#ifndef GK_BLOCK_H
#define GK_BLOCK_H
#include "base/gk_lanes.h"
#include "setup/gk_node.h"

/* a block of gk_compliance and how it is read: loaded and displaced place swapped; as the image of a mirrored flank */
typedef struct gk_block {
    const gk_real *table;
    int swapped, image;
} gk_block;

/* compliance of a tooth's flank `to` by a load on flank `from` of the tooth `offset` before it */
GK_HOT gk_block gk_block_of(const gk_node *n, int from, int to, int offset);
/* normal displacement at flank `from` per force along the profile at flank `to` of the same tooth; along the profile */
GK_HOT gk_block gk_block_along_normal(const gk_node *n, int from, int to);
GK_HOT gk_block gk_block_along_own(const gk_node *n, int from, int to);
/* (functions, functions) between two points */
GK_HOT void gk_block_tabulate(const gk_node *n, gk_block b, const gk_spot *p, const gk_spot *q, double *cell);
/* between points i and j */
GK_HOT double gk_block_between(const gk_node *n, gk_block b, int i, int j);
#endif
