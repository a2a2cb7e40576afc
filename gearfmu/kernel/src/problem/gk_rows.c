/* Rows of an engagement on the oscillators, from the tables of both sides. A contact's row on a gear group is the
 * interpolated row of its candidate, for the reference tooth 0 (gk_turn.c). On the ground group a row is minus the
 * outward displacement of both gears plus the gap's gradient times their rigid motion; it is kept over the oscillators
 * that the two gears read, those of gear A first. Rows of the sliding, with friction, are made likewise. */
#include "problem/gk_rows.h"
#include "problem/gk_felt.h"

/* rigid motion of both gears of an engagement by displacements (or speeds) of the ground group */
static void read_rigid(const gk_setup *setup, const gk_work *work, int e, const double *ground, double rigid[POSE])
{
    const gk_base *base = &setup->base;
    memset(rigid, 0, POSE * sizeof *rigid);
    for (int w = 0; w < 2; w++) {
        const int g = setup->mesh[e].side[w].gear;
        const double *seen = work->by_tables && base->patterns[g] ? work->seen[g] : NULL;
        for (int m = 0; m < base->motions[g]; m++) {
            const int c = base->motion[g][m];
            if (seen)
                rigid[SPACE * w + c] = seen[c];
            else
                rigid[SPACE * w + c] = gk_dot_quads(base->moved[g][c], ground + base->from[g], base->width[g] / 4);
        }
    }
}

/* positions and angles of both gears of an engagement: spin, and rigid motion by the ground oscillators */
void gk_rows_pose(const gk_setup *setup, const gk_work *work, int e, const double *spin, const double *ground,
                  double *pose)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(spin && pose);
    read_rigid(setup, work, e, ground, pose);
    const int frame = setup->mesh[e].frame;
    for (int w = 0; w < 2; w++) {
        const double turned = spin[setup->mesh[e].spin[w]];
        pose[SPACE * w + PHIA] += frame < 0 ? turned : turned - spin[frame];
    }
}

/* Takes away what rigid motion of the gears by `ground` makes of the gaps of the contacts: places are found with it */
void gk_rows_without_rigid(const gk_setup *setup, const gk_work *work, int e, const double *ground, double *read)
{
    GK_ASSERT(gk_is_mesh(setup, e) && read);
    const gk_engaged *engaged = &work->engaged[e];
    const int each = setup->spatial ? 1 : GK_STRIPS(setup);
    double rigid[POSE];
    read_rigid(setup, work, e, ground, rigid);
    for (int p = 0, i = 0; p < engaged->places; p++)
        for (int first = 0; first < GK_STRIPS(setup); first += each) {
            const double *gradient = engaged->place[p].point[first].gradient;
            double sum = 0.0;
            for (int w = 0; w < 2; w++) {
                const int g = setup->mesh[e].side[w].gear;
                if (engaged->by_patterns[w]) continue; /* it has not been read */
                for (int m = 0; m < setup->base.motions[g]; m++) {
                    const int c = SPACE * w + setup->base.motion[g][m];
                    sum += gradient[c] * rigid[c];
                }
            }
            for (int strip = 0; strip < each; strip++) read[i++] -= sum;
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

enum { ADD, WRITE, ADD_ALONG, WRITE_ALONG }; /* rows of the gaps, added or written; of the sliding */

typedef struct ground_fill { /* rows of the contacts on the part of the ground group that one gear reads */
    const gk_base *base;
    const gk_side *side;
    const gk_engaged *engaged;
    double *out;
    size_t local; /* quads of a row */
} ground_fill;

/* each: strips of a place whose gradient is the same: all, or each has its own */
GK_INLINE void ground_rows_of(const ground_fill *f, const int motions, const int each, const int strips, const int what)
{
    const gk_base *base = f->base;
    const gk_side *side = f->side;
    const gk_engaged *engaged = f->engaged;
    const gk_position *at = &engaged->position[side->which];
    const int quads = base->width[side->gear] / 4, points = side->candidates * strips;
    const int *motion = base->motion[side->gear];
    const size_t local = f->local;
    const gk_quad *const table = (const gk_quad *)(what >= ADD_ALONG ? side->along.ground : side->ground);
    const gk_quad *const node = table + (size_t)(at->node * points) * quads;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        const gk_quad *low = node + (size_t)(place->candidate[side->which] * strips) * quads;
        const gk_quad *high = low + (size_t)points * quads;
        gk_quad *to = (gk_quad *)f->out + (size_t)(p * strips) * local;
        for (int first = 0; first < strips; first += each) {
            const gk_point *point = &place->point[first];
            const double *gradient = (what >= ADD_ALONG ? point->slide : point->gradient) + SPACE * side->which;
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
                    if (what == WRITE || what == WRITE_ALONG)
                        to[(size_t)i * local + q] = row;
                    else
                        to[(size_t)i * local + q] += row;
                }
            }
        }
    }
}

GK_INLINE void ground_rows(const ground_fill *f, const int spatial, const int what, const int strips)
{
    const int motions = f->base->motions[f->side->gear];
    if (spatial && motions == 5)
        ground_rows_of(f, 5, 1, strips, what);
    else if (spatial)
        ground_rows_of(f, motions, 1, strips, what);
    else if (motions == 2)
        ground_rows_of(f, 2, strips, strips, what);
    else
        ground_rows_of(f, motions, strips, strips, what);
}

