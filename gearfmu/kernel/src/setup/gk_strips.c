/* Slices across the face width → strips, the contact rows of a place: their number, lengths and weights on the width
 * functions of the bodies. */
#include "setup/gk_setup.h"

/* Only even width functions: slice s and its mirror image read, carry and deform the same, so both together are one row
 * of twice the length. */
int gk_strips_mirrored(const gk_model *model)
{
    for (int a = 0; a < model->functions; a++)
        if (model->degree[a] % 2) return 0;
    return !model->spatial;
}

int gk_strips_count(const gk_model *model, int slices)
{
    GK_ASSERT(slices >= 1 && slices <= MAX_SLICES);
    return gk_strips_mirrored(model) ? (slices + 1) / 2 : slices;
}

static double tan_of(double angle)
{
    double sine, cosine;
    gk_sincos(angle, &sine, &cosine);
    return sine / cosine;
}

/* strip ← width functions: (2a + 1) × mean of P_a over the strip; strips share the common face width */
static double legendre_integral(int degree, double x)
{ /* ∫ P_a = (P_{a+1} − P_{a−1})/(2a + 1) */
    double before = 1.0, now = x, minus = 0.0;
    if (degree == 0) return x;
    for (int k = 1; k <= degree; k++) {
        double next = ((2.0 * k + 1.0) * x * now - k * before) / (k + 1.0);
        minus = before, before = now, now = next;
    }
    return (now - minus) / (2.0 * degree + 1.0);
}

/* the same of a part of the width, −1 … 1 of the half-width of gear g, from … to */
static void row_over(const gk_model *model, double from, double to, double *out)
{
    for (int a = 0; a < model->functions; a++) {
        const int d = model->degree[a];
        out[a] = (2.0 * d + 1.0) * (legendre_integral(d, to) - legendre_integral(d, from)) / (to - from);
    }
}

void gk_strips_row(const gk_model *model, int g, double from, double to, double *out)
{
    GK_ASSERT(gk_is_gear(model, g) && from < to);
    const double per_half = 2.0 / model->gear[g].width;
    row_over(model, per_half * from, per_half * to, out);
}

void gk_strips_rows(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int g, gk_strip_weights out)
{
    GK_ASSERT(gk_is_gear(model, g));
    GK_ASSERT(setup->strips >= 1 && setup->strips <= setup->slices);
    const double edge = e->width / model->gear[g].width;
    for (int s = 0; s < setup->strips; s++)
        row_over(model, edge * (2.0 * s / setup->slices - 1.0), edge * (2.0 * (s + 1) / setup->slices - 1.0), out[s]);
}

/* Past a tip edge the gap grows as the square of the distance from it, here from … to. Its mean over a part of `length`
 * that ends there, between what it is at the part's place on the flank, or next to it, and at the end. */
static double mean_past(double from, double to, double length)
{
    if (!(to > 0.0)) return 0.0;
    const double share = from < 0.0 ? to / length : 1.0;
    from = gk_max(from, 0.0);
    return share * (to + 2.0 * from) / (3.0 * (to + from));
}

/* The part of a strip that carries, where the rolls of both flanks at mid-width are `roll`: what lies on both flanks
 * and past their ends by no more than `past`; of a strip that has left them the end next to them. A roll at z is s +
 * sg z tan β_b, β_b of its own gear. */
gk_part gk_strips_part(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, double sg,
                       const double roll[2], int strip)
{
    GK_ASSERT(strip >= 0 && strip < setup->strips);
    GK_ASSERT(sg == 1.0 || sg == -1.0);
    static const double LEAST_SHARE = 0.02; /* of a strip that has left its flanks */
    const gk_engagement *e = &model->engagement[mesh->index];
    const double half = 0.5 * e->width / setup->slices, middle = mesh->strip_middle[strip];
    double from = middle - half, to = middle + half, low = -INFINITY, high = INFINITY; /* low, high: tip edges */
    for (int w = 0; w < 2; w++) {
        const double slope = sg * mesh->helix[w], edge = model->gear[e->gear[w]].s_tip - roll[w];
        if (slope == 0.0) continue;
        const double end = (edge + mesh->past[w]) / slope;
        if ((slope > 0.0) == (w == 0 || e->kind != MESH_INTERNAL))
            to = gk_min(to, end), high = gk_min(high, edge / slope);
        else
            from = gk_max(from, end), low = gk_max(low, edge / slope);
    }
    gk_part part = {.middle = gk_clamp(0.5 * (from + to), middle - half, middle + half),
                    .share = gk_max((to - from) / (2.0 * half), LEAST_SHARE)};
    const double length = 2.0 * half * part.share;
    part.end[0] = part.middle - 0.5 * length, part.end[1] = part.middle + 0.5 * length;
    part.flank = part.middle;
    if (!(low < high)) return part; /* nothing of it is on both flanks anywhere */
    part.flank = gk_clamp(gk_clamp(part.middle, low, high), part.end[0], part.end[1]);
    part.past[0] = mean_past(low - part.end[1], low - part.end[0], length);
    part.past[1] = mean_past(part.end[0] - high, part.end[1] - high, length);
    return part;
}

