/* A gear group in the frame of a tooth (docs/theory.md, eq. 3): rows are those of the reference tooth 0, so that the
 * state is turned to a tooth before it is read, and forces are turned back. */
#include "force/gk_turn.h"

/* a gear group's state in the frame of a tooth: what tooth 0 of a state turned back would have */
void gk_turn_back(const gk_modal *m, int tooth, const gk_real *y, gk_real *out)
{
    GK_ASSERT(tooth >= 0 && y != out && m->n % (2 * LANES) == 0);
    const int half = m->n / LANES; /* halves of LANES in one half of the lanes */
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    const gk_half *a = (const gk_half *)y, *b = a + half;
    gk_half *to = (gk_half *)out;
    for (int k = 0; k < half; k++) {
        to[k] = a[k] * c[k] + b[k] * s[k];
        to[half + k] = b[k] * c[k] - a[k] * s[k];
    }
}

/* adds two forces in the frame of a tooth to the group's */
void gk_turn_forth(const gk_modal *m, int tooth, const gk_real *f[2], gk_real *sum[2])
{
    GK_ASSERT(tooth >= 0 && m->n % (2 * LANES) == 0);
    const int half = m->n / LANES;
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    for (int k = 0; k < half; k++)
        for (int i = 0; i < 2; i++) {
            const gk_half a = ((const gk_half *)f[i])[k], b = ((const gk_half *)f[i])[half + k];
            ((gk_half *)sum[i])[k] += a * c[k] - b * s[k];
            ((gk_half *)sum[i])[half + k] += a * s[k] + b * c[k];
        }
}

/* adds a group's displacement in the frame of a tooth to that in its own axes, the first `lanes` of each half */
void gk_turn_add(const gk_modal *m, int tooth, int lanes, const gk_real *y, gk_real *sum)
{
    GK_ASSERT(tooth >= 0 && y != sum && lanes % (LANES / 2) == 0 && lanes <= m->pairs);
    const int half = m->n / LANES;
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    const gk_half *a = (const gk_half *)y, *b = a + half;
    gk_half *to = (gk_half *)sum;
    for (int k = 0; k < 2 * lanes / LANES; k++) {
        to[k] += a[k] * c[k] - b[k] * s[k];
        to[half + k] += a[k] * s[k] + b[k] * c[k];
    }
}
