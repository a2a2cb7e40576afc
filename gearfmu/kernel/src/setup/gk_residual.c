/* Compliance of what is not dynamic between the points of a node: of the gear group by the tables of its body less what
 * its dynamic modes carry, then what ground oscillators and supports yield. */
#include "setup/gk_residual.h"
#include "setup/gk_slices.h"

static size_t most_lanes(const gk_gear *gear) { return 2 * ((size_t)gear->modes + LANES); }

size_t gk_residual_size(const gk_model *model, const gk_gear *gear, size_t points)
{
    GK_ASSERT(model && gear);
    const size_t square = points * points, along = model->rubbing ? 2 * square : 0;
    return 2 * square + along + MAX_SLICES * MAX_SLICES + (2 * points + 1) * most_lanes(gear) +
           points * (size_t)gk_padded(gk_node_motions(gear));
}

double *gk_residual_begin(gk_residual *r, const gk_node *n, double *room)
{
    GK_ASSERT(r && room);
    const gk_modal *m = &n->setup->modal[n->side->gear];
    const size_t points = (size_t)n->points, square = points * points, lanes = (size_t)m->n;
    r->whole = room, room += square;
    r->taken = room, room += square;
    r->normal = room, room += GK_ON(n->setup, friction) ? square : 0;
    r->along = room, room += GK_ON(n->setup, friction) ? square : 0;
    r->middle = room, room += points * lanes;
    r->share = room, room += points * lanes;
    r->square = room, room += lanes;
    r->patches = room, room += MAX_SLICES * MAX_SLICES;
    if (n->gear->smeared) gk_slices_fill(n, r->patches);
    r->loaded = room, room += points * (size_t)gk_padded(gk_node_motions(n->gear));
    for (int k = 0; k < m->n; k++) r->square[k] = m->omega2[k] > 0 ? (double)m->omega2[k] : 1.0;
    return room;
}

/* ---- of the gear group ------------------------------------------------------------------------------------------- */
static inline double sum_of(const double *lane) { return (lane[0] + lane[1]) + (lane[2] + lane[3]); }

/* Σ a_k b_k/ω² over modes below `dynamic` */
static double carried(const gk_node *n, int i, int j, int dynamic)
{
    const double *a = n->rows + (size_t)i * n->gear->modes, *b = n->rows + (size_t)j * n->gear->modes;
    gk_quad sum = {0};
    double lane[4];
    int k = 0;
    for (; k + 4 <= dynamic; k += 4)
        sum += *(const gk_quad *)(a + k) * *(const gk_quad *)(b + k) * *(const gk_quad *)(n->flexibility + k);
    memcpy(lane, &sum, sizeof lane);
    for (; k < dynamic; k++) lane[k % 4] += a[k] * b[k] * n->flexibility[k];
    return sum_of(lane);
}

/* by the tables between two candidates, (strips, strips); 0 when they are too far apart for these: what stored modes
 * carry is all there is then */
static int tabulated(const gk_node *n, int first, int second, double *out)
{
    const int A = n->model->functions, strips = n->setup->strips;
    const int offset = n->at[second * strips].offset - n->at[first * strips].offset;
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    for (int c = 0; c < strips * strips; c++) out[c] = 0.0;
    if (offset < -FURTHER || offset > FURTHER) return 0;
    const gk_block b = gk_block_of(n, n->at[first * strips].flank, n->at[second * strips].flank, offset);
    for (int s = 0; s < strips; s++)
        for (int t = 0; t < strips; t++) {
            if (n->gear->helix != 0.0 || s + t == 0) /* else all strips have the same rolls */
                gk_block_tabulate(n, b, &n->at[first * strips + s], &n->at[second * strips + t], cell);
            const double *of_s = n->at[first * strips + s].width, *of_t = n->at[second * strips + t].width;
            for (int a = 0; a < A; a++) out[s * strips + t] += of_s[a] * gk_node_dot(cell + a * A, of_t, A);
        }
    return 1;
}

/* rows halfway to the next node as the step interpolates them */
static void find_middle(const gk_residual *r, const gk_node *n, int at)
{
    const gk_modal *m = &n->setup->modal[n->side->gear];
    const size_t size = (size_t)n->points * (size_t)m->n;
    const gk_real *rows = n->side->rows + (size_t)at * size, *next = rows + size;
    for (size_t k = 0; k < size; k++) {
        r->middle[k] = (double)rows[k] + next[k];
        r->share[k] = 0.25 * r->middle[k];
    }
}

