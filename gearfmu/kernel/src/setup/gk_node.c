/* One node of a side's tables: where its points lie on the flanks, and what they read there of all stored modes and of
 * every ground oscillator; the same for loads at given lengths of roll. */
#include "setup/gk_node.h"

double gk_node_tan(double angle)
{
    double sine, cosine;
    gk_sincos(angle, &sine, &cosine);
    return sine / cosine;
}

double gk_node_roll(const gk_side *side, int flank, double position, int offset)
{
    GK_ASSERT(flank == 0 || flank == 1);
    GK_ASSERT(side->step == 1 || side->step == -1);
    const double roll = (position + offset) * side->pitch;
    return flank ? side->both - roll : roll;
}

/* ---- where, and what is read there ------------------------------------------------------------------------------- */
static size_t points_of(const gk_model *model) { return MAX_CANDIDATES * (size_t)gk_strips_count(model, MAX_SLICES); }

/* what gk_node_begin hands out */
size_t gk_node_size(const gk_model *model, const gk_gear *gear)
{
    const size_t modes = (size_t)gear->modes, motions = (size_t)gk_node_motions(gear);
    const size_t still = 2 * (size_t)gear->low + GK_NODE_PARTS;
    return points_of(model) * (2 * modes + still + 2 * motions + 1) +
           (1 + (size_t)model->functions + 2 * MAX_CANDIDATES) * modes;
}

void gk_node_blend(const gk_node *n, const gk_real *table, const gk_spot *p, int width, double *out)
{
    const int A = n->model->functions;
    const gk_real *t = table + (size_t)((p->flank * n->model->rolls + p->grid.index) * A) * width;
    for (int k = 0; k < width; k++) out[k] = 0.0;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++, t += width) {
            const double w = p->grid.weight[i] * p->width[a];
            for (int k = 0; k < width; k++) out[k] += w * t[k];
        }
}

/* the same in two steps, for strips that have their length of roll in common: (functions, width) of the rolls … */
static void blend_rolls(const gk_node *n, const gk_real *table, const gk_spot *p, int width, double *cells)
{
    const size_t size = (size_t)(n->model->functions * width);
    const gk_real *t = table + (size_t)(p->flank * n->model->rolls + p->grid.index) * size;
    for (size_t k = 0; k < size; k++)
        cells[k] = p->grid.weight[0] * t[k] + p->grid.weight[1] * t[size + k] + p->grid.weight[2] * t[2 * size + k] +
                   p->grid.weight[3] * t[3 * size + k];
}

/* … and of the width functions */
static void blend_width(const gk_node *n, const double *cells, const gk_spot *p, int width, double *out)
{
    memset(out, 0, (size_t)width * sizeof *out);
    for (int a = 0; a < n->model->functions; a++, cells += width)
        for (int k = 0; k < width; k++) out[k] += p->width[a] * cells[k];
}

/* rows of a table of the gear group at a point */
static void blend_strip(const gk_node *n, const gk_real *table, const gk_spot *p, int strip, double *out)
{
    if (n->gear->helix != 0.0) return gk_node_blend(n, table, p, n->gear->modes, out);
    if (strip == 0) blend_rolls(n, table, p, n->gear->modes, n->cells);
    blend_width(n, n->cells, p, n->gear->modes, out);
}

/* rows of tooth 0 on that of a candidate: members of a pair turn into each other */
static void turn_row(const gk_node *n, int candidate, double *row)
{
    const gk_gear *gear = n->gear;
    const double *cosine = n->cosine + (size_t)candidate * gear->modes,
                 *sine = n->sine + (size_t)candidate * gear->modes;
    for (int k = 0; k < gear->modes; k++) {
        if (gear->member[k] == 1) {
            const double a = row[k], b = row[k + 1];
            row[k] = a * cosine[k] - b * sine[k];
            row[k + 1] = a * sine[k] + b * cosine[k];
            k++;
        } else {
            row[k] *= cosine[k];
        }
    }
}

