/* Checks of what the code itself guarantees: where functions that other files call begin, and in accessors. They are
 * active in builds with -DGK_CHECK and absent from the product. Data from outside (blobs, values, saved states) are
 * refused with an outcome instead. */
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
