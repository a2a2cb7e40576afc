/* The small system of a step: which forces are unknown, what they do to the gaps within the step (D) and at once through what is massless (C′), and the gaps without them.
 * Rows: slices of all places, then the live bilateral rows (bearings, port springs, shafts, clutches). Contact forces press inward, rows measure outward: a contact row is −(flank row). */
#include "gk_core.h"

/* the gear's bore row a link pulls at, or −1 */
static int bore_row(const gk_model *model, int link, int g)
{
    switch (link) {
    case BEARING_0X: return g == 0 ? BORE_X : -1;
    case BEARING_0Y: return g == 0 ? BORE_Y : -1;
    case BEARING_1X: return g == 1 ? BORE_X : -1;
    case BEARING_1Y: return g == 1 ? BORE_Y : -1;
    case PORT_0: return g == 0 && !model->port[0].chain ? BORE_RZ : -1;
    case PORT_1: return g == 1 && !model->port[1].chain ? BORE_RZ : -1;
    case SHAFT_0: return g == 0 ? BORE_RZ : -1;
    case SHAFT_1: return g == 1 ? BORE_RZ : -1;
    default: return -1;
    }
}

static void link_gradient(const gk_model *model, int link, const gk_work *work, int bore, double *rigid)
{
    int g = link == BEARING_1X || link == BEARING_1Y || link == PORT_1 || link == SHAFT_1 || link == CLUTCH_1;
    int phi = g ? PHIB : PHIA;
    memset(rigid, 0, RIGID * sizeof *rigid);
    switch (link) {
    case BEARING_0X: case BEARING_1X:
        rigid[3 * g] = 1.0;
        rigid[phi] = -work->read[g][bore + BORE_Y]; /* the elastic bore displacement turns with the frame */
        break;
    case BEARING_0Y: case BEARING_1Y:
        rigid[3 * g + 1] = 1.0;
        rigid[phi] = work->read[g][bore + BORE_X];
        break;
    case PORT_0: case PORT_1: rigid[model->port[g].chain ? INERTIA_0 + g : phi] = 1.0; break;
    case SHAFT_0: case SHAFT_1: rigid[phi] = 1.0, rigid[DISC_0 + g] = -1.0; break;
    default: rigid[INERTIA_0 + g] = 1.0, rigid[DISC_0 + g] = -1.0;
    }
}

/* what every basis row reads of y, B·y */
static void gather(const gk_setup *setup, const gk_work *work, int g, int rows, const gk_real *y, double *read)
{
    const int n = setup->modal[g].n;
    for (int i = 0; i < rows; i++) read[i] = n ? gk_dot(work->basis[g] + (size_t)i * n, y, n) : 0.0;
}

/* B diag(w) Bᵀ over `lanes` of both halves, added to out */
static void gram(const gk_setup *setup, gk_work *work, int g, int rows, const gk_real *w, int lanes, double *out)
{
    const int n = setup->modal[g].n, P = setup->modal[g].pairs;
    if (!n || !lanes) return;
    for (int i = 0; i < rows; i++) {
        const gk_real *b = work->basis[g] + (size_t)i * n;
        gk_real *v = work->scaled;
        for (int k = 0; k < lanes; k++) v[k] = b[k] * w[k];
        for (int k = 0; k < lanes; k++) v[P + k] = b[P + k] * w[P + k];
        for (int j = i; j < rows; j++) {
            const gk_real *other = work->basis[g] + (size_t)j * n;
            double sum = lanes == P ? gk_dot(v, other, n) : gk_dot(v, other, lanes) + gk_dot(v + P, other + P, lanes);
            out[i * rows + j] += sum;
            if (j != i) out[j * rows + i] += sum;
        }
    }
}

