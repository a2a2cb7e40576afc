/* Level, effects, slices and step → gk_setup: which modes are dynamic, and their rows in lanes. */
#include <stdio.h>
#include "model/gk_core.h"

/* memory is handed out twice with the same code: first counting (base NULL), then for real */
typedef struct bump {
    char *base;
    size_t used;
} bump;

static void *take(bump *b, size_t bytes)
{
    void *p = b->base ? b->base + b->used : NULL;
    b->used += (bytes + 63) / 64 * 64;
    return p;
}

static int padded(int n) { return (n + LANES - 1) / LANES * LANES; }

/* number of lanes a half needs: one a pair, one a single mode */
static int lanes_of(const gk_gear *gear, int modes)
{
    int lanes = 0;
    for (int k = 0; k < modes; k++) lanes += gear->part[k] != 2;
    return lanes;
}

static void lay_out_table(bump *b, const gk_setup *setup, const gk_gear *gear, int kinds, gk_table *table)
{
    const size_t R = (size_t)gear->rolls, A = (size_t)setup->strips, block = (A * A * (size_t)kinds + 7) / 8 * 8;
    table->ff = take(b, 4 * OFFSETS * R * R * block * sizeof(gk_real));
    table->fb = take(b, 2 * R * A * 4 * (size_t)kinds * sizeof(double));
}

static void lay_out_gear(bump *b, const gk_model *model, gk_setup *setup, int g, int modes)
{
    const gk_gear *gear = &model->gear[g];
    gk_modal *m = &setup->modal[g];
    size_t n, R = (size_t)gear->rolls, A = (size_t)setup->strips;
    m->count = modes;
    m->pairs = padded(lanes_of(gear, modes));
    m->n = 2 * m->pairs;
    n = (size_t)m->n;
    m->omega = take(b, n * sizeof(double));
    m->zeta = take(b, n * sizeof(double));
    m->omega2 = take(b, n * sizeof(gk_real));
    m->rows = take(b, 2 * R * A * n * sizeof(gk_real));
    m->bore = take(b, BORE_ROWS * n * sizeof(gk_real));
    m->cosine = take(b, (size_t)gear->z * (size_t)m->pairs * sizeof(gk_real));
    m->sine = take(b, (size_t)gear->z * (size_t)m->pairs * sizeof(gk_real));
    m->turn = take(b, 2 * (size_t)gear->z * sizeof(double));
    m->path = take(b, 2 * R * ((A * A + 3) / 4 * 4) * sizeof(double));
    lay_out_table(b, setup, gear, 1, &m->residual);
}

static void lay_out_flow(bump *b, const gk_setup *setup, gk_coefficients *k)
{
    for (int g = 0; g < 2; g++) {
        size_t bytes = (size_t)setup->modal[g].n * sizeof(gk_real);
        gk_flow *f = &k->flow[g];
        gk_real **array[] = {&f->d11, &f->a12,      &f->a21,    &f->d22,    &f->b0q,   &f->b0v,       &f->bq,
                             &f->bv,  &f->mobility, &f->read_q, &f->read_v, &f->kappa, &f->inverse_s2};
        for (size_t i = 0; i < sizeof array / sizeof *array; i++) *array[i] = take(b, bytes);
    }
}

/* everything after the setup itself; returns the bytes used */
static size_t lay_out(const gk_model *model, gk_setup *setup, char *base, const int modes[2])
{
    bump b = {base, 0};
    gk_work scratch, *work = take(&b, sizeof(gk_work));
    if (!work) work = &scratch;
    setup->work = work;
    int widest = 0;
    for (int g = 0; g < 2; g++) {
        lay_out_gear(&b, model, setup, g, modes[g]);
        size_t n = (size_t)setup->modal[g].n;
        work->qp[g] = take(&b, n * sizeof(gk_real));
        work->vp[g] = take(&b, n * sizeof(gk_real));
        work->force[g] = take(&b, n * sizeof(gk_real));
        work->zero[g] = take(&b, n * sizeof(gk_real));
        work->reading[g] = take(&b, n * sizeof(gk_real));
        for (int i = 0; i < 7; i++) work->stage[g][i] = take(&b, 2 * n * sizeof(gk_real));
        work->trial[g] = take(&b, 2 * n * sizeof(gk_real));
        work->basis[g] = take(&b, (size_t)(MAX_PAIRS * setup->strips + BORE_ROWS) * n * sizeof(gk_real));
        lay_out_table(&b, setup, &model->gear[g], KINDS, &work->table[g]);
        if (setup->modal[g].n > widest) widest = setup->modal[g].n;
    }
    work->scaled = take(&b, 2 * (size_t)widest * sizeof(gk_real));
    setup->flexibility = take(
        &b, (KINDS + MAX_FUNCTIONS) *
                (size_t)(model->gear[0].modes > model->gear[1].modes ? model->gear[0].modes : model->gear[1].modes) *
                sizeof(double));
    for (int i = 0; i < CACHE; i++) lay_out_flow(&b, setup, &work->cache[i]);
    lay_out_flow(&b, setup, &work->at_rest);
    lay_out_flow(&b, setup, &work->explicit_rows);
    return b.used;
}

