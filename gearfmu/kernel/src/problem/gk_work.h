/* Scratch of a step: neither model nor state. And the functions that form the problem and take the step. */
#ifndef GK_WORK_H
#define GK_WORK_H
#include "base/gk_check.h"
#include "force/gk_field.h"
#include "force/gk_flank.h"
#include "force/gk_place.h"
#include "problem/gk_system.h"
#include "setup/gk_room.h"

enum { LIMIT_POSITIONS = 8 }; /* of an engagement, where the limit of the step is looked for */
/* phases of a step, for the profile */
enum {
    PHASE_PREDICT,
    PHASE_FIND,
    PHASE_ROWS,
    PHASE_SYSTEM,
    PHASE_SOLVE,
    PHASE_PASS,
    PHASE_CORRECT,
    PHASE_REMEMBER,
    PHASES
};
typedef struct gk_bores { /* at once: moments on ports, and what contacts turn the bores */
    double moment[MAX_PORTS], turned[MAX_PORTS];
} gk_bores;

/* Friction of an engagement in a step (gk_friction.c). Matrices are by columns: [j·stride + i] is what friction at
 * contact j does to row i. */
typedef struct gk_glide {
    gk_real *basis[2]; /* (contacts, n), (contacts, local part) rows of the sliding, as those of the gaps */
    gk_real *near;     /* as that of the gaps */
    double *ground, rigid[MAX_LOCAL][MAX_STRIDE];
    double *matrix, *small;                     /* small: two of (contacts, rows + 1) */
    double *gap_moves, *gap_yields;             /* (contacts, stride) to the gaps of all rows: in the step; at once */
    double *moves, *yields;                     /* to the sliding of all contacts */
    double gap[MAX_STRIDE];                     /* gaps without friction */
    double free[MAX_STRIDE], begin[MAX_STRIDE]; /* sliding in the step by the forces of the last one alone; by the
                                                   speed at its start */
    double moved_along[MAX_STRIDE];             /* as read in a pass, of all engagements */
    double *gap_kappa, *kappa;                  /* of gap_yields and yields what is dynamic */
    gk_real *lanes;                             /* gk_glide.c: rows on all lanes and their coefficients */
    double others[MAX_STRIDE],                  /* by other engagements; */
        others_start[MAX_STRIDE];               /* at once at the start of the step */
    double most[MAX_STRIDE];                    /* coefficient of friction */
    double most_force[MAX_STRIDE],              /* times the mean normal force; */
        most_end[MAX_STRIDE];                   /* the one at the end */
    double share[MAX_STRIDE];                   /* of the mean friction that is there at the end */
    double by_end[MAX_STRIDE];                  /* weight of the end of the step in the mean coefficient */
    signed char limit[MAX_STRIDE], held[MAX_STRIDE];       /* ±1: at that limit; 1: below it */
    signed char full[MAX_STRIDE];                          /* ±1: at the limit at the end alone, where the gears roll */
    int rolls;                                             /* the gears do: friction fades, it does not stick */
    double moved;                                          /* by the last round, N */
    double fixed[MAX_STRIDE], by_own_z[MAX_STRIDE], *by_z; /* mean friction as a function of z, (contacts, stride): of
                                                           contacts below the limit, else of their own z */
    double end_fixed[MAX_STRIDE], end_by_z[MAX_STRIDE],    /* friction at the end as a function of z and its mean */
        end_by_mean[MAX_STRIDE];
    int expressed, anew;                             /* these slopes are known; D does not yet contain them */
    double *D;                                       /* D without friction */
    double creep[MAX_STRIDE];                        /* sliding in the step below which friction is less than that */
    double start[MAX_STRIDE], start_end[MAX_STRIDE]; /* friction at the start: in the states; of all the normal force */
    double mean[MAX_STRIDE], ratio[MAX_STRIDE];      /* in the step; over the mean normal force */
    double step[MAX_STRIDE], end[MAX_STRIDE], last[MAX_STRIDE]; /* as z, λ + f_d and λ of the normal forces are used */
    double grown[MAX_STRIDE];                                   /* end less start_end; 0 beyond the contacts */
    double slid[MAX_STRIDE], lead[MAX_STRIDE]; /* sliding in the step by the rows at its end; what that is more than by
                                                  rows that move */
    double damps[MAX_STRIDE];                  /* relaxation time of a contact that sticks over h */
    double taken, held0; /* energy that friction took in the step; that it holds in what is quasi-static at the start */
} gk_glide;

