/* Gap of a tooth pair in one transverse section: involute flanks at the actual centre distance in closed form
 * (docs/theory.md, eq. 4), with tip relief (eq. 5) and deviations (eq. 5a), and tip corners off the line of action (eq.
 * 6).
 *
 * External pair, side sg = ±1, R = r_bA + r_bB, d = C_B − C_A, a = |d|, L = √(a² − R²), t = arg d − sg·arccos(R/a), n =
 * sg·(−sin t, cos t): roll of A  s_A = r_bA sg (β_A − t),   roll of B  s_B = r_bB sg (β_B − t − π),   g = L − s_A − s_B
 * + δ_A(s_A) + δ_B(s_B) with β the base angle of the tooth's flank and δ the tip relief. Beyond the end of a flank (s >
 * s_tip) the tip edge, an arc of radius ρ tangent to the flank, meets the other involute along that involute's normal.
 * Gap and gradient go over continuously. Gradients are exact derivatives of these gaps, relief slope included. */
#include "force/gk_section.h"

static gk_action line_of_action(const gk_posed *q, double sg)
{
    const double R = gk_base_distance(q), turn = gk_is_internal(q) ? -1.0 : 1.0;
    double d[2];
    gk_apart(q, d);
    const double dx = turn * d[0], dy = turn * d[1],
                 a2 = dx * dx + dy * dy; /* external: A to B; internal: ring to planet */
    gk_action l = {.sg = sg};
    l.L = sqrt(a2 - R * R);
    l.cosine = (dx * R + sg * dy * l.L) / a2;
    l.sine = (dy * R - sg * dx * l.L) / a2;
    l.t = gk_atan2(l.sine, l.cosine);
    const double turned = l.t - q->mesh->action[sg < 0.0];
    if (fabs(turned) > GK_PI) l.t += turned > 0.0 ? -2.0 * GK_PI : 2.0 * GK_PI; /* teeth are counted from there */
    l.nx = -sg * l.sine;
    l.ny = sg * l.cosine;
    const double radial = -sg * R / (a2 * l.L); /* ∂t = ∂arg d − sg R/(a L) ∂a */
    l.dt_x = turn * (-dy / a2 + radial * dx);
    l.dt_y = turn * (dx / a2 + radial * dy);
    return l;
}

/* the teeth 0 of both gears on one flank (0: drive), and their gap */
gk_flank_side gk_section_side(const gk_posed *q, int flank)
{
    GK_ASSERT(flank == 0 || flank == 1);
    const double sg = flank ? -1.0 : 1.0;
    gk_flank_side s = {.flank = flank, .shift = q->e->shift[flank], .sg = sg, .l = line_of_action(q, sg)};
    s.step = gk_is_internal(q) ? 1 : -1;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = q->gear[i];
        s.pitch[i] = 2.0 * GK_PI / gear->z;
        s.base[i] = q->pose[SPACE * i + PHIA] + gear->phase + sg * gear->psi_b + (i ? s.shift * s.pitch[1] : 0.0);
        s.roll[i] = gear->r_b * sg * (s.base[i] - s.l.t - (i && !gk_is_internal(q) ? GK_PI : 0.0));
    }
    s.p_b = q->gear[0]->r_b * s.pitch[0];
    s.allowance = flank ? q->allowance : 0.0;
    s.gap = (gk_is_internal(q) ? s.roll[1] - s.roll[0] - s.l.L : s.l.L - s.roll[0] - s.roll[1]) + s.allowance;
    s.beyond = GK_ON(q->setup, tip_contact) ? 0.5 * s.p_b : 0.0;
    return s;
}

static double relief(const gk_gear *gear, int on, double s, double *slope)
{
    const double towards_tip = gear->s_tip > gear->s_form ? 1.0 : -1.0,
                 over = on ? towards_tip * (s - gear->relief_start) : 0.0;
    if (over <= 0.0) {
        *slope = 0.0;
        return 0.0;
    }
    *slope = 2.0 * towards_tip * gear->relief * over;
    return gear->relief * over * over;
}

double gk_section_depth(const gk_posed *q, const gk_tooth_flanks *f, int which, double s, double *slope)
{
    const double depth = relief(q->gear[which], GK_ON(q->setup, tip_relief), s, slope);
    if (!GK_HAS(flank_deviations) || !f->depth[which]) return depth;
    double own_slope;
    double own = gk_deviation_at(q->gear[which], f->depth[which], s, &own_slope);
    if (f->next[which]) {
        double next_slope, next = gk_deviation_at(q->gear[which], f->next[which], s, &next_slope);
        own += f->part[which] * (next - own), own_slope += f->part[which] * (next_slope - own_slope);
    }
    *slope += own_slope;
    return depth + own;
}