static const int *all_modes(const gk_model *model, int modes[2])
{
    modes[0] = model->gear[0].modes, modes[1] = model->gear[1].modes;
    return modes;
}

size_t gk_setup_size(const gk_model *model)
{
    gk_setup probe;
    int modes[2];
    memset(&probe, 0, sizeof probe);
    probe.strips = gk_strips_count(model, MAX_SLICES);
    return 128 + sizeof(gk_setup) + lay_out(model, &probe, NULL, all_modes(model, modes));
}

size_t gk_data_size(const gk_model *model)
{
    size_t n = 0;
    for (int g = 0; g < 2; g++) n += 2 * (size_t)padded(lanes_of(&model->gear[g], model->gear[g].modes));
    return sizeof(gk_data) + 3 * n * sizeof(gk_real);
}

size_t gk_state_size(const gk_setup *setup) { return setup->state_size; }

/* number of modes below the wished cut, moved to the widest relative gap within 15 %: never inside a cluster, never
 * inside a pair */
static int modes_below(const gk_gear *gear, double cut_hz)
{
    double cut = 2.0 * GK_PI * cut_hz, widest = 0.0;
    int best = 0;
    while (best < gear->modes && gear->omega[best] < cut) best++;
    if (best == gear->modes) return best;
    for (int k = 1; k < gear->modes; k++) {
        if (gear->part[k] == 2 || gear->omega[k] < 0.85 * cut || gear->omega[k - 1] > 1.15 * cut) continue;
        double gap = gear->omega[k] / gear->omega[k - 1] - 1.0;
        if (gap > widest) widest = gap, best = k;
    }
    if (best < gear->modes && gear->part[best] == 2) best++;
    return best;
}

static int modes_at_level(const gk_model *model, gk_level level, int g)
{
    const gk_gear *gear = &model->gear[g];
    switch (level) {
    case LEVEL_RIGID: return 0;
    case LEVEL_FAST: return modes_below(gear, model->cut[0]);
    case LEVEL_STANDARD: return modes_below(gear, model->cut[1]);
    default: return gear->modes;
    }
}

/* flank rows of one mode into its lane */
static void fill_lane(const gk_gear *gear, gk_modal *m, int strips, gk_strip_weights weight, int mode, int lane)
{
    const int A = gear->functions;
    for (int point = 0; point < 2 * gear->rolls; point++)
        for (int s = 0; s < strips; s++) {
            double sum = 0.0;
            for (int a = 0; a < A; a++) sum += weight[s][a] * gear->rows[((size_t)point * A + a) * gear->modes + mode];
            m->rows[((size_t)point * strips + s) * m->n + lane] = (gk_real)sum;
        }
    for (int i = 0; i < BORE_ROWS; i++) m->bore[i * m->n + lane] = (gk_real)gear->bore[(size_t)i * gear->modes + mode];
    m->omega[lane] = gear->omega[mode];
    m->omega2[lane] = (gk_real)(gear->omega[mode] * gear->omega[mode]);
    m->zeta[lane] = gear->zeta[mode];
}