static void fill_tooth_turns(const gk_node *n)
{
    double cosine[MAX_TEETH], sine[MAX_TEETH];
    const int z = n->gear->z;
    for (int m = 0; m < z; m++) gk_sincos(2.0 * GK_PI * m / z, &sine[m], &cosine[m]);
    for (int c = 0; c < n->side->candidates; c++)
        for (int k = 0; k < n->gear->modes; k++) {
            const int turned = (int)((int64_t)n->gear->diameter[k] * gk_node_offset(n->side, c) % z);
            const int at = turned < 0 ? turned + z : turned;
            n->cosine[(size_t)c * n->gear->modes + k] = cosine[at];
            n->sine[(size_t)c * n->gear->modes + k] = sine[at];
        }
}

typedef struct heading {                                  /* of a candidate's tooth, in ground axes */
    double angle, angle_cosine, angle_sine, cosine, sine; /* of the tooth; of its line of action */
} heading;

typedef struct direction {     /* in ground axes, at the nominal place of contact */
    double n[3], arm[3];       /* outward normal; point of contact from the gear's centre × normal */
    double along[3], lever[3]; /* the same against the direction in which gear A slides past B */
} direction;

static double facing_of(const gk_node *n) { return n->e->kind == MESH_EXTERNAL && n->side->which == 1 ? -1.0 : 1.0; }

static heading heading_of(const gk_node *n, const gk_spot *p)
{
    const gk_engagement *e = n->e;
    const double dx = e->position[1][0] - e->position[0][0], dy = e->position[1][1] - e->position[0][1];
    const double R = gk_base_reach(n->model, e), sg = p->flank ? -1.0 : 1.0;
    double t = gk_atan2(dy, dx);
    heading h;
    if (e->kind == MESH_INTERNAL) t = gk_atan2(-dy, -dx);
    t -= sg * gk_acos(R / sqrt(dx * dx + dy * dy));
    gk_sincos(t, &h.sine, &h.cosine);
    h.angle = (facing_of(n) < 0.0 ? t + GK_PI : t) + sg * (p->middle / n->gear->r_b - n->gear->psi_b);
    gk_sincos(h.angle, &h.angle_sine, &h.angle_cosine);
    return h;
}

static direction direction_of(const gk_node *n, const gk_spot *p, const heading *h)
{
    const double sg = p->flank ? -1.0 : 1.0, second = n->side->which == 1 ? -1.0 : 1.0, facing = facing_of(n);
    const double hollow = n->e->kind == MESH_INTERNAL && n->side->which == 1 ? -1.0 : 1.0, r_b = n->gear->r_b;
    const double nx = -second * sg * h->sine, ny = second * sg * h->cosine;
    direction d;
    d.n[0] = n->helix_cosine * nx, d.n[1] = n->helix_cosine * ny, d.n[2] = -hollow * sg * n->helix_sine;
    const double x = facing * r_b * h->cosine + hollow * p->nominal * nx,
                 y = facing * r_b * h->sine + hollow * p->nominal * ny;
    d.arm[0] = y * d.n[2] - p->z * d.n[1];
    d.arm[1] = p->z * d.n[0] - x * d.n[2];
    d.arm[2] = n->helix_cosine * hollow * sg * r_b;
    d.along[0] = -second * h->cosine, d.along[1] = -second * h->sine, d.along[2] = 0.0;
    d.lever[0] = -p->z * d.along[1], d.lever[1] = p->z * d.along[0];
    d.lever[2] = x * d.along[1] - y * d.along[0];
    return d;
}

/* rows of modes of nodal diameter 0 and 1 on tooth 0 → on the tooth at an angle, in axes that do not turn */
static void turn_low(const gk_gear *gear, const heading *h, double *row)
{
    for (int k = 0; k < gear->low; k++)
        if (gear->low_member[k] == 1) {
            const double a = row[k], b = row[k + 1];
            row[k] = a * h->angle_cosine - b * h->angle_sine;
            row[k + 1] = a * h->angle_sine + b * h->angle_cosine;
        }
}

