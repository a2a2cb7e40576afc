/* Blob → gk_model: every field present, of the right size and plausible, or one message that says which is not.
 * Nothing is trusted before it is checked. */
#include "model/gk_model.h"
#include "base/gk_lanes.h"
#include "model/gk_fields.h"
#include "model/gk_vars.h"
#include <stdio.h>
#include <string.h>

enum { MODEL_VERSION = 4, MOST_NAME = 64 };
static const double ROUNDING = 1e-9; /* relative: of numbers that are computed from those of the stage file */

/* what is read with: blob, shape so far, and the first thing that was wrong */
typedef struct reader {
    const gk_blob *blob;
    gk_shape shape;
    gk_outcome outcome;
    char *message;
} reader;

static void refuse(reader *r, const char *what, const char *why)
{
    if (r->outcome) return;
    snprintf(r->message, GK_MESSAGE, "model blob: %s %s; make the model again with this version of gearfmu", what, why);
    r->outcome = GK_BAD_BLOB;
}

static const void *take(reader *r, int field)
{
    const char *wrong = NULL;
    if (r->outcome) return NULL;
    const void *found = gk_field_find(r->blob, field, &r->shape, &wrong);
    if (wrong) refuse(r, gk_field_name(field), wrong);
    return wrong ? NULL : found;
}

static void demand(reader *r, int holds, const char *what)
{
    if (!holds) refuse(r, what, "are out of range");
}

static int between(double x, double low, double high) { return x >= low && x <= high; }

/* a number of the stage file within its range (gk_ranges.h), but for rounding, or a message that names both */
static void demand_range(reader *r, const char *what, double x, double low, double high)
{
    if (r->outcome || between(x, low - ROUNDING * fabs(low), high + ROUNDING * fabs(high))) return;
    snprintf(r->message, GK_MESSAGE,
             "model blob: %s = %.6g is out of range, from %.6g to %.6g; correct the stage and make the model again",
             what, x, low, high);
    r->outcome = GK_BAD_BLOB;
}
#define WITHIN(r, x, RANGE, what) demand_range(r, what, x, GK_LOW_##RANGE, GK_HIGH_##RANGE)

static uint64_t length_of(const reader *r, int field) { return gk_field_count(r->blob, field, &r->shape); }

/* numbers of a field, none of them beyond ±limit */
static const double *bounded(reader *r, int field, double limit)
{
    const double *v = take(r, field);
    if (!v) return NULL;
    for (uint64_t i = 0, count = length_of(r, field); i < count; i++)
        if (!between(v[i], -limit, limit)) {
            refuse(r, gk_field_name(field), "is out of range");
            return NULL;
        }
    return v;
}

/* the same in single precision */
static const float *bounded_f32(reader *r, int field, float limit)
{
    const float *v = take(r, field);
    if (!v) return NULL;
    for (uint64_t i = 0, count = length_of(r, field); i < count; i++)
        if (!(v[i] >= -limit && v[i] <= limit)) {
            refuse(r, gk_field_name(field), "is out of range");
            return NULL;
        }
    return v;
}

static int counted(const int32_t *c, int32_t low, int32_t high) { return *c >= low && *c <= high; }

static void read_counts(reader *r, gk_model *m)
{
    const int32_t *c = take(r, F_MODEL_counts);
    if (!c) return;
    if (c[0] != MODEL_VERSION) return refuse(r, "model version", "is not the one this kernel reads");
    WITHIN(r, c[1], SLICES, "number of slices");
    WITHIN(r, c[2], ROTORS, "number of rotors");
    WITHIN(r, c[3], GEARS, "number of gears");
    WITHIN(r, c[4], ENGAGEMENTS, "number of engagements");
    WITHIN(r, c[5], PORTS, "number of ports");
    WITHIN(r, c[6], SUPPORTS, "number of supported directions");
    WITHIN(r, c[7], SUPPORTS, "number of dampers");
    demand(r, counted(c + 8, 1, MAX_FUNCTIONS) && counted(c + 9, 4, 1000) && counted(c + 10, 1, SETS), "counts");
    if (r->outcome) return;
    m->slices = c[1], m->rotors = c[2], m->gears = c[3], m->engagements = c[4], m->ports = c[5], m->supports = c[6];
    m->dampers = c[7], m->functions = c[8], m->rolls = c[9], m->sets = c[10];
    static const gk_symbol counts[] = {SYMBOL_rotors,   SYMBOL_gears,   SYMBOL_engagements, SYMBOL_ports,
                                       SYMBOL_supports, SYMBOL_dampers, SYMBOL_functions,   SYMBOL_rolls};
    for (int i = 0; i < 8; i++) r->shape.size[counts[i]] = (uint64_t)c[2 + i];
}

