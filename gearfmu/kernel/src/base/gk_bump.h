/* Memory of one block, handed out twice by the same code: first counting (base NULL), then for real. */
#ifndef GK_BUMP_H
#define GK_BUMP_H
#include "base/gk_lanes.h"
#include <stdint.h>

typedef struct gk_bump {
    char *base;
    size_t used;
} gk_bump;

static inline void *gk_bump_take(gk_bump *b, size_t bytes)
{
    void *p = b->base ? b->base + b->used : NULL;
    b->used += (bytes + 63) / 64 * 64;
    return p;
}

static inline double *gk_bump_doubles(gk_bump *b, size_t count) { return gk_bump_take(b, count * sizeof(double)); }
static inline gk_real *gk_bump_reals(gk_bump *b, size_t count) { return gk_bump_take(b, count * sizeof(gk_real)); }

/* arrays begin behind the head of a block */
static inline char *gk_bump_behind(void *block, size_t size)
{
    return (char *)(((uintptr_t)block + size + 63) / 64 * 64);
}
#endif
