/* Sizes, names and words of a model: bits of the status, outcomes. */
#include "model/gk_model.h"

size_t gk_model_size(void) { return sizeof(gk_model); }
const char *gk_model_name(const gk_model *model)
{
    GK_ASSERT(model);
    return model->name;
}
const char *gk_model_hash(const gk_model *model)
{
    GK_ASSERT(model);
    return model->blob.hash;
}
const char *gk_model_guid(const gk_model *model)
{
    GK_ASSERT(model);
    return model->guid;
}
int gk_abi(void) { return GK_ABI; }

const char *gk_status_text(int bit)
{
    static const char *const text[] = {
        "local contact law beyond its range",
        "fallback scheme in use",
        "limit of iterations reached",
        "gamma lowered: forces are damped more",
        "a loaded flank ended although effect.tip_contact is off",
        "mesh force beyond torque_max, for which the model is made",
        "speed beyond speed_max, for which the model is made",
        "gears were accelerated abruptly in the first step: set speeds before the initialisation ends",
    };
    return bit >= 0 && bit < (int)(sizeof text / sizeof *text) ? text[bit] : NULL;
}

const char *gk_outcome_text(gk_outcome outcome)
{
    static const char *const text[GK_OUTCOMES] = {
        "ok",
        "bad model blob",
        "no such variable in this model",
        "value refused: not finite or out of range",
        "call not allowed now",
        "communication step refused: not positive, not finite or not at the current time",
        "internal step too large for this model",
        "no static equilibrium found for the start",
        "diverged: the state is not finite, or rk45 needs endless steps, even with the fallback scheme",
        "tooth penetration exceeds the validity range of the contact model",
        "energy balance broken"};
    return (int)outcome >= 0 && outcome < GK_OUTCOMES ? text[outcome] : "unknown outcome";
}
