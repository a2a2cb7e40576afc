/* What the rows of an engagement read of the oscillators, and what their forces do to them. A contact's row on a gear
 * group is the interpolated row of its candidate, for the reference tooth 0: the group's state is turned to the
 * reference tooth before it is read, and its force turned back (docs/theory.md, eq. 3). On the ground group a row is
 * minus the outward displacement of both gears plus the gap's gradient times their rigid motion; it is kept over the
 * oscillators that the two gears read, those of gear A first. */
#include "problem/gk_work.h"

/* rigid motion of both gears of an engagement by displacements (or speeds) of the ground group */
static void read_rigid(const gk_model *model, const gk_setup *setup, int e, const double *ground, double rigid[POSE])
{
    const gk_base *base = &setup->base;
    memset(rigid, 0, POSE * sizeof *rigid);
    for (int w = 0; w < 2; w++) {
        const int g = model->engagement[e].gear[w];
        for (int m = 0; m < base->motions[g]; m++) {
            const int c = base->motion[g][m];
            rigid[SPACE * w + c] = gk_dot_quads(base->moved[g][c], ground + base->from[g], base->width[g] / 4);
        }
    }
}

/* positions and angles of both gears of an engagement: spin, and rigid motion by the ground oscillators */
void gk_rows_pose(const gk_model *model, const gk_setup *setup, int e, const double *spin, const double *ground,
                  double *pose)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(spin && pose);
    read_rigid(model, setup, e, ground, pose);
    const int frame = setup->mesh[e].frame;
    for (int w = 0; w < 2; w++) {
        const double turned = spin[model->gear[model->engagement[e].gear[w]].rotor];
        pose[SPACE * w + PHIA] += frame < 0 ? turned : turned - spin[frame];
    }
}

/* Fills the rows of the contacts on the gear groups, from a table of the side */
static void contact_rows(const gk_setup *setup, const gk_side *side, const gk_real *table, const gk_engaged *work,
                         gk_real *out)
{
    const gk_position *at = &work->position[side->which];
    const int halves = 2 * GK_LANES(setup, side->gear) / LANES, strips = GK_STRIPS(setup),
              points = side->candidates * strips;
    const gk_real part = (gk_real)at->part;
    gk_half *to = (gk_half *)out;
    for (int p = 0; p < work->places; p++) {
        const size_t first = ((size_t)at->node * points + (size_t)(work->place[p].candidate[side->which] * strips)) *
                             halves;
        const gk_half *low = (const gk_half *)table + first, *high = low + (size_t)points * halves;
        for (int k = 0; k < strips * halves; k += 2) {
            to[k] = low[k] + part * (high[k] - low[k]);
            to[k + 1] = low[k + 1] + part * (high[k + 1] - low[k + 1]);
        }
        to += strips * halves;
    }
}

void gk_rows_form(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(work->engaged[e].places >= 0 && work->engaged[e].places <= MAX_PAIRS);
    gk_engaged *engaged = &work->engaged[e];
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        if (GK_LANES(setup, side->gear)) contact_rows(setup, side, side->rows, engaged, engaged->basis[w]);
    }
}

enum { ADD, WRITE, ADD_ALONG }; /* rows of the gaps, added or written; of the sliding */

/* Rows of the contacts on the part of the ground group that one gear reads; strips of a place whose gradient is the
 * same: all, or each has its own */
