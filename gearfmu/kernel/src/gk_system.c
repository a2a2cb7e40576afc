/* The small system of a step (docs/theory.md, eq. 10): which forces are unknown, what they do to the gaps within the step (D) and at once through what is massless (C′), and the gaps without them.
 * Rows: slices of all places, then the live bilateral rows (bearings, port springs, shafts, clutches). Contact forces press inward, rows measure outward: a contact row is −(flank row). */
#include "gk_core.h"

static void link_gradient(const gk_model *model, const gk_setup *setup, int link, const gk_work *work, double *rigid)
{
    int g = link == BEARING_1X || link == BEARING_1Y || link == PORT_1 || link == SHAFT_1 || link == CLUTCH_1;
    int phi = g ? PHIB : PHIA;
    memset(rigid, 0, RIGID * sizeof *rigid);
    switch (link) {
    case BEARING_0X: case BEARING_1X:
        rigid[3 * g] = 1.0;
        if (setup->on.roll_motion) rigid[phi] = -work->read[g][work->system.contacts + BORE_Y]; /* the elastic bore displacement turns with the frame */
        break;
    case BEARING_0Y: case BEARING_1Y:
        rigid[3 * g + 1] = 1.0;
        if (setup->on.roll_motion) rigid[phi] = work->read[g][work->system.contacts + BORE_X];
        break;
    case PORT_0: case PORT_1: rigid[model->port[g].chain ? INERTIA_0 + g : phi] = 1.0; break;
    case SHAFT_0: case SHAFT_1: rigid[phi] = 1.0, rigid[DISC_0 + g] = -1.0; break;
    default: rigid[INERTIA_0 + g] = 1.0, rigid[DISC_0 + g] = -1.0;
    }
}

/* what every basis row reads of y, B·y */
static void gather(const gk_setup *setup, const gk_work *work, int g, const gk_real *y, double *read)
{
    const int n = setup->modal[g].n, rows = work->system.contacts + BORE_ROWS;
    for (int i = 0; i < rows; i++) read[i] = n ? gk_dot(work->basis[g] + (size_t)i * n, y, n) : 0.0;
}

/* row of the system that basis row i of gear g stands in, −1: none */
static int row_of(const gk_system *s, int g, int i) { return i < s->contacts ? i : s->bore[g][i - s->contacts]; }

/* B diag(w) Bᵀ over `lanes` of both halves, added to the upper triangle of the system matrix */
static void gram(const gk_setup *setup, gk_work *work, int g, const gk_real *w, int lanes, double *out)
{
    const gk_system *s = &work->system;
    const int n = setup->modal[g].n, P = setup->modal[g].pairs, rows = s->contacts + BORE_ROWS;
    if (!n || !lanes) return;
    for (int i = 0; i < rows; i++) {
        const gk_real *b = work->basis[g] + (size_t)i * n;
        gk_real *v = work->scaled;
        if (row_of(s, g, i) < 0) continue;
        double *line = out + (size_t)row_of(s, g, i) * s->n;
        for (int k = 0; k < lanes; k++) v[k] = b[k] * w[k];
        for (int k = 0; k < lanes; k++) v[P + k] = b[P + k] * w[P + k];
        for (int j = i; j < rows; j++) {
            const int column = row_of(s, g, j);
            if (column < 0) continue;
            const gk_real *other = work->basis[g] + (size_t)j * n;
            const double sum = lanes == P ? gk_dot(v, other, n) : gk_dot(v, other, lanes) + gk_dot(v + P, other + P, lanes);
            line[column] += (i < s->contacts) == (j < s->contacts) ? sum : -sum;
        }
    }
}

/* residual between the strips of two places, added to the system matrix */
static void residual_pair(const gk_setup *setup, const gk_gear *gear, int g, const gk_place *p, const gk_place *q, double *out, int n)
{
    const gk_modal *modal = &setup->modal[g];
    const int offset = q->number[g] - p->number[g], strips = setup->strips;
    gk_real sum[MAX_SLICES * MAX_SLICES + 3] = {0};
    if (offset < -3 || offset > 3) return;
    const gk_real *table = modal->c_ff + (size_t)((p->flank * 2 + q->flank) * OFFSETS + offset + 3) * gear->rolls * gear->rolls * modal->block;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            const gk_real w = (gk_real)(p->weight[g][i] * q->weight[g][j]);
            const gk_real *t = table + ((size_t)(p->index[g] + i) * gear->rolls + q->index[g] + j) * modal->block;
            for (int k = 0; k < modal->block; k++) sum[k] += w * t[k];
        }
    for (int a = 0; a < strips; a++)
        for (int b = 0; b < strips; b++) out[a * n + b] += sum[a * strips + b];
}

