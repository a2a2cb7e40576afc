/* What the rows of an engagement read of the oscillators, and what their forces do to them: modes of the gear groups,
 * the ground group, bores. Rows of the gaps and rows of the sliding of contacts go the same way (gk_rows). Whatever is
 * pushed is read by the same numbers, else energy leaks. Forces come in pairs x, y: two sums in one pass. */
#include "problem/gk_exchange.h"
#include "force/gk_turn.h"
#include "problem/gk_felt.h"

gk_rows gk_rows_of_gaps(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    const gk_engaged *engaged = &work->engaged[e];
    return (gk_rows){setup, work, engaged, engaged->basis, engaged->ground, engaged->system.n};
}

gk_rows gk_rows_of_sliding(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e) && work->engaged[e].glide);
    const gk_engaged *engaged = &work->engaged[e];
    const gk_glide *glide = engaged->glide;
    return (gk_rows){setup, work, engaged, glide->basis, glide->ground, engaged->system.contacts};
}

/* ---- reading ----------------------------------------------------------------------------------------------------- */
/* reads displacements (or speeds) of the ground group */
void gk_exchange_read_ground(const gk_rows *rows, const double *ground, double *read)
{
    GK_ASSERT(ground && read);
    const gk_engaged *engaged = rows->engaged;
    const gk_mesh *mesh = &rows->setup->mesh[engaged->index];
    double local[MAX_GROUND + 4 * MAX_ROTORS], *to = local;
    for (int w = 0; w < 2; to += engaged->wide[w++])
        if (engaged->by_patterns[w]) { /* places are found with the rigid motion */
            GK_ASSERT(ground == rows->work->ground_y);
            memcpy(to, rows->work->seen[mesh->side[w].gear], (size_t)engaged->wide[w] * sizeof *to);
            memset(to, 0, SPACE * sizeof *to);
        } else {
            memcpy(to, ground + mesh->part[w].from, (size_t)engaged->wide[w] * sizeof *to);
        }
    for (int i = 0; i < engaged->system.stride; i++) read[i] = 0.0;
    gk_times_rows(rows->ground, rows->count, engaged->local, local, read);
}

/* adds what contacts read of displacements y of the gear group of a side */
void gk_exchange_read_modes(const gk_rows *rows, int which, const gk_real *y, double *read)
{
    GK_ASSERT(which == 0 || which == 1);
    const gk_engaged *engaged = rows->engaged;
    const int g = rows->setup->mesh[engaged->index].side[which].gear, n = GK_LANES(rows->setup, g);
    gk_real *turned = rows->work->turned;
    const gk_real *row = rows->basis[which];
    if (!n || !engaged->system.contacts) return;
    gk_turn_back(&rows->setup->modal[g], engaged->position[which].tooth, y, turned);
    for (int i = 0; i < engaged->system.contacts; i++, row += n) read[i] -= gk_dot(row, turned, n);
}

/* reads displacements (or speeds) of the ground group and, y, of the gear groups */
void gk_exchange_read(const gk_rows *rows, const gk_real *const y[], const double *ground, double *read)
{
    GK_ASSERT(y && read);
    gk_exchange_read_ground(rows, ground, read);
    for (int w = 0; w < 2; w++)
        gk_exchange_read_modes(rows, w, y[rows->setup->mesh[rows->engaged->index].side[w].gear], read);
}

/* ---- pushing ----------------------------------------------------------------------------------------------------- */
typedef struct pushes { /* rows whose forces are not zero */
    int count, row[MAX_ROWS];
    double x[MAX_ROWS], y[MAX_ROWS];
} pushes;

static void list_pushes(const double *x, const double *y, int rows, pushes *p)
{
    p->count = 0;
    for (int i = 0; i < rows; i++) {
        p->row[p->count] = i, p->x[p->count] = x[i], p->y[p->count] = y[i];
        p->count += x[i] != 0.0 || y[i] != 0.0;
    }
}

typedef struct half_rows { /* on a gear group; width: of a row */
    const gk_half *at;
    int width;
} half_rows;