GK_INLINE void ground_rows_of(const gk_setup *setup, const gk_side *side, const gk_engaged *engaged, double *out,
                              const int motions, const int each, const int strips, const int what)
{
    const gk_base *base = &setup->base;
    const gk_position *at = &engaged->position[side->which];
    const int quads = base->width[side->gear] / 4, points = side->candidates * strips;
    const int *motion = base->motion[side->gear];
    const size_t local = (size_t)setup->mesh[engaged->index].local / 4;
    const gk_quad *const table = (const gk_quad *)(what == ADD_ALONG ? side->along.ground : side->ground);
    const gk_quad *const node = table + (size_t)(at->node * points) * quads;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        const gk_quad *low = node + (size_t)(place->candidate[side->which] * strips) * quads;
        const gk_quad *high = low + (size_t)points * quads;
        gk_quad *to = (gk_quad *)out + (size_t)(p * strips) * local;
        for (int first = 0; first < strips; first += each) {
            const gk_point *point = &place->point[first];
            const double *gradient = (what == ADD_ALONG ? point->slide : point->gradient) + SPACE * side->which;
            double g[SPACE];
            const gk_quad *moved[SPACE];
            for (int m = 0; m < motions; m++)
                g[m] = gradient[motion[m]], moved[m] = (const gk_quad *)base->moved[side->gear][motion[m]];
            for (int q = 0; q < quads; q++) {
                gk_quad rigid = {0};
                for (int m = 0; m < motions; m++) rigid += g[m] * moved[m][q];
                for (int i = first; i < first + each; i++) {
                    const gk_quad here = low[i * quads + q];
                    const gk_quad row = rigid - (here + at->part * (high[i * quads + q] - here));
                    if (what == WRITE)
                        to[(size_t)i * local + q] = row;
                    else
                        to[(size_t)i * local + q] += row;
                }
            }
        }
    }
}

GK_INLINE void ground_rows(const gk_setup *setup, const gk_side *side, const gk_engaged *engaged, double *out,
                           const int what, const int strips)
{
    const int motions = setup->base.motions[side->gear];
    if (setup->spatial)
        ground_rows_of(setup, side, engaged, out, motions, 1, strips, what);
    else if (motions == 2)
        ground_rows_of(setup, side, engaged, out, 2, strips, strips, what);
    else
        ground_rows_of(setup, side, engaged, out, motions, strips, strips, what);
}

/* do the rows of both gears fill those of the engagement, each its own part of them? */
static int fills(const gk_base *base, const gk_mesh *mesh)
{
    int width = 0;
    for (int w = 0; w < 2; w++) width += base->width[mesh->side[w].gear];
    return !mesh->joined && width == mesh->local;
}

/* Fills the rows of contacts and joints on the ground group; the rows have been listed */
void gk_rows_form_ground(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system));
    const gk_base *base = &setup->base;
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    const int local = mesh->local;
    if (!local) return;
    const int afresh = fills(base, mesh);
    if (!afresh) memset(engaged->ground, 0, (size_t)(s->contacts * local) * sizeof *engaged->ground);
    for (int w = 0; w < 2; w++)
        if (afresh) {
            GK_STRIPPED(GK_STRIPS(setup), ground_rows, setup, &mesh->side[w], engaged, engaged->ground + mesh->at[w],
                        WRITE)
        } else {
            GK_STRIPPED(GK_STRIPS(setup), ground_rows, setup, &mesh->side[w], engaged, engaged->ground + mesh->at[w],
                        ADD)
        }
    for (int i = s->contacts; i < s->n; i++) {
        double *row = engaged->ground + (size_t)i * local;
        if (gk_rows_at_bore(setup, s, i))
            gk_local_gather(mesh, base->port_rows + s->port_of[i] * base->n, row);
        else
            memset(row, 0, (size_t)local * sizeof *row);
    }
}

/* Fills the rows of the sliding of all contacts: gear groups, ground group, spins; those of the gaps are there */
void gk_rows_form_along(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(work->engaged[e].glide);
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_glide *glide = engaged->glide;
    const int strips = GK_STRIPS(setup), contacts = engaged->system.contacts;
    memset(glide->rigid, 0, sizeof glide->rigid);
    memset(glide->ground, 0, (size_t)(contacts * mesh->local) * sizeof *glide->ground);
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &mesh->side[w];
        if (GK_LANES(setup, side->gear)) contact_rows(setup, side, side->along.rows, engaged, glide->basis[w]);
        if (mesh->local)
            ground_rows_of(setup, side, engaged, glide->ground + mesh->at[w], setup->base.motions[side->gear],
                           setup->spatial ? 1 : strips, strips, ADD_ALONG);
    }
    for (int i = 0; i < contacts; i++) {
        const double *slide = gk_point_of(setup, &engaged->place[i / strips], i % strips)->slide;
        glide->rigid[0][i] = slide[PHIA], glide->rigid[1][i] = slide[PHIB];
        if (mesh->frame >= 0) glide->rigid[2][i] = -slide[PHIA] - slide[PHIB];
    }
}

