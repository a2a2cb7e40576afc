/* Lines of contact of helical teeth, cut into parts that move and grow with them (docs/theory.md, 2.6). A part closes
 * gradually: its gap is the least of GAPS places along it, and the law of its contact (gk_law.c) knows the others. They
 * follow from sections at both ends and in the middle of every part by a parabola: flank, relief, deviations, lead,
 * tilt, and past a tip edge the gap of the corner. */
#include "force/gk_parts.h"

static const double BENT = 50e-6; /* m: more than a parabola within a part can mean */

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

/* deviations of both flanks at z: between two places of their fields */
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

/* what leads of both gears open at z, in the transverse section */
static double lead_at(const gk_posed *q, int flank, double z)
{
    double sum = 0.0;
    for (int w = 0; w < 2 && GK_ON(q->setup, flank_deviations); w++)
        sum += gk_strips_lead(q->gear[w], flank, 2.0 * z / q->gear[w]->width);
    return sum;
}

typedef struct cut { /* a section at z */
    double z;
    gk_point point;
    gk_touch touch;
} cut;

/* the section at z with all that opens it there */
static void cut_line(const gk_posed *q, const gk_place *place, gk_tooth_flanks *f, const double roll[2], cut *at)
{
    take_fields(q, place, at->z, f);
    gk_section_at(q, f, roll, at->z, &at->point, &at->touch);
    gk_parts_lean(q, f->side->sg, &at->touch, at->z, &at->point);
    at->point.gap += q->mesh->cosine * lead_at(q, f->side->flank, at->z);
}

static void order(double *a, double *b)
{
    const double low = gk_min(*a, *b), high = gk_max(*a, *b);
    *a = low, *b = high;
}

/* gaps at GAPS places of a part by those at its ends and in its middle: the least, and what the others are more; their
 * mean where a part closes as a whole */
static void profile(const double gap[3], int gradual, gk_point *p)
{
    const double rise = gap[2] - gap[0], bend = gap[0] - 2.0 * gap[1] + gap[2];
    double at[GAPS], mean = 0.0;
    for (int i = 0; i < GAPS; i++) {
        const double u = (i + 0.5) / GAPS - 0.5, v = 2.0 * fabs(u);
        at[i] = fabs(bend) < BENT ? gap[1] + rise * u + 2.0 * bend * u * u
                                  : (1.0 - v) * gap[1] + v * gap[u < 0.0 ? 0 : 2];
        mean += at[i] / GAPS;
    }
    order(&at[0], &at[1]), order(&at[2], &at[3]), order(&at[0], &at[2]), order(&at[1], &at[3]), order(&at[1], &at[2]);
    p->gap = gradual ? at[0] : mean;
    for (int i = 1; i < GAPS; i++) p->opens[i - 1] = gradual ? at[i] - at[0] : 0.0;
}

int gk_parts_find(const gk_posed *q, gk_tooth_flanks *f, const double roll[2], double search_distance, gk_place *place)
{
    GK_ASSERT(q->mesh->rides && place);
    const double sg = f->side->sg;
    const gk_line line = gk_strips_line(q->model, q->mesh, sg, roll);
    const int gradual = q->mesh->yields > 0.0;
    double gap[3] = {0};
    f->open = GK_ON(q->setup, tip_contact) ? GK_OPEN : GK_OPEN * line.missing;
    place->gap = GK_OPEN;
    for (int i = 0; i < GK_STRIPS(q->setup); i++) {
        const gk_part part = gk_strips_part(q->setup, &line, i);
        const double z[3] = {part.end[0], part.end[1], part.middle};
        const int into[3] = {0, 2, 1};
        gk_point *p = &place->point[i];
        cut at;
        for (int k = i ? 1 : 0; k < 3; k++) {
            at.z = z[k];
            cut_line(q, place, f, roll, &at);
            gap[into[k]] = at.point.gap;
        }
        if (part.flank != part.middle) {
            take_fields(q, place, part.flank, f);
            gk_section_at(q, f, roll, part.flank, &at.point, &at.touch);
            gk_parts_lean(q, sg, &at.touch, part.middle, &at.point);
        }
        *p = at.point;
        profile(gap, gradual, p);
        if (GK_ON(q->setup, friction)) gk_parts_glide(q, sg, &at.touch, part.middle, p);
        memcpy(p->end, part.end, sizeof p->end);
        p->share = (part.end[1] - part.end[0]) * q->setup->slices / q->e->width;
        place->gap = gk_min(place->gap, p->gap);
        gap[0] = gap[2];
    }
    return place->gap < search_distance;
}
