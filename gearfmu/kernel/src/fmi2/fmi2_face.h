/* Inside of the FMI 2.0 co-simulation face: one instance, its memory, its saved states. Everything here is hidden;
 * fmi2.c exports the 34 functions of co-simulation, and the ten of model exchange, which it refuses.
 *   fmi2.c           who may call what when, handles, the exported functions
 *   fmi2_instance.c  making, settling, access to variables, log
 *   fmi2_state.c     saved states and their bytes
 *   fmi2_resource.c  resource location → bytes of model.gkb */
#ifndef FMI2_FACE_H
#define FMI2_FACE_H
#include "fmi2Functions.h"
#include "gk.h"

typedef enum face_mode {
    MODE_INSTANTIATED = 1,
    MODE_INITIALIZATION = 2,
    MODE_STEP = 4,
    MODE_DISCARDED = 8, /* a step stopped early: values of the last good time can be read, an earlier state restored */
    MODE_ERROR = 16,    /* the initialisation failed: restore, reset or free                                         */
    MODE_TERMINATED = 32
} face_mode;

/* Log categories, in the order of modelDescription.xml; the last two are always on: a refusal must be able to say why.
 */
enum {
    LOG_EVENTS = 1,
    LOG_WARNING = 2,
    LOG_DISCARD = 4,
    LOG_ERROR = 8,
    LOG_FATAL = 16,
    LOG_ALL = 31,
    LOG_ALWAYS = LOG_DISCARD | LOG_ERROR
};

/* What a value reference is; 0: no variable. */
enum {
    ROLE_REAL = 1,
    ROLE_INTEGER = 2,
    ROLE_BOOLEAN = 3,
    ROLE_TYPE = 3,
    ROLE_INPUT = 4,
    ROLE_PARAMETER = 8,
    ROLE_SETTABLE = 12
};

/* The bytes of a saved state: this head, `values` doubles (every settable variable, as given before the
 * initialisation), `bytes` bytes of gk_data. All fields little-endian; no padding. */
typedef struct face_head {
    char magic[8];
    uint64_t size;  /* of head, values and bytes */
    uint64_t check; /* FNV-1a of all that follows, filled when the state is serialised */
    char hash[64];  /* gk_model_hash */
    double start, stop, last_good;
    uint32_t stop_defined, mode, values, reserved;
    uint64_t bytes; /* 0 before the end of the initialisation */
} face_head;

typedef struct face_state {
    struct face_state *next;
    size_t capacity;
    face_head head; /* the values and bytes follow it directly */
} face_state;

typedef struct face {
    fmi2CallbackFunctions environment;
    const char *name;
    face_mode mode;
    unsigned logged;
    void *blob, *tables; /* two blocks of memory: the model file, and all that follows here */
    gk_model *model;
    gk_setup *setup;
    gk_work *work;
    gk_data *given;          /* settings before the initialisation: defaults and what was set */
    gk_data *data;           /* the running model */
    int settled;             /* data is the initial state that belongs to given (initialisation mode) */
    int prepared;            /* setup belongs to prepared_values */
    double *prepared_values; /* (settables) */
    uint32_t *settable;      /* (settables) value references of inputs and parameters */
    int settables;
    uint32_t references; /* value references lie below this */
    unsigned char *role; /* (references) */
    double *old;         /* (references) values before a set call, to undo it */
    double start, stop, last_good;
    int stop_defined;
    fmi2Status step_status;
    double warned;             /* solver.status bits already told */
    uint32_t status_reference; /* of solver.status */
    face_state *states;
} face;

#define FACE_ALIGNMENT 64

/* instance */
face *face_create(fmi2String name, fmi2String guid, fmi2String location, const fmi2CallbackFunctions *environment,
                  int logging);
void face_destroy(face *f);
fmi2Status face_reset(face *f);
fmi2Status face_settle(face *f);
fmi2Status face_prepare(face *f);
/* `count` values of one type; exactly one of reals and integers is given */
fmi2Status face_get(face *f, int type, const fmi2ValueReference references[], size_t count, double *reals,
                    int *integers);
fmi2Status face_set(face *f, int type, const fmi2ValueReference references[], size_t count, const double *reals,
                    const int *integers);
void face_warn_of_retries(face *f);
unsigned char *face_align(void *block); /* up to the next multiple of FACE_ALIGNMENT */
void *face_allocate(const fmi2CallbackFunctions *environment, size_t size);
void face_release(const fmi2CallbackFunctions *environment, void *block);
void face_log(const fmi2CallbackFunctions *environment, fmi2String name, unsigned logged, unsigned category,
              const char *format, ...);
#define SAY(f, category, ...) face_log(&(f)->environment, (f)->name, (f)->logged, category, __VA_ARGS__)
#define REFUSE(f, ...) (SAY(f, LOG_ERROR, __VA_ARGS__), fmi2Error)

/* saved states */
face_state *face_state_find(const face *f, const void *state);
fmi2Status face_state_save(face *f, face_state **state);
fmi2Status face_state_restore(face *f, const face_state *state);
void face_state_free(face *f, face_state *state);
void face_state_write(const face_state *state, void *bytes);
fmi2Status face_state_read(face *f, const void *bytes, size_t size, face_state **state);

/* resource: NULL with a message, or a block (64-byte aligned inside, freed with face_release) whose bytes start at
 * *bytes */
void *face_read_model(fmi2String location, const fmi2CallbackFunctions *environment, const unsigned char **bytes,
                      size_t *size, char message[GK_MESSAGE]);

/* refuses a function that this FMU does not offer */
fmi2Status face_absent(fmi2Component c, const char *what);

#endif
