/* Nodal contact with a penalty stiffness (docs/theory.md, 2.7): nodes of a flank against the deformed involute of the
 * other gear, the way of Schurr et al. (ICSV22, 2015), on every engagement.
 *
 * A node of gear c at P finds its foot on the involute of gear o in closed form, D = P − C_o, ℓ = √(D² − r_b²):
 *     t′ = arg D − sg arctan(ℓ/r_b),   s′ = r_b sg (β_o − t′),   g = ±(ℓ − s′) + δ_c + δ_o(s′) − e_c − e_o(s′)     (8h)
 * (− where o is a ring) with the outward elastic displacements e of node and foot, and its force on both is
 *     f = k A max(0, −g),   U = ½ k A max(0, −g)²,   on a coordinate x: −∂U/∂x = f ∂g/∂x                          (8i)
 * gradients being exact, slopes of relief and of e_o along the flank included. Elastic displacements are read, and
 * forces gathered, at a few points of a tooth's flank (gk_field.c). Nodes are looked for from the line of contact
 * outwards until they are open. */
#include "problem/gk_nodal.h"
#include "problem/gk_rows.h"

static const double NODE_NEAR = 5e-6; /* m: gap up to which the next node outwards is looked at too */

typedef struct tooth_in_hand { /* one tooth of a place */
    const gk_gear *gear;
    gk_field *field;
    int index;                /* wrapped number of the tooth */
    double hollow, tan_helix; /* hollow: −1 for a ring */
    double base, toward;      /* base angle at mid-width; direction t of the line of action seen from its axis */
    double along[2];          /* cos and sin of that direction */
} tooth_in_hand;

typedef struct nodal_pair { /* a place in hand */
    const gk_model *model;
    const gk_setup *setup;
    const gk_engagement *e;
    const gk_mesh *mesh;
    const gk_place *place;
    const double *pose;             /* where it is taken */
    double stand[POSE], turn[POSE]; /* where toothings stand that do not run true (gk_deviation.c) */
    double moved[POSE];             /* from there on, gaps are linear: roll_motion off */
    double rate[POSE];              /* speeds of the pose */
    int flank;
    double sg, apart[2]; /* apart: from A's axis to B's */
    tooth_in_hand tooth[2];
    double push[POSE], energy; /* forces on the pose */
    double strip[MAX_SLICES];
} nodal_pair;

typedef struct nodal_layer { /* nodes of tooth `own` across the width that share a transverse section */
    int own, first, last;    /* from `first` to before `last` */
    double z, lead;          /* of the section; what leads open there */
    const double *depth[2];  /* of the teeth of A and B beside involute and tip relief, along the roll; NULL: nothing */
    double cosine, sine;     /* of the base angle of the tooth there */
} nodal_layer;

typedef struct node_foot { /* of a node on the other flank, without elastic displacement */
    double gap, gradient[POSE], roll, roll_gradient[POSE];
} node_foot;

/* ---- gap of a node ----------------------------------------------------------------------------------------------- */
/* depth that a flank has lost to its relief, and past its tip to the tip edge: an arc tangent to the flank, followed as
 * a parabola of the length of arc */
static double depth_at(const nodal_pair *p, const gk_gear *gear, const double *line, double s, double *slope)
{
    double own_slope = 0.0;
    const double own = line ? gk_deviation_at(gear, line, s, &own_slope) : 0.0;
    const double outward = gear->s_tip > gear->s_form ? 1.0 : -1.0;
    const double over = GK_ON(p->setup, tip_relief) ? gk_max(0.0, outward * (s - gear->relief_start)) : 0.0;
    const double past = gk_max(0.0, outward * (s * s - gear->s_tip * gear->s_tip) / (2.0 * gear->r_b));
    *slope = outward * (2.0 * gear->relief * over + past * s / (gear->r_b * gear->edge)) + own_slope;
    return gear->relief * over * over + past * past / (2.0 * gear->edge) + own;
}

/* to the normal section: the gap along the common normal, and what axial motion and tilts do to it (gk_flank.c, lean)
 * */
