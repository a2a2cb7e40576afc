/* Face of gk_blob.h for the tests: open a blob, copy its hash, look every name up under every type and add up all it
 * holds. */
#include "base/gk_blob.h"
#include <string.h>

int probe_blob_open(const void *bytes, size_t size, char *message, char *hash, uint32_t *sections)
{
    gk_blob blob;
    gk_outcome outcome = gk_blob_open(&blob, bytes, size, message);
    memcpy(hash, blob.hash, sizeof blob.hash);
    *sections = blob.sections;
    return outcome;
}

/* sum of the elements of section `name` under type 1, 2, 3, 4; *count = UINT64_MAX when absent */
int probe_blob_sum(const void *bytes, size_t size, const char *name, int type, double *sum, uint64_t *count)
{
    char message[GK_MESSAGE];
    gk_blob blob;
    gk_outcome outcome = gk_blob_open(&blob, bytes, size, message);
    *sum = 0;
    *count = UINT64_MAX;
    if (outcome != GK_OK) return outcome;
    uint64_t n = 0;
    const double *f = type == 1 ? gk_blob_f64(&blob, name, &n) : NULL;
    const int32_t *k = type == 2 ? gk_blob_i32(&blob, name, &n) : NULL;
    const char *t = type == 3 ? gk_blob_text(&blob, name, &n) : NULL;
    const float *s = type == 4 ? gk_blob_f32(&blob, name, &n) : NULL;
    for (uint64_t i = 0; i < n; i++) *sum += f ? f[i] : k ? k[i] : s ? (double)s[i] : t[i];
    if (f || k || s || t) *count = n;
    return GK_OK;
}
