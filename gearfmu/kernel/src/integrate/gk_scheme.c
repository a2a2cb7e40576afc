/* What every integrator is: the one place where they differ in more than their own file. */
#include "integrate/gk_integrate.h"

const gk_scheme *gk_scheme_of(gk_integrator integrator)
{
    GK_ASSERT(integrator >= DG4 && integrator <= CENTRAL);
    static const gk_scheme schemes[] = {
        [DG4] = {.corrected = 1},
        [MIX4] = {.linear_force = 1},
        [EM] = {0},
        [RK45] = {.is_explicit = 1, .adaptive = 1},
        [CENTRAL] = {.is_explicit = 1},
    };
    return &schemes[integrator];
}
