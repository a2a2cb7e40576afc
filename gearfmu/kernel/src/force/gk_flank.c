/* Where teeth may touch: gaps of involute flanks at the actual centre distance, closed form (docs/theory.md, eq. 4),
 * with tip relief (eq. 5), and of tip corners off the line of action (eq. 6).
 *
 * External pair, side sg = ±1, R = r_bA + r_bB, d = C_B − C_A, a = |d|, L = √(a² − R²), t = arg d − sg·arccos(R/a), n =
 * sg·(−sin t, cos t): roll of A  s_A = r_bA sg (β_A − t),   roll of B  s_B = r_bB sg (β_B − t − π),   g = L − s_A − s_B
 * + δ_A(s_A) + δ_B(s_B) with β the base angle of the tooth's flank and δ the tip relief. Beyond the end of a flank (s >
 * s_tip) the tip edge, an arc of radius ρ tangent to the flank, meets the other involute along that involute's normal.
 * Gap and gradient go over continuously. Gradients are exact derivatives of these gaps, relief slope included. A tooth
 * with an index deviation ε is the same tooth at β + ε (eq. 4a). */
#include "problem/gk_work.h"

typedef struct pair { /* the gears of an engagement at their poses */
    const gk_model *model;
    const gk_setup *setup;
    const gk_engagement *e;
    const gk_mesh *mesh;
    const gk_gear *gear[2];
    const double *pose;
    double allowance;
} pair;

typedef struct line {              /* line of action of one side */
    double sg, L, sine, cosine, t; /* of t */
    double nx, ny;                 /* n */
    double dt_x, dt_y;             /* ∂t/∂(C_B − C_A) */
} line;

/* Where a transverse section touches: direction of the force on B, and the point halfway between the teeth from the
 * axis of either gear, the same for both */
typedef struct touch {
    double n[2], at[2][2];
} touch;

static pair pair_of(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *pose)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    return (pair){model, setup, e, mesh, {&model->gear[e->gear[0]], &model->gear[e->gear[1]]}, pose, mesh->allowance};
}

static int internal(const pair *q) { return q->e->kind == MESH_INTERNAL; }

/* from the axis of A to that of B */
static void apart(const pair *q, double d[2])
{
    for (int c = 0; c < 2; c++)
        d[c] = q->e->position[1][c] + q->pose[XB + c] - (q->e->position[0][c] + q->pose[XA + c]);
}

static double reach_of(const pair *q) { return q->gear[1]->r_b + (internal(q) ? -1.0 : 1.0) * q->gear[0]->r_b; }