/* a gear group's state in the frame of a tooth: what tooth 0 of a state turned back would have */
void gk_rows_turn_back(const gk_modal *m, int tooth, const gk_real *y, gk_real *out)
{
    GK_ASSERT(tooth >= 0 && y != out && m->n % (2 * LANES) == 0);
    const int half = m->n / LANES; /* halves of LANES in one half of the lanes */
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    const gk_half *a = (const gk_half *)y, *b = a + half;
    gk_half *to = (gk_half *)out;
    for (int k = 0; k < half; k++) {
        to[k] = a[k] * c[k] + b[k] * s[k];
        to[half + k] = b[k] * c[k] - a[k] * s[k];
    }
}

/* adds two forces in the frame of a tooth to the group's */
void gk_rows_turn_forth(const gk_modal *m, int tooth, const gk_real *f[2], gk_real *sum[2])
{
    GK_ASSERT(tooth >= 0 && m->n % (2 * LANES) == 0);
    const int half = m->n / LANES;
    const gk_half *c = (const gk_half *)m->cosine + tooth * half, *s = (const gk_half *)m->sine + tooth * half;
    for (int k = 0; k < half; k++)
        for (int i = 0; i < 2; i++) {
            const gk_half a = ((const gk_half *)f[i])[k], b = ((const gk_half *)f[i])[half + k];
            ((gk_half *)sum[i])[k] += a * c[k] - b * s[k];
            ((gk_half *)sum[i])[half + k] += a * s[k] + b * c[k];
        }
}

/* what the rows of an engagement read of displacements (or speeds) of its own part of the ground group */
void gk_rows_read_local(const gk_mesh *mesh, const gk_engaged *engaged, const double *local, double *read)
{
    GK_ASSERT(engaged && engaged->index == mesh->index);
    GK_ASSERT(local && read);
    const gk_system *s = &engaged->system;
    for (int i = 0; i < s->stride; i++) read[i] = 0.0;
    gk_times_rows(engaged->ground, s->n, mesh->local, local, read);
}

/* the same of the sliding of the contacts */
void gk_rows_read_local_along(const gk_mesh *mesh, const gk_engaged *engaged, const double *local, double *read)
{
    GK_ASSERT(engaged && engaged->index == mesh->index);
    GK_ASSERT(engaged->glide && local && read);
    const gk_system *s = &engaged->system;
    for (int i = 0; i < s->stride; i++) read[i] = 0.0;
    gk_times_rows(engaged->glide->ground, s->contacts, mesh->local, local, read);
}

/* what the sliding of the contacts reads of displacements (or speeds) of the ground group */
void gk_rows_read_ground_along(const gk_setup *setup, const gk_engaged *engaged, int e, const double *ground,
                               double *read)
{
    double local[MAX_GROUND + 4 * MAX_ROTORS];
    gk_local_gather(&setup->mesh[e], ground, local);
    gk_rows_read_local_along(&setup->mesh[e], engaged, local, read);
}

/* what the gaps of an engagement read of displacements (or speeds) of the ground group and, y, of the gear groups */
void gk_rows_read(const gk_setup *setup, gk_work *work, int e, const gk_real *const y[], const double *ground,
                  double *read)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(y && read);
    const gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    double local[MAX_GROUND + 4 * MAX_ROTORS];
    gk_local_gather(&setup->mesh[e], ground, local);
    gk_rows_read_local(&setup->mesh[e], engaged, local, read);
    for (int w = 0; w < 2; w++) {
        const int g = setup->mesh[e].side[w].gear, n = GK_LANES(setup, g);
        if (!n || !s->contacts) continue;
        gk_rows_turn_back(&setup->modal[g], engaged->position[w].tooth, y[g], work->turned);
        const gk_real *row = engaged->basis[w];
        for (int i = 0; i < s->contacts; i++, row += n) read[i] -= gk_dot(row, work->turned, n);
    }
}

