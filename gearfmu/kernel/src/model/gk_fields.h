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
/* clang-format off */
#define GK_SYMBOLS(S)                                                                                                  \
    S(rotors) S(gears) S(engagements) S(ports) S(supports) S(functions) S(rolls) S(z) S(modes) S(reads)     \
    S(ground) S(carried) S(whirls) S(own) S(starts) S(flank_teeth) S(flank_places) S(flank_rolls)                      \
    S(sensors) /* directions of points of the housing */                                                               \
    S(points) /* of a flank where rows are stored */                                                                   \
    S(low)    /* modes of nodal diameter 0 and 1 */                                                                    \
    S(flanks) /* with tables of their own */                                                                           \
    S(places) /* points times width functions */                                                                       \
    S(half)   /* pairs of places, each once */                                                                         \
    S(across) /* numbers of a table between both flanks */
/* clang-format on */
#define GK_SYMBOL(name) SYMBOL_##name,
typedef enum gk_symbol { GK_SYMBOLS(GK_SYMBOL) SYMBOLS } gk_symbol;
#undef GK_SYMBOL

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
