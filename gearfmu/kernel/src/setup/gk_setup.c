/* The choice of level, effects and oscillators → gk_setup, but for the tables of the sides of engagements. */
#include "setup/gk_setup.h"
#include "setup/gk_kinematics.h"

/* ---- modes and ground group -------------------------------------------------------------------------------------- */
static void fill_modal(const gk_gear *gear, gk_modal *m)
{
    const int P = m->pairs, n = m->n;
    int lane = -1;
    memset(m->omega, 0, (size_t)n * sizeof(double));
    memset(m->zeta, 0, (size_t)n * sizeof(double));
    memset(m->omega2, 0, (size_t)n * sizeof(gk_real));
    memset(m->cosine, 0, (size_t)gear->z * (size_t)P * sizeof(gk_real));
    memset(m->sine, 0, (size_t)gear->z * (size_t)P * sizeof(gk_real));
    memset(m->turn_rate, 0, (size_t)P * sizeof(gk_real));
    for (int k = 0; k < m->count; k++) {
        if (gear->member[k] != 2) lane++;
        const int to = gear->member[k] == 2 ? P + lane : lane;
        m->lane[k] = to;
        m->omega[to] = gear->omega[k];
        m->omega2[to] = (gk_real)(gear->omega[k] * gear->omega[k]);
        m->zeta[to] = gear->zeta[k];
        if (gear->member[k] == 1) m->turn_rate[lane] = (gk_real)(gear->turn_rate ? gear->turn_rate[k] : 0.0);
        for (int j = 0; j < gear->z && gear->member[k] != 2; j++) {
            double sine, cosine;
            gk_sincos(2.0 * GK_PI * (double)((int64_t)gear->diameter[k] * j % gear->z) / gear->z, &sine, &cosine);
            m->cosine[(size_t)j * (size_t)P + (size_t)lane] = (gk_real)cosine;
            m->sine[(size_t)j * (size_t)P + (size_t)lane] = gear->member[k] == 0 ? 0 : (gk_real)sine;
        }
    }
}

/* pairs up to the last that Coriolis forces couple, in whole halves */
static int turning(const gk_modal *m)
{
    int last = m->pairs;
    while (last > 0 && m->turn_rate[last - 1] == 0) last--;
    return (last + LANES / 2 - 1) / (LANES / 2) * (LANES / 2);
}

/* the dynamic columns of rows over all ground oscillators */
static void select_rows(const gk_base *base, const double *rows, int count, int all, double *out)
{
    for (int i = 0; i < count; i++)
        for (int k = 0; k < base->n; k++)
            out[i * base->n + k] = base->which[k] >= 0 ? rows[i * all + base->which[k]] : 0.0;
}

/* rigid motion of a gear by the dynamic oscillators, and the part of them that it reads */
static void fill_centre(const gk_model *model, gk_base *base, int directions, int g)
{
    const gk_gear *gear = &model->gear[g];
    const int reads = gear->ground[base->set].reads;
    int from = base->n, to = 0;
    memset(base->centre[g], 0, 6 * (size_t)base->n * sizeof(double));
    for (int k = 0; k < reads; k++) {
        const int slot = base->slot[gear->ground[base->set].list[k]];
        if (slot < 0) continue;
        from = slot < from ? slot : from, to = slot >= to ? slot + 1 : to;
        for (int c = 0; c < 6; c++) base->centre[g][c * base->n + slot] = gear->ground[base->set].centre[c * reads + k];
    }
    base->from[g] = from < to ? from / 4 * 4 : 0;
    base->width[g] = from < to ? gk_padded(to) - base->from[g] : 0;
    base->motions[g] = 0;
    for (int c = 0; c < SPACE; c++) {
        const double *moved = base->centre[g] + GK_RIGID_ROW[c] * base->n + base->from[g];
        double size = 0.0;
        for (int k = 0; k < base->width[g]; k++) size += fabs(moved[k]);
        base->moved[g][c] = moved;
        if (size > 0.0 && c < directions) base->motion[g][base->motions[g]++] = c;
    }
}