/* what an island exchanges in a pass (gk_pass.c): forces in the step, z; λ + f_d, under which what is quasi-static
 * yields; λ alone. What rows read of it: in the step; as deflection at once under λ */
enum { STEP, ONCE, AT_ONCE, PUSHES };
enum { WHOLE, YIELDED, MOVES };
typedef struct gk_forces { /* of an engagement; along: the same along the profile */
    double of[PUSHES][MAX_STRIDE], along[2][MAX_STRIDE];
} gk_forces;

enum { MAX_NEAR = (MAX_GROUND + 4 * MAX_ROTORS) / 8 + 1 };

typedef struct gk_far_tooth { /* load on a tooth by patterns, and what others move of it */
    gk_real load[LANES], moved[LANES];
    int loaded;
} gk_far_tooth;

typedef struct gk_far_pair { /* a tooth that feels another of its gear */
    const gk_real *S;
    const gk_far_tooth *from;
    gk_far_tooth *to;
} gk_far_pair;

typedef struct gk_kept { /* D and K = Q − A of an engagement as of some steps ago, between the rows of that time */
    double *D, *K;
    int n, places, age; /* n −1: none */
    int again;          /* this step takes them */
    gk_key key[MAX_PAIRS];
} gk_kept;

typedef struct gk_engaged { /* an engagement in a step */
    int index;
    int local, wide[2]; /* numbers of a row on the ground group: together, of either side: oscillators or patterns */
    int by_patterns[2]; /* a side's are patterns */
    gk_glide *glide;    /* with friction */
    gk_film film;
    gk_place place[MAX_PAIRS];
    int places;
    double pose[POSE]; /* predicted */
    gk_position position[2];
    gk_real *basis[2]; /* (contacts, n) rows of the contacts in the frame of the reference tooth */
    double *ground;    /* (rows, local part): rows of contacts and joints on the ground group */
    gk_real *near;     /* (rows, halves) the same in whole halves, those of either side by themselves */
    int halves;
    double *matrix;               /* D, A, P, J, L, B */
    double bore[2][MAX_CONTACTS]; /* what a moment on the port of either side's rotor turns the contacts at once */
    gk_real *far[2];              /* (contacts, LANES) patterns of far teeth */
    gk_far_tooth far_tooth[2][MAX_PAIRS];
    gk_forces forces;                /* as pushed in a pass */
    gk_bores own_bores[MOVES];       /* its part of what is pushed at bores */
    double moved[MOVES][MAX_STRIDE]; /* what its rows read in a pass, of all engagements */
    double *rest;                    /* (n, stride) what is not dynamic of its own compliance, less P */
    gk_kept kept;
    const gk_step_side *table; /* of either side: gk_room.table */
    gk_system system;
} gk_engaged;

