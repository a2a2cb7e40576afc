/* The gears of a blob. */
#include "base/gk_lanes.h"
#include "model/gk_model_gear.h"

static void read_numbers(gk_reader *r, gk_gear *g)
{
    const double *v = gk_read_take(r, F_GEAR_gear);
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
    gk_read_demand(r,
                   gk_read_between(g->s_form, 0, 20) && gk_read_between(g->s_tip, 0, 20) &&
                       fabs(g->s_tip - g->s_form) > 1e-6 && gk_read_between(g->psi_b, 0, 4) &&
                       gk_read_between(g->phase, -1e3, 1e3) && gk_read_between(g->local, 1e-20, 1) &&
                       gk_read_between(g->relief_start, -1, 20) && gk_read_between(g->corner_radius, 1e-4, 20) &&
                       gk_read_between(g->corner_angle, -10, 10) && gk_read_between(g->helix, -1.2, 1.2),
                   "gear data");
}

static void check_modes(gk_reader *r, const gk_gear *g)
{
    for (int k = 0; k < g->modes && !r->outcome; k++) {
        const int next = k + 1 < g->modes ? g->member[k + 1] : -1, before = k ? g->member[k - 1] : -1;
        gk_read_demand(r, gk_read_between(g->omega[k], 1e-3, 1e12), "frequencies");
        WITHIN(r, g->zeta[k], DAMPING_RATIO, "damping ratio of a gear's mode");
        gk_read_demand(r, gk_read_counted(g->diameter + k, 0, g->z) && gk_read_counted(g->member + k, 0, 2),
                       "nodal diameters or members");
        if ((g->member[k] == 1 && next != 2) || (g->member[k] == 2 && before != 1))
            gk_read_refuse(r, "mode pairs", "are torn");
    }
    for (int level = 0; level < 3 && !r->outcome; level++) {
        const int *count = g->level_modes + level;
        gk_read_demand(r,
                       gk_read_counted(count, level ? count[-1] : 0, g->modes) &&
                           (*count == g->modes || g->member[*count] != 2),
                       "modes of a level");
    }
}

static void read_ground_of(gk_reader *r, gk_model *m, gk_gear *g, int set)
{
    r->shape.set = set;
    r->shape.size[SYMBOL_ground] = (uint64_t)m->ground[set].n;
    r->shape.size[SYMBOL_reads] = gk_field_count(r->blob, F_GEAR_SET_ground_list, &r->shape);
    if (r->shape.size[SYMBOL_reads] > r->shape.size[SYMBOL_ground])
        gk_read_refuse(r, "ground oscillators of a gear", "are too many");
    g->ground[set].reads = (int)r->shape.size[SYMBOL_reads];
    g->ground[set].list = gk_read_take(r, F_GEAR_SET_ground_list);
    g->ground[set].centre = gk_read_bounded(r, F_GEAR_SET_centre, 1e6);
    g->ground[set].low = gk_read_bounded(r, F_GEAR_SET_low_ground, 1e6);
    g->ground[set].node = gk_read_bounded(r, F_GEAR_SET_node_ground, 1e17);
    g->ground[set].far = gk_read_bounded_f32(r, F_GEAR_SET_far_ground, 1e6f);
    if (!r->outcome && (!g->far_rows != !g->far_modes || !g->far_rows != !g->ground[set].far))
        gk_read_refuse(r, "patterns of far teeth", "are not known in all their parts");
    for (int k = 0; k < g->ground[set].reads && !r->outcome; k++) {
        gk_read_demand(r, gk_read_counted(g->ground[set].list + k, 0, m->ground[set].n - 1),
                       "ground oscillators of a gear");
        if (k && g->ground[set].list[k] <= g->ground[set].list[k - 1])
            gk_read_refuse(r, "ground oscillators of a gear", "are not sorted");
    }
}

static void read_index(gk_reader *r, gk_gear *g)
{
    g->index = gk_read_take(r, F_GEAR_index);
    g->index_most = 0.0;
    for (int k = 0; g->index && k < 2 * g->z; k++) {
        gk_read_demand(r, gk_read_between(g->index[k], -0.1 / g->z, 0.1 / g->z), "index deviations");
        g->index_most = gk_max(g->index_most, g->r_b * fabs(g->index[k]));
    }
}

static void read_nodes(gk_reader *r, gk_gear *g)
{
    const int32_t *nodes = gk_read_take(r, F_GEAR_nodes);
    for (int i = 0; nodes && i < 2; i++) {
        WITHIN(r, nodes[i], NODES, "number of nodes of a flank");
        if (!r->outcome) g->nodes[i] = nodes[i];
    }
}

