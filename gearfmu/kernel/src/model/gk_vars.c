/* Variables by value reference: one table (gk_variables.inc) decides names, ranges and which of them exist in a model.
 */
#include "model/gk_core.h"

typedef enum { ALWAYS, SPRING, TORQUE, FIXED, SPRING_OR_FIXED, CHAIN } gk_exists;
typedef struct gk_row {
    int shaft;
    const char *name;
    gk_type type;
    gk_causality causality;
    gk_exists exists;
    const char *unit;
    double start, minimum, maximum;
    const char *items, *description;
} gk_row;

enum { SHAFT_OF_0 = 0, SHAFT_OF_1 = 1, SHAFT_OF_M = 0 };
static const gk_row TABLE[GK_VARS] = {
#define GK_VAR(S, ID, NAME, TYPE, CAUSALITY, EXISTS, UNIT, START, MIN, MAX, ITEMS, TEXT)                               \
    {SHAFT_OF_##S, NAME, TYPE, CAUSALITY, EXISTS, UNIT, START, MIN, MAX, ITEMS, TEXT},
#include "model/gk_variables.inc"
#undef GK_VAR
};

static int exists(const gk_model *model, int reference)
{
    const gk_row *row = &TABLE[reference];
    const gk_port *port = &model->port[row->shaft];
    switch (row->exists) {
    case ALWAYS: return 1;
    case SPRING: return port->kind == PORT_SPRING;
    case TORQUE: return port->kind == PORT_TORQUE;
    case FIXED: return port->kind == PORT_FIXED;
    case SPRING_OR_FIXED: return port->kind != PORT_TORQUE;
    case CHAIN: return port->chain;
    }
    return 0;
}

/* starts that the stage decides */
static double start_of(const gk_model *model, int reference)
{
    switch (reference) {
    case V_M_SLICES: return model->slices;
    case V_M_BACKLASH: return model->backlash;
    case V_M_DAMPING: return model->damping;
    default: return TABLE[reference].start;
    }
}

static void expand(char *out, size_t size, const char *pattern, const char *shaft)
{
    size_t n = 0;
    for (; *pattern && n + 1 < size; pattern++) {
        if (*pattern != '%')
            out[n++] = *pattern;
        else
            for (const char *c = shaft; *c && n + 1 < size; c++) out[n++] = *c;
    }
    out[n] = 0;
}

int gk_variable_count(const gk_model *model)
{
    int count = 0;
    for (int i = 0; i < GK_VARS; i++) count += exists(model, i);
    return count;
}

gk_outcome gk_variable(const gk_model *model, int index, gk_variable_info *info)
{
    for (int i = 0; i < GK_VARS; i++) {
        if (!exists(model, i) || index-- > 0) continue;
        const gk_row *row = &TABLE[i];
        memset(info, 0, sizeof *info);
        info->reference = (uint32_t)i;
        info->type = row->type;
        info->causality = row->causality;
        expand(info->name, sizeof info->name, row->name, model->shaft[row->shaft]);
        expand(info->unit, sizeof info->unit, row->unit, "");
        expand(info->items, sizeof info->items, row->items, "");
        expand(info->description, sizeof info->description, row->description, "");
        info->start = start_of(model, i);
        info->minimum = row->minimum;
        info->maximum = row->maximum;
        return GK_OK;
    }
    return GK_BAD_VARIABLE;
}

gk_outcome gk_defaults(const gk_model *model, gk_data *data)
{
    memset(data, 0, gk_data_size(model));
    data->magic = GK_DATA_MAGIC;
    data->phase = PHASE_NEW;
    for (int i = 0; i < GK_VARS; i++) data->value[i] = start_of(model, i);
    return GK_OK;
}

static gk_outcome acceptable(const gk_model *model, const gk_data *data, uint32_t reference, double value)
{
    if (reference >= GK_VARS || !exists(model, (int)reference)) return GK_BAD_VARIABLE;
    const gk_row *row = &TABLE[reference];
    if (row->causality == GK_OUTPUT) return GK_BAD_CALL;
    if (row->causality == GK_PARAMETER && data->phase != PHASE_NEW) return GK_BAD_CALL;
    if (data->phase == PHASE_FAILED) return GK_BAD_CALL;
    if (!gk_finite(value) || value < row->minimum || value > row->maximum) return GK_BAD_VALUE;
    if (row->type != GK_REAL && value != (double)(int)value) return GK_BAD_VALUE;
    return GK_OK;
}

gk_outcome gk_set_many(const gk_model *model, gk_data *data, const uint32_t *references, size_t count,
                       const double *values)
{
    for (size_t i = 0; i < count; i++) {
        gk_outcome outcome = acceptable(model, data, references[i], values[i]);
        if (outcome) return outcome;
    }
    for (size_t i = 0; i < count; i++) data->value[references[i]] = values[i];
    return GK_OK;
}

gk_outcome gk_set(const gk_model *model, gk_data *data, uint32_t reference, double value)
{
    return gk_set_many(model, data, &reference, 1, &value);
}

gk_outcome gk_get_many(const gk_model *model, const gk_data *data, const uint32_t *references, size_t count,
                       double *values)
{
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= GK_VARS || !exists(model, (int)references[i])) return GK_BAD_VARIABLE;
        values[i] = data->value[references[i]];
    }
    return GK_OK;
}

gk_outcome gk_get(const gk_model *model, const gk_data *data, uint32_t reference, double *value)
{
    return gk_get_many(model, data, &reference, 1, value);
}

gk_effects gk_effects_of(const gk_data *data)
{
    const double *v = data->value;
    gk_effects on = {v[V_M_E_ELASTIC] != 0,       v[V_M_E_RESIDUAL] != 0,   v[V_M_E_LOCAL] != 0,  v[V_M_E_COAST] != 0,
                     v[V_M_E_DAMPING] != 0,       v[V_M_E_RELIEF] != 0,     v[V_M_E_CORNER] != 0, v[V_M_E_BEARING] != 0,
                     v[V_M_E_MODAL_DAMPING] != 0, v[V_M_E_ROLL_MOTION] != 0};
    return on;
}
