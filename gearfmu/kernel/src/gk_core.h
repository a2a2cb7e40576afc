/* Inside of the kernel: what model, setup and data are made of. One reading direction:
 *   gk_model.c  blob → gk_model          gk_setup.c  level, effects, h → gk_setup      gk_vars.c   variables by reference
 *   gk_strips.c slices → contact rows    gk_table.c  compliance between points         gk_flow.c   modal coefficients of h
 *   gk_limit.c  which h, which γ         gk_flank.c  where teeth may touch             gk_rows.c   displacement rows at those places
 *   gk_system.c the small system of a step   gk_law.c local line contact   gk_solve.c its solution   gk_tangent.c its matrix   gk_balance.c its energy
 *   gk_step.c   one step; gk_comm.c many; gk_static.c none
 *   gk_rk45.c, gk_central.c  explicit integrators    gk_still.c  places that do not move, for conservation tests */
#ifndef GK_CORE_H
#define GK_CORE_H
#include <math.h>
#include <string.h>
#include "gk.h"
#include "gk_blob.h"
#include "gk_math.h"

#ifdef GK_DOUBLE_MODES
typedef double gk_real; /* test build: modal states and rows in double */
#else
typedef float gk_real;
#endif

#define GK_PI 3.14159265358979323846
enum {
    LANES = 16,       /* sums run in this many lanes, whatever the vector width */
    MAX_PAIRS = 8,    /* tooth pairs looked at in one step, both flanks */
    MAX_SLICES = 10,
    MAX_FUNCTIONS = 6,
    MAX_MODES = 6000,
    OFFSETS = 7,      /* tooth offsets −3 … 3 of the residual table */
    MAX_CONTACTS = MAX_PAIRS * MAX_SLICES,
    CACHE = 4,        /* coefficient sets kept */
    GAMMAS = 25       /* γ is known at h·2^(−i/4) */
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
#include "gk_variables.inc"
#undef GK_VAR
    GK_VARS
};
/* the same variable of shaft s: the blocks of both shafts have one layout */
#define GK_OF_SHAFT(ID, s) (V_0_##ID + (s) * (V_1_PHI_IN - V_0_PHI_IN))

typedef enum { PORT_SPRING, PORT_TORQUE, PORT_FIXED } gk_port_kind;
typedef enum { LEVEL_RIGID, LEVEL_FAST, LEVEL_STANDARD, LEVEL_FULL, LEVEL_PAPER, LEVEL_EXPLICIT } gk_level;
typedef enum { DG4, MIX4, EM, RK45, CENTRAL } gk_integrator;
typedef enum { KIND_PAIR, KIND_FLAT } gk_kind;

/* ---- constant: read from the blob -------------------------------------------------------------------------------------------------------------- */
typedef struct gk_gear {
    double teeth, r_b, s_form, s_tip, psi_b, phase;       /* phase: attitude of tooth 0 when phi = 0 */
    double mass, inertia, width, local, strip;            /* local = 2 (1 − ν²)/(π E); strip half-width w */
    double relief, relief_start;                          /* δ(s) = relief (s − relief_start)²₊ */
    double edge, corner_radius, corner_angle;             /* tip edge: arc radius, polar position of its centre */
    double bearing_k, bearing_c;
    int z, modes, rolls, functions;
    const double *omega, *zeta, *rows, *bore, *c_ff, *c_fb, *c_bb;
    const int32_t *diameter, *part;
    const double *index;  /* (2 flanks, z) rad: individual index deviation of every tooth; NULL: none */
    double index_most;    /* the largest of them along the flank normal, m */
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
    double distance, backlash, nominal_backlash, damping, /* backlash j_wt of the pair; of the teeth as their numbers give them */
         torque_max, speed_max, cut[2], h_max, overlap_max;
    int degree[MAX_FUNCTIONS];    /* Legendre degrees of the width functions */
    int slices, coast_shift; /* wheel tooth of the pinion's tooth k: −k on the drive flank, coast_shift − k on the coast flank */
};