static gk_span span_of(const double *row, int n)
{
    int from = n, to = 0;
    for (int k = 0; k < n; k++)
        if (row[k] != 0.0) from = k < from ? k : from, to = k + 1;
    return from < to ? (gk_span){from / 4 * 4, gk_padded(to) - from / 4 * 4} : (gk_span){0, 0};
}

static gk_span hull(gk_span a, gk_span b)
{
    if (!a.width || !b.width) return a.width ? a : b;
    const int from = a.from < b.from ? a.from : b.from;
    const int to = a.from + a.width > b.from + b.width ? a.from + a.width : b.from + b.width;
    return (gk_span){from, to - from};
}

/* of a pair of rows that turn into each other: below it speeds whirl by less than that part of the rotor's speed */
static const double IDLE_TURN = 1e-4;

/* adds a pair of rows that turn into each other with the speed of a rotor, unless they hardly move what is dynamic */
static void add_turn(gk_base *base, const double *rows, int all, int rotor)
{
    double *to = base->turn_rows + 2 * base->turns * base->n, size[2] = {0.0, 0.0};
    select_rows(base, rows, 2, all, to);
    for (int k = 0; k < base->n; k++) {
        if (!(base->omega[k] > 0.0)) to[k] = to[base->n + k] = 0.0;
        for (int i = 0; i < 2; i++) size[i] += to[i * base->n + k] * to[i * base->n + k];
    }
    if (size[0] * size[1] < IDLE_TURN * IDLE_TURN) return;
    base->turn_rotor[base->turns] = rotor;
    base->turn_span[base->turns++] = hull(span_of(to, base->n), span_of(to + base->n, base->n));
}

/* what turns with rotors: Coriolis forces on carried bodies, gyroscopic forces */
static void fill_turns(const gk_model *model, const gk_setup *setup, gk_base *base)
{
    const gk_ground *ground = &model->ground[base->set];
    base->turns = 0;
    for (int i = 0; i < model->carried && GK_ON(setup, coriolis); i++)
        add_turn(base, ground->carried_rows + 2 * i * ground->n, ground->n, model->carried_frame[i]);
    for (int i = 0; i < model->whirls && GK_ON(setup, gyroscopic); i++)
        add_turn(base, ground->whirl_rows + 2 * i * ground->n, ground->n, model->whirl[i]);
}

static int same_span(gk_span a, gk_span b) { return a.from == b.from && a.width == b.width; }

/* oscillators that many turning pairs have in common, and the dashpots that pull just these */
static void find_crowd(const gk_model *model, gk_base *base)
{
    base->crowd = (gk_span){0, 0};
    base->crowd_pairs = base->crowd_dampers = 0;
    for (int i = 0; i < base->turns; i++) {
        int count = 0;
        for (int j = 0; j < base->turns; j++) count += same_span(base->turn_span[i], base->turn_span[j]);
        if (count < LEAST_CROWD || count > MOST_CROWD || count <= base->crowd_pairs) continue;
        base->crowd = base->turn_span[i], base->crowd_pairs = count;
    }
    for (int s = 0; s < model->supports; s++) base->crowd_dampers += gk_in_crowd(base, base->damper_span[s]);
}

/* the load outward on what rotors carry */
static void fill_carried(const gk_model *model, gk_base *base)
{
    const gk_ground *ground = &model->ground[base->set];
    if (!model->carried) return;
    select_rows(base, ground->carried_rows, 2 * model->carried, ground->n, base->carried_rows);
    memset(base->outward, 0, (size_t)(model->rotors * base->n) * sizeof *base->outward);
    for (int i = 0; i < 2 * model->carried; i++)
        gk_axpy(model->carried_place[i], base->carried_rows + i * base->n,
                base->outward + model->carried_frame[i / 2] * base->n, 0, base->n / 4);
    memset(base->outward_support, 0, (size_t)(model->rotors * model->supports) * sizeof *base->outward_support);
    for (int k = 0; k < ground->n; k++)
        for (int i = 0; i < 2 * model->carried && base->slot[k] < 0; i++) {
            const double q = model->carried_place[i] * ground->carried_rows[i * ground->n + k] /
                             (ground->omega[k] * ground->omega[k]);
            double *to = base->outward_support + model->carried_frame[i / 2] * model->supports;
            for (int s = 0; s < model->supports && q != 0.0; s++)
                for (int t = 0; t < model->supports; t++)
                    to[s] += ground->kappa[s * model->supports + t] * ground->support_rows[t * ground->n + k] * q;
        }
}