static void residual_pair(const gk_setup *setup, const gk_gear *gear, int g, const gk_place *p, const gk_place *q, double *block)
{
    const gk_modal *modal = &setup->modal[g];
    int offset = q->number[g] - p->number[g];
    gk_real sum[64] = {0};
    memset(block, 0, (size_t)setup->functions * setup->functions * sizeof *block);
    if (offset < -3 || offset > 3) return;
    const gk_real *table = modal->c_ff + (size_t)((p->flank * 2 + q->flank) * OFFSETS + offset + 3) * gear->rolls * gear->rolls * modal->block;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            const gk_real w = (gk_real)(p->weight[g][i] * q->weight[g][j]);
            const gk_real *t = table + ((size_t)(p->index[g] + i) * gear->rolls + q->index[g] + j) * modal->block;
            for (int k = 0; k < modal->block; k++) sum[k] += w * t[k];
        }
    for (int k = 0; k < setup->functions * setup->functions; k++) block[k] = sum[k];
}

/* static compliance of what is not dynamic: flank–flank, flank–bore, bore–bore */
static void residual(const gk_model *model, const gk_setup *setup, const double *frame, gk_work *work, int g, int rows, double *out)
{
    const gk_gear *gear = &model->gear[g];
    const gk_modal *modal = &setup->modal[g];
    const int A = setup->functions, bore = work->places * A;
    for (int p = 0; p < work->places; p++) {
        double block[MAX_FUNCTIONS * MAX_FUNCTIONS], sine, cosine;
        for (int q = p; q < work->places; q++) {
            residual_pair(setup, gear, g, &work->place[p], &work->place[q], block);
            for (int a = 0; a < A; a++)
                for (int b = 0; b < A; b++) out[(p * A + a) * rows + q * A + b] = out[(q * A + b) * rows + p * A + a] = block[a * A + b];
        }
        const gk_place *place = &work->place[p];
        gk_sincos(frame[g ? PHIB : PHIA] + gear->phase + 2.0 * GK_PI * place->tooth[g] / gear->teeth, &sine, &cosine);
        for (int a = 0; a < A; a++) {
            double c[3] = {0, 0, 0};
            for (int i = 0; i < 4; i++)
                for (int k = 0; k < 3; k++)
                    c[k] += place->weight[g][i] * modal->c_fb[((size_t)(place->flank * gear->rolls + place->index[g] + i) * A + a) * 3 + k];
            double turned[3] = {c[0] * cosine - c[1] * sine, c[0] * sine + c[1] * cosine, c[2]};
            for (int k = 0; k < 3; k++) out[(p * A + a) * rows + bore + k] = out[(bore + k) * rows + p * A + a] = turned[k];
        }
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) out[(bore + i) * rows + bore + k] = modal->c_bb[3 * i + k];
}

/* coefficients of a system row on the basis rows of gear g: first basis row and count */
int gk_system_basis(const gk_model *model, const gk_setup *setup, const gk_work *work, int row, int g, int *first, const double **c)
{
    static const double one = 1.0;
    const gk_system *s = &work->system;
    if (row < s->contacts) {
        *first = s->place_of[row] * setup->functions;
        *c = setup->strip_row[g][row % s->strips];
        return setup->functions;
    }
    int bore = bore_row(model, s->link_of[row], g);
    if (bore < 0) return 0;
    *first = work->places * setup->functions + bore;
    *c = &one;
    return 1;
}

/* basis Gram matrix → upper triangle of the system matrix; contacts read −(width functions), links one bore row */
static void project(const gk_model *model, const gk_setup *setup, const gk_work *work, int g, int rows, const double *basis, double *out)
{
    const gk_system *s = &work->system;
    const int A = setup->functions, S = s->strips;
    for (int i = 0; i < s->n; i++) {
        const double *ci;
        int first, count = gk_system_basis(model, setup, work, i, g, &first, &ci);
        if (!count) continue;
        double line[MAX_BASIS] = {0}, *row = out + (size_t)i * s->n;
        const double sign = i < s->contacts ? -1.0 : 1.0;
        for (int a = 0; a < count; a++)
            for (int k = 0; k < rows; k++) line[k] += sign * ci[a] * basis[(first + a) * rows + k];
        for (int p = i / S * (i < s->contacts) + work->places * (i >= s->contacts); p < work->places; p++)
            for (int c = 0; c < S; c++) {
                const double *t = setup->strip_row[g][c], *l = line + p * A;
                double sum = 0.0;
                for (int a = 0; a < A; a++) sum += t[a] * l[a];
                row[p * S + c] -= sum;
            }
        for (int j = i < s->contacts ? s->contacts : i; j < s->n; j++) {
            const int bore = bore_row(model, s->link_of[j], g);
            if (bore >= 0) row[j] += line[work->places * A + bore];
        }
    }
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
    for (int link = 0; link < LINKS; link++) {
        if (!setup->link[link]) continue;
        const int torque = (link == PORT_0 || link == PORT_1) && setup->given_torque[link - PORT_0];
        s->kind[s->n] = link >= CLUTCH_0 ? ROW_CLUTCH : torque ? ROW_TORQUE : ROW_SPRING;
        s->link_of[s->n] = link;
        s->force0[s->n] = link >= CLUTCH_0 ? 0.0 : data->link[link];
        s->damping[s->n] = 2.0 * setup->link_d[link] / h;
        s->bound[s->n] = link >= CLUTCH_0 ? 2.0 * data->value[GK_OF_SHAFT(CAPACITY, link - CLUTCH_0)] : 0.0;
        s->n++;
    }
}

