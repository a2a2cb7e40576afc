/* Tables of one gear of an engagement along the path of contact: rows of its dynamic modes, what its ground oscillators
 * read, and compliance of what is not dynamic (docs/theory.md, eq. 2), for all teeth that may touch, at NODES + 1
 * positions in one pitch. Teeth of one flank are whole base pitches apart, so one position decides all lengths of roll.
 * A row between two nodes is linear, the compliance of what is not dynamic a parabola. */
#include "integrate/gk_integrate.h"

static const double MARGIN = 0.15, CORNER = 0.5; /* base pitches beyond the ends of the flanks: play; tip corners */

static double tan_of(double angle)
{
    double sine, cosine;
    gk_sincos(angle, &sine, &cosine);
    return sine / cosine;
}

/* ---- which teeth ------------------------------------------------------------------------------------------------- */
/* lengths of roll of this side between which the other side has a flank, corners included */
static void span(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int which, double ends[2])
{
    const gk_gear *own = &model->gear[e->gear[which]], *other = &model->gear[e->gear[1 - which]];
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double R = gk_base_reach(model, e), L = sqrt(x * x + y * y - R * R);
    const double pitch = own->r_b * 2.0 * GK_PI / own->z, beyond = (setup->on.tip_contact ? CORNER : 0.0) + MARGIN;
    const double lean = 0.5 * e->width * fabs(tan_of(own->helix)); /* the ends of the face width are ahead and behind */
    if (e->kind == MESH_EXTERNAL) {
        ends[0] = L - other->s_tip, ends[1] = own->s_tip;
    } else if (which == 0) { /* the planet in the ring: s_B = L + s_A */
        ends[0] = other->s_tip - L, ends[1] = own->s_tip;
    } else {
        ends[0] = own->s_tip, ends[1] = L + other->s_tip;
    }
    ends[0] -= beyond * pitch + lean, ends[1] += beyond * pitch + lean;
}

static double roll_at(const gk_side *side, int flank, double position, int offset)
{
    const double roll = (position + offset) * side->pitch;
    return flank ? side->both - roll : roll;
}

void gk_side_plan(const gk_model *model, const gk_setup *setup, int index, gk_side *side, int which)
{
    const gk_engagement *e = &model->engagement[index];
    const gk_gear *gear = &model->gear[e->gear[which]];
    memset(side, 0, sizeof *side);
    side->gear = e->gear[which], side->which = which;
    side->port_of = gk_port_of(model, side->gear);
    side->nodes = 1, side->candidates = side->count[0] = 1;
    side->step = which == 1 && e->kind == MESH_EXTERNAL ? -1 : 1;
    side->pitch = 1.0;
    if (e->kind == MESH_FLAT) return;
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double a = sqrt(x * x + y * y), R = gk_base_reach(model, e);
    double ends[2];
    side->nodes = NODES;
    side->pitch = gear->r_b * 2.0 * GK_PI / gear->z;
    side->both = 2.0 * gear->r_b * (gear->psi_b + gk_acos(R / a));
    span(model, setup, e, which, ends);
    side->candidates = 0;
    for (int flank = 0; flank < 2; flank++) {
        side->count[flank] = 0;
        for (int k = -gear->z; k <= gear->z && side->candidates < MAX_CANDIDATES; k++) {
            const int offset = side->step * k;
            const double begin = roll_at(side, flank, 0.0, offset), end = roll_at(side, flank, 1.0, offset);
            if (gk_max(begin, end) < ends[0] || gk_min(begin, end) > ends[1]) continue;
            if (!side->count[flank]) side->first[flank] = offset;
            side->count[flank]++, side->candidates++;
        }
    }
}

/* ---- one node ---------------------------------------------------------------------------------------------------- */
typedef struct place { /* a candidate's strip at a node */
    int flank, offset;
    gk_grid grid;                   /* of where contact is */
    double middle, nominal, roll;   /* length of roll on the line of action at mid-width, here; where contact is */
    double z, width[MAX_FUNCTIONS]; /* middle of the part that carries; its weights on the width functions */
} place;

typedef struct node { /* what a node's tables are made from */
    const gk_model *model;
    const gk_setup *setup;
    const gk_engagement *e;
    const gk_gear *gear;
    const gk_side *side;
    int points;                            /* candidates × strips */
    place at[MAX_CANDIDATES * MAX_SLICES]; /* points */
    gk_strip_weights weight;
    double length;       /* of the line of action between the base circles, nominal */
    double *rows;        /* (points, modes): all stored modes, tooth offset included */
    double *ground;      /* (points, reads): outward, rigid motion included, of every ground oscillator */
    double *rigid;       /* (points, reads): the part of it that is rigid motion */
    double *support;     /* (points, supports): C_fs */
    double *port;        /* (points) */
    double *flexibility; /* (modes) 1/ω² of the dynamic ones */
} node;