/* the names in a text, separated by bars, into rows of NAME_LENGTH */
static void read_names(reader *r, int field, int count, char (*out)[NAME_LENGTH])
{
    const char *at = take(r, field);
    if (r->outcome || count == 0) return;
    for (int i = 0; i < count; i++) {
        const size_t length = strcspn(at, "|");
        const int last = i + 1 == count;
        if (!length || length >= NAME_LENGTH || (at[length] == 0) != last)
            return refuse(r, gk_field_name(field), "does not hold the names there should be");
        memcpy(out[i], at, length);
        out[i][length] = 0;
        at += length + 1;
    }
}

/* frames are moving rotors on the ground */
static void read_frames(reader *r, gk_model *m)
{
    const int32_t *frame = take(r, F_MODEL_frame);
    for (int i = 0; i < m->rotors; i++) {
        m->frame[i] = -1;
        if (!frame || r->outcome) continue;
        demand(r, counted(frame + i, -1, m->rotors - 1) && frame[i] != i, "frames");
        if (r->outcome) return;
        m->frame[i] = frame[i];
    }
    m->support_turn = take(r, F_MODEL_support_turn);
    for (int i = 0; m->support_turn && i < m->supports; i++) {
        const int32_t *turn = m->support_turn + i;
        demand(r, counted(turn, -1, 2 * m->rotors - 1), "axes of supports");
        if (*turn >= 0 && *turn % 2 == 0) demand(r, i + 1 < m->supports && turn[1] == turn[0] + 1, "axes of supports");
    }
    m->carried = (int)length_of(r, F_MODEL_carried);
    demand(r, m->carried <= MAX_CARRIED, "carried bodies");
    r->shape.size[SYMBOL_carried] = (uint64_t)m->carried;
    m->carried_frame = take(r, F_MODEL_carried);
    m->carried_place = bounded(r, F_MODEL_carried_place, 1e3);
    if (m->carried && !m->carried_place) refuse(r, "places of carried bodies", "are missing");
    for (int i = 0; i < m->carried && !r->outcome; i++)
        demand(r, counted(m->carried_frame + i, 0, m->rotors - 1), "carried bodies");
    m->whirls = (int)length_of(r, F_MODEL_whirl);
    demand(r, m->whirls <= MAX_WHIRLS, "gyroscopic pairs");
    r->shape.size[SYMBOL_whirls] = (uint64_t)m->whirls;
    m->whirl = take(r, F_MODEL_whirl);
    for (int i = 0; i < m->whirls && !r->outcome; i++)
        demand(r, counted(m->whirl + i, 0, m->rotors - 1), "gyroscopic pairs");
    for (int i = 0; i < m->rotors; i++)
        if (m->frame[i] >= 0) demand(r, m->frame[m->frame[i]] < 0 && m->inertia[m->frame[i]] > 0.0, "frames");
}

static void read_stage(reader *r, gk_model *m)
{
    const int32_t *degree = take(r, F_MODEL_degrees);
    const double *limits = take(r, F_MODEL_limits), *inertia = take(r, F_MODEL_inertia);
    m->name = take(r, F_MODEL_name);
    if (r->outcome) return;
    demand(r, m->name[0] && strlen(m->name) <= MOST_NAME, "name");
    m->cut[0] = limits[0], m->cut[1] = limits[1], m->h_max = limits[2], m->period_min = limits[3];
    WITHIN(r, m->cut[0], CUT, "cut frequency of level fast, Hz,");
    WITHIN(r, m->cut[1], CUT, "cut frequency of level standard, Hz,");
    demand(r, between(m->h_max, 1e-9, 1e-3) && between(m->period_min, 1e-9, 1e9), "limits");
    for (int i = 0; i < m->functions; i++) {
        demand(r, counted(degree + i, 0, 20), "degrees of the width functions");
        m->degree[i] = degree[i];
    }
    for (int i = 0; i < m->rotors; i++) {
        if (inertia[i] != 0.0) WITHIN(r, inertia[i], INERTIA, "moment of inertia of a rotor, kg.m2,");
        m->inertia[i] = inertia[i];
    }
    read_frames(r, m);
}

