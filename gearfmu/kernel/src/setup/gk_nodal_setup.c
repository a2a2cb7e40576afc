/* Nodes of the flanks for nodal contact: even in arc length along the flank and even across the common face width, as
 * those of a structured mesh. The area that a node stands for follows from the trapezoidal rule in both directions, so
 * that all areas together are that of the flank (docs/theory.md, 2.7). */
#include "setup/gk_setup.h"

/* (2a + 1) P_a at x, −1 … 1, for the width functions of the model: displacement there is their sum with the rows, and a
 * force there loads the rows by them */
static void functions_at(const gk_model *model, double x, double *out)
{
    for (int a = 0; a < model->functions; a++) {
        double before = 0.0, now = 1.0;
        for (int k = 0; k < model->degree[a]; k++) {
            const double next = ((2.0 * k + 1.0) * x * now - k * before) / (k + 1.0);
            before = now, now = next;
        }
        out[a] = (2.0 * model->degree[a] + 1.0) * now;
    }
}

/* weight of entry i of n even ones in the trapezoidal rule */
static double share_of(int i, int n) { return (i == 0 || i == n - 1 ? 0.5 : 1.0) / (n - 1); }

static void fill_along(const gk_gear *gear, gk_nodes *nodes)
{
    const double from = gear->s_form * gear->s_form, to = gear->s_tip * gear->s_tip;
    nodes->along = gear->nodes[0];
    for (int i = 0; i < nodes->along; i++) {
        const double s = sqrt(from + (to - from) * i / (nodes->along - 1));
        double sine, cosine;
        gk_sincos(s / gear->r_b, &sine, &cosine);
        nodes->roll[i] = s;
        nodes->x[i] = gear->r_b * cosine + s * sine;
        nodes->y[i] = s * cosine - gear->r_b * sine;
        nodes->length[i] = fabs(to - from) / (2.0 * gear->r_b) * share_of(i, nodes->along);
        nodes->grid[i] = gk_grid_points(gear, s);
    }
}

/* the strip that a place across the width belongs to; strips of mirrored halves are those of negative z */
static int strip_at(const gk_setup *setup, double share, int mirrored)
{
    const double at = (mirrored && share > 0.5 ? 1.0 - share : share) * setup->slices;
    return (int)gk_clamp(at, 0.0, setup->strips - 1);
}

static void fill_across(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int count,
                        gk_nodes *nodes)
{
    const int mirrored = gk_strips_mirrored(model), A = model->functions;
    nodes->across = 0;
    for (int i = mirrored ? count / 2 : 0; i < count; i++) {
        const int j = nodes->across++, twice = mirrored && 2 * i + 1 != count;
        const double share = (double)i / (count - 1);
        nodes->z[j] = e->width * (share - 0.5);
        nodes->width[j] = e->width * share_of(i, count) * (twice ? 2.0 : 1.0);
        nodes->strip[j] = strip_at(setup, share, mirrored);
        nodes->lead[j] = nodes->lead[count + j] = 0.0;
        for (int w = 0; w < 2; w++) {
            const gk_gear *gear = &model->gear[e->gear[w]];
            const double x = 2.0 * nodes->z[j] / gear->width;
            functions_at(model, x, nodes->functions[w] + j * A);
            for (int flank = 0; flank < 2 && GK_ON(setup, flank_deviations); flank++)
                nodes->lead[flank * count + j] += gk_strips_lead(gear, flank, x);
        }
    }
}

/* what the flanks of both gears are beside involutes, at the places across */
static void fill_deviations(const gk_model *model, const gk_setup *setup, const gk_engagement *e, gk_nodes *nodes)
{
    double x[MAX_NODES];
    for (int w = 0; w < 2; w++) {
        const gk_gear *gear = &model->gear[e->gear[w]];
        for (int j = 0; j < nodes->across; j++) x[j] = 2.0 * nodes->z[j] / gear->width;
        gk_deviation_fill(setup, gear, nodes->across, x, x, &nodes->deviation[w]);
    }
}

