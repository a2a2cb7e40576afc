/* A pass: what forces of an island do to all of its rows (gk_pass.c). */
#ifndef GK_PASS_H
#define GK_PASS_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"

/* whose forces: those that were found last; the same with those at the start of the step at once; at the start, with
 * what dampers and friction do there */
typedef enum { PRESENT, FROM_START, ALONG_START } gk_moment;

static inline int gk_is_within(const gk_coupled *c, int e) { return c->setup->mesh[e].island == c->island; }

GK_HOT void gk_pass_forces(const gk_coupled *c, gk_moment when);
/* whole: what forces do in the step; at_once: what λ deflects */
GK_HOT void gk_pass(const gk_coupled *c, int whole, int at_once);
/* what a unit force of one row does at once to the rows of engagements before its own: moved[YIELDED]; of that what no
 * oscillator does: moved[WHOLE] */
GK_HOT void gk_pass_unit(const gk_coupled *c, int from, int row);
#endif