/* ---- chosen: level, effects, step ----------------------------------------------------------------------------------------------------------------- */
enum { KINDS = 3 }; /* of compliance: D, −K, Q */
typedef struct gk_table { /* compliances between the points of one gear, of one kind or of all side by side: what a force there displaces here */
    gk_real *ff;   /* (2, 2, OFFSETS, rolls, rolls, block): from flank and roll to flank, tooth offset and roll; block: (kinds, strips, strips) padded to 8 */
    double *fb;    /* (2, rolls, strips, 4 a kind): strip of tooth 0 to the bore node (x, y, rz), body-fixed axes */
    double bb[KINDS][9];
    int kinds, block;
} gk_table;

typedef struct gk_modal { /* dynamic modes of one gear: n lanes, [first parts | second parts], padded with zeros */
    int n, pairs, count;
    double *omega, *zeta; /* (n) */
    gk_real *omega2;
    gk_real *rows;        /* (2 flanks, rolls, strips, n) tooth 0 */
    gk_real *bore;        /* (3, n) */
    gk_real *cosine, *sine; /* (z, pairs) */
    gk_table residual;    /* static compliance of everything that is not dynamic */
    double *path;         /* (2 flanks, rolls, strips² padded to 4): residual of a tooth's strips beyond all stored modes, what the contact's dashpot is parallel to */
} gk_modal;

typedef struct gk_flow { /* coefficients of one gear's modes for one (h, γ) */
    gk_real *d11, *a12, *a21, *d22, *b0q, *b0v, *bq, *bv; /* flow (d11 = a11 − 1, d22 = a22 − 1); response to the force at the start and at the end of the step */
    gk_real *mobility, *read_q, *read_v;                  /* what a force at the end does to a gap; the gap reads read_q q + read_v v */
    gk_real *kappa, *inverse_s2;
    int exact; /* the first `exact` lanes of each half are exponential (κ ≠ 0) */
} gk_flow;

typedef struct gk_coefficients {
    double h, gamma, rigid_b0, rigid_bq, rigid_mobility, rigid_kappa; /* the same of a free mass */
    int timeless;    /* forces move nothing in the step: D = 0 */
    int curved_read; /* mix4: the gap reads more than q */
    gk_flow flow[2];
    uint64_t age;
} gk_coefficients;

typedef struct gk_effects {
    int elastic, residual, hertz, coast_flank, contact_damping, tip_relief, tip_contact, bearings, modal_damping, roll_motion;
} gk_effects;

/* A kernel built with -DGK_WITHOUT=tip_relief has no code for that effect: what an effect costs while it is off is measured against it (benchmarks/effects_cost.py) */
#ifndef GK_WITHOUT
#define GK_WITHOUT nothing
#endif
enum { EFFECT_nothing, EFFECT_elastic, EFFECT_modes, EFFECT_residual, EFFECT_hertz, EFFECT_slices, EFFECT_coast_flank, EFFECT_contact_damping, EFFECT_tip_relief,
       EFFECT_tip_contact, EFFECT_bearings, EFFECT_modal_damping, EFFECT_roll_motion, EFFECT_pitch_errors };
#define GK_EFFECT(name) EFFECT_##name
#define GK_EFFECT_OF(name) GK_EFFECT(name)
#define GK_HAS(effect) (GK_EFFECT_OF(GK_WITHOUT) != EFFECT_##effect)
#define GK_ON(setup, effect) (GK_HAS(effect) && (setup)->on.effect)
#define GK_LANES(setup, g) (GK_HAS(modes) && GK_HAS(elastic) ? (setup)->modal[g].n : 0)
#define GK_STRIPS(of) (GK_HAS(slices) ? (of)->strips : 1)

typedef struct gk_work gk_work;
typedef gk_outcome gk_step_function(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma);

struct gk_setup {
    uint64_t magic;
    gk_level level;
    gk_integrator integrator;
    gk_effects on;
    int slices;
    int strips;                  /* contact rows of a place: slices, or half of them where both halves of the face width do the same */
    double h, gamma_at[GAMMAS], allowance, damping, width; /* allowance: what opens the coast flanks beyond the teeth's own numbers, along the normal; width: common face width */
    double strip_width[MAX_SLICES], strip_term, square_low, square_high, log_low, log_high; /* bounds of b² in the local law, and their ln */
    double inverse_mass[RIGID];
    int link[LINKS];             /* live bilateral rows */
    int given_torque[2];         /* the port's row carries a given torque */
    double link_c[LINKS];        /* compliance 1/k */
    double link_d[LINKS];        /* dashpot */
    gk_modal modal[2];
    double *flexibility;         /* scratch of the tables: KINDS + MAX_FUNCTIONS numbers a stored mode */
    gk_step_function *step;      /* gk_step_once in the widest vectors of this processor */
    gk_work *work; /* scratch and coefficient cache: neither model nor state */
    size_t state_size;
};