static size_t points_of(const gk_model *model) { return MAX_CANDIDATES * (size_t)gk_strips_count(model, MAX_SLICES); }

size_t gk_side_scratch(const gk_model *model)
{
    size_t modes = 0, reads = 0;
    for (int g = 0; g < model->gears; g++) {
        modes = modes > (size_t)model->gear[g].modes ? modes : (size_t)model->gear[g].modes;
        for (int s = 0; s < model->sets; s++)
            reads = reads > (size_t)model->gear[g].ground[s].reads ? reads : (size_t)model->gear[g].ground[s].reads;
    }
    const size_t of_node = points_of(model) * (modes + 2 * reads + (size_t)model->supports + 1) + modes;
    const size_t of_step = 4 * points_of(model) * (modes + LANES);
    return of_node > of_step ? of_node : of_step;
}

/* out (width) = Σ over the four rolls and the width functions of a table (2, rolls, functions, width) at one point */
static void blend(const node *n, const double *table, const place *p, int width, double *out)
{
    const int A = n->model->functions;
    const double *t = table + (size_t)((p->flank * n->model->rolls + p->grid.index) * A) * width;
    for (int k = 0; k < width; k++) out[k] = 0.0;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++, t += width) {
            const double w = p->grid.weight[i] * p->width[a];
            for (int k = 0; k < width; k++) out[k] += w * t[k];
        }
}

static void turn_row(const gk_gear *gear, int offset, double *row)
{
    for (int k = 0; k < gear->modes; k++) {
        double sine, cosine;
        const int64_t turned = (int64_t)gear->diameter[k] * offset % gear->z;
        gk_sincos(2.0 * GK_PI * (double)turned / gear->z, &sine, &cosine);
        if (gear->member[k] == 1) {
            const double a = row[k], b = row[k + 1];
            row[k] = a * cosine - b * sine;
            row[k + 1] = a * sine + b * cosine;
            k++;
        } else {
            row[k] *= cosine;
        }
    }
}

/* adds Σ over rolls and width functions of weighted rows, modes from `first` on */
static void add_rows(const gk_model *model, const gk_gear *gear, const place *p, int first,
                     double weight[4][MAX_FUNCTIONS], double *sum)
{
    const size_t modes = (size_t)gear->modes;
    const double *row = gear->rows + (size_t)((p->flank * model->rolls + p->grid.index) * model->functions) * modes;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < model->functions; a++, row += modes) {
            for (int k = first; k < gear->modes; k++) sum[k] += weight[i][a] * row[k];
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
void gk_side_push(const gk_model *model, const gk_strip_load *load, int first, double *sum)
{
    const gk_gear *gear = &model->gear[load->gear];
    double row[MAX_MODES], weight[4][MAX_FUNCTIONS] = {{0}};
    place p = {.flank = load->flank, .grid.index = -1}, next = p;
    memset(row + first, 0, (size_t)(gear->modes - first) * sizeof *row);
    for (int strip = 0; strip < load->strips; strip++) {
        next.grid = gk_grid_at(model, gear, load->roll[strip]);
        if (p.grid.index >= 0 && next.grid.index != p.grid.index) add_rows(model, gear, &p, first, weight, row);
        p = next;
        for (int i = 0; i < 4; i++)
            for (int a = 0; a < model->functions; a++)
                weight[i][a] += load->force[strip] * p.grid.weight[i] * load->width[strip][a];
    }
    add_rows(model, gear, &p, first, weight, row);
    add_turned(gear, load->tooth, first, row, sum);
}

typedef struct direction { /* in ground axes, at the nominal place of contact */
    double angle;          /* of the tooth */
    double n[3], arm[3];   /* outward normal; point of contact from the gear's centre × normal */
} direction;

static direction direction_of(const node *n, const place *p)
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
    return d;
}