static void read_port(reader *r, gk_model *m, int i, const int32_t *kind, const double *v)
{
    gk_port *p = &m->port[i];
    demand(r, counted(kind, 0, m->rotors - 1) && counted(kind + 1, 0, 2) && counted(kind + 2, 0, 1), "kinds of ports");
    if (r->outcome) return;
    p->rotor = kind[0], p->kind = (gk_port_kind)kind[1], p->chain = kind[2] ? ++m->chains : 0;
    p->k = v[0], p->c = v[1], p->inertia = v[2], p->disc = v[3], p->shaft_k = v[4], p->shaft_c = v[5];
    if (p->kind != PORT_TORQUE) {
        WITHIN(r, p->k, PORT_STIFFNESS, "stiffness of a port, N.m/rad,");
        WITHIN(r, p->c, PORT_DAMPING, "damping of a port, N.m.s/rad,");
    }
    if (!p->chain) return;
    demand(r, p->kind == PORT_SPRING, "chains of ports");
    WITHIN(r, p->inertia, INERTIA, "inertia of a chain, kg.m2,");
    WITHIN(r, p->disc, INERTIA, "disc inertia of a chain, kg.m2,");
    WITHIN(r, p->shaft_k, PORT_STIFFNESS, "shaft stiffness of a chain, N.m/rad,");
    WITHIN(r, p->shaft_c, PORT_DAMPING, "shaft damping of a chain, N.m.s/rad,");
}

static void read_ports(reader *r, gk_model *m)
{
    const int32_t *kinds = take(r, F_MODEL_port_kinds);
    const double *v = take(r, F_MODEL_ports);
    m->port_residual = bounded(r, F_MODEL_port_residual, 1e3);
    m->port_support = bounded(r, F_MODEL_port_support, 1e3);
    for (int i = 0; i < m->ports && !r->outcome; i++) read_port(r, m, i, kinds + 3 * i, v + 6 * i);
    for (int i = 0; i < m->ports; i++)
        for (int j = 0; j < i; j++)
            if (m->port[i].rotor == m->port[j].rotor) refuse(r, "ports", "share a rotor");
    for (int i = 0; i < m->ports && !r->outcome; i++)
        if (m->inertia[m->port[i].rotor] == 0.0) refuse(r, "ports", "sit on a rotor that stands");
}

static void read_numbers(reader *r, gk_gear *g)
{
    const double *v = take(r, F_GEAR_gear);
    if (!v) return;
    double *const to[] = {&g->r_b,   &g->s_form,        &g->s_tip,        &g->psi_b,  &g->phase,
                          &g->width, &g->local,         &g->strip,        &g->relief, &g->relief_start,
                          &g->edge,  &g->corner_radius, &g->corner_angle, &g->z_mid,  &g->helix};
    for (size_t i = 0; i < sizeof to / sizeof *to; i++) *to[i] = v[i];
    WITHIN(r, g->r_b, BASE_RADIUS, "base radius of a gear, m,");
    WITHIN(r, g->width, FACE_WIDTH, "face width of a gear, m,");
    WITHIN(r, g->strip, STRIP, "half-width of a load strip, m,");
    WITHIN(r, g->edge, TIP_EDGE, "radius of a tip edge, m,");
    WITHIN(r, g->relief, RELIEF, "curvature of a tip relief, 1/m,");
    WITHIN(r, g->z_mid, PLACE, "place of a gear along its axis, m,");
    demand(r,
           between(g->s_form, 0, 20) && between(g->s_tip, 0, 20) && fabs(g->s_tip - g->s_form) > 1e-6 &&
               between(g->psi_b, 0, 4) && between(g->phase, -1e3, 1e3) && between(g->local, 1e-20, 1) &&
               between(g->relief_start, -1, 20) && between(g->corner_radius, 1e-4, 20) &&
               between(g->corner_angle, -10, 10) && between(g->helix, -1.2, 1.2),
           "gear data");
}