/* static compliance of what is not dynamic: flank–flank, flank–bore, bore–bore, into the upper triangle of C */
static void residual(const gk_setup *setup, const gk_gear *gear, const gk_work *work, int g, double attitude)
{
    const gk_system *s = &work->system;
    const gk_modal *modal = &setup->modal[g];
    const int strips = setup->strips, n = s->n;
    for (int p = 0; p < work->places; p++) {
        const gk_place *place = &work->place[p];
        double *block = s->C + (size_t)p * strips * n, sine, cosine;
        for (int q = p; q < work->places; q++) residual_pair(setup, gear, g, place, &work->place[q], block + q * strips, n);
        gk_sincos(attitude + 2.0 * GK_PI * place->tooth[g] / gear->teeth, &sine, &cosine);
        for (int a = 0; a < strips; a++) {
            double c[3] = {0, 0, 0};
            for (int i = 0; i < 4; i++)
                for (int k = 0; k < 3; k++)
                    c[k] += place->weight[g][i] * modal->c_fb[((size_t)(place->flank * gear->rolls + place->index[g] + i) * strips + a) * 3 + k];
            const double turned[3] = {c[0] * cosine - c[1] * sine, c[0] * sine + c[1] * cosine, c[2]};
            for (int k = 0; k < 3; k++)
                if (s->bore[g][k] >= 0) block[a * n + s->bore[g][k]] -= turned[k];
        }
    }
    for (int i = 0; i < 3; i++)
        for (int k = i; k < 3; k++)
            if (s->bore[g][i] >= 0 && s->bore[g][k] >= 0) s->C[(size_t)s->bore[g][i] * n + s->bore[g][k]] += modal->c_bb[3 * i + k];
}

static void list_contacts(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work)
{
    gk_system *s = &work->system;
    for (int p = 0; p < work->places; p++)
        for (int i = 0; i < s->strips; i++, s->n++) {
            const gk_place *place = &work->place[p];
            s->kind[s->n] = ROW_CONTACT;
            s->link_of[s->n] = -1;
            s->place_of[s->n] = p;
            s->force0[s->n] = place->memory < 0 ? 0.0 : data->memory[place->memory].force[i];
            s->damping[s->n] = setup->on.damping ? 2.0 * setup->damping * setup->strip_width[i] / h : 0.0;
            s->bound[s->n] = 0.0;
            s->weight[s->n] = setup->strip_width[i] * setup->slices / setup->width;
            if (i == 0) gk_law_set(model, setup, place->curvature, &s->local[s->n]);
            else s->local[s->n] = s->local[s->n - i];
            s->local[s->n].width = setup->strip_width[i];
        }
    s->contacts = s->n;
}

static void list_rows(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, gk_work *work)
{
    gk_system *s = &work->system;
    s->strips = setup->strips;
    s->n = 0;
    list_contacts(model, setup, data, h, work);
    for (int g = 0; g < 2; g++)
        for (int k = 0; k < BORE_ROWS; k++) s->bore[g][k] = -1;
    for (int link = 0; link < LINKS; link++) {
        if (!setup->link[link]) continue;
        const int torque = (link == PORT_0 || link == PORT_1) && setup->given_torque[link - PORT_0];
        s->kind[s->n] = link >= CLUTCH_0 ? ROW_CLUTCH : torque ? ROW_TORQUE : ROW_SPRING;
        s->link_of[s->n] = link;
        s->weight[s->n] = 1.0;
        if (link <= BEARING_1Y) s->bore[link / 2][link % 2] = s->n;
        else if (link <= PORT_1 ? !model->port[link - PORT_0].chain : link <= SHAFT_1) s->bore[(link - PORT_0) % 2][BORE_RZ] = s->n;
        s->force0[s->n] = link >= CLUTCH_0 ? 0.0 : data->link[link];
        s->damping[s->n] = 2.0 * setup->link_d[link] / h;
        s->bound[s->n] = link >= CLUTCH_0 ? 2.0 * data->value[GK_OF_SHAFT(CAPACITY, link - CLUTCH_0)] : 0.0;
        s->n++;
    }
}

/* elastic part of every row from what the basis rows read, in the row's own sense */
static void elastic(const gk_system *s, double (*const read)[MAX_BASIS], double *out)
{
    for (int i = 0; i < s->contacts; i++) out[i] = -read[0][i] - read[1][i];
    for (int i = s->contacts; i < s->n; i++) out[i] = 0.0;
    for (int g = 0; g < 2; g++)
        for (int k = 0; k < BORE_ROWS; k++)
            if (s->bore[g][k] >= 0) out[s->bore[g][k]] = read[g][s->contacts + k];
}

