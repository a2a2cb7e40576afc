/* All that changes while a model runs, in one block without pointers: a copy of its bytes is a snapshot and is the FMU
 * state. */
#ifndef GK_DATA_H
#define GK_DATA_H
#include "base/gk_lanes.h"
#include "model/gk_model.h"
#include "model/gk_vars.h"

enum {
    MAX_PAIRS = 8, /* tooth pairs of an engagement looked at in one step, both flanks */
    MAX_CONTACTS = MAX_PAIRS * MAX_SLICES,
    JOINTS = 3, /* of a port: its spring or torque, the shaft and the clutch of its chain */
    MAX_SPINS = MAX_ROTORS + 2 * MAX_PORTS
};
enum { JOINT_PORT, JOINT_SHAFT, JOINT_CLUTCH };
/* pose of a gear: in the plane, and what only spatial models know */
enum { PLANE = 3, SPACE = 6, POSE = 2 * SPACE };
enum { XA, YA, PHIA, ZA, RXA, RYA, XB, YB, PHIB, ZB, RXB, RYB };

typedef enum { LEVEL_RIGID, LEVEL_FAST, LEVEL_STANDARD, LEVEL_FULL, LEVEL_PAPER, LEVEL_EXPLICIT } gk_level;
typedef enum { DG4, MIX4, EM, RK45, CENTRAL } gk_integrator;
typedef enum { CONTACT_BY_LEVEL, CONTACT_LINE, CONTACT_NODAL } gk_contact_law;
/* bits of solver.status */
enum {
    STATUS_LAW = 1,        /* local law beyond its range */
    STATUS_FALLBACK = 2,   /* em in use */
    STATUS_LIMIT = 4,      /* limit of iterations reached */
    STATUS_GAMMA = 8,      /* γ lowered */
    STATUS_TIP_ENDED = 16, /* a loaded flank ended with tip corners off */
    STATUS_TORQUE = 32,    /* mean mesh force over a tooth pitch beyond that of torque_max */
    STATUS_SPEED = 64,     /* a tooth pitch passed faster than at speed_max */
    STATUS_JUMP = 128      /* the first step moved at once what had started at rest */
};

typedef struct gk_key {
    int32_t flank, tooth;
} gk_key; /* flank 0 drive, 1 coast; tooth: unwrapped tooth number of gear A */

typedef struct gk_memory { /* what a tooth pair remembers from the last step */
    gk_key key;
    double force[MAX_SLICES], gap[MAX_SLICES];  /* λ0; s0 */
    double damper[MAX_SLICES], end[MAX_SLICES]; /* η_d of the last step, f_d at its end */
    double ratio[MAX_SLICES];                   /* friction over normal force */
} gk_memory;

typedef struct gk_meshing { /* an engagement */
    double
        frozen[POSE]; /* poses of both gears at the start: where all is taken that depends on position when roll_motion
                         is off */
    double search_distance;   /* how far to look for contacts */
    double open_time;         /* without any contact */
    double rubbed;            /* energy lost to friction */
    double squeezed;          /* energy lost to the squeeze film */
    double rolling, unsteady; /* speed of gear A and its deviation from that, means over the last millisecond */
    double energy_error;      /* defect of energy that the balance of contacts tolerated so far */
    double pitch_angle, pitch_time,
        pitch_impulse; /* of the tooth pitch that passes: where it began, what it gathered */
    int64_t impacts;
    int32_t apart, pairs;
    int32_t adopted, unused; /* gaps in memory are those at the end of the step: another setup made it */
    gk_memory memory[MAX_PAIRS];
} gk_meshing;

typedef struct gk_motion {
    double phi, w, a;
} gk_motion;

typedef struct gk_joint_state {
    double force, damper, end;
} gk_joint_state; /* λ0 (clutch: the constant torque of the last step), damper force of the last step and at its end */

typedef struct gk_energy {
    double work, dissipated, baseline;
    double quasi_static; /* energy of the quasi-static part at the end of the last step */
    double through;      /* that passed the ports, in whichever direction */
} gk_energy;

struct gk_data {
    uint64_t magic;
    int32_t phase, status;
    double stage[STAGE_VARS], shaft[MAX_PORTS][SHAFT_VARS], rotor[MAX_ROTORS][ROTOR_VARS],
        mesh[MAX_ENGAGEMENTS][MESH_VARS], support[MAX_SUPPORTS][SUPPORT_VARS];
    double x[MAX_SPINS], v[MAX_SPINS], f[MAX_SPINS]; /* spins: angle, speed, torque of the moment */
    double f_rate[MAX_SPINS];                        /* change of f in the last step over h */
    gk_joint_state joint[MAX_PORTS][JOINTS];
    int32_t locked[MAX_PORTS]; /* clutches */
    double time_base, step_H;  /* time = time_base + count·H */
    int64_t count;
    gk_motion input[MAX_PORTS]; /* outer ends at the start of the communication step */
    double hold[MAX_PORTS];     /* angle a port is referred to */
    double v_bore[MAX_PORTS];   /* speed of the bore nodes before the last internal step */
    double angle[MAX_PORTS];    /* bore angle at a torque port, quasi-static part included */
    double rk_h;
    double state_h, state_gamma;         /* the step for which x and q are expressed; 0: physical */
    double expressed_h, expressed_gamma; /* the last step that was made */
    double table_h;                      /* the internal step with tables of its own: that of the run's first
                                                   communication step */
    gk_energy energy;
    int64_t steps, iterations, retried;
    int64_t amplitudes; /* where those of observed gears stand, in doubles from `oscillator` on */
    gk_meshing meshing[MAX_ENGAGEMENTS];
    double oscillator[]; /* ground group: q (n), v (n), f (n), double; then of every gear group q, v, f, gk_real; then
                            the amplitudes of observed gears */
};

#define GK_DATA_MAGIC 0x32415441444b47ULL
enum { PHASE_NEW = 1, PHASE_RUNNING, PHASE_FAILED };
#endif
