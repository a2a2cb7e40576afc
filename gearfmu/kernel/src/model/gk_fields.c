/* Sections of the blob by the table of fields: their names from scope and numbers, their lengths from dimensions. */
#include "model/gk_fields.h"
#include "base/gk_check.h"
#include <stdio.h>
#include <string.h>

typedef enum { MODEL, GEAR, SET, GEAR_SET } field_scope;
typedef enum { F64, F32, I32, TEXT } field_type;
typedef struct field {
    field_scope scope;
    const char *name;
    field_type type;
    const char *dimensions;
} field;

static const field TABLE[GK_FIELDS] = {
#define GK_FIELD(SCOPE, ID, TYPE, DIMENSIONS, UNIT, DESCRIPTION) {SCOPE, #ID, TYPE, DIMENSIONS},
#include "model/gk_fields.inc"
#undef GK_FIELD
};

#define WORD(name) #name,
static const char *const WORDS[SYMBOLS] = {GK_SYMBOLS(WORD)};

static void section_name(const field *f, const gk_shape *shape, char out[32])
{
    switch (f->scope) {
    case GEAR: snprintf(out, 32, "%s%d", f->name, shape->gear); break;
    case SET: snprintf(out, 32, "%s%d", f->name, shape->set); break;
    case GEAR_SET: snprintf(out, 32, "%s%d_%d", f->name, shape->gear, shape->set); break;
    default: snprintf(out, 32, "%s", f->name);
    }
}

static const void *section(const gk_blob *blob, const field *f, const gk_shape *shape, uint64_t *count)
{
    char name[32];
    section_name(f, shape, name);
    return f->type == F64   ? (const void *)gk_blob_f64(blob, name, count)
           : f->type == F32 ? (const void *)gk_blob_f32(blob, name, count)
           : f->type == I32 ? (const void *)gk_blob_i32(blob, name, count)
                            : (const void *)gk_blob_text(blob, name, count);
}

/* next factor of the dimensions: a number or what a word stands for */
static uint64_t factor(const char **at, const gk_shape *shape)
{
    uint64_t number = 0;
    size_t length = strcspn(*at, " ");
    const char *word = *at;
    *at += length;
    while (**at == ' ') ++*at;
    for (int i = 0; i < SYMBOLS; i++)
        if (strlen(WORDS[i]) == length && !memcmp(WORDS[i], word, length)) return shape->size[i];
    for (size_t i = 0; i < length; i++) number = 10 * number + (uint64_t)(word[i] - '0');
    return number;
}

uint64_t gk_field_count(const gk_blob *blob, int which, const gk_shape *shape)
{
    GK_ASSERT(blob && shape && which >= 0 && which < GK_FIELDS);
    uint64_t count = 0;
    section(blob, &TABLE[which], shape, &count);
    return count;
}

const char *gk_field_name(int which)
{
    GK_ASSERT(which >= 0 && which < GK_FIELDS);
    return TABLE[which].name;
}

const void *gk_field_find(const gk_blob *blob, int which, const gk_shape *shape, const char **wrong)
{
    GK_ASSERT(blob && shape && wrong);
    GK_ASSERT(which >= 0 && which < GK_FIELDS);
    static const double nothing = 0.0;
    const field *f = &TABLE[which];
    const char *at = f->dimensions;
    const int optional = *at == '?';
    uint64_t wanted = 1, count = 0;
    const void *found = section(blob, f, shape, &count);
    *wrong = NULL;
    if (!found && optional) return NULL;
    if (f->type == TEXT) return *wrong = found ? NULL : "is missing", found;
    for (at += optional; *at;) wanted *= factor(&at, shape);
    if (!found && wanted) return *wrong = "is missing", NULL;
    if (count != wanted) return *wrong = "has the wrong length", NULL;
    return wanted ? found : &nothing;
}
