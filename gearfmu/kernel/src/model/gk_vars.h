/* Variables by scope: V_STAGE_ENERGY is the place of energy.stored among the values of the stage. */
#ifndef GK_VARS_H
#define GK_VARS_H
#include "gk.h"
#include "model/gk_effects.h"

typedef enum gk_scope {
    SCOPE_STAGE,
    SCOPE_SHAFT,
    SCOPE_ROTOR,
    SCOPE_MESH,
    SCOPE_SUPPORT,
    SCOPE_SENSOR,
    SCOPE_MODE,
    SCOPES
} gk_scope;

/* places are counted from 0 in every scope */
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) V_##ID,
#define GK_VARS_END(SCOPE) SCOPE##_VARS, SCOPE##_ENDS = -1,
#include "model/gk_variables.inc"
#undef GK_VAR
#undef GK_VARS_END
};

void gk_vars_start(const gk_model *model, gk_data *data); /* all values */
/* may a parameter of this model start with this value? */
int gk_start_allowed(const gk_model *model, uint32_t reference, double value);

gk_effects gk_effects_of(const gk_data *data);
void gk_vars_take(const gk_model *model, gk_data *data, const gk_data *from);
#endif
