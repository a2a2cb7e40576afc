/* FMI 2.0 co-simulation face of the kernel: who may call what when, and the exported functions.
 *
 * A refused call (wrong order, unknown reference, NaN, negative step, freed instance) returns fmi2Error, says why to
 * the logger and changes nothing, the mode included. A step that the kernel gives up returns fmi2Discard;
 * fmi2LastSuccessfulTime tells how far it came. */
#include "fmi2/fmi2_face.h"
#include <stdio.h>
#include <string.h>

/* ---- who may call when (FMI 2.0.4, 4.2.4) ------------------------------------------------------------------------ */
enum {
    I = MODE_INSTANTIATED,
    N = MODE_INITIALIZATION,
    S = MODE_STEP,
    D = MODE_DISCARDED,
    E = MODE_ERROR,
    T = MODE_TERMINATED,
    ANY = I | N | S | D | E | T
};

#define CALLS(X)                                                                                                       \
    X(SetDebugLogging, ANY)                                                                                            \
    X(SetupExperiment, I)                                                                                              \
    X(EnterInitializationMode, I)                                                                                      \
    X(ExitInitializationMode, N)                                                                                       \
    X(Terminate, S | D)                                                                                                \
    X(Reset, ANY)                                                                                                      \
    X(Get, N | S | D | T)                                                                                              \
    X(Set, I | N | S)                                                                                                  \
    X(GetFMUstate, I | N | S | D | T)                                                                                  \
    X(SetFMUstate, ANY)                                                                                                \
    X(FreeFMUstate, ANY)                                                                                               \
    X(SerializeFMUstate, ANY) X(DeSerializeFMUstate, ANY) X(DoStep, S) X(GetStatus, S | D | T) X(NotOffered, ANY)
enum {
#define X(name, modes) CALL_##name,
    CALLS(X)
#undef X
};
static const struct {
    const char *name;
    int modes;
} calls[] = {
#define X(name, modes) {#name, modes},
    CALLS(X)
#undef X
};

static const char *mode_name(face_mode mode)
{
    switch (mode) {
    case MODE_INSTANTIATED: return "instantiated";
    case MODE_INITIALIZATION: return "initialization mode";
    case MODE_STEP: return "step mode";
    case MODE_DISCARDED: return "after a discarded step";
    case MODE_ERROR: return "error";
    default: return "terminated";
    }
}

/* ---- handles
 * An fmi2Component is a number: slot and generation. A freed or invented one is recognised without touching memory.
 * This table is the only thing instances share; it is empty when no instance lives. */
#define SLOTS 1024u
static struct {
    int taken;
    uintptr_t generation;
    face *instance;
} slots[SLOTS];

static fmi2Component publish(face *f)
{
    for (uintptr_t k = 0; k < SLOTS; k++) {
        int is_free = 0;
        if (!__atomic_compare_exchange_n(&slots[k].taken, &is_free, 1, 0, __ATOMIC_ACQ_REL, __ATOMIC_RELAXED)) continue;
        uintptr_t generation = __atomic_add_fetch(&slots[k].generation, 1, __ATOMIC_ACQ_REL);
        __atomic_store_n(&slots[k].instance, f, __ATOMIC_RELEASE);
        return (fmi2Component)(generation * SLOTS + k);
    }
    return NULL;
}

static face *instance_of(fmi2Component c)
{
    uintptr_t k = (uintptr_t)c % SLOTS;
    if (__atomic_load_n(&slots[k].generation, __ATOMIC_ACQUIRE) != (uintptr_t)c / SLOTS) return NULL;
    return __atomic_load_n(&slots[k].instance, __ATOMIC_ACQUIRE);
}

static void withdraw(fmi2Component c)
{
    uintptr_t k = (uintptr_t)c % SLOTS;
    __atomic_store_n(&slots[k].instance, NULL, __ATOMIC_RELEASE);
    __atomic_store_n(&slots[k].taken, 0, __ATOMIC_RELEASE);
}

/* says why a call is refused, and what is allowed instead: not what always is, nor what never is */
static void refuse_call(face *f, int call)
{
    char allowed[256] = "";
    size_t used = 0;
    for (size_t k = 0; k < sizeof calls / sizeof *calls; k++)
        if ((calls[k].modes & (int)f->mode) && calls[k].modes != ANY)
            used += (size_t)snprintf(allowed + used, sizeof allowed - used, "%s, ", calls[k].name);
    SAY(f, LOG_ERROR, "fmi2%s is not allowed in mode '%s'; allowed are %sSetFMUstate, Reset and FreeInstance",
        calls[call].name, mode_name(f->mode), allowed);
}

/* the instance, or NULL after having told why the call is refused */
static face *enter(fmi2Component c, int call)
{
    face *f = instance_of(c);
    if (!f || (calls[call].modes & (int)f->mode)) return f;
    refuse_call(f, call);
    return NULL;
}