/* ---- changing ---------------------------------------------------------------------------------------------------------------------------------------- */
typedef struct gk_key { int32_t flank, tooth; } gk_key; /* flank 0 drive, 1 coast; tooth: unwrapped tooth number of the pinion */

typedef struct gk_memory { /* what a tooth pair remembers from the last step */
    gk_key key;
    double force[MAX_SLICES], gap[MAX_SLICES], dash[MAX_SLICES], end[MAX_SLICES]; /* λ0; s0; η_d of the last step, f_d at its end */
} gk_memory;

typedef struct gk_motion { double phi, w, a; } gk_motion;

/* massless: energy of the massless part at the end of the last step; owed: defect of energy that the balance of contacts tolerated so far */
typedef struct gk_ledger { double work, dissipated, baseline, massless, owed; } gk_ledger;

struct gk_data {
    uint64_t magic;
    int32_t phase, pairs, locked[2];
    double value[GK_VARS];
    double x[RIGID], v[RIGID], f[RIGID];
    double f_rate[RIGID];        /* change of f in the last step over h */
    double link[LINKS];          /* λ0 of the bilateral rows (clutch: the constant torque of the last step) */
    double link_dash[LINKS], link_end[LINKS];
    double time_base, step_H, time_last; /* time = time_base + count·H */
    int64_t count;
    gk_motion input[2], blend[2]; /* outer ends at the start of the communication step; jump that is blended away */
    double hold[2];              /* angle a port is referred to */
    double v_bore[2];            /* speed of the bore nodes before the last internal step */
    double rk_h;
    double state_h, state_gamma; /* the step for which x and q are expressed; 0: physical */
    double expressed_h, expressed_gamma; /* the last step that was made */
    double table_h;              /* the internal step with tables of its own: that of the run's first communication step */
    double angle[2];             /* bore angle at a torque port, massless part included */
    double still[RIGID];         /* frames of the start, where all is taken that depends on position when roll_motion is off */
    double reach;                /* largest interpenetration of undeformed flanks in the last step: how far to look for contacts */
    gk_ledger ledger;
    int64_t steps, rounds, trouble, impacts;
    int32_t status, apart;
    double open_time;
    gk_memory memory[MAX_PAIRS];
    gk_real modal[];             /* per gear: q (n), v (n), f (n) */
};

#define GK_SETUP_MAGIC 0x50555445534b47ULL
#define GK_DATA_MAGIC 0x41544144534b47ULL
enum { PHASE_NEW = 1, PHASE_RUNNING, PHASE_FAILED };

/* ---- scratch of one step ----------------------------------------------------------------------------------------------------------------------------- */
typedef struct gk_place { /* one tooth pair on one flank at the predicted position */
    gk_key key;
    double gap, gradient[6];          /* ∂gap/∂(xA, yA, φA, xB, yB, φB) */
    double roll[2], curvature;        /* roll on each gear, 1/ρA + 1/ρB */
    int tooth[2], number[2], flank;   /* tooth of each gear: wrapped to 0 … z−1, and as counted */
    int index[2];                     /* first of four grid rolls */
    double weight[2][4];
    int memory;                       /* its entry in gk_data.memory, −1 if new */
} gk_place;

typedef struct gk_local { double c, a, beta, low, high, q_low, c_low, phi_log, phi_high, slope_high, delta_high; } gk_local;
typedef struct gk_approach { double delta, slope, energy; } gk_approach; /* δ(λ), δ′, ∫ λ dδ */

/* Unknown forces of one step: contacts, then links. Closed contact, bilateral row, sticking clutch:
 *     g + D z + Aλ + lag + Pλ + δ(λ) = 0,   z = λ + η_d + α·direction
 * D: what a force in the step does to the gaps; P + δ: the path that the row's own dashpot is parallel to; A = Q − K: everything else that has no mass, Q, less the κ part.
 * lag = Q f_d − ½K η_d: what the dashpots' force at the end of the step, f_d = ½η_d + (β − ½)(η_d − η_d0), deflects; the κ part of its mean. */
