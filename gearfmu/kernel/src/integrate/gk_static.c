/* Static equilibrium by the same contact routine as the step (docs/theory.md, 4): proximal points. Every rigid
 * coordinate may move by mobility × force (an implicit "step" of a viscous body), everything elastic is compliance;
 * repeated until nothing moves. The mobility is large against all compliances, so a few rounds suffice; each round is a
 * monotone complementarity problem. */
#include "model/gk_core.h"

static const double MOBILITY = 1e-4; /* s²: divided by the mass of a coordinate, m/N */
static const double SEE = 3e-3;      /* m: look this far for flanks */
static const double AT_REST = 1e-11; /* m: movement at MOBILITY that counts as none: some 1e-8 N are left … */
static const double ROUNDING =
    2e-7; /* … and what single precision of the rows leaves undecided of the deepest deflection */
enum { REST_ROUNDS = 150 };

static int grounded(const gk_boundary *b) { return b->kind != PORT_TORQUE; }

/* where to begin: the grounded side decides, the other follows without load */
static void begin(const gk_model *model, gk_data *data, const gk_boundary b[2])
{
    const double ratio = model->gear[0].r_b / model->gear[1].r_b;
    memset(data->x, 0, sizeof data->x);
    if (model->kind == KIND_FLAT) return;
    data->x[PHIA] = grounded(&b[0]) ? b[0].phi : grounded(&b[1]) ? -b[1].phi / ratio : 0.0;
    data->x[PHIB] = -data->x[PHIA] * ratio;
    for (int g = 0; g < 2; g++) {
        data->x[INERTIA_0 + g] = b[g].phi;
        data->x[DISC_0 + g] = data->x[3 * g + 2];
    }
}

static int floats(const gk_model *model, const gk_setup *setup, const gk_boundary b[2])
{
    if (model->kind == KIND_FLAT) return 0;
    for (int g = 0; g < 2; g++)
        if (grounded(&b[g]) && !(model->port[g].chain && !setup->link[CLUTCH_0 + g])) return 0;
    return 1;
}

/* when nothing holds the rotation of the train: take the net force along it (given torques and, after a first solution,
 * that of all rows) as inertial forces of a uniform acceleration */
static void balance_rotation(const gk_model *model, const gk_setup *setup, const gk_boundary b[2], double *given)
{
    const gk_system *s = &setup->work->system;
    const double turn[2] = {1.0, -model->gear[0].r_b / model->gear[1].r_b};
    double net = 0.0, inertia = 0.0;
    if (!floats(model, setup, b)) return;
    for (int g = 0; g < 2; g++) {
        const int coordinate[2] = {3 * g + 2, DISC_0 + g};
        for (int c = 0; c <= model->port[g].chain; c++) {
            double force = given[coordinate[c]] + (s->n == 0 && c == 0 && !model->port[g].chain ? b[g].torque : 0.0);
            for (int i = 0; i < s->n; i++) force += s->rigid[coordinate[c]][i] * s->z[i];
            net += turn[g] * force;
            inertia += turn[g] * turn[g] / setup->inverse_mass[coordinate[c]];
        }
    }
    for (int g = 0; g < 2; g++) {
        given[3 * g + 2] -= turn[g] * net / (inertia * setup->inverse_mass[3 * g + 2]);
        if (model->port[g].chain) given[DISC_0 + g] -= turn[g] * net / (inertia * setup->inverse_mass[DISC_0 + g]);
    }
}

/* a train that nothing holds stays where it is: take its common rotation out of the last move; returns what it moved
 * else */
