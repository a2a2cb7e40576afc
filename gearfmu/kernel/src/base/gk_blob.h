/* A blob: one checked block of named, constant arrays (written by gearfmu/stage/assembly/blob.py).
 * Opening checks magic, version, size, SHA-256, alignment, bounds and overlap of every section, and that every f64 and
 * f32 is finite; after that the accessors only look up. */
#ifndef GK_BLOB_H
#define GK_BLOB_H
#include "gk.h"

typedef struct gk_blob {
    const unsigned char *bytes;
    size_t size;
    uint32_t sections;
    char hash[65]; /* hex */
} gk_blob;

gk_outcome gk_blob_open(gk_blob *blob, const void *bytes, size_t size, char message[GK_MESSAGE]);
/* NULL (and *count = 0) when the section is absent or of another type. Names have at most 23 characters. */
const double *gk_blob_f64(const gk_blob *blob, const char *name, uint64_t *count);
const float *gk_blob_f32(const gk_blob *blob, const char *name, uint64_t *count);
const int32_t *gk_blob_i32(const gk_blob *blob, const char *name, uint64_t *count);
const char *gk_blob_text(const gk_blob *blob, const char *name,
                         uint64_t *count); /* UTF-8, ends with NUL (checked when opened) */
#endif
