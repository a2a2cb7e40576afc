/* Array versions of gk_math.h for the tests. */
#include "base/gk_math.h"
#include <stddef.h>

void probe_exp(const double *x, double *y, size_t n)
{
    for (size_t i = 0; i < n; i++) y[i] = gk_exp(x[i]);
}
void probe_log(const double *x, double *y, size_t n)
{
    for (size_t i = 0; i < n; i++) y[i] = gk_log(x[i]);
}
void probe_acos(const double *x, double *y, size_t n)
{
    for (size_t i = 0; i < n; i++) y[i] = gk_acos(x[i]);
}
void probe_sin(const double *x, double *y, size_t n)
{
    double other;
    for (size_t i = 0; i < n; i++) gk_sincos(x[i], &y[i], &other);
}
void probe_cos(const double *x, double *y, size_t n)
{
    double other;
    for (size_t i = 0; i < n; i++) gk_sincos(x[i], &other, &y[i]);
}
void probe_atan2(const double *y, const double *x, double *angle, size_t n)
{
    for (size_t i = 0; i < n; i++) angle[i] = gk_atan2(y[i], x[i]);
}
