/* Tables of the sides of engagements: which teeth they are of, and what making them takes. */
#ifndef GK_TABLES_H
#define GK_TABLES_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_model.h"
#include "setup/gk_room.h"
#include "setup/gk_setup.h"

/* sides whose tables have much in common (gk_side_twins): which of their engagements */
typedef struct gk_twins {
    int count, engagement[2 * MAX_ENGAGEMENTS], which[2 * MAX_ENGAGEMENTS];
} gk_twins;

typedef void gk_fill_function(const gk_model *model, gk_setup *setup, gk_room *room, const gk_twins *twins);
/* gk_tables.c */
GK_HOT gk_fill_function gk_side_fill;
/* gk_side.c */
void gk_side_plan(const gk_model *model, const gk_setup *setup, int e, gk_side *side, int which);
int gk_side_twins(const gk_model *model, int e, int f);
size_t gk_side_scratch(const gk_model *model);
/* gk_moves.c: tables of a step; doubles of what it has in hand */
GK_HOT gk_moves_function gk_side_step;
size_t gk_moves_scratch(size_t points, size_t lanes, size_t ground);
#endif