#define ENTER(call)                                                                                                    \
    face *f = enter(c, CALL_##call);                                                                                   \
    if (!f) return fmi2Error
#define NEED(f, pointer)                                                                                               \
    if (!(pointer)) return REFUSE(f, "%s: the argument " #pointer " is NULL", __func__)

/* ---- life -------------------------------------------------------------------------------------------------------- */
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    static const fmi2CallbackFunctions none;
    const fmi2CallbackFunctions *environment = functions ? functions : &none;
    (void)visible;
    const char *fault = !instanceName || !*instanceName ? "the instance name is empty"
                        : fmuType != fmi2CoSimulation   ? "only co-simulation is offered"
                                                        : NULL;
    face *f = fault ? NULL
                    : face_create(instanceName, fmuGUID, fmuResourceLocation, environment, loggingOn != fmi2False);
    fmi2Component c = f ? publish(f) : NULL;
    if (f && !c) {
        face_destroy(f);
        fault = "too many instances in this process";
    }
    if (fault)
        face_log(environment, instanceName ? instanceName : "", LOG_ALWAYS, LOG_ERROR, "fmi2Instantiate: %s", fault);
    return c;
}

void fmi2FreeInstance(fmi2Component c)
{
    face *f = instance_of(c);
    if (!f) return;
    withdraw(c);
    face_destroy(f);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    static const struct {
        const char *name;
        unsigned bits;
    } known[] = {{"logEvents", LOG_EVENTS},
                 {"logStatusWarning", LOG_WARNING},
                 {"logStatusDiscard", LOG_DISCARD},
                 {"logStatusError", LOG_ERROR},
                 {"logAll", LOG_ALL}};
    ENTER(SetDebugLogging);
    unsigned chosen = nCategories ? 0 : LOG_ALL;
    if (nCategories) NEED(f, categories);
    for (size_t i = 0; i < nCategories; i++) {
        size_t k = 0;
        while (k < sizeof known / sizeof *known && (!categories[i] || strcmp(categories[i], known[k].name))) k++;
        if (k == sizeof known / sizeof *known)
            return REFUSE(f, "unknown log category '%.60s'", categories[i] ? categories[i] : "(null)");
        chosen |= known[k].bits;
    }
    f->logged = loggingOn ? chosen | LOG_ALWAYS : LOG_ALWAYS;
    return fmi2OK;
}

static int is_finite(double x) { return x - x == 0; }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    ENTER(SetupExperiment);
    (void)toleranceDefined, (void)tolerance; /* the internal step is fixed: parameter h */
    if (!is_finite(startTime)) return REFUSE(f, "start time is not finite");
    if (stopTimeDefined && !(is_finite(stopTime) && stopTime >= startTime))
        return REFUSE(f, "stop time %.17g s is before the start or not finite", stopTime);
    f->start = f->last_good = startTime;
    f->stop_defined = stopTimeDefined != fmi2False;
    f->stop = f->stop_defined ? stopTime : 0;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    ENTER(EnterInitializationMode);
    f->mode = MODE_INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    ENTER(ExitInitializationMode);
    fmi2Status status = face_settle(f);
    f->mode = status == fmi2OK ? MODE_STEP : MODE_ERROR;
    if (status == fmi2OK) SAY(f, LOG_EVENTS, "initialised at %.17g s", f->start);
    return status;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    ENTER(Terminate);
    f->mode = MODE_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    ENTER(Reset);
    return face_reset(f);
}

/* ---- variables --------------------------------------------------------------------------------------------------- */
#define CONST_get
#define CONST_set const
#define VALUES(VERB, verb, TYPE, ROLE, reals, integers)                                                                \
    fmi2Status fmi2##VERB##TYPE(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,                            \
                                CONST_##verb fmi2##TYPE value[])                                                       \
    {                                                                                                                  \
        ENTER(VERB);                                                                                                   \
        if (nvr) NEED(f, vr && value);                                                                                 \
        return face_##verb(f, ROLE_##ROLE, vr, nvr, reals, integers);                                                  \
    }
VALUES(Get, get, Real, REAL, value, NULL);
VALUES(Get, get, Integer, INTEGER, NULL, value);
VALUES(Get, get, Boolean, BOOLEAN, NULL, value);
VALUES(Set, set, Real, REAL, value, NULL);
VALUES(Set, set, Integer, INTEGER, NULL, value);
VALUES(Set, set, Boolean, BOOLEAN, NULL, value);

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    ENTER(Get);
    (void)vr, (void)value;
    return nvr ? REFUSE(f, "get String: this model has no String variables") : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    ENTER(Set);
    (void)vr, (void)value;
    return nvr ? REFUSE(f, "set String: this model has no String variables") : fmi2OK;
}