static void lean_node(const nodal_pair *p, double z, const double normal[2], double at[2][2], node_foot *foot)
{
    const gk_mesh *mesh = p->mesh;
    const double nx = mesh->cosine * normal[0], ny = mesh->cosine * normal[1], nz = -p->sg * mesh->sine;
    foot->gap *= mesh->cosine;
    for (int d = 0; d < POSE; d++) foot->gradient[d] *= mesh->cosine;
    for (int w = 0; w < 2 && p->setup->spatial; w++) {
        const double sense = w ? 1.0 : -1.0, *pose = p->pose + SPACE * w, up = z - pose[ZA];
        double *gradient = foot->gradient + SPACE * w;
        gradient[ZA] = sense * nz;
        gradient[RXA] = sense * (at[w][1] * nz - up * ny);
        gradient[RYA] = sense * (up * nx - at[w][0] * nz);
        for (int c = PLANE; c < SPACE; c++)
            foot->gap += gradient[c] * (pose[c] + (w && c > ZA ? p->e->tilt[c - RXA] : 0.0));
    }
}

/* derivatives of c·s′, s′ = sg r_b (β_o − t′), D = (dx, dy), node at r from the axis of its own gear */
static void roll_gradient(const nodal_pair *p, int own, const double r[2], const double D[2], double length,
                          double *out)
{
    const gk_gear *gear = p->tooth[1 - own].gear;
    const double k = p->sg * gear->r_b, square = D[0] * D[0] + D[1] * D[1];
    const double radial = -p->sg * gear->r_b / (length * square);
    const double tx = -k * (-D[1] / square + radial * D[0]), ty = -k * (D[0] / square + radial * D[1]);
    memset(out, 0, POSE * sizeof *out);
    double *of_own = out + SPACE * own, *of_other = out + SPACE * (1 - own);
    of_own[XA] = tx, of_own[YA] = ty, of_own[PHIA] = ty * r[0] - tx * r[1];
    of_other[XA] = -tx, of_other[YA] = -ty, of_other[PHIA] = k;
}

/* (8h) without elastic displacements, for a node of a layer; 0 where it has no foot */
static int foot_of(const nodal_pair *p, const nodal_layer *layer, int along, node_foot *foot)
{
    const int own = layer->own;
    const gk_nodes *nodes = &p->mesh->nodes[own];
    const tooth_in_hand *c = &p->tooth[own], *o = &p->tooth[1 - own];
    const double r_b = o->gear->r_b, sense = own ? 1.0 : -1.0, x = nodes->x[along], y = p->sg * nodes->y[along];
    const double r[2] = {layer->cosine * x - layer->sine * y, layer->sine * x + layer->cosine * y};
    const double D[2] = {sense * p->apart[0] + r[0], sense * p->apart[1] + r[1]}, square = D[0] * D[0] + D[1] * D[1];
    double slope, unused;
    if (!(square - r_b * r_b > 1e-10) || !(square < 1e4)) return 0;
    const double length = sqrt(square - r_b * r_b);
    const double ct = (D[0] * r_b + p->sg * D[1] * length) / square, st = (D[1] * r_b - p->sg * D[0] * length) / square;
    const double turn = gk_atan2(st * o->along[0] - ct * o->along[1], ct * o->along[0] + st * o->along[1]);
    foot->roll = r_b * p->sg * (o->base + layer->z * o->tan_helix / r_b - o->toward - turn);
    if (!(fabs(foot->roll) < 1e3)) return 0;
    const double nx = -o->hollow * p->sg * st, ny = o->hollow * p->sg * ct; /* out of the material of o */
    foot->gap = o->hollow * (length - foot->roll) +
                depth_at(p, c->gear, layer->depth[own], nodes->roll[along], &unused) +
                depth_at(p, o->gear, layer->depth[1 - own], foot->roll, &slope) + layer->lead +
                (p->flank ? p->mesh->allowance : 0.0);
    roll_gradient(p, own, r, D, length, foot->roll_gradient);
    memset(foot->gradient, 0, sizeof foot->gradient);
    double *of_own = foot->gradient + SPACE * own, *of_other = foot->gradient + SPACE * (1 - own);
    of_own[XA] = nx, of_own[YA] = ny, of_own[PHIA] = ny * r[0] - nx * r[1];
    of_other[XA] = -nx, of_other[YA] = -ny, of_other[PHIA] = -o->hollow * p->sg * r_b;
    for (int d = 0; d < POSE; d++) foot->gradient[d] += slope * foot->roll_gradient[d];
    const double normal[2] = {own ? nx : -nx, own ? ny : -ny}; /* of the force on B */
    double at[2][2];
    memcpy(at[own], r, sizeof r), memcpy(at[1 - own], D, sizeof D);
    lean_node(p, layer->z, normal, at, foot);
    return 1;
}

