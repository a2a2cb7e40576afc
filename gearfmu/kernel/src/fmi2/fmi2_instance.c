/* One instance of the FMI 2 face: its memory, its settings before the initialisation, access to the kernel's variables.
 */
#include "fmi2/fmi2_face.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Zeroed memory: by the importer's function when it gives both, which FMI asks to zero it, else the C library's. It is
 * left untouched: sizes are those of the largest setup, and pages that nothing touches cost nothing. */
void *face_allocate(const fmi2CallbackFunctions *environment, size_t size)
{
    const int theirs = environment->allocateMemory && environment->freeMemory;
    return theirs ? environment->allocateMemory(1, size) : calloc(1, size);
}

void face_release(const fmi2CallbackFunctions *environment, void *block)
{
    if (!block) return;
    if (environment->allocateMemory && environment->freeMemory)
        environment->freeMemory(block);
    else
        free(block);
}

unsigned char *face_align(void *block)
{
    return (unsigned char *)(((uintptr_t)block + FACE_ALIGNMENT - 1) / FACE_ALIGNMENT * FACE_ALIGNMENT);
}

/* The logger's message is a printf format: a % of ours is doubled. */
void face_log(const fmi2CallbackFunctions *environment, fmi2String name, unsigned logged, unsigned category,
              const char *format, ...)
{
    static const char *const names[] = {"logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                        "logStatusFatal"};
    static const fmi2Status statuses[] = {fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal};
    if (!environment->logger || !(category & (logged | LOG_ALWAYS))) return;
    char text[GK_MESSAGE + 256], safe[2 * sizeof text];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    char *out = safe;
    for (const char *in = text; *in; in++) {
        if (*in == '%') *out++ = '%';
        *out++ = *in;
    }
    *out = '\0';
    int k = 0;
    while (category >> (k + 1)) k++;
    environment->logger(environment->componentEnvironment, name, statuses[k], names[k], safe);
}

/* A bump over one block: returns the aligned place and moves on; with block = NULL it only counts. */
static void *take(unsigned char *block, size_t *used, size_t size)
{
    size_t at = *used;
    *used = at + (size + FACE_ALIGNMENT - 1) / FACE_ALIGNMENT * FACE_ALIGNMENT;
    return block ? block + at : NULL;
}

static size_t lay_out(face *f, unsigned char *block)
{
    size_t used = 0;
    f->setup = take(block, &used, gk_setup_size(f->model));
    f->work = take(block, &used, gk_work_size(f->model));
    f->given = take(block, &used, gk_data_size(f->model));
    f->data = take(block, &used, gk_data_size(f->model));
    f->prepared_values = take(block, &used, (size_t)f->settables * sizeof(double));
    f->settable = take(block, &used, (size_t)f->settables * sizeof(uint32_t));
    f->role = take(block, &used, f->references);
    f->old = take(block, &used, f->references * sizeof(double));
    return used;
}

static unsigned char role_of(const gk_variable_info *info)
{
    static const unsigned char types[] = {
        [GK_REAL] = ROLE_REAL, [GK_INTEGER] = ROLE_INTEGER, [GK_BOOLEAN] = ROLE_BOOLEAN, [GK_ENUM] = ROLE_INTEGER};
    unsigned char settable = info->causality == GK_INPUT       ? ROLE_INPUT
                             : info->causality == GK_PARAMETER ? ROLE_PARAMETER
                                                               : 0;
    return types[info->type] | settable;
}

static void count_variables(face *f)
{
    gk_variable_info info;
    for (int k = 0; gk_variable(f->model, k, &info) == GK_OK; k++) {
        if (info.reference >= f->references) f->references = info.reference + 1;
        f->settables += info.causality != GK_OUTPUT;
    }
}

static void list_variables(face *f)
{
    gk_variable_info info;
    int n = 0;
    for (int k = 0; gk_variable(f->model, k, &info) == GK_OK; k++) {
        f->role[info.reference] = role_of(&info);
        if (info.causality != GK_OUTPUT) f->settable[n++] = info.reference;
        if (strcmp(info.name, "solver.status") == 0) f->status_reference = info.reference;
    }
}

static int open_model(face *f, fmi2String guid, fmi2String location)
{
    char message[GK_MESSAGE] = "";
    const unsigned char *bytes;
    size_t size;
    f->blob = face_read_model(location, &f->environment, &bytes, &size, message);
    if (!f->blob) return SAY(f, LOG_ERROR, "%s", message), 0;
    gk_outcome outcome = gk_model_open(f->model, bytes, size, message);
    if (outcome != GK_OK)
        return SAY(f, LOG_ERROR, "resources/model.gkb: %s: %s; export the FMU again", gk_outcome_text(outcome),
                   message),
               0;
    if (!guid || strcmp(guid, gk_model_guid(f->model)))
        return SAY(f, LOG_ERROR, "GUID %.80s is not that of resources/model.gkb (%s): export the FMU again",
                   guid ? guid : "(null)", gk_model_guid(f->model)),
               0;
    return 1;
}

static int take_memory(face *f)
{
    count_variables(f);
    void *block = face_allocate(&f->environment, lay_out(f, NULL) + FACE_ALIGNMENT);
    if (!block) return SAY(f, LOG_ERROR, "no memory for the instance"), 0;
    f->tables = block;
    lay_out(f, face_align(block));
    list_variables(f);
    return 1;
}

face *face_create(fmi2String name, fmi2String guid, fmi2String location, const fmi2CallbackFunctions *environment,
                  int logging)
{
    size_t head = sizeof(face) + strlen(name) + 1;
    unsigned char *block = face_allocate(environment, head + FACE_ALIGNMENT + gk_model_size());
    if (!block) return NULL;
    face *f = (face *)(void *)block;
    f->environment = *environment;
    f->name = memcpy(block + sizeof(face), name, strlen(name) + 1);
    f->model = (gk_model *)face_align(block + head);
    f->logged = logging ? LOG_ALL : LOG_ALWAYS;
    if (!open_model(f, guid, location) || !take_memory(f) || face_reset(f) != fmi2OK) {
        face_destroy(f);
        return NULL;
    }
    SAY(f, LOG_EVENTS, "instance of %s, model %s", gk_model_name(f->model), gk_model_hash(f->model));
    return f;
}

void face_destroy(face *f)
{
    fmi2CallbackFunctions environment = f->environment;
    while (f->states) face_state_free(f, f->states);
    face_release(&environment, f->tables);
    face_release(&environment, f->blob);
    face_release(&environment, f);
}

/* back to what fmi2Instantiate left; saved states stay valid */
fmi2Status face_reset(face *f)
{
    if (gk_defaults(f->model, f->given) != GK_OK) return REFUSE(f, "the model has no defaults: export the FMU again");
    f->mode = MODE_INSTANTIATED;
    f->settled = 0;
    f->start = f->stop = f->last_good = 0;
    f->stop_defined = 0;
    f->step_status = fmi2OK;
    f->warned = 0;
    return fmi2OK;
}

/* bring the setup up to the parameters in `given`; does nothing when it already belongs to them */
fmi2Status face_prepare(face *f)
{
    int same = f->prepared;
    for (int k = 0; k < f->settables; k++) {
        double value = 0;
        gk_get(f->model, f->given, f->settable[k], &value);
        if (f->role[f->settable[k]] & ROLE_PARAMETER)
            same = same && memcmp(&value, &f->prepared_values[k], sizeof value) == 0;
        f->prepared_values[k] = value;
    }
    if (same) return fmi2OK;
    char message[GK_MESSAGE] = "";
    gk_outcome outcome = gk_prepare(f->model, f->given, f->setup, f->work, message);
    f->prepared = outcome == GK_OK;
    if (outcome != GK_OK) return REFUSE(f, "%s: %s", gk_outcome_text(outcome), message);
    if (message[0]) SAY(f, LOG_WARNING, "%s", message);
    return fmi2OK;
}

/* the initial state that belongs to the settings: prepared tables, static equilibrium, outputs */
fmi2Status face_settle(face *f)
{
    if (f->settled) return fmi2OK;
    if (face_prepare(f) != fmi2OK) return fmi2Error;
    memcpy(f->data, f->given, gk_data_size(f->model));
    gk_outcome outcome = gk_initialize(f->model, f->setup, f->work, f->data, f->start);
    if (outcome != GK_OK) return REFUSE(f, "initialisation at %.17g s: %s", f->start, gk_outcome_text(outcome));
    f->settled = 1;
    f->last_good = f->start;
    return fmi2OK;
}

static const char *type_name(int type)
{
    static const char *const names[] = {"none", "Real", "Integer or Enumeration", "Boolean"};
    return names[type & ROLE_TYPE];
}

static int role(const face *f, fmi2ValueReference reference)
{
    return reference < f->references ? f->role[reference] : 0;
}

static int find_variable(const face *f, fmi2ValueReference reference, gk_variable_info *info)
{
    for (int k = 0; gk_variable(f->model, k, info) == GK_OK; k++)
        if (info->reference == reference) return 1;
    return 0;
}

/* "pinion.w (value reference 513)" */
typedef struct label {
    char text[96];
} label;
static label named(const face *f, fmi2ValueReference reference)
{
    label out;
    gk_variable_info info;
    if (find_variable(f, reference, &info))
        snprintf(out.text, sizeof out.text, "%s (value reference %u)", info.name, reference);
    else
        snprintf(out.text, sizeof out.text, "value reference %u", reference);
    return out;
}

static int refuse_type(face *f, const char *call, int type, fmi2ValueReference reference)
{
    int what = role(f, reference);
    if ((what & ROLE_TYPE) == type) return 0;
    SAY(f, LOG_ERROR, "%s %s: %s is %s", call, type_name(type), named(f, reference).text,
        what ? type_name(what) : "no variable of this model");
    return 1;
}

/* in initialisation mode outputs are those of the present settings */
fmi2Status face_get(face *f, int type, const fmi2ValueReference references[], size_t count, double *reals,
                    int *integers)
{
    for (size_t i = 0; i < count; i++) {
        if (refuse_type(f, "get", type, references[i])) return fmi2Error;
        int initial = f->mode == MODE_INITIALIZATION, setting = (role(f, references[i]) & ROLE_SETTABLE) != 0;
        if (initial && !setting && face_settle(f) != fmi2OK) return fmi2Error;
        double value = 0;
        gk_outcome outcome = gk_get(f->model, initial && setting ? f->given : f->data, references[i], &value);
        if (outcome != GK_OK) return REFUSE(f, "get %s: %s", named(f, references[i]).text, gk_outcome_text(outcome));
        if (reals)
            reals[i] = value;
        else
            integers[i] = (int)value;
    }
    return fmi2OK;
}

static int refuse_setting(face *f, int type, fmi2ValueReference reference)
{
    if (refuse_type(f, "set", type, reference)) return 1;
    int what = role(f, reference);
    if (!(what & ROLE_SETTABLE)) return SAY(f, LOG_ERROR, "set: %s is an output", named(f, reference).text), 1;
    if (f->mode == MODE_STEP && !(what & ROLE_INPUT))
        return SAY(f, LOG_ERROR, "set: %s is a fixed parameter: set it before the initialisation ends",
                   named(f, reference).text),
               1;
    return 0;
}

static fmi2Status refuse_value(face *f, fmi2ValueReference reference, double value, gk_outcome outcome)
{
    gk_variable_info info;
    const label own = named(f, reference);
    const char *name = own.text;
    if (outcome != GK_BAD_VALUE || !find_variable(f, reference, &info))
        return REFUSE(f, "set %s = %.17g: %s", name, value, gk_outcome_text(outcome));
    const char *whole = info.type == GK_REAL ? "" : " whole numbers";
    if (info.items[0]) return REFUSE(f, "set %s = %.17g: allowed are 0, 1, ... for %s", name, value, info.items);
    return REFUSE(f, "set %s = %.17g: allowed are%s from %g to %g %s", name, value, whole, info.minimum, info.maximum,
                  info.unit);
}

/* all values or, when one is refused, none */
fmi2Status face_set(face *f, int type, const fmi2ValueReference references[], size_t count, const double *reals,
                    const int *integers)
{
    gk_data *target = f->mode == MODE_STEP ? f->data : f->given;
    for (size_t i = 0; i < count; i++) {
        if (refuse_setting(f, type, references[i])) return fmi2Error;
        gk_get(f->model, target, references[i], &f->old[references[i]]);
    }
    f->settled = 0;
    for (size_t i = 0; i < count; i++) {
        double value = reals ? reals[i] : integers[i];
        gk_outcome outcome = gk_set(f->model, target, references[i], value);
        if (outcome == GK_OK) continue;
        for (size_t k = 0; k < i; k++) gk_set(f->model, target, references[k], f->old[references[k]]);
        return refuse_value(f, references[i], value, outcome);
    }
    return fmi2OK;
}

void face_warn_of_retries(face *f)
{
    double status = 0;
    if (!(f->logged & LOG_WARNING) || gk_get(f->model, f->data, f->status_reference, &status) != GK_OK ||
        status == f->warned)
        return;
    unsigned fresh = (unsigned)status & ~(unsigned)f->warned;
    for (int k = 0; gk_status_text(k); k++)
        if (fresh >> k & 1) SAY(f, LOG_WARNING, "until %.9g s: %s", gk_time(f->data), gk_status_text(k));
    f->warned = status;
}
