/* Which teeth of a gear may touch those of its partner in an engagement, which sides are twins, and what the making of
 * their tables takes. */
#include "setup/gk_residual.h"
#include "setup/gk_tables.h"

static const double MARGIN = 0.15, CORNER = 0.5; /* base pitches beyond the ends of the flanks: play; tip corners */

/* ---- which teeth ------------------------------------------------------------------------------------------------- */
/* lengths of roll of this side between which the other side has a flank, corners included */
static void span(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int which, double ends[2])
{
    const gk_gear *own = &model->gear[e->gear[which]], *other = &model->gear[e->gear[1 - which]];
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    const double R = gk_base_reach(model, e), L = sqrt(x * x + y * y - R * R);
    const double pitch = own->r_b * 2.0 * GK_PI / own->z, beyond = (setup->on.tip_contact ? CORNER : 0.0) + MARGIN;
    const double lean = 0.5 * e->width *
                        fabs(gk_node_tan(own->helix)); /* the ends of the face width are ahead and behind */
    if (e->kind == MESH_EXTERNAL) {
        ends[0] = L - other->s_tip, ends[1] = own->s_tip;
    } else if (which == 0) { /* the planet in the ring: s_B = L + s_A */
        ends[0] = other->s_tip - L, ends[1] = own->s_tip;
    } else {
        ends[0] = own->s_tip, ends[1] = L + other->s_tip;
    }
    ends[0] -= beyond * pitch + lean, ends[1] += beyond * pitch + lean;
}

void gk_side_plan(const gk_model *model, const gk_setup *setup, int index, gk_side *side, int which)
{
    GK_ASSERT(gk_is_engagement(model, index));
    GK_ASSERT(which == 0 || which == 1);
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
            const double begin = gk_node_roll(side, flank, 0.0, offset), end = gk_node_roll(side, flank, 1.0, offset);
            if (gk_max(begin, end) < ends[0] || gk_min(begin, end) > ends[1]) continue;
            if (!side->count[flank]) side->first[flank] = offset;
            side->count[flank]++, side->candidates++;
        }
    }
}

/* ---- twins ------------------------------------------------------------------------------------------------------- */
static int same_body(const gk_model *model, const gk_engagement *a, const gk_engagement *b, int w)
{
    return gk_spread_leader(model, a->gear[w]) == gk_spread_leader(model, b->gear[w]);
}

static double squared_distance(const gk_engagement *e)
{
    const double x = e->position[1][0] - e->position[0][0], y = e->position[1][1] - e->position[0][1];
    return x * x + y * y;
}

/* all that places of points and rows of bodies follow from, to the last bit */
int gk_side_twins(const gk_model *model, int e, int f)
{
    GK_ASSERT(gk_is_engagement(model, e) && gk_is_engagement(model, f));
    const gk_engagement *a = &model->engagement[e], *b = &model->engagement[f];
    return a->kind == b->kind && a->width == b->width && squared_distance(a) == squared_distance(b) &&
           same_body(model, a, b, 0) && same_body(model, a, b, 1);
}

/* ---- scratch ----------------------------------------------------------------------------------------------------- */
static size_t most_points(const gk_model *model) { return MAX_CANDIDATES * (size_t)gk_strips_count(model, MAX_SLICES); }

/* doubles that a maker takes, and those of what a step has in hand (gk_moves.c) */
size_t gk_side_scratch(const gk_model *model)
{
    size_t most = 0, ground = 0;
    for (int s = 0; s < model->sets; s++)
        if ((size_t)model->ground[s].n > ground) ground = (size_t)model->ground[s].n;
    ground = (size_t)gk_padded((int)ground) + 4 * (MAX_ROTORS + 1);
    for (int g = 0; g < model->gears; g++) {
        const gk_gear *gear = &model->gear[g];
        const size_t points = most_points(model), held = (size_t)gk_padded(model->supports + 1);
        const size_t of_side = gk_node_size(model, gear) + gk_residual_size(model, gear, points) + points * held +
                               2 * (size_t)model->engagements * gk_grounded_room(model, gear, (int)ground);
        const size_t of_step = gk_moves_scratch(points, (size_t)gear->modes + LANES, ground);
        if (of_side > most) most = of_side;
        if (of_step > most) most = of_step;
    }
    return most;
}