/* a flat engagement has one gap for all nodes */
static int foot_at(const nodal_pair *p, const nodal_layer *layer, int along, node_foot *foot)
{
    if (p->e->kind != MESH_FLAT) return foot_of(p, layer, along, foot);
    memset(foot, 0, sizeof *foot);
    foot->gap = p->place->point[0].gap;
    foot->gradient[PHIA] = -1.0, foot->gradient[PHIB] = 1.0;
    foot->roll = p->mesh->nodes[layer->own].roll[along];
    return 1;
}

/* ---- forces ------------------------------------------------------------------------------------------------------ */
static double by_functions(const double *functions, const double *values, int n)
{
    double sum = 0.0;
    for (int a = 0; a < n; a++) sum += functions[a] * values[a];
    return sum;
}

static double by_pose(const double gradient[POSE], const double moved[POSE])
{
    double sum = 0.0;
    for (int d = 0; d < POSE; d++) sum += gradient[d] * moved[d];
    return sum;
}

/* (8i) of one node that is `depth` deep and gets deeper at `rate`; the damper never pulls and never more than doubles
 * the force (8a) */
static double force_of(nodal_pair *p, double stiffness, double depth, double rate)
{
    const double elastic = stiffness * depth, damper = stiffness * p->mesh->retardation * rate;
    p->energy += 0.5 * elastic * depth;
    return GK_ON(p->setup, contact_damping) ? elastic + gk_clamp(damper, -elastic, elastic) : elastic;
}

/* Nodes of a layer in row `along`. Returns the smallest gap. */
static double press_row(nodal_pair *p, const nodal_layer *layer, int along)
{
    const int own = layer->own, other = 1 - own, A = p->model->functions;
    const gk_nodes *nodes = &p->mesh->nodes[own];
    const tooth_in_hand *c = &p->tooth[own], *o = &p->tooth[other];
    const int linear = !GK_ON(p->setup, roll_motion) || p->e->kind == MESH_FLAT; /* the foot stays where it is */
    double smallest = INFINITY, own_load[MAX_FUNCTIONS] = {0}, other_load[MAX_FUNCTIONS] = {0}, sum = 0.0, slide = 0.0;
    node_foot foot;
    if (!foot_at(p, layer, along, &foot)) return INFINITY;
    foot.gap += by_pose(foot.gradient, p->moved);
    const gk_grid at = gk_grid_points(o->gear, foot.roll);
    const gk_reading here = gk_field_read(c->field, &nodes->grid[along]), there = gk_field_read(o->field, &at);
    const double stiffness = p->mesh->penalty[own] * nodes->length[along] / p->mesh->cosine;
    for (int j = layer->first; j < layer->last; j++) {
        const double *of_own = nodes->functions[own] + j * A, *of_other = nodes->functions[other] + j * A;
        const double gap = foot.gap - by_functions(of_own, here.at, A) - by_functions(of_other, there.at, A);
        smallest = gk_min(smallest, gap);
        if (!(gap < 0.0)) continue;
        const double slope = linear ? 0.0 : by_functions(of_other, there.slope, A);
        const double rate = slope * by_pose(foot.roll_gradient, p->rate) - by_pose(foot.gradient, p->rate) +
                            by_functions(of_own, here.rate, A) + by_functions(of_other, there.rate, A);
        const double force = force_of(p, stiffness * nodes->width[j], -gap, rate);
        sum += force, slide += force * slope;
        p->strip[nodes->strip[j]] += force;
        for (int a = 0; a < A; a++) own_load[a] += force * of_own[a], other_load[a] += force * of_other[a];
    }
    if (sum == 0.0) return smallest;
    for (int d = 0; d < POSE; d++) p->push[d] += sum * foot.gradient[d] - slide * foot.roll_gradient[d];
    gk_field_load(c->field, &nodes->grid[along], own_load);
    gk_field_load(o->field, &at, other_load);
    return smallest;
}