static line line_of_action(const pair *q, double sg)
{
    const double R = reach_of(q), turn = internal(q) ? -1.0 : 1.0;
    double d[2];
    apart(q, d);
    const double dx = turn * d[0], dy = turn * d[1],
                 a2 = dx * dx + dy * dy; /* external: A to B; internal: ring to planet */
    line l = {.sg = sg};
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

typedef struct flank_side flank_side;

/* The flanks of a tooth pair in one transverse section */
typedef struct tooth_flanks {
    const flank_side *side;
    double beta[2], closer; /* base angles; what the gap loses by the places of the teeth */
    const double *depth[2]; /* along the roll, beside involute and tip relief (eq. 5a); NULL: nothing */
} tooth_flanks;

/* what a flank has lost to relief and deviations at a length of roll */
static double depth_of(const pair *q, const tooth_flanks *f, int which, double s, double *slope)
{
    const double depth = relief(q->gear[which], GK_ON(q->setup, tip_relief), s, slope);
    if (!GK_HAS(flank_deviations) || !f->depth[which]) return depth;
    double own_slope;
    const double own = gk_deviation_at(q->gear[which], f->depth[which], s, &own_slope);
    *slope += own_slope;
    return depth + own;
}

/* add the derivative of c·s, s = sg r_b (β − t), to a place's gradient; gear 0 or 1 */
static void add_roll(gk_point *p, const line *l, const gk_gear *gear, int which, double c)
{
    const double k = c * l->sg * gear->r_b;
    p->gradient[which ? PHIB : PHIA] += k;
    p->gradient[XA] += k * l->dt_x;
    p->gradient[YA] += k * l->dt_y;
    p->gradient[XB] -= k * l->dt_x;
    p->gradient[YB] -= k * l->dt_y;
}

static void flank_contact(const pair *q, const line *l, const tooth_flanks *f, double g, gk_point *p)
{
    const double sense = internal(q) ? -1.0 : 1.0;
    p->gap = g;
    p->curvature = 1.0 / gk_max(p->roll[0], 1e-4) + sense / gk_max(p->roll[1], 1e-4);
    memset(p->gradient, 0, sizeof p->gradient);
    p->gradient[XA] = -l->nx, p->gradient[YA] = -l->ny, p->gradient[PHIA] = -l->sg * q->gear[0]->r_b;
    p->gradient[XB] = l->nx, p->gradient[YB] = l->ny, p->gradient[PHIB] = -sense * l->sg * q->gear[1]->r_b;
    for (int i = 0; i < 2; i++) {
        double slope, depth = depth_of(q, f, i, p->roll[i], &slope);
        p->gap += depth;
        if (slope != 0.0) add_roll(p, l, q->gear[i], i, slope);
    }
}

static void flank_touch(const pair *q, const line *l, const gk_point *p, touch *t)
{
    const double halfway = 0.5 * (internal(q) ? p->roll[1] - p->roll[0] - l->L : l->L - p->roll[0] - p->roll[1]);
    t->n[0] = l->nx, t->n[1] = l->ny;
    for (int w = 0; w < 2; w++) {
        const int ring = w && internal(q);
        const double side = w && !ring ? -1.0 : 1.0, roll = p->roll[w] + (ring ? -halfway : halfway);
        t->at[w][0] = side * (q->gear[w]->r_b * l->cosine + roll * l->nx);
        t->at[w][1] = side * (q->gear[w]->r_b * l->sine + roll * l->ny);
    }
}

/* Eq. 6: tip edge of gear c (c = 0: A) on the involute of the other gear o. base = base angle β of the tooth of c; l =
 * line of action. Returns 0 when the edge's centre lies inside the base circle of o: no involute there. m: along the
 * other's involute normal, away from its base circle, into the teeth of a ring and out of others (side = 1). */
static int corner_contact(const pair *q, const line *l, int c, const tooth_flanks *f, gk_point *p, touch *t)
{
    const int o = 1 - c;
    const double *beta = f->beta;
    const gk_gear *tip = q->gear[c], *other = q->gear[o];
    const double side = o == 1 && internal(q) ? -1.0 : 1.0, own = c == 1 && internal(q) ? -1.0 : 1.0;
    double d[2];
    double over = p->roll[c] - tip->s_tip, sine, cosine;
    gk_sincos(beta[c] - l->sg * tip->corner_angle, &sine, &cosine);
    double rx = tip->corner_radius * cosine, ry = tip->corner_radius * sine; /* edge centre from the axis of c */
    apart(q, d);
    const double ox = c == 0 ? -d[0] : d[0], oy = c == 0 ? -d[1] : d[1];
    double dx = ox + rx, dy = oy + ry, r2 = dx * dx + dy * dy, l2 = r2 - other->r_b * other->r_b;
    if (l2 <= 1e-10) return 0;
    double length = sqrt(l2);
    /* tangent point direction of the other's base circle: arg(D) − sg·atan(length / r_b) */
    double ct = (dx * other->r_b + l->sg * dy * length) / r2, st = (dy * other->r_b - l->sg * dx * length) / r2;
    double nominal = l->t +
                     (o == 1 && !internal(q) ? GK_PI : 0.0); /* t′ is near t (+π): the small difference as angle */
    gk_sincos(nominal, &sine, &cosine);
    double turn = gk_atan2(st * cosine - ct * sine, ct * cosine + st * sine);
    double s = other->r_b * l->sg * (beta[o] - nominal - turn);
    double mx = -l->sg * st, my = l->sg * ct;
    const double ux = side * mx, uy = side * my; /* outward normal of the other's flank */
    double slope_c, slope_o, relief_c = depth_of(q, f, c, tip->s_tip, &slope_c),
                             relief_o = depth_of(q, f, o, s, &slope_o);
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

/* What gear A slides past B along the profile of A, per motion of the poses: e = e_p of A, square to n in the section
 */
static void glide(const pair *q, double sg, const touch *t, double z, gk_point *p)
{
    const double ex = sg * t->n[1], ey = -sg * t->n[0];
    for (int w = 0; w < 2; w++) {
        const double sense = w ? -1.0 : 1.0, up = z - q->pose[SPACE * w + ZA], *at = t->at[w];
        double *slide = p->slide + SPACE * w;
        slide[XA] = sense * ex, slide[YA] = sense * ey, slide[PHIA] = sense * (at[0] * ey - at[1] * ex);
        slide[ZA] = 0.0, slide[RXA] = -sense * up * ey, slide[RYA] = sense * up * ex;
    }
}

/* Teeth out of their places (index deviation, ISO 1328-1): flank, roll and base angle turn with the tooth. Returns what
 * the gap loses. */
static double misplace(const pair *q, double sg, const gk_place *p, double beta[2], double rolls[2])
{
    double closer = 0.0;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = q->gear[i];
        if (!gear->index) continue;
        const double angle = gear->index[p->flank * gear->z + p->tooth[i]], roll = sg * gear->r_b * angle;
        beta[i] += angle;
        rolls[i] += roll;
        closer += i && internal(q) ? -roll : roll;
    }
    return closer;
}

struct flank_side {         /* one side of the teeth: base angles and lengths of roll of the teeth 0 */
    int flank, shift, step; /* step: B's tooth is shift + step·k */
    double sg, pitch[2], p_b, base[2], roll[2], gap, beyond, allowance;
    line l;
};

static flank_side side_of(const pair *q, int flank)
{
    const double sg = flank ? -1.0 : 1.0;
    flank_side s = {.flank = flank, .shift = q->e->shift[flank], .sg = sg, .l = line_of_action(q, sg)};
    s.step = internal(q) ? 1 : -1;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = q->gear[i];
        s.pitch[i] = 2.0 * GK_PI / gear->z;
        s.base[i] = q->pose[SPACE * i + PHIA] + gear->phase + sg * gear->psi_b + (i ? s.shift * s.pitch[1] : 0.0);
        s.roll[i] = gear->r_b * sg * (s.base[i] - s.l.t - (i && !internal(q) ? GK_PI : 0.0));
    }
    s.p_b = q->gear[0]->r_b * s.pitch[0];
    s.allowance = flank ? q->allowance : 0.0;
    s.gap = (internal(q) ? s.roll[1] - s.roll[0] - s.l.L : s.l.L - s.roll[0] - s.roll[1]) + s.allowance;
    s.beyond = GK_ON(q->setup, tip_contact) ? 0.5 * s.p_b : 0.0;
    return s;
}

