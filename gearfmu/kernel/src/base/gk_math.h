/* Elementary functions of our own: the same bits on every platform (libm differs in the last bit between C libraries
 * and CPUs). Double precision, error ≤ 2 ulp over the stated range; no tables from the outside, no branches on CPU
 * features. sqrt comes from the compiler (IEEE exact). */
#ifndef GK_MATH_H
#define GK_MATH_H
double gk_exp(double x);                                /* −745 … 709; 0 below, +inf above; subnormal results too */
double gk_log(double x);                                /* x > 0 (subnormals too); −inf at 0, NaN below          */
void gk_sincos(double x, double *sine, double *cosine); /* |x| ≤ 1e9: Cody–Waite reduction by π/2; NaN beyond */
double gk_atan2(double y, double x);                    /* (−π, π], signed zeros and infinities as in C99        */
double gk_acos(double x);                               /* −1 … 1; NaN outside                                  */

/* for logarithms of four numbers at once (gk_law.c) */
#define GK_LN2_HIGH 0x1.62e42fefp-1 /* 32 bits, so n·GK_LN2_HIGH is exact */
#define GK_LN2_LOW 0x1.473de6af278edp-34
/* log((1 + s)/(1 − s)) = 2 s + s z LOG(z), z = s², |s| ≤ (√2 − 1)/(√2 + 1); 3.2e-16 */
static const double GK_LOG[7] = {0x1.5555555555558p-1, 0x1.99999999952e2p-2, 0x1.2492492df14bcp-2, 0x1.c71c62e57c3c4p-3,
                                 0x1.7462b4ac441afp-3, 0x1.39fe604146b74p-3, 0x1.2b584c6b42d60p-3};
#endif
