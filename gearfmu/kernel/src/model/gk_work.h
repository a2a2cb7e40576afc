/* What one step works on, and every function of the kernel by the file it stands in. Part of gk_core.h. */
#ifndef GK_WORK_H
#define GK_WORK_H
/* ---- scratch of one step
 * -----------------------------------------------------------------------------------------------------------------------------
 */
typedef struct gk_place { /* one tooth pair on one flank at the predicted position */
    gk_key key;
    double gap, gradient[6];        /* ∂gap/∂(xA, yA, φA, xB, yB, φB) */
    double roll[2], curvature;      /* roll on each gear, 1/ρA + 1/ρB */
    int tooth[2], number[2], flank; /* tooth of each gear: wrapped to 0 … z−1, and as counted */
    int index[2];                   /* first of four grid rolls */
    double weight[2][4];
    int memory; /* its entry in gk_data.memory, −1 if new */
} gk_place;

typedef struct gk_local {
    double c, a, beta, low, high, q_low, c_low, phi_log, phi_high, slope_high, delta_high;
} gk_local;
typedef struct gk_approach {
    double delta, slope, energy;
} gk_approach; /* δ(λ), δ′, ∫ λ dδ */

/* Unknown forces of one step: contacts, then links. Closed contact, bilateral row, sticking clutch:
 *     g + D z + Aλ + lag + Pλ + δ(λ) = 0,   z = λ + η_d + α·direction
 * D: what a force in the step does to the gaps; P + δ: the path that the row's own dashpot is parallel to; A = Q − K:
 * everything else that has no mass, Q, less the κ part. lag = Q f_d − ½K η_d: what the dashpots' force at the end of
 * the step, f_d = β η_d + tail, deflects; the κ part of its mean. */
typedef struct gk_system {
    int contacts, n, stride, strips, clutches; /* clutches are the last rows */
    gk_row_kind kind[MAX_ROWS];
    int link_of[MAX_ROWS]; /* −1 for contacts */
    int place_of[MAX_CONTACTS];
    int bore[2][BORE_ROWS]; /* rows that pull at the bores, −1: none */
    double g[MAX_STRIDE], g0[MAX_ROWS], force0[MAX_STRIDE], dash0[MAX_STRIDE], end0[MAX_STRIDE], lag0[MAX_STRIDE];
    double damping[MAX_STRIDE];                      /* 2c/h of the row's dashpot */
    double bound[MAX_ROWS], slip[2];                 /* clutch: |z| ≤ bound; z of a slipping one, by clutch */
    double weight[MAX_ROWS];                         /* slices that a row stands for: η is shared out per slice */
    double width[MAX_STRIDE], per_width[MAX_STRIDE]; /* of the contacts' strips; 0 in links */
    gk_local local[MAX_PAIRS];                       /* law of a place, per metre */
    double rigid[RIGID][MAX_STRIDE];                 /* derivative of the rows by each rigid coordinate */
    double *D, *A, *Q;                               /* (n, stride) symmetric; Q: A without the κ part, C_res − P */
    double *J, *L, *B; /* (stride, stride) by columns: tangent of the active rows, then its upper factor; lower factor;
                          what a dashpot's force does, D + ½A + (late − ½)Q */
    double inverse[MAX_STRIDE]; /* of the pivots */
    double path[MAX_PAIRS][MAX_SLICES * MAX_SLICES + 3],
        spring[MAX_STRIDE]; /* P: strips of a place, (strips, strips); links: 1/k */

    double force[MAX_STRIDE], dash[MAX_STRIDE], eta[MAX_STRIDE],
        z[MAX_STRIDE];                          /* λ, η_d, η = η_d + α·direction, z = λ + η */
    unsigned char active[MAX_ROWS];             /* in the equations: closed contact, bilateral row, sticking clutch */
    signed char clip[MAX_ROWS], hold[MAX_ROWS]; /* dashpot: 0 linear, ±1 at its limit ±(λ0 + λ1), 2 not acting; its
                                                   force at the end: 0 linear, ±1 at its limit ±λ1 */
    double beta[MAX_STRIDE],
        tail[MAX_STRIDE]; /* of a dashpot that acts: f_d = β η_d + what the last step leaves of it */
    double on[MAX_STRIDE], gain[MAX_STRIDE], pull[MAX_STRIDE], late[MAX_STRIDE], rest[MAX_STRIDE],
        held[MAX_STRIDE]; /* the same as numbers (gk_solve_status): 1 in the equations, else 0;
η_d = gain·(change of Pλ + δ) + pull·(λ0 + λ1), f_d = late·η_d + rest + held·λ1 */
    int dashpots;         /* any of them */
    double direction[MAX_STRIDE], alpha;
    double end[MAX_STRIDE], begin[MAX_STRIDE]; /* f_d; mix4, whose forces are linear in the step: f_d at its start,
                                                  which the prediction contains; else 0 */
    double Dz[MAX_STRIDE], Al[MAX_STRIDE], lag[MAX_STRIDE];               /* D z, Aλ, Q f_d − ½K η_d */
    double linear[MAX_STRIDE], squeeze[MAX_STRIDE], squeeze0[MAX_STRIDE]; /* Pλ; Pλ + δ now and at the start */
    double delta[MAX_STRIDE], yield[MAX_STRIDE],
        potential[MAX_STRIDE]; /* local law at the present λ: δ, δ′, ∫ λ dδ; 0 in links */
    double slope[MAX_STRIDE];  /* δ′ in the tangent */
    double stored0;            /* energy of the massless part at the start of the step */
    double held0;              /* energy that the dashpots' force holds in Q at the start */
    double owed, due;          /* defect of energy that the steps before left; what of it this step should make good */
    int rounds, limit_reached, curved;
} gk_system;