/* 1/ρA + 1/ρB in the normal section at the pitch point */
static double pitch_curvature(const gk_model *model, const gk_mesh *mesh)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    const double R = gk_base_reach(model, e), L = sqrt(mesh->distance * mesh->distance - R * R);
    const double a = L * model->gear[e->gear[0]].r_b / R, b = L * model->gear[e->gear[1]].r_b / R;
    return mesh->cosine * (1.0 / a + e->kind / b);
}

/* dδ/df (m²/N) of the line of contact at the load of force_max on one tooth pair, f = 4/3 k √(2R) δ^(3/2) per metre. A
 * flat engagement is as stiff as all its nodes. */
static double line_compliance(const gk_model *model, const gk_mesh *mesh, double penalty)
{
    const gk_engagement *e = &model->engagement[mesh->index];
    if (e->kind == MESH_FLAT) {
        double length = 0.0;
        for (int i = 0; i < mesh->nodes[0].along; i++) length += mesh->nodes[0].length[i];
        return 1.0 / (penalty * length);
    }
    const double load = e->force_max * mesh->cosine / e->width, R = 1.0 / pitch_curvature(model, mesh);
    const double depth = gk_exp(2.0 / 3.0 * gk_log(0.75 * load / (penalty * sqrt(2.0 * R))));
    return depth / (1.5 * load);
}

/* ---- rows at points ---------------------------------------------------------------------------------------------- */
/* Weights of the model's rolls for the displacement at a point of the flank, at the arc length p from its form circle.
 * Rows are means over the load strip, p ± w, clipped at the ends of the flank: the value at a point is that of the
 * strip whose middle it is; within w/2 of an end, where there is none, it goes on straight. */
static gk_grid weights_at(const gk_model *model, const gk_gear *gear, double p, double length)
{
    const double outward = gear->s_tip > gear->s_form ? 1.0 : -1.0, w = gk_min(gear->strip, 0.5 * length);
    const double strip = p < w ? 2.0 * p - w : p > length - w ? 2.0 * p - (length - w) : p;
    const double inside = gk_clamp(strip, 0.0, length);
    const double s = sqrt(gear->s_form * gear->s_form + outward * 2.0 * gear->r_b * inside);
    gk_grid grid = gk_grid_at(model, gear, s);
    const double beyond = outward * gear->r_b / gk_max(s, 1e-9) * (strip - inside);
    for (int i = 0; i < 4; i++) grid.weight[i] += beyond * grid.slope[i];
    return grid;
}

/* Σ weight row[roll] of entry k of a table (rolls, functions, width), at one function */
static double blended(const gk_grid *grid, const gk_real *table, int functions, int width, int a, int k)
{
    double sum = 0.0;
    for (int i = 0; i < 4; i++) sum += grid->weight[i] * table[(size_t)((grid->index + i) * functions + a) * width + k];
    return sum;
}

/* part c0, c_c or c_s of a row of modes of nodal diameter 0 and 1 (ground_part.py, turn_tables), from that
 * on tooth 0 */
static double low_part(const gk_gear *gear, const double *row, int part, int k)
{
    const int member = gear->low_member[k];
    if (part < 2) return (member == 0) == (part == 0) ? row[k] : 0.0;
    return member == 1 ? -row[k + 1] : member == 2 ? row[k - 1] : 0.0;
}

/* Σ over the modes of nodal diameter 0 and 1 and the node, of one part of a row by ground oscillator k */
static double ground_part(const gk_gear *gear, int set, const double *low, const double node[3][6], int part, int k)
{
    const int reads = gear->ground[set].reads;
    double sum = 0.0;
    for (int i = 0; i < gear->low; i++)
        sum += low_part(gear, low, part, i) * gear->ground[set].low[(size_t)i * (size_t)reads + (size_t)k];
    for (int i = 0; i < 6; i++) sum += node[part][i] * gear->ground[set].node[i * reads + k];
    return sum;
}

/* a point of a flank and one width function: cell of the tables */
typedef struct cell {
    int gear, flank, function;
    size_t number;
    gk_grid grid;
} cell;

