/* The small problem of an engagement in one step: unknown forces of its contacts and joints (docs/theory.md, eq. 10).
 * Closed contact, bilateral row, sticking clutch:
 *     g + D z + Aλ + lag + Pλ + δ(λ) = 0,   z = λ + η_d + α·direction
 * D: what a force in the step does to the gaps; P + δ: compliance parallel to the row's own damper; A = Q − K:
 * everything else that is quasi-static, Q, less the κ part. lag = A f_d: what the dampers' force at the end of the
 * step, f_d = β η_d + tail, deflects. */
#ifndef GK_SYSTEM_H
#define GK_SYSTEM_H
#include "base/gk_check.h"
#include "model/gk_effects.h"
#include "setup/gk_setup.h"

/* how much of a damper's force at the end of the last step goes into that of this one (docs/theory.md, 3.2) */
#define GK_MEMORY 0.25

enum {
    MAX_JOINTS = 2 * JOINTS, /* of one engagement */
    MAX_ROWS = MAX_CONTACTS + MAX_JOINTS,
    MAX_STRIDE = (MAX_ROWS + 3) / 4 * 4,
    MAX_LOCAL = 7 /* spins that an engagement's rows read */
};
/* λ ≥ 0; any λ; λ on either side of a play; given torque; velocity-level friction. Their verbs: gk_row.h */
typedef enum { ROW_CONTACT, ROW_SPRING, ROW_PLAY, ROW_TORQUE, ROW_CLUTCH } gk_row_kind;
typedef struct gk_row_block { /* rows of one kind, from … end − 1 */
    gk_row_kind kind;
    int from, end;
} gk_row_block;

/* local laws of four contacts side by side */
typedef struct gk_laws {
    gk_quad c, a, beta, low, high, q_low, c_low, phi_log, phi_high, slope_high, delta_high;
    gk_quad yields, closes[GAPS - 1]; /* of parts: gk_mesh.yields; forces at which further places close */
} gk_laws;

typedef struct gk_flank_rows { /* what only contacts have; 0 in joints */
    int place_of[MAX_CONTACTS];
    unsigned char recalled[MAX_ROWS];                /* a contact that was there in the last step */
    double width[MAX_STRIDE], per_width[MAX_STRIDE]; /* of their strips */
    double curvature[MAX_STRIDE];                    /* 1/m */
    double opens[GAPS - 1][MAX_STRIDE];              /* of parts of lines of contact: gk_point.opens, m */
    double yields;                                   /* gk_mesh.yields; 0: contacts close as a whole */
    gk_laws law[MAX_STRIDE / 4];                     /* per metre */
    int curved;                                      /* the local law is */
} gk_flank_rows;

typedef struct gk_local { /* law at λ: δ, δ′, ∫ λ dδ, 0 in joints; δ′ in the tangent */
    double delta[MAX_STRIDE], yield[MAX_STRIDE], potential[MAX_STRIDE], slope[MAX_STRIDE];
} gk_local;

typedef struct gk_joint_rows { /* what only joints have; −1 in contacts */
    int port[MAX_ROWS], which[MAX_ROWS];
    double bound[MAX_ROWS], slip[MAX_ROWS]; /* clutch: |z| ≤ bound; z of a slipping one */
    int clutches;                           /* the last rows */
} gk_joint_rows;

typedef struct gk_dashpots { /* η_d in the step, f_d at its end, A f_d; 0: of the last step */
    double mean[MAX_STRIDE], end[MAX_STRIDE], lag[MAX_STRIDE], mean0[MAX_STRIDE], end0[MAX_STRIDE], lag0[MAX_STRIDE];
    double coefficient[MAX_STRIDE]; /* 2c/h */
    signed char clip[MAX_STRIDE],
        hold[MAX_STRIDE]; /* 0 linear, ±1 at its limit ±part·(λ0 + λ1), 2 not acting; its force at
                             the end: 0 linear, ±1 at its limit ±λ1 */
    double beta[MAX_STRIDE], tail[MAX_STRIDE]; /* of one that acts: f_d = β η_d + what the last step leaves of it */
    double apart[MAX_STRIDE];                  /* distance left at the start of the step */
    double part[MAX_STRIDE]; /* of λ0 + λ1 that η_d is where it is limited: 1 where a contact is closed at both ends */
    double gain[MAX_STRIDE], pull[MAX_STRIDE], late[MAX_STRIDE], rest[MAX_STRIDE],
        held[MAX_STRIDE]; /* the same as numbers (gk_solve_status): η_d = gain·(change of Pλ + δ) + pull·(λ0 + λ1),
                             pull = ±part; f_d = late·η_d + rest + held·λ1 */
    int any, stand;       /* stand: where they are, no search for what limits them */
} gk_dashpots;