/* Σ a b/ω² of these over the dynamic modes */
static double carried_halfway(const gk_residual *r, const gk_node *n, int i, int j)
{
    const int lanes = n->setup->modal[n->side->gear].n;
    const double *a = r->share + (size_t)i * (size_t)lanes, *b = r->middle + (size_t)j * (size_t)lanes;
    gk_quad sum = {0};
    double lane[4];
    for (int k = 0; k < lanes; k += 4)
        sum += *(const gk_quad *)(a + k) * *(const gk_quad *)(b + k) / *(const gk_quad *)(r->square + k);
    memcpy(lane, &sum, sizeof lane);
    return sum_of(lane);
}

/* to the compliance of a candidate by itself, (strips, strips) */
static void add_local(const gk_residual *r, const gk_node *n, int candidate, double *cell)
{
    const int strips = n->setup->strips, first = candidate * strips;
    for (int s = 0; s < strips; s++)
        for (int t = 0; t <= s; t++) {
            const double local = gk_slices_local(n, r->patches, first + s, first + t);
            cell[s * strips + t] += local;
            if (t < s) cell[t * strips + s] += local;
        }
}

/* Two candidates. Of a tooth with itself what no stored mode carries, too: what its damper is parallel to. */
static void gather_block(const gk_residual *r, const gk_node *n, int at, int halfway, int p, int q)
{
    const gk_side *side = n->side;
    const int strips = n->setup->strips, square = strips * strips, dynamic = n->setup->modal[side->gear].count;
    double cell[MAX_BLOCK];
    const int near = tabulated(n, p, q, cell);
    if (p == q && n->gear->smeared) add_local(r, n, p, cell);
    for (int c = 0; c < square; c++) {
        const int i = p * strips + c / strips, j = q * strips + c % strips;
        const size_t here = (size_t)i * (size_t)n->points + (size_t)j;
        const double stored = !near || (p == q && !halfway) ? carried(n, i, j, n->gear->modes) : 0.0;
        if (p == q && !halfway) side->path[((size_t)at * side->candidates + p) * square + c] = cell[c] - stored;
        if (p == q && j > i) continue; /* it is symmetric */
        r->whole[here] = near ? cell[c] : stored;
        r->taken[here] = halfway ? carried_halfway(r, n, i, j) : carried(n, i, j, dynamic);
    }
}

void gk_residual_gather(gk_residual *r, const gk_node *n, int at, int halfway)
{
    GK_ASSERT(at >= 0 && at + halfway <= n->side->nodes);
    if (halfway) find_middle(r, n, at);
    for (int p = 0; p < n->side->candidates; p++)
        for (int q = p; q < n->side->candidates; q++) gather_block(r, n, at, halfway, p, q);
}

/* Σ a b/ω² over modes `from` … `to` − 1 */
static double carried_by(const gk_node *n, const double *a, const double *b, int from, int to)
{
    double sum = 0.0;
    for (int k = from; k < to; k++) sum += a[k] * b[k] * n->flexibility[k];
    return sum;
}

/* What is not dynamic yields along the normal and along the profile per force along the profile. One tooth by its own
 * table; of others what stored modes carry. */
void gk_residual_gather_along(gk_residual *r, const gk_node *n)
{
    GK_ASSERT(r->normal && r->along);
    const gk_gear *gear = n->gear;
    const int modes = gear->modes, dynamic = n->setup->modal[n->side->gear].count;
    const double own = gk_node_along(n);
    for (int j = 0; j < n->points; j++)
        for (int i = 0; i < n->points; i++) {
            const int same = n->at[i].offset == n->at[j].offset && gear->along_normal;
            const double *a = n->rows + (size_t)i * modes, *s = n->along_rows + (size_t)i * modes;
            const double *t = n->along_rows + (size_t)j * modes;
            const int from = same ? 0 : dynamic, to = same ? dynamic : modes;
            const double sign = same ? -1.0 : 1.0;
            double normal = sign * carried_by(n, a, t, from, to), along = sign * carried_by(n, s, t, from, to);
            if (same)
                normal += own * gk_block_between(n, gk_block_along_normal(n, n->at[i].flank, n->at[j].flank), i, j),
                    along += gk_block_between(n, gk_block_along_own(n, n->at[i].flank, n->at[j].flank), i, j);
            r->normal[i * n->points + j] = normal, r->along[i * n->points + j] = along;
        }
}