/* Takes away what rigid motion of the gears by `ground` makes of the gaps of the contacts: places are found with it */
void gk_rows_without_rigid(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int e,
                           const double *ground, double *read)
{
    GK_ASSERT(engaged && engaged->index == e);
    GK_ASSERT(read);
    const int each = setup->spatial ? 1 : GK_STRIPS(setup);
    double rigid[POSE];
    read_rigid(model, setup, e, ground, rigid);
    for (int p = 0, i = 0; p < engaged->places; p++)
        for (int first = 0; first < GK_STRIPS(setup); first += each) {
            const double *gradient = engaged->place[p].point[first].gradient;
            double sum = 0.0;
            for (int w = 0; w < 2; w++) {
                const int g = setup->mesh[e].side[w].gear;
                for (int m = 0; m < setup->base.motions[g]; m++) {
                    const int c = SPACE * w + setup->base.motion[g][m];
                    sum += gradient[c] * rigid[c];
                }
            }
            for (int strip = 0; strip < each; strip++) read[i++] -= sum;
        }
}

/* ---- bores ------------------------------------------------------------------------------------------------------- */
/* what a moment on the port of a side's rotor turns its contacts outward at once */
GK_INLINE void bore_column(const gk_side *side, const gk_engaged *engaged, double *out, const int strips)
{
    const gk_position *at = &engaged->position[side->which];
    const int points = side->candidates * strips;
    const double *node = side->port + (size_t)at->node * points;
    for (int p = 0; p < engaged->places; p++, out += strips) {
        const double *low = node + engaged->place[p].candidate[side->which] * strips, *high = low + points;
        for (int i = 0; i < strips; i++) out[i] = low[i] + at->part * (high[i] - low[i]);
    }
}

/* Fills what moments on ports turn the contacts of an engagement */
void gk_rows_form_bores(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    for (int w = 0; w < 2; w++)
        if (setup->mesh[e].side[w].port_of >= 0)
            GK_STRIPPED(GK_STRIPS(setup), bore_column, &setup->mesh[e].side[w], &work->engaged[e],
                        work->engaged[e].bore[w])
}

/* adds what the rows' forces do at once between flanks and bores: moments on ports, and what contacts turn the bores */
void gk_rows_push_bores(const gk_setup *setup, const gk_engaged *engaged, int e, const double *x, gk_bores *sum)
{
    GK_ASSERT(engaged && engaged->index == e);
    GK_ASSERT(x && sum);
    const gk_system *s = &engaged->system;
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i)) sum->moment[s->port_of[i]] += x[i];
    for (int w = 0; w < 2; w++) {
        const int port = setup->mesh[e].side[w].port_of;
        for (int i = 0; i < s->contacts && port >= 0; i++) sum->turned[port] -= engaged->bore[w][i] * x[i];
    }
}

/* adds what the rows read of it */
void gk_rows_read_bores(const gk_setup *setup, const gk_engaged *engaged, int e, const gk_bores *bores, double *read)
{
    GK_ASSERT(engaged && engaged->index == e);
    GK_ASSERT(bores && read);
    const gk_system *s = &engaged->system;
    for (int i = s->contacts; i < s->n; i++)
        if (gk_rows_at_bore(setup, s, i)) read[i] += bores->turned[s->port_of[i]];
    for (int w = 0; w < 2; w++) {
        const int port = setup->mesh[e].side[w].port_of;
        for (int i = 0; i < s->contacts && port >= 0; i++) read[i] -= engaged->bore[w][i] * bores->moment[port];
    }
}

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

