/* Small arithmetic: numbers without the C library, sums in fixed lanes. */
#ifndef GK_LANES_H
#define GK_LANES_H
#include "base/gk_check.h"
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef GK_DOUBLE_MODES
typedef double gk_real; /* test build: modal states and rows of the gear groups in double */
typedef int64_t gk_whole;
#define GK_SIGN INT64_MIN
#else
typedef float gk_real;
typedef int32_t gk_whole;
#define GK_SIGN INT32_MIN
#endif
enum { LANES = 16 }; /* sums run in this many lanes, whatever the vector width */

static inline double gk_clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }
/* the C library stays out (only sqrt and memory functions come from the compiler): NaN on the right goes through */
static inline double gk_max(double x, double y) { return x > y ? x : y; }
static inline double gk_min(double x, double y) { return x < y ? x : y; }
static inline double gk_floor(double x)
{ /* |x| < 2^62 */
    GK_ASSERT(!(x >= 0x1p62) && !(x <= -0x1p62));
    double whole = (double)(int64_t)x;
    return whole > x ? whole - 1.0 : whole;
}
static inline int gk_finite(double x) { return x - x == 0.0; }

/* four doubles at once, the same bits at every vector width; rows of the small system are padded to them */
typedef double gk_quad __attribute__((vector_size(4 * sizeof(double)), may_alias, aligned(sizeof(double))));
typedef int64_t gk_bits __attribute__((vector_size(4 * sizeof(int64_t)), may_alias, aligned(sizeof(double))));
typedef uint64_t gk_unsigned __attribute__((vector_size(4 * sizeof(uint64_t)), may_alias, aligned(sizeof(double))));
/* GK_CHUNK: as many doubles as one register holds: a block of sums that stays in registers is some of these. GK_HOT
 * marks what a step runs through, which is compiled for wider vectors too (run/gk_wide.c). */
#ifdef GK_WIDE
enum { GK_CHUNK = 4 };
#define GK_HOT static __attribute__((unused))
#else
enum { GK_CHUNK = 2 };
#define GK_HOT
#endif
typedef double gk_chunk __attribute__((vector_size(GK_CHUNK * sizeof(double)), may_alias, aligned(sizeof(double))));
typedef gk_real gk_some __attribute__((vector_size(GK_CHUNK * sizeof(gk_real)), may_alias, aligned(sizeof(gk_real))));
#define GK_INLINE static inline __attribute__((always_inline))
/* macros, because compilers differ in how they pass vectors and say so */
#define GK_ALL(x) ((gk_quad){(x), (x), (x), (x)})
#define GK_CHOOSE(where, x, y) ((gk_quad)(((where) & (gk_bits)(x)) | (~(where) & (gk_bits)(y))))
#define GK_LARGER(x, y) GK_CHOOSE((x) > (y), x, y)
#define GK_MAGNITUDE(x) ((gk_quad)((gk_bits)(x) & INT64_MAX))
static inline double gk_largest(const gk_quad *x)
{
    GK_ASSERT(x);
    return gk_max(gk_max((*x)[0], (*x)[2]), gk_max((*x)[1], (*x)[3]));
}
/* calls f(…, quads) with the usual sizes as constants, so that the compiler keeps short rows in registers */
#define GK_SIZED(quads, f, ...)                                                                                        \
    switch (quads) {                                                                                                   \
    case 2: f(__VA_ARGS__, 2); break;                                                                                  \
    case 3: f(__VA_ARGS__, 3); break;                                                                                  \
    case 4: f(__VA_ARGS__, 4); break;                                                                                  \
    default: f(__VA_ARGS__, quads);                                                                                    \
    }

/* zeros in a few quads, as stores instead of a call */
GK_INLINE void gk_clear(double *x, int quads)
{
    GK_ASSERT(quads >= 0 && (x || !quads));
    const gk_quad zero = {0};
    gk_quad *to = (gk_quad *)x;
    switch (quads) {
    case 4: to[3] = zero; /* fall through */
    case 3: to[2] = zero; /* fall through */
    case 2: to[1] = zero; /* fall through */
    case 1: to[0] = zero; /* fall through */
    case 0: break;
    default: memset(x, 0, (size_t)quads * sizeof *to);
    }
}

/* f(…, quads, block) for every block of a quad of rows, blocks as constants too where quads is one */
#define GK_BLOCKS(quads, f, ...)                                                                                       \
    f(__VA_ARGS__, quads, 0);                                                                                          \
    if (quads > 1) f(__VA_ARGS__, quads, 1);                                                                           \
    if (quads > 2) f(__VA_ARGS__, quads, 2);                                                                           \
    for (int block = 3; block < quads; block++) f(__VA_ARGS__, quads, block);
