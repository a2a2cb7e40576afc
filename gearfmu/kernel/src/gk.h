/* gearfmu kernel: elastic gear stage, reduced bodies, tooth contact, one fixed-step solver.
 *
 * Four kinds of memory, all owned by the caller; the kernel allocates nothing, opens nothing, starts nothing and keeps
 * no globals:
 *   gk_model   pointers into a constant, checked blob (geometry, modes, static compliance)
 *   gk_setup   what is fixed once level, effects and step are chosen (tables for the chosen modes and slices)
 *   gk_data    everything that changes, without pointers: a copy of its bytes is a snapshot and is the FMU state
 *   gk_work    scratch and coefficients of the steps in use: neither model nor state; one for every thread
 * Life: gk_model_open → gk_defaults → gk_set … → gk_prepare → gk_initialize → (gk_set, gk_step, gk_get)*
 */
#ifndef GK_H
#define GK_H
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define GK_API __declspec(dllexport)
#else
#define GK_API __attribute__((visibility("default")))
#endif

#define GK_ABI 7
#define GK_MESSAGE 512

typedef enum gk_outcome {
    GK_OK = 0,
    GK_BAD_BLOB,       /* not a model, wrong version, damaged, or out of bounds: see the message               */
    GK_BAD_VARIABLE,   /* no such value reference in this model                                                 */
    GK_BAD_VALUE,      /* NaN, infinite or outside the variable's range; nothing was changed                     */
    GK_BAD_CALL,       /* this call is not allowed now; nothing was changed                                      */
    GK_BAD_STEP,       /* communication step negative, zero, not finite or not at the current time; unchanged    */
    GK_STEP_TOO_LARGE, /* h above the stability limit of this model at this level: see the message for h to use  */
    GK_NO_EQUILIBRIUM, /* the initial static equilibrium was not found                                           */
    GK_DIVERGED,       /* a state not finite or rk45 steps without end, even with the smallest step and em       */
    GK_PENETRATION,    /* tooth penetration exceeds the validity range of the contact model                      */
    GK_ENERGY,         /* the energy balance broke                                                               */
    GK_OUTCOMES
} gk_outcome;

typedef struct gk_model gk_model;
typedef struct gk_setup gk_setup;
typedef struct gk_data gk_data;
typedef struct gk_work gk_work;

typedef enum gk_type { GK_REAL, GK_INTEGER, GK_BOOLEAN, GK_ENUM } gk_type;
typedef enum gk_causality { GK_INPUT, GK_OUTPUT, GK_PARAMETER } gk_causality;

typedef struct gk_variable_info {
    uint32_t reference; /* FMI value reference: gk_variables.inc */
    gk_type type;
    gk_causality causality;
    char name[64];  /* e.g. "pinion.phi"                                                */
    char unit[24];  /* "" for none                                                       */
    char items[64]; /* enumeration items "rigid|fast|…", values 0, 1, …                   */
    char description[160];
    double start, minimum, maximum;
} gk_variable_info;

/* model */
GK_API int gk_abi(void);
GK_API const char *gk_outcome_text(gk_outcome outcome);
GK_API const char *gk_status_text(int bit); /* what bit 0, 1, … of solver.status means; NULL past the last */
GK_API size_t gk_model_size(void);
GK_API gk_outcome gk_model_open(gk_model *model, const void *blob, size_t size, char message[GK_MESSAGE]);
GK_API const char *gk_model_name(const gk_model *model); /* stage name                        */
GK_API const char *gk_model_hash(const gk_model *model); /* 64 hex digits, SHA-256 of the blob */
GK_API const char *gk_model_guid(const gk_model *model); /* GUID of an FMU with this model     */

/* variables: only those that exist in this model (ports decide), in the table's order */
GK_API int gk_variable_count(const gk_model *model);
GK_API gk_outcome gk_variable(const gk_model *model, int index, gk_variable_info *info);

/* sizes in bytes; upper bounds over all levels, effects and slices, so that memory can be taken at instantiation */
GK_API size_t gk_setup_size(const gk_model *model);
GK_API size_t gk_data_size(const gk_model *model);
GK_API size_t gk_work_size(const gk_model *model);

