/* Elementary functions in plain IEEE double: + − × ÷ √, no fused operations, no libm, so the same bits on every
 * platform. Argument reductions after Cody and Waite (Software Manual for the Elementary Functions, 1980) with the
 * rounding error of each carried along as a second double, as in fdlibm (Sun, 1993). The polynomials are our own:
 * Chebyshev interpolation with 60 digits, printed by tests/kernel/minimax.py, where each truncation error stands below
 * 0.1 ulp of the result. Measured worst errors: tests/kernel/test_math.py. */
#include "base/gk_check.h"
#include "base/gk_math.h"
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if FLT_EVAL_METHOD != 0
#error "gk_math.c needs double arithmetic without excess precision (on 32-bit x86: -msse2 -mfpmath=sse)"
#endif

#define HORNER(c, x) horner((c), (int)(sizeof(c) / sizeof(c)[0]), (x))

static const double NOT_A_NUMBER = NAN;

/* c[0] + c[1] x + … */
static inline double horner(const double *c, int n, double x)
{
    double sum = c[n - 1];
    for (int i = n - 2; i >= 0; i--) sum = sum * x + c[i];
    return sum;
}

static inline uint64_t bits_of(double x)
{
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static inline double of_bits(uint64_t b)
{
    double x;
    memcpy(&x, &b, sizeof x);
    return x;
}

static inline double magnitude(double x) { return of_bits(bits_of(x) & (UINT64_MAX >> 1)); }
static inline int is_negative(double x) { return (int)(bits_of(x) >> 63); } /* −0 too */
static inline double with_sign_of(double x, double sign) { return is_negative(sign) ? -x : x; }
static inline double power_of_two(int n) { return of_bits((uint64_t)(n + 1023) << 52); } /* −1022 … 1023 */

/* nearest integer, ties to even, of |x| < 2^51 */
static inline double nearest(double x)
{
    const double shift = 0x1.8p52;
    return (x + shift) - shift;
}

/* exp r = 1 + r + r² EXP(r) on |r| ≤ ln 2 / 2; 2.6e-18 */
static const double EXP[] = {0x1.0000000000000p-1,  0x1.5555555555557p-3,  0x1.5555555555556p-5,  0x1.11111111100dfp-7,
                             0x1.6c16c16c162d6p-10, 0x1.a01a01abe6323p-13, 0x1.a01a01a6d7831p-16, 0x1.71de0237484cdp-19,
                             0x1.27e4db67ac2b0p-22, 0x1.af4ddda1c08cdp-26, 0x1.1f72fc83bcbc7p-29};

double gk_exp(double x)
{
    if (x != x) return x;
    if (x > 709.79) return HUGE_VAL;
    if (x < -745.14) return 0.0;
    double n = nearest(x * 0x1.71547652b82fep+0);
    double high = x - n * GK_LN2_HIGH, low = n * GK_LN2_LOW;
    double r = high - low;
    double tail = (high - r) - low;
    double y = 1.0 + (r + (tail + r * r * HORNER(EXP, r)));
    /* the first factor is exact, so a subnormal result is rounded once */
    int half = (int)n / 2;
    return y * power_of_two(half) * power_of_two((int)n - half);
}

double gk_log(double x)
{
    if (x == 0.0) return -HUGE_VAL;
    if (!(x > 0.0)) return NOT_A_NUMBER;
    if (x > DBL_MAX) return x;
    int exponent = 0;
    if (x < DBL_MIN) {
        x *= 0x1p54;
        exponent = -54;
    }
    /* x = 2^exponent m with m in [√½, √2): 0x95f62 is what the high word of √½ lacks to that of 1 */
    uint64_t b = bits_of(x) + ((uint64_t)0x95f62 << 32);
    exponent += (int)(b >> 52) - 1023;
    double m = of_bits((b & (UINT64_MAX >> 12)) + ((uint64_t)0x3fe6a09e << 32));
    /* log(1 + f) = f − f²/2 + s (f²/2 + R) keeps the leading terms exact */
    double f = m - 1.0, n = exponent;
    double s = f / (2.0 + f), z = s * s, half_square = 0.5 * f * f;
    double r = z * HORNER(GK_LOG, z);
    return n * GK_LN2_HIGH - ((half_square - (s * (half_square + r) + n * GK_LN2_LOW)) - f);
}

/* sin r = r + r z SIN(z), cos r = 1 − z/2 + z² COS(z), z = r², |r| ≤ π/4; 3.2e-17, 2.3e-18 */
static const double SIN[] = {-0x1.5555555555555p-3, 0x1.1111111110bb2p-7,   -0x1.a01a019e83aa2p-13,
                             0x1.71de379689090p-19, -0x1.ae600b01a40ccp-26, 0x1.5e0b1995f429ap-33};
static const double COS[] = {0x1.5555555555555p-5,   -0x1.6c16c16c16967p-10, 0x1.a01a019f4eafap-16,
                             -0x1.27e4fa17d9864p-22, 0x1.1eeb68e8b2372p-29,  -0x1.907da304ce77bp-37};
/* π/2 in pieces: 4 × 23 bits and a double; products with an integer below 2^30 are exact but for the last */
static const double PIO2[] = {0x1.921fb4p+0, 0x1.4442dp-24, 0x1.846988p-48, 0x1.8cc514p-72, 0x1.80dc1cd129025p-95};

/* a − b as its rounded value; what rounding lost is added to *lost (Knuth's two-sum) */
static inline double subtract(double a, double b, double *lost)
{
    double d = a - b;
    double bb = a - d;
    *lost += (a - (d + bb)) + (bb - b);
    return d;
}

/* x = n π/2 + r + tail. Multiples of π/2 come as near as 2^-57 to a double below 1e9; the relative error of r + tail is
 * below 2^-57 even there. */
static double reduce_by_half_pi(double x, double *r, double *tail)
{
    double n = nearest(x * 0x1.45f306dc9c883p-1);
    double lost = 0.0;
    double d = (x - n * PIO2[0]) - n * PIO2[1];
    d = subtract(d, n * PIO2[2], &lost);
    d = subtract(d, n * PIO2[3], &lost);
    lost -= n * PIO2[4];
    *r = d + lost;
    *tail = (d - *r) + lost;
    return n;
}

void gk_sincos(double x, double *sine, double *cosine)
{
    GK_ASSERT(sine && cosine && sine != cosine);
    if (!(magnitude(x) <= 1e9)) {
        *sine = *cosine = NOT_A_NUMBER;
        return;
    }
    double r, tail;
    int quadrant = (int)reduce_by_half_pi(x, &r, &tail) & 3;
    double z = r * r, half = 0.5 * z, one = 1.0 - half;
    double s = r - ((half * tail - r * z * HORNER(SIN, z)) - tail);
    double c = one + (((1.0 - one) - half) + (z * z * HORNER(COS, z) - r * tail));
    if (x == 0.0) s = x; /* keeps −0 */
    double near = quadrant & 1 ? c : s, far = quadrant & 1 ? s : c;
    *sine = quadrant & 2 ? -near : near;
    *cosine = (quadrant + 1) & 2 ? -far : far;
}

/* atan t = t + t z ATAN(z), z = t², |t| ≤ tan π/8; 4.5e-17 */
static const double ATAN[] = {-0x1.5555555555555p-2, 0x1.999999999934cp-3, -0x1.24924924361fep-3, 0x1.c71c71853d61ep-4,
                              -0x1.745d0b28a329ap-4, 0x1.3b126305e1a32p-4, -0x1.10fa77ab9c6d5p-4, 0x1.dfe64915a2d96p-5,
                              -0x1.a0999a3df6ef8p-5, 0x1.4162b9f87c419p-5, -0x1.3a31a292c6ad9p-6};
/* k π/4, k = 0 … 4, with what the double lacks */
static const double PIO4_HIGH[] = {0.0, 0x1.921fb54442d18p-1, 0x1.921fb54442d18p+0, 0x1.2d97c7f3321d2p+1,
                                   0x1.921fb54442d18p+1};
static const double PIO4_LOW[] = {0.0, 0x1.1a62633145c07p-55, 0x1.1a62633145c07p-54, 0x1.a79394c9e8a0ap-54,
                                  0x1.1a62633145c07p-53};

double gk_atan2(double y, double x)
{
    if (x != x || y != y) return x + y;
    double ax = magnitude(x), ay = magnitude(y);
    if (ax > DBL_MAX && ay > DBL_MAX) ax = ay = 1.0;
    if (ax > 0x1p1022 || ay > 0x1p1022) { /* so that their sum stays finite */
        ax *= 0x1p-2;
        ay *= 0x1p-2;
    }
    /* |y/x| or |x/y|, whichever is at most 1, or its angle to the diagonal: |t| ≤ tan π/8 */
    double small = ax < ay ? ax : ay, large = ax < ay ? ay : ax;
    int diagonal = small > 0x1.a827999fcef32p-2 * large;
    double t = diagonal ? (small - large) / (small + large) : large > 0.0 ? small / large : 0.0;
    /* angle = k π/4 ± atan t, in the quadrant of (x, y) */
    int mirrored = ax < ay, k = diagonal ? 1 : 0;
    if (mirrored) k = 2 - k;
    if (is_negative(x)) {
        mirrored = !mirrored;
        k = 4 - k;
    }
    if (mirrored) t = -t;
    double z = t * t;
    double angle = k == 0 ? t + t * z * HORNER(ATAN, z) : PIO4_HIGH[k] + (t + (t * z * HORNER(ATAN, z) + PIO4_LOW[k]));
    return with_sign_of(angle, y);
}

/* asin s = s + s z ASIN(z), z = s² ≤ 1/4; 2.2e-17 */
static const double ASIN[] = {0x1.5555555555556p-3, 0x1.3333333332ecap-4, 0x1.6db6db6e31f13p-5, 0x1.f1c71c1db0623p-6,
                              0x1.6e8bb1c8209a2p-6, 0x1.1c4d35cf95421p-6, 0x1.c9cf07674736ap-7, 0x1.782651caa6547p-7,
                              0x1.52420b04b37bep-7, 0x1.65a9c4dfcf8b2p-8, 0x1.1d189408314eep-6, -0x1.e6aaa8a0a04ccp-7,
                              0x1.d72b2bc8155f8p-6};

double gk_acos(double x)
{
    if (!(magnitude(x) <= 1.0)) return NOT_A_NUMBER;
    if (magnitude(x) < 0.5) {
        double z = x * x;
        return PIO4_HIGH[2] - (x - (PIO4_LOW[2] - x * z * HORNER(ASIN, z)));
    }
    /* acos |x| = 2 asin √z; √z with the half of its digits that the root rounds away */
    double z = 0.5 * (1.0 - magnitude(x));
    double s = sqrt(z);
    double head = of_bits(bits_of(s) & (UINT64_MAX << 32));
    double rest = s > 0.0 ? (z - head * head) / (s + head) : 0.0;
    double tail = s * z * HORNER(ASIN, z);
    return is_negative(x) ? PIO4_HIGH[4] - 2.0 * (s + (tail - PIO4_LOW[2])) : 2.0 * (head + (rest + tail));
}
