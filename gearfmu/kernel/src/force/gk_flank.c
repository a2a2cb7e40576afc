/* Where teeth may touch: gaps of involute flanks at the actual centre distance, closed form (docs/theory.md, eq. 4),
 * with tip relief (eq. 5), and of tip corners off the line of action (eq. 6).
 *
 * External pair, side sg = ±1, R = r_bA + r_bB, d = C_B − C_A, a = |d|, L = √(a² − R²), t = arg d − sg·arccos(R/a), n =
 * sg·(−sin t, cos t): roll of A  s_A = r_bA sg (β_A − t),   roll of B  s_B = r_bB sg (β_B − t − π),   g = L − s_A − s_B
 * + δ_A(s_A) + δ_B(s_B) with β the base angle of the tooth's flank and δ the tip relief. Beyond the end of a flank (s >
 * s_tip) the tip edge, an arc of radius ρ tangent to the flank, meets the other involute along that involute's normal.
 * Gap and gradient go over continuously. Gradients are exact derivatives of these gaps, relief slope included. A tooth
 * with an index deviation ε is the same tooth at β + ε (eq. 4a). */
#include "model/gk_core.h"

typedef struct line {              /* line of action of one side */
    double sg, L, sine, cosine, t; /* of t */
    double nx, ny;                 /* n */
    double dt_x, dt_y;             /* ∂t/∂d */
} line;

static line line_of_action(const double *frame, const gk_model *model, double sg)
{
    double R = model->gear[0].r_b + model->gear[1].r_b;
    double dx = model->distance + frame[XB] - frame[XA], dy = frame[YB] - frame[YA];
    double a2 = dx * dx + dy * dy;
    line l = {.sg = sg};
    l.L = sqrt(a2 - R * R);
    l.cosine = (dx * R + sg * dy * l.L) / a2;
    l.sine = (dy * R - sg * dx * l.L) / a2;
    l.t = gk_atan2(l.sine, l.cosine);
    l.nx = -sg * l.sine;
    l.ny = sg * l.cosine;
    double radial = -sg * R / (a2 * l.L); /* ∂t = ∂arg d − sg R/(a L) ∂a */
    l.dt_x = -dy / a2 + radial * dx;
    l.dt_y = dx / a2 + radial * dy;
    return l;
}

static double relief(const gk_gear *gear, int on, double s, double *slope)
{
    double over = on ? s - gear->relief_start : 0.0;
    if (over <= 0.0) {
        *slope = 0.0;
        return 0.0;
    }
    *slope = 2.0 * gear->relief * over;
    return gear->relief * over * over;
}

/* add the derivative of c·s, s = sg r_b (β − t), to a place's gradient; gear 0 or 1 */
static void add_roll(gk_place *p, const line *l, const gk_gear *gear, int which, double c)
{
    double k = c * l->sg * gear->r_b;
    p->gradient[which ? PHIB : PHIA] += k;
    p->gradient[XA] += k * l->dt_x;
    p->gradient[YA] += k * l->dt_y;
    p->gradient[XB] -= k * l->dt_x;
    p->gradient[YB] -= k * l->dt_y;
}

static void flank_contact(const gk_model *model, const gk_setup *setup, const line *l, double g, gk_place *p)
{
    p->gap = g;
    p->curvature = 1.0 / gk_max(p->roll[0], 1e-4) + 1.0 / gk_max(p->roll[1], 1e-4);
    const double gradient[6] = {-l->nx, -l->ny, -l->sg * model->gear[0].r_b, l->nx, l->ny, -l->sg * model->gear[1].r_b};
    memcpy(p->gradient, gradient, sizeof gradient);
    for (int i = 0; i < 2; i++) {
        double slope, depth = relief(&model->gear[i], GK_ON(setup, tip_relief), p->roll[i], &slope);
        p->gap += depth;
        if (slope != 0.0) add_roll(p, l, &model->gear[i], i, slope);
    }
}

/* Eq. 6: tip edge of gear c (c = 0: A) on the involute of the other gear o. base = base angle β of the tooth of c; l =
 * line of action. Returns 0 when the edge's centre lies inside the base circle of o: no involute there. All formulas
 * for c = 0; for c = 1 the roles and the direction of n swap, which the signs below say. */