/* −Σ rows·x and −Σ rows·y over `halves` of a gear group from `first` on, in registers */
GK_INLINE void push_halves(const pushes *p, half_rows rows, int first, gk_half *out_x, gk_half *out_y, const int halves)
{
    gk_half sum_x[4] = {{0}}, sum_y[4] = {{0}};
    for (int r = 0; r < p->count; r++) {
        const gk_half *row = rows.at + (size_t)p->row[r] * rows.width + first;
        const gk_real x = (gk_real)p->x[r], y = (gk_real)p->y[r];
        for (int k = 0; k < halves; k++) sum_x[k] -= x * row[k], sum_y[k] -= y * row[k];
    }
    for (int k = 0; k < halves; k++) out_x[first + k] = sum_x[k], out_y[first + k] = sum_y[k];
}

/* −Σ rows·x and −Σ rows·y of a gear group, in the frame of the reference tooth */
static void contact_forces(const gk_setup *setup, const gk_real *basis, const gk_side *side, const pushes *p,
                           gk_real *out_x, gk_real *out_y)
{
    const int width = 2 * GK_LANES(setup, side->gear) / LANES;
    const half_rows rows = {(const gk_half *)basis, width};
    int first = 0;
    for (; first + 4 <= width; first += 4) push_halves(p, rows, first, (gk_half *)out_x, (gk_half *)out_y, 4);
    for (; first < width; first += 2) push_halves(p, rows, first, (gk_half *)out_x, (gk_half *)out_y, 2);
}

static void push_basis(const gk_rows *rows, int which, const pushes *p, gk_real *out_x, gk_real *out_y)
{
    const gk_side *side = &rows->setup->mesh[rows->engaged->index].side[which];
    const gk_real *turned[2] = {rows->work->turned, rows->work->turned_next};
    gk_real *sum[2] = {out_x, out_y};
    if (!GK_LANES(rows->setup, side->gear) || !p->count) return;
    contact_forces(rows->setup, rows->basis[which], side, p, rows->work->turned, rows->work->turned_next);
    gk_turn_forth(&rows->setup->modal[side->gear], rows->engaged->position[which].tooth, turned, sum);
}

/* adds the modal forces of the contacts' forces x and y to those of the gear group of a side */
void gk_exchange_push_modes(const gk_rows *rows, int which, const double *x, const double *y, gk_real *out_x,
                            gk_real *out_y)
{
    GK_ASSERT(which == 0 || which == 1);
    pushes p;
    list_pushes(x, y, rows->engaged->system.contacts, &p);
    push_basis(rows, which, &p, out_x, out_y);
}

typedef struct quad_rows { /* on the ground group; width: of a row */
    const gk_quad *at;
    int width;
} quad_rows;

/* adds Σ rows·x, and where `both` Σ rows·y, over `quads` of the ground group from `first` on */
GK_INLINE void push_quads(const pushes *p, quad_rows rows, int first, gk_quad *out_x, gk_quad *out_y, const int quads,
                          const int both)
{
    gk_quad sum_x[4], sum_y[4];
    for (int k = 0; k < quads; k++) sum_x[k] = out_x[first + k];
    for (int k = 0; both && k < quads; k++) sum_y[k] = out_y[first + k];
    for (int r = 0; r < p->count; r++) {
        const gk_quad *row = rows.at + (size_t)p->row[r] * rows.width + first;
        const double x = p->x[r], y = p->y[r];
        for (int k = 0; k < quads; k++) sum_x[k] += x * row[k];
        for (int k = 0; both && k < quads; k++) sum_y[k] += y * row[k];
    }
    for (int k = 0; k < quads; k++) out_x[first + k] = sum_x[k];
    for (int k = 0; both && k < quads; k++) out_y[first + k] = sum_y[k];
}

/* adds the forces x, and where `both` y, of rows to those on the ground group: of either side */
GK_INLINE void ground_forces(const gk_rows *of, const pushes *p, double *const out_x[2], double *const out_y[2],
                             const int both)
{
    const quad_rows rows = {(const gk_quad *)of->ground, of->engaged->local / 4};
    for (int w = 0, first = 0; w < 2; w++) {
        gk_quad *x = (gk_quad *)out_x[w] - first, *y = (gk_quad *)out_y[w] - first;
        const int end = first + of->engaged->wide[w] / 4;
        for (; first + 3 <= end; first += 3) push_quads(p, rows, first, x, y, 3, both);
        for (; first + 2 <= end; first += 2) push_quads(p, rows, first, x, y, 2, both);
        for (; first < end; first++) push_quads(p, rows, first, x, y, 1, both);
    }
}