struct gk_work {
    gk_room room;
    /* of every gear group: predicted state, modal force of the rows, of the ground group the same in double */
    gk_real *qp[MAX_GEARS], *vp[MAX_GEARS], *force[MAX_GEARS], *next[MAX_GEARS];
    double *turned_speed[MAX_GEARS]; /* predicted speeds where Coriolis forces turn them, before they are rounded */
    double *ground_q, *ground_v, *ground_force, *ground_next, *ground_reading,
        *ground_start;           /* speeds after half a step of the supports' dashpots and of turning axes */
    double pressed;              /* work of centrifugal loads in the first half */
    gk_real *reading[MAX_GEARS]; /* scratch: how far the modes move by the forces of the last step alone */
    const gk_real *y[MAX_GEARS]; /* displacement that the rows read: qp or zero */
    const double *ground_y;
    gk_real *turned, *turned_next, *scaled; /* states in the frame of a reference tooth; row times coefficients */
    double *ground_scaled;
    gk_real *stage[MAX_GEARS][7], *trial[MAX_GEARS]; /* rk45, central: derivatives (v, a) and trial state (q, v) */
    double *ground_stage[7], *ground_trial;
    double stage_spin[7][2 * MAX_SPINS], trial_spin[2 * MAX_SPINS];
    double spin[MAX_SPINS], speed[MAX_SPINS], moved[MAX_SPINS]; /* predicted; moved in the step */
    int another;                                                /* this step is of another h or γ than the last */
    double outer[MAX_PORTS], outer_before[MAX_PORTS], outer_speed[MAX_PORTS],
        torque[MAX_PORTS];   /* outer ends of the ports at both ends of the step, torque at its end */
    double run_h, run_gamma; /* γ of the internal step of the run */
    gk_engaged *engaged;     /* (engagements) */
    double *tally;           /* (6, ground oscillators) sums of a communication step and their scratch (gk_tally.c) */
    double *pushed;          /* forces on all oscillators of the ground group, then of a gear group */
    double *mode_row;        /* (modes) scratch */
    /* statics (gk_static.c): every oscillator is compliance */
    double *rest_ground;            /* displacement of the ground group */
    gk_real *rest_modes[MAX_GEARS]; /* displacement of those modes of gears with several engagements that are soft */
    double *rest;      /* forces, moves and their tangent: (2 + n, n), n spins and dynamic ground oscillators */
    double *soft_rows; /* (2, MAX_ROWS, MAX_SOFT) rows of an engagement on the soft modes of its gears */
    double *island;    /* the limit of the step: (2, rows, rows) of all engagements */
    /* of an island in a pass: forces pushed, and what these move */
    double push_spin[PUSHES][MAX_SPINS], move_spin[MOVES][MAX_SPINS], yield_spin[MAX_SPINS];
    gk_real *push_ground[PUSHES], *move_ground[MOVES];
    gk_real push_pattern[PUSHES][MAX_GEARS][MOST_PATTERNS], move_pattern[MOVES][MAX_GEARS][MOST_PATTERNS];
    double scatter_pattern[2][MAX_GEARS][MOST_PATTERNS]; /* forces of the step and at its end */
    gk_real *move_modes[MOVES][MAX_GEARS];
    gk_bores push_bores[MOVES];
    gk_far_pair *far_pair;
    int far_pairs, most_far_pairs;
    int by_tables;                         /* this step goes by its tables and by patterns */
    double seen[MAX_GEARS][MOST_PATTERNS]; /* predicted displacement of the patterns */
    gk_field field[2];                     /* nodal contact: teeth of A and B in hand */
    uint64_t cycles[PHASES], mark;         /* phase profile, filled by a build with GK_PROFILE */
};

