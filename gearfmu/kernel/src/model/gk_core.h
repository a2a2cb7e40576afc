/* Inside of the kernel: what model, setup and data are made of; gk_work.h: what a step works on, and who calls whom;
 * gk_lanes.h: sums. One reading direction: gk_model.c  blob → gk_model          gk_setup.c  level, effects, h →
 * gk_setup      gk_vars.c   variables by reference gk_strips.c slices → contact rows    gk_table.c  compliance between
 * points         gk_flow.c   modal coefficients of h gk_limit.c  which h, which γ         gk_flank.c  where teeth may
 * touch             gk_rows.c   displacement rows at those places gk_system.c the small system of a step   gk_law.c
 * local line contact   gk_solve.c its solution   gk_tangent.c its matrix   gk_balance.c its energy gk_step.c   one
 * step; gk_comm.c many; gk_static.c none gk_rk45.c, gk_central.c  explicit integrators    gk_still.c  places that do
 * not move, for conservation tests */
#ifndef GK_CORE_H
#define GK_CORE_H
#include <math.h>
#include <string.h>
#include "gk.h"
#include "base/gk_blob.h"
#include "base/gk_math.h"

#ifdef GK_DOUBLE_MODES
typedef double gk_real; /* test build: modal states and rows in double */
#else
typedef float gk_real;
#endif

#define GK_PI 3.14159265358979323846
enum {
    LANES = 16,    /* sums run in this many lanes, whatever the vector width */
    MAX_PAIRS = 8, /* tooth pairs looked at in one step, both flanks */
    MAX_SLICES = 10,
    MAX_FUNCTIONS = 6,
    MAX_MODES = 6000,
    OFFSETS = 7, /* tooth offsets −3 … 3 of the residual table */
    MAX_CONTACTS = MAX_PAIRS * MAX_SLICES,
    CACHE = 4,  /* coefficient sets kept */
    GAMMAS = 25 /* γ is known at h·2^(−i/4) */
};

/* bilateral rows of the small system; they exist when `live` */
/* what a row of the small system is: λ ≥ 0; any λ; given torque; velocity-level friction */
typedef enum { ROW_CONTACT, ROW_SPRING, ROW_TORQUE, ROW_CLUTCH } gk_row_kind;
enum { BEARING_0X, BEARING_0Y, BEARING_1X, BEARING_1Y, PORT_0, PORT_1, SHAFT_0, SHAFT_1, CLUTCH_0, CLUTCH_1, LINKS };
/* phases of a step, for the profile */
enum { PHASE_PREDICT, PHASE_FIND, PHASE_ROWS, PHASE_SYSTEM, PHASE_SOLVE, PHASE_CORRECT, PHASE_REMEMBER, PHASES };
/* rigid coordinates */
enum { XA, YA, PHIA, XB, YB, PHIB, INERTIA_0, INERTIA_1, DISC_0, DISC_1, RIGID };
enum { BORE_X, BORE_Y, BORE_RZ, BORE_ROWS };
enum { MAX_ROWS = MAX_CONTACTS + LINKS, MAX_STRIDE = (MAX_ROWS + 3) / 4 * 4, MAX_BASIS = MAX_CONTACTS + BORE_ROWS };

enum {
#define GK_VAR(S, ID, ...) V_##S##_##ID,
#include "model/gk_variables.inc"
#undef GK_VAR
    GK_VARS
};
/* the same variable of shaft s: the blocks of both shafts have one layout */
#define GK_OF_SHAFT(ID, s) (V_0_##ID + (s) * (V_1_PHI_IN - V_0_PHI_IN))

typedef enum { PORT_SPRING, PORT_TORQUE, PORT_FIXED } gk_port_kind;
typedef enum { LEVEL_RIGID, LEVEL_FAST, LEVEL_STANDARD, LEVEL_FULL, LEVEL_PAPER, LEVEL_EXPLICIT } gk_level;
typedef enum { DG4, MIX4, EM, RK45, CENTRAL } gk_integrator;
typedef enum { KIND_PAIR, KIND_FLAT } gk_kind;

/* ---- constant: read from the blob
 * -------------------------------------------------------------------------------------------------------------- */