/* add the derivative of c·s, s = sg r_b (β − t), to a place's gradient; gear 0 or 1 */
static void add_roll(gk_point *p, const gk_action *l, const gk_gear *gear, int which, double c)
{
    const double k = c * l->sg * gear->r_b;
    p->gradient[which ? PHIB : PHIA] += k;
    p->gradient[XA] += k * l->dt_x;
    p->gradient[YA] += k * l->dt_y;
    p->gradient[XB] -= k * l->dt_x;
    p->gradient[YB] -= k * l->dt_y;
}

static void flank_contact(const gk_posed *q, const gk_action *l, const gk_tooth_flanks *f, double g, gk_point *p)
{
    const double sense = gk_is_internal(q) ? -1.0 : 1.0;
    p->gap = g;
    p->curvature = 1.0 / gk_max(p->roll[0], 1e-4) + sense / gk_max(p->roll[1], 1e-4);
    memset(p->gradient, 0, sizeof p->gradient);
    p->gradient[XA] = -l->nx, p->gradient[YA] = -l->ny, p->gradient[PHIA] = -l->sg * q->gear[0]->r_b;
    p->gradient[XB] = l->nx, p->gradient[YB] = l->ny, p->gradient[PHIB] = -sense * l->sg * q->gear[1]->r_b;
    for (int i = 0; i < 2; i++) {
        double slope, depth = gk_section_depth(q, f, i, p->roll[i], &slope);
        p->gap += depth;
        if (slope != 0.0) add_roll(p, l, q->gear[i], i, slope);
    }
}

static void flank_touch(const gk_posed *q, const gk_action *l, const gk_point *p, gk_touch *t)
{
    const double halfway = 0.5 * (gk_is_internal(q) ? p->roll[1] - p->roll[0] - l->L : l->L - p->roll[0] - p->roll[1]);
    t->n[0] = l->nx, t->n[1] = l->ny;
    for (int w = 0; w < 2; w++) {
        const int ring = w && gk_is_internal(q);
        const double side = w && !ring ? -1.0 : 1.0, roll = p->roll[w] + (ring ? -halfway : halfway);
        t->at[w][0] = side * (q->gear[w]->r_b * l->cosine + roll * l->nx);
        t->at[w][1] = side * (q->gear[w]->r_b * l->sine + roll * l->ny);
    }
}

/* Eq. 6: tip edge of gear c (c = 0: A) on the involute of the other gear o. base = base angle β of the tooth of c; l =
 * line of action. Returns 0 when the edge's centre lies inside the base circle of o: no involute there. m: along the
 * other's involute normal, away from its base circle, into the teeth of a ring and out of others (side = 1). */