static void check_modes(reader *r, const gk_gear *g)
{
    for (int k = 0; k < g->modes && !r->outcome; k++) {
        const int next = k + 1 < g->modes ? g->member[k + 1] : -1, before = k ? g->member[k - 1] : -1;
        demand(r, between(g->omega[k], 1e-3, 1e12), "frequencies");
        WITHIN(r, g->zeta[k], DAMPING_RATIO, "damping ratio of a gear's mode");
        demand(r, counted(g->diameter + k, 0, g->z) && counted(g->member + k, 0, 2), "nodal diameters or members");
        if ((g->member[k] == 1 && next != 2) || (g->member[k] == 2 && before != 1)) refuse(r, "mode pairs", "are torn");
    }
    for (int level = 0; level < 3 && !r->outcome; level++) {
        const int *count = g->level_modes + level;
        demand(r, counted(count, level ? count[-1] : 0, g->modes) && (*count == g->modes || g->member[*count] != 2),
               "modes of a level");
    }
}

static void read_ground_of(reader *r, gk_model *m, gk_gear *g, int set)
{
    r->shape.set = set;
    r->shape.size[SYMBOL_ground] = (uint64_t)m->ground[set].n;
    r->shape.size[SYMBOL_reads] = gk_field_count(r->blob, F_GEAR_SET_ground_list, &r->shape);
    if (r->shape.size[SYMBOL_reads] > r->shape.size[SYMBOL_ground])
        refuse(r, "ground oscillators of a gear", "are too many");
    g->ground[set].reads = (int)r->shape.size[SYMBOL_reads];
    g->ground[set].list = take(r, F_GEAR_SET_ground_list);
    g->ground[set].centre = bounded(r, F_GEAR_SET_centre, 1e6);
    g->ground[set].low = bounded(r, F_GEAR_SET_low_ground, 1e6);
    g->ground[set].node = bounded(r, F_GEAR_SET_node_ground, 1e17);
    g->ground[set].far = bounded_f32(r, F_GEAR_SET_far_ground, 1e6f);
    if (!r->outcome && (!g->far_rows != !g->far_modes || !g->far_rows != !g->ground[set].far))
        refuse(r, "patterns of far teeth", "are not known in all their parts");
    for (int k = 0; k < g->ground[set].reads && !r->outcome; k++) {
        demand(r, counted(g->ground[set].list + k, 0, m->ground[set].n - 1), "ground oscillators of a gear");
        if (k && g->ground[set].list[k] <= g->ground[set].list[k - 1])
            refuse(r, "ground oscillators of a gear", "are not sorted");
    }
}

static void read_index(reader *r, gk_gear *g)
{
    g->index = take(r, F_GEAR_index);
    g->index_most = 0.0;
    for (int k = 0; g->index && k < 2 * g->z; k++) {
        demand(r, between(g->index[k], -0.1 / g->z, 0.1 / g->z), "index deviations");
        g->index_most = gk_max(g->index_most, g->r_b * fabs(g->index[k]));
    }
}

static void read_nodes(reader *r, gk_gear *g)
{
    const int32_t *nodes = take(r, F_GEAR_nodes);
    for (int i = 0; nodes && i < 2; i++) {
        WITHIN(r, nodes[i], NODES, "number of nodes of a flank");
        if (!r->outcome) g->nodes[i] = nodes[i];
    }
}

/* penalty and nodes are there together */
static void read_nodal(reader *r, gk_model *m)
{
    const double *v = take(r, F_MODEL_nodal);
    for (int i = 0; v && i < m->engagements && !r->outcome; i++) {
        gk_engagement *e = &m->engagement[i];
        WITHIN(r, v[2 * i], PENALTY, "penalty of nodal contact, N/m3,");
        demand(r, between(v[2 * i + 1], 0, 1), "numbers of nodal contact");
        for (int w = 0; w < 2; w++)
            if (!m->gear[e->gear[w]].nodes[0]) refuse(r, "nodes of a flank", "are missing");
        e->penalty = v[2 * i], e->nodes_of_a = v[2 * i + 1];
    }
}

