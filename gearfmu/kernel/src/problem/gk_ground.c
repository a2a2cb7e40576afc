/* What the ground group and the spins do to the rows of an engagement within the step: D and −K, from the rows, or
 * motion by motion of both gears from the tables of the step. */
#include "problem/gk_work.h"
#include "problem/gk_rows.h"

/* D += W mobility Wᵀ, A −= W κ Wᵀ over the dynamic ground oscillators, from the rows: for a step that has no table */
static void add_ground(const gk_setup *setup, gk_work *work, int e, const gk_coefficients *k)
{
    const gk_mesh *mesh = &setup->mesh[e];
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    const int width = mesh->local;
    double *moves = work->ground_scaled, *yields = moves + width, mobility[MAX_GROUND + 4 * MAX_ROTORS],
           kappa[MAX_GROUND + 4 * MAX_ROTORS];
    if (!width || k->timeless) return;
    gk_local_gather(mesh, k->ground.mobility, mobility);
    gk_local_gather(mesh, k->ground.kappa, kappa);
    for (int i = 0; i < s->n; i++) {
        const double *row = engaged->ground + (size_t)i * width;
        for (int l = 0; l < width; l++) moves[l] = row[l] * mobility[l], yields[l] = row[l] * kappa[l];
        for (int j = 0; j < gk_block_end(i) && j < s->n; j++) {
            const double *other = engaged->ground + (size_t)j * width;
            s->D[i * s->stride + j] += gk_dot_quads(moves, other, width / 4);
            s->A[i * s->stride + j] -= gk_dot_quads(yields, other, width / 4);
        }
    }
}

/* The same from tables: with W = −u + gΦ (u outward, g gradient, Φ rigid motion) what u alone makes is in the tables
 * of the contacts; the rest is −h gᵀ − g hᵀ, h = uMΦᵀ − ½ gΦMΦᵀ, motion by motion of both gears */
typedef struct pulled {                                           /* a motion of a gear */
    double g[MAX_STRIDE], moved[MAX_STRIDE], yielded[MAX_STRIDE]; /* h in D, in K */
} pulled;

/* motions of one gear, and what the bore of its rotor has in common with the contacts: `port`, in D and in K */
GK_INLINE void pull(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, pulled *p,
                    double port[2][MAX_STRIDE], const int quads, const int motions, const int strips)
{
    const gk_system *s = &engaged->system;
    const gk_position *at = &engaged->position[side->which];
    const gk_step_side *table = &engaged->table[side->which];
    const int points = side->candidates * strips, *motion = setup->base.motion[side->gear];
    const int bore = quads == 1 ? PLANE : SPACE, each = quads == 1 ? strips : 1; /* strips with the same gradient */
    const gk_quad *const node = (const gk_quad *)table->pulls + 2 * (size_t)(at->node * points) * quads;
    const int whole = s->contacts / 4 * 4, rest = s->stride / 4 - s->contacts / 4; /* rows; quads with joints in them */
    for (int m = 0; m < motions; m++)
        gk_clear(p[m].g + whole, rest), gk_clear(p[m].moved + whole, rest), gk_clear(p[m].yielded + whole, rest);
    for (int place = 0, i = 0; place < engaged->places; place++) {
        const gk_place *found = &engaged->place[place];
        const gk_quad *low = node + 2 * (size_t)(found->candidate[side->which] * strips) * quads,
                      *high = low + 2 * (size_t)points * quads;
        for (int first = 0; first < strips; first += each) {
            const double *g = found->point[first].gradient + SPACE * side->which;
            gk_quad own[2][COMMON / 4] = {{{0}}};
            for (int m = 0; m < motions; m++)
                for (int kind = 0; kind < 2; kind++)
                    for (int q = 0; q < quads; q++)
                        own[kind][q] += g[motion[m]] * ((const gk_quad *)table->own[kind][motion[m]])[q];
            for (int kind = 0; kind < 2; kind++)
                for (int q = 0; q < quads; q++) own[kind][q] *= ((const gk_quad *)table->share)[q];
            for (int strip = 0; strip < each; strip++, i++, low += 2 * quads, high += 2 * quads) {
                double h[2][COMMON];
                for (int kind = 0; kind < 2; kind++)
                    for (int q = 0; q < quads; q++)
                        ((gk_quad *)h[kind])[q] = low[kind * quads + q] - own[kind][q] +
                                                  at->part * (high[kind * quads + q] - low[kind * quads + q]);
                for (int m = 0; m < motions; m++) {
                    p[m].g[i] = g[motion[m]];
                    p[m].moved[i] = h[0][motion[m]], p[m].yielded[i] = h[1][motion[m]];
                }
                port[0][i] = -h[0][bore], port[1][i] = -h[1][bore];
            }
        }
    }
}

