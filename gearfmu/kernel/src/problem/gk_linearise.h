/* The stage linearised at rest under load (docs/theory.md, 8), in the terms of a step: coordinates are spins and
 * dynamic oscillators, rows the unknown forces of a step that are at work.
 *
 *     x = W q,   λ = −(Q + S)⁻¹ x,   M q̈ + diag(ω²) q = Wᵀ λ                                                    (29)
 *
 * S = P + δ′: the compliance parallel to a row's own damper at the force of the moment; Q: everything else that is
 * quasi-static. Clutches are taken as closed: the two inertias they connect are one coordinate. */
#ifndef GK_LINEARISE_H
#define GK_LINEARISE_H
#include "gk.h"

typedef struct gk_linear {                            /* arrays are the caller's, row by row */
    int32_t coordinates, room, supports, engagements; /* gk_linearise_room; room: for rows */
    int32_t rows;                                     /* found, ≤ room */
    /* coordinates */
    int32_t *group,
        *number; /* −1: spin of rotor, or of a chain's inertia; 0: ground oscillator; 1 + g: mode of gear g */
    double *mass, *omega, *zeta; /* kg m², or 1 for oscillators; rad/s */
    /* rows, in what they read (gaps, m; angles, rad) and press (N, N m) */
    int32_t
        *label; /* (room, 4) engagement, flank, tooth of gear A and strip of a contact; −1, port and joint otherwise */
    double *force, *dashpot, *te; /* λ; damper's constant; derivative of a gap by the transmission error of its pair */
    double *W;                    /* (room, coordinates) */
    double *Q, *S;                /* (room, room) */
    /* supports: force = support_rows q + support_forces λ + support_damping q̇; of the springs alone, without the last:
     * elongation = compliance · force */
    double *support_compliance, *support_rows,
        *support_forces;          /* (supports), (supports, coordinates), (supports, room) */
    double *support_damping;      /* (supports, coordinates) N·s/m */
    double *damper, *damper_rows; /* (supports), 0: none; (supports, coordinates) of elongation */
} gk_linear;

/* how much there is at most, into the numbers before `rows`; after gk_prepare */
GK_API gk_outcome gk_linearise_room(const gk_model *model, const gk_setup *setup, gk_linear *out);
/* Fills all the rest at the equilibrium that gk_te or gk_initialize left in `data`. GK_BAD_CALL when data has moved on
 * since then. */
GK_API gk_outcome gk_linearise(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                               gk_linear *out);
#endif