/* what the ground oscillators of the gear move at a point, outward; C_fs there */
static void ground_point(const node *n, const place *p, double *row, double *rigid, double *support)
{
    const int set = n->setup->base.set, reads = n->gear->ground[set].reads, supports = n->model->supports;
    const size_t size = 2 * (size_t)n->model->rolls * n->model->functions;
    const direction d = direction_of(n, p);
    const double *centre = n->gear->ground[set].centre,
                 along[6] = {d.n[0], d.n[1], d.n[2], d.arm[0], d.arm[1], d.arm[2]};
    double trig[3] = {1.0, 0.0, 0.0}, part[MAX_GROUND];
    gk_sincos(d.angle, &trig[2], &trig[1]);
    for (int k = 0; k < reads; k++) {
        rigid[k] = 0.0;
        for (int c = 0; c < 6; c++) rigid[k] += along[c] * centre[c * reads + k];
        row[k] = rigid[k];
    }
    for (int s = 0; s < supports; s++) support[s] = 0.0;
    for (int c = 0; c < 3; c++) {
        blend(n, n->gear->ground[set].rows + c * size * reads, p, reads, part);
        for (int k = 0; k < reads; k++) row[k] += trig[c] * part[k];
        blend(n, n->gear->support_residual + c * size * supports, p, supports, part);
        for (int s = 0; s < supports; s++) support[s] += trig[c] * part[s];
    }
}

/* adds the forces on ground oscillators that are not dynamic, by outward forces on the strips of a tooth of one gear */
void gk_side_push_ground(const gk_model *model, const gk_setup *setup, int e, int which, const gk_strip_load *load,
                         double *sum)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const node n = {.model = model,
                    .setup = setup,
                    .e = &model->engagement[e],
                    .gear = &model->gear[load->gear],
                    .side = &mesh->side[which]};
    const int reads = n.gear->ground[setup->base.set].reads;
    const int32_t *list = n.gear->ground[setup->base.set].list;
    double row[MAX_GROUND], rigid[MAX_GROUND], support[MAX_SUPPORTS];
    for (int strip = 0; strip < load->strips; strip++) {
        const double roll = load->roll[strip], z = mesh->strip_middle[strip], sg = load->flank ? -1.0 : 1.0;
        place p = {
            .flank = load->flank, .grid = gk_grid_at(model, n.gear, roll), .nominal = roll, .roll = roll, .z = z};
        p.middle = roll - sg * z * tan_of(n.gear->helix);
        memcpy(p.width, load->width[strip], sizeof p.width);
        if (load->force[strip] == 0.0) continue;
        ground_point(&n, &p, row, rigid, support);
        for (int k = 0; k < reads; k++)
            if (setup->base.slot[list[k]] < 0) sum[list[k]] += load->force[strip] * row[k];
    }
}

/* Where contact is on this side when the other gear's tooth has gone past its tip: at the edge's arc, off the line of
 * action (docs/theory.md, eq. 6, with the gap closed) */
static double corner_roll(const node *n, const place *p)
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
static void find_part(const node *n, const gk_mesh *mesh, place *p, int strip)
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

static void gather_node(node *n, double position)
{
    const int strips = n->setup->strips, modes = n->gear->modes, set = n->setup->base.set;
    const gk_mesh *mesh = &n->setup->mesh[n->e - n->model->engagement];
    double ports[MAX_PORTS];
    for (int i = 0; i < n->points; i++) {
        place *p = &n->at[i];
        const int c = i / strips, strip = i % strips;
        p->flank = c >= n->side->count[0];
        p->offset = n->side->first[p->flank] + n->side->step * (p->flank ? c - n->side->count[0] : c);
        p->middle = n->e->kind == MESH_FLAT ? n->gear->s_form : roll_at(n->side, p->flank, position, p->offset);
        find_part(n, mesh, p, strip);
        p->nominal = p->middle + (p->flank ? -1.0 : 1.0) * p->z * tan_of(n->gear->helix);
        p->roll = corner_roll(n, p);
        p->grid = gk_grid_at(n->model, n->gear, p->roll);
        blend(n, n->gear->rows, p, modes, n->rows + (size_t)i * modes);
        if (p->offset) turn_row(n->gear, p->offset, n->rows + (size_t)i * modes);
        blend(n, n->gear->port_residual, p, n->model->ports, ports);
        n->port[i] = n->side->port_of >= 0 ? ports[n->side->port_of] : 0.0;
        if (n->e->kind != MESH_FLAT)
            ground_point(n, p, n->ground + (size_t)i * n->gear->ground[set].reads,
                         n->rigid + (size_t)i * n->gear->ground[set].reads,
                         n->support + (size_t)i * n->model->supports);
    }
}