/* rigid part of a link's displacement: its gradient times the coordinates, but not the turning part of the bearing rows, which is a derivative and no displacement */
static double rigid_part(const gk_system *s, int i, const double *x)
{
    double sum = 0.0;
    for (int d = 0; d < RIGID; d++)
        if (s->link_of[i] > BEARING_1Y || (d != PHIA && d != PHIB)) sum += s->rigid[i][d] * x[d];
    return sum;
}

/* gaps at the predicted frames: undeformed gap minus outward elastic displacement; springs measure relative to their outer ends; clutches read half a step of slip */
static void gaps(const gk_model *model, const gk_setup *setup, double h, gk_work *work)
{
    gk_system *s = &work->system;
    elastic(s, work->read, s->g);
    for (int i = 0; i < s->n; i++) {
        const int port = s->link_of[i] - PORT_0;
        switch (s->kind[i]) {
        case ROW_CONTACT: {
            const gk_place *p = &work->place[s->place_of[i]];
            s->g[i] += p->gap;
            memcpy(s->rigid[i], p->gradient, sizeof p->gradient);
            memset(s->rigid[i] + 6, 0, (RIGID - 6) * sizeof(double));
            break;
        }
        case ROW_CLUTCH:
            link_gradient(model, setup, s->link_of[i], work, s->rigid[i]);
            s->g[i] += 0.5 * h * rigid_part(s, i, work->speed);
            break;
        default:
            link_gradient(model, setup, s->link_of[i], work, s->rigid[i]);
            s->g[i] += rigid_part(s, i, work->frame) - (s->kind[i] == ROW_SPRING && port >= 0 && port < 2 ? work->outer[port] : 0.0);
        }
    }
}

/* d/dt of the gaps that the rows read, for given modal and rigid speeds, at the system formed last */
void gk_system_rates(const gk_setup *setup, gk_work *work, const gk_real *const modal_speed[2], const double *speed, double *rate)
{
    const gk_system *s = &work->system;
    for (int g = 0; g < 2; g++) gather(setup, work, g, modal_speed[g], work->read_rate[g]);
    elastic(s, work->read_rate, rate);
    for (int i = 0; i < s->n; i++) {
        const int port = s->link_of[i] - PORT_0;
        for (int d = 0; d < RIGID; d++) rate[i] += s->rigid[i][d] * speed[d];
        if (s->kind[i] == ROW_SPRING && port >= 0 && port < 2) rate[i] -= work->outer_speed[port];
    }
}

static void rigid_part_of_matrices(const gk_setup *setup, const gk_coefficients *k, gk_system *s)
{
    const int n = s->n;
    for (int i = 0; i < n; i++) {
        for (int j = i; j < n; j++) {
            double sum = 0.0;
            for (int d = 0; d < RIGID; d++) sum += s->rigid[i][d] * s->rigid[j][d] * setup->inverse_mass[d];
            s->D[i * n + j] += k->rigid_mobility * sum;
            if (s->kind[i] != ROW_CLUTCH && s->kind[j] != ROW_CLUTCH) s->K[i * n + j] += k->rigid_kappa * sum;
            s->C[i * n + j] -= s->K[i * n + j];
            s->D[j * n + i] = s->D[i * n + j];
            s->C[j * n + i] = s->C[i * n + j];
            s->K[j * n + i] = s->K[i * n + j];
        }
        if (s->link_of[i] >= 0) s->C[i * n + i] += setup->link_c[s->link_of[i]];
    }
}

/* Forms the system at work->place for the weights of k: D from the mobilities, K from κ, C′ = residual − K + 1/k on the links' diagonal.
 * The local law is not in C′ (it depends on the force). */
void gk_system_form(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k, gk_work *work)
{
    gk_system *s = &work->system;
    list_rows(model, setup, data, k->h, work);
    const int n = s->n;
    const size_t size = (size_t)n * n;
    s->D = work->matrix;
    s->C = s->D + size;
    s->K = s->C + size;
    s->J = s->K + size;
    memset(s->D, 0, 3 * size * sizeof(double));
    for (int g = 0; g < 2; g++) {
        gather(setup, work, g, work->y[g], work->read[g]);
        gram(setup, work, g, k->flow[g].mobility, k->timeless ? 0 : setup->modal[g].pairs, s->D);
        if (setup->on.residual) residual(setup, &model->gear[g], work, g, work->attitude[g]);
        gram(setup, work, g, k->flow[g].kappa, k->flow[g].exact, s->K);
    }
    gaps(model, setup, k->h, work);
    rigid_part_of_matrices(setup, k, s);
}