/* the node of a tooth that is nearest to the line of contact in the section at z */
static int nearest_node(const nodal_pair *p, const nodal_layer *layer)
{
    const tooth_in_hand *t = &p->tooth[layer->own];
    const gk_gear *gear = t->gear;
    const double from = gear->s_form * gear->s_form, to = gear->s_tip * gear->s_tip;
    const double s = gear->r_b * p->sg * (t->base - t->toward) + p->sg * layer->z * t->tan_helix;
    const int last = p->mesh->nodes[layer->own].along - 1;
    if (p->e->kind == MESH_FLAT) return 0;
    const double share = (gk_max(s, 0.0) * s - from) / (to - from);
    return share > 0.0 ? (int)(gk_min(share, 1.0) * last + 0.5) : 0;
}

/* nodes of a layer, from the line of contact outwards */
static void press_layer(nodal_pair *p, int own, int first, int last)
{
    const gk_nodes *nodes = &p->mesh->nodes[own];
    const tooth_in_hand *t = &p->tooth[own];
    nodal_layer layer = {.own = own, .first = first, .last = last, .z = p->setup->spatial ? nodes->z[first] : 0.0};
    layer.lead = nodes->lead[p->flank * t->gear->nodes[1] + first];
    for (int w = 0; w < 2; w++)
        layer.depth[w] = gk_deviation_line(&nodes->deviation[w], p->tooth[w].index, p->flank, first);
    gk_sincos(t->base + layer.z * t->tan_helix / t->gear->r_b, &layer.sine, &layer.cosine);
    const int middle = nearest_node(p, &layer);
    for (int i = middle; i < nodes->along; i++)
        if (press_row(p, &layer, i) > NODE_NEAR && i > middle) break;
    for (int i = middle - 1; i >= 0; i--)
        if (press_row(p, &layer, i) > NODE_NEAR) break;
}

/* those of a planar model have one section all over the width, those of others one each */
static void press_nodes(nodal_pair *p, int own)
{
    const int across = p->mesh->nodes[own].across, each = p->setup->spatial ? 1 : across;
    for (int j = 0; j < across && p->mesh->penalty[own] > 0.0; j += each) press_layer(p, own, j, j + each);
}

/* ---- engagements ------------------------------------------------------------------------------------------------- */
static void take_tooth(nodal_pair *p, gk_work *work, int which)
{
    tooth_in_hand *t = &p->tooth[which];
    const gk_place *place = p->place;
    const int internal = p->e->kind == MESH_INTERNAL;
    const int g = p->e->gear[which];
    t->gear = &p->model->gear[g], t->field = &work->field[which];
    t->index = place->tooth[which];
    t->hollow = internal && which ? -1.0 : 1.0;
    t->tan_helix = p->mesh->helix[which];
    t->toward = place->action + (which && !internal ? GK_PI : 0.0);
    const double angle = p->pose[SPACE * which + PHIA] + t->gear->phase +
                         2.0 * GK_PI / t->gear->z * place->number[which];
    gk_sincos(t->toward, &t->along[1], &t->along[0]);
    t->base = angle + p->sg * t->gear->psi_b;
    if (t->gear->index) t->base += t->gear->index[p->flank * t->gear->z + t->index];
    gk_field *f = t->field;
    f->setup = p->setup, f->functions = p->model->functions, f->ground = work->ground_trial;
    f->gear = g, f->flank = p->flank, f->tooth = t->index;
    gk_sincos(angle, &f->sine, &f->cosine);
}

/* forces on the poses of an engagement to spins and ground oscillators */
static void press_pose(const gk_setup *setup, gk_work *work, const gk_mesh *mesh, const double *push, double *spin_rate)
{
    const gk_base *base = &setup->base;
    const int rotor[2] = {mesh->spin[0], mesh->spin[1]};
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear;
        const double torque = push[SPACE * w + PHIA];
        spin_rate[rotor[w]] += torque * setup->inverse_inertia[rotor[w]];
        if (mesh->frame >= 0) spin_rate[mesh->frame] -= torque * setup->inverse_inertia[mesh->frame];
        for (int m = 0; m < base->motions[g]; m++) {
            const int c = base->motion[g][m];
            gk_axpy(push[SPACE * w + c], base->moved[g][c], work->ground_force + base->from[g], 0, base->width[g] / 4);
        }
    }
}