typedef struct gk_account {    /* energy of the quasi-static part */
    double stored0, held0;     /* at the start of the step; what the dampers' force holds in Q then */
    double error, correction;  /* defect that the steps before left; what of it this step should make good */
    double shift0, shift;      /* account of the invariant's jumps (12c), at the start and at the end */
    double lead;               /* half of what states lead the motion by, over h²: 1/24 at γ = 1 */
    double rubbing;            /* what friction leaves of that energy in the step (gk_friction_defect) */
    double rubbed, unbalanced; /* energy that friction takes in the step; of it what no scalar balances */
} gk_account;

typedef struct gk_others { /* what other engagements of the island do: to the gaps in the step; as deflection at once */
    double gap[MAX_STRIDE], deflection[MAX_STRIDE];
    int coupled;  /* there are any */
    double bends; /* what the law may still bend, of the largest local deflection; 0: moves tell */
} gk_others;

typedef struct gk_system {
    int contacts, n, stride, strips;
    gk_row_kind kind[MAX_ROWS];
    gk_row_block block[MAX_JOINTS + 1]; /* the contacts first */
    int blocks;
    double g[MAX_STRIDE], g0[MAX_ROWS], force0[MAX_STRIDE];
    double weight[MAX_ROWS];             /* slices that a row stands for: η is shared out per slice */
    double rigid[MAX_LOCAL][MAX_STRIDE]; /* derivative of the rows by each spin of the engagement */
    double *D, *A, *P;          /* (n, stride) symmetric; P: strips of a tooth pair among each other, 1/k of joints */
    double *J, *L, *B;          /* (stride, stride) by columns: tangent of the active rows, then its upper factor; lower
                          factor; what a damper's force does, D + late·A */
    double inverse[MAX_STRIDE]; /* of the pivots */
    int factored;               /* the tangent's factors are those of the status */
    double force[MAX_STRIDE], eta[MAX_STRIDE], z[MAX_STRIDE];               /* λ, η = η_d + α·direction, λ + η */
    double Dz[MAX_STRIDE], Al[MAX_STRIDE];                                  /* D z, Aλ */
    double linear[MAX_STRIDE], approach[MAX_STRIDE], approach0[MAX_STRIDE]; /* Pλ; Pλ + δ now and at the start */
    unsigned char active[MAX_STRIDE]; /* in the equations: closed contact, bilateral row, sticking clutch */
    double on[MAX_STRIDE];            /* the same as a number, 1 or 0 */
    double jump[MAX_STRIDE];          /* of a given torque, at the start of the step; else 0 */
    double last[MAX_STRIDE];          /* forces at the end that the next prediction is made with */
    double direction[MAX_STRIDE], alpha, along[MAX_STRIDE]; /* along: dλ/dα */
    gk_flank_rows flank;
    gk_local local;
    gk_joint_rows joint;
    gk_dashpots dashpot;
    gk_account energy;
    gk_others others;
    int iterations, limit_reached;
    int rubs;             /* there is friction */
    int films;            /* rows whose gap is open at the start of the step, with oil in it */
    struct gk_film *film; /* with the squeeze film */
} gk_system;

/* engagements that share rotors, solved together */
typedef struct gk_island gk_island;
struct gk_island {
    int count;
    gk_system *member[MAX_ENGAGEMENTS];
    void (*sweep)(const gk_island *island); /* solves all members, NULL: there is one */
    void *context;
};

/* Squeeze film of an engagement in a step (gk_film.c); zeros in rows without */
typedef struct gk_film {
    double step;                                      /* h; 0: no time passes, the speed of approach is given */
    double cut[MAX_STRIDE], inverse_root[MAX_STRIDE]; /* r: roughness, of a part of a line of contact more by the mean
                                                         of its gaps over the least; (H + r)^-½ */
    double factor[MAX_STRIDE];                        /* c = factor·[(d + r)^-3/2 − (H + r)^-3/2] */
    double open[MAX_STRIDE];                          /* thickness d0 at the start */
    double speed[MAX_STRIDE];                         /* of approach, where that is given */
    double sinks[MAX_STRIDE];   /* 1: time passes, z = λ1 + min(λ1, closes) − λ0 + η: what a film carries is a mean */
    double lift[MAX_STRIDE];    /* 1: z grows by twice the force */
    double at_open[MAX_STRIDE]; /* I(d0) */
    double closes[MAX_STRIDE];  /* mean force from which on flanks touch at the end */
    double left[MAX_STRIDE];    /* thickness at the end by the present forces */
    double yields[MAX_STRIDE];  /* its decrease per mean force of the step */
    double delta0[MAX_STRIDE], potential0[MAX_STRIDE]; /* local law at the start */
    double burst; /* energy lost where flanks touch through a film and no scalar balances the step */
} gk_film;