/* gk_layout_work.c */
void gk_layout_work(const gk_model *model, const gk_setup *setup, gk_work *work);
/* gk_film.c */
GK_HOT void gk_film_begin(const gk_setup *setup, gk_work *work, int e, double h);
GK_HOT void gk_film_begin_rates(const gk_setup *setup, gk_work *work, int e, const double *rate);
/* gk_glide.c */
GK_HOT void gk_glide_rows(const gk_setup *setup, gk_work *work, int e);
GK_HOT void gk_glide_moves(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e);
GK_HOT void gk_glide_yields(const gk_system *s, gk_glide *glide);
GK_HOT void gk_glide_own(const gk_glide *glide, const gk_system *s, const gk_forces *f, double *gaps, double *along);
GK_HOT void gk_glide_freely(const gk_setup *setup, const gk_data *data, gk_work *work, double h, int e);
GK_HOT double gk_glide_lead(const gk_mesh *mesh, const gk_point *point, const double speed[2], double h);
GK_HOT void gk_glide_ride(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                          gk_work *work);
/* gk_friction_energy.c */
GK_HOT double gk_friction_held(const gk_glide *glide, const gk_system *s);
GK_HOT double gk_friction_held0(const gk_glide *glide, const gk_system *s);
GK_HOT double gk_friction_defect(const gk_glide *glide, const gk_system *s);
GK_HOT double gk_friction_taken(const gk_glide *glide, const gk_system *s);
static inline double gk_friction_slid(const gk_glide *glide, int j) { return glide->slid[j] - glide->lead[j]; }
/* gk_friction_law.c */
GK_HOT double gk_friction_express(gk_glide *glide, const gk_system *s);
GK_HOT void gk_friction_apply(gk_glide *glide, gk_system *s);
GK_HOT double gk_friction_follow(gk_glide *glide, const gk_system *s);
/* gk_friction.c */
GK_HOT void gk_friction_form(const gk_model *model, const gk_setup *setup, const gk_data *data,
                             const gk_coefficients *k, gk_work *work, int e);
GK_HOT double gk_friction_solve(gk_glide *glide, gk_system *s, int round, int stands, double enough);
GK_HOT void gk_friction_account(gk_glide *glide, gk_system *s);
GK_HOT double gk_friction_local_yield(const gk_system *s, int i);
GK_HOT void gk_friction_watch(const gk_setup *setup, gk_data *data, double h, int e);
GK_HOT double gk_friction_settle(gk_glide *glide, const gk_system *s);
/* gk_couple.c */
/* by which a pass changes less than the one before, as long as it is not known */
#define GK_FIRST_RATE 0.1
typedef struct gk_coupled { /* an island in a step */
    const gk_model *model;
    const gk_setup *setup;
    gk_work *work;
    const gk_coefficients *k;
    int island, alone; /* alone: the engagement of an island of one */
    int sweeps;        /* passes at most; 0: as many as a step may take */
    double rate;       /* by which a pass changed less than the one before */
    int read, known;   /* rows have read what the present forces do; it is known what engagements do to each other */
    int unsettled;     /* where friction is at its limits has not been found */
} gk_coupled;
GK_HOT gk_island gk_couple_island(gk_coupled *coupled);
GK_HOT void gk_couple_recall(gk_coupled *coupled);
/* gk_compliance.c; columns of a row of D and A that are filled directly */
static inline int gk_block_end(int i)
{
    GK_ASSERT(i >= 0);
    return i / 4 * 4 + 4;
}
typedef enum { BY_ROWS, BY_TABLES, NOT_DYNAMIC } gk_compliance_of;
GK_HOT void gk_compliance_form(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e,
                               gk_compliance_of what);
GK_HOT void gk_compliance_mirror(gk_system *s);
/* gk_ground.c */
GK_HOT void gk_ground_add(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e,
                          int tables);
/* gk_form.c */
GK_HOT void gk_form_system(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                           gk_work *work, int e);
GK_HOT void gk_form_rates(const gk_setup *setup, gk_work *work, int e, const gk_real *const modal_speed[],
                          const double *ground_speed, const double *speed, double *rate);

#ifdef GK_PROFILE /* processor cycles by phase; the product has no clock in it */
#include <x86intrin.h>
#define GK_MARK(work) ((work)->mark = __rdtsc())
#define GK_LAP(work, phase) ((work)->cycles[phase] -= (work)->mark, (work)->cycles[phase] += ((work)->mark = __rdtsc()))
#else
#define GK_MARK(work) ((void)(work))
#define GK_LAP(work, phase) ((void)(work))
#endif
#endif