typedef struct gk_system {
    int contacts, n, stride, strips;
    gk_row_kind kind[MAX_ROWS];
    int link_of[MAX_ROWS];            /* −1 for contacts */
    int place_of[MAX_CONTACTS];
    int bore[2][BORE_ROWS];           /* rows that pull at the bores, −1: none */
    double g[MAX_STRIDE], g0[MAX_ROWS], force0[MAX_ROWS], dash0[MAX_ROWS], end0[MAX_STRIDE], lag0[MAX_STRIDE];
    double damping[MAX_ROWS];         /* 2c/h of the row's dashpot */
    double bound[MAX_ROWS];           /* clutch: |z| ≤ bound */
    double weight[MAX_ROWS];          /* slices that a row stands for: η is shared out per slice */
    double width[MAX_CONTACTS];
    gk_local local[MAX_PAIRS];        /* law of a place, per metre */
    double rigid[RIGID][MAX_STRIDE];  /* derivative of the rows by each rigid coordinate */
    double *D, *A, *Q;                /* (n, stride) symmetric; Q: A without the κ part, C_res − P */
    double *J, *L;                    /* (stride, stride) by columns: tangent of the active rows, then its upper factor; lower factor */
    double path[MAX_PAIRS][MAX_SLICES * MAX_SLICES + 3], spring[MAX_ROWS]; /* P: strips of a place, (strips, strips); links: 1/k */

    double force[MAX_STRIDE], dash[MAX_STRIDE], eta[MAX_STRIDE], z[MAX_STRIDE]; /* λ, η_d, η = η_d + α·direction, z = λ + η */
    unsigned char active[MAX_ROWS];   /* in the equations: closed contact, bilateral row, sticking clutch */
    signed char clip[MAX_ROWS];       /* dashpot: 0 linear, ±1 at its limit ±(λ0 + λ1), 2 not acting */
    double direction[MAX_STRIDE], alpha;
    double beta[MAX_STRIDE], end[MAX_STRIDE];               /* β: ¾ where the last step had a dashpot force too, else ½; f_d */
    double Dz[MAX_STRIDE], Al[MAX_STRIDE], lag[MAX_STRIDE]; /* D z, Aλ, Q f_d − ½K η_d */
    double linear[MAX_STRIDE], squeeze[MAX_STRIDE], squeeze0[MAX_STRIDE]; /* Pλ; Pλ + δ now and at the start */
    gk_approach law[MAX_CONTACTS];    /* at the present λ */
    double slope[MAX_CONTACTS];       /* δ′ in the tangent */
    double stored0;                   /* energy of the massless part at the start of the step */
    double held0;                     /* energy that the dashpots' force holds in Q at the start */
    double owed, due;                 /* defect of energy that the steps before left; what of it this step should make good */
    int rounds, limit_reached, curved;
} gk_system;

struct gk_work {
    gk_coefficients cache[CACHE];
    gk_coefficients at_rest, explicit_rows;   /* everything elastic is compliance (gk_static.c); forces move nothing at once (gk_rk45.c) */
    uint64_t clock;
    gk_place place[MAX_PAIRS];
    int places;
    gk_real *qp[2], *vp[2], *force[2], *zero[2], *scaled; /* predicted modal state; modal force of the rows; zeros; row times two coefficients */
    gk_real *reading[2];                      /* read_q q + read_v v where that is not q */
    const gk_real *y[2];                      /* displacement that the rows read: qp, reading, or zero at rest */
    gk_real *stage[2][7], *trial[2];          /* rk45, central: derivatives (v, a) and trial state (q, v) */
    double stage_rigid[7][2 * RIGID], trial_rigid[2 * RIGID];
    gk_real *basis[2];                        /* (MAX_BASIS, n): rows of the contacts, then bore rows in inertial axes */
    double frame[RIGID], speed[RIGID];        /* predicted */
    double attitude[2];                       /* of the gears whose rows the system is formed with */
    double moved[RIGID];
    int another;                              /* this step is of another h or γ than the last */
    double outer[2], outer_before[2], outer_speed[2], torque[2]; /* outer ends of the ports at both ends of the step, torque at its end */
    double read[2][MAX_BASIS], read_rate[2][MAX_BASIS];
    gk_system system;
    uint64_t cycles[PHASES], mark;            /* phase profile, filled by a build with GK_PROFILE */
    double matrix[5 * MAX_STRIDE * MAX_STRIDE];   /* D, A, Q, J, L */
    gk_table table[2];                            /* of each gear: D, −K and Q of one step */
    double table_h, table_gamma;                  /* which step; 0: none yet */
    double run_h, run_gamma;                      /* γ of the internal step of the run */
};

