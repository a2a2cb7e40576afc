/* Lines of contact of helical teeth, cut into parts that move and grow with them (docs/theory.md, 2.6). A part closes
 * gradually: its gap is the least of GAPS places along it, and the law of its contact (gk_law.c) knows the others. On
 * both flanks they are straight along the line but for relief, deviations and lead; past a tip edge they follow a
 * parabola through sections of the corner. */
#include "force/gk_parts.h"

/* What gear A slides past B along the profile of A, per motion of the poses: e = e_p of A, square to n in the section
 */
void gk_parts_glide(const gk_posed *q, double sg, const gk_touch *t, double z, gk_point *p)
{
    const double ex = sg * t->n[1], ey = -sg * t->n[0];
    for (int w = 0; w < 2; w++) {
        const double sense = w ? -1.0 : 1.0, up = z - q->pose[SPACE * w + ZA], *at = t->at[w];
        double *slide = p->slide + SPACE * w;
        slide[XA] = sense * ex, slide[YA] = sense * ey, slide[PHIA] = sense * (at[0] * ey - at[1] * ex);
        slide[ZA] = 0.0, slide[RXA] = -sense * up * ey, slide[RYA] = sense * up * ex;
    }
}

/* From the transverse section at z into space: the normal is n = cos β_b n_t − sg sin β_b e_z, a gear that moves
 * along its axis or tilts about its mid-width moves the point of contact along it. Both gears have the point halfway
 * between their teeth, so that contact forces are in balance with their moments. */
void gk_parts_lean(const gk_posed *q, double sg, const gk_touch *t, double z, gk_point *p)
{
    const gk_mesh *mesh = q->mesh;
    const double nx = mesh->cosine * t->n[0], ny = mesh->cosine * t->n[1], nz = -sg * mesh->sine;
    p->gap *= mesh->cosine;
    p->curvature *= mesh->cosine;
    for (int w = 0; w < 2; w++) {
        const double sense = w ? 1.0 : -1.0, *pose = q->pose + SPACE * w;
        const double x = t->at[w][0], y = t->at[w][1], up = z - pose[ZA];
        double *gradient = p->gradient + SPACE * w;
        for (int c = 0; c < PLANE; c++) gradient[c] *= mesh->cosine;
        gradient[ZA] = sense * nz;
        gradient[RXA] = sense * (y * nz - up * ny);
        gradient[RYA] = sense * (up * nx - x * nz);
        for (int c = PLANE; c < SPACE; c++)
            p->gap += gradient[c] * (pose[c] + (w && c > ZA ? q->e->tilt[c - RXA] : 0.0));
    }
}

/* the flanks at z: their deviations, between two places of the fields */
static void take_fields(const gk_posed *q, const gk_place *p, double z, gk_tooth_flanks *f)
{
    for (int w = 0; w < 2; w++) {
        const gk_deviation *d = &q->mesh->deviation[w];
        const double u = gk_clamp(z / q->gear[w]->width + 0.5, 0.0, 1.0) * (d->lines - 1);
        const int at = (int)u < d->lines - 1 ? (int)u : (d->lines > 1 ? d->lines - 2 : 0);
        f->depth[w] = gk_deviation_line(d, p->tooth[w], p->flank, at);
        f->next[w] = f->depth[w] && d->lines > 1 ? gk_deviation_line(d, p->tooth[w], p->flank, at + 1) : NULL;
        f->part[w] = u - at;
    }
}

/* ---- gaps along a line ------------------------------------------------------------------------------------------- */
typedef struct stretch { /* of a line: a parabola through its gaps at both ends and in the middle, m */
    double low, high, gap[3];
} stretch;

typedef struct course { /* of the gaps along a line, without leads */
    const gk_posed *q;
    const gk_place *place;
    gk_tooth_flanks *f;
    const double *roll;            /* lengths of roll at mid-width */
    stretch before, flanks, after; /* past the tip edge of one end, on both flanks without depths, past the other */
} course;

static double along(const stretch *s, double z)
{
    const double u = (z - s->low) / (s->high - s->low) - 0.5, *g = s->gap;
    return g[1] + u * (g[2] - g[0]) + 2.0 * u * u * (g[0] - 2.0 * g[1] + g[2]);
}

/* The gap of the section at z, without leads; tilted: what tilts and axial motion open of it */
static double gap_of(const course *c, double z, double *tilted)
{
    gk_point p;
    gk_touch touch;
    take_fields(c->q, c->place, z, c->f);
    gk_section_at(c->q, c->f, c->roll, z, &p, &touch);
    const double plane = c->q->mesh->cosine * p.gap;
    gk_parts_lean(c->q, c->f->side->sg, &touch, z, &p);
    *tilted = p.gap - plane;
    return p.gap;
}

/* a stretch past a tip edge, by the gaps at its ends */
static stretch past_edge(const course *c, double low, double high, double at_low, double at_high)
{
    double tilted;
    return (stretch){low, high, {at_low, gap_of(c, 0.5 * (low + high), &tilted), at_high}};
}

