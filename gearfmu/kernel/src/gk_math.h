/* Elementary functions of our own: the same bits on every platform (libm differs in the last bit between C libraries and CPUs).
 * Double precision, error ≤ 2 ulp over the stated range; no tables from the outside, no branches on CPU features. sqrt comes from the compiler (IEEE exact). */
#ifndef GK_MATH_H
#define GK_MATH_H
double gk_exp(double x);                              /* −745 … 709; 0 below, +inf above; subnormal results too */
double gk_log(double x);                              /* x > 0 (subnormals too); −inf at 0, NaN below          */
void gk_sincos(double x, double *sine, double *cosine); /* |x| ≤ 1e9: Cody–Waite reduction by π/2; NaN beyond */
double gk_atan2(double y, double x);                  /* (−π, π], signed zeros and infinities as in C99        */
double gk_acos(double x);                             /* −1 … 1; NaN outside                                  */
#endif
