/* Where arrays of gk_setup and gk_room lie (gk_layout.c). */
#ifndef GK_LAYOUT_H
#define GK_LAYOUT_H
#include "base/gk_bump.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

void gk_layout_plan(const gk_model *model, gk_setup *setup);
/* plans the largest setup of a model; returns its bytes behind the head */
size_t gk_layout_largest(const gk_model *model, gk_setup *setup);
/* modes: dynamic ones of every gear; ground: dynamic ground oscillators, padded */
void gk_layout_setup(const gk_model *model, gk_setup *setup, const int *modes, int ground);
void gk_layout_room(gk_bump *b, const gk_model *model, const gk_setup *setup, gk_room *room);
/* may flanks feel the ground group by patterns? */
int gk_layout_by_patterns(const gk_setup *setup);
#endif