static void read_lead(gk_reader *r, gk_gear *g)
{
    g->lead = gk_read_take(r, F_GEAR_lead);
    for (int k = 0; g->lead && k < 2 * LEADS; k++) WITHIN(r, g->lead[k], FLANK_DEPTH, "depth of a lead, m,");
}

static void read_flanks(gk_reader *r, gk_gear *g)
{
    gk_field_of_flanks *f = &g->flanks;
    const int32_t *size = gk_read_take(r, F_GEAR_flank_size);
    gk_read_demand(r,
                   !size || ((size[0] == 1 || size[0] == g->z) && gk_read_counted(size + 1, 1, MAX_FLANK_PLACES) &&
                             gk_read_counted(size + 2, 4, MAX_FLANK_ROLLS)),
                   "sizes of the deviations of flanks");
    for (int i = 0; i < 3; i++) r->shape.size[SYMBOL_flank_teeth + i] = size && !r->outcome ? (uint64_t)size[i] : 0;
    if (size && !r->outcome) f->teeth = size[0], f->places = size[1], f->rolls = size[2];
    f->depth = gk_read_bounded(r, F_GEAR_flank, GK_HIGH_FLANK_DEPTH);
    if (!r->outcome && !size != !f->depth) gk_read_refuse(r, "deviations of flanks", "are not whole");
    for (int k = 0; f->depth && k < 2 * f->teeth * f->places * f->rolls; k++) f->most = gk_max(f->most, -f->depth[k]);
    g->runout = gk_read_bounded(r, F_GEAR_runout, GK_HIGH_RUNOUT);
}

/* the first of a pair is followed by its second */
static int pairs_whole(const int32_t *member, int count)
{
    for (int k = 0; k < count; k++) {
        const int next = k + 1 < count ? member[k + 1] : -1, before = k ? member[k - 1] : -1;
        if (!gk_read_counted(member + k, 0, 2) || (member[k] == 1 && next != 2) || (member[k] == 2 && before != 1))
            return 0;
    }
    return 1;
}

static void read_observed(gk_reader *r, gk_model *m, gk_gear *g)
{
    gk_observed *o = &g->observed;
    o->name = gk_read_take(r, F_GEAR_observed);
    if (r->outcome || !o->name) return;
    r->shape.size[SYMBOL_own] = gk_read_count(r, F_GEAR_own_number);
    gk_read_demand(r, r->shape.size[SYMBOL_own] <= MAX_OWN && o->name[0] && strlen(o->name) < NAME_LENGTH,
                   "observed gears");
    o->from = m->amplitudes, o->own = (int)r->shape.size[SYMBOL_own];
    o->own_number = gk_read_take(r, F_GEAR_own_number), o->member = gk_read_take(r, F_GEAR_own_member);
    o->number = gk_read_take(r, F_GEAR_mode_number);
    const double *scale = gk_read_bounded(r, F_GEAR_mode_scale, 1e6);
    for (int set = 0; set < m->sets && !r->outcome; set++) {
        r->shape.set = set;
        r->shape.size[SYMBOL_reads] = (uint64_t)g->ground[set].reads;
        o->rows[set] = gk_read_bounded(r, F_GEAR_SET_own_rows, 1e6);
        if (!o->rows[set]) gk_read_refuse(r, "rows of an observed gear", "are missing");
    }
    if (!r->outcome && !(o->own_number && o->member && o->number && scale))
        gk_read_refuse(r, "numbers of an observed gear", "are missing");
    if (r->outcome) return;
    for (int k = 0; k < o->own; k++)
        gk_read_demand(r, gk_read_counted(o->own_number + k, -6, 999999), "observed gears");
    for (int k = 0; k < g->modes; k++) gk_read_demand(r, gk_read_counted(o->number + k, 1, 999999), "observed gears");
    gk_read_demand(r, pairs_whole(o->member, o->own), "pairs of observed gears");
    o->scale = *scale;
    m->amplitudes += o->own + g->modes;
}

/* what words in the dimensions of a gear's fields stand for */
static void take_sizes(gk_reader *r, const gk_model *m, const gk_gear *g)
{
    uint64_t *size = r->shape.size;
    const uint64_t places = (uint64_t)g->points * (uint64_t)m->functions, half = places * (places + 1) / 2;
    size[SYMBOL_z] = (uint64_t)g->z, size[SYMBOL_modes] = (uint64_t)g->modes;
    size[SYMBOL_points] = (uint64_t)g->points, size[SYMBOL_low] = (uint64_t)g->low;
    size[SYMBOL_flanks] = g->mirrored ? 1 : 2, size[SYMBOL_places] = places, size[SYMBOL_half] = half;
    size[SYMBOL_across] = g->mirrored ? half : places * places;
}