typedef struct gk_gear {
    double teeth, r_b, s_form, s_tip, psi_b, phase; /* phase: attitude of tooth 0 when phi = 0 */
    double mass, inertia, width, local, strip;      /* local = 2 (1 − ν²)/(π E); strip half-width w */
    double relief, relief_start;                    /* δ(s) = relief (s − relief_start)²₊ */
    double edge, corner_radius, corner_angle;       /* tip edge: arc radius, polar position of its centre */
    double bearing_k, bearing_c;
    int z, modes, rolls, functions;
    const double *omega, *zeta, *rows, *bore, *c_ff, *c_fb, *c_bb;
    const int32_t *diameter, *part;
    const double *index; /* (2 flanks, z) rad: individual index deviation of every tooth; NULL: none */
    double index_most;   /* the largest of them along the flank normal, m */
} gk_gear;

typedef struct gk_port {
    gk_port_kind kind;
    int chain;
    double k, c, inertia, disc, shaft_k, shaft_c;
} gk_port;

struct gk_model {
    gk_blob blob;
    const char *name;
    char shaft[2][24];
    gk_kind kind;
    gk_gear gear[2];
    gk_port port[2];
    double distance, backlash, nominal_backlash,
        damping, /* backlash j_wt of the pair; of the teeth as their numbers give them */
        torque_max, speed_max, cut[2], h_max, overlap_max;
    int degree[MAX_FUNCTIONS]; /* Legendre degrees of the width functions */
    int slices, coast_shift; /* wheel tooth of the pinion's tooth k: −k on the drive flank, coast_shift − k on the coast
                                flank */
};

/* ---- chosen: level, effects, step
 * ----------------------------------------------------------------------------------------------------------------- */
enum { KINDS = 3 };       /* of compliance: D, −K, Q */
typedef struct gk_table { /* compliances between the points of one gear, of one kind or of all side by side: what a
                             force there displaces here */
    gk_real *ff; /* (2, 2, OFFSETS, rolls, rolls, block): from flank and roll to flank, tooth offset and roll; block:
                    (kinds, strips, strips) padded to 8 */
    double *fb;  /* (2, rolls, strips, 4 a kind): strip of tooth 0 to the bore node (x, y, rz), body-fixed axes */
    double bb[KINDS][9];
    int kinds, block;
} gk_table;

typedef struct gk_modal { /* dynamic modes of one gear: n lanes, [first parts | second parts], padded with zeros */
    int n, pairs, count;
    double *omega, *zeta; /* (n) */
    gk_real *omega2;
    gk_real *rows;          /* (2 flanks, rolls, strips, n) tooth 0 */
    gk_real *bore;          /* (3, n) */
    gk_real *cosine, *sine; /* (z, pairs) */
    double *turn;           /* (z, 2) cosine and sine of the angle from tooth 0 to a tooth */
    gk_table residual;      /* static compliance of everything that is not dynamic */
    double *path; /* (2 flanks, rolls, strips² padded to 4): residual of a tooth's strips beyond all stored modes, what
                     the contact's dashpot is parallel to */
} gk_modal;

typedef struct gk_flow { /* coefficients of one gear's modes for one (h, γ) */
    gk_real *d11, *a12, *a21, *d22, *b0q, *b0v, *bq,
        *bv; /* flow (d11 = a11 − 1, d22 = a22 − 1); response to the force at the start and at the end of the step */
    gk_real *mobility, *read_q, *read_v; /* what a force at the end does to a gap; the gap reads read_q q + read_v v */
    gk_real *kappa, *inverse_s2;
    int exact; /* the first `exact` lanes of each half are exponential (κ ≠ 0) */
} gk_flow;

typedef struct gk_coefficients {
    double h, gamma, rigid_b0, rigid_bq, rigid_mobility, rigid_kappa; /* the same of a free mass */
    int timeless;                                                     /* forces move nothing in the step: D = 0 */
    int curved_read;                                                  /* mix4: the gap reads more than q */
    gk_flow flow[2];
    uint64_t age;
} gk_coefficients;

typedef struct gk_effects {
    int elastic, residual, hertz, coast_flank, contact_damping, tip_relief, tip_contact, bearings, modal_damping,
        roll_motion;
} gk_effects;

/* A kernel built with -DGK_WITHOUT=tip_relief has no code for that effect: what an effect costs while it is off is
 * measured against it (benchmarks/effects_cost.py) */
