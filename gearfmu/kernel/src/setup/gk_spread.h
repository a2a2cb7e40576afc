/* Tables of a gear's flanks on the even grid of rolls (gk_spread.c). */
#ifndef GK_SPREAD_H
#define GK_SPREAD_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_model.h"

/* Rows of a gear on the even grid of rolls (gk_spread.c): (2 flanks, rolls, functions, …) of modes of the gear group,
 * of those of nodal diameter 0 and 1, along the normal and along the profile; of the node (3 parts before the flanks,
 * 6), of ports and of the patterns of far teeth. NULL: unknown */
typedef struct gk_flank_tables {
    gk_real *rows, *low, *along_rows, *along_low, *node, *port, *far;
} gk_flank_tables;

enum { FURTHER = OFFSETS / 2, ACROSS = 1 + 2 * FURTHER };
/* Compliances of a gear on the even grid of rolls, blocks (rolls, rolls, functions, functions), loaded place first: of
 * a flank by its own load, of the same flank 1 … FURTHER teeth further, of the other flank: of the same tooth from
 * flank 0, then of those further from flank 0 and from flank 1. Of a mirrored gear those that begin at flank 0. */
typedef struct gk_compliance {
    gk_real *own[2], *next[2][FURTHER], *across[ACROSS];
    gk_real *along_normal[2][2], *along_own[2], *along_across;
} gk_compliance;

/* the first gear whose tables are those of gear g */
int gk_spread_leader(const gk_model *model, int g);
/* rows of gear g into the setup */
void gk_spread_rows(const gk_model *model, gk_setup *setup, int g);
/* scratch of gk_spread_compliance: doubles, and numbers of the blocks that it makes */
size_t gk_spread_scratch(const gk_model *model, size_t *reals);
/* compliances of gear g, whose blocks lie in `blocks` */
void gk_spread_compliance(const gk_model *model, const gk_setup *setup, int g, double *scratch, gk_real *blocks,
                          gk_compliance *to);
#endif