/* dynamic modes into lanes */
static void fill_modes(const gk_gear *gear, gk_modal *m, int strips, gk_strip_weights weight)
{
    const int P = m->pairs, n = m->n;
    memset(m->omega, 0, (size_t)n * sizeof(double));
    memset(m->zeta, 0, (size_t)n * sizeof(double));
    memset(m->omega2, 0, (size_t)n * sizeof(gk_real));
    memset(m->rows, 0, 2 * (size_t)gear->rolls * strips * n * sizeof(gk_real));
    memset(m->bore, 0, (size_t)BORE_ROWS * n * sizeof(gk_real));
    memset(m->cosine, 0, (size_t)gear->z * P * sizeof(gk_real));
    memset(m->sine, 0, (size_t)gear->z * P * sizeof(gk_real));
    for (int j = 0; j < gear->z; j++) gk_sincos(2.0 * GK_PI * j / gear->z, &m->turn[2 * j + 1], &m->turn[2 * j]);
    int lane = -1;
    for (int k = 0; k < m->count; k++) {
        if (gear->part[k] != 2) lane++;
        fill_lane(gear, m, strips, weight, k, gear->part[k] == 2 ? P + lane : lane);
        if (gear->part[k] == 2) continue;
        for (int j = 0; j < gear->z; j++) {
            double sine, cosine;
            gk_sincos(2.0 * GK_PI * (double)((int64_t)gear->diameter[k] * j % gear->z) / gear->z, &sine, &cosine);
            m->cosine[(size_t)j * P + lane] = (gk_real)cosine;
            m->sine[(size_t)j * P + lane] = gear->part[k] == 0 ? 0 : (gk_real)sine;
        }
    }
}

static void fill_links(const gk_model *model, gk_setup *setup)
{
    for (int g = 0; g < 2; g++) {
        const gk_gear *gear = &model->gear[g];
        const gk_port *port = &model->port[g];
        const int bearing = model->kind == KIND_PAIR && GK_ON(setup, bearings);
        for (int i = BEARING_0X + 2 * g; i <= BEARING_0Y + 2 * g; i++)
            setup->link[i] = bearing, setup->link_c[i] = 1.0 / gear->bearing_k, setup->link_d[i] = gear->bearing_c;
        setup->inverse_mass[3 * g] = bearing || model->kind == KIND_FLAT ? 1.0 / gear->mass : 0.0;
        setup->inverse_mass[3 * g + 1] = bearing ? 1.0 / gear->mass : 0.0;
        setup->inverse_mass[3 * g + 2] = model->kind == KIND_PAIR ? 1.0 / gear->inertia : 0.0;
        setup->link[PORT_0 + g] = model->kind == KIND_PAIR;
        setup->link_c[PORT_0 + g] = port->kind != PORT_TORQUE ? 1.0 / port->k : 0.0;
        setup->link_d[PORT_0 + g] = port->kind != PORT_TORQUE ? port->c : 0.0;
        setup->given_torque[g] = port->kind == PORT_TORQUE;
        setup->link[SHAFT_0 + g] = setup->link[CLUTCH_0 + g] = port->chain;
        setup->link_c[SHAFT_0 + g] = port->chain ? 1.0 / port->shaft_k : 0.0;
        setup->link_d[SHAFT_0 + g] = port->shaft_c;
        setup->link_c[CLUTCH_0 + g] = setup->link_d[CLUTCH_0 + g] = 0.0;
        setup->inverse_mass[INERTIA_0 + g] = port->chain ? 1.0 / port->inertia : 0.0;
        setup->inverse_mass[DISC_0 + g] = port->chain ? 1.0 / port->disc : 0.0;
    }
}

/* coefficients of systems in which no time passes: at rest κ = −1/ω² puts the dynamic modes into C′ too; for explicit
 * integration C′ is the massless part alone */
static void fill_timeless(gk_setup *setup)
{
    gk_coefficients *both[2] = {&setup->work->at_rest, &setup->work->explicit_rows};
    for (int c = 0; c < 2; c++) {
        gk_coefficients *k = both[c];
        k->h = 1.0, k->gamma = k->rigid_kappa = k->rigid_mobility = k->rigid_b0 = k->rigid_bq = 0.0, k->curved_read = 0,
        k->timeless = 1;
        for (int g = 0; g < 2; g++) {
            const gk_modal *m = &setup->modal[g];
            memset(setup->work->zero[g], 0, (size_t)m->n * sizeof(gk_real));
            memset(k->flow[g].mobility, 0, (size_t)m->n * sizeof(gk_real));
            for (int i = 0; i < m->n; i++) {
                k->flow[g].kappa[i] = c == 0 && m->omega[i] > 0.0 ? (gk_real)(-1.0 / (m->omega[i] * m->omega[i])) : 0;
                k->flow[g].inverse_s2[i] = 1;
            }
            k->flow[g].exact = c == 0 ? m->pairs : 0;
        }
    }
}