static void read_lead(reader *r, gk_gear *g)
{
    g->lead = take(r, F_GEAR_lead);
    for (int k = 0; g->lead && k < 2 * LEADS; k++) WITHIN(r, g->lead[k], FLANK_DEPTH, "depth of a lead, m,");
}

static void read_flanks(reader *r, gk_gear *g)
{
    gk_field_of_flanks *f = &g->flanks;
    const int32_t *size = take(r, F_GEAR_flank_size);
    demand(r,
           !size || ((size[0] == 1 || size[0] == g->z) && counted(size + 1, 1, MAX_FLANK_PLACES) &&
                     counted(size + 2, 4, MAX_FLANK_ROLLS)),
           "sizes of the deviations of flanks");
    for (int i = 0; i < 3; i++) r->shape.size[SYMBOL_flank_teeth + i] = size && !r->outcome ? (uint64_t)size[i] : 0;
    if (size && !r->outcome) f->teeth = size[0], f->places = size[1], f->rolls = size[2];
    f->depth = bounded(r, F_GEAR_flank, GK_HIGH_FLANK_DEPTH);
    if (!r->outcome && !size != !f->depth) refuse(r, "deviations of flanks", "are not whole");
    for (int k = 0; f->depth && k < 2 * f->teeth * f->places * f->rolls; k++) f->most = gk_max(f->most, -f->depth[k]);
    g->runout = bounded(r, F_GEAR_runout, GK_HIGH_RUNOUT);
}

/* the first of a pair is followed by its second */
static int pairs_whole(const int32_t *member, int count)
{
    for (int k = 0; k < count; k++) {
        const int next = k + 1 < count ? member[k + 1] : -1, before = k ? member[k - 1] : -1;
        if (!counted(member + k, 0, 2) || (member[k] == 1 && next != 2) || (member[k] == 2 && before != 1)) return 0;
    }
    return 1;
}

static void read_observed(reader *r, gk_model *m, gk_gear *g)
{
    gk_observed *o = &g->observed;
    o->name = take(r, F_GEAR_observed);
    if (r->outcome || !o->name) return;
    r->shape.size[SYMBOL_own] = length_of(r, F_GEAR_own_number);
    demand(r, r->shape.size[SYMBOL_own] <= MAX_OWN && o->name[0] && strlen(o->name) < NAME_LENGTH, "observed gears");
    o->from = m->amplitudes, o->own = (int)r->shape.size[SYMBOL_own];
    o->own_number = take(r, F_GEAR_own_number), o->member = take(r, F_GEAR_own_member);
    o->number = take(r, F_GEAR_mode_number);
    const double *scale = bounded(r, F_GEAR_mode_scale, 1e6);
    for (int set = 0; set < m->sets && !r->outcome; set++) {
        r->shape.set = set;
        r->shape.size[SYMBOL_reads] = (uint64_t)g->ground[set].reads;
        o->rows[set] = bounded(r, F_GEAR_SET_own_rows, 1e6);
        if (!o->rows[set]) refuse(r, "rows of an observed gear", "are missing");
    }
    if (!r->outcome && !(o->own_number && o->member && o->number && scale))
        refuse(r, "numbers of an observed gear", "are missing");
    if (r->outcome) return;
    for (int k = 0; k < o->own; k++) demand(r, counted(o->own_number + k, -6, 999999), "observed gears");
    for (int k = 0; k < g->modes; k++) demand(r, counted(o->number + k, 1, 999999), "observed gears");
    demand(r, pairs_whole(o->member, o->own), "pairs of observed gears");
    o->scale = *scale;
    m->amplitudes += o->own + g->modes;
}