/* what motion outward at a point is made of: rows of modes of nodal diameter 0 and 1 on tooth 0; parts of the node */
static void still_point(const gk_node *n, const gk_spot *p, double *still)
{
    const size_t size = 2 * (size_t)n->model->rolls * n->model->functions * 6;
    gk_node_blend(n, n->flank->low, p, n->gear->low, still);
    for (int c = 0; c < 3; c++) gk_node_blend(n, n->flank->node + c * size, p, 6, still + n->gear->low + 6 * c);
}

/* motion outward at a point */
static void turn_point(const gk_node *n, const gk_spot *p, const heading *h, const double *still, double *motion)
{
    const direction d = direction_of(n, p, h);
    const double trig[3] = {1.0, h->angle_cosine, h->angle_sine}, *part = still + n->gear->low;
    double *low = motion + 6, *node = low + n->gear->low;
    for (int c = 0; c < 3; c++) motion[c] = d.n[c], motion[3 + c] = d.arm[c];
    memcpy(low, still, (size_t)n->gear->low * sizeof *low);
    turn_low(n->gear, h, low);
    memset(node, 0, 6 * sizeof *node);
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 6; k++) node[k] += trig[c] * part[6 * c + k];
}

void gk_node_motion_at(const gk_node *n, const gk_spot *p, double *motion)
{
    GK_ASSERT(n->gear->low <= MAX_LOW && n->e->kind != MESH_FLAT);
    double still[MAX_LOW + GK_NODE_PARTS];
    const heading h = heading_of(n, p);
    still_point(n, p, still);
    turn_point(n, p, &h, still, motion);
}

/* motion along the profile at a point; what the supports' forces displace there is not known */
static void turn_along(const gk_node *n, const gk_spot *p, const heading *h, const double *still, double *motion)
{
    const direction d = direction_of(n, p, h);
    double *low = motion + 6;
    memset(motion, 0, (size_t)gk_node_motions(n->gear) * sizeof *motion);
    for (int c = 0; c < 3; c++) motion[c] = d.along[c], motion[3 + c] = d.lever[c];
    if (!n->flank->along_low) return;
    memcpy(low, still, (size_t)n->gear->low * sizeof *low);
    turn_low(n->gear, h, low);
    for (int k = 0; k < n->gear->low; k++) low[k] *= gk_node_along(n);
}

/* rows along the profile of a point */
static void gather_along(const gk_node *n, const gk_spot *p, int i)
{
    const int modes = n->gear->modes;
    double *row = n->along_rows + (size_t)i * modes;
    if (n->flank->along_rows)
        gk_node_blend(n, n->flank->along_rows, p, modes, row);
    else
        memset(row, 0, (size_t)modes * sizeof *row);
    for (int k = 0; k < modes; k++) row[k] *= gk_node_along(n);
    if (p->offset) turn_row(n, i / n->setup->strips, row);
    if (n->e->kind != MESH_FLAT && n->flank->along_low)
        gk_node_blend(n, n->flank->along_low, p, n->gear->low, n->along_still + (size_t)i * n->gear->low);
}

/* what opens the coast flanks of a line of contact that rides beyond the teeth's own numbers, m */
static double allowance_of(const gk_mesh *mesh, int flank) { return flank && mesh->rides ? mesh->allowance : 0.0; }

/* length of roll on the other gear where that on this side is `own` and the gap is closed */
static double other_roll(const gk_node *n, const gk_mesh *mesh, int flank, double own)
{
    const double open = allowance_of(mesh, flank);
    if (n->e->kind != MESH_INTERNAL) return n->length + open - own;
    return own + (n->side->which == 1 ? open - n->length : n->length - open);
}

/* Where contact is on this side when the other gear's tooth has gone past its tip: at the edge's arc, off the line of
 * action (docs/theory.md, eq. 6, with the gap closed) */
