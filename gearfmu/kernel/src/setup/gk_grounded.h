/* What ground oscillators and supports do to a side of an engagement (gk_grounded.c). */
#ifndef GK_GROUNDED_H
#define GK_GROUNDED_H
#include "setup/gk_node.h"

/* What the ground oscillators that are not dynamic and the supports do to a side (gk_node_motion: rows M of motions) */
typedef struct gk_grounded {
    int motions, columns;
    double *yields;  /* (motions, motions): M Ω⁻² Mᵀ − C_fs κ C_sf: the motion at a flank per load on motions */
    double *loaded;  /* (points, motions): yields · motion of every point */
    double *joints;  /* (motions, supports + 1): elongation of the supports; angle of the port */
    double *dynamic; /* (motions, width of the gear): M of the dynamic oscillators */
} gk_grounded;

gk_grounded gk_grounded_side(const gk_node *n);
/* `loaded` of every point of a node */
void gk_grounded_load(const gk_node *n, const gk_grounded *g);
/* through the ground oscillators that are not dynamic and the supports, between two points */
double gk_grounded_through(const gk_node *n, const gk_grounded *g, int i, int j);
/* out (m) += x (n) · matrix (n, m) */
void gk_grounded_times(const double *x, const double *matrix, int n, int m, double *out);
#endif