/* whether anything moves along the axis, tilts, or differs over the face width but evenly */
static int is_spatial(const gk_model *m)
{
    for (int e = 0; e < m->engagements; e++)
        if (m->engagement[e].tilt[0] != 0.0 || m->engagement[e].tilt[1] != 0.0) return 1;
    for (int i = 0; i < m->gears; i++) {
        const gk_gear *g = &m->gear[i];
        if (g->helix != 0.0 || g->lead || g->flanks.places > 1) return 1;
        if (g->runout && (g->runout[2] != 0.0 || g->runout[3] != 0.0)) return 1;
        for (int set = 0; set < m->sets; set++)
            for (int c = 2; c < 5; c++) /* z, rx, ry */
                for (int k = 0; k < g->ground[set].reads; k++)
                    if (g->ground[set].centre[c * g->ground[set].reads + k] != 0.0) return 1;
    }
    return 0;
}

/* what words in the dimensions of a gear's fields stand for */
static void take_sizes(reader *r, const gk_model *m, const gk_gear *g)
{
    uint64_t *size = r->shape.size;
    const uint64_t places = (uint64_t)g->points * (uint64_t)m->functions, half = places * (places + 1) / 2;
    size[SYMBOL_z] = (uint64_t)g->z, size[SYMBOL_modes] = (uint64_t)g->modes;
    size[SYMBOL_points] = (uint64_t)g->points, size[SYMBOL_low] = (uint64_t)g->low;
    size[SYMBOL_flanks] = g->mirrored ? 1 : 2, size[SYMBOL_places] = places, size[SYMBOL_half] = half;
    size[SYMBOL_across] = g->mirrored ? half : places * places;
}

static void read_along(reader *r, gk_gear *g)
{
    g->along_rows = bounded_f32(r, F_GEAR_along_rows, 1e6f);
    g->along_low = bounded_f32(r, F_GEAR_along_low, 1e6f);
    g->along_normal = bounded_f32(r, F_GEAR_along_normal, 1e3f);
    g->along_own = bounded_f32(r, F_GEAR_along_own, 1e3f);
    g->along_across = bounded_f32(r, F_GEAR_along_across, 1e3f);
    const int parts = !!g->along_rows + !!g->along_low + !!g->along_normal + !!g->along_own + !!g->along_across;
    if (!r->outcome && parts % 5) refuse(r, "displacement along the profile", "is not known in all its parts");
}

/* rows of the modes and compliance beyond them, at the points that are stored */
static void read_tables(reader *r, gk_gear *g)
{
    g->resample = bounded(r, F_GEAR_resample, 1e3);
    g->rows = bounded_f32(r, F_GEAR_rows, 1e6f);
    g->low_rows = bounded_f32(r, F_GEAR_low_rows, 1e6f);
    g->low_member = take(r, F_GEAR_low_member);
    if (!r->outcome) demand(r, pairs_whole(g->low_member, g->low), "pairs of modes of nodal diameter 0 and 1");
    g->node = bounded_f32(r, F_GEAR_node, 1e3f), g->node_support = bounded(r, F_GEAR_node_support, 1e3);
    g->residual_own = bounded_f32(r, F_GEAR_residual_own, 1e3f);
    g->residual_next = bounded_f32(r, F_GEAR_residual_next, 1e3f);
    g->residual_across = bounded_f32(r, F_GEAR_residual_across, 1e3f);
    g->port_residual = bounded_f32(r, F_GEAR_port_residual, 1e3f);
    read_along(r, g);
}

static void read_gear(reader *r, gk_model *m, int i)
{
    gk_gear *g = &m->gear[i];
    r->shape.gear = i;
    const int32_t *size = take(r, F_GEAR_size);
    if (!size) return;
    WITHIN(r, size[1], TEETH, "number of teeth");
    demand(r,
           counted(size, 0, m->rotors - 1) && counted(size + 2, 0, MAX_MODES) && counted(size + 5, 1, MAX_POINTS) &&
               counted(size + 6, 0, MAX_LOW) && counted(size + 7, 0, 1),
           "sizes of a gear");
    if (r->outcome) return;
    g->rotor = size[0], g->z = size[1], g->modes = size[2];
    g->points = size[5], g->low = size[6], g->mirrored = size[7];
    take_sizes(r, m, g);
    read_numbers(r, g);
    g->omega = take(r, F_GEAR_omega), g->zeta = take(r, F_GEAR_zeta);
    g->diameter = take(r, F_GEAR_diameter), g->member = take(r, F_GEAR_member);
    g->level_modes = take(r, F_GEAR_level_modes);
    g->turn_rate = bounded(r, F_GEAR_turn_rate, 1.001);
    read_tables(r, g);
    g->far_rows = bounded_f32(r, F_GEAR_far_rows, 1e3f), g->far_modes = bounded_f32(r, F_GEAR_far_modes, 1e6f);
    if (!r->outcome) check_modes(r, g);
    for (int set = 0; set < m->sets; set++) read_ground_of(r, m, g, set);
    if (!r->outcome) read_index(r, g);
    if (!r->outcome) read_lead(r, g);
    if (!r->outcome) read_flanks(r, g);
    if (!r->outcome) read_observed(r, m, g);
    if (!r->outcome) read_nodes(r, g);
}