/* The stretches of a line. One that is nowhere on both flanks is all past them. */
static void run_along(course *c, const gk_line *line)
{
    const double first = line->end[0], last = line->end[1];
    const double low = gk_clamp(line->edge[0], first, last), high = gk_clamp(line->edge[1], first, last);
    const double flat = c->q->mesh->cosine * (c->f->side->gap - c->f->closer);
    double tilted[2];
    if (!(low < high)) {
        c->before = past_edge(c, first, last, gap_of(c, first, &tilted[0]), gap_of(c, last, &tilted[1]));
        c->flanks.low = c->flanks.high = last;
        return;
    }
    const double at_low = gap_of(c, low, &tilted[0]), at_high = gap_of(c, high, &tilted[1]);
    c->flanks = (stretch){low, high, {flat + tilted[0], flat + 0.5 * (tilted[0] + tilted[1]), flat + tilted[1]}};
    if (first < low) c->before = past_edge(c, first, low, gap_of(c, first, &tilted[0]), at_low);
    if (high < last) c->after = past_edge(c, high, last, at_high, gap_of(c, last, &tilted[1]));
}

/* what leads of both gears open at z, in the transverse section */
static double lead_at(const gk_posed *q, int flank, double z)
{
    double sum = 0.0;
    for (int w = 0; w < 2 && GK_ON(q->setup, flank_deviations); w++)
        sum += gk_strips_lead(q->gear[w], flank, 2.0 * z / q->gear[w]->width);
    return sum;
}

/* with all that opens it there */
static double gap_at(const course *c, double z)
{
    const gk_posed *q = c->q;
    const double lead = q->mesh->cosine * lead_at(q, c->f->side->flank, z);
    if (z < c->flanks.low) return along(&c->before, z) + lead;
    if (z > c->flanks.high) return along(&c->after, z) + lead;
    double depths = 0.0, slope;
    if (GK_HAS(flank_deviations)) take_fields(q, c->place, z, c->f);
    for (int w = 0; w < 2; w++)
        depths += gk_section_depth(q, c->f, w, c->roll[w] + c->f->side->sg * z * q->mesh->helix[w], &slope);
    return along(&c->flanks, z) + q->mesh->cosine * depths + lead;
}

/* ---- parts ------------------------------------------------------------------------------------------------------- */
static void order(double *a, double *b)
{
    const double low = gk_min(*a, *b), high = gk_max(*a, *b);
    *a = low, *b = high;
}

/* gaps at GAPS places of a part: the least, and what the others are more; their mean where a part closes as a whole */
static void profile(const course *c, const gk_part *part, gk_point *p)
{
    const double step = (part->end[1] - part->end[0]) / GAPS;
    const int gradual = c->q->mesh->yields > 0.0;
    double at[GAPS], mean = 0.0;
    for (int i = 0; i < GAPS; i++) {
        at[i] = gap_at(c, part->end[0] + (i + 0.5) * step);
        mean += at[i] / GAPS;
    }
    order(&at[0], &at[1]), order(&at[2], &at[3]), order(&at[0], &at[2]), order(&at[1], &at[3]), order(&at[1], &at[2]);
    p->gap = gradual ? at[0] : mean;
    for (int i = 1; i < GAPS; i++) p->opens[i - 1] = gradual ? at[i] - at[0] : 0.0;
}

/* The section of a part: that of its place on the flanks nearest to its middle, forces at its middle; the gap stays */
static void section_of(const gk_posed *q, gk_tooth_flanks *f, const double roll[2], const gk_part *part,
                       gk_place *place, gk_point *p)
{
    const double gap = p->gap;
    gk_touch touch;
    take_fields(q, place, part->flank, f);
    gk_section_at(q, f, roll, part->flank, p, &touch);
    gk_parts_lean(q, f->side->sg, &touch, part->middle, p);
    if (GK_ON(q->setup, friction)) gk_parts_glide(q, f->side->sg, &touch, part->middle, p);
    p->gap = gap;
    memcpy(p->end, part->end, sizeof p->end);
    p->share = (part->end[1] - part->end[0]) * q->setup->slices / q->e->width;
    p->moves = part->moves;
}

int gk_parts_find(const gk_posed *q, gk_tooth_flanks *f, const double roll[2], double search_distance, gk_place *place)
{
    GK_ASSERT(q->mesh->rides && place);
    const gk_line line = gk_strips_line(q->model, q->mesh, f->side->sg, roll);
    course c = {.q = q, .place = place, .f = f, .roll = roll};
    f->open = GK_ON(q->setup, tip_contact) ? GK_OPEN : GK_OPEN * line.missing;
    run_along(&c, &line);
    place->gap = GK_OPEN;
    for (int i = 0; i < GK_STRIPS(q->setup); i++) {
        const gk_part part = gk_strips_part(q->setup, &line, i);
        profile(&c, &part, &place->point[i]);
        place->gap = gk_min(place->gap, place->point[i].gap);
    }
    if (!(place->gap < search_distance)) return 0;
    for (int i = 0; i < GK_STRIPS(q->setup); i++) {
        const gk_part part = gk_strips_part(q->setup, &line, i);
        section_of(q, f, roll, &part, place, &place->point[i]);
    }
    return 1;
}
