/* Slices across the face width → strips, the contact rows of a place: their number, lengths and weights on the width
 * functions of the bodies. */
#include "setup/gk_setup.h"

static const double LEAST_SHARE = 0.02; /* of the face width: length of a line that begins or has ended */

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

/* The line of contact of a tooth pair where the rolls of both flanks at mid-width are `roll`: between the end faces and
 * the tip edges, and past these by what their edges carry. A roll at z is s + sg z tan β_b, β_b of its own gear. Of a
 * pair that has left its flanks the end next to them. */
gk_line gk_strips_line(const gk_model *model, const gk_mesh *mesh, double sg, const double roll[2])
{
    GK_ASSERT(sg == 1.0 || sg == -1.0);
    const gk_engagement *e = &model->engagement[mesh->index];
    const double half = 0.5 * e->width, least = LEAST_SHARE * e->width;
    gk_line line = {.end = {-half, half}, .edge = {-INFINITY, INFINITY}};
    for (int w = 0; w < 2; w++) {
        const double slope = sg * mesh->helix[w], edge = model->gear[e->gear[w]].s_tip - roll[w];
        if (slope == 0.0) continue;
        const double end = (edge + mesh->past[w]) / slope;
        if ((slope > 0.0) == (w == 0 || e->kind != MESH_INTERNAL))
            line.end[1] = gk_min(line.end[1], end), line.edge[1] = gk_min(line.edge[1], edge / slope);
        else
            line.end[0] = gk_max(line.end[0], end), line.edge[0] = gk_max(line.edge[0], edge / slope);
    }
    line.moves[0] = line.end[0] == -half, line.moves[1] = line.end[1] == half;
    const double length = line.end[1] - line.end[0];
    line.missing = gk_max(0.0, 1.0 - length / least);
    if (line.missing == 0.0) return line;
    const double middle = gk_clamp(0.5 * (line.end[0] + line.end[1]), 0.5 * least - half, half - 0.5 * least);
    line.end[0] = middle - 0.5 * least, line.end[1] = middle + 0.5 * least;
    return line;
}

/* One of the equal parts of a line, which move and grow with it */
gk_part gk_strips_part(const gk_setup *setup, const gk_line *line, int strip)
{
    GK_ASSERT(strip >= 0 && strip < setup->strips);
    const double length = (line->end[1] - line->end[0]) / setup->strips;
    gk_part part;
    const double at = (strip + 0.5) / setup->strips;
    part.moves = (1.0 - at) * line->moves[0] + at * line->moves[1];
    for (int i = 0; i < 2; i++) part.end[i] = line->end[0] + (strip + i) * length;
    part.middle = part.flank = 0.5 * (part.end[0] + part.end[1]);
    if (line->edge[0] < line->edge[1]) part.flank = gk_clamp(part.middle, line->edge[0], line->edge[1]);
    part.flank = gk_clamp(part.flank, part.end[0], part.end[1]);
    return part;
}

/* adds a force that is even between two places of the width to those of its fixed slices */
void gk_strips_spread(const gk_setup *setup, const gk_engagement *e, const double end[2], double force, double *slice)
{
    GK_ASSERT(end[0] < end[1] && slice);
    const double per = setup->slices / e->width, from = per * end[0] + 0.5 * setup->slices,
                 to = per * end[1] + 0.5 * setup->slices; /* in slices from the face z < 0 on */
    const int first = (int)gk_clamp(from, 0.0, setup->slices - 1), last = (int)gk_clamp(to, 0.0, setup->slices - 1);
    for (int i = first; i <= last; i++) {
        const double low = i == first ? from : i, high = i == last ? to : i + 1;
        slice[i] += force * (high - low) / (to - from);
    }
}

/* The tip edge carries a line of contact on past the end of its flank, by one and a half half-widths of the load patch,
 * to where the gap of the edge is about what deflections are; without end for spur teeth, which leave the flank as a
 * whole. Without contact of tip edges the line ends with its flank. */
static double past_end(const gk_setup *setup, const gk_engagement *e, const gk_gear *gear, double helix)
{
    if (!GK_ON(setup, tip_contact) || e->kind == MESH_FLAT) return 0.0;
    const double span = fabs(helix) * e->width, least = 1e-6, reach = 1.5 * gear->strip;
    const double outwards = gear->s_tip > gear->s_form ? 1.0 : -1.0;
    return outwards * reach * gk_max(1.0, reach / gk_max(span, least));
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

/* what both gears' flanks are beside involutes, and how far they may reach out; parts of a line find theirs by z */
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
        if (mesh->rides)
            gk_deviation_share(setup, gear, &mesh->deviation[w]);
        else
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
    mesh->rides = setup->spatial && !setup->nodal && e->kind != MESH_FLAT && model->gear[e->gear[0]].helix != 0.0;
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