static double unroll(const gk_model *model, const gk_setup *setup, const gk_boundary b[2], const double *before,
                     double *x, double moved)
{
    const double ratio = model->gear[0].r_b / model->gear[1].r_b;
    const int coordinate[4] = {PHIA, DISC_0, PHIB, DISC_1};
    double momentum = 0.0, inertia = 0.0;
    if (!floats(model, setup, b) || !gk_finite(moved)) return moved;
    for (int c = 0; c < 4; c++) {
        const double turn = c < 2 ? 1.0 : -ratio, mobile = setup->inverse_mass[coordinate[c]];
        if (mobile > 0.0)
            momentum += turn * (x[coordinate[c]] - before[coordinate[c]]) / mobile, inertia += turn * turn / mobile;
    }
    moved = 0.0;
    for (int c = 0; c < 4; c++)
        if (setup->inverse_mass[coordinate[c]] > 0.0) x[coordinate[c]] -= (c < 2 ? 1.0 : -ratio) * momentum / inertia;
    for (int d = 0; d < RIGID; d++)
        moved = gk_max(moved,
                       fabs(x[d] - before[d]) * (d == XA || d == YA || d == XB || d == YB ? 1.0 : model->gear[0].r_b));
    return moved;
}

static double relax(const gk_model *model, const gk_setup *rest, gk_data *data, const double *given)
{
    gk_work *work = rest->work;
    gk_system *s = &work->system;
    double moved = 0.0;
    for (int d = 0; d < RIGID; d++) {
        work->frame[d] = data->x[d] + work->at_rest.rigid_mobility * rest->inverse_mass[d] * given[d];
        work->speed[d] = 2.0 * work->frame[d]; /* a sticking clutch keeps its angle: velocity row with h = 1 */
    }
    work->y[0] = work->zero[0], work->y[1] = work->zero[1];
    work->places = gk_flank_find(model, rest, data->x, SEE, work->place);
    if (work->places < 0) return work->places = 0, NAN;
    for (int p = 0; p < work->places; p++) {
        for (int d = 0; d < 6; d++)
            work->place[p].gap += work->place[p].gradient[d] *
                                  (work->frame[d] - data->x[d]); /* given forces move the frame, not the place */
        work->place[p].memory = -1;
        for (int m = 0; m < data->pairs; m++)
            if (data->memory[m].key.flank == work->place[p].key.flank &&
                data->memory[m].key.tooth == work->place[p].key.tooth)
                work->place[p].memory = m;
    }
    gk_rows_form(model, rest, data->x, work);
    gk_system_form(model, rest, data, &work->at_rest, work);
    gk_step_recall(rest, data, s);
    gk_solve_plain(s);
    for (int d = 0; d < RIGID; d++) {
        double z = 0.0;
        for (int i = 0; i < s->n; i++) z += s->rigid[d][i] * s->z[i];
        const double x = work->frame[d] + work->at_rest.rigid_mobility * rest->inverse_mass[d] * z;
        const double arm = d == XA || d == YA || d == XB || d == YB     ? 1.0
                           : d == PHIB || d == INERTIA_1 || d == DISC_1 ? model->gear[1].r_b
                                                                        : model->gear[0].r_b;
        moved = gk_max(moved, fabs(x - data->x[d]) * arm);
        if (!gk_finite(x)) return NAN;
        data->x[d] = x;
    }
    gk_step_remember(rest, data);
    return s->limit_reached ? gk_max(moved, 1.0) : moved;
}

/* movement at MOBILITY below which the solution cannot be told from rest */
static double rest_limit(const gk_work *work)
{
    double deepest = 0.0;
    for (int p = 0; p < work->places; p++) deepest = gk_max(deepest, -work->place[p].gap);
    return AT_REST + ROUNDING * deepest;
}

/* modes take the static share of the forces that hold the equilibrium */
static void spread(const gk_setup *setup, gk_data *data)
{
    const gk_system *s = &setup->work->system;
    gk_real *q = data->modal;
    data->state_h = data->state_gamma = 0.0;
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        if (n) gk_step_scatter(setup, g, s->force, s->force, q + 2 * n, setup->work->reading[g]);
        for (int i = 0; i < n; i++) {
            q[i] = setup->modal[g].omega2[i] > 0 ? q[2 * n + i] / setup->modal[g].omega2[i] : 0;
            q[n + i] = 0;
        }
        q += 3 * n;
    }
    for (int d = 0; d < RIGID; d++) {
        data->f[d] = 0.0;
        for (int i = 0; i < s->n; i++)
            if (s->kind[i] != ROW_CLUTCH) data->f[d] += s->rigid[d][i] * s->force[i];
    }
}