static double corner_roll(const gk_node *n, const gk_mesh *mesh, const gk_spot *p)
{
    const gk_engagement *e = n->e;
    const gk_gear *tip = &n->model->gear[e->gear[1 - n->side->which]];
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double a = sqrt(x * x + y * y), R = gk_base_reach(n->model, e);
    const double roll = other_roll(n, mesh, p->flank, p->nominal);
    const int inside = e->kind == MESH_INTERNAL, on_ring = inside && n->side->which == 1;
    const int past = inside && !on_ring ? roll < tip->s_tip : roll > tip->s_tip;
    if (e->kind == MESH_FLAT || !n->setup->on.tip_contact || !past) return p->nominal;
    const double sg = p->flank ? -1.0 : 1.0, angle = sg * (roll / tip->r_b - gk_acos(R / a) - tip->corner_angle);
    double sine, cosine;
    gk_sincos(angle, &sine, &cosine);
    const double dx = tip->corner_radius * cosine + (on_ring ? a : -a), dy = tip->corner_radius * sine;
    const double l2 = dx * dx + dy * dy - n->gear->r_b * n->gear->r_b;
    const double edge = tip->edge - allowance_of(mesh, p->flank);
    return l2 > 0.0 ? sqrt(l2) - (on_ring ? -edge : edge) : 0.0;
}

/* Where a strip carries: a slice of the width, or at the nominal centre distance a part of the line of contact */
static void find_part(const gk_node *n, const gk_mesh *mesh, gk_spot *p, int strip)
{
    p->z = mesh->strip_middle[strip];
    p->length = n->e->width / n->setup->slices;
    memcpy(p->width, n->weight[strip], sizeof p->width);
    if (!mesh->rides) return;
    const int own = n->side->which;
    double roll[2];
    roll[own] = p->middle, roll[1 - own] = other_roll(n, mesh, p->flank, p->middle);
    const gk_line line = gk_strips_line(n->model, mesh, p->flank ? -1.0 : 1.0, roll);
    const gk_part part = gk_strips_part(n->setup, &line, strip);
    p->z = part.middle;
    p->length = part.end[1] - part.end[0];
    gk_strips_row(n->model, n->side->gear, part.end[0], part.end[1], p->width);
}

/* where the points of a candidate lie */
static void place(gk_node *n, const gk_mesh *mesh, double position, int c)
{
    const int strips = n->setup->strips;
    for (int strip = 0; strip < strips; strip++) {
        gk_spot *p = &n->at[c * strips + strip];
        p->flank = c >= n->side->count[0];
        p->offset = gk_node_offset(n->side, c);
        p->middle = n->e->kind == MESH_FLAT ? n->gear->s_form : gk_node_roll(n->side, p->flank, position, p->offset);
        find_part(n, mesh, p, strip);
        p->nominal = p->middle + (p->flank ? -1.0 : 1.0) * p->z * n->helix_tan;
        p->roll = corner_roll(n, mesh, p);
        p->grid = gk_grid_at(n->model, n->gear, p->roll);
    }
}

/* Places the points and reads what twins have in common (gk_side_twins). Rows of all candidates, or only of those with
 * teeth beyond the tables. */
void gk_node_gather(gk_node *n, double position, int all)
{
    GK_ASSERT(position >= 0.0 && position <= 1.0);
    GK_ASSERT(n->points >= 0 && n->points <= MAX_CANDIDATES * MAX_SLICES);
    const int strips = n->setup->strips, modes = n->gear->modes;
    const gk_mesh *mesh = &n->setup->mesh[n->e - n->model->engagement];
    for (int c = 0; c < n->side->candidates; c++) {
        place(n, mesh, position, c);
        for (int i = c * strips; i < (c + 1) * strips; i++) {
            const gk_spot *p = &n->at[i];
            if (n->e->kind != MESH_FLAT) still_point(n, p, n->still + (size_t)i * gk_node_still(n->gear));
            if (!all && !n->beyond[c]) continue;
            blend_strip(n, n->flank->rows, p, i - c * strips, n->rows + (size_t)i * modes);
            if (p->offset) turn_row(n, c, n->rows + (size_t)i * modes);
            if (GK_ON(n->setup, friction)) gather_along(n, p, i);
        }
    }
}

