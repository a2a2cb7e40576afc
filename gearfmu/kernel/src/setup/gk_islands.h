/* Islands: which engagements act on each other within a step. */
#ifndef GK_ISLANDS_H
#define GK_ISLANDS_H
#include "gk.h"
#include "setup/gk_setup.h"

/* numbers the island of every engagement */
void gk_islands_find(const gk_model *model, gk_setup *setup);
#endif
