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
typedef enum { DG4, EM, RK45, CENTRAL } gk_integrator;
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
    double shift;             /* account of the invariant's jumps where contacts close and open (theory, 12c) */
    double pitch_angle, pitch_time,
        pitch_impulse; /* of the tooth pitch that passes: where it began, what it gathered */
    int64_t impacts;
    int32_t apart, pairs;
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

typedef double gk_shaft_values[SHAFT_VARS], gk_rotor_values[ROTOR_VARS], gk_mesh_values[MESH_VARS],
    gk_support_values[SUPPORT_VARS], gk_sensor_values[SENSOR_VARS];
typedef gk_joint_state gk_joint_states[JOINTS];

/* Arrays behind the head of gk_data: GK_ARRAY(name, type of an element, how many). What `mesh` and those before it hold
 * are variables.
 * x, v, f: angle, speed and torque of the moment of spins; f_rate: change of f in the last step over h
 * locked: clutches; input: outer ends at the start of the communication step; hold: angle a port is referred to
 * v_bore: speed of the bore nodes before the last internal step
 * angle: bore angle at a torque port, quasi-static part included
 * oscillator: ground group: q (n), v (n), f (n), f_rate (n), double; then the same of every gear group, gk_real; then
 * the amplitudes of observed gears */
#define GK_ARRAYS                                                                                                      \
    GK_ARRAY(shaft, gk_shaft_values, model->ports)                                                                     \
    GK_ARRAY(rotor, gk_rotor_values, model->rotors)                                                                    \
    GK_ARRAY(support, gk_support_values, model->supports)                                                              \
    GK_ARRAY(sensor, gk_sensor_values, model->sensors)                                                                 \
    GK_ARRAY(mesh, gk_mesh_values, model->engagements)                                                                 \
    GK_ARRAY(x, double, spins)                                                                                         \
    GK_ARRAY(v, double, spins)                                                                                         \
    GK_ARRAY(f, double, spins)                                                                                         \
    GK_ARRAY(f_rate, double, spins)                                                                                    \
    GK_ARRAY(joint, gk_joint_states, model->ports)                                                                     \
    GK_ARRAY(input, gk_motion, model->ports)                                                                           \
    GK_ARRAY(hold, double, model->ports)                                                                               \
    GK_ARRAY(v_bore, double, model->ports)                                                                             \
    GK_ARRAY(angle, double, model->ports)                                                                              \
    GK_ARRAY(locked, int32_t, model->ports)                                                                            \
    GK_ARRAY(meshing, gk_meshing, model->engagements)                                                                  \
    GK_ARRAY(oscillator, double, 0)
#define GK_ARRAY(name, type, count) typedef type gk_of_##name;
GK_ARRAYS
#undef GK_ARRAY
enum {
#define GK_ARRAY(name, type, count) OF_##name,
    GK_ARRAYS
#undef GK_ARRAY
        ARRAYS
};
/* an array of some data */
#define GK_OF(data, name) ((gk_of_##name *)(uintptr_t)((data)->tail + (data)->at[OF_##name]))

struct gk_data {
    uint64_t magic;
    int32_t phase, status;
    uint32_t at[ARRAYS]; /* where they begin, in doubles from `tail` on */
    double stage[STAGE_VARS];
    double time_base, step_H; /* time = time_base + count·H */
    int64_t count;
    double rk_h;
    double state_h, state_gamma;         /* the step for which x and q are expressed; 0: physical */
    double expressed_h, expressed_gamma; /* the last step that was made */
    double table_h;                      /* the internal step with tables of its own: that of the run's first
                                                   communication step */
    gk_energy energy;
    int64_t steps, iterations, retried;
    int64_t amplitudes; /* where those of observed gears stand, in doubles from `oscillator` on */
    double tail[];
};

#define GK_DATA_MAGIC 0x32415441444b47ULL
enum { PHASE_NEW = 1, PHASE_RUNNING, PHASE_FAILED };

/* where the arrays of a model's data begin */
void gk_data_plan(const gk_model *model, uint32_t at[ARRAYS]);
#endif
