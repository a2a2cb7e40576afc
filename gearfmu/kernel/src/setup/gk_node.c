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

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

/* what gk_node_begin hands out */
static size_t node_size(const gk_model *model, const gk_gear *gear)
{
    const size_t modes = (size_t)gear->modes, motions = (size_t)gk_node_motions(gear);
    return points_of(model) * (2 * modes + 2 * motions + 1) + (1 + (size_t)model->functions) * modes +
           2 * (size_t)gear->z;
}

size_t gk_node_scratch(const gk_model *model)
{
    size_t most = 0;
    for (int g = 0; g < model->gears; g++) {
        const gk_gear *gear = &model->gear[g];
        const size_t motions = (size_t)gk_node_motions(gear);
        size_t ground = 0;
        for (int s = 0; s < model->sets; s++) ground = larger(ground, (size_t)model->ground[s].n);
        const size_t of_side = motions * (motions + points_of(model) + (size_t)model->supports + 1) +
                               motions * (ground + 4 * (MAX_ROTORS + 1));
        const size_t of_step = 4 * points_of(model) * ((size_t)gear->modes + LANES);
        most = larger(most, larger(node_size(model, gear) + of_side, of_step));
    }
    return most;
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

static void turn_row(const gk_node *n, int offset, double *row)
{
    const gk_gear *gear = n->gear;
    for (int k = 0; k < gear->modes; k++) {
        const int turned = (int)((int64_t)gear->diameter[k] * offset % gear->z),
                  at = turned < 0 ? turned + gear->z : turned;
        if (gear->member[k] == 1) {
            const double a = row[k], b = row[k + 1];
            row[k] = a * n->cosine[at] - b * n->sine[at];
            row[k + 1] = a * n->sine[at] + b * n->cosine[at];
            k++;
        } else {
            row[k] *= n->cosine[at];
        }
    }
}

typedef struct direction {     /* in ground axes, at the nominal place of contact */
    double angle;              /* of the tooth */
    double n[3], arm[3];       /* outward normal; point of contact from the gear's centre × normal */
    double along[3], lever[3]; /* the same against the direction in which gear A slides past B */
} direction;

static direction direction_of(const gk_node *n, const gk_spot *p)
{
    const gk_engagement *e = n->e;
    const double dx = e->position[1][0] - e->position[0][0], dy = e->position[1][1] - e->position[0][1];
    const double R = gk_base_reach(n->model, e), sg = p->flank ? -1.0 : 1.0, second = n->side->which == 1 ? -1.0 : 1.0;
    const int ring = e->kind == MESH_INTERNAL && n->side->which == 1;
    const double facing = e->kind == MESH_EXTERNAL ? second : 1.0, hollow = ring ? -1.0 : 1.0;
    direction d;
    double sine, cosine, helix_sine, helix_cosine, t = gk_atan2(dy, dx);
    if (e->kind == MESH_INTERNAL) t = gk_atan2(-dy, -dx);
    t -= sg * gk_acos(R / sqrt(dx * dx + dy * dy));
    gk_sincos(t, &sine, &cosine);
    gk_sincos(n->gear->helix, &helix_sine, &helix_cosine);
    const double nx = -second * sg * sine, ny = second * sg * cosine, r_b = n->gear->r_b;
    d.angle = (facing < 0.0 ? t + GK_PI : t) + sg * (p->middle / r_b - n->gear->psi_b);
    d.n[0] = helix_cosine * nx, d.n[1] = helix_cosine * ny, d.n[2] = -hollow * sg * helix_sine;
    const double x = facing * r_b * cosine + hollow * p->nominal * nx,
                 y = facing * r_b * sine + hollow * p->nominal * ny;
    d.arm[0] = y * d.n[2] - p->z * d.n[1];
    d.arm[1] = p->z * d.n[0] - x * d.n[2];
    d.arm[2] = helix_cosine * hollow * sg * r_b;
    d.along[0] = -second * cosine, d.along[1] = -second * sine, d.along[2] = 0.0;
    d.lever[0] = -p->z * d.along[1], d.lever[1] = p->z * d.along[0];
    d.lever[2] = x * d.along[1] - y * d.along[0];
    return d;
}

/* rows of modes of nodal diameter 0 and 1 on tooth 0 → on the tooth at an angle, in axes that do not turn */
static void turn_low(const gk_gear *gear, double cosine, double sine, double *row)
{
    for (int k = 0; k < gear->low; k++)
        if (gear->low_member[k] == 1) {
            const double a = row[k], b = row[k + 1];
            row[k] = a * cosine - b * sine;
            row[k + 1] = a * sine + b * cosine;
        }
}

/* motion outward at a point */
static void ground_point(const gk_node *n, const gk_spot *p, double *motion)
{
    const size_t size = 2 * (size_t)n->model->rolls * n->model->functions * 6;
    const direction d = direction_of(n, p);
    double trig[3] = {1.0, 0.0, 0.0}, part[6], *low = motion + 6, *node = low + n->gear->low;
    gk_sincos(d.angle, &trig[2], &trig[1]);
    for (int c = 0; c < 3; c++) motion[c] = d.n[c], motion[3 + c] = d.arm[c];
    gk_node_blend(n, n->flank->low, p, n->gear->low, low);
    turn_low(n->gear, trig[1], trig[2], low);
    memset(node, 0, 6 * sizeof *node);
    for (int c = 0; c < 3; c++) {
        gk_node_blend(n, n->flank->node + c * size, p, 6, part);
        for (int k = 0; k < 6; k++) node[k] += trig[c] * part[k];
    }
}

/* motion along the profile at a point; what the supports' forces displace there is not known */
static void along_point(const gk_node *n, const gk_spot *p, double *motion)
{
    const direction d = direction_of(n, p);
    double cosine, sine, *low = motion + 6;
    gk_sincos(d.angle, &sine, &cosine);
    memset(motion, 0, (size_t)gk_node_motions(n->gear) * sizeof *motion);
    for (int c = 0; c < 3; c++) motion[c] = d.along[c], motion[3 + c] = d.lever[c];
    if (!n->flank->along_low) return;
    gk_node_blend(n, n->flank->along_low, p, n->gear->low, low);
    turn_low(n->gear, cosine, sine, low);
    for (int k = 0; k < n->gear->low; k++) low[k] *= gk_node_along(n);
}

/* rows along the profile of a point */
static void gather_along(gk_node *n, const gk_spot *p, int i)
{
    const int modes = n->gear->modes;
    double *row = n->along_rows + (size_t)i * modes;
    if (n->flank->along_rows)
        gk_node_blend(n, n->flank->along_rows, p, modes, row);
    else
        memset(row, 0, (size_t)modes * sizeof *row);
    for (int k = 0; k < modes; k++) row[k] *= gk_node_along(n);
    if (p->offset) turn_row(n, p->offset, row);
    if (n->e->kind != MESH_FLAT) along_point(n, p, n->along_motion + (size_t)i * gk_node_motions(n->gear));
}

/* Where contact is on this side when the other gear's tooth has gone past its tip: at the edge's arc, off the line of
 * action (docs/theory.md, eq. 6, with the gap closed) */
static double corner_roll(const gk_node *n, const gk_spot *p)
{
    const gk_engagement *e = n->e;
    const gk_gear *tip = &n->model->gear[e->gear[1 - n->side->which]];
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double a = sqrt(x * x + y * y), R = gk_base_reach(n->model, e), L = sqrt(a * a - R * R);
    const int inside = e->kind == MESH_INTERNAL, on_ring = inside && n->side->which == 1;
    const double roll = inside ? p->nominal + (on_ring ? -L : L) : L - p->nominal;
    const int past = inside && !on_ring ? roll < tip->s_tip : roll > tip->s_tip;
    if (e->kind == MESH_FLAT || !n->setup->on.tip_contact || !past) return p->nominal;
    const double sg = p->flank ? -1.0 : 1.0, angle = sg * (roll / tip->r_b - gk_acos(R / a) - tip->corner_angle);
    double sine, cosine;
    gk_sincos(angle, &sine, &cosine);
    const double dx = tip->corner_radius * cosine + (on_ring ? a : -a), dy = tip->corner_radius * sine;
    const double l2 = dx * dx + dy * dy - n->gear->r_b * n->gear->r_b;
    return l2 > 0.0 ? sqrt(l2) - (on_ring ? -tip->edge : tip->edge) : 0.0;
}

/* Where a strip carries at the nominal centre distance: its part on both flanks, with a length of its own */
static void find_part(const gk_node *n, const gk_mesh *mesh, gk_spot *p, int strip)
{
    p->z = mesh->strip_middle[strip];
    memcpy(p->width, n->weight[strip], sizeof p->width);
    if (n->e->kind == MESH_FLAT || n->gear->helix == 0.0) return;
    const int own = n->side->which, internal = n->e->kind == MESH_INTERNAL;
    double roll[2];
    roll[own] = p->middle;
    roll[1 - own] = internal ? p->middle + (own ? -n->length : n->length) : n->length - p->middle;
    const gk_part part = gk_strips_part(n->model, n->setup, mesh, p->flank ? -1.0 : 1.0, roll, strip);
    if (part.share >= 1.0) return;
    const double slice = n->e->width / n->setup->slices, half = 0.5 * part.share * slice;
    const double low = mesh->strip_middle[strip] - 0.5 * slice + half, high = low + slice - 2.0 * half;
    const double middle = gk_clamp(part.middle, low, high);
    p->z = part.middle;
    gk_strips_row(n->model, n->side->gear, middle - half, middle + half, p->width);
}

void gk_node_gather(gk_node *n, double position)
{
    GK_ASSERT(position >= 0.0 && position <= 1.0);
    GK_ASSERT(n->points >= 0 && n->points <= MAX_CANDIDATES * MAX_SLICES);
    const int strips = n->setup->strips, modes = n->gear->modes;
    const gk_mesh *mesh = &n->setup->mesh[n->e - n->model->engagement];
    double ports[MAX_PORTS];
    for (int i = 0; i < n->points; i++) {
        gk_spot *p = &n->at[i];
        const int c = i / strips, strip = i % strips;
        p->flank = c >= n->side->count[0];
        p->offset = n->side->first[p->flank] + n->side->step * (p->flank ? c - n->side->count[0] : c);
        p->middle = n->e->kind == MESH_FLAT ? n->gear->s_form : gk_node_roll(n->side, p->flank, position, p->offset);
        find_part(n, mesh, p, strip);
        p->nominal = p->middle + (p->flank ? -1.0 : 1.0) * p->z * gk_node_tan(n->gear->helix);
        p->roll = corner_roll(n, p);
        p->grid = gk_grid_at(n->model, n->gear, p->roll);
        blend_strip(n, n->flank->rows, p, strip, n->rows + (size_t)i * modes);
        if (p->offset) turn_row(n, p->offset, n->rows + (size_t)i * modes);
        gk_node_blend(n, n->flank->port, p, n->model->ports, ports);
        n->port[i] = n->side->port_of >= 0 ? ports[n->side->port_of] : 0.0;
        if (n->e->kind != MESH_FLAT) ground_point(n, p, n->motion + (size_t)i * gk_node_motions(n->gear));
        if (GK_ON(n->setup, friction)) gather_along(n, p, i);
    }
}

gk_node gk_node_begin(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, const gk_side *side)
{
    GK_ASSERT(work->columns && gk_is_engagement(model, e));
    GK_ASSERT(side->candidates <= MAX_CANDIDATES);
    gk_node n = {.model = model,
                 .setup = setup,
                 .e = &model->engagement[e],
                 .gear = &model->gear[side->gear],
                 .side = side,
                 .flank = &setup->flank[side->gear],
                 .compliance = &work->compliance};
    double *room = work->columns;
    const size_t most = points_of(model), modes = (size_t)n.gear->modes, motions = (size_t)gk_node_motions(n.gear);
    n.points = side->candidates * setup->strips;
    n.rows = room, room += most * modes;
    n.along_rows = room, room += most * modes;
    n.motion = room, room += most * motions;
    n.along_motion = room, room += most * motions;
    n.port = room, room += most;
    n.cells = room, room += (size_t)model->functions * modes;
    n.cosine = room, room += n.gear->z;
    n.sine = room, room += n.gear->z;
    n.flexibility = room;
    for (int m = 0; m < n.gear->z; m++) gk_sincos(2.0 * GK_PI * m / n.gear->z, &n.sine[m], &n.cosine[m]);
    for (int k = 0; k < n.gear->modes; k++) n.flexibility[k] = 1.0 / (n.gear->omega[k] * n.gear->omega[k]);
    gk_strips_rows(model, setup, n.e, side->gear, n.weight);
    const double x = n.e->position[1][0] - n.e->position[0][0], y = n.e->position[1][1] - n.e->position[0][1];
    const double R = gk_base_reach(model, n.e);
    n.length = sqrt(gk_max(x * x + y * y - R * R, 0.0));
    return n;
}

double *gk_node_room(const gk_node *n) { return n->flexibility + n->gear->modes; }

/* ---- loads ------------------------------------------------------------------------------------------------------- */
/* adds Σ over rolls and width functions of weighted rows, modes from `first` on */
static void add_rows(const gk_node *n, const gk_spot *p, int first, double weight[4][MAX_FUNCTIONS], double *sum)
{
    const int modes = n->gear->modes, A = n->model->functions;
    const gk_real *row = n->flank->rows + (size_t)((p->flank * n->model->rolls + p->grid.index) * A) * (size_t)modes;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++, row += modes) {
            for (int k = first; k < modes; k++) sum[k] += weight[i][a] * row[k];
            weight[i][a] = 0.0;
        }
}

