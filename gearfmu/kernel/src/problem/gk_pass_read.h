/* The second half of a pass: what rows of an engagement read (gk_pass_read.c). */
#ifndef GK_PASS_READ_H
#define GK_PASS_READ_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "problem/gk_work.h"

/* what rows of an engagement read: WHOLE or YIELDED; far: of far teeth */
GK_HOT void gk_pass_read(const gk_coupled *c, int e, int t, const double *far);
/* what the sliding of its contacts reads */
GK_HOT void gk_pass_read_along(const gk_coupled *c, int e);
/* what its rows read at once, in moved[YIELDED]; of that what no oscillator does, in moved[WHOLE] */
GK_HOT void gk_pass_read_unit(const gk_coupled *c, int e);
#endif