/* Forces on the supports: κ times the displacement, and κ K_s⁻¹ times the force of a dashpot, which what yields in
 * series with its spring passes on to all of them. */
static void fill_supports(const gk_model *model, gk_base *base)
{
    const gk_ground *ground = &model->ground[base->set];
    const int supports = model->supports, n = base->n;
    select_rows(base, ground->damper_rows, supports, ground->n, base->damper_rows);
    for (int s = 0; s < supports; s++) {
        double *const moved = base->support_rows + s * n, *const damped = base->support_damping + s * n;
        for (int k = 0; k < n; k++) {
            moved[k] = damped[k] = 0.0;
            for (int t = 0; t < supports && base->which[k] >= 0; t++) {
                const double kappa = ground->kappa[s * supports + t];
                moved[k] += kappa * ground->support_rows[t * ground->n + base->which[k]];
                damped[k] += kappa * ground->support_compliance[t] * ground->damper[t] * base->damper_rows[t * n + k];
                for (int u = 0; ground->support_coupling && u < supports; u++)
                    damped[k] += kappa * ground->support_coupling[t * supports + u] * ground->damper[u] *
                                 base->damper_rows[u * n + k];
            }
        }
        base->support_span[s] = span_of(moved, n);
        base->support_damping_span[s] = span_of(damped, n);
        base->damper_span[s] = span_of(base->damper_rows + s * n, n);
    }
}

/* points of the housing, which stand in a set without it */
static void fill_sensors(const gk_model *model, gk_base *base)
{
    const gk_ground *ground = &model->ground[base->set];
    memset(base->sensor_rows, 0, (size_t)(model->sensors * base->n) * sizeof *base->sensor_rows);
    if (ground->sensor_rows) select_rows(base, ground->sensor_rows, model->sensors, ground->n, base->sensor_rows);
    for (int i = 0; i < model->sensors; i++) base->sensor_span[i] = span_of(base->sensor_rows + i * base->n, base->n);
}

static void fill_base(const gk_model *model, gk_setup *setup, const int32_t *which)
{
    gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    for (int k = 0; k < ground->n; k++) base->slot[k] = -1;
    for (int i = 0; i < base->n; i++) {
        base->which[i] = which[i];
        if (which[i] >= 0) base->slot[which[i]] = i, base->count++;
    }
    select_rows(base, ground->omega, 1, ground->n, base->omega);
    select_rows(base, ground->zeta, 1, ground->n, base->zeta);
    for (int i = 0; i < base->n; i++) base->omega2[i] = base->omega[i] * base->omega[i];
    select_rows(base, ground->port_rows, model->ports, ground->n, base->port_rows);
    fill_carried(model, base);
    fill_turns(model, setup, base);
    fill_supports(model, base);
    fill_sensors(model, base);
    find_crowd(model, base);
    for (int p = 0; p < model->ports; p++) base->port_span[p] = span_of(base->port_rows + p * base->n, base->n);
    for (int g = 0; g < model->gears; g++) fill_centre(model, base, gk_directions(setup), g);
}

static int meet(gk_span a, gk_span b)
{
    return a.width && b.width && a.from < b.from + b.width && b.from < a.from + a.width;
}

/* the parts of the ground group that the rows of an engagement read: its gears, and the ports among its joints */
static void fill_parts(const gk_model *model, const gk_base *base, gk_mesh *mesh)
{
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear;
        mesh->part[w] = (gk_span){base->from[g], base->width[g]};
        for (int p = 0; p < mesh->ports; p++)
            if (gk_port_of(model, g) == mesh->port[p])
                mesh->part[w] = hull(mesh->part[w], base->port_span[mesh->port[p]]);
    }
    gk_span *a = &mesh->part[0], *b = &mesh->part[1];
    mesh->joined = meet(*a, *b);
    if (mesh->joined) *a = hull(*a, *b), *b = (gk_span){0, 0};
    mesh->local = a->width + b->width;
    mesh->at[0] = base->from[mesh->side[0].gear] - a->from;
    mesh->at[1] = base->from[mesh->side[1].gear] - (b->width ? b->from - a->width : a->from);
}

