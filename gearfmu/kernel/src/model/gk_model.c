/* Blob → gk_model: every field present, of the right size and plausible, or one message that says which is not.
 * Nothing is trusted before it is checked. */
#include "base/gk_lanes.h"
#include "base/gk_math.h"
#include "model/gk_model_gear.h"
#include "model/gk_read.h"
#include "model/gk_vars.h"

enum { MODEL_VERSION = 5, MOST_NAME = 64 };

static void read_counts(gk_reader *r, gk_model *m)
{
    const int32_t *c = gk_read_take(r, F_MODEL_counts);
    if (!c) return;
    if (c[0] != MODEL_VERSION) return gk_read_refuse(r, "model version", "is not the one this kernel reads");
    WITHIN(r, c[1], SLICES, "number of slices");
    WITHIN(r, c[2], ROTORS, "number of rotors");
    WITHIN(r, c[3], GEARS, "number of gears");
    WITHIN(r, c[4], ENGAGEMENTS, "number of engagements");
    WITHIN(r, c[5], PORTS, "number of ports");
    WITHIN(r, c[6], SUPPORTS, "number of supported directions");
    gk_read_demand(r,
                   gk_read_counted(c + 7, 1, MAX_FUNCTIONS) && gk_read_counted(c + 8, 4, 1000) &&
                       gk_read_counted(c + 9, 1, SETS),
                   "counts");
    if (r->outcome) return;
    m->slices = c[1], m->rotors = c[2], m->gears = c[3], m->engagements = c[4], m->ports = c[5], m->supports = c[6];
    m->functions = c[7], m->rolls = c[8], m->sets = c[9];
    static const gk_symbol counts[] = {SYMBOL_rotors,   SYMBOL_gears,     SYMBOL_engagements, SYMBOL_ports,
                                       SYMBOL_supports, SYMBOL_functions, SYMBOL_rolls};
    for (int i = 0; i < 7; i++) r->shape.size[counts[i]] = (uint64_t)c[2 + i];
}

/* the names in a text, separated by bars, into rows of NAME_LENGTH */
static void read_names(gk_reader *r, int field, int count, char (*out)[NAME_LENGTH])
{
    const char *at = gk_read_take(r, field);
    if (r->outcome || count == 0) return;
    for (int i = 0; i < count; i++) {
        const size_t length = strcspn(at, "|");
        const int last = i + 1 == count;
        if (!length || length >= NAME_LENGTH || (at[length] == 0) != last)
            return gk_read_refuse(r, gk_field_name(field), "does not hold the names there should be");
        memcpy(out[i], at, length);
        out[i][length] = 0;
        at += length + 1;
    }
}

/* frames are moving rotors on the ground */
static void read_frames(gk_reader *r, gk_model *m)
{
    const int32_t *frame = gk_read_take(r, F_MODEL_frame);
    for (int i = 0; i < m->rotors; i++) {
        m->frame[i] = -1;
        if (!frame || r->outcome) continue;
        gk_read_demand(r, gk_read_counted(frame + i, -1, m->rotors - 1) && frame[i] != i, "frames");
        if (r->outcome) return;
        m->frame[i] = frame[i];
    }
    m->support_turn = gk_read_take(r, F_MODEL_support_turn);
    for (int i = 0; m->support_turn && i < m->supports; i++) {
        const int32_t *turn = m->support_turn + i;
        gk_read_demand(r, gk_read_counted(turn, -1, 2 * m->rotors - 1), "axes of supports");
        if (*turn >= 0 && *turn % 2 == 0)
            gk_read_demand(r, i + 1 < m->supports && turn[1] == turn[0] + 1, "axes of supports");
    }
    m->carried = (int)gk_read_count(r, F_MODEL_carried);
    gk_read_demand(r, m->carried <= MAX_CARRIED, "carried bodies");
    r->shape.size[SYMBOL_carried] = (uint64_t)m->carried;
    m->carried_frame = gk_read_take(r, F_MODEL_carried);
    m->carried_place = gk_read_bounded(r, F_MODEL_carried_place, 1e3);
    if (m->carried && !m->carried_place) gk_read_refuse(r, "places of carried bodies", "are missing");
    for (int i = 0; i < m->carried && !r->outcome; i++)
        gk_read_demand(r, gk_read_counted(m->carried_frame + i, 0, m->rotors - 1), "carried bodies");
    m->whirls = (int)gk_read_count(r, F_MODEL_whirl);
    gk_read_demand(r, m->whirls <= MAX_WHIRLS, "gyroscopic pairs");
    r->shape.size[SYMBOL_whirls] = (uint64_t)m->whirls;
    m->whirl = gk_read_take(r, F_MODEL_whirl);
    for (int i = 0; i < m->whirls && !r->outcome; i++)
        gk_read_demand(r, gk_read_counted(m->whirl + i, 0, m->rotors - 1), "gyroscopic pairs");
    for (int i = 0; i < m->rotors; i++)
        if (m->frame[i] >= 0) gk_read_demand(r, m->frame[m->frame[i]] < 0 && m->inertia[m->frame[i]] > 0.0, "frames");
}