/* level, integrator and effects that go together; `paper` is the paper's way: truncated modes, no residual, rk45 (dg4
 * where a clutch hangs on a port) */
static gk_outcome choose(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE])
{
    const int clutch = model->port[0].chain || model->port[1].chain;
    setup->level = (gk_level)(int)data->value[V_M_LEVEL];
    setup->integrator = (gk_integrator)(int)data->value[V_M_INTEGRATOR];
    setup->on = gk_effects_of(data);
    setup->slices = (int)data->value[V_M_SLICES];
    setup->strips = gk_strips_count(model, setup->slices);
    setup->damping = data->value[V_M_DAMPING];
    if (setup->damping == 0.0) setup->on.contact_damping = 0;
    if (model->kind == KIND_PAIR)
        setup->allowance = (data->value[V_M_BACKLASH] - model->nominal_backlash) *
                           (model->gear[0].r_b + model->gear[1].r_b) / model->distance;
    if (setup->level == LEVEL_EXPLICIT && setup->integrator == DG4) setup->integrator = CENTRAL;
    if ((setup->integrator == RK45 || setup->integrator == CENTRAL) && clutch) {
        snprintf(message, GK_MESSAGE,
                 "integrators rk45 and central (level explicit) know no clutch: use dg4, or export the stage without "
                 "the chain");
        return GK_BAD_VALUE;
    }
    if (setup->level == LEVEL_PAPER) {
        setup->on.residual = 0;
        if (setup->integrator == DG4 && !clutch) setup->integrator = RK45;
        snprintf(message, GK_MESSAGE,
                 "level paper leaves the static compliance of all higher modes out: tooth stiffness is 15 to 40 %% too "
                 "high; use it for comparison only");
    } else if (!setup->on.elastic) {
        setup->on.residual = 0;
    } else if (!setup->on.residual) {
        snprintf(message, GK_MESSAGE,
                 "effect.residual = false leaves the static compliance of all higher modes out: allowed at level paper "
                 "only");
        return GK_BAD_VALUE;
    }
    return GK_OK;
}

gk_outcome gk_prepare(const gk_model *model, const gk_data *data, gk_setup *setup, char message[GK_MESSAGE])
{
    message[0] = 0;
    if (data->magic != GK_DATA_MAGIC) {
        snprintf(message, GK_MESSAGE, "gk_prepare before gk_defaults");
        return GK_BAD_CALL;
    }
    memset(setup, 0, sizeof *setup);
    gk_outcome outcome = choose(model, data, setup, message);
    if (outcome) return outcome;
    const int modes[2] = {setup->on.elastic ? modes_at_level(model, setup->level, 0) : 0,
                          setup->on.elastic ? modes_at_level(model, setup->level, 1) : 0};
    const uintptr_t base = ((uintptr_t)setup + sizeof *setup + 63) / 64 * 64;
    lay_out(model, setup, (char *)base, modes);
    setup->step = gk_wide_step(1, setup->integrator);
    gk_work *work = setup->work;
    work->clock = 0;
    for (int i = 0; i < CACHE; i++) work->cache[i].age = 0;
    memset(work->cycles, 0, sizeof work->cycles);
    setup->state_size = sizeof(gk_data);
    gk_strips_fill(model, setup);
    gk_law_bounds(model, setup);
    for (int g = 0; g < 2; g++) {
        gk_strip_weights weight;
        gk_strips_rows(model, setup, g, weight);
        fill_modes(&model->gear[g], &setup->modal[g], setup->strips, weight);
        setup->state_size += 3 * (size_t)setup->modal[g].n * sizeof(gk_real);
    }
    gk_table_residual(model, setup);
    work->table_h = work->table_gamma = work->run_h = work->run_gamma = 0.0;
    fill_links(model, setup);
    fill_timeless(setup);
    outcome = gk_limit_choose(model, setup, data->value[V_M_H], message);
    if (outcome == GK_OK) setup->magic = GK_SETUP_MAGIC;
    return outcome;
}