static void add_joint(gk_setup *setup, int port, int which, int live, double k, double c)
{
    setup->joint[port][which] = (gk_joint){live, live && k > 0.0 ? 1.0 / k : 0.0, live ? c : 0.0};
}

/* residual of the bore angle: of the free body, less what the supports answer, plus the ground oscillators that are not
 * dynamic */
static double bore_residual(const gk_model *model, const gk_setup *setup, int p)
{
    const gk_base *base = &setup->base;
    const gk_ground *ground = &model->ground[base->set];
    const double *to = model->port_support + p * model->supports, *row = ground->port_rows + p * ground->n;
    double sum = model->port_residual[p * model->ports + p];
    if (!setup->on.residual) return 0.0;
    for (int s = 0; s < model->supports; s++)
        for (int t = 0; t < model->supports; t++) sum -= to[s] * ground->kappa[s * model->supports + t] * to[t];
    for (int k = 0; k < ground->n; k++)
        if (base->slot[k] < 0) sum += row[k] * row[k] / (ground->omega[k] * ground->omega[k]);
    return sum;
}

/* what a moment at the port does at once to the forces on the supports */
static void fill_port_support(const gk_model *model, gk_setup *setup, int p)
{
    const gk_ground *ground = &model->ground[setup->base.set];
    const double *row = ground->port_rows + p * ground->n;
    double moved[MAX_SUPPORTS];
    for (int s = 0; s < model->supports; s++) {
        moved[s] = setup->on.residual ? model->port_support[p * model->supports + s] : 0.0;
        for (int k = 0; k < ground->n && setup->on.residual; k++)
            if (setup->base.slot[k] < 0)
                moved[s] += ground->support_rows[s * ground->n + k] * row[k] / (ground->omega[k] * ground->omega[k]);
    }
    for (int s = 0; s < model->supports; s++) {
        setup->port_support[p][s] = 0.0;
        for (int t = 0; t < model->supports; t++)
            setup->port_support[p][s] += ground->kappa[s * model->supports + t] * moved[t];
    }
}

static void fill_ports(const gk_model *model, gk_setup *setup)
{
    setup->spins = model->rotors + 2 * model->chains;
    for (int r = 0; r < model->rotors; r++)
        setup->inverse_inertia[r] = model->inertia[r] > 0.0 ? 1.0 / model->inertia[r] : 0.0;
    for (int p = 0; p < model->ports; p++) {
        const gk_port *port = &model->port[p];
        const int torque = port->kind == PORT_TORQUE;
        setup->chained[p] = port->chain > 0;
        setup->given_torque[p] = torque;
        add_joint(setup, p, JOINT_PORT, 1, torque ? 0.0 : port->k, torque ? 0.0 : port->c);
        add_joint(setup, p, JOINT_SHAFT, port->chain > 0, port->shaft_k, port->shaft_c);
        add_joint(setup, p, JOINT_CLUTCH, port->chain > 0, 0.0, 0.0);
        setup->clutches += port->chain > 0;
        setup->port_own[p] = bore_residual(model, setup, p);
        fill_port_support(model, setup, p);
        if (!port->chain) continue;
        setup->inverse_inertia[gk_inertia_of(model, p)] = 1.0 / port->inertia;
        setup->inverse_inertia[gk_disc_of(model, p)] = 1.0 / port->disc;
    }
}