#define GK_BLOCKS_BACK(quads, f, ...)                                                                                  \
    for (int block = quads - 1; block > 2; block--) f(__VA_ARGS__, quads, block);                                      \
    if (quads > 2) f(__VA_ARGS__, quads, 2);                                                                           \
    if (quads > 1) f(__VA_ARGS__, quads, 1);                                                                           \
    f(__VA_ARGS__, quads, 0);

/* the same for the strips of a place: those of 1, 5, 7 and 10 slices */
#define GK_STRIPPED(strips, f, ...)                                                                                    \
    switch (strips) {                                                                                                  \
    case 1: f(__VA_ARGS__, 1); break;                                                                                  \
    case 3: f(__VA_ARGS__, 3); break;                                                                                  \
    case 5: f(__VA_ARGS__, 5); break;                                                                                  \
    case 7: f(__VA_ARGS__, 7); break;                                                                                  \
    default: f(__VA_ARGS__, strips);                                                                                   \
    }

/* y += f x over quads `from` … `to` − 1 */
GK_INLINE void gk_axpy(double f, const double *x, double *y, int from, int to)
{
    GK_ASSERT(0 <= from && (from >= to || (x && y)));
    const gk_quad *a = (const gk_quad *)x;
    gk_quad *b = (gk_quad *)y;
    for (int q = from; q < to; q++) b[q] += f * a[q];
}