static void read_ground(reader *r, gk_model *m, int set)
{
    gk_ground *g = &m->ground[set];
    r->shape.set = set;
    const uint64_t n = length_of(r, F_SET_omega_ground);
    demand(r, n <= MAX_GROUND, "ground oscillators");
    if (r->outcome) return;
    g->n = (int)n;
    r->shape.size[SYMBOL_ground] = n;
    g->omega = take(r, F_SET_omega_ground), g->zeta = take(r, F_SET_zeta_ground);
    g->rigid_share = bounded(r, F_SET_rigid_share, 1.001);
    g->damper_rows = bounded(r, F_SET_damper_rows, 1e6), g->damper = take(r, F_SET_damper);
    g->support_rows = bounded(r, F_SET_support_rows, 1e6), g->kappa = bounded(r, F_SET_kappa, 1e17);
    g->support_compliance = bounded(r, F_SET_support_compliance, 1e3);
    g->port_rows = bounded(r, F_SET_port_rows, 1e6);
    g->carried_rows = bounded(r, F_SET_carried_rows, 1e6);
    if (m->carried && !g->carried_rows) refuse(r, "motion of carried bodies", "is missing");
    g->whirl_rows = bounded(r, F_SET_whirl_rows, 1e6);
    if (m->whirls && !g->whirl_rows) refuse(r, "rows of gyroscopic pairs", "are missing");
    for (int k = 0; k < g->n && !r->outcome; k++) {
        demand(r, between(g->omega[k], 1e-3, 1e12), "ground oscillators");
        WITHIN(r, g->zeta[k], DAMPING_RATIO, "damping ratio of a ground oscillator");
        if (k && g->omega[k] < g->omega[k - 1] * (1 - 1e-6)) refuse(r, "ground oscillators", "are not sorted");
    }
    for (int k = 0; k < m->dampers && !r->outcome; k++)
        demand(r, between(g->damper[k], 0, 1e12), "dashpots of the supports");
}

static double squared_distance(const gk_engagement *e)
{
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    return x * x + y * y;
}

static void read_engagement(reader *r, gk_model *m, int i, const int32_t *who, int shift, const double *v)
{
    gk_engagement *e = &m->engagement[i];
    demand(r,
           counted(who, 0, m->gears - 1) && counted(who + 1, 0, m->gears - 1) && who[0] != who[1] &&
               counted(who + 2, -1, 1) && counted(who + 3, -4, 4),
           "engagements");
    if (r->outcome) return;
    e->gear[0] = who[0], e->gear[1] = who[1], e->kind = (gk_mesh_kind)who[2];
    e->shift[0] = shift, e->shift[1] = shift + who[3];
    memcpy(e->position, v, sizeof e->position);
    e->backlash = v[4], e->nominal_backlash = v[5], e->damping = v[6], e->force_max = v[7];
    e->tilt[0] = v[8], e->tilt[1] = v[9];
    for (int k = 0; k < 4; k++) WITHIN(r, v[k], AXIS, "position of a gear, m,");
    WITHIN(r, e->backlash, BACKLASH, "backlash, m,");
    WITHIN(r, e->damping, CONTACT_DAMPING, "contact damping, N.s/m2,");
    for (int k = 0; k < 2; k++) WITHIN(r, e->tilt[k], TILT, "tilt of an axis against that of its mate, rad,");
    demand(r, between(e->nominal_backlash, -1e-2, 1e-2) && between(e->force_max, 1e-9, 1e12), "engagements");
    const gk_gear *A = &m->gear[e->gear[0]], *B = &m->gear[e->gear[1]];
    const double reach = e->kind == MESH_INTERNAL ? B->r_b - A->r_b : A->r_b + B->r_b;
    if (e->kind != MESH_FLAT && !(squared_distance(e) > 1.0002 * reach * reach))
        refuse(r, "centre distance", "is smaller than the base radii allow");
    if (A->rotor == B->rotor) refuse(r, "engagements", "join gears of one rotor");
    if (m->frame[A->rotor] != m->frame[B->rotor]) refuse(r, "engagements", "join gears that stand in different axes");
    if (m->frame[A->rotor] == A->rotor || m->frame[A->rotor] == B->rotor) refuse(r, "frames", "turn in themselves");
    if (e->kind != MESH_FLAT && !(fabs(A->helix + e->kind * B->helix) < 1e-6))
        refuse(r, "helix angles", "do not fit each other");
    e->width = gk_min(A->width, B->width);
    e->overlap_max = e->kind == MESH_FLAT ? 1.0 : 0.25 * fabs(A->s_tip - A->s_form);
}