/* adds a row of tooth 0 turned to another tooth, modes from `first` on, which begins no pair's second */
static void add_turned(const gk_gear *gear, int tooth, int first, const double *row, double *sum)
{
    double cosine[MAX_TEETH], sine[MAX_TEETH];
    for (int m = 0; m < gear->z; m++) gk_sincos(2.0 * GK_PI * m / gear->z, &sine[m], &cosine[m]);
    for (int k = first; k < gear->modes; k++) {
        const int m = (int)((int64_t)gear->diameter[k] * tooth % gear->z);
        if (gear->member[k] == 1) {
            sum[k] += row[k] * cosine[m] - row[k + 1] * sine[m];
            sum[k + 1] += row[k] * sine[m] + row[k + 1] * cosine[m];
            k++;
        } else {
            sum[k] += row[k] * cosine[m];
        }
    }
}

/* Adds the modal forces of a gear group, modes from `first` on, by outward forces on the strips of a tooth at these
 * lengths of roll. Strips in one cell of the grid of rolls, as those of a spur gear, are one row. */
void gk_node_push(const gk_model *model, const gk_setup *setup, const gk_strip_load *load, int first, double *sum)
{
    GK_ASSERT(gk_is_gear(model, load->gear) && load->strips <= MAX_SLICES);
    GK_ASSERT(first >= 0 && first <= model->gear[load->gear].modes);
    const gk_gear *gear = &model->gear[load->gear];
    const gk_node n = {.model = model, .gear = gear, .flank = &setup->flank[load->gear]};
    double row[MAX_MODES], weight[4][MAX_FUNCTIONS] = {{0}};
    gk_spot p = {.flank = load->flank, .grid.index = -1}, next = p;
    memset(row + first, 0, (size_t)(gear->modes - first) * sizeof *row);
    for (int strip = 0; strip < load->strips; strip++) {
        next.grid = gk_grid_at(model, gear, load->roll[strip]);
        if (p.grid.index >= 0 && next.grid.index != p.grid.index) add_rows(&n, &p, first, weight, row);
        p = next;
        for (int i = 0; i < 4; i++)
            for (int a = 0; a < model->functions; a++)
                weight[i][a] += load->force[strip] * p.grid.weight[i] * load->width[strip][a];
    }
    add_rows(&n, &p, first, weight, row);
    add_turned(gear, load->tooth, first, row, sum);
}

