/* Dense symmetric systems. */
#include "base/gk_dense.h"
#include "base/gk_lanes.h"

/* Cholesky of a (n, n), in place, lower; 0 when not positive */
int gk_cholesky(double *a, int n)
{
    GK_ASSERT(a && n >= 0);
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = a[i * n + j];
            for (int k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
            if (i != j)
                a[i * n + j] = sum / a[j * n + j];
            else if (!(sum > 0.0))
                return 0;
            else
                a[i * n + i] = sqrt(sum);
        }
    return 1;
}

/* x ← (L Lᵀ)⁻¹ x */
void gk_cholesky_solve(const double *L, double *x, int n)
{
    GK_ASSERT(L && x && n >= 0);
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) x[i] -= L[i * n + k] * x[k];
        x[i] /= L[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) x[i] -= L[k * n + i] * x[k];
        x[i] /= L[i * n + i];
    }
}
