/* Variables by value reference: one table (gk_variables.inc) decides names, ranges and which of them exist in a
 * model. A reference is 256 × the variable's number + its instance, so that it stays when variables or gears are
 * added; those of amplitudes, which may be many, begin at 2²⁴. */
#include "model/gk_data.h"
#include <stdio.h>

typedef enum {
    ALWAYS,
    SPRING,
    TORQUE,
    FIXED,
    SPRING_OR_FIXED,
    CHAIN,
    SLICES_DIFFER,
    CARRIED,
    SPINNING,
    DEVIATING,
    RUNNING_OUT,
    RUBBING,
    HOUSED,
    OBSERVED
} gk_exists;
enum {
    STAGE = SCOPE_STAGE,
    SHAFT = SCOPE_SHAFT,
    ROTOR = SCOPE_ROTOR,
    MESH = SCOPE_MESH,
    SUPPORT = SCOPE_SUPPORT,
    SENSOR = SCOPE_SENSOR,
    MODE = SCOPE_MODE
};
typedef struct gk_row {
    gk_scope scope;
    int number, place; /* place: among the values of its scope */
    const char *name;
    gk_type type;
    gk_causality causality;
    gk_exists exists;
    const char *unit;
    double start, minimum, maximum;
    const char *items, *description;
} gk_row;