/* elastic part of row i from what the basis rows read, in the row's own sense */
static double elastic(const gk_model *model, const gk_setup *setup, const gk_work *work, int i, double (*const read)[MAX_BASIS])
{
    double sum = 0.0;
    for (int g = 0; g < 2; g++) {
        const double *c;
        int first, count = gk_system_basis(model, setup, work, i, g, &first, &c);
        for (int a = 0; a < count; a++) sum += c[a] * read[g][first + a];
    }
    return work->system.kind[i] == ROW_CONTACT ? -sum : sum;
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
    const int bore = work->places * setup->functions;
    for (int i = 0; i < s->n; i++) {
        s->g[i] = elastic(model, setup, work, i, work->read);
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
            link_gradient(model, s->link_of[i], work, bore, s->rigid[i]);
            s->g[i] += 0.5 * h * rigid_part(s, i, work->speed);
            break;
        default:
            link_gradient(model, s->link_of[i], work, bore, s->rigid[i]);
            s->g[i] += rigid_part(s, i, work->frame) - (s->kind[i] == ROW_SPRING && port >= 0 && port < 2 ? work->outer[port] : 0.0);
        }
    }
}

/* d/dt of the gaps that the rows read, for given modal and rigid speeds, at the system formed last */
void gk_system_rates(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_real *const modal_speed[2], const double *speed, double *rate)
{
    const gk_system *s = &work->system;
    for (int g = 0; g < 2; g++) gather(setup, work, g, work->places * setup->functions + BORE_ROWS, modal_speed[g], work->read_rate[g]);
    for (int i = 0; i < s->n; i++) {
        const int port = s->link_of[i] - PORT_0;
        rate[i] = elastic(model, setup, work, i, work->read_rate);
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
    const int n = s->n, rows = work->places * setup->functions + BORE_ROWS;
    const size_t size = (size_t)n * n, basis = (size_t)rows * rows * sizeof(double);
    s->D = work->matrix;
    s->C = s->D + size;
    s->K = s->C + size;
    s->J = s->K + size;
    memset(s->D, 0, 3 * size * sizeof(double));
    for (int g = 0; g < 2; g++) {
        gather(setup, work, g, rows, work->y[g], work->read[g]);
        memset(work->gram_d[g], 0, basis);
        gram(setup, work, g, rows, k->flow[g].mobility, setup->modal[g].pairs, work->gram_d[g]);
        project(model, setup, work, g, rows, work->gram_d[g], s->D);
        if (setup->on.residual) {
            residual(model, setup, work->frame, work, g, rows, work->gram_c[g]);
            project(model, setup, work, g, rows, work->gram_c[g], s->C);
        }
        if (k->flow[g].exact) {
            memset(work->gram_k[g], 0, basis);
            gram(setup, work, g, rows, k->flow[g].kappa, k->flow[g].exact, work->gram_k[g]);
            project(model, setup, work, g, rows, work->gram_k[g], s->K);
        }
    }
    gaps(model, setup, k->h, work);
    rigid_part_of_matrices(setup, k, s);
}