/* adds the forces on ground oscillators that are not dynamic, by outward forces on the strips of a tooth of one gear */
void gk_node_push_ground(const gk_model *model, const gk_setup *setup, int e, int which, const gk_strip_load *load,
                         double *sum)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    GK_ASSERT(setup->mesh[e].side[which].gear == load->gear);
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_node n = {.model = model,
                       .setup = setup,
                       .e = &model->engagement[e],
                       .gear = &model->gear[load->gear],
                       .side = &mesh->side[which],
                       .flank = &setup->flank[load->gear]};
    const int set = setup->base.set, reads = n.gear->ground[set].reads, motions = gk_node_motions(n.gear);
    const int32_t *list = n.gear->ground[set].list;
    double motion[12 + MAX_LOW], all[12 + MAX_LOW] = {0};
    for (int strip = 0; strip < load->strips; strip++) {
        const double roll = load->roll[strip], z = mesh->strip_middle[strip], sg = load->flank ? -1.0 : 1.0;
        gk_spot p = {
            .flank = load->flank, .grid = gk_grid_at(model, n.gear, roll), .nominal = roll, .roll = roll, .z = z};
        p.middle = roll - sg * z * gk_node_tan(n.gear->helix);
        memcpy(p.width, load->width[strip], sizeof p.width);
        if (load->force[strip] == 0.0) continue;
        ground_point(&n, &p, motion);
        for (int i = 0; i < motions; i++) all[i] += load->force[strip] * motion[i];
    }
    for (int i = 0; i < motions; i++) {
        const double *row = gk_node_motion(n.gear, set, i);
        for (int k = 0; k < reads; k++)
            if (setup->base.slot[list[k]] < 0) sum[list[k]] += all[i] * row[k];
    }
}