/* −Σ rows·x and −Σ rows·y over `halves` of a gear group from `first` on, in registers */
GK_INLINE void push_halves(const pushes *p, const gk_half *rows, int width, int first, gk_half *out_x, gk_half *out_y,
                           const int halves)
{
    gk_half sum_x[4] = {{0}}, sum_y[4] = {{0}};
    for (int r = 0; r < p->count; r++) {
        const gk_half *row = rows + (size_t)p->row[r] * width + first;
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
    const gk_half *rows = (const gk_half *)basis;
    int first = 0;
    for (; first + 4 <= width; first += 4) push_halves(p, rows, width, first, (gk_half *)out_x, (gk_half *)out_y, 4);
    for (; first < width; first += 2) push_halves(p, rows, width, first, (gk_half *)out_x, (gk_half *)out_y, 2);
}

static void push_basis(const gk_setup *setup, gk_work *work, int e, int which, const gk_real *basis, const pushes *p,
                       gk_real *out_x, gk_real *out_y)
{
    const gk_side *side = &setup->mesh[e].side[which];
    const gk_real *turned[2] = {work->turned, work->turned_next};
    gk_real *sum[2] = {out_x, out_y};
    if (!GK_LANES(setup, side->gear) || !p->count) return;
    contact_forces(setup, basis, side, p, work->turned, work->turned_next);
    gk_rows_turn_forth(&setup->modal[side->gear], work->engaged[e].position[which].tooth, turned, sum);
}

/* adds the modal forces of the contacts' forces x and y to those of a gear group */
void gk_rows_push_modes(const gk_setup *setup, gk_work *work, int e, int which, const double *x, const double *y,
                        gk_real *out_x, gk_real *out_y)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    pushes p;
    list_pushes(x, y, work->engaged[e].system.contacts, &p);
    push_basis(setup, work, e, which, work->engaged[e].basis[which], &p, out_x, out_y);
}

/* the same of forces along the profile */
void gk_rows_push_modes_along(const gk_setup *setup, gk_work *work, int e, int which, const double *x, const double *y,
                              gk_real *out_x, gk_real *out_y)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    pushes p;
    list_pushes(x, y, work->engaged[e].system.contacts, &p);
    push_basis(setup, work, e, which, work->engaged[e].glide->basis[which], &p, out_x, out_y);
}

/* adds what the contacts read of displacements y of a gear group by rows `row` */
static void read_basis(const gk_setup *setup, gk_work *work, int e, int which, const gk_real *row, const gk_real *y,
                       double *read)
{
    const gk_engaged *engaged = &work->engaged[e];
    const int g = setup->mesh[e].side[which].gear, n = GK_LANES(setup, g);
    if (!n || !engaged->system.contacts) return;
    gk_rows_turn_back(&setup->modal[g], engaged->position[which].tooth, y, work->turned);
    for (int i = 0; i < engaged->system.contacts; i++, row += n) read[i] -= gk_dot(row, work->turned, n);
}

/* adds what their gaps read */
void gk_rows_read_modes(const gk_setup *setup, gk_work *work, int e, int which, const gk_real *y, double *read)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    read_basis(setup, work, e, which, work->engaged[e].basis[which], y, read);
}

/* adds what their sliding reads */
void gk_rows_read_modes_along(const gk_setup *setup, gk_work *work, int e, int which, const gk_real *y, double *read)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    read_basis(setup, work, e, which, work->engaged[e].glide->basis[which], y, read);
}

/* adds Σ rows·x and Σ rows·y over `quads` of the ground group from `first` on */
GK_INLINE void push_quads(const pushes *p, const gk_quad *rows, int width, int first, gk_quad *out_x, gk_quad *out_y,
                          const int quads)
{
    gk_quad sum_x[4], sum_y[4];
    for (int k = 0; k < quads; k++) sum_x[k] = out_x[k], sum_y[k] = out_y[k];
    for (int r = 0; r < p->count; r++) {
        const gk_quad *row = rows + (size_t)p->row[r] * width + first;
        const double x = p->x[r], y = p->y[r];
        for (int k = 0; k < quads; k++) sum_x[k] += x * row[k], sum_y[k] += y * row[k];
    }
    for (int k = 0; k < quads; k++) out_x[k] = sum_x[k], out_y[k] = sum_y[k];
}

