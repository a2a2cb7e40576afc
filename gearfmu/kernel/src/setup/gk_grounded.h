/* What ground oscillators and supports do to a side of an engagement (gk_grounded.c). */
#ifndef GK_GROUNDED_H
#define GK_GROUNDED_H
#include "base/gk_lanes.h"
#include "base/gk_check.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_node.h"

typedef struct gk_matrix {
    const double *entry;
    int rows, columns; /* columns: in whole quads */
} gk_matrix;

/* What the ground oscillators that are not dynamic and the supports do to a side (gk_node_motion: rows M of motions);
 * rows are padded with zeros to whole quads */
typedef struct gk_grounded {
    int motions, stride, held, columns;
    double *yields;  /* (motions, stride): M Ω⁻² Mᵀ − C_fs κ C_sf: the motion at a flank per load on motions */
    double *joints;  /* (motions, held): elongation of the supports; angle of the port */
    double *dynamic; /* (motions, columns: width of the gear): M of the dynamic oscillators */
} gk_grounded;

/* doubles of a gear with `columns` dynamic oscillators */
GK_HOT size_t gk_grounded_room(const gk_model *model, const gk_gear *gear, int columns);
GK_HOT gk_grounded gk_grounded_side(const gk_node *n, double *room);
static inline gk_matrix gk_grounded_yields(const gk_grounded *g)
{
    GK_ASSERT(g->stride % 4 == 0);
    return (gk_matrix){g->yields, g->motions, g->stride};
}
static inline gk_matrix gk_grounded_joints(const gk_grounded *g)
{
    GK_ASSERT(g->held % 4 == 0);
    return (gk_matrix){g->joints, g->motions, g->held};
}
static inline gk_matrix gk_grounded_dynamic(const gk_grounded *g)
{
    GK_ASSERT(g->columns % 4 == 0);
    return (gk_matrix){g->dynamic, g->motions, g->columns};
}
/* out (points, columns) += x (points, rows) · matrix */
GK_HOT void gk_grounded_times(const double *x, const gk_matrix *by, int points, double *out);
#endif