static const gk_row TABLE[] = {
#define GK_VAR(SCOPE, NUMBER, ID, NAME, TYPE, CAUSALITY, EXISTS, UNIT, START, MIN, MAX, ITEMS, TEXT)                   \
    {(gk_scope)SCOPE, NUMBER, V_##ID, NAME, TYPE, CAUSALITY, EXISTS, UNIT, START, MIN, MAX, ITEMS, TEXT},
#define GK_VARS_END(SCOPE)
#include "model/gk_variables.inc"
#undef GK_VAR
#undef GK_VARS_END
};
enum { ROWS = sizeof TABLE / sizeof *TABLE, INSTANCES = 256, MODES_FROM = 1 << 24 };

static int instances(const gk_model *model, gk_scope scope)
{
    switch (scope) {
    case SCOPE_SHAFT: return model->ports;
    case SCOPE_ROTOR: return model->rotors;
    case SCOPE_MESH: return model->engagements;
    case SCOPE_SUPPORT: return model->supports;
    case SCOPE_SENSOR: return model->sensors;
    case SCOPE_MODE: return model->amplitudes;
    default: return 1;
    }
}

static int exists(const gk_model *model, const gk_row *row, int instance)
{
    if (instance < 0 || instance >= instances(model, row->scope)) return 0;
    const gk_port *port = row->scope == SCOPE_SHAFT ? &model->port[instance] : NULL;
    switch (row->exists) {
    case ALWAYS:
    case OBSERVED: return 1;
    case SPRING: return port->kind == PORT_SPRING;
    case TORQUE: return port->kind == PORT_TORQUE;
    case FIXED: return port->kind == PORT_FIXED;
    case SPRING_OR_FIXED: return port->kind != PORT_TORQUE;
    case CHAIN: return port->chain > 0;
    case SLICES_DIFFER: return model->spatial && row->place - V_SLICE_1 < model->slices; /* those of the stage file */
    case CARRIED: return model->carried > 0;
    case SPINNING: return model->spinning;
    case DEVIATING: return model->deviating;
    case RUNNING_OUT: return model->running_out;
    case RUBBING: return model->rubbing;
    case HOUSED: return model->housed;
    }
    return 0;
}

/* row and instance of a reference; NULL when there is none in this model */
static const gk_row *row_of(const gk_model *model, uint32_t reference, int *instance)
{
    const uint32_t number = reference / INSTANCES;
    if (reference >= MODES_FROM) {
        *instance = (int)(reference - MODES_FROM);
        return *instance < model->amplitudes ? &TABLE[ROWS - 1] : NULL; /* the last of the table */
    }
    *instance = (int)(reference % INSTANCES);
    for (int i = 0; i < ROWS - 1; i++)
        if (TABLE[i].number == (int)number) return exists(model, &TABLE[i], *instance) ? &TABLE[i] : NULL;
    return NULL;
}

static double *value_of(gk_data *data, const gk_row *row, int instance)
{
    switch (row->scope) {
    case SCOPE_SHAFT: return &GK_OF(data, shaft)[instance][row->place];
    case SCOPE_ROTOR: return &GK_OF(data, rotor)[instance][row->place];
    case SCOPE_MESH: return &GK_OF(data, mesh)[instance][row->place];
    case SCOPE_SUPPORT: return &GK_OF(data, support)[instance][row->place];
    case SCOPE_SENSOR: return &GK_OF(data, sensor)[instance][row->place];
    case SCOPE_MODE: return GK_OF(data, oscillator) + data->amplitudes + instance;
    default: return &data->stage[row->place];
    }
}

static uint32_t reference_of(const gk_row *row, int instance)
{
    return (uint32_t)((row->scope == SCOPE_MODE ? MODES_FROM : INSTANCES * row->number) + instance);
}

/* starts that the model or its stage decides */
static double start_of(const gk_model *model, const gk_row *row, int instance)
{
    for (int i = 0; i < model->starts; i++)
        if ((uint32_t)model->start_reference[i] == reference_of(row, instance)) return model->start_value[i];
    if (row->scope == SCOPE_STAGE && row->place == V_SLICES) return model->slices;
    if (row->scope == SCOPE_MESH && row->place == V_BACKLASH) return model->engagement[instance].backlash;
    if (row->scope == SCOPE_MESH && row->place == V_DAMPING) return model->engagement[instance].damping;
    if (row->scope == SCOPE_MESH && row->place == V_PENALTY) return model->engagement[instance].penalty;
    return row->start;
}

/* ---- names ------------------------------------------------------------------------------------------------------- */
static const char *instance_name(const gk_model *model, const gk_row *row, int instance)
{
    switch (row->scope) {
    case SCOPE_SHAFT: return model->rotor_name[model->port[instance].rotor];
    case SCOPE_ROTOR: return model->rotor_name[instance];
    case SCOPE_MESH: return model->engagement[instance].name;
    case SCOPE_SUPPORT: return model->support_name[instance];
    case SCOPE_SENSOR: return model->sensor_name[instance];
    default: return "";
    }
}

static const gk_gear *observed_of(const gk_model *model, int instance)
{
    const gk_gear *found = NULL;
    for (int g = 0; g < model->gears; g++)
        if (model->gear[g].observed.name && model->gear[g].observed.from <= instance) found = &model->gear[g];
    return found;
}

/* number in the body of an amplitude's mode; −1 … −6: rigid motion */
static int number_of(const gk_model *model, int instance)
{
    const gk_observed *o = &observed_of(model, instance)->observed;
    const int i = instance - o->from;
    return i < o->own ? o->own_number[i] : o->number[i - o->own];
}

/* ring.motion.x, ring.mode_12 */
static void name_mode(char *out, size_t size, const gk_model *model, int instance)
{
    static const char *const motions[] = {"x", "y", "z", "rx", "ry", "rz"};
    const char *gear = observed_of(model, instance)->observed.name;
    const int number = number_of(model, instance);
    if (number < 0)
        snprintf(out, size, "%s.motion.%s", gear, motions[-number - 1]);
    else
        snprintf(out, size, "%s.mode_%d", gear, number);
}

static void expand(char *out, size_t size, const gk_model *model, const gk_row *row, int instance)
{
    if (row->scope == SCOPE_MODE) return name_mode(out, size, model, instance);
    const char *name = instance_name(model, row, instance);
    const int several = model->engagements > 1;
    size_t n = 0;
    for (const char *c = row->name; *c && n < size; c++)
        n += (size_t)(*c == '%'   ? snprintf(out + n, size - n, "%s", name)
                      : *c == '&' ? snprintf(out + n, size - n, "%s", model->displacement_name[instance])
                      : *c != '@' ? snprintf(out + n, size - n, "%c", *c)
                                  : snprintf(out + n, size - n, "%s%s", several ? name : "", several ? "." : ""));
}

/* ---- interface --------------------------------------------------------------------------------------------------- */
int gk_variable_count(const gk_model *model)
{
    GK_ASSERT(model);
    int count = 0;
    for (int i = 0; i < ROWS; i++)
        for (int k = 0; k < instances(model, TABLE[i].scope); k++) count += exists(model, &TABLE[i], k);
    return count;
}

/* shafts, rotors, supports, sensors, engagements one after the other, then the stage */
static const gk_row *listed(const gk_model *model, int index, int *instance)
{
    static const gk_scope order[SCOPES] = {SCOPE_SHAFT, SCOPE_ROTOR, SCOPE_SUPPORT, SCOPE_SENSOR,
                                           SCOPE_MESH,  SCOPE_STAGE, SCOPE_MODE};
    for (int s = 0; s < SCOPES; s++)
        for (int k = 0; k < instances(model, order[s]); k++)
            for (int i = 0; i < ROWS; i++)
                if (TABLE[i].scope == order[s] && exists(model, &TABLE[i], k) && index-- == 0)
                    return *instance = k, &TABLE[i];
    return NULL;
}

/* tilts and moments of a support have units of their own */
static const char *unit_of(const gk_model *model, const gk_row *row, int instance)
{
    if (row->scope == SCOPE_MODE) return number_of(model, instance) < -3 ? "rad" : row->unit;
    if (row->scope != SCOPE_SUPPORT) return row->unit;
    const char *direction = strrchr(model->support_name[instance], '.');
    if (!direction || direction[1] != 'm') return row->unit;
    return strcmp(row->unit, "N") ? "rad" : "N.m";
}

gk_outcome gk_variable(const gk_model *model, int index, gk_variable_info *info)
{
    GK_ASSERT(model && info);
    int instance;
    const gk_row *row = listed(model, index, &instance);
    if (!row) return GK_BAD_VARIABLE;
    memset(info, 0, sizeof *info);
    info->reference = reference_of(row, instance);
    info->type = row->type;
    info->causality = row->causality;
    expand(info->name, sizeof info->name, model, row, instance);
    snprintf(info->unit, sizeof info->unit, "%s", unit_of(model, row, instance));
    snprintf(info->items, sizeof info->items, "%s", row->items);
    snprintf(info->description, sizeof info->description, "%s", row->description);
    info->start = start_of(model, row, instance);
    info->minimum = row->minimum;
    info->maximum = row->maximum;
    return GK_OK;
}

void gk_vars_start(const gk_model *model, gk_data *data)
{
    GK_ASSERT(model && data);
    for (int i = 0; i < ROWS; i++)
        for (int k = 0; k < instances(model, TABLE[i].scope); k++)
            *value_of(data, &TABLE[i], k) = start_of(model, &TABLE[i], k);
}

static int in_range(const gk_row *row, double value)
{
    return gk_finite(value) && value >= row->minimum && value <= row->maximum &&
           (row->type == GK_REAL || value == (double)(int)value);
}

int gk_start_allowed(const gk_model *model, uint32_t reference, double value)
{
    GK_ASSERT(model);
    int instance;
    const gk_row *row = row_of(model, reference, &instance);
    return row && row->causality == GK_PARAMETER && in_range(row, value);
}

static gk_outcome acceptable(const gk_model *model, const gk_data *data, uint32_t reference, double value)
{
    int instance;
    const gk_row *row = row_of(model, reference, &instance);
    if (!row) return GK_BAD_VARIABLE;
    if (row->causality == GK_OUTPUT) return GK_BAD_CALL;
    if (row->causality == GK_PARAMETER && data->phase != PHASE_NEW) return GK_BAD_CALL;
    if (data->phase == PHASE_FAILED) return GK_BAD_CALL;
    return in_range(row, value) ? GK_OK : GK_BAD_VALUE;
}

gk_outcome gk_set_many(const gk_model *model, gk_data *data, const uint32_t *references, size_t count,
                       const double *values)
{
    GK_ASSERT(model && data && (!count || (references && values)));
    GK_ASSERT(data->magic == GK_DATA_MAGIC);
    for (size_t i = 0; i < count; i++) {
        gk_outcome outcome = acceptable(model, data, references[i], values[i]);
        if (outcome) return outcome;
    }
    for (size_t i = 0; i < count; i++) {
        int instance;
        const gk_row *row = row_of(model, references[i], &instance);
        *value_of(data, row, instance) = values[i];
    }
    return GK_OK;
}

/* values of all variables but parameters, from other data of the same model */
void gk_vars_take(const gk_model *model, gk_data *data, const gk_data *from)
{
    GK_ASSERT(model && data && from && data != from);
    GK_ASSERT(data->magic == GK_DATA_MAGIC && from->magic == GK_DATA_MAGIC);
    for (int i = 0; i < ROWS; i++)
        for (int k = 0; k < instances(model, TABLE[i].scope); k++)
            if (TABLE[i].causality != GK_PARAMETER)
                *value_of(data, &TABLE[i], k) = *value_of((gk_data *)(uintptr_t)from, &TABLE[i], k);
}

gk_outcome gk_set(const gk_model *model, gk_data *data, uint32_t reference, double value)
{
    return gk_set_many(model, data, &reference, 1, &value);
}

gk_outcome gk_get_many(const gk_model *model, const gk_data *data, const uint32_t *references, size_t count,
                       double *values)
{
    GK_ASSERT(model && data && (!count || (references && values)));
    for (size_t i = 0; i < count; i++) {
        int instance;
        const gk_row *row = row_of(model, references[i], &instance);
        if (!row) return GK_BAD_VARIABLE;
        values[i] = *value_of((gk_data *)(uintptr_t)data, row, instance);
    }
    return GK_OK;
}

gk_outcome gk_get(const gk_model *model, const gk_data *data, uint32_t reference, double *value)
{
    return gk_get_many(model, data, &reference, 1, value);
}

gk_effects gk_effects_of(const gk_data *data)
{
    GK_ASSERT(data && data->magic == GK_DATA_MAGIC);
    return (gk_effects){
#define GK_EFFECT(name, variable, needs, refusal) .name = data->stage[V_##variable] != 0.0,
#define GK_PART(name)
#include "model/gk_effects.inc"
#undef GK_EFFECT
#undef GK_PART
    };
}