static void fill_modes(const gk_model *model, gk_setup *setup, const cell *c)
{
    const gk_gear *gear = &model->gear[c->gear];
    const gk_modal *m = &setup->modal[c->gear];
    const size_t cells = (size_t)(model->rolls * model->functions);
    const gk_real *rows = setup->flank[c->gear].rows + (size_t)c->flank * cells * (size_t)gear->modes;
    gk_real *modes = setup->point_rows[c->gear].modes + c->number * (size_t)m->n;
    memset(modes, 0, (size_t)m->n * sizeof *modes);
    for (int k = 0; k < m->count; k++)
        modes[m->lane[k]] = (gk_real)blended(&c->grid, rows, model->functions, gear->modes, c->function, k);
}

static void fill_ground(const gk_model *model, gk_setup *setup, const cell *c)
{
    const gk_gear *gear = &model->gear[c->gear];
    const gk_base *base = &setup->base;
    const gk_flank_tables *from = &setup->flank[c->gear];
    const int A = model->functions, reads = setup->on.elastic ? gear->ground[base->set].reads : 0;
    const size_t cells = (size_t)(model->rolls * A), width = (size_t)base->width[c->gear];
    const gk_real *rows = from->low + (size_t)c->flank * cells * (size_t)gear->low;
    const int32_t *list = gear->ground[base->set].list;
    double low[MAX_LOW], node[3][6];
    for (int k = 0; k < gear->low; k++) low[k] = blended(&c->grid, rows, A, gear->low, c->function, k);
    for (int part = 0; part < 3; part++)
        for (int k = 0; k < 6; k++)
            node[part][k] = blended(&c->grid, from->node + (size_t)(2 * part + c->flank) * cells * 6, A, 6, c->function,
                                    k);
    for (int part = 0; part < 3; part++) {
        gk_real *ground = setup->point_rows[c->gear].ground + ((size_t)(2 * part * POINTS * A) + c->number) * width;
        memset(ground, 0, width * sizeof *ground);
        for (int k = 0; k < reads; k++)
            if (base->slot[list[k]] >= 0)
                ground[base->slot[list[k]] - base->from[c->gear]] = (gk_real)ground_part(gear, base->set, low, node,
                                                                                         part, k);
    }
}

void gk_nodal_rows(const gk_model *model, gk_setup *setup, int g)
{
    GK_ASSERT(gk_is_gear(model, g) && setup->nodal);
    const gk_gear *gear = &model->gear[g];
    const double length = fabs(gear->s_tip * gear->s_tip - gear->s_form * gear->s_form) / (2.0 * gear->r_b);
    for (int point = 0; point < POINTS && gear->nodes[0]; point++) {
        cell c = {.gear = g, .grid = weights_at(model, gear, length * point / (POINTS - 1), length)};
        for (c.flank = 0; c.flank < 2; c.flank++)
            for (c.function = 0; c.function < model->functions; c.function++) {
                c.number = (size_t)((c.flank * POINTS + point) * model->functions + c.function);
                fill_modes(model, setup, &c);
                fill_ground(model, setup, &c);
            }
    }
}

/* ---- an engagement ----------------------------------------------------------------------------------------------- */
void gk_nodal_fill(const gk_model *model, const gk_setup *setup, const gk_data *data, gk_mesh *mesh)
{
    GK_ASSERT(gk_is_engagement(model, mesh->index) && setup->nodal);
    const gk_engagement *e = &model->engagement[mesh->index];
    const double penalty = GK_OF(data, mesh)[mesh->index][V_PENALTY];
    for (int w = 0; w < 2; w++) {
        const gk_gear *gear = &model->gear[e->gear[w]];
        fill_along(gear, &mesh->nodes[w]);
        fill_across(model, setup, e, gear->nodes[1], &mesh->nodes[w]);
        fill_deviations(model, setup, e, &mesh->nodes[w]);
        mesh->penalty[w] = penalty * (w ? 1.0 - e->nodes_of_a : e->nodes_of_a);
    }
    mesh->compliance = line_compliance(model, mesh, penalty);
    mesh->retardation = mesh->damping * mesh->compliance; /* with it that line has the damping per metre of the stage */
}