static void read_stage(gk_reader *r, gk_model *m)
{
    const int32_t *degree = gk_read_take(r, F_MODEL_degrees);
    const double *limits = gk_read_take(r, F_MODEL_limits), *inertia = gk_read_take(r, F_MODEL_inertia);
    m->name = gk_read_take(r, F_MODEL_name);
    if (r->outcome) return;
    gk_read_demand(r, m->name[0] && strlen(m->name) <= MOST_NAME, "name");
    const char *guid = gk_read_take(r, F_MODEL_guid);
    if (r->outcome) return;
    gk_read_demand(r, !guid || strlen(guid) == 64, "guid");
    m->guid = guid ? guid : m->blob.hash;
    m->cut[0] = limits[0], m->cut[1] = limits[1], m->h_max = limits[2], m->period_min = limits[3];
    WITHIN(r, m->cut[0], CUT, "cut frequency of level fast, Hz,");
    WITHIN(r, m->cut[1], CUT, "cut frequency of level standard, Hz,");
    gk_read_demand(r, gk_read_between(m->h_max, 1e-9, 1e-3) && gk_read_between(m->period_min, 1e-9, 1e9), "limits");
    for (int i = 0; i < m->functions; i++) {
        gk_read_demand(r, gk_read_counted(degree + i, 0, 20), "degrees of the width functions");
        m->degree[i] = degree[i];
    }
    for (int i = 0; i < m->rotors; i++) {
        if (inertia[i] != 0.0) WITHIN(r, inertia[i], INERTIA, "moment of inertia of a rotor, kg.m2,");
        m->inertia[i] = inertia[i];
    }
    read_frames(r, m);
}

static void read_port(gk_reader *r, gk_model *m, int i, const int32_t *kind, const double *v)
{
    gk_port *p = &m->port[i];
    gk_read_demand(r,
                   gk_read_counted(kind, 0, m->rotors - 1) && gk_read_counted(kind + 1, 0, 2) &&
                       gk_read_counted(kind + 2, 0, 1),
                   "kinds of ports");
    if (r->outcome) return;
    p->rotor = kind[0], p->kind = (gk_port_kind)kind[1], p->chain = kind[2] ? ++m->chains : 0;
    p->k = v[0], p->c = v[1], p->inertia = v[2], p->disc = v[3], p->shaft_k = v[4], p->shaft_c = v[5];
    if (p->kind != PORT_TORQUE) {
        WITHIN(r, p->k, PORT_STIFFNESS, "stiffness of a port, N.m/rad,");
        WITHIN(r, p->c, PORT_DAMPING, "damping of a port, N.m.s/rad,");
    }
    if (!p->chain) return;
    gk_read_demand(r, p->kind == PORT_SPRING, "chains of ports");
    WITHIN(r, p->inertia, INERTIA, "inertia of a chain, kg.m2,");
    WITHIN(r, p->disc, INERTIA, "disc inertia of a chain, kg.m2,");
    WITHIN(r, p->shaft_k, PORT_STIFFNESS, "shaft stiffness of a chain, N.m/rad,");
    WITHIN(r, p->shaft_c, PORT_DAMPING, "shaft damping of a chain, N.m.s/rad,");
}

static void read_ports(gk_reader *r, gk_model *m)
{
    const int32_t *kinds = gk_read_take(r, F_MODEL_port_kinds);
    const double *v = gk_read_take(r, F_MODEL_ports);
    m->port_residual = gk_read_bounded(r, F_MODEL_port_residual, 1e3);
    m->port_support = gk_read_bounded(r, F_MODEL_port_support, 1e3);
    const double *play = gk_read_bounded(r, F_MODEL_port_play, 1.0);
    for (int i = 0; i < m->ports && !r->outcome; i++) {
        read_port(r, m, i, kinds + 3 * i, v + 6 * i);
        m->port[i].play = play ? play[i] : 0.0;
        if (m->port[i].play < 0.0) gk_read_refuse(r, "plays of ports", "are negative");
    }
    for (int i = 0; i < m->ports; i++)
        for (int j = 0; j < i; j++)
            if (m->port[i].rotor == m->port[j].rotor) gk_read_refuse(r, "ports", "share a rotor");
    for (int i = 0; i < m->ports && !r->outcome; i++)
        if (m->inertia[m->port[i].rotor] == 0.0) gk_read_refuse(r, "ports", "sit on a rotor that stands");
}

