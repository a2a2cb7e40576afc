/* The functions through which a step is reached, by the vectors they are compiled for. */
#ifndef GK_WIDE_H
#define GK_WIDE_H
#include "integrate/gk_closed.h"
#include "integrate/gk_integrate.h"
#include "model/gk_data.h"
#include "run/gk_run.h"
#include "setup/gk_patterns.h"
#include "setup/gk_setup.h"
#include "setup/gk_tables.h"

typedef struct gk_hot {
    gk_step_function *step[CENTRAL + 1]; /* by integrator */
    gk_tally_function *count;
    gk_fill_function *fill;
    gk_moves_function *moves;
    gk_supports_function *supports;
    gk_keep_function *keep;
    gk_holds_function *holds;
    gk_patterns_function *patterns;
} gk_hot;
#define GK_HOT_FUNCTIONS                                                                                               \
    {{gk_step_once, gk_step_once, gk_rk45_step, gk_central_step},                                                      \
     gk_tally_count,                                                                                                   \
     gk_side_fill,                                                                                                     \
     gk_side_step,                                                                                                     \
     gk_supports_by_motion,                                                                                            \
     gk_closed_keep,                                                                                                   \
     gk_closed_holds,                                                                                                  \
     gk_patterns_find}

/* those in the widest vectors of this processor; NULL: the baseline's */
const gk_hot *gk_wide(void);
#endif