/* ---- saved states ------------------------------------------------------------------------------------------------ */
#define OWN(f, state)                                                                                                  \
    face_state *own = face_state_find(f, state);                                                                       \
    if (!own) return REFUSE(f, "%s: this is not a saved state of this instance, or it was freed", __func__)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    ENTER(GetFMUstate);
    NEED(f, FMUstate);
    face_state *own = *FMUstate ? face_state_find(f, *FMUstate) : NULL;
    if (*FMUstate && !own)
        return REFUSE(f, "fmi2GetFMUstate: *FMUstate is neither NULL nor a saved state of this instance");
    fmi2Status status = face_state_save(f, &own);
    if (status == fmi2OK) *FMUstate = own;
    return status;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    ENTER(SetFMUstate);
    OWN(f, FMUstate);
    return face_state_restore(f, own);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    ENTER(FreeFMUstate);
    if (!FMUstate || !*FMUstate) return fmi2OK;
    OWN(f, *FMUstate);
    face_state_free(f, own);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    ENTER(SerializeFMUstate);
    NEED(f, size);
    OWN(f, FMUstate);
    *size = own->head.size;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    ENTER(SerializeFMUstate);
    NEED(f, serializedState);
    OWN(f, FMUstate);
    if (size < own->head.size)
        return REFUSE(f, "fmi2SerializeFMUstate: %zu bytes do not hold a state of %zu", size, (size_t)own->head.size);
    face_state_write(own, serializedState);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    ENTER(DeSerializeFMUstate);
    NEED(f, serializedState && FMUstate);
    face_state *own = *FMUstate ? face_state_find(f, *FMUstate) : NULL;
    if (*FMUstate && !own)
        return REFUSE(f, "fmi2DeSerializeFMUstate: *FMUstate is neither NULL nor a saved state of this instance");
    fmi2Status status = face_state_read(f, serializedState, size, &own);
    if (status == fmi2OK) *FMUstate = own;
    return status;
}

/* ---- steps ------------------------------------------------------------------------------------------------------- */
static int given_up(gk_outcome outcome)
{
    return outcome == GK_DIVERGED || outcome == GK_PENETRATION || outcome == GK_ENERGY;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    ENTER(DoStep);
    (void)noSetFMUStatePriorToCurrentPoint; /* a promise we need not make use of: saved states stay valid */
    double end = currentCommunicationPoint + communicationStepSize;
    if (f->stop_defined && end > f->stop + 0.5 * communicationStepSize)
        return REFUSE(f, "fmi2DoStep to %.17g s goes beyond the stop time %.17g s", end, f->stop);
    gk_outcome outcome = gk_step(f->model, f->setup, f->work, f->data, currentCommunicationPoint,
                                 communicationStepSize);
    if (outcome == GK_OK) {
        f->last_good = end;
        f->step_status = fmi2OK;
        face_warn_of_retries(f);
        return fmi2OK;
    }
    if (!given_up(outcome))
        return REFUSE(f, "fmi2DoStep(%.17g, %.17g) at %.17g s: %s", currentCommunicationPoint, communicationStepSize,
                      gk_time(f->data), gk_outcome_text(outcome));
    f->mode = MODE_DISCARDED;
    f->step_status = fmi2Discard;
    f->last_good = gk_time(f->data);
    SAY(f, LOG_DISCARD,
        "the step from %.17g s stopped at %.17g s: %s. Values of that time can be read; to go on restore a saved state "
        "(fmi2SetFMUstate) or fmi2Reset, else fmi2Terminate",
        currentCommunicationPoint, f->last_good, gk_outcome_text(outcome));
    return fmi2Discard;
}

#define STATUS(NAME, TYPE, KIND, told)                                                                                 \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2StatusKind s, fmi2##TYPE *value)                               \
    {                                                                                                                  \
        ENTER(GetStatus);                                                                                              \
        NEED(f, value);                                                                                                \
        if (s != fmi2##KIND) return fmi2Discard;                                                                       \
        *value = told;                                                                                                 \
        return fmi2OK;                                                                                                 \
    }
STATUS(Status, Status, DoStepStatus, f->step_status);
STATUS(RealStatus, Real, LastSuccessfulTime, f->last_good);
STATUS(BooleanStatus, Boolean, Terminated, fmi2False); /* a discarded step may be tried again from a saved state */
STATUS(StringStatus, String, PendingStatus, "");

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    ENTER(GetStatus);
    (void)s, (void)value;
    return fmi2Discard; /* the standard knows no integer status */
}

/* ---- what modelDescription.xml does not declare (fmi2_absent.c) -------------------------------------------------- */
fmi2Status face_absent(fmi2Component c, const char *what)
{
    ENTER(NotOffered);
    return REFUSE(f, "%s: this FMU does not offer it (see modelDescription.xml)", what);
}