typedef double gk_strip_weights[MAX_SLICES][MAX_FUNCTIONS];

/* gk_vars.c */
gk_effects gk_effects_of(const gk_data *data);
/* gk_rk45.c */
int gk_rk45_evaluate(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k, int i, const double outer[2]);
void gk_rk45_angles(const gk_setup *setup, gk_data *data);
gk_outcome gk_rk45_advance(const gk_model *model, const gk_setup *setup, gk_data *data, double h);
/* gk_central.c */
gk_outcome gk_central_step(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma);
double gk_central_energy(const gk_setup *setup, const gk_data *data, double h);
double gk_central_limit(const gk_model *model, const gk_setup *setup);
/* gk_flow.c */
const gk_coefficients *gk_flow_for(const gk_setup *setup, double h, double gamma);
/* gk_flank.c */
int gk_flank_find(const gk_model *model, const gk_setup *setup, const double *frame, double reach, gk_place *place);
/* gk_still.c */
int gk_still_find(const gk_model *model, const gk_setup *setup, const double *still, const double *frame, gk_place *place);
/* gk_rows.c */
void gk_rows_form(const gk_model *model, const gk_setup *setup, const double *frame, gk_work *work);
/* gk_system.c */
void gk_system_form(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k, gk_work *work);
void gk_system_rates(const gk_setup *setup, gk_work *work, const gk_real *const modal_speed[2], const double *speed, double *rate);
/* gk_table.c */
void gk_table_residual(const gk_model *model, gk_setup *setup);
void gk_table_for(const gk_model *model, const gk_setup *setup, const gk_coefficients *k);
void gk_table_add(const gk_model *model, const gk_setup *setup, int g, const gk_table *table, double *const out[KINDS]);
void gk_table_path(const gk_model *model, const gk_setup *setup, const gk_place *place, double *out);
/* gk_law.c */
void gk_law_set(const gk_model *model, const gk_setup *setup, double curvature, gk_local *law);
void gk_law_bounds(const gk_model *model, gk_setup *setup);
gk_approach gk_law_at(const gk_local *law, double width, double force);
/* gk_solve.c */
void gk_solve_contacts(gk_system *s);
void gk_solve_plain(gk_system *s);
void gk_solve_settle(gk_system *s);
void gk_solve_set(gk_system *s, int row, double force);
void gk_solve_times(const gk_system *s, const double *matrix, const double *x, double *y);
void gk_solve_lag(const gk_system *s, const double *end, const double *dash, double *lag);
void gk_solve_path(const gk_system *s, const double *x, double *y);
double gk_solve_stored(const gk_system *s);
/* gap at the end as the contact sees it, and the deflection of the massless part under it: their sum is the distance that is left */
static inline double gk_solve_end_gap(const gk_system *s, int i) { return s->g[i] + s->Dz[i] + s->lag[i]; }
static inline double gk_solve_massless(const gk_system *s, int i) { return s->Al[i] + s->squeeze[i]; }
/* gk_tangent.c */
void gk_tangent_factorise(gk_system *s);
void gk_tangent_solve(const gk_system *s, double *x);
/* gk_balance.c */
void gk_balance_solve(gk_system *s);
/* gk_strips.c */
int gk_strips_count(const gk_model *model, int slices);
void gk_strips_fill(const gk_model *model, gk_setup *setup);
void gk_strips_rows(const gk_model *model, const gk_setup *setup, int g, gk_strip_weights out);
/* gk_limit.c */
int gk_limit_cholesky(double *a, int n);
void gk_limit_compliance(const gk_system *s, double full, int dashpots, double *C);
void gk_limit_solve(const double *L, double *x, int n);
double gk_limit_mu(const gk_model *model, const gk_setup *setup, double h, double gamma);
double gk_limit_gamma(const gk_setup *setup, const gk_data *data, double h);
void gk_limit_run(const gk_model *model, const gk_setup *setup, const gk_data *data);
gk_outcome gk_limit_choose(const gk_model *model, gk_setup *setup, double wished, char message[GK_MESSAGE]);
/* gk_wide.c */
gk_step_function *gk_wide_step(int widest, gk_integrator integrator);
/* gk_step.c */
gk_outcome gk_step_once(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma);
int gk_step_remembered(const gk_data *data, gk_key key);
void gk_step_recall(const gk_setup *setup, const gk_data *data, gk_system *s);
void gk_step_remember(const gk_setup *setup, gk_data *data);
void gk_step_scatter(const gk_setup *setup, int g, const double *x, const double *y, gk_real *out_x, gk_real *out_y);
double gk_step_energy(const gk_setup *setup, const gk_data *data, const gk_coefficients *k);
/* gk_static.c */
typedef struct gk_boundary { gk_port_kind kind; double torque, phi, k; } gk_boundary;
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_data *data, const gk_boundary boundary[2], int keep);

