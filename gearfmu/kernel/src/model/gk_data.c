/* Where the arrays of gk_data lie: their sizes are the model's. */
#include "model/gk_data.h"

void gk_data_plan(const gk_model *model, uint32_t at[ARRAYS])
{
    GK_ASSERT(model && at);
    const int spins = model->rotors + 2 * model->chains;
    size_t used = 0;
#define GK_ARRAY(name, type, count)                                                                                    \
    at[OF_##name] = (uint32_t)used;                                                                                    \
    used += ((size_t)(count) * sizeof(gk_of_##name) + sizeof(double) - 1) / sizeof(double);
    GK_ARRAYS
#undef GK_ARRAY
}
