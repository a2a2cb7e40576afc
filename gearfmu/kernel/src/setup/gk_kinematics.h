/* What turns with what, without deformation: engagements roll in the axes of their frames. */
#ifndef GK_KINEMATICS_H
#define GK_KINEMATICS_H
#include "model/gk_data.h"

/* independent motions: speed of every spin per unit of each */
typedef struct gk_motions {
    int count;
    double turn[MAX_ROTORS][MAX_SPINS];
} gk_motions;

void gk_kinematics_find(const gk_model *model, gk_motions *motions);
/* 1 where an engagement drives through the flanks sg = −1 when the other ports hold a torque in +z on the first */
void gk_kinematics_carrying(const gk_model *model, int coasts[MAX_ENGAGEMENTS]);
void gk_kinematics_follow(const gk_model *model, int known[MAX_ROTORS], double *speed);
#endif