GK_INLINE void pull_stripped(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, pulled *p,
                             double port[2][MAX_STRIDE], const int strips)
{
    const int motions = setup->base.motions[side->gear];
    if (setup->spatial)
        pull(setup, engaged, side, p, port, COMMON / 4, motions, strips);
    else if (motions == 2)
        pull(setup, engaged, side, p, port, COMMON / 8, 2, strips);
    else
        pull(setup, engaged, side, p, port, COMMON / 8, motions, strips);
}

GK_INLINE void add_pulled(gk_system *s, const pulled *p, int motions, const int quads)
{
    for (int m = 0; m < motions; m++) {
        const gk_quad *g = (const gk_quad *)p[m].g, *h = (const gk_quad *)p[m].moved,
                      *k = (const gk_quad *)p[m].yielded;
        gk_quad *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
        for (int i = 0; i < s->contacts; i++, D += quads, A += quads) {
            const double own = p[m].g[i], moved = p[m].moved[i], yielded = p[m].yielded[i];
            for (int q = 0; q <= i / 4; q++) D[q] -= moved * g[q] + own * h[q], A[q] += yielded * g[q] + own * k[q];
        }
    }
}

/* D takes mobility·R, A gives κ·R, R = Σ rowᵀrow/J over the spins that move */
GK_INLINE void add_rows(const gk_coefficients *k, const double *inverse, int spins, gk_system *s, const int quads)
{
    for (int m = 0; m < spins; m++) {
        const double moves = k->rigid_mobility * inverse[m], yields = k->rigid_kappa * inverse[m];
        const gk_quad *row = (const gk_quad *)s->rigid[m];
        gk_quad *D = (gk_quad *)s->D, *A = (gk_quad *)s->A;
        for (int i = 0; i < s->n; i++, D += quads, A += quads) {
            const double x = s->rigid[m][i], moved = moves * x, yielded = yields * x;
            if (x == 0.0) continue;
            for (int q = 0; q <= i / 4; q++) D[q] += moved * row[q], A[q] -= yielded * row[q];
        }
    }
}

static void add_spins(const gk_setup *setup, const gk_coefficients *k, gk_system *s, int e)
{
    const gk_mesh *mesh = &setup->mesh[e];
    double inverse[MAX_LOCAL];
    for (int l = 0; l < mesh->spins; l++) inverse[l] = setup->inverse_inertia[mesh->spin[l]];
    GK_SIZED(s->stride / 4, add_rows, k, inverse, mesh->spins, s)
}

/* a clutch is a row of speeds, without κ; clutches are the last rows */
static void leave_clutches(gk_system *s)
{
    for (int i = s->n - s->joint.clutches; i < s->n; i++)
        for (int j = 0; j <= i; j++) s->A[i * s->stride + j] = s->A[j * s->stride + i] = 0.0;
}

/* ground group by its tables, and spins; numbers are written one by one well before quads of them are read */
static void add_tabled(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, gk_engaged *engaged,
                       int e)
{
    gk_system *s = &engaged->system;
    const int bore = gk_directions(setup); /* among what is common */
    double port[2][2][MAX_STRIDE];
    pulled p[POSE];
    int motions = 0;
    for (int w = 0; w < 2; w++) {
        const gk_side *side = &setup->mesh[e].side[w];
        if (!setup->base.width[side->gear]) continue;
        GK_STRIPPED(GK_STRIPS(s), pull_stripped, setup, engaged, side, p + motions, port[w])
        motions += setup->base.motions[side->gear];
    }
    add_spins(setup, k, s, e);
    GK_SIZED(s->stride / 4, add_pulled, s, p, motions)
    for (int r = s->contacts; r < s->n; r++)
        for (int w = 0; w < 2; w++) {
            const int g = setup->mesh[e].side[w].gear;
            double *D = s->D + r * s->stride, *A = s->A + r * s->stride;
            if (!setup->base.width[g] || !gk_rows_at_bore(setup, s, r) || gk_port_of(model, g) != s->joint.port[r])
                continue;
            for (int i = 0; i < s->contacts; i++) D[i] += port[w][0][i], A[i] -= port[w][1][i];
            D[r] += engaged->table[w].own[0][bore][bore], A[r] -= engaged->table[w].own[1][bore][bore];
        }
}

/* adds the ground group and the spins to D and A */
void gk_ground_add(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e,
                   int tables)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system));
    gk_engaged *engaged = &work->engaged[e];
    if (tables)
        add_tabled(model, setup, k, engaged, e);
    else
        add_ground(setup, work, e, k), add_spins(setup, k, &engaged->system, e);
    leave_clutches(&engaged->system);
}