#ifndef GK_WITHOUT
#define GK_WITHOUT nothing
#endif
enum {
    EFFECT_nothing,
    EFFECT_elastic,
    EFFECT_modes,
    EFFECT_residual,
    EFFECT_hertz,
    EFFECT_slices,
    EFFECT_coast_flank,
    EFFECT_contact_damping,
    EFFECT_tip_relief,
    EFFECT_tip_contact,
    EFFECT_bearings,
    EFFECT_modal_damping,
    EFFECT_roll_motion,
    EFFECT_pitch_errors
};
#define GK_EFFECT(name) EFFECT_##name
#define GK_EFFECT_OF(name) GK_EFFECT(name)
#define GK_HAS(effect) (GK_EFFECT_OF(GK_WITHOUT) != EFFECT_##effect)
#define GK_ON(setup, effect) (GK_HAS(effect) && (setup)->on.effect)
#define GK_LANES(setup, g) (GK_HAS(modes) && GK_HAS(elastic) ? (setup)->modal[g].n : 0)
#define GK_STRIPS(of) (GK_HAS(slices) ? (of)->strips : 1)

typedef struct gk_work gk_work;
typedef gk_outcome gk_step_function(const gk_model *model, const gk_setup *setup, gk_data *data, double h,
                                    double gamma);

struct gk_setup {
    uint64_t magic;
    gk_level level;
    gk_integrator integrator;
    gk_effects on;
    int slices;
    int strips; /* contact rows of a place: slices, or half of them where both halves of the face width do the same */
    double h, gamma_at[GAMMAS], allowance, damping, width; /* allowance: what opens the coast flanks beyond the teeth's
                                                              own numbers, along the normal; width: common face width */
    double strip_width[MAX_SLICES], strip_term, square_low, square_high, log_low,
        log_high; /* bounds of b² in the local law, and their ln */
    double inverse_mass[RIGID];
    int link[LINKS];      /* live bilateral rows */
    int given_torque[2];  /* the port's row carries a given torque */
    double link_c[LINKS]; /* compliance 1/k */
    double link_d[LINKS]; /* dashpot */
    gk_modal modal[2];
    double *flexibility;    /* scratch of the tables: KINDS + MAX_FUNCTIONS numbers a stored mode */
    gk_step_function *step; /* gk_step_once in the widest vectors of this processor */
    gk_work *work;          /* scratch and coefficient cache: neither model nor state */
    size_t state_size;
};

/* ---- changing
 * ----------------------------------------------------------------------------------------------------------------------------------------
 */
typedef struct gk_key {
    int32_t flank, tooth;
} gk_key; /* flank 0 drive, 1 coast; tooth: unwrapped tooth number of the pinion */

typedef struct gk_memory { /* what a tooth pair remembers from the last step */
    gk_key key;
    double force[MAX_SLICES], gap[MAX_SLICES], dash[MAX_SLICES],
        end[MAX_SLICES]; /* λ0; s0; η_d of the last step, f_d at its end */
} gk_memory;

typedef struct gk_motion {
    double phi, w, a;
} gk_motion;

/* massless: energy of the massless part at the end of the last step; owed: defect of energy that the balance of
 * contacts tolerated so far */
typedef struct gk_ledger {
    double work, dissipated, baseline, massless, owed;
} gk_ledger;

struct gk_data {
    uint64_t magic;
    int32_t phase, pairs, locked[2];
    double value[GK_VARS];
    double x[RIGID], v[RIGID], f[RIGID];
    double f_rate[RIGID]; /* change of f in the last step over h */
    double link[LINKS];   /* λ0 of the bilateral rows (clutch: the constant torque of the last step) */
    double link_dash[LINKS], link_end[LINKS];
    double time_base, step_H, time_last; /* time = time_base + count·H */
    int64_t count;
    gk_motion input[2], blend[2]; /* outer ends at the start of the communication step; jump that is blended away */
    double hold[2];               /* angle a port is referred to */
    double v_bore[2];             /* speed of the bore nodes before the last internal step */
    double rk_h;
    double state_h, state_gamma;         /* the step for which x and q are expressed; 0: physical */
    double expressed_h, expressed_gamma; /* the last step that was made */
    double table_h;      /* the internal step with tables of its own: that of the run's first communication step */
    double angle[2];     /* bore angle at a torque port, massless part included */
    double still[RIGID]; /* frames of the start, where all is taken that depends on position when roll_motion is off */
    double reach; /* largest interpenetration of undeformed flanks in the last step: how far to look for contacts */
    gk_ledger ledger;
    int64_t steps, rounds, trouble, impacts;
    int32_t status, apart;
    double open_time;
    gk_memory memory[MAX_PAIRS];
    gk_real modal[]; /* per gear: q (n), v (n), f (n) */
};

#define GK_SETUP_MAGIC 0x50555445534b47ULL
#define GK_DATA_MAGIC 0x41544144534b47ULL
enum { PHASE_NEW = 1, PHASE_RUNNING, PHASE_FAILED };

#include "base/gk_lanes.h"
#include "model/gk_work.h"
#endif
