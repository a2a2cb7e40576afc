/* Checks of what the code itself guarantees: at the doors of functions that other files call, and in accessors. They are
 * active in builds with -DGK_CHECK and nothing in the product. What comes from outside (blobs, values, saved states) is
 * no matter for GK_ASSERT: it is refused with an outcome. */
#ifndef GK_CHECK_H
#define GK_CHECK_H
#ifdef GK_CHECK
#include <stdio.h>
#include <stdlib.h>

/* ends the process */
static inline void gk_check_failed(const char *file, int line, const char *condition)
{
    fprintf(stderr, "%s:%d: GK_ASSERT(%s) failed\n", file, line, condition);
    abort();
}
#define GK_ASSERT(condition) ((condition) ? (void)0 : gk_check_failed(__FILE__, __LINE__, #condition))
#else
#define GK_ASSERT(condition) ((void)0)
#endif
#endif
