/* Which teeth may touch: pairs whose gap (gk_section.c) is below a search distance, on the drive and the coast flank,
 * and their entries in the tables of both sides. In space every strip has its own section. A tooth with an index
 * deviation ε is the same tooth at β + ε (docs/theory.md, eq. 4a). */
#include "force/gk_flank.h"
#include "force/gk_parts.h"
#include "force/gk_section.h"

static const double LEAN = 0.2e-3; /* m: what tilts may close of a gap */

static gk_posed pair_of(const gk_model *model, const gk_setup *setup, const gk_mesh *mesh, const double *pose)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    return (gk_posed){model, setup,          e, mesh, {&model->gear[e->gear[0]], &model->gear[e->gear[1]]},
                      pose,  mesh->allowance};
}

/* Teeth out of their places (index deviation, ISO 1328-1): flank, roll and base angle turn with the tooth. Returns what
 * the gap loses. */
static double misplace(const gk_posed *q, double sg, const gk_place *p, double beta[2], double rolls[2])
{
    double closer = 0.0;
    for (int i = 0; i < 2; i++) {
        const gk_gear *gear = q->gear[i];
        if (!gear->index) continue;
        const double angle = gear->index[p->flank * gear->z + p->tooth[i]], roll = sg * gear->r_b * angle;
        beta[i] += angle;
        rolls[i] += roll;
        closer += i && gk_is_internal(q) ? -roll : roll;
    }
    return closer;
}

/* of a slice of both teeth */
static void take_deviations(const gk_posed *q, const gk_place *p, int strip, gk_tooth_flanks *f)
{
    for (int w = 0; w < 2; w++) f->depth[w] = gk_deviation_line(&q->mesh->deviation[w], p->tooth[w], p->flank, strip);
}

/* what tilts of both gears may close of a gap */
static double tilting(const gk_posed *q)
{
    double angle = 0.0;
    for (int c = RXA; c <= RYA; c++) angle += fabs(q->pose[c]) + fabs(q->pose[SPACE + c]) + fabs(q->e->tilt[c - RXA]);
    return q->e->width * angle;
}

/* what may close of the gaps of a side beside its nearest: tilts, of spur teeth as they are */
static double leaning(const gk_posed *q)
{
    if (!q->setup->spatial) return 0.0;
    return q->mesh->helix[0] == 0.0 && q->mesh->helix[1] == 0.0 ? gk_min(LEAN, tilting(q)) : LEAN;
}

/* Every slice by itself; 0 when none comes within `search_distance`. Slices of spur teeth with the same deviations have
 * one section; those of helical ones, for nodal contact, touch where they are nearest to the flanks. */
static int slices_of(const gk_posed *q, gk_tooth_flanks *f, const double roll[2], double search_distance,
                     gk_place *place)
{
    const gk_flank_side *s = f->side;
    const int spur = q->mesh->helix[0] == 0.0 && q->mesh->helix[1] == 0.0;
    const double half = 0.5 * q->e->width / q->setup->slices;
    const double *depth[2] = {NULL, NULL};
    const gk_line line = gk_strips_line(q->model, q->mesh, s->sg, roll);
    gk_point plane;
    gk_touch t;
    f->open = GK_OPEN;
    place->gap = GK_OPEN;
    for (int i = 0; i < GK_STRIPS(q->setup); i++) {
        gk_point *p = &place->point[i];
        const double z = q->mesh->strip_middle[i], from = z - half, to = z + half, middle = 0.5 * (from + to);
        take_deviations(q, place, i, f);
        if (!i || !spur || f->depth[0] != depth[0] || f->depth[1] != depth[1])
            gk_section_at(q, f, roll, gk_clamp(gk_clamp(middle, line.edge[0], line.edge[1]), from, to), &plane, &t);
        if (!i && spur && plane.gap - q->mesh->protrusion - tilting(q) > search_distance) return 0;
        *p = plane, depth[0] = f->depth[0], depth[1] = f->depth[1];
        gk_parts_lean(q, s->sg, &t, middle, p);
        if (GK_ON(q->setup, friction)) gk_parts_glide(q, s->sg, &t, middle, p);
        p->share = (to - from) / (2.0 * half);
        p->gap += q->mesh->cosine * q->mesh->lead[s->flank][i];
        place->gap = gk_min(place->gap, p->gap);
    }
    return place->gap < search_distance;
}

static int modulo(int64_t k, int z)
{
    const int m = (int)(k % z);
    return m < 0 ? m + z : m;
}

/* one tooth pair; 0 when it does not come within `search_distance` */
static int tooth_pair(const gk_posed *q, const gk_flank_side *s, int k, double search_distance, gk_place *p)
{
    gk_tooth_flanks f = {
        s, {s->base[0] + k * s->pitch[0], s->base[1] + s->step * k * s->pitch[1]}, 0.0, {NULL}, {NULL}, {0.0}, GK_OPEN};
    double roll[2] = {s->roll[0] + s->sg * k * s->p_b, s->roll[1] + s->step * s->sg * k * s->p_b};
    p->key.flank = p->flank = s->flank;
    p->key.tooth = k;
    p->action = s->l.t;
    p->number[0] = k, p->number[1] = s->shift + s->step * k;
    for (int i = 0; i < 2; i++) p->tooth[i] = modulo(p->number[i], q->gear[i]->z);
    if (q->gear[0]->index || q->gear[1]->index) f.closer = misplace(q, s->sg, p, f.beta, roll);
    if (q->mesh->rides) return gk_parts_find(q, &f, roll, search_distance, p);
    if (q->setup->spatial) return slices_of(q, &f, roll, search_distance, p);
    take_deviations(q, p, 0, &f);
    p->point[0].share = 1.0;
    p->point[0].roll[0] = roll[0], p->point[0].roll[1] = roll[1];
    gk_touch t;
    const int glides = GK_ON(q->setup, friction);
    if (!gk_section(q, &f, &p->point[0], glides ? &t : NULL)) return 0;
    if (glides) gk_parts_glide(q, s->sg, &t, 0.0, &p->point[0]);
    p->gap = p->point[0].gap;
    return p->gap < search_distance;
}