/* rows of the place's strips say what its nodes carry */
static void report(const gk_setup *setup, const nodal_pair *p, int place, gk_system *s)
{
    for (int i = 0; i < setup->strips; i++) {
        const int row = place * setup->strips + i;
        s->force[row] = s->z[row] = p->strip[i];
        s->Al[row] = s->linear[row] = s->others.deflection[row] = s->dashpot.end[row] = 0.0;
        s->local.potential[row] = i ? 0.0 : p->energy;
        if (!i && p->strip[0] == 0.0 && p->energy > 0.0) s->force[row] = 1e-300; /* energy is counted where force is */
    }
}

/* to where the toothings stand: pose, motion and rate */
static void take_runout(nodal_pair *p)
{
    if (!GK_HAS(runout) || !p->mesh->runs_out) return;
    memcpy(p->stand, p->pose, sizeof p->stand);
    gk_runout_move(p->model, p->setup, p->e, p->stand, p->turn);
    gk_runout_follow(p->turn, p->moved), gk_runout_follow(p->turn, p->rate);
    p->pose = p->stand;
}

static void press_engagement(gk_work *work, const gk_data *data, nodal_pair *p, const gk_real *const speed[],
                             double *spin_rate)
{
    const gk_setup *setup = p->setup;
    const int e = p->mesh->index;
    gk_engaged *engaged = &work->engaged[e];
    const int frozen = !GK_ON(setup, roll_motion);
    p->pose = frozen ? GK_OF(data, meshing)[e].frozen : engaged->pose;
    for (int d = 0; d < POSE && frozen; d++)
        p->moved[d] = p->e->kind == MESH_FLAT ? 0.0 : engaged->pose[d] - p->pose[d];
    gk_rows_pose(setup, work, e, work->speed, work->ground_trial + setup->base.n, p->rate);
    take_runout(p);
    for (int c = 0; c < 2; c++)
        p->apart[c] = p->e->position[1][c] + p->pose[XB + c] - (p->e->position[0][c] + p->pose[XA + c]);
    for (int i = 0; i < engaged->places; i++) {
        p->place = &engaged->place[i];
        p->flank = p->place->flank, p->sg = p->flank ? -1.0 : 1.0, p->energy = 0.0;
        memset(p->strip, 0, sizeof p->strip);
        memset(p->push, 0, sizeof p->push);
        for (int w = 0; w < 2; w++) {
            take_tooth(p, work, w);
            gk_field_begin(p->tooth[w].field, work->y[p->e->gear[w]], speed[p->e->gear[w]]);
        }
        for (int w = 0; w < 2; w++) press_nodes(p, w);
        for (int w = 0; w < 2; w++) {
            gk_real *sum[2] = {work->force[p->e->gear[w]], work->next[p->e->gear[w]]};
            gk_field_end(p->tooth[w].field, work->room.zero, sum, work->ground_force);
        }
        if (p->mesh->runs_out) gk_runout_turn(p->turn, p->push);
        press_pose(setup, work, p->mesh, p->push, spin_rate);
        report(setup, p, i, &engaged->system);
    }
}

/* takes the strips' own forces out of the problem of an engagement, which joints are left in: they only report */
void gk_nodal_leave(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    for (int i = 0; i < s->contacts; i++) s->g[i] = 1.0, s->force0[i] = s->dashpot.mean0[i] = s->dashpot.end0[i] = 0.0;
}

/* adds the forces of nodal contact at the trial state to modal forces, ground forces and rates of the spins' speeds */
void gk_nodal_press(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                    const gk_real *const speed[], double spin_rate[])
{
    GK_ASSERT(setup->nodal && speed && spin_rate);
    for (int e = 0; e < model->engagements; e++) {
        nodal_pair p = {.model = model, .setup = setup, .e = &model->engagement[e], .mesh = &setup->mesh[e]};
        press_engagement(work, data, &p, speed, spin_rate);
    }
}
