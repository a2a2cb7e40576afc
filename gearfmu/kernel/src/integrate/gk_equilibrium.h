/* A search for rest (gk_static.c): its unknowns, the forces that are left on them and the tangent of these. */
#ifndef GK_EQUILIBRIUM_H
#define GK_EQUILIBRIUM_H
#include "base/gk_check.h"
#include "gk.h"
#include "integrate/gk_integrate.h"
#include "model/gk_data.h"
#include "model/gk_model.h"
#include "problem/gk_work.h"
#include "setup/gk_kinematics.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

typedef struct gk_equilibrium { /* a search for rest */
    const gk_model *model;
    gk_setup setup; /* as of the model, but for joints */
    gk_work *work;
    gk_data *data;
    const gk_boundary *boundary;
    gk_coefficients k;
    gk_motions motion;      /* of the spins without deformation, no two of those that float alike in kinetic energy */
    int floats[MAX_ROTORS]; /* motions that nothing holds */
    int leader[MAX_ROTORS]; /* port that decides where a motion begins, −1: none */
    double given[MAX_SPINS], before[MAX_SPINS];
    int island;                              /* that comes to rest now */
    int unknowns;                            /* spins, lanes of the ground group, soft modes gear by gear */
    int soft[MAX_GEARS], soft_at[MAX_GEARS]; /* how many of a gear; number of the first among the unknowns */
    int32_t lane[MAX_GEARS][MAX_SOFT];
    double *force, *move; /* of them */
    double *tangent;      /* (unknowns, unknowns) */
    double trust;         /* m: how far the next move may go */
    double loose;         /* s²: LOOSE … MOST_LOOSE */
    double gain;          /* J: force along the whole of the last move */
} gk_equilibrium;

/* does the island that comes to rest now have the engagement, and the spin? */
static inline int gk_equilibrium_has(const gk_equilibrium *r, int e)
{
    GK_ASSERT(gk_is_mesh(&r->setup, e));
    return r->setup.mesh[e].island == r->island;
}
static inline int gk_equilibrium_moves(const gk_equilibrium *r, int d)
{
    GK_ASSERT(d >= 0 && d < r->setup.spins);
    for (int e = 0; e < r->model->engagements; e++)
        for (int l = 0; l < r->setup.mesh[e].spins && gk_equilibrium_has(r, e); l++)
            if (r->setup.mesh[e].spin[l] == d) return 1;
    return 0;
}

void gk_equilibrium_unknowns(gk_equilibrium *r);
void gk_equilibrium_forces(gk_equilibrium *r);
void gk_equilibrium_tangent(gk_equilibrium *r);
void gk_equilibrium_go(gk_equilibrium *r, double share);
#endif