/* the teeth k of A that may touch: their rolls lie between the other gear's end and their own; 0: nonsense */
static int teeth(const gk_posed *q, const gk_flank_side *s, double ends[2])
{
    const double beyond = s->beyond + 0.5 * q->e->width * fabs(q->mesh->helix[0]);
    const double first = (gk_is_internal(q) ? q->gear[1]->s_tip - s->l.L : s->l.L - q->gear[1]->s_tip) - beyond;
    const double last = q->gear[0]->s_tip + beyond;
    ends[0] = s->sg > 0 ? (first - s->roll[0]) / s->p_b : (s->roll[0] - last) / s->p_b;
    ends[1] = s->sg > 0 ? (last - s->roll[0]) / s->p_b : (s->roll[0] - first) / s->p_b;
    return ends[0] > -1e8 && ends[1] < 1e8;
}

/* where both gears stand in the tables of their sides; 0 when the poses are meaningless */
static void place_sides(const gk_posed *q, const gk_mesh *mesh, const gk_flank_side *drive, gk_position position[2])
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

static int find_side(const gk_posed *q, const gk_flank_side *s, double search_distance, const gk_position position[2],
                     gk_place *place, int room)
{
    double ends[2];
    int found = 0;
    if (!(s->gap - q->mesh->protrusion - leaning(q) < search_distance))
        return 0; /* the whole side is open: it costs this one comparison */
    if (!teeth(q, s, ends)) return -1;
    for (int k = (int)gk_floor(ends[0]) + 1; k <= (int)gk_floor(ends[1]) && found < room; k++)
        if (tooth_pair(q, s, k, search_distance, &place[found]) && in_tables(q->mesh, position, &place[found])) found++;
    return found;
}

static int find_flat(const gk_posed *q, double search_distance, gk_position position[2], gk_place *p)
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

/* t of both flanks by the direction that teeth are counted from, wherever ±π lies and the axes have gone */
static void nominal_action(const gk_posed *q, gk_mesh *mesh)
{
    const double alpha = gk_acos(gk_base_distance(q) / mesh->distance);
    mesh->action[0] = q->e->direction - alpha, mesh->action[1] = q->e->direction + alpha;
}

/* Gaps of both flanks of a tooth together depend on the centre distance alone: straight but for its square */
static const double BENDS = 20.0, SURE = 1e-6; /* of it per centre distance; m */

void gk_flank_clearance(const gk_model *model, const gk_setup *setup, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index));
    double pose[POSE] = {0}, d[2], sum[2];
    gk_posed q = pair_of(model, setup, mesh, pose);
    const double step = 1e-5;
    gk_apart(&q, d);
    nominal_action(&q, mesh);
    for (int i = 0; i < 2; i++) {
        for (int c = 0; c < 2; c++) pose[XB + c] = i * step * d[c] / mesh->distance;
        const gk_flank_side drive = gk_section_side(&q, 0), coast = gk_section_side(&q, 1);
        sum[i] = drive.gap + coast.gap;
    }
    mesh->clearance = sum[0];
    mesh->clearance_slope = (sum[1] - sum[0]) / step;
}

/* no coast flank can be near, by the gaps of the drive flanks */
static int coast_is_open(const gk_posed *q, const gk_mesh *mesh, const gk_flank_side *drive, double a,
                         double search_distance)
{
    const double apart = a - mesh->distance, sum = mesh->clearance + mesh->clearance_slope * apart;
    return sum - drive->gap - mesh->protrusion - leaning(q) >
           search_distance + SURE + BENDS * apart * apart / mesh->distance;
}

/* `gk_flank_find` where both toothings stand */
static int find(const gk_posed *q, double search_distance, gk_position position[2], gk_place *place)
{
    const double *pose = q->pose;
    if (q->e->kind == MESH_FLAT) return find_flat(q, search_distance, position, place);
    const double R = gk_base_distance(q);
    double d[2];
    gk_apart(q, d);
    const double a2 = d[0] * d[0] + d[1] * d[1];
    if (!(a2 > 1.0001 * R * R) || !(a2 < 1e4) || !(fabs(pose[PHIA]) < 1e9) || !(fabs(pose[PHIB]) < 1e9)) return -1;
    const gk_flank_side drive = gk_section_side(q, 0);
    place_sides(q, q->mesh, &drive, position);
    const int both = GK_ON(q->setup, coast_flank);
    const int found = both || !q->mesh->coasts ? find_side(q, &drive, search_distance, position, place, MAX_PAIRS) : 0;
    if (found < 0 || !(both || q->mesh->coasts)) return found;
    if (coast_is_open(q, q->mesh, &drive, sqrt(a2), search_distance)) return found;
    const gk_flank_side coast = gk_section_side(q, 1);
    const int back = find_side(q, &coast, search_distance, position, place + found, MAX_PAIRS - found);
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
    gk_posed q = pair_of(model, setup, mesh, pose);
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