static int corner_contact(const gk_model *model, const gk_setup *setup, const double *frame, const line *l, int c,
                          const double beta[2], gk_place *p)
{
    const int o = 1 - c;
    const gk_gear *tip = &model->gear[c], *other = &model->gear[o];
    double over = p->roll[c] - tip->s_tip, sine, cosine;
    gk_sincos(beta[c] - l->sg * tip->corner_angle, &sine, &cosine);
    double rx = tip->corner_radius * cosine, ry = tip->corner_radius * sine; /* edge centre from the axis of c */
    double ox = (c == 0 ? -model->distance : model->distance) + frame[3 * c] - frame[3 * o],
           oy = frame[3 * c + 1] - frame[3 * o + 1];
    double dx = ox + rx, dy = oy + ry, r2 = dx * dx + dy * dy, l2 = r2 - other->r_b * other->r_b;
    if (l2 <= 1e-10) return 0;
    double length = sqrt(l2);
    /* tangent point direction of the other's base circle: arg(D) − sg·atan(length / r_b) */
    double ct = (dx * other->r_b + l->sg * dy * length) / r2, st = (dy * other->r_b - l->sg * dx * length) / r2;
    double nominal = l->t + (o == 1 ? GK_PI : 0.0); /* t′ is near t (+π): take the small difference as angle */
    gk_sincos(nominal, &sine, &cosine);
    double turn = gk_atan2(st * cosine - ct * sine, ct * cosine + st * sine);
    double s = other->r_b * l->sg * (beta[o] - nominal - turn);
    double mx = -l->sg * st, my = l->sg * ct; /* outward normal of the other's flank */
    double slope_c, slope_o, relief_c = relief(tip, GK_ON(setup, tip_relief), tip->s_tip, &slope_c),
                             relief_o = relief(other, GK_ON(setup, tip_relief), s, &slope_o);
    double fade = 1.0 / (1.0 + over / tip->edge);
    p->gap = length - s - tip->edge + relief_c + slope_c * over * fade + relief_o;
    memset(p->gradient, 0, sizeof p->gradient);
    p->gradient[3 * c] = mx;
    p->gradient[3 * c + 1] = my;
    p->gradient[3 * c + 2] = mx * -ry + my * rx;
    p->gradient[3 * o] = -mx;
    p->gradient[3 * o + 1] = -my;
    p->gradient[3 * o + 2] = -l->sg * other->r_b;
    if (slope_c != 0.0) add_roll(p, l, tip, c, slope_c * fade * fade);
    if (slope_o != 0.0) { /* ∂s = sg r_b (∂φ_o − ∂t′), ∂t′ = ∂arg D − sg (r_b/(length r²)) D·∂D */
        double k = slope_o * l->sg * other->r_b, radial = -l->sg * other->r_b / (length * r2);
        double tx = -k * (-dy / r2 + radial * dx), ty = -k * (dx / r2 + radial * dy);
        p->gradient[3 * c] += tx;
        p->gradient[3 * c + 1] += ty;
        p->gradient[3 * c + 2] += tx * -ry + ty * rx;
        p->gradient[3 * o] -= tx;
        p->gradient[3 * o + 1] -= ty;
        p->gradient[3 * o + 2] += k;
    }
    p->roll[c] = tip->s_tip;
    p->roll[o] = s;
    double blend = gk_clamp(over / tip->strip, 0.0,
                            1.0); /* the contact patch leaves the flank over about the strip's half-width */
    blend = blend * blend * (3.0 - 2.0 * blend);
    p->curvature = (1.0 - blend) / tip->s_tip + blend / tip->edge + 1.0 / gk_max(s, 1e-4);
    return 1;
}

static int modulo(int k, int z)
{
    int m = k % z;
    return m < 0 ? m + z : m;
}

static void grid(const gk_gear *gear, double roll, int *index, double *w)
{
    /* cubic convolution (Keys 1981, a = −½): continuous slope, exact for parabolas; quadratic extrapolation gives the
     * ghost points at the ends */
    double u = (gk_clamp(roll, gear->s_form, gear->s_tip) - gear->s_form) / (gear->s_tip - gear->s_form) *
               (gear->rolls - 1);
    int cell = (int)u < gear->rolls - 2 ? (int)u : gear->rolls - 2;
    double x = u - cell, x2 = x * x, x3 = x2 * x;
    double k[4] = {-0.5 * x + x2 - 0.5 * x3, 1.0 - 2.5 * x2 + 1.5 * x3, 0.5 * x + 2.0 * x2 - 1.5 * x3,
                   -0.5 * x2 + 0.5 * x3};
    *index = (int)gk_clamp(cell - 1, 0, gear->rolls - 4);
    for (int i = 0; i < 4; i++) w[i] = k[i];
    if (cell == 0) { /* ghost f(−1) = 3 f0 − 3 f1 + f2 */
        w[0] = k[1] + 3.0 * k[0], w[1] = k[2] - 3.0 * k[0], w[2] = k[3] + k[0], w[3] = 0.0;
    } else if (cell == gear->rolls - 2) {
        w[3] = k[2] + 3.0 * k[3], w[2] = k[1] - 3.0 * k[3], w[1] = k[0] + k[3], w[0] = 0.0;
    }
}

/* Teeth out of their places (index deviation, ISO 1328-1): flank, roll and base angle turn with the tooth. Returns what
 * the gap loses. */