/* ---- with the ground --------------------------------------------------------------------------------------------- */
/* yields · motion of every point */
static void load_points(const gk_residual *r, const gk_node *n, const gk_grounded *g, const double *motion)
{
    const gk_matrix yields = gk_grounded_yields(g);
    memset(r->loaded, 0, (size_t)n->points * (size_t)g->stride * sizeof *r->loaded);
    gk_grounded_times(motion, &yields, n->points, r->loaded);
}

/* motion of a point times `count` of what others are loaded to, in the lanes of gk_node_dot */
GK_INLINE void through_some(const gk_grounded *g, const double *motion, const double *loaded, int count, double *out)
{
    gk_quad sum[4] = {{0}};
    int k = 0;
    for (; k + 4 <= g->motions; k += 4)
        for (int j = 0; j < count; j++)
            sum[j] += *(const gk_quad *)(motion + k) * *(const gk_quad *)(loaded + (size_t)j * g->stride + k);
    for (; k < g->motions; k++)
        for (int j = 0; j < count; j++) sum[j][0] += motion[k] * loaded[(size_t)j * g->stride + k];
    for (int j = 0; j < count; j++) out[j] = (sum[j][0] + sum[j][1]) + (sum[j][2] + sum[j][3]);
}

/* through the ground oscillators that are not dynamic and the supports, from points `from` on to a point */
static void through(const gk_residual *r, const gk_node *n, const gk_grounded *g, const double *motion, int from,
                    double *out)
{
    int j = from;
    for (; j + 4 <= n->points; j += 4) through_some(g, motion, r->loaded + (size_t)j * g->stride, 4, out + j);
    for (; j < n->points; j++) through_some(g, motion, r->loaded + (size_t)j * g->stride, 1, out + j);
}

/* The residual at a node. Halfway to the next node: what makes the parabola there right. */
void gk_residual_store(gk_residual *r, const gk_node *n, int at, int halfway, const gk_grounded *g)
{
    GK_ASSERT(at >= 0 && at + halfway <= n->side->nodes);
    const gk_side *side = n->side;
    const int strips = n->setup->strips, flat = n->e->kind == MESH_FLAT, points = n->points;
    const size_t columns = (size_t)side->columns, size = 2 * (size_t)points * columns;
    gk_real *table = side->residual + (size_t)at * size;
    double ground[MAX_CANDIDATES * MAX_SLICES] = {0};
    if (!flat) load_points(r, n, g, n->motion);
    for (int i = 0; i < points; i++) {
        const int first = i / strips * strips;
        if (!flat) through(r, n, g, n->motion + (size_t)i * (size_t)g->motions, first, ground);
        for (int j = first; j < points; j = j == i ? first + strips : j + 1) {
            const size_t here = 2 * (size_t)i * columns + (size_t)j, mirrored = 2 * (size_t)j * columns + (size_t)i;
            const size_t pair = (size_t)i * (size_t)points + (size_t)j;
            const double left = r->whole[pair] + ground[j] - r->taken[pair];
            if (halfway)
                table[here + columns] = table[mirrored + columns] = (gk_real)(4.0 * left - table[here] -
                                                                              table[here + size]);
            else
                table[here] = table[mirrored] = (gk_real)left;
        }
    }
}

void gk_residual_store_along(gk_residual *r, const gk_node *n, int at, const gk_grounded *g)
{
    GK_ASSERT(at >= 0 && at <= n->side->nodes && r->normal);
    const gk_side *side = n->side;
    const int points = n->points, flat = n->e->kind == MESH_FLAT;
    double normal[MAX_CANDIDATES * MAX_SLICES] = {0}, along[MAX_CANDIDATES * MAX_SLICES] = {0};
    if (!flat) load_points(r, n, g, n->along_motion);
    for (int i = 0; i < points; i++) {
        const size_t row = ((size_t)at * points + (size_t)i) * (size_t)side->columns, point = (size_t)i * g->motions;
        if (!flat) through(r, n, g, n->motion + point, 0, normal);
        if (!flat) through(r, n, g, n->along_motion + point, 0, along);
        for (int j = 0; j < points; j++) {
            side->along.normal[row + j] = (gk_real)(r->normal[i * points + j] + normal[j]);
            side->along.own[row + j] = (gk_real)(r->along[i * points + j] + along[j]);
        }
    }
}