static void read_along(gk_reader *r, gk_gear *g)
{
    g->along_rows = gk_read_bounded_f32(r, F_GEAR_along_rows, 1e6f);
    g->along_low = gk_read_bounded_f32(r, F_GEAR_along_low, 1e6f);
    g->along_normal = gk_read_bounded_f32(r, F_GEAR_along_normal, 1e3f);
    g->along_own = gk_read_bounded_f32(r, F_GEAR_along_own, 1e3f);
    g->along_across = gk_read_bounded_f32(r, F_GEAR_along_across, 1e3f);
    const int parts = !!g->along_rows + !!g->along_low + !!g->along_normal + !!g->along_own + !!g->along_across;
    if (!r->outcome && parts % 5) gk_read_refuse(r, "displacement along the profile", "is not known in all its parts");
}

/* rows of the modes and compliance beyond them, at the points that are stored */
static void read_tables(gk_reader *r, gk_gear *g)
{
    g->resample = gk_read_bounded(r, F_GEAR_resample, 1e3);
    g->rows = gk_read_bounded_f32(r, F_GEAR_rows, 1e6f);
    g->low_rows = gk_read_bounded_f32(r, F_GEAR_low_rows, 1e6f);
    g->low_member = gk_read_take(r, F_GEAR_low_member);
    if (!r->outcome) gk_read_demand(r, pairs_whole(g->low_member, g->low), "pairs of modes of nodal diameter 0 and 1");
    g->node = gk_read_bounded_f32(r, F_GEAR_node, 1e3f), g->node_support = gk_read_bounded(r, F_GEAR_node_support, 1e3);
    g->residual_own = gk_read_bounded_f32(r, F_GEAR_residual_own, 1e3f);
    g->residual_next = gk_read_bounded_f32(r, F_GEAR_residual_next, 1e3f);
    g->residual_across = gk_read_bounded_f32(r, F_GEAR_residual_across, 1e3f);
    g->port_residual = gk_read_bounded_f32(r, F_GEAR_port_residual, 1e3f);
    read_along(r, g);
}

void gk_model_gear(gk_reader *r, gk_model *m, int i)
{
    GK_ASSERT(gk_is_gear(m, i));
    gk_gear *g = &m->gear[i];
    r->shape.gear = i;
    const int32_t *size = gk_read_take(r, F_GEAR_size);
    if (!size) return;
    WITHIN(r, size[1], TEETH, "number of teeth");
    gk_read_demand(r,
                   gk_read_counted(size, 0, m->rotors - 1) && gk_read_counted(size + 2, 0, MAX_MODES) &&
                       gk_read_counted(size + 5, 1, MAX_POINTS) && gk_read_counted(size + 6, 0, MAX_LOW) &&
                       gk_read_counted(size + 7, 0, 1),
                   "sizes of a gear");
    if (r->outcome) return;
    g->rotor = size[0], g->z = size[1], g->modes = size[2];
    g->points = size[5], g->low = size[6], g->mirrored = size[7];
    take_sizes(r, m, g);
    read_numbers(r, g);
    g->omega = gk_read_take(r, F_GEAR_omega), g->zeta = gk_read_take(r, F_GEAR_zeta);
    g->diameter = gk_read_take(r, F_GEAR_diameter), g->member = gk_read_take(r, F_GEAR_member);
    g->level_modes = gk_read_take(r, F_GEAR_level_modes);
    g->turn_rate = gk_read_bounded(r, F_GEAR_turn_rate, 1.001);
    read_tables(r, g);
    g->far_rows = gk_read_bounded_f32(r, F_GEAR_far_rows, 1e3f),
    g->far_modes = gk_read_bounded_f32(r, F_GEAR_far_modes, 1e6f);
    if (!r->outcome) check_modes(r, g);
    for (int set = 0; set < m->sets; set++) read_ground_of(r, m, g, set);
    if (!r->outcome) read_index(r, g);
    if (!r->outcome) g->smeared = gk_read_bounded(r, F_GEAR_smeared, 1e9);
    if (!r->outcome) g->smeared_tip = gk_read_bounded(r, F_GEAR_smeared_tip, 1e9);
    if (!r->outcome && !g->smeared != !g->smeared_tip) gk_read_refuse(r, "loads of width functions", "are not whole");
    if (!r->outcome) read_lead(r, g);
    if (!r->outcome) read_flanks(r, g);
    if (!r->outcome) read_observed(r, m, g);
    if (!r->outcome) read_nodes(r, g);
}