/* ---- compliance of what is not dynamic --------------------------------------------------------------------------- */
static double dot(const double *a, const double *b, int n)
{
    double lane[4] = {0, 0, 0, 0};
    int k = 0;
    for (; k + 4 <= n; k += 4)
        for (int l = 0; l < 4; l++) lane[l] += a[k + l] * b[k + l];
    for (; k < n; k++) lane[0] += a[k] * b[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* Σ a_k b_k/ω² over modes below `dynamic` */
static double carried(const node *n, int i, int j, int dynamic)
{
    const double *a = n->rows + (size_t)i * n->gear->modes, *b = n->rows + (size_t)j * n->gear->modes;
    double lane[4] = {0, 0, 0, 0};
    for (int k = 0; k < dynamic; k++) lane[k % 4] += a[k] * b[k] * n->flexibility[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* stored compliance of the free body between two points, by width function, (functions, functions) */
static void tabulate(const node *n, const place *p, const place *q, double *cell)
{
    const int A = n->model->functions, R = n->model->rolls, offset = q->offset - p->offset;
    const double *table = n->gear->residual + (size_t)((p->flank * 2 + q->flank) * OFFSETS + offset + OFFSETS / 2) *
                                                  (size_t)(R * R * A * A);
    for (int c = 0; c < A * A; c++) cell[c] = 0.0;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            const double w = p->grid.weight[i] * q->grid.weight[j],
                         *t = table + ((p->grid.index + i) * R + q->grid.index + j) * A * A;
            for (int c = 0; c < A * A; c++) cell[c] += w * t[c];
        }
}

/* the same between two candidates, (strips, strips); 0 when they are too far apart for the table: what stored modes
 * carry is all there is then */
static int tabulated(const node *n, int first, int second, double *out)
{
    const int A = n->model->functions, strips = n->setup->strips;
    const int offset = n->at[second * strips].offset - n->at[first * strips].offset;
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    for (int c = 0; c < strips * strips; c++) out[c] = 0.0;
    if (offset < -(OFFSETS / 2) || offset > OFFSETS / 2) return 0;
    for (int s = 0; s < strips; s++)
        for (int t = 0; t < strips; t++) {
            if (n->setup->spatial || s + t == 0) /* else all strips have the same rolls */
                tabulate(n, &n->at[first * strips + s], &n->at[second * strips + t], cell);
            const double *of_s = n->at[first * strips + s].width, *of_t = n->at[second * strips + t].width;
            for (int a = 0; a < A; a++) out[s * strips + t] += of_s[a] * dot(cell + a * A, of_t, A);
        }
    return 1;
}

/* −C_fs κ C_sf + Σ W Wᵀ/Ω² over the ground oscillators that are not dynamic, between two points */
static double through_ground(const node *n, int i, int j, const double *still)
{
    const int set = n->setup->base.set, reads = n->gear->ground[set].reads, supports = n->model->supports;
    const double *kappa = n->model->ground[set].kappa, *a = n->support + (size_t)i * supports;
    const double *x = n->ground + (size_t)i * reads, *y = n->ground + (size_t)j * reads;
    double sum = 0.0;
    for (int s = 0; s < supports; s++)
        if (a[s] != 0.0) sum -= a[s] * dot(kappa + s * supports, n->support + (size_t)j * supports, supports);
    for (int k = 0; k < reads; k++) sum += x[k] * y[k] * still[k];
    return sum;
}

/* 1/Ω² of the ground oscillators that the gear reads and that are not dynamic, 0 of the others */
static void flexibility_of_still(const node *n, double *still)
{
    const gk_base *base = &n->setup->base;
    const int32_t *list = n->gear->ground[base->set].list;
    for (int k = 0; k < n->gear->ground[base->set].reads; k++) {
        const double omega = n->model->ground[base->set].omega[list[k]];
        still[k] = base->slot[list[k]] >= 0 ? 0.0 : 1.0 / (omega * omega);
    }
}

/* Σ a b/ω² over the dynamic modes, rows halfway to the next node as the step interpolates them */
static double carried_halfway(const node *n, int at, int i, int j)
{
    const gk_modal *m = &n->setup->modal[n->side->gear];
    const gk_real *rows = n->side->rows + (size_t)at * n->points * m->n, *next = rows + (size_t)n->points * m->n;
    const gk_real *a = rows + (size_t)i * m->n, *c = next + (size_t)i * m->n;
    const gk_real *b = rows + (size_t)j * m->n, *d = next + (size_t)j * m->n;
    double lane[4] = {0, 0, 0, 0};
    for (int k = 0; k < m->n; k++)
        if (m->omega2[k] > 0) lane[k % 4] += 0.25 * ((double)a[k] + c[k]) * ((double)b[k] + d[k]) / m->omega2[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* The residual between two candidates at a node, and of a tooth with itself what no stored mode carries: what its
 * damper is parallel to. Halfway to the next node: what makes the parabola there right. */
static void store_block(const node *n, int at, int halfway, const double *still, int p, int q)
{
    const gk_side *side = n->side;
    const int strips = n->setup->strips, square = strips * strips, dynamic = n->setup->modal[side->gear].count;
    const size_t columns = (size_t)side->columns, size = 2 * (size_t)n->points * columns;
    gk_real *table = side->residual + (size_t)at * size;
    double cell[MAX_BLOCK];
    const int near = tabulated(n, p, q, cell);
    for (int c = 0; c < square; c++) {
        const int i = p * strips + c / strips, j = q * strips + c % strips;
        const size_t here = 2 * (size_t)i * columns + (size_t)j, mirrored = 2 * (size_t)j * columns + (size_t)i;
        const double stored = !near || (p == q && !halfway) ? carried(n, i, j, n->gear->modes) : 0.0;
        const double ground = n->e->kind == MESH_FLAT ? 0.0 : through_ground(n, i, j, still);
        const double all = (near ? cell[c] : stored) + ground;
        if (halfway) {
            const double middle = all - carried_halfway(n, at, i, j);
            table[here + columns] = table[mirrored + columns] = (gk_real)(4.0 * middle - table[here] -
                                                                          table[here + size]);
            continue;
        }
        if (p == q) side->path[((size_t)at * side->candidates + p) * square + c] = cell[c] - stored;
        table[here] = table[mirrored] = (gk_real)(all - carried(n, i, j, dynamic));
    }
}

static void store_residual(const node *n, int at, int halfway, const double *still)
{
    for (int p = 0; p < n->side->candidates; p++)
        for (int q = p; q < n->side->candidates; q++) store_block(n, at, halfway, still, p, q);
}

/* flank to bore angle and to supports, beside what dynamic oscillators carry */
static void store_joints(const node *n, int at, const double *still)
{
    const gk_side *side = n->side;
    const gk_base *base = &n->setup->base;
    const int points = n->points, supports = n->model->supports, reads = n->gear->ground[base->set].reads;
    const int32_t *list = n->gear->ground[base->set].list;
    const gk_ground *ground = &n->model->ground[base->set];
    double moved[MAX_SUPPORTS];
    for (int i = 0; i < points; i++) {
        const double *row = n->ground + (size_t)i * reads, *fs = n->support + (size_t)i * supports;
        double turned = n->port[i];
        for (int s = 0; s < supports; s++) moved[s] = fs[s];
        for (int k = 0; k < reads; k++) {
            const double w = row[k] * still[k];
            if (w == 0.0) continue;
            for (int s = 0; s < supports; s++) moved[s] += w * ground->support_rows[s * ground->n + list[k]];
            if (n->side->port_of >= 0) turned += w * ground->port_rows[n->side->port_of * ground->n + list[k]];
        }
        double *to = side->support + ((size_t)at * points + i) * gk_padded(supports);
        for (int s = 0; s < supports; s++) {
            const double *kappa = ground->kappa + s * supports;
            to[s] = dot(kappa, moved, supports);
            if (n->side->port_of >= 0)
                turned -= fs[s] * dot(kappa, n->model->port_support + n->side->port_of * supports, supports);
        }
        side->port[(size_t)at * points + i] = turned;
    }
}

static void store_rows(const node *n, int at)
{
    const gk_side *side = n->side;
    const gk_modal *m = &n->setup->modal[side->gear];
    for (int i = 0; i < n->points; i++) {
        gk_real *to = side->rows + ((size_t)at * n->points + i) * m->n;
        memset(to, 0, (size_t)m->n * sizeof *to);
        for (int k = 0; k < m->count; k++) to[m->lane[k]] = (gk_real)n->rows[(size_t)i * n->gear->modes + k];
    }
}

/* rows of the dynamic ground oscillators without the rigid motion, which the gap reads */
static void store_ground(const node *n, int at)
{
    const gk_side *side = n->side;
    const gk_base *base = &n->setup->base;
    const int reads = n->gear->ground[base->set].reads, from = base->from[side->gear], width = base->width[side->gear];
    const int32_t *list = n->gear->ground[base->set].list;
    for (int i = 0; i < n->points; i++) {
        double *to = side->ground + ((size_t)at * n->points + i) * width;
        const double *row = n->ground + (size_t)i * reads, *rigid = n->rigid + (size_t)i * reads;
        memset(to, 0, (size_t)width * sizeof *to);
        for (int k = 0; k < reads; k++)
            if (base->slot[list[k]] >= 0) to[base->slot[list[k]] - from] = row[k] - rigid[k];
    }
}

/* ---- all of them ------------------------------------------------------------------------------------------------- */
static node begin_node(const gk_model *model, const gk_setup *setup, double *room, int e, const gk_side *side)
{
    node n = {
        .model = model, .setup = setup, .e = &model->engagement[e], .gear = &model->gear[side->gear], .side = side};
    const size_t most = points_of(model), reads = (size_t)n.gear->ground[setup->base.set].reads;
    n.points = side->candidates * setup->strips;
    n.rows = room, room += most * (size_t)n.gear->modes;
    n.ground = room, room += most * reads;
    n.rigid = room, room += most * reads;
    n.support = room, room += most * (size_t)model->supports;
    n.port = room, room += most;
    n.flexibility = room;
    for (int k = 0; k < n.gear->modes; k++) n.flexibility[k] = 1.0 / (n.gear->omega[k] * n.gear->omega[k]);
    gk_strips_rows(model, setup, n.e, side->gear, n.weight);
    const double x = n.e->position[1][0] - n.e->position[0][0], y = n.e->position[1][1] - n.e->position[0][1];
    const double R = gk_base_reach(model, n.e);
    n.length = sqrt(gk_max(x * x + y * y - R * R, 0.0));
    return n;
}

/* the supports that any point of the tables loads */
static gk_span held_by(const double *support, size_t points, int supports)
{
    int from = supports, to = 0;
    for (size_t i = 0; i < points; i++, support += gk_padded(supports))
        for (int s = 0; s < supports; s++)
            if (support[s] != 0.0) from = s < from ? s : from, to = s >= to ? s + 1 : to;
    return from < to ? (gk_span){from, to - from} : (gk_span){0, 0};
}

/* rows over the supports become rows of whole quads over those that the side loads */
static void keep_held(gk_side *side, size_t rows, int supports)
{
    const size_t width = (size_t)gk_padded(side->held.width), held = (size_t)side->held.width;
    for (size_t r = 0; r < rows; r++) {
        double row[MAX_SUPPORTS] = {0};
        memcpy(row, side->support + r * (size_t)gk_padded(supports) + side->held.from, held * sizeof *row);
        memcpy(side->support + r * width, row, width * sizeof *row);
    }
}

/* tables of a side that the level decides */
void gk_side_fill(const gk_model *model, gk_setup *setup, gk_work *work, int e, int which)
{
    gk_side *side = &setup->mesh[e].side[which];
    node n = begin_node(model, setup, work->columns, e, side);
    double still[MAX_GROUND];
    const size_t nodes = (size_t)side->nodes + 1, points = (size_t)n.points;
    flexibility_of_still(&n, still);
    for (int at = 0; at <= side->nodes; at++) {
        gather_node(&n, (double)at / side->nodes);
        store_rows(&n, at);
        if (setup->on.elastic && n.e->kind != MESH_FLAT) store_ground(&n, at);
        if (setup->on.residual) store_residual(&n, at, 0, still);
        if (setup->on.residual && n.e->kind != MESH_FLAT) store_joints(&n, at, still);
    }
    for (int at = 0; at < side->nodes && setup->on.residual; at++) {
        gather_node(&n, (at + 0.5) / side->nodes);
        store_residual(&n, at, 1, still);
    }
    if (!setup->on.elastic || n.e->kind == MESH_FLAT)
        memset(side->ground, 0, nodes * points * (size_t)setup->base.width[side->gear] * sizeof *side->ground);
    if (!setup->on.residual) {
        memset(side->residual, 0, 2 * nodes * points * (size_t)side->columns * sizeof(gk_real));
        memset(side->path, 0, nodes * points * (size_t)setup->strips * sizeof *side->path);
    }
    if (!setup->on.residual || n.e->kind == MESH_FLAT) {
        memset(side->port, 0, nodes * points * sizeof *side->port);
        memset(side->support, 0, nodes * points * (size_t)gk_padded(model->supports) * sizeof *side->support);
    }
    side->held = held_by(side->support, nodes * points, model->supports);
    keep_held(side, nodes * points, model->supports);
}