#ifdef GK_PROFILE /* processor cycles by phase; the product has no clock in it */
#include <x86intrin.h>
#define GK_MARK(work) ((work)->mark = __rdtsc())
#define GK_LAP(work, phase) ((work)->cycles[phase] -= (work)->mark, (work)->cycles[phase] += ((work)->mark = __rdtsc()))
#else
#define GK_MARK(work) ((void)(work))
#define GK_LAP(work, phase) ((void)(work))
#endif

static inline double gk_clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
/* the C library stays out (only sqrt and memory functions come from the compiler): NaN on the right goes through */
static inline double gk_max(double x, double y) { return x > y ? x : y; }
static inline double gk_min(double x, double y) { return x < y ? x : y; }
static inline double gk_floor(double x)
{ /* |x| < 2^62 */
    double whole = (double)(int64_t)x;
    return whole > x ? whole - 1.0 : whole;
}
static inline int gk_finite(double x) { return x - x == 0.0; }

/* four doubles at once, the same bits at every vector width; rows of the small system are padded to them */
typedef double gk_quad __attribute__((vector_size(4 * sizeof(double)), may_alias, aligned(sizeof(double))));
#define GK_INLINE static inline __attribute__((always_inline))
/* calls f(…, quads) with the usual sizes as constants, so that the compiler keeps short rows in registers */
#define GK_SIZED(quads, f, ...)            \
    switch (quads) {                       \
    case 2: f(__VA_ARGS__, 2); break;      \
    case 3: f(__VA_ARGS__, 3); break;      \
    case 4: f(__VA_ARGS__, 4); break;      \
    default: f(__VA_ARGS__, quads);        \
    }

/* the same for the strips of a place: those of 1, 5 and 10 slices */
#define GK_STRIPPED(strips, f, ...)           \
    switch (strips) {                         \
    case 1: f(__VA_ARGS__, 1); break;         \
    case 3: f(__VA_ARGS__, 3); break;         \
    case 5: f(__VA_ARGS__, 5); break;         \
    default: f(__VA_ARGS__, strips);          \
    }

/* y += f x over quads `from` … `to` − 1 */
GK_INLINE void gk_axpy(double f, const double *x, double *y, int from, int to)
{
    const gk_quad *a = (const gk_quad *)x;
    gk_quad *b = (gk_quad *)y;
    for (int q = from; q < to; q++) b[q] += f * a[q];
}

static inline double gk_dot_quads(const double *x, const double *y, int quads)
{
    const gk_quad *a = (const gk_quad *)x, *b = (const gk_quad *)y;
    gk_quad sum = {0};
    for (int q = 0; q < quads; q++) sum += a[q] * b[q];
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/* Σ a_k b_k in LANES fixed lanes, added up as a tree: the same bits at every vector width. n is a multiple of LANES. */
typedef gk_real gk_half __attribute__((vector_size(LANES / 2 * sizeof(gk_real)), may_alias, aligned(sizeof(gk_real)))); /* states start anywhere */

static inline double gk_dot(const gk_real *a, const gk_real *b, int n)
{
    gk_half low = {0}, high = {0};
    const gk_half *x = (const gk_half *)a, *y = (const gk_half *)b;
    for (int k = 0; k < 2 * n / LANES; k += 2) {
        low += x[k] * y[k];
        high += x[k + 1] * y[k + 1];
    }
    low += high;
    return ((low[0] + low[4]) + (low[2] + low[6])) + ((low[1] + low[5]) + (low[3] + low[7]));
}
#endif
