/* What engagements of an island do to each other (gk_give.c). */
#ifndef GK_GIVE_H
#define GK_GIVE_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"

/* all that forces do to gaps in the step; their deflection at once alone, under those at the end or at the start; at
 * the start with what dampers and friction do there */
typedef enum { WHOLE, AT_ONCE, AT_START, WHOLE_START } gk_effect;

static inline int gk_is_within(const gk_coupled *c, int e) { return c->setup->mesh[e].island == c->island; }

GK_HOT void gk_give(const gk_coupled *c, int e, gk_effect of);
GK_HOT void gk_give_all(const gk_coupled *c, gk_effect of);
/* adds what the others do to the rows of an engagement; at_once: their forces in the step are 0 */
GK_HOT void gk_take(const gk_coupled *c, int e, int at_once, double *read);
GK_HOT void gk_take_along(const gk_coupled *c, int e, double *read);
/* gives a unit force of one row, acting at once, and nothing else; what that does to the rows of another engagement */
GK_HOT void gk_give_unit(const gk_coupled *c, int from, int row);
GK_HOT void gk_take_given(const gk_coupled *c, int to, double *read);
#endif