static double misplace(const gk_model *model, double sg, gk_place *p, double beta[2])
{
    double closer = 0.0;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = &model->gear[i];
        if (!gear->index) continue;
        const double angle = gear->index[p->flank * gear->z + p->tooth[i]], roll = sg * gear->r_b * angle;
        beta[i] += angle;
        p->roll[i] += roll;
        closer += roll;
    }
    return closer;
}

static int side(const gk_model *model, const gk_setup *setup, const double *frame, int flank, double reach,
                gk_place *place, int room)
{
    const gk_gear *A = &model->gear[0], *B = &model->gear[1];
    double sg = flank ? -1.0 : 1.0;
    line l = line_of_action(frame, model, sg);
    int shift = flank ? model->coast_shift : 0;
    double pitch = 2.0 * GK_PI / A->teeth, pitch_b = 2.0 * GK_PI / B->teeth, p_b = A->r_b * pitch;
    double base_a = frame[PHIA] + A->phase + sg * A->psi_b,
           base_b = frame[PHIB] + B->phase + sg * B->psi_b + shift * pitch_b;
    double s_a = A->r_b * sg * (base_a - l.t), s_b = B->r_b * sg * (base_b - l.t - GK_PI);
    double allowance = flank ? setup->allowance : 0.0, g = l.L - s_a - s_b + allowance,
           misplaced = GK_HAS(pitch_errors) ? A->index_most + B->index_most : 0.0;
    if (!(g - misplaced < reach)) return 0; /* the whole side is open: it costs this one comparison */
    double beyond = GK_ON(setup, tip_contact) ? 0.5 * p_b : 0.0;
    /* teeth whose roll on A lies between B's and A's ends */
    double first = l.L - B->s_tip - beyond, last = A->s_tip + beyond;
    double from = sg > 0 ? (first - s_a) / p_b : (s_a - last) / p_b,
           to = sg > 0 ? (last - s_a) / p_b : (s_a - first) / p_b;
    if (!(from > -1e8 && to < 1e8)) return -1;
    int found = 0;
    for (int k = (int)gk_floor(from) + 1; k <= (int)gk_floor(to) && found < room; k++) {
        gk_place *p = &place[found];
        p->key.flank = p->flank = flank;
        p->key.tooth = k;
        p->roll[0] = s_a + sg * k * p_b;
        p->roll[1] = s_b - sg * k * p_b;
        double beta[2] = {base_a + k * pitch, base_b - k * pitch_b};
        p->number[0] = k;
        p->number[1] = shift - k;
        p->tooth[0] = modulo(k, A->z);
        p->tooth[1] = modulo(shift - k, B->z);
        const double closer = misplaced > 0.0 ? misplace(model, sg, p, beta) : 0.0;
        int corner = p->roll[0] > A->s_tip ? 0 : p->roll[1] > B->s_tip ? 1 : -1;
        if (corner >= 0 && !GK_ON(setup, tip_contact))
            continue; /* a loaded pair reaches past the end by its deflection */
        if (corner < 0)
            flank_contact(model, setup, &l, g - closer, p);
        else if (!corner_contact(model, setup, frame, &l, corner, beta, p))
            continue;
        else
            p->gap += allowance;
        if (!(p->gap < reach)) continue;
        for (int i = 0; i < 2; i++) grid(&model->gear[i], p->roll[i], &p->index[i], p->weight[i]);
        found++;
    }
    return found;
}

static int flat(const gk_model *model, const double *frame, double reach, gk_place *p)
{
    memset(p, 0, sizeof *p);
    p->gap = model->distance + frame[XB] - frame[XA];
    p->gradient[XA] = -1.0;
    p->gradient[XB] = 1.0;
    p->curvature = 1.0;
    for (int i = 0; i < 2; i++) grid(&model->gear[i], 0.0, &p->index[i], p->weight[i]);
    return p->gap < reach;
}

/* All places whose undeformed gap is below `reach` at the given frames; −1 when the frames are meaningless */
int gk_flank_find(const gk_model *model, const gk_setup *setup, const double *frame, double reach, gk_place *place)
{
    if (model->kind == KIND_FLAT) return flat(model, frame, reach, place);
    double dx = model->distance + frame[XB] - frame[XA], dy = frame[YB] - frame[YA],
           R = model->gear[0].r_b + model->gear[1].r_b;
    if (!(dx * dx + dy * dy > 1.0001 * R * R) || !(dx * dx + dy * dy < 1e4)) return -1;
    int found = side(model, setup, frame, 0, reach, place, MAX_PAIRS);
    if (found < 0 || !GK_ON(setup, coast_flank)) return found;
    int coast = side(model, setup, frame, 1, reach, place + found, MAX_PAIRS - found);
    return coast < 0 ? -1 : found + coast;
}