static int corner_contact(const gk_posed *q, const gk_action *l, int c, const gk_tooth_flanks *f, gk_point *p,
                          gk_touch *t)
{
    const int o = 1 - c;
    const double *beta = f->beta;
    const gk_gear *tip = q->gear[c], *other = q->gear[o];
    const double side = o == 1 && gk_is_internal(q) ? -1.0 : 1.0, own = c == 1 && gk_is_internal(q) ? -1.0 : 1.0;
    double d[2];
    double over = p->roll[c] - tip->s_tip, sine, cosine;
    gk_sincos(beta[c] - l->sg * tip->corner_angle, &sine, &cosine);
    double rx = tip->corner_radius * cosine, ry = tip->corner_radius * sine; /* edge centre from the axis of c */
    gk_apart(q, d);
    const double ox = c == 0 ? -d[0] : d[0], oy = c == 0 ? -d[1] : d[1];
    double dx = ox + rx, dy = oy + ry, r2 = dx * dx + dy * dy, l2 = r2 - other->r_b * other->r_b;
    if (l2 <= 1e-10) return 0;
    double length = sqrt(l2);
    /* tangent point direction of the other's base circle: arg(D) − sg·atan(length / r_b) */
    double ct = (dx * other->r_b + l->sg * dy * length) / r2, st = (dy * other->r_b - l->sg * dx * length) / r2;
    double nominal = l->t + (o == 1 && !gk_is_internal(q) ? GK_PI
                                                          : 0.0); /* t′ is near t (+π): the small difference as angle */
    gk_sincos(nominal, &sine, &cosine);
    double turn = gk_atan2(st * cosine - ct * sine, ct * cosine + st * sine);
    double s = other->r_b * l->sg * (beta[o] - nominal - turn);
    double mx = -l->sg * st, my = l->sg * ct;
    const double ux = side * mx, uy = side * my; /* outward normal of the other's flank */
    double slope_c, slope_o, relief_c = gk_section_depth(q, f, c, tip->s_tip, &slope_c),
                             relief_o = gk_section_depth(q, f, o, s, &slope_o);
    double fade = 1.0 / (1.0 + own * over / tip->edge);
    p->gap = side * (length - s) - tip->edge + relief_c + slope_c * over * fade + relief_o;
    memset(p->gradient, 0, sizeof p->gradient);
    p->gradient[SPACE * c] = ux;
    p->gradient[SPACE * c + 1] = uy;
    p->gradient[SPACE * c + 2] = ux * -ry + uy * rx;
    p->gradient[SPACE * o] = -ux;
    p->gradient[SPACE * o + 1] = -uy;
    p->gradient[SPACE * o + 2] = -side * l->sg * other->r_b;
    if (slope_c != 0.0) add_roll(p, l, tip, c, slope_c * fade * fade);
    if (slope_o != 0.0) { /* ∂s = sg r_b (∂φ_o − ∂t′), ∂t′ = ∂arg D − sg (r_b/(length r²)) D·∂D */
        double k = slope_o * l->sg * other->r_b, radial = -l->sg * other->r_b / (length * r2);
        double tx = -k * (-dy / r2 + radial * dx), ty = -k * (dx / r2 + radial * dy);
        p->gradient[SPACE * c] += tx;
        p->gradient[SPACE * c + 1] += ty;
        p->gradient[SPACE * c + 2] += tx * -ry + ty * rx;
        p->gradient[SPACE * o] -= tx;
        p->gradient[SPACE * o + 1] -= ty;
        p->gradient[SPACE * o + 2] += k;
    }
    p->roll[c] = tip->s_tip;
    p->roll[o] = s;
    if (t) {
        const double out = c == 0 ? -1.0 : 1.0, middle = 0.5 * (s + length - side * tip->edge);
        t->n[0] = out * ux, t->n[1] = out * uy;
        t->at[o][0] = other->r_b * ct + middle * mx, t->at[o][1] = other->r_b * st + middle * my;
        t->at[c][0] = rx + (middle - length) * mx, t->at[c][1] = ry + (middle - length) * my;
    }
    /* the contact patch leaves the flank over about the strip's half-width */
    double blend = gk_clamp(own * over / tip->strip, 0.0, 1.0);
    blend = blend * blend * (3.0 - 2.0 * blend);
    p->curvature = own * (1.0 - blend) / tip->s_tip + blend / tip->edge + side / gk_max(s, 1e-4);
    return 1;
}

/* The transverse section of a tooth pair where its base angles are β and its rolls are in p; 0 where the flanks have
 * ended. A loaded pair reaches past the end by its deflection. t: where it touches, NULL: not asked for. */
int gk_section(const gk_posed *q, const gk_tooth_flanks *f, gk_point *p, gk_touch *t)
{
    GK_ASSERT(f->side && p);
    const gk_flank_side *s = f->side;
    const int tip_b = gk_is_internal(q) ? p->roll[1] < q->gear[1]->s_tip : p->roll[1] > q->gear[1]->s_tip;
    const int corner = p->roll[0] > q->gear[0]->s_tip ? 0 : tip_b ? 1 : -1;
    if (corner >= 0 && !GK_ON(q->setup, tip_contact)) return 0;
    if (corner < 0) {
        flank_contact(q, &s->l, f, s->gap - f->closer, p);
        if (t) flank_touch(q, &s->l, p, t);
        return 1;
    }
    if (!corner_contact(q, &s->l, corner, f, p, t)) return 0;
    p->gap += s->allowance;
    return 1;
}

/* The section at z, of rolls `roll` at mid-width; past the ends of the flanks these go on as involutes, open. */
void gk_section_at(const gk_posed *q, const gk_tooth_flanks *f, const double roll[2], double z, gk_point *p,
                   gk_touch *t)
{
    GK_ASSERT(p && t);
    const gk_flank_side *s = f->side;
    gk_tooth_flanks here = *f;
    for (int w = 0; w < 2; w++) {
        p->roll[w] = roll[w] + s->sg * z * q->mesh->helix[w];
        here.beta[w] = f->beta[w] + z * q->mesh->helix[w] / q->gear[w]->r_b;
    }
    if (gk_section(q, &here, p, t)) return;
    flank_contact(q, &s->l, &here, s->gap - f->closer + f->open, p);
    flank_touch(q, &s->l, p, t);
}
