/* What a slice yields beside its neighbours on one tooth, near its load (docs/theory.md, eq. 8g′). Tables of compliance
 * know a slice's load by the width functions at one length of roll, so smeared over much of the width. On the half-
 * space that a flank is near a load the patches of the slices take the place of these. End faces and tip edge are
 * mirrors. */
#include "setup/gk_slices.h"

static const double FAR_OFF = 4.0; /* half-widths of a strip from which on its image is a line */

/* ---- mean of 1/distance ------------------------------------------------------------------------------------------ */
/* ∫∫∫∫ dx dx dy dy of 1/√(x² + y²) */
static double fourfold(double x, double y)
{
    x = fabs(x), y = fabs(y);
    const double r = sqrt(x * x + y * y);
    double sum = -r * r * r / 6.0;
    if (x > 0.0 && y > 0.0) sum += 0.5 * x * y * (x * gk_log((y + r) / x) + y * gk_log((x + r) / y));
    return sum;
}

/* ∫∫ dx dx, y > 0 */
static double twofold(double x, double y)
{
    x = fabs(x);
    const double r = sqrt(x * x + y * y);
    return x * gk_log((x + r) / y) - r;
}

/* between two patches ±strip wide: half-lengths, middles `apart` along the line of contact and `across` it */
static double between_patches(const double half[2], double apart, double across, double strip)
{
    const int line = across > FAR_OFF * strip;
    double sum = 0.0;
    for (int i = -1; i <= 1; i += 2)
        for (int j = -1; j <= 1; j += 2) {
            const double x = apart + i * half[0] - j * half[1];
            if (line)
                sum -= i * j * 4.0 * strip * strip * twofold(x, across);
            else if (across > 0.0)
                sum -= i * j * (fourfold(x, across + 2.0 * strip) + fourfold(x, across - 2.0 * strip));
            else
                sum -= i * j * 2.0 * fourfold(x, 2.0 * strip);
            if (!line) sum += i * j * 2.0 * fourfold(x, across);
        }
    return sum / (16.0 * half[0] * half[1] * strip * strip);
}

/* with both end faces as mirrors, by the places of the middles across the width */
static double between_faces(const gk_node *n, const double half[2], double z, double other)
{
    const double apart[3] = {z - other, z + other - n->gear->width, z + other + n->gear->width};
    double sum = 0.0;
    for (int i = 0; i < 3; i++) sum += between_patches(half, apart[i] / n->helix_cosine, 0.0, n->gear->strip);
    return sum;
}

void gk_slices_fill(const gk_node *n, double *patches)
{
    GK_ASSERT(n->gear->smeared && patches);
    const int strips = n->setup->strips;
    const double slice = n->e->width / n->setup->slices;
    const double half[2] = {0.5 * slice / n->helix_cosine, 0.5 * slice / n->helix_cosine};
    const double *z = n->setup->mesh[n->e - n->model->engagement].strip_middle;
    for (int s = 0; s < strips; s++)
        for (int t = 0; t <= s; t++)
            patches[s * strips + t] = patches[t * strips + s] = between_faces(n, half, z[s], z[t]);
}

/* ---- between width functions ------------------------------------------------------------------------------------- */
/* length of profile from a length of roll to the tip */
static double below_tip(const gk_gear *gear, double roll)
{
    return fabs(0.5 * (gear->s_tip * gear->s_tip - roll * roll) / gear->r_b);
}

/* (functions, functions): gk_gear.smeared and smeared_tip, linear between their places */
static void blend_smeared(const gk_gear *gear, int cells, const gk_spot *high, const gk_spot *low, double *out)
{
    const double roll = 0.5 * (high->nominal + low->nominal), most = 2.0 * below_tip(gear, gear->s_form);
    const double across = below_tip(gear, high->nominal) + below_tip(gear, low->nominal);
    const double u = gk_clamp((roll - gear->s_form) / (gear->s_tip - gear->s_form), 0.0, 1.0) * (SMEARED_ROLLS - 1);
    const double v = gk_clamp((high->z - low->z) / gear->width, 0.0, 1.0) * (SMEARED_DISTANCES - 1);
    const double w = sqrt(gk_clamp(across / most, 0.0, 1.0)) * (SMEARED_DISTANCES - 1);
    const int i = (int)gk_min(u, SMEARED_ROLLS - 2), j = (int)gk_min(v, SMEARED_DISTANCES - 2);
    const int k = (int)gk_min(w, SMEARED_DISTANCES - 2), row = SMEARED_DISTANCES * cells;
    const double *at = gear->smeared + i * row + j * cells, *tip = gear->smeared_tip + k * cells;
    const double x = u - i, y = v - j, z = w - k;
    for (int c = 0; c < cells; c++)
        out[c] = (1.0 - x) * ((1.0 - y) * at[c] + y * at[cells + c]) +
                 x * ((1.0 - y) * at[row + c] + y * at[row + cells + c]) + (1.0 - z) * tip[c] + z * tip[cells + c];
}

/* ---- what slices yield ------------------------------------------------------------------------------------------- */
static int is_whole(const gk_node *n, const gk_spot *p) { return p->length == n->e->width / n->setup->slices; }

double gk_slices_local(const gk_node *n, const double *patches, int i, int j)
{
    GK_ASSERT(n->gear->smeared && i >= 0 && j >= 0 && i < n->points && j < n->points);
    const gk_gear *gear = n->gear;
    const gk_spot *p = &n->at[i], *q = &n->at[j];
    const int A = n->model->functions, strips = n->setup->strips;
    const double half[2] = {0.5 * p->length / n->helix_cosine, 0.5 * q->length / n->helix_cosine};
    const double tip = 2.0 * below_tip(gear, 0.5 * (p->nominal + q->nominal));
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    double sum = is_whole(n, p) && is_whole(n, q) ? patches[i % strips * strips + j % strips]
                                                  : between_faces(n, half, p->z, q->z);
    sum += between_patches(half, (p->z - q->z) / n->helix_cosine, tip, gear->strip);
    const gk_spot *high = p->z < q->z ? q : p, *low = p->z < q->z ? p : q;
    blend_smeared(gear, A * A, high, low, cell);
    for (int a = 0; a < A; a++) sum -= high->width[a] * gk_node_dot(cell + a * A, low->width, A);
    return 0.5 * gear->local * sum;
}
