/* What a slice yields beside its neighbours on one tooth, near its load (docs/theory.md, eq. 8h). Tables of compliance
 * know a slice's load by the width functions at one length of roll, so smeared over much of the width. On the half-space
 * that a flank is near a load, with the end faces as mirrors, the patches of the slices take the place of these. */
#include "setup/gk_slices.h"

/* ∫∫∫∫ dx dx dy dy of 1/√(x² + y²) */
static double fourfold(double x, double y)
{
    x = fabs(x), y = fabs(y);
    const double r = sqrt(x * x + y * y);
    double sum = -r * r * r / 6.0;
    if (x > 0.0 && y > 0.0) sum += 0.5 * x * y * (x * gk_log((y + r) / x) + y * gk_log((x + r) / y));
    return sum;
}

/* mean of 1/distance between two patches along one line: their half-lengths, their middles `apart`, ±strip wide */
static double between_patches(const double half[2], double apart, double strip)
{
    double sum = 0.0;
    for (int i = -1; i <= 1; i += 2)
        for (int j = -1; j <= 1; j += 2) {
            const double x = apart + i * half[0] - j * half[1];
            sum -= i * j * (fourfold(x, 2.0 * strip) - fourfold(x, 0.0));
        }
    return sum / (8.0 * half[0] * half[1] * strip * strip);
}

/* (functions, functions) of gk_gear.smeared, linear between its places */
static void blend_smeared(const gk_gear *gear, int cells, double roll, double distance, double *out)
{
    const double end = gear->s_tip - gear->s_form;
    const double u = gk_clamp((roll - gear->s_form) / end, 0.0, 1.0) * (SMEARED_ROLLS - 1);
    const double v = gk_clamp(distance / gear->width, 0.0, 1.0) * (SMEARED_DISTANCES - 1);
    const int i = (int)gk_min(u, SMEARED_ROLLS - 2), j = (int)gk_min(v, SMEARED_DISTANCES - 2);
    const double *at = gear->smeared + (size_t)((i * SMEARED_DISTANCES + j) * cells);
    const double *further = at + (size_t)(SMEARED_DISTANCES * cells), x = u - i, y = v - j;
    for (int c = 0; c < cells; c++)
        out[c] = (1.0 - x) * ((1.0 - y) * at[c] + y * at[cells + c]) +
                 x * ((1.0 - y) * further[c] + y * further[cells + c]);
}

double gk_slices_local(const gk_node *n, const gk_spot *p, const gk_spot *q)
{
    GK_ASSERT(n->gear->smeared && p->length > 0.0 && q->length > 0.0);
    const gk_gear *gear = n->gear;
    const int A = n->model->functions;
    const gk_spot *high = p->z < q->z ? q : p, *low = p->z < q->z ? p : q;
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS], of_functions = 0.0, of_patches = 0.0;
    blend_smeared(gear, A * A, 0.5 * (p->nominal + q->nominal), high->z - low->z, cell);
    for (int a = 0; a < A; a++) of_functions += high->width[a] * gk_node_dot(cell + a * A, low->width, A);
    const double half[2] = {0.5 * p->length / n->helix_cosine, 0.5 * q->length / n->helix_cosine};
    const double apart[3] = {p->z - q->z, p->z + q->z - gear->width, p->z + q->z + gear->width};
    for (int i = 0; i < 3; i++) of_patches += between_patches(half, apart[i] / n->helix_cosine, gear->strip);
    return 0.5 * gear->local * (of_patches - of_functions);
}