/* penalty and nodes are there together */
static void read_nodal(gk_reader *r, gk_model *m)
{
    const double *v = gk_read_take(r, F_MODEL_nodal);
    for (int i = 0; v && i < m->engagements && !r->outcome; i++) {
        gk_engagement *e = &m->engagement[i];
        WITHIN(r, v[2 * i], PENALTY, "penalty of nodal contact, N/m3,");
        gk_read_demand(r, gk_read_between(v[2 * i + 1], 0, 1), "numbers of nodal contact");
        for (int w = 0; w < 2; w++)
            if (!m->gear[e->gear[w]].nodes[0]) gk_read_refuse(r, "nodes of a flank", "are missing");
        e->penalty = v[2 * i], e->nodes_of_a = v[2 * i + 1];
    }
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

/* directions of points of the housing */
static void read_sensors(gk_reader *r, gk_model *m)
{
    const uint64_t count = gk_read_count(r, F_MODEL_sensed);
    gk_read_demand(r, count <= MAX_SENSORS, "number of sensors");
    r->shape.size[SYMBOL_sensors] = count;
    const int32_t *sensed = gk_read_take(r, F_MODEL_sensed);
    if (r->outcome) return;
    for (uint64_t i = 0; i < count; i++) gk_read_demand(r, gk_read_counted(sensed + i, 0, 2), "directions of sensors");
    if (count) read_names(r, F_MODEL_sensor_names, (int)count, m->sensor_name);
    m->sensors = (int)count;
}

static void read_ground(gk_reader *r, gk_model *m, int set)
{
    gk_ground *g = &m->ground[set];
    r->shape.set = set;
    const uint64_t n = gk_read_count(r, F_SET_omega_ground);
    gk_read_demand(r, n <= MAX_GROUND, "ground oscillators");
    if (r->outcome) return;
    g->n = (int)n;
    r->shape.size[SYMBOL_ground] = n;
    g->omega = gk_read_take(r, F_SET_omega_ground), g->zeta = gk_read_take(r, F_SET_zeta_ground);
    g->rigid_share = gk_read_bounded(r, F_SET_rigid_share, 1.001);
    g->damper_rows = gk_read_bounded(r, F_SET_damper_rows, 1e6), g->damper = gk_read_take(r, F_SET_damper);
    g->support_rows = gk_read_bounded(r, F_SET_support_rows, 1e6), g->kappa = gk_read_bounded(r, F_SET_kappa, 1e17);
    g->carrying = g->kappa ? m->supports : 0;
    while (g->carrying && g->kappa[(g->carrying - 1) * (m->supports + 1)] == 0.0) g->carrying--;
    g->support_compliance = gk_read_bounded(r, F_SET_support_compliance, 1e3);
    g->support_coupling = gk_read_bounded(r, F_SET_support_coupling, 1e3);
    g->port_rows = gk_read_bounded(r, F_SET_port_rows, 1e6);
    g->sensor_rows = gk_read_bounded(r, F_SET_sensor_rows, 1e6);
    g->carried_rows = gk_read_bounded(r, F_SET_carried_rows, 1e6);
    if (m->carried && !g->carried_rows) gk_read_refuse(r, "motion of carried bodies", "is missing");
    g->whirl_rows = gk_read_bounded(r, F_SET_whirl_rows, 1e6);
    if (m->whirls && !g->whirl_rows) gk_read_refuse(r, "rows of gyroscopic pairs", "are missing");
    for (int k = 0; k < g->n && !r->outcome; k++) {
        gk_read_demand(r, gk_read_between(g->omega[k], 1e-3, 1e12), "ground oscillators");
        WITHIN(r, g->zeta[k], DAMPING_RATIO, "damping ratio of a ground oscillator");
        if (k && g->omega[k] < g->omega[k - 1] * (1 - 1e-6)) gk_read_refuse(r, "ground oscillators", "are not sorted");
    }
    for (int k = 0; k < m->supports && !r->outcome; k++)
        gk_read_demand(r, gk_read_between(g->damper[k], 0, 1e12), "dashpots of the supports");
}

static double squared_distance(const gk_engagement *e)
{
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    return x * x + y * y;
}

static double direction_of(const gk_engagement *e)
{
    const double sense = e->kind == MESH_INTERNAL ? -1.0 : 1.0;
    return gk_atan2(sense * (e->position[1][1] - e->position[0][1]), sense * (e->position[1][0] - e->position[0][0]));
}

static void read_engagement(gk_reader *r, gk_model *m, int i, const int32_t *who, int shift, const double *v)
{
    gk_engagement *e = &m->engagement[i];
    gk_read_demand(r,
                   gk_read_counted(who, 0, m->gears - 1) && gk_read_counted(who + 1, 0, m->gears - 1) &&
                       who[0] != who[1] && gk_read_counted(who + 2, -1, 1) && gk_read_counted(who + 3, -4, 4),
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
    gk_read_demand(r, gk_read_between(e->nominal_backlash, -1e-2, 1e-2) && gk_read_between(e->force_max, 1e-9, 1e12),
                   "engagements");
    const gk_gear *A = &m->gear[e->gear[0]], *B = &m->gear[e->gear[1]];
    const double reach = e->kind == MESH_INTERNAL ? B->r_b - A->r_b : A->r_b + B->r_b;
    if (e->kind != MESH_FLAT && !(squared_distance(e) > 1.0002 * reach * reach))
        gk_read_refuse(r, "centre distance", "is smaller than the base radii allow");
    if (A->rotor == B->rotor) gk_read_refuse(r, "engagements", "join gears of one rotor");
    if (m->frame[A->rotor] != m->frame[B->rotor])
        gk_read_refuse(r, "engagements", "join gears that stand in different axes");
    if (m->frame[A->rotor] == A->rotor || m->frame[A->rotor] == B->rotor)
        gk_read_refuse(r, "frames", "turn in themselves");
    if (e->kind != MESH_FLAT && !(fabs(A->helix + e->kind * B->helix) < 1e-6))
        gk_read_refuse(r, "helix angles", "do not fit each other");
    e->width = gk_min(A->width, B->width);
    e->overlap_max = e->kind == MESH_FLAT ? 1.0 : 0.25 * fabs(A->s_tip - A->s_form);
}

static void read_engagements(gk_reader *r, gk_model *m)
{
    char names[MAX_ENGAGEMENTS][NAME_LENGTH];
    const int32_t *who = gk_read_take(r, F_MODEL_engaged);
    const int32_t *shift = gk_read_take(r, F_MODEL_tooth_shift);
    const double *v = gk_read_take(r, F_MODEL_engagement), *direction = gk_read_take(r, F_MODEL_direction);
    read_names(r, F_MODEL_engagement_names, m->engagements, names);
    for (int i = 0; i < m->engagements && !r->outcome; i++) {
        memcpy(m->engagement[i].name, names[i], NAME_LENGTH);
        gk_read_demand(r, !shift || gk_read_counted(shift + i, -10000, 10000), "engagements");
        gk_read_demand(r, !direction || gk_read_between(direction[i], -4.0, 4.0), "directions of engagements");
        if (!r->outcome) read_engagement(r, m, i, who + 4 * i, shift ? shift[i] : 0, v + 10 * i);
        if (!r->outcome) m->engagement[i].direction = direction ? direction[i] : direction_of(&m->engagement[i]);
    }
}

static void read_starts(gk_reader *r, gk_model *m)
{
    m->starts = (int)gk_read_count(r, F_MODEL_start_reference);
    gk_read_demand(r, m->starts <= MAX_STARTS, "starts");
    r->shape.size[SYMBOL_starts] = (uint64_t)m->starts;
    m->start_reference = gk_read_take(r, F_MODEL_start_reference);
    m->start_value = gk_read_take(r, F_MODEL_start_value);
    if (m->starts && !m->start_value) gk_read_refuse(r, "starts", "are missing");
    for (int i = 0; i < m->starts && !r->outcome; i++)
        gk_read_demand(r, gk_start_allowed(m, (uint32_t)m->start_reference[i], m->start_value[i]), "starts");
}

gk_outcome gk_model_open(gk_model *model, const void *blob, size_t size, char message[GK_MESSAGE])
{
    GK_ASSERT(model && message);
    memset(model, 0, sizeof *model);
    message[0] = 0;
    gk_outcome outcome = gk_blob_open(&model->blob, blob, size, message);
    if (outcome) return outcome;
    gk_reader r = {.blob = &model->blob, .message = message};
    read_counts(&r, model);
    read_names(&r, F_MODEL_rotor_names, model->rotors, model->rotor_name);
    read_names(&r, F_MODEL_support_names, model->supports, model->support_name);
    read_names(&r, F_MODEL_displacement_names, model->supports, model->displacement_name);
    model->housed = model->sets > 2;
    if (!r.outcome) read_sensors(&r, model);
    if (!r.outcome) read_stage(&r, model);
    if (!r.outcome) read_ports(&r, model);
    for (int i = 0; i < model->sets && !r.outcome; i++) read_ground(&r, model, i);
    for (int i = 0; i < model->gears && !r.outcome; i++) gk_model_gear(&r, model, i);
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