/* The tip edge carries a line of contact on past the end of its flank: by the half-width of the load strip, over
 * which the contact patch leaves the flank; farther where a slice spans less roll than that, without end for spur
 * teeth, whose strips leave the flank as a whole. Longer parts of coarse slices would carry at the gap of their
 * middle alone. */
static double past_end(const gk_setup *setup, const gk_engagement *e, const gk_gear *gear, double helix)
{
    if (!GK_ON(setup, tip_contact) || e->kind == MESH_FLAT) return 0.0;
    const double span = fabs(helix) * e->width / setup->slices, least = 1e-6;
    const double outwards = gear->s_tip > gear->s_form ? 1.0 : -1.0;
    return outwards * gear->strip * gk_max(1.0, gear->strip / gk_max(span, least));
}

/* a gear's lead at x, −1 … 1 of its half-width */
double gk_strips_lead(const gk_gear *gear, int flank, double x)
{
    GK_ASSERT(flank == 0 || flank == 1);
    if (!gear->lead) return 0.0;
    const double u = gk_clamp(0.5 * (x + 1.0), 0.0, 1.0) * (LEADS - 1);
    const int at = (int)u < LEADS - 1 ? (int)u : LEADS - 2;
    const double *depth = gear->lead + flank * LEADS + at;
    return depth[0] + (u - at) * (depth[1] - depth[0]);
}

/* its mean, from … to */
static double lead_over(const gk_gear *gear, int flank, double from, double to)
{
    enum { SAMPLES = 16 };
    double sum = 0.0;
    for (int i = 0; i < SAMPLES && gear->lead; i++)
        sum += gk_strips_lead(gear, flank, from + (to - from) * (i + 0.5) / SAMPLES);
    return sum / SAMPLES;
}

/* what both gears' flanks are beside involutes, and how far they may reach out */
static void fill_deviations(const gk_model *model, const gk_setup *setup, gk_mesh *mesh)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    mesh->protrusion = 0.0, mesh->runs_out = 0;
    for (int w = 0; w < 2; w++) {
        const gk_gear *gear = &model->gear[e->gear[w]];
        double from[MAX_SLICES], to[MAX_SLICES];
        for (int s = 0; s < setup->strips; s++) {
            const double edge = e->width / gear->width;
            from[s] = edge * (2.0 * s / setup->slices - 1.0), to[s] = edge * (2.0 * (s + 1) / setup->slices - 1.0);
            for (int flank = 0; flank < 2 && GK_ON(setup, flank_deviations); flank++)
                mesh->lead[flank][s] += lead_over(gear, flank, from[s], to[s]);
        }
        gk_deviation_fill(setup, gear, setup->strips, from, to, &mesh->deviation[w]);
        mesh->protrusion += (GK_HAS(pitch_errors) ? gear->index_most : 0.0) +
                            (GK_ON(setup, flank_deviations) ? gear->flanks.most : 0.0);
        mesh->runs_out |= GK_ON(setup, runout) && gear->runout;
    }
}

void gk_strips_fill(const gk_model *model, const gk_setup *setup, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    GK_ASSERT(setup->strips >= 1 && setup->strips <= MAX_SLICES);
    const gk_engagement *e = &model->engagement[mesh->index];
    mesh->strip_term = 0.0;
    gk_sincos(model->gear[e->gear[0]].helix, &mesh->sine, &mesh->cosine);
    for (int s = 0; s < setup->strips; s++)
        mesh->strip_width[s] = e->width / setup->slices *
                               (gk_strips_mirrored(model) && 2 * s + 1 != setup->slices ? 2.0 : 1.0);
    for (int s = 0; s < setup->strips; s++) mesh->strip_middle[s] = e->width * ((s + 0.5) / setup->slices - 0.5);
    memset(mesh->lead, 0, sizeof mesh->lead);
    fill_deviations(model, setup, mesh);
    for (int w = 0; w < 2; w++) {
        const gk_gear *gear = &model->gear[e->gear[w]];
        mesh->helix[w] = tan_of(gear->helix);
        mesh->past[w] = past_end(setup, e, gear, mesh->helix[w]);
        mesh->strip_term += gear->local * (gk_log(4.0 * gear->strip) - 1.0);
    }
}
