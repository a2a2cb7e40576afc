/* Variables by scope: V_STAGE_ENERGY is the place of energy.stored among the values of the stage. */
#ifndef GK_VARS_H
#define GK_VARS_H
#include "gk.h"
#include "model/gk_effects.h"

typedef enum gk_scope { SCOPE_STAGE, SCOPE_SHAFT, SCOPE_ROTOR, SCOPE_MESH, SCOPE_SUPPORT, SCOPE_MODE, SCOPES } gk_scope;

/* one enumeration a scope: the rows of the other scopes count as nothing */
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_STAGE_##SCOPE(ID)
#define GK_IN_STAGE_STAGE(ID) V_##ID,
#define GK_IN_STAGE_SHAFT(ID)
#define GK_IN_STAGE_ROTOR(ID)
#define GK_IN_STAGE_MESH(ID)
#define GK_IN_STAGE_MODE(ID)
#define GK_IN_STAGE_SUPPORT(ID)
#include "model/gk_variables.inc"
#undef GK_VAR
    STAGE_VARS
};
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_SHAFT_##SCOPE(ID)
#define GK_IN_SHAFT_STAGE(ID)
#define GK_IN_SHAFT_SHAFT(ID) V_##ID,
#define GK_IN_SHAFT_ROTOR(ID)
#define GK_IN_SHAFT_MESH(ID)
#define GK_IN_SHAFT_MODE(ID)
#define GK_IN_SHAFT_SUPPORT(ID)
#include "model/gk_variables.inc"
#undef GK_VAR
    SHAFT_VARS
};
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_ROTOR_##SCOPE(ID)
#define GK_IN_ROTOR_STAGE(ID)
#define GK_IN_ROTOR_SHAFT(ID)
#define GK_IN_ROTOR_ROTOR(ID) V_##ID,
#define GK_IN_ROTOR_MESH(ID)
#define GK_IN_ROTOR_MODE(ID)
#define GK_IN_ROTOR_SUPPORT(ID)
#include "model/gk_variables.inc"
#undef GK_VAR
    ROTOR_VARS
};
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_MESH_##SCOPE(ID)
#define GK_IN_MESH_STAGE(ID)
#define GK_IN_MESH_SHAFT(ID)
#define GK_IN_MESH_ROTOR(ID)
#define GK_IN_MESH_MESH(ID) V_##ID,
#define GK_IN_MESH_MODE(ID)
#define GK_IN_MESH_SUPPORT(ID)
#include "model/gk_variables.inc"
#undef GK_VAR
    MESH_VARS
};
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_SUPPORT_##SCOPE(ID)
#define GK_IN_SUPPORT_STAGE(ID)
#define GK_IN_SUPPORT_SHAFT(ID)
#define GK_IN_SUPPORT_ROTOR(ID)
#define GK_IN_SUPPORT_MESH(ID)
#define GK_IN_SUPPORT_MODE(ID)
#define GK_IN_SUPPORT_SUPPORT(ID) V_##ID,
#include "model/gk_variables.inc"
#undef GK_VAR
    SUPPORT_VARS
};
enum {
#define GK_VAR(SCOPE, NUMBER, ID, ...) GK_IN_MODE_##SCOPE(ID)
#define GK_IN_MODE_STAGE(ID)
#define GK_IN_MODE_SHAFT(ID)
#define GK_IN_MODE_ROTOR(ID)
#define GK_IN_MODE_MESH(ID)
#define GK_IN_MODE_SUPPORT(ID)
#define GK_IN_MODE_MODE(ID) V_##ID,
#include "model/gk_variables.inc"
#undef GK_VAR
    MODE_VARS
};

/* may a parameter of this model start with this value? */
int gk_start_allowed(const gk_model *model, uint32_t reference, double value);

gk_effects gk_effects_of(const gk_data *data);
void gk_vars_take(const gk_model *model, gk_data *data, const gk_data *from);
#endif
