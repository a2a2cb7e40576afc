/* The table of the blob's arrays (gk_fields.inc): finding one and checking its length. */
#ifndef GK_FIELDS_H
#define GK_FIELDS_H
#include "base/gk_blob.h"

enum {
#define GK_FIELD(SCOPE, ID, ...) F_##SCOPE##_##ID,
#include "model/gk_fields.inc"
#undef GK_FIELD
    GK_FIELDS
};

/* what a word in the dimensions of a field means; 0 until it is known */
typedef enum gk_symbol {
    SYMBOL_rotors,
    SYMBOL_gears,
    SYMBOL_engagements,
    SYMBOL_ports,
    SYMBOL_supports,
    SYMBOL_dampers,
    SYMBOL_functions,
    SYMBOL_rolls,
    SYMBOL_z,
    SYMBOL_modes,
    SYMBOL_reads,
    SYMBOL_ground,
    SYMBOL_carried,
    SYMBOL_whirls,
    SYMBOL_own,
    SYMBOL_starts,
    SYMBOL_flank_teeth,
    SYMBOL_flank_places,
    SYMBOL_flank_rolls,
    SYMBOL_points, /* of a flank where rows are stored */
    SYMBOL_low,    /* modes of nodal diameter 0 and 1 */
    SYMBOL_flanks, /* with tables of their own */
    SYMBOL_places, /* points times width functions */
    SYMBOL_half,   /* pairs of places, each once */
    SYMBOL_across, /* numbers of a table between both flanks */
    SYMBOLS
} gk_symbol;

typedef struct gk_shape {
    uint64_t size[SYMBOLS];
    int gear, set; /* the one that is read, by scope */
} gk_shape;

/* The array of a field; *wrong: why it cannot be used (missing, wrong length), else NULL. An optional array that is
 * absent is NULL without a reason. An empty array is not NULL. */
const void *gk_field_find(const gk_blob *blob, int field, const gk_shape *shape, const char **wrong);
/* elements that the section of a field has, whatever is wanted */
uint64_t gk_field_count(const gk_blob *blob, int field, const gk_shape *shape);
const char *gk_field_name(int field);
#endif