/* the teeth k of A that may touch: their rolls lie between the other gear's end and their own; 0: nonsense */
static int teeth(const pair *q, const flank_side *s, double ends[2])
{
    const double beyond = s->beyond + 0.5 * q->e->width * fabs(q->mesh->helix[0]);
    const double first = (internal(q) ? q->gear[1]->s_tip - s->l.L : s->l.L - q->gear[1]->s_tip) - beyond;
    const double last = q->gear[0]->s_tip + beyond;
    ends[0] = s->sg > 0 ? (first - s->roll[0]) / s->p_b : (s->roll[0] - last) / s->p_b;
    ends[1] = s->sg > 0 ? (last - s->roll[0]) / s->p_b : (s->roll[0] - first) / s->p_b;
    return ends[0] > -1e8 && ends[1] < 1e8;
}

static int modulo(int64_t k, int z)
{
    const int m = (int)(k % z);
    return m < 0 ? m + z : m;
}

/* where both gears stand in the tables of their sides; 0 when the poses are meaningless */
static void place_sides(const pair *q, const gk_mesh *mesh, const flank_side *drive, gk_position position[2])
{
    for (int w = 0; w < 2; w++) {
        gk_position *at = &position[w];
        const gk_side *side = &mesh->side[w];
        const double u = drive->roll[w] / side->pitch, whole = gk_floor(u), x = (u - whole) * side->nodes;
        at->reference = (w ? drive->shift : 0) - (int64_t)whole;
        at->tooth = modulo(at->reference, q->gear[w]->z);
        at->node = (int)x < side->nodes ? (int)x : side->nodes - 1;
        at->part = x - at->node;
    }
}

