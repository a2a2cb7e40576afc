/* What a slice yields beside its neighbours on one tooth, near its load (gk_slices.c). */
#ifndef GK_SLICES_H
#define GK_SLICES_H
#include "setup/gk_node.h"

/* m/N, between two slices of one flank: that of their own patches less that of their width functions */
GK_HOT double gk_slices_local(const gk_node *n, const gk_spot *p, const gk_spot *q);
#endif