/* adds the forces x and y of rows to those on the ground group, whose two parts for this engagement begin at `at` */
static void ground_forces(const gk_mesh *mesh, const double *ground, const pushes *p, const int at[2], double *out_x,
                          double *out_y)
{
    const int width = mesh->local / 4;
    const gk_quad *rows = (const gk_quad *)ground;
    for (int w = 0, first = 0; w < 2; w++) {
        const int quads = mesh->part[w].width / 4;
        gk_quad *x = (gk_quad *)(out_x + at[w]) - first, *y = (gk_quad *)(out_y + at[w]) - first;
        const int end = first + quads;
        for (; first + 3 <= end; first += 3) push_quads(p, rows, width, first, x + first, y + first, 3);
        for (; first + 2 <= end; first += 2) push_quads(p, rows, width, first, x + first, y + first, 2);
        for (; first < end; first++) push_quads(p, rows, width, first, x + first, y + first, 1);
    }
}

/* adds the forces x and y of rows to those on the engagement's own part of the ground group */
void gk_rows_push_local(const gk_mesh *mesh, const gk_engaged *engaged, const double *x, const double *y, double *out_x,
                        double *out_y)
{
    GK_ASSERT(engaged && engaged->index == mesh->index);
    const int at[2] = {0, mesh->part[0].width};
    pushes p;
    list_pushes(x, y, engaged->system.n, &p);
    if (mesh->local && p.count) ground_forces(mesh, engaged->ground, &p, at, out_x, out_y);
}

/* the same of forces along the profile */
void gk_rows_push_local_along(const gk_mesh *mesh, const gk_engaged *engaged, const double *x, const double *y,
                              double *out_x, double *out_y)
{
    GK_ASSERT(engaged && engaged->index == mesh->index);
    GK_ASSERT(engaged->glide);
    const int at[2] = {0, mesh->part[0].width};
    pushes p;
    list_pushes(x, y, engaged->system.contacts, &p);
    if (mesh->local && p.count) ground_forces(mesh, engaged->glide->ground, &p, at, out_x, out_y);
}

/* friction of an engagement, into the same as gk_rows_scatter */
static void scatter_along(const gk_setup *setup, gk_work *work, int e)
{
    const gk_glide *glide = work->engaged[e].glide;
    const gk_mesh *mesh = &setup->mesh[e];
    const int at[2] = {mesh->part[0].from, mesh->part[1].from};
    pushes p;
    list_pushes(glide->step, glide->last, work->engaged[e].system.contacts, &p);
    if (mesh->local && p.count) ground_forces(mesh, glide->ground, &p, at, work->ground_force, work->ground_next);
    for (int w = 0; w < 2; w++) {
        const int g = setup->mesh[e].side[w].gear;
        gk_rows_push_modes_along(setup, work, e, w, glide->step, glide->last, work->force[g], work->next[g]);
    }
}

/* modal forces of the rows' forces x and y of all engagements, into work->force, next, ground_force and ground_next */
void gk_rows_scatter(const gk_model *model, const gk_setup *setup, gk_work *work, const double *(*x)(const gk_system *),
                     const double *(*y)(const gk_system *))
{
    GK_ASSERT(x && y);
    const size_t width = (size_t)setup->base.n * sizeof(double);
    for (int g = 0; g < model->gears; g++) {
        const size_t size = (size_t)GK_LANES(setup, g) * sizeof(gk_real);
        memset(work->force[g], 0, size);
        memset(work->next[g], 0, size);
    }
    memset(work->ground_force, 0, width);
    memset(work->ground_next, 0, width);
    for (int e = 0; e < model->engagements; e++) {
        const gk_engaged *engaged = &work->engaged[e];
        const gk_system *s = &engaged->system;
        pushes p;
        list_pushes(x(s), y(s), s->n, &p);
        const gk_mesh *mesh = &setup->mesh[e];
        const int at[2] = {mesh->part[0].from, mesh->part[1].from};
        if (mesh->local) ground_forces(mesh, engaged->ground, &p, at, work->ground_force, work->ground_next);
        while (p.count && p.row[p.count - 1] >= s->contacts) p.count--;
        for (int w = 0; w < 2; w++) {
            const int g = setup->mesh[e].side[w].gear;
            push_basis(setup, work, e, w, engaged->basis[w], &p, work->force[g], work->next[g]);
        }
        if (GK_ON(setup, friction)) scatter_along(setup, work, e);
    }
}