struct gk_work {
    gk_coefficients cache[CACHE];
    gk_coefficients at_rest,
        explicit_rows; /* everything elastic is compliance (gk_static.c); forces move nothing at once (gk_rk45.c) */
    uint64_t clock;
    gk_place place[MAX_PAIRS];
    int places;
    gk_real *qp[2], *vp[2], *force[2], *zero[2],
        *scaled;         /* predicted modal state; modal force of the rows; zeros; row times two coefficients */
    gk_real *reading[2]; /* read_q q + read_v v where that is not q */
    const gk_real *y[2]; /* displacement that the rows read: qp, reading, or zero at rest */
    gk_real *stage[2][7], *trial[2]; /* rk45, central: derivatives (v, a) and trial state (q, v) */
    double stage_rigid[7][2 * RIGID], trial_rigid[2 * RIGID];
    gk_real *basis[2];                 /* (MAX_BASIS, n): rows of the contacts, then bore rows in inertial axes */
    double frame[RIGID], speed[RIGID]; /* predicted */
    double attitude[2], axes[2][2];    /* of the gears whose rows the system is formed with, and its cosine and sine */
    double moved[RIGID];
    int another; /* this step is of another h or γ than the last */
    double outer[2], outer_before[2], outer_speed[2],
        torque[2]; /* outer ends of the ports at both ends of the step, torque at its end */
    double read[2][MAX_BASIS], read_rate[2][MAX_BASIS];
    gk_system system;
    uint64_t cycles[PHASES], mark;              /* phase profile, filled by a build with GK_PROFILE */
    double matrix[6 * MAX_STRIDE * MAX_STRIDE]; /* D, A, Q, J, L, B */
    gk_table table[2];                          /* of each gear: D, −K and Q of one step */
    double table_h, table_gamma;                /* which step; 0: none yet */
    double run_h, run_gamma;                    /* γ of the internal step of the run */
};

typedef double gk_strip_weights[MAX_SLICES][MAX_FUNCTIONS];

/* gk_vars.c */
gk_effects gk_effects_of(const gk_data *data);
/* gk_rk45.c */
int gk_rk45_evaluate(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k, int i,
                     const double outer[2]);
void gk_rk45_resist(const gk_setup *setup, const gk_system *s, double *y);
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
int gk_still_find(const gk_model *model, const gk_setup *setup, const double *still, const double *frame,
                  gk_place *place);
/* gk_rows.c */
void gk_rows_form(const gk_model *model, const gk_setup *setup, const double *frame, gk_work *work);
/* gk_system.c */
void gk_system_form(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                    gk_work *work);
void gk_system_rates(const gk_setup *setup, gk_work *work, const gk_real *const modal_speed[2], const double *speed,
                     double *rate);
/* gk_table.c */
void gk_table_residual(const gk_model *model, gk_setup *setup);
void gk_table_for(const gk_model *model, const gk_setup *setup, const gk_coefficients *k);
void gk_table_put(const gk_model *model, const gk_setup *setup, const gk_table *const table[2],
                  double *const out[KINDS]);
void gk_table_path(const gk_model *model, const gk_setup *setup, const gk_place *place, double *out);
/* gk_law.c */
void gk_law_set(const gk_model *model, const gk_setup *setup, double curvature, gk_local *law);
void gk_law_bounds(const gk_model *model, gk_setup *setup);
gk_approach gk_law_at(const gk_local *law, double width, double force);
void gk_law_apply(gk_system *s);
/* gk_solve.c */
void gk_solve_contacts(gk_system *s);
void gk_solve_plain(gk_system *s);
void gk_solve_settle(gk_system *s);
void gk_solve_status(gk_system *s);
void gk_solve_times(const gk_system *s, const double *matrix, const double *x, double *y);
void gk_solve_lag(const gk_system *s, const double *end, const double *dash, double *lag);
void gk_solve_path(const gk_system *s, const double *x, double *y);
double gk_solve_stored(const gk_system *s);
/* gap at the end as the contact sees it, and the deflection of the massless part under it: their sum is the distance
 * that is left */
static inline double gk_solve_end_gap(const gk_system *s, int i) { return s->g[i] + s->Dz[i] + s->lag[i]; }
static inline double gk_solve_mean(const gk_system *s, int i)
{
    return 0.5 * (s->force0[i] + s->begin[i] + s->z[i]);
} /* force of a row in the step */
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
typedef struct gk_boundary {
    gk_port_kind kind;
    double torque, phi, k;
} gk_boundary;
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_data *data, const gk_boundary boundary[2],
                           int keep);

#ifdef GK_PROFILE /* processor cycles by phase; the product has no clock in it */
#include <x86intrin.h>
#define GK_MARK(work) ((work)->mark = __rdtsc())
#define GK_LAP(work, phase) ((work)->cycles[phase] -= (work)->mark, (work)->cycles[phase] += ((work)->mark = __rdtsc()))
#else
#define GK_MARK(work) ((void)(work))
#define GK_LAP(work, phase) ((void)(work))
#endif
#endif
