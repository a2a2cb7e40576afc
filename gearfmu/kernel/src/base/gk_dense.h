/* Dense symmetric systems (gk_dense.c). */
#ifndef GK_DENSE_H
#define GK_DENSE_H
int gk_cholesky(double *a, int n);
void gk_cholesky_solve(const double *L, double *x, int n);
#endif