static inline double gk_dot_quads(const double *x, const double *y, int quads)
{
    GK_ASSERT(quads >= 0 && (!quads || (x && y)));
    const gk_quad *a = (const gk_quad *)x, *b = (const gk_quad *)y;
    gk_quad sum = {0};
    for (int q = 0; q < quads; q++) sum += a[q] * b[q];
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/* Σ a_k b_k in LANES fixed lanes, added up as a tree: the same bits at every vector width. n is a multiple of LANES. */
typedef gk_real gk_four __attribute__((vector_size(4 * sizeof(gk_real)), may_alias, aligned(sizeof(gk_real))));
#define GK_WIDENED(four) __builtin_convertvector(four, gk_quad)
typedef gk_real gk_half __attribute__((vector_size(LANES / 2 * sizeof(gk_real)), may_alias,
                                       aligned(sizeof(gk_real)))); /* states start anywhere */
/* halves that hold n numbers; numbers in them */
static inline int gk_halves(int n) { return (n + LANES / 2 - 1) / (LANES / 2); }
static inline int gk_whole_halves(int n) { return gk_halves(n) * (LANES / 2); }
/* x, or 0 where it is less than `least` in magnitude: numbers that fade end at 0 before products of them are denormal,
 * which many processors compute slowly; by the same bits on all */
typedef gk_whole gk_half_bits
    __attribute__((vector_size(LANES / 2 * sizeof(gk_whole)), may_alias, aligned(sizeof(gk_whole))));
#define GK_HALF_FADED(x, least) ((gk_half)((gk_half_bits)(x) & (((x) >= (least)) | ((x) <= -(least)) | GK_SIGN)))
#define GK_HALF_MAGNITUDE(x) ((gk_half)((gk_half_bits)(x) & ~GK_SIGN))
#define GK_HALF_LARGER(x, y) ((gk_half)(((gk_half_bits)(x) & ((x) > (y))) | ((gk_half_bits)(y) & ~((x) > (y)))))
#define GK_QUAD_FADED(x, least) ((gk_quad)((gk_bits)(x) & (((x) >= (least)) | ((x) <= -(least)) | INT64_MIN)))
/* a half in double, to and fro, and its quads: the form that compilers turn into single instructions */
typedef double gk_eight __attribute__((vector_size(LANES / 2 * sizeof(double)), may_alias, aligned(sizeof(double))));
#define GK_WIDER(half) __builtin_convertvector(half, gk_eight)
#define GK_ROUNDED(eight) __builtin_convertvector(eight, gk_half)
#define GK_QUAD_OF(eight, j) (((gk_quad *)&(eight))[j])

static inline double gk_dot(const gk_real *a, const gk_real *b, int n)
{
    GK_ASSERT(n >= 0 && n % LANES == 0 && (!n || (a && b)));
    gk_half low = {0}, high = {0};
    const gk_half *x = (const gk_half *)a, *y = (const gk_half *)b;
    for (int k = 0; k < 2 * n / LANES; k += 2) {
        low += x[k] * y[k];
        high += x[k + 1] * y[k + 1];
    }
    low += high;
    return ((low[0] + low[4]) + (low[2] + low[6])) + ((low[1] + low[5]) + (low[3] + low[7]));
}

/* ---- rows ---- */
/* adds row·x to what each row reads: `each` rows side by side, whose sums do not wait for each other */
GK_INLINE void gk_times_some(const double *rows, int width, const double *x, double *read, const int each)
{
    const gk_quad *b = (const gk_quad *)x;
    gk_quad sum[4] = {{0}};
    for (int q = 0; q < width / 4; q++)
        for (int i = 0; i < each; i++) sum[i] += ((const gk_quad *)(rows + (size_t)i * (size_t)width))[q] * b[q];
    for (int i = 0; i < each; i++) read[i] += (sum[i][0] + sum[i][2]) + (sum[i][1] + sum[i][3]);
}

static inline void gk_times_rows(const double *rows, int n, int width, const double *x, double *read)
{
    GK_ASSERT(n >= 0 && width % 4 == 0);
    int i = 0;
    for (; i + 4 <= n; i += 4) gk_times_some(rows + (size_t)i * (size_t)width, width, x, read + i, 4);
    for (; i < n; i++) gk_times_some(rows + (size_t)i * (size_t)width, width, x, read + i, 1);
}

static inline double gk_across(const gk_half *sum)
{
    const gk_four *half = (const gk_four *)sum, s = half[0] + half[1];
    return (s[0] + s[2]) + (s[1] + s[3]);
}

/* y += Σ x_i rows_i over a few halves, which stay in registers */
GK_INLINE void gk_sum_some(const gk_half *rows, int width, const gk_real *x, int count, gk_half *y, const int halves)
{
    gk_half sum[8];
    for (int k = 0; k < halves; k++) sum[k] = y[k];
    int i = 0;
    for (; i + 2 <= count; i += 2, rows += 2 * width)
        for (int k = 0; k < halves; k++) sum[k] = (sum[k] + x[i] * rows[k]) + x[i + 1] * rows[width + k];
    for (int k = 0; k < halves && i < count; k++) sum[k] += x[i] * rows[k];
    for (int k = 0; k < halves; k++) y[k] = sum[k];
}

/* the same of whole rows, `width` halves each */
static inline void gk_sum_rows(const gk_real *rows, int width, const gk_real *x, int count, gk_real *y)
{
    GK_ASSERT(count >= 0 && width >= 0);
    const gk_half *from = (const gk_half *)rows;
    gk_half *to = (gk_half *)y;
    int k = 0;
    for (; k + 8 <= width; k += 8) gk_sum_some(from + k, width, x, count, to + k, 8);
    for (; k + 4 <= width; k += 4) gk_sum_some(from + k, width, x, count, to + k, 4);
    if (width - k == 3) gk_sum_some(from + k, width, x, count, to + k, 3), k += 3;
    if (k + 2 <= width) gk_sum_some(from + k, width, x, count, to + k, 2), k += 2;
    if (k < width) gk_sum_some(from + k, width, x, count, to + k, 1);
}

static inline double gk_half_largest(const gk_half *x)
{
    double most = 0.0;
    for (int i = 0; i < LANES / 2; i++) most = gk_max(most, (*x)[i]);
    return most;
}

/* to[i] += row·rows[i], four rows side by side; rows are `width` halves apart, of which the product takes `halves` */
static inline void gk_multiply_rows(const gk_half *row, const gk_half *rows, int count, int width, int halves,
                                    double *to)
{
    GK_ASSERT(count >= 0 && halves <= width);
    int i = 0;
    for (; i + 4 <= count; i += 4, rows += 4 * width) {
        gk_half sum[4] = {{0}};
        int k = 0;
        for (; k + 2 <= halves; k += 2)
            for (int l = 0; l < 4; l++)
                sum[l] = (sum[l] + row[k] * rows[l * width + k]) + row[k + 1] * rows[l * width + k + 1];
        for (int l = 0; l < 4 && k < halves; l++) sum[l] += row[k] * rows[l * width + k];
        for (int l = 0; l < 4; l++) to[i + l] += gk_across(&sum[l]);
    }
    for (; i < count; i++, rows += width) {
        gk_half sum = {0};
        for (int k = 0; k < halves; k++) sum += row[k] * rows[k];
        to[i] += gk_across(&sum);
    }
}

#endif