/* Equilibrium under the given boundary: for each shaft a spring of stiffness k at angle phi, a held angle (PORT_FIXED,
 * k = ∞: the bore is held) or a torque. `keep`: start from data->x instead of from the unloaded mesh. */
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_data *data, const gk_boundary b[2],
                           int keep)
{
    gk_setup rest = *setup;
    gk_work *work = setup->work;
    double given[RIGID] = {0};
    rest.on.contact_damping = 0;
    rest.on.roll_motion = 1;
    for (int g = 0; g < 2; g++) {
        rest.given_torque[g] = !grounded(&b[g]);
        rest.link_c[PORT_0 + g] = b[g].kind == PORT_SPRING ? 1.0 / b[g].k : 0.0;
        work->outer[g] = b[g].phi;
        work->torque[g] = b[g].torque;
        if (model->port[g].chain && !data->locked[g]) { /* slips at the start: a given friction torque */
            const double slip = data->v[INERTIA_0 + g] - data->v[DISC_0 + g],
                         friction = data->value[GK_OF_SHAFT(CAPACITY, g)] * (slip > 0.0   ? 1.0
                                                                             : slip < 0.0 ? -1.0
                                                                                          : 0.0);
            rest.link[CLUTCH_0 + g] = 0;
            given[INERTIA_0 + g] = -friction;
            given[DISC_0 + g] = friction;
        }
        for (int i = 0; i < LINKS; i++) rest.link_d[i] = 0.0;
    }
    if (!keep) begin(model, data, b);
    if (!keep) data->pairs = 0;
    work->system.n = 0; /* nothing solved yet */
    balance_rotation(model, &rest, b, given);
    /* where the linearised gaps lead in circles, once more with smaller moves */
    for (double mobility = MOBILITY; mobility > 1e-4 * MOBILITY; mobility *= 0.01) {
        work->at_rest.rigid_mobility = mobility;
        double moved = INFINITY;
        for (int round = 0; round < REST_ROUNDS && moved > 1e-14; round++) {
            double before[RIGID];
            memcpy(before, data->x, sizeof before);
            moved = unroll(model, &rest, b, before, data->x, relax(model, &rest, data, given));
            balance_rotation(model, &rest, b, given);
        }
        if (moved * (MOBILITY / mobility) <= rest_limit(work)) {
            spread(&rest, data);
            memcpy(data->still, data->x, sizeof data->still);
            return GK_OK;
        }
        if (!gk_finite(moved)) break;
    }
    return GK_NO_EQUILIBRIUM;
}

/* Quasi-static transmission (eq. 13): torque on the pinion's bore, the wheel's bore held at phi_wheel. out: te (m),
 * then for every place {flank, tooth of the pinion, force of each slice}; room for 1 + MAX_PAIRS·(2 + MAX_SLICES)
 * numbers. `keep` continues from the last call. */
gk_outcome gk_te(const gk_model *model, const gk_setup *setup, gk_data *data, double phi_wheel, double torque, int keep,
                 double *out, int *places)
{
    const gk_boundary b[2] = {{PORT_TORQUE, torque, 0.0, 0.0}, {PORT_FIXED, 0.0, phi_wheel, 0.0}};
    gk_outcome outcome = gk_static_solve(model, setup, data, b, keep);
    if (outcome) return outcome;
    const gk_system *s = &setup->work->system;
    double phi_pinion = 0.0;
    for (int i = s->contacts; i < s->n; i++)
        if (s->link_of[i] == PORT_0) phi_pinion = gk_solve_end_gap(s, i) + gk_solve_massless(s, i);
    *out++ = model->gear[0].r_b * phi_pinion + model->gear[1].r_b * phi_wheel;
    *places = setup->work->places;
    for (int p = 0; p < *places; p++, out += 2 + setup->slices) {
        out[0] = setup->work->place[p].key.flank;
        out[1] = setup->work->place[p].key.tooth;
        for (int i = 0; i < setup->slices; i++) {
            const int strip = i < s->strips ? i : setup->slices - 1 - i;
            out[2 + i] = s->force[p * s->strips + strip] * setup->width / (setup->slices * setup->strip_width[strip]);
        }
    }
    return GK_OK;
}