/* life */
GK_API gk_outcome gk_defaults(const gk_model *model, gk_data *data);
GK_API gk_outcome gk_set(const gk_model *model, gk_data *data, uint32_t reference, double value);
GK_API gk_outcome gk_get(const gk_model *model, const gk_data *data, uint32_t reference, double *value);
/* `count` of them at once: when one is refused none is set */
GK_API gk_outcome gk_set_many(const gk_model *model, gk_data *data, const uint32_t *references, size_t count,
                              const double *values);
GK_API gk_outcome gk_get_many(const gk_model *model, const gk_data *data, const uint32_t *references, size_t count,
                              double *values);
GK_API gk_outcome gk_prepare(const gk_model *model, const gk_data *data, gk_setup *setup, gk_work *work,
                             char message[GK_MESSAGE]);
GK_API gk_outcome gk_initialize(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                                double time);
/* One communication step from `time` to time + H. The first H is taken as given; a later one within 8 ulp(time + H) of
 * the last counts as that one. On failure the data stands at the last good time (gk_time) and the outcome says why. */
GK_API gk_outcome gk_step(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double time,
                          double H);
GK_API double gk_time(const gk_data *data);

/* `steps` communication steps of H (s), step n beginning at n·H; rows of numbers by value reference. */
typedef struct gk_recording {
    double H;
    uint64_t first, steps;   /* number of the first one; how many                                                 */
    uint64_t given, kept;    /* how many inputs and outputs                                                       */
    const uint32_t *inputs;  /* (given)                                                                           */
    const uint32_t *outputs; /* (kept)                                                                            */
    const double *input;     /* (steps, given): set before each step                                              */
    double *output;          /* (steps, kept): taken after each step                                              */
    uint64_t done;           /* steps that were made: as many rows of `output` are written                        */
} gk_recording;
/* Ends at the first input that is refused or step that fails, with its outcome. */
GK_API gk_outcome gk_record(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                            gk_recording *recording);

/* Quasi-static equilibrium under a torque on the bore of the first port, the bore of the second held at phi_out,
 * further ports free; by the contact routine of the step. After gk_prepare; `keep` continues from the last call. */
GK_API gk_outcome gk_te(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double phi_out,
                        double torque, int keep);

/* What gk_te has just found, seen at an engagement. out[0] = loaded transmission error te (m) by the bores of the
 * ports, out[1] = angle of the first port's bore (rad), out[2] = te (m) as the output in motion, by the carrier's own
 * angle; then for each of *places tooth pairs {flank 0 drive 1 coast, tooth number of gear A, force of each slice (N)};
 * at most 3 + 8·12 numbers. GK_BAD_CALL after a step. */
GK_API gk_outcome gk_te_at(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                           int engagement, double *out, int *places);

/* Static equilibrium with the torque[p] (N m) on the bore of every port p, chains left out; phi[p] (rad): angles of
 * the bores. The torques balance where nothing holds the rotors: Σ torque × speed = 0 in every motion that the
 * meshes allow. After gk_prepare. */
GK_API gk_outcome gk_rest(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                          const double *torque, double *phi);

/* Goes on at another level, with other effects, slices or another step: `data`, prepared with `setup` and not yet
 * initialised, takes over the motion of data that has just made a step with `from`. What was compliance and is dynamic
 * now starts at rest in its static place; contacts start anew. GK_BAD_CALL where either is explicit, where bearings are
 * on in one only, and before a step. */
GK_API gk_outcome gk_adopt(const gk_model *model, const gk_setup *from_setup, const gk_work *from_work,
                           const gk_data *from, const gk_setup *setup, gk_data *data);

/* Phase profile of the step: name and processor cycles of phase 0, 1, …; 0 past the last. Cycles are counted by builds
 * with -DGK_PROFILE only, else they stay 0. */
GK_API int gk_profile(const gk_work *work, int phase, const char **name, uint64_t *cycles);

/* state = the first gk_state_size bytes of gk_data */
GK_API size_t gk_state_size(const gk_setup *setup);
/* check bytes that come from outside (another process, a file) before they become a state */
GK_API gk_outcome gk_state_check(const gk_model *model, const gk_setup *setup, const void *bytes, size_t size);

#endif