/* adds the forces x and y of rows to those on ground group and gear groups */
static void scatter(const gk_rows *rows, const double *x, const double *y)
{
    const gk_mesh *mesh = &rows->setup->mesh[rows->engaged->index];
    gk_work *work = rows->work;
    pushes p;
    list_pushes(x, y, rows->count, &p);
    double *to_z[2], *to_next[2];
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear, from = mesh->part[w].from, patterns = rows->engaged->by_patterns[w];
        to_z[w] = patterns ? work->scatter_pattern[0][g] : work->ground_force + from;
        to_next[w] = patterns ? work->scatter_pattern[1][g] : work->ground_next + from;
    }
    if (mesh->local) ground_forces(rows, &p, to_z, to_next, 1);
    while (p.count && p.row[p.count - 1] >= rows->engaged->system.contacts) p.count--;
    for (int w = 0; w < 2; w++) {
        const int g = mesh->side[w].gear;
        push_basis(rows, w, &p, work->force[g], work->next[g]);
    }
}

/* Modal forces of the rows' forces x and y of all engagements, friction included, into work->force, next, ground_force
 * and ground_next. */
void gk_exchange_scatter(const gk_model *model, const gk_setup *setup, gk_work *work,
                         const double *(*x)(const gk_system *), const double *(*y)(const gk_system *))
{
    GK_ASSERT(x && y);
    const size_t width = (size_t)setup->base.n * sizeof(double);
    for (int g = 0; g < model->gears; g++) {
        const size_t size = (size_t)GK_LANES(setup, g) * sizeof(gk_real);
        memset(work->force[g], 0, size);
        memset(work->next[g], 0, size);
        if (!setup->base.patterns[g]) continue;
        memset(work->scatter_pattern[0][g], 0, sizeof work->scatter_pattern[0][g]);
        memset(work->scatter_pattern[1][g], 0, sizeof work->scatter_pattern[1][g]);
    }
    memset(work->ground_force, 0, width);
    memset(work->ground_next, 0, width);
    for (int e = 0; e < model->engagements; e++) {
        const gk_engaged *engaged = &work->engaged[e];
        const gk_rows gaps = gk_rows_of_gaps(setup, work, e);
        scatter(&gaps, x(&engaged->system), y(&engaged->system));
        if (!GK_ON(setup, friction)) continue;
        const gk_rows sliding = gk_rows_of_sliding(setup, work, e);
        scatter(&sliding, engaged->glide->step, engaged->glide->last);
    }
    if (work->by_tables) gk_felt_scatter(model, setup, work);
}

/* ---- bores ------------------------------------------------------------------------------------------------------- */
/* adds what the rows' forces do at once between flanks and bores: moments on ports, and what contacts turn the bores */
void gk_exchange_push_bores(const gk_setup *setup, const gk_engaged *engaged, const double *x, gk_bores *sum)
{
    GK_ASSERT(x && sum);
    const gk_system *s = &engaged->system;
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i)) sum->moment[s->joint.port[i]] += x[i];
    for (int w = 0; w < 2; w++) {
        const int port = setup->mesh[engaged->index].side[w].port_of;
        if (port < 0) continue;
        const int whole = s->contacts / 4;
        sum->turned[port] -= gk_dot_quads(engaged->bore[w], x, whole);
        for (int i = 4 * whole; i < s->contacts; i++) sum->turned[port] -= engaged->bore[w][i] * x[i];
    }
}

/* adds what the rows read of it */
void gk_exchange_read_bores(const gk_setup *setup, const gk_engaged *engaged, const gk_bores *bores, double *read)
{
    GK_ASSERT(bores && read);
    const gk_system *s = &engaged->system;
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i)) read[i] += bores->turned[s->joint.port[i]];
    for (int w = 0; w < 2; w++) {
        const int port = setup->mesh[engaged->index].side[w].port_of;
        const int whole = port < 0 || bores->moment[port] == 0.0 ? 0 : s->contacts / 4;
        if (whole) gk_axpy(-bores->moment[port], engaged->bore[w], read, 0, whole);
        for (int i = 4 * whole; i < s->contacts && port >= 0; i++) read[i] -= engaged->bore[w][i] * bores->moment[port];
    }
}