static void read_engagements(reader *r, gk_model *m)
{
    char names[MAX_ENGAGEMENTS][NAME_LENGTH];
    const int32_t *who = take(r, F_MODEL_engaged);
    const int32_t *shift = take(r, F_MODEL_tooth_shift);
    const double *v = take(r, F_MODEL_engagement);
    read_names(r, F_MODEL_engagement_names, m->engagements, names);
    for (int i = 0; i < m->engagements && !r->outcome; i++) {
        memcpy(m->engagement[i].name, names[i], NAME_LENGTH);
        demand(r, !shift || counted(shift + i, -10000, 10000), "engagements");
        if (!r->outcome) read_engagement(r, m, i, who + 4 * i, shift ? shift[i] : 0, v + 10 * i);
    }
}

static void read_starts(reader *r, gk_model *m)
{
    m->starts = (int)length_of(r, F_MODEL_start_reference);
    demand(r, m->starts <= MAX_STARTS, "starts");
    r->shape.size[SYMBOL_starts] = (uint64_t)m->starts;
    m->start_reference = take(r, F_MODEL_start_reference);
    m->start_value = take(r, F_MODEL_start_value);
    if (m->starts && !m->start_value) refuse(r, "starts", "are missing");
    for (int i = 0; i < m->starts && !r->outcome; i++)
        demand(r, gk_start_allowed(m, (uint32_t)m->start_reference[i], m->start_value[i]), "starts");
}

gk_outcome gk_model_open(gk_model *model, const void *blob, size_t size, char message[GK_MESSAGE])
{
    GK_ASSERT(model && message);
    memset(model, 0, sizeof *model);
    message[0] = 0;
    gk_outcome outcome = gk_blob_open(&model->blob, blob, size, message);
    if (outcome) return outcome;
    reader r = {.blob = &model->blob, .message = message};
    read_counts(&r, model);
    read_names(&r, F_MODEL_rotor_names, model->rotors, model->rotor_name);
    read_names(&r, F_MODEL_support_names, model->supports, model->support_name);
    read_names(&r, F_MODEL_displacement_names, model->supports, model->displacement_name);
    if (!r.outcome) read_stage(&r, model);
    if (!r.outcome) read_ports(&r, model);
    for (int i = 0; i < model->sets && !r.outcome; i++) read_ground(&r, model, i);
    for (int i = 0; i < model->gears && !r.outcome; i++) read_gear(&r, model, i);
    if (!r.outcome) read_engagements(&r, model);
    if (!r.outcome) read_nodal(&r, model);
    if (!r.outcome) model->spatial = is_spatial(model);
    if (!r.outcome) read_starts(&r, model);
    model->rubbing = 1;
    for (int g = 0; g < model->gears; g++) model->rubbing &= model->gear[g].along_rows != NULL;
    model->spinning = model->whirls > 0;
    for (int g = 0; g < model->gears; g++) {
        model->spinning |= model->gear[g].turn_rate != NULL;
        model->deviating |= model->gear[g].flanks.depth || model->gear[g].lead;
        model->running_out |= model->gear[g].runout != NULL;
    }
    return r.outcome;
}