/* For GK_ASSERT: counts that fit together; the number of a row */
static inline int gk_system_is_sound(const gk_system *s)
{
    return s->contacts >= 0 && s->contacts <= MAX_CONTACTS && s->n >= s->contacts && s->n <= MAX_ROWS &&
           s->stride % 4 == 0 && s->stride >= s->n && s->stride <= MAX_STRIDE && s->joint.clutches >= 0 &&
           s->joint.clutches <= s->n - s->contacts;
}
static inline int gk_is_row(const gk_system *s, int i) { return i >= 0 && i < s->n; }

/* what kinds of rows are: does the row yield at once under its force, or is it one of speeds? */
static inline int gk_row_yields(const gk_system *s, int i) { return s->kind[i] != ROW_CLUTCH; }
static inline int gk_row_is_given(const gk_system *s, int i) { return s->kind[i] == ROW_TORQUE; }
/* does a gap that changes change its force? can it open? */
static inline int gk_row_is_stiff(const gk_system *s, int i) { return gk_row_yields(s, i) && !gk_row_is_given(s, i); }
static inline int gk_row_opens(const gk_system *s, int i)
{
    return s->kind[i] == ROW_CONTACT || s->kind[i] == ROW_PLAY;
}
/* is its gap relative to the outer end of a port? */
static inline int gk_row_has_outer_end(const gk_system *s, int i)
{
    return s->joint.which[i] == JOINT_PORT && !gk_row_is_given(s, i);
}

/* what gk_rows_scatter may scatter: the forces at the end; those of the step */
static inline const double *gk_step_force(const gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    return s->force;
}
static inline const double *gk_step_z(const gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    return s->z;
}

static inline int gk_film_on(const gk_system *s) { return GK_HAS(film) && s->films > 0; }
/* flanks of a contact that carries touch: it is no film alone */
static inline int gk_solve_touches(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return s->force[i] > 0.0 && !(gk_film_on(s) && s->film->left[i] > 0.0);
}

static inline int gk_film_sinks(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return gk_film_on(s) && s->film->sinks[i] != 0.0;
}
/* dz/dλ − 1; what z is more than λ + η */
static inline double gk_film_lift(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return gk_film_on(s) ? s->film->lift[i] : 0.0;
}
static inline double gk_film_carried(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return gk_film_sinks(s, i) ? gk_min(s->force[i], s->film->closes[i]) - s->force0[i] : 0.0;
}

/* gk_film.c */
GK_HOT void gk_film_apply(gk_system *s);
GK_HOT double gk_film_lost(const gk_system *s);
GK_HOT double gk_film_grows(const gk_system *s, const double *p, const double *linear, double *square);
GK_HOT double gk_film_power(const gk_system *s);

/* gk_solve.c */
GK_HOT void gk_solve_contacts(gk_system *s);
GK_HOT void gk_solve_clear(gk_system *s);
GK_HOT void gk_solve_settle(gk_system *s);
GK_HOT void gk_solve_begin(gk_system *s);
GK_HOT void gk_solve_begin_dashpots(gk_system *s);
GK_HOT void gk_solve_status(gk_system *s);
GK_HOT void gk_solve_times(const gk_system *s, const double *matrix, const double *x, double *y);
GK_HOT void gk_solve_path(const gk_system *s, const double *x, double *y);
GK_HOT double gk_solve_stored(const gk_system *s);
GK_HOT double gk_solve_jump(const gk_system *s);
/* gap at the end as the contact sees it, and the deflection of the quasi-static part under it: their sum is the
 * distance that is left */
static inline double gk_solve_end_gap(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return s->g[i] + s->Dz[i] + s->dashpot.lag[i] + s->others.gap[i];
}
static inline double gk_solve_mean(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return 0.5 * (s->force0[i] + s->z[i]);
} /* force of a row in the step */
/* mean of the forces at its start and end, before a given torque jumps: that which does work on what is quasi-static */
static inline double gk_solve_static_mean(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return gk_solve_mean(s, i) - 0.5 * s->jump[i];
}
static inline double gk_solve_quasi_static(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return s->Al[i] + s->approach[i] + s->others.deflection[i];
}
/* gk_tangent.c */
GK_HOT void gk_tangent_factorise(gk_system *s);
GK_HOT void gk_tangent_solve(const gk_system *s, double *x);
/* gk_balance.c */
GK_HOT void gk_balance_plain(const gk_island *island);
GK_HOT void gk_balance_solve(const gk_island *island);
/* gk_law.c */
GK_HOT void gk_law_set(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, gk_system *s);
GK_HOT void gk_law_bounds(const gk_model *model, const gk_setup *setup, gk_mesh *mesh);
GK_HOT double gk_law_slope(const gk_system *s, int i, double force);
GK_HOT void gk_law_apply(gk_system *s);
#endif