/* do the rows of both gears fill those of the engagement, each its own part of them? */
static int fills(const gk_base *base, const gk_mesh *mesh)
{
    int width = 0;
    for (int w = 0; w < 2; w++) width += base->width[mesh->side[w].gear];
    return !mesh->joined && width == mesh->local;
}

/* clears the rows of the contacts beside what the first gear writes of them */
static void clear_beside(const gk_base *base, const gk_mesh *mesh, gk_engaged *engaged)
{
    const int at = mesh->at[0], end = at + base->width[mesh->side[0].gear];
    double *row = engaged->ground;
    for (int i = 0; i < engaged->system.contacts; i++, row += engaged->local) {
        memset(row, 0, (size_t)at * sizeof *row);
        memset(row + end, 0, (size_t)(engaged->local - end) * sizeof *row);
    }
}

/* rows of the joints at bores on the oscillators that a side reads */
static void joint_rows(const gk_setup *setup, const gk_mesh *mesh, gk_engaged *engaged, int w)
{
    const gk_system *s = &engaged->system;
    const size_t size = (size_t)engaged->wide[w] * sizeof(double);
    double *row = engaged->ground + s->contacts * engaged->local + (w ? engaged->wide[0] : 0);
    for (int i = s->contacts; i < s->n; i++, row += engaged->local)
        if (gk_rows_at_bore(setup, s, i))
            memcpy(row, setup->base.port_rows + s->joint.port[i] * setup->base.n + mesh->part[w].from, size);
        else
            memset(row, 0, size);
}

/* rows in single precision, those of either side in whole halves */
static void round_rows(const gk_engaged *engaged, const double *rows, int count, gk_real *near)
{
    gk_half *to = (gk_half *)near;
    for (int i = 0; i < count; i++)
        for (int w = 0; w < 2; rows += engaged->wide[w++]) {
            const gk_eight *from = (const gk_eight *)rows;
            const int whole = engaged->wide[w] / 8;
            for (int k = 0; k < whole; k++) *to++ = GK_ROUNDED(from[k]);
            if (engaged->wide[w] % 8 == 0) continue;
            *to = (gk_half){0};
            *(gk_four *)to++ = __builtin_convertvector(*(const gk_quad *)(from + whole), gk_four);
        }
}

/* Fills the rows of contacts and joints on the ground group; the rows have been listed */
void gk_rows_form_ground(const gk_setup *setup, gk_work *work, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system));
    const gk_base *base = &setup->base;
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_felt_plan(setup, work, engaged);
    const int local = engaged->local;
    if (!local) return;
    const int afresh = fills(base, mesh), alone = !engaged->by_patterns[0] && !engaged->by_patterns[1];
    if (!afresh && alone)
        clear_beside(base, mesh, engaged);
    else if (!afresh)
        memset(engaged->ground, 0, (size_t)(engaged->system.contacts * local) * sizeof *engaged->ground);
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &mesh->side[w];
        const int at = engaged->by_patterns[0] && w ? engaged->wide[0] : mesh->at[w];
        const ground_fill f = {base, side, engaged, engaged->ground + at, (size_t)local / 4};
        if (engaged->by_patterns[w]) {
            gk_felt_rows(setup, work, e, w);
            continue;
        }
        if (afresh || (alone && !w)) {
            GK_STRIPPED(GK_STRIPS(setup), ground_rows, &f, setup->spatial, WRITE)
        } else {
            GK_STRIPPED(GK_STRIPS(setup), ground_rows, &f, setup->spatial, ADD)
        }
        joint_rows(setup, mesh, engaged, w);
    }
    if (mesh->coupled) round_rows(engaged, engaged->ground, engaged->system.n, engaged->near);
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
    const int afresh = fills(&setup->base, mesh);
    for (int d = 0; d < mesh->spins; d++) gk_clear(glide->rigid[d], engaged->system.stride / 4);
    if (!afresh) memset(glide->ground, 0, (size_t)(contacts * mesh->local) * sizeof *glide->ground);
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &mesh->side[w];
        if (GK_LANES(setup, side->gear)) contact_rows(setup, side, side->along.rows, engaged, glide->basis[w]);
        const ground_fill f = {&setup->base, side, engaged, glide->ground + mesh->at[w], (size_t)mesh->local / 4};
        if (!mesh->local) continue;
        if (afresh) {
            GK_STRIPPED(strips, ground_rows, &f, setup->spatial, WRITE_ALONG)
        } else {
            GK_STRIPPED(strips, ground_rows, &f, setup->spatial, ADD_ALONG)
        }
    }
    if (mesh->coupled) round_rows(engaged, glide->ground, contacts, glide->near);
    for (int i = 0; i < contacts; i++) {
        const double *slide = gk_point_of(setup, &engaged->place[i / strips], i % strips)->slide;
        glide->rigid[0][i] = slide[PHIA], glide->rigid[1][i] = slide[PHIB];
        if (mesh->frame >= 0) glide->rigid[2][i] = -slide[PHIA] - slide[PHIB];
    }
}

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
