/* Motions of a stage at rest that ports decide or nothing holds (gk_static.c). */
#ifndef GK_MOTIONS_H
#define GK_MOTIONS_H
#include "integrate/gk_equilibrium.h"

void gk_motions_find(gk_equilibrium *r);
void gk_motions_begin(gk_equilibrium *r);
void gk_motions_balance(gk_equilibrium *r, int solved);
void gk_motions_hold(gk_equilibrium *r);
void gk_motions_unroll(gk_equilibrium *r);
#endif