/* ports of the rotors that this engagement is the first to engage, and the spins that its rows read */
static void fill_spins(const gk_model *model, gk_mesh *mesh)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    mesh->spins = 2;
    for (int w = 0; w < 2; w++) mesh->spin[w] = model->gear[e->gear[w]].rotor;
    mesh->frame = gk_frame_of(model, e);
    if (mesh->frame >= 0) mesh->spin[mesh->spins++] = mesh->frame;
    for (int p = 0; p < model->ports; p++) {
        int first = -1;
        for (int i = 0; i < model->engagements && first < 0; i++)
            for (int w = 0; w < 2; w++)
                if (gk_port_of(model, model->engagement[i].gear[w]) == p) first = i;
        if (first != mesh->index || mesh->ports == 2) continue;
        const int slot = mesh->ports++;
        mesh->port[slot] = p;
        mesh->joint_spin[slot][0] = mesh->joint_spin[slot][1] = -1;
        if (!model->port[p].chain) continue;
        mesh->joint_spin[slot][0] = mesh->spins, mesh->spin[mesh->spins++] = gk_inertia_of(model, p);
        mesh->joint_spin[slot][1] = mesh->spins, mesh->spin[mesh->spins++] = gk_disc_of(model, p);
    }
}

static void fill_mesh(const gk_model *model, gk_setup *setup, const gk_data *data, int e)
{
    gk_mesh *mesh = &setup->mesh[e];
    const gk_engagement *engagement = &model->engagement[e];
    const double *a = engagement->position[0], *b = engagement->position[1];
    mesh->distance = sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
    fill_spins(model, mesh);
    fill_parts(model, &setup->base, mesh);
    mesh->damping = GK_OF(data, mesh)[e][V_DAMPING];
    if (engagement->kind != MESH_FLAT)
        mesh->allowance = (GK_OF(data, mesh)[e][V_BACKLASH] - engagement->nominal_backlash) *
                          gk_base_reach(model, engagement) / mesh->distance;
    gk_strips_fill(model, setup, mesh);
    if (GK_ON(setup, friction) || GK_ON(setup, film)) gk_lubrication_fill(model, data, mesh);
    if (setup->nodal) gk_nodal_fill(model, setup, data, mesh);
}

/* coefficients of problems in which no time passes: C′ is the quasi-static part alone */
static void fill_explicit(const gk_model *model, const gk_setup *setup, gk_room *room)
{
    gk_coefficients *k = &room->explicit_rows;
    const size_t ground = (size_t)setup->base.n * sizeof(double);
    k->h = 1.0, k->gamma = k->rigid_kappa = k->rigid_lead = k->rigid_mobility = 0.0;
    k->timeless = 1;
    for (int g = 0; g < model->gears; g++) {
        const size_t size = (size_t)setup->modal[g].n * sizeof(gk_real);
        memset(k->flow[g].mobility, 0, size);
        memset(k->flow[g].kappa, 0, size);
        for (int i = 0; i < setup->modal[g].n; i++) k->flow[g].inverse_s2[i] = k->flow[g].unit[i] = 1;
        memset(k->flow[g].lead, 0, size);
        memset(k->flow[g].hold, 0, size);
        memset(room->zero, 0, size);
        k->flow[g].yields = k->flow[g].softest = 0;
    }
    memset(k->ground.mobility, 0, ground);
    memset(k->ground.kappa, 0, ground);
    memset(k->ground.lead, 0, ground);
    memset(k->ground.hold, 0, ground);
    for (int i = 0; i < setup->base.n; i++) k->ground.inverse_s2[i] = k->ground.unit[i] = 1.0;
    memset(room->ground_zero, 0, ground);
}

void gk_setup_fill(const gk_model *model, gk_setup *setup, gk_room *room, const gk_data *data, const int32_t *which)
{
    GK_ASSERT(model && setup && room && data && which);
    int coasts[MAX_ENGAGEMENTS];
    for (int g = 0; g < model->gears; g++) {
        fill_modal(&model->gear[g], &setup->modal[g]);
        if (GK_ON(setup, gyroscopic)) setup->modal[g].turns = turning(&setup->modal[g]);
    }
    fill_base(model, setup, which);
    fill_ports(model, setup);
    gk_kinematics_carrying(model, coasts);
    for (int e = 0; e < model->engagements; e++) {
        fill_mesh(model, setup, data, e);
        setup->mesh[e].coasts = coasts[e];
    }
    for (int g = 0; g < model->gears; g++) gk_spread_rows(model, setup, g);
    for (int g = 0; g < model->gears && setup->nodal; g++) gk_nodal_rows(model, setup, g);
    for (int g = 0; g < model->gears; g++) gk_far_fill(model, setup, g);
    fill_explicit(model, setup, room);
}
