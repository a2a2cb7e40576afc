/* The part of gk_work that setup fills: coefficients and tables of the steps in use, and scratch. */
#ifndef GK_ROOM_H
#define GK_ROOM_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_spread.h"

enum {
    CACHE = 4,          /* coefficient sets kept */
    COMMON = 8,         /* motions of a gear and the angle of its bore, padded to quads */
    MOST_PATTERNS = 40, /* of a gear on the ground group, rigid motions and ports included */
};

typedef struct gk_flow { /* coefficients of a gear group for one (h, γ) */
    gk_real *d11, *a12, *a21, *d22, *b0q, *b0v, *bq,
        *bv;           /* flow (d11 = a11 − 1, d22 = a22 − 1); response to the force at
                                                             the start and at the end of the step */
    gk_real *mobility; /* what a force at the end does to a gap */
    gk_real *kappa, *inverse_s2;
    gk_real *unit, *lead, *hold; /* v = unit ẋ + lead ḟ + hold f */
    int yields, softest;         /* the first lanes of each half: κ ≠ 0; padded, and as they are */
} gk_flow;

/* Turning pairs and dashpots of the crowd as matrices, in whole halves: rows by oscillators, what these do to speeds,
 * and to the rows. Rows x of all pairs stand before their rows y. */
enum { LEAST_CROWD = 16, MOST_CROWD = 128 };
typedef struct gk_crowd_flow {
    gk_real *turns, *turned, *turning;       /* (width, 2 pairs), (2 pairs, width), (2 pairs, 2 pairs) */
    gk_real *damps, *holds, *pulls, *pulled; /* (width, dashpots) twice, (dashpots, width), (dashpots, dashpots) */
} gk_crowd_flow;

typedef struct gk_ground_flow { /* the same of the ground group */
    double *d11, *a12, *a21, *d22, *b0q, *b0v, *bq, *bv, *mobility, *kappa, *inverse_s2;
    double *unit, *lead, *hold;
    double *press;          /* half a step's kick by a load that at rest displaces by load/ω² */
    double *pulls, *holds;  /* (supports, n) s²e/n of a dashpot; e times `hold` */
    double *turns, *turned; /* (2 turns, n) turn_rows on the invariant's speeds, and what these do to speeds */
    double *products;       /* (turns, 3) of the rows of a pair: x·x, y·y, x·y */
    gk_crowd_flow crowd;
    double decay[MAX_SUPPORTS];                    /* 1 − e^(−dh/2) */
    double loss[MAX_SUPPORTS], gain[MAX_SUPPORTS]; /* what that takes per u² and per u (e·hold f), u = e·(v − hold f) */
} gk_ground_flow;

typedef struct gk_coefficients {
    double h, gamma, rigid_mobility, rigid_kappa, rigid_lead; /* of a free mass, whose b0q = bq = mobility */
    int timeless;                                             /* forces move nothing in the step: D = 0 */
    gk_flow flow[MAX_GEARS];
    gk_ground_flow ground;
    uint64_t age;
} gk_coefficients;

typedef struct gk_step_side { /* D and A of one step h: squares of nodes and products of neighbours */
    gk_real *moves; /* (nodes + 1, points, 4, columns): D at the node, D mixed with the next, the same of A = C − K */
    double *pulls;  /* (nodes + 1, points, 2, common): what the ground oscillators' rows have in common with the rigid
                      motion of the gear, then with the bore angle: in D, in K */
    double own[2][COMMON][COMMON]; /* the same of these with each other */
    double share[COMMON];          /* of what they have with each other in h: ½, of the bore angle 1 */
} gk_step_side;

typedef struct gk_room {
    gk_coefficients cache[CACHE];
    gk_coefficients explicit_rows; /* forces move nothing at once (gk_rk45.c) */
    uint64_t clock;
    gk_step_side table[MAX_ENGAGEMENTS][2];
    double table_h, table_gamma;            /* step of the tables of D and K; 0: none yet */
    gk_real *between[MAX_GEARS][MAX_GEARS]; /* (2, patterns of the second, of the first) in that step */
    gk_real *zero;                          /* a state at rest: of the widest gear group, of the ground group */
    double *ground_zero;
    double *columns; /* room for a node's rows and their products; A of the explicit rows at all LIMIT_POSITIONS */
    double *spread;  /* room of gk_spread.c, and the compliances that it makes of one gear */
    gk_real *blocks;
    gk_compliance compliance;
} gk_room;

GK_HOT const gk_coefficients *gk_flow_for(const gk_model *model, const gk_setup *setup, gk_room *room, double h,
                                          double gamma);
GK_HOT const gk_coefficients *gk_flow_known(const gk_room *room, double h, double gamma);
#endif