/* entries of a place in the tables of both sides; 0 when it lies beyond one of them */
static int in_tables(const gk_mesh *mesh, const gk_position position[2], gk_place *p)
{
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &mesh->side[w];
        const int64_t offset = side->step * (p->number[w] - position[w].reference - side->first[p->flank]);
        if (offset < 0 || offset >= side->count[p->flank]) return 0;
        p->candidate[w] = (int)offset + (p->flank ? side->count[0] : 0);
    }
    return 1;
}

/* The transverse section of a tooth pair where its base angles are β and its rolls are in p; 0 where the flanks have
 * ended. A loaded pair reaches past the end by its deflection. t: where it touches, NULL: not asked for. */
static int section(const pair *q, const tooth_flanks *f, gk_point *p, touch *t)
{
    const flank_side *s = f->side;
    const int tip_b = internal(q) ? p->roll[1] < q->gear[1]->s_tip : p->roll[1] > q->gear[1]->s_tip;
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

/* ---- slices of helical or tilted teeth --------------------------------------------------------------------------- */
static const double LEAN = 0.2e-3; /* m: what tilts may close of a gap */
static const double OPEN = 1e-3;   /* m: gap of a strip that has left its flanks */

/* From the transverse section at z into space: the normal is n = cos β_b n_t − sg sin β_b e_z, a gear that moves
 * along its axis or tilts about its mid-width moves the point of contact along it. Both gears have the point halfway
 * between their teeth, so that contact forces are in balance with their moments. */
static void lean(const pair *q, double sg, const touch *t, double z, gk_point *p)
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

/* one transverse section of a strip, in its plane */
static void section_at(const pair *q, const tooth_flanks *f, const double roll[2], double z, gk_point *p, touch *t)
{
    const flank_side *s = f->side;
    tooth_flanks here = *f;
    for (int w = 0; w < 2; w++) {
        p->roll[w] = roll[w] + s->sg * z * q->mesh->helix[w];
        here.beta[w] = f->beta[w] + z * q->mesh->helix[w] / q->gear[w]->r_b;
    }
    if (section(q, &here, p, t)) return;
    flank_contact(q, &s->l, &here, s->gap - f->closer + OPEN, p);
    flank_touch(q, &s->l, p, t);
}

/* of a strip of both teeth */
static void take_deviations(const pair *q, const gk_place *p, int strip, tooth_flanks *f)
{
    for (int w = 0; w < 2; w++) f->depth[w] = gk_deviation_line(&q->mesh->deviation[w], p->tooth[w], p->flank, strip);
}

/* Every strip by itself, in the middle of its part that carries; 0 when none comes within `search_distance`. Strips of
 * spur teeth with the same deviations have one section. */
static int strips_of(const pair *q, tooth_flanks *f, const double roll[2], double search_distance, gk_place *place)
{
    const flank_side *s = f->side;
    const int spur = q->mesh->helix[0] == 0.0 && q->mesh->helix[1] == 0.0;
    const double *depth[2] = {NULL, NULL};
    gk_point plane;
    touch t;
    place->gap = OPEN;
    for (int i = 0; i < GK_STRIPS(q->setup); i++) {
        gk_point *p = &place->point[i];
        const gk_part part = gk_strips_part(q->model, q->setup, q->mesh, s->sg, roll, i);
        take_deviations(q, place, i, f);
        if (!i || !spur || f->depth[0] != depth[0] || f->depth[1] != depth[1])
            section_at(q, f, roll, part.middle, &plane, &t);
        *p = plane, depth[0] = f->depth[0], depth[1] = f->depth[1];
        lean(q, s->sg, &t, part.middle, p);
        if (GK_ON(q->setup, friction)) glide(q, s->sg, &t, part.middle, p);
        p->share = part.share;
        p->gap += q->mesh->cosine * q->mesh->lead[s->flank][i];
        place->gap = gk_min(place->gap, p->gap);
    }
    return place->gap < search_distance;
}

/* one tooth pair; 0 when it does not come within `search_distance` */
static int tooth_pair(const pair *q, const flank_side *s, int k, double search_distance, gk_place *p)
{
    tooth_flanks f = {s, {s->base[0] + k * s->pitch[0], s->base[1] + s->step * k * s->pitch[1]}, 0.0, {NULL, NULL}};
    double roll[2] = {s->roll[0] + s->sg * k * s->p_b, s->roll[1] + s->step * s->sg * k * s->p_b};
    p->key.flank = p->flank = s->flank;
    p->key.tooth = k;
    p->action = s->l.t;
    p->number[0] = k, p->number[1] = s->shift + s->step * k;
    for (int i = 0; i < 2; i++) p->tooth[i] = modulo(p->number[i], q->gear[i]->z);
    if (q->gear[0]->index || q->gear[1]->index) f.closer = misplace(q, s->sg, p, f.beta, roll);
    if (q->setup->spatial) return strips_of(q, &f, roll, search_distance, p);
    take_deviations(q, p, 0, &f);
    p->point[0].share = 1.0;
    p->point[0].roll[0] = roll[0], p->point[0].roll[1] = roll[1];
    touch t;
    const int glides = GK_ON(q->setup, friction);
    if (!section(q, &f, &p->point[0], glides ? &t : NULL)) return 0;
    if (glides) glide(q, s->sg, &t, 0.0, &p->point[0]);
    p->gap = p->point[0].gap;
    return p->gap < search_distance;
}

/* moves the gaps of a place along their gradients */
void gk_flank_move(const gk_setup *setup, gk_place *place, const double delta[POSE])
{
    GK_ASSERT(setup && place && delta);
    place->gap = INFINITY;
    for (int i = 0; i < (setup->spatial ? GK_STRIPS(setup) : 1); i++) {
        gk_point *p = &place->point[i];
        for (int d = 0; d < POSE; d++) p->gap += p->gradient[d] * delta[d];
        place->gap = gk_min(place->gap, p->gap);
    }
}

static int find_side(const pair *q, const gk_mesh *mesh, const flank_side *s, double search_distance,
                     const gk_position position[2], gk_place *place, int room)
{
    double ends[2];
    int found = 0;
    const double leaning = q->setup->spatial ? LEAN : 0.0;
    if (!(s->gap - mesh->protrusion - leaning < search_distance))
        return 0; /* the whole side is open: it costs this one comparison */
    if (!teeth(q, s, ends)) return -1;
    for (int k = (int)gk_floor(ends[0]) + 1; k <= (int)gk_floor(ends[1]) && found < room; k++)
        if (tooth_pair(q, s, k, search_distance, &place[found]) && in_tables(mesh, position, &place[found])) found++;
    return found;
}

static int find_flat(const pair *q, double search_distance, gk_position position[2], gk_place *p)
{
    memset(p, 0, sizeof *p);
    memset(position, 0, 2 * sizeof *position);
    p->gap = q->e->position[1][0] - q->e->position[0][0] + q->pose[PHIB] - q->pose[PHIA];
    for (int i = 0; i < (q->setup->spatial ? GK_STRIPS(q->setup) : 1); i++) {
        gk_point *at = &p->point[i];
        at->gap = p->gap, at->curvature = at->share = 1.0;
        at->gradient[PHIA] = -1.0, at->gradient[PHIB] = 1.0;
    }
    return p->gap < search_distance;
}

/* t of both flanks where the gears stand without load: not cut at ±π, so that both count teeth alike */
static void nominal_action(const pair *q, gk_mesh *mesh)
{
    const double turn = internal(q) ? -1.0 : 1.0;
    double d[2];
    apart(q, d);
    const double towards = gk_atan2(turn * d[1], turn * d[0]), alpha = gk_acos(reach_of(q) / mesh->distance);
    mesh->action[0] = towards - alpha, mesh->action[1] = towards + alpha;
}

/* Gaps of both flanks of a tooth together depend on the centre distance alone: straight but for its square */
static const double BENDS = 20.0, SURE = 1e-6; /* of it per centre distance; m */

void gk_flank_clearance(const gk_model *model, const gk_setup *setup, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    double pose[POSE] = {0}, d[2], sum[2];
    pair q = pair_of(model, setup, mesh, pose);
    const double step = 1e-5;
    apart(&q, d);
    mesh->distance = sqrt(d[0] * d[0] + d[1] * d[1]);
    nominal_action(&q, mesh);
    for (int i = 0; i < 2; i++) {
        for (int c = 0; c < 2; c++) pose[XB + c] = i * step * d[c] / mesh->distance;
        const flank_side drive = side_of(&q, 0), coast = side_of(&q, 1);
        sum[i] = drive.gap + coast.gap;
    }
    mesh->clearance = sum[0];
    mesh->clearance_slope = (sum[1] - sum[0]) / step;
}

/* no coast flank can be near, by the gaps of the drive flanks */
static int coast_is_open(const pair *q, const gk_mesh *mesh, const flank_side *drive, double a, double search_distance)
{
    const double apart = a - mesh->distance, sum = mesh->clearance + mesh->clearance_slope * apart;
    return sum - drive->gap - mesh->protrusion - (q->setup->spatial ? LEAN : 0.0) >
           search_distance + SURE + BENDS * apart * apart / mesh->distance;
}

/* `gk_flank_find` where both toothings stand */
static int find(const pair *q, double search_distance, gk_position position[2], gk_place *place)
{
    const double *pose = q->pose;
    if (q->e->kind == MESH_FLAT) return find_flat(q, search_distance, position, place);
    const double R = reach_of(q);
    double d[2];
    apart(q, d);
    const double a2 = d[0] * d[0] + d[1] * d[1];
    if (!(a2 > 1.0001 * R * R) || !(a2 < 1e4) || !(fabs(pose[PHIA]) < 1e9) || !(fabs(pose[PHIB]) < 1e9)) return -1;
    const flank_side drive = side_of(q, 0);
    place_sides(q, q->mesh, &drive, position);
    const int both = GK_ON(q->setup, coast_flank);
    const int found = both || !q->mesh->coasts
                          ? find_side(q, q->mesh, &drive, search_distance, position, place, MAX_PAIRS)
                          : 0;
    if (found < 0 || !(both || q->mesh->coasts)) return found;
    if (coast_is_open(q, q->mesh, &drive, sqrt(a2), search_distance)) return found;
    const flank_side coast = side_of(q, 1);
    const int back = find_side(q, q->mesh, &coast, search_distance, position, place + found, MAX_PAIRS - found);
    return back < 0 ? -1 : found + back;
}

/* All tooth pairs whose undeformed gap is below `search_distance` at the given poses, and where the sides stand in
 * their tables; −1 when the poses are meaningless. Without coast flanks those that carry when the first port drives the
 * stage. The spins of a flat engagement are translations. */
int gk_flank_find(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *pose,
                  double search_distance, gk_position position[2], gk_place *place)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    GK_ASSERT(pose && position && place);
    GK_ASSERT(search_distance >= 0.0);
    pair q = pair_of(model, setup, mesh, pose);
    double moved[POSE], turn[POSE];
    if (!GK_HAS(runout) || !mesh->runs_out) return find(&q, search_distance, position, place);
    memcpy(moved, pose, sizeof moved);
    gk_runout_move(model, setup, q.e, moved, turn);
    q.pose = moved;
    const int found = find(&q, search_distance, position, place);
    for (int i = 0; i < found; i++)
        for (int s = 0; s < (setup->spatial ? GK_STRIPS(setup) : 1); s++) {
            gk_runout_turn(turn, place[i].point[s].gradient);
            if (GK_ON(setup, friction)) gk_runout_turn(turn, place[i].point[s].slide);
        }
    return found;
}
