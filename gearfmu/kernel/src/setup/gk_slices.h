/* What a slice yields beside its neighbours on one tooth, near its load (gk_slices.c). */
#ifndef GK_SLICES_H
#define GK_SLICES_H
#include "setup/gk_node.h"

/* patches (strips, strips): of whole slices */
GK_HOT void gk_slices_fill(const gk_node *n, double *patches);
/* m/N, between two points of one flank: that of their patches less that of their width functions */
GK_HOT double gk_slices_local(const gk_node *n, const double *patches, int i, int j);
#endif