/* the rest, of the side in hand: ports, and motion in ground axes, along the profile too where that is wanted */
void gk_node_turn(gk_node *n, int along)
{
    GK_ASSERT(n->setup && n->points == n->side->candidates * n->setup->strips);
    const size_t motions = (size_t)gk_node_motions(n->gear);
    double ports[MAX_PORTS];
    heading h = {0};
    for (int i = 0; i < n->points; i++) {
        const gk_spot *p = &n->at[i];
        gk_node_blend(n, n->flank->port, p, n->model->ports, ports);
        n->port[i] = n->side->port_of >= 0 ? ports[n->side->port_of] : 0.0;
        if (n->e->kind == MESH_FLAT) continue;
        if (i % n->setup->strips == 0) h = heading_of(n, p);
        turn_point(n, p, &h, n->still + (size_t)i * gk_node_still(n->gear), n->motion + i * motions);
        if (!along) continue;
        turn_along(n, p, &h, n->along_still + (size_t)i * n->gear->low, n->along_motion + i * motions);
    }
}

/* teeth of the same side too far apart for the tables: what stored modes carry is all there is then */
static void find_beyond(gk_node *n)
{
    memset(n->beyond, 0, sizeof n->beyond);
    for (int c = 0; c < n->side->candidates; c++)
        for (int d = 0; d < n->side->candidates; d++) {
            const int offset = gk_node_offset(n->side, d) - gk_node_offset(n->side, c);
            if (offset < -FURTHER || offset > FURTHER) n->beyond[c] = 1;
        }
}

void gk_node_take(gk_node *n, int e, const gk_side *side)
{
    GK_ASSERT(gk_is_engagement(n->model, e) && side->candidates <= MAX_CANDIDATES);
    n->e = &n->model->engagement[e];
    n->gear = &n->model->gear[side->gear];
    n->side = side;
    n->flank = &n->setup->flank[side->gear];
}

gk_node gk_node_begin(const gk_model *model, const gk_setup *setup, const gk_room *of, int e, const gk_side *side)
{
    GK_ASSERT(of->columns && gk_is_engagement(model, e));
    gk_node n = {.model = model, .setup = setup, .compliance = &of->compliance};
    gk_node_take(&n, e, side);
    double *room = of->columns;
    const size_t most = points_of(model), modes = (size_t)n.gear->modes, motions = (size_t)gk_node_motions(n.gear);
    n.points = side->candidates * setup->strips;
    n.rows = room, room += most * modes;
    n.along_rows = room, room += most * modes;
    n.still = room, room += most * (size_t)gk_node_still(n.gear);
    n.along_still = room, room += most * (size_t)n.gear->low;
    n.motion = room, room += most * motions;
    n.along_motion = room, room += most * motions;
    n.port = room, room += most;
    n.cells = room, room += (size_t)model->functions * modes;
    n.cosine = room, room += MAX_CANDIDATES * modes;
    n.sine = room, room += MAX_CANDIDATES * modes;
    n.flexibility = room;
    for (int k = 0; k < n.gear->modes; k++) n.flexibility[k] = 1.0 / (n.gear->omega[k] * n.gear->omega[k]);
    fill_tooth_turns(&n);
    find_beyond(&n);
    gk_strips_rows(model, setup, n.e, side->gear, n.weight);
    gk_sincos(n.gear->helix, &n.helix_sine, &n.helix_cosine);
    n.helix_tan = n.helix_sine / n.helix_cosine;
    const double x = n.e->position[1][0] - n.e->position[0][0], y = n.e->position[1][1] - n.e->position[0][1];
    const double R = gk_base_reach(model, n.e);
    n.length = sqrt(gk_max(x * x + y * y - R * R, 0.0));
    return n;
}

double *gk_node_room(const gk_node *n) { return n->flexibility + n->gear->modes; }
