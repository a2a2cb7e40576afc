/* What the bodies of an engagement do to its rows at once and within the step: compliance between contacts through
 * both gears, from the tables or from the rows, residual at the bores, paths of the contacts' own dampers. D and A
 * are symmetric and filled by block rows of quads: row i of a contact has columns up to the end of its block, that
 * of a joint up to itself; at the end the rest is mirrored. */
#include "problem/gk_work.h"
#include "problem/gk_rows.h"

static const double SHARE = 0.95, SHARE_OF_BOTH_FLANKS = 0.75;

/* ---- between contacts -------------------------------------------------------------------------------------------- */
/* tooth pairs that follow each other: their strips are neighbours in the system and in the tables of both sides */
typedef struct run {
    int column, count, point[2]; /* columns of the system; where they begin in the tables */
} run;

static int list_runs(const gk_engaged *engaged, int strips, run runs[MAX_PAIRS])
{
    int count = 0;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        if (p && place->candidate[0] == place[-1].candidate[0] + 1 && place->candidate[1] == place[-1].candidate[1] + 1)
            runs[count - 1].count += strips;
        else
            runs[count++] = (run){p * strips, strips, {place->candidate[0] * strips, place->candidate[1] * strips}};
    }
    return count;
}

/* quads of a row between contacts: where they stand in the system and in the tables of both sides */
typedef struct part {
    int column, point[2];
} part;

static int list_parts(const gk_engaged *engaged, int strips, part *parts)
{
    run runs[MAX_PAIRS];
    const int count = list_runs(engaged, strips, runs);
    int n = 0;
    for (int r = 0; r < count; r++)
        for (int c = 0; c < runs[r].count; c += 4)
            parts[n++] = (part){runs[r].column + c, {runs[r].point[0] + c, runs[r].point[1] + c}};
    return n;
}

typedef struct
    blend { /* a table of one side at two neighbouring nodes: (points, parts, columns) each, and their weights */
    const gk_real *low, *high;
    double square_low, mixed, square_high;
    size_t columns, row; /* of one part; of all parts */
} blend;

static blend blend_of(const gk_setup *setup, const gk_engaged *engaged, const gk_side *side, const gk_real *table,
                      int parts)
{
    const gk_position *at = &engaged->position[side->which];
    const size_t columns = (size_t)side->columns, row = (size_t)parts * columns;
    const size_t node = (size_t)(side->candidates * GK_STRIPS(setup)) * row;
    const double x = at->part, y = 1.0 - x;
    const gk_real *low = table + (size_t)at->node * node;
    return (blend){low, low + node, y * y, x * y, x * x, columns, row};
}

#define WIDENED(values) GK_WIDENED(*(const gk_four *)(values))
#define BLENDED(b, at)                                                                                                 \
    ((b).square_low * WIDENED((b).low + (at)) + (b).mixed * WIDENED((b).low + (at) + (b).columns) +                    \
     (b).square_high * WIDENED((b).high + (at)))

/* rows of D and A between the contacts, or of A alone. What a quad writes beyond its run the next one writes again. */
GK_INLINE void table_rows(const gk_engaged *engaged, const blend *p, const blend *q, const part *parts, int count,
                          const int moves, const int strips)
{
    const gk_system *s = &engaged->system;
    double *D = s->D, *A = s->A;
    const int64_t rest = s->contacts % 4;
    const gk_bits inside = (gk_bits){0, 1, 2, 3} < rest; /* contacts of their last quad */
    for (int place = 0, i = 0; place < engaged->places; place++) {
        size_t first = (size_t)(engaged->place[place].candidate[0] * strips) * p->row;
        size_t second = (size_t)(engaged->place[place].candidate[1] * strips) * q->row;
        for (int strip = 0; strip < strips; strip++, i++, first += p->row, second += q->row) {
            const int end = gk_block_end(i);
            for (int c = 0; c < count && parts[c].column < end; c++) {
                const size_t a = first + (size_t)parts[c].point[0], b = second + (size_t)parts[c].point[1];
                if (moves) {
                    *(gk_quad *)(D + parts[c].column) = BLENDED(*p, a) + BLENDED(*q, b);
                    *(gk_quad *)(A + parts[c].column) = BLENDED(*p, a + 2 * p->columns) +
                                                        BLENDED(*q, b + 2 * q->columns);
                } else {
                    *(gk_quad *)(A + parts[c].column) = BLENDED(*p, a) + BLENDED(*q, b);
                }
            }
            if (end > s->contacts) {
                gk_quad *last_D = (gk_quad *)(D + end) - 1, *last_A = (gk_quad *)(A + end) - 1;
                *last_D = GK_CHOOSE(inside, *last_D, GK_ALL(0.0));
                *last_A = GK_CHOOSE(inside, *last_A, GK_ALL(0.0));
            }
            D += s->stride, A += s->stride;
        }
    }
}

/* compliance between the contacts through both gears, from the tables: of the step, or of what is not dynamic alone;
 * the rest of D and A is cleared */
static void between_contacts(const gk_setup *setup, const gk_engaged *engaged, int e, int tables)
{
    const gk_system *s = &engaged->system;
    const gk_side *side = setup->mesh[e].side;
    const int strips = GK_STRIPS(s);
    blend of[2];
    part parts[MAX_CONTACTS];
    const int count = list_parts(engaged, strips, parts);
    for (int w = 0; w < 2; w++)
        of[w] = tables ? blend_of(setup, engaged, &side[w], engaged->table[w].moves, 4)
                       : blend_of(setup, engaged, &side[w], side[w].residual, 2);
    if (tables) {
        GK_STRIPPED(strips, table_rows, engaged, &of[0], &of[1], parts, count, 1)
    } else {
        memset(s->D, 0, (size_t)(s->contacts * s->stride) * sizeof *s->D);
        GK_STRIPPED(strips, table_rows, engaged, &of[0], &of[1], parts, count, 0)
    }
    const int first = s->contacts * s->stride, quads = (s->stride - s->contacts) * s->stride / 4;
    gk_clear(s->D + first, quads), gk_clear(s->A + first, quads);
}

/* rows diag(mobility) rowsᵀ and −rows diag(κ) rowsᵀ, added to D and A: for a step that has no table */
static void gram(const gk_setup *setup, gk_work *work, gk_engaged *engaged, const gk_side *side,
                 const gk_coefficients *k)
{
    gk_system *s = &engaged->system;
    const int n = GK_LANES(setup, side->gear), P = setup->modal[side->gear].pairs;
    const gk_flow *flow = &k->flow[side->gear];
    gk_real *moves = work->scaled, *yields = moves + n;
    if (!n || k->timeless) return;
    for (int i = 0; i < s->contacts; i++) {
        const gk_real *b = engaged->basis[side->which] + (size_t)i * n;
        for (int l = 0; l < n; l++) moves[l] = b[l] * flow->mobility[l], yields[l] = b[l] * flow->kappa[l];
        for (int j = 0; j < gk_block_end(i) && j < s->contacts; j++) {
            const gk_real *other = engaged->basis[side->which] + (size_t)j * n;
            s->D[i * s->stride + j] += gk_dot(moves, other, n);
            if (flow->yields)
                s->A[i * s->stride + j] -= gk_dot(yields, other, flow->yields) +
                                           gk_dot(yields + P, other + P, flow->yields);
        }
    }
}

/* residual between contacts and the bores of their own gear, and of the bores */
static void joint_residual(const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    for (int r = s->contacts; r < s->n; r++) {
        if (!gk_rows_at_bore(setup, s, r)) continue;
        double *A = s->A + r * s->stride;
        A[r] += setup->port_own[s->joint.port[r]];
        for (int w = 0; w < 2; w++)
            for (int i = 0; i < s->contacts && setup->mesh[e].side[w].port_of == s->joint.port[r]; i++)
                A[i] -= engaged->bore[w][i];
    }
}

/* ---- dampers ----------------------------------------------------------------------------------------------------- */
/* The share of a tooth's own residual that its damper is parallel to. What other contacts have in common with it stays
 * outside, so that Q = C_res − P is positive: little with the neighbours, more with the other flank of the same tooth
 * (docs/theory.md, 2.5). */
static double path_share(const gk_engaged *engaged, int p)
{
    const gk_place *place = engaged->place;
    for (int q = 0; q < engaged->places; q++)
        if (place[q].flank != place[p].flank &&
            (place[q].number[0] == place[p].number[0] || place[q].number[1] == place[p].number[1]))
            return SHARE_OF_BOTH_FLANKS;
    return SHARE;
}

/* the paths of the contacts' own dampers, both teeth; what is in P is not in A */
GK_INLINE void paths(const gk_setup *setup, gk_engaged *engaged, int e, const int strips)
{
    gk_system *s = &engaged->system;
    const int square = strips * strips;
    const gk_side *side = setup->mesh[e].side;
    const double part[2] = {engaged->position[0].part, engaged->position[1].part};
    for (int p = 0; p < engaged->places; p++) {
        double *A = s->A + (size_t)(p * strips) * (s->stride + 1), *P = s->P + (size_t)(p * strips) * (s->stride + 1);
        const double share = path_share(engaged, p), *low[2], *high[2];
        for (int w = 0; w < 2; w++) {
            low[w] = side[w].path +
                     ((size_t)engaged->position[w].node * side[w].candidates + engaged->place[p].candidate[w]) * square;
            high[w] = low[w] + side[w].candidates * square;
        }
        for (int a = 0, c = 0; a < strips; a++, A += s->stride, P += s->stride)
            for (int b = 0; b < strips; b++, c++) {
                P[b] = share * ((low[0][c] + part[0] * (high[0][c] - low[0][c])) +
                                (low[1][c] + part[1] * (high[1][c] - low[1][c])));
                A[b] -= P[b];
            }
    }
}

static void take_paths(const gk_setup *setup, gk_engaged *engaged, int e)
{
    gk_system *s = &engaged->system;
    memset(s->P, 0, (size_t)(s->n * s->stride) * sizeof *s->P);
    if (GK_ON(setup, residual) && GK_ON(setup, contact_damping)) /* else no damper asks for it */
        GK_STRIPPED(GK_STRIPS(setup), paths, setup, engaged, e)
    for (int i = s->contacts; i < s->n; i++)
        s->P[i * s->stride + i] = setup->joint[s->joint.port[i]][s->joint.which[i]].compliance;
}

/* D, A and P of the contacts and of the joints' residual; from the tables of the step, or for any step from the rows;
 * or what is not dynamic of them alone */
void gk_compliance_form(const gk_setup *setup, const gk_coefficients *k, gk_work *work, int e, gk_compliance_of what)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(gk_system_is_sound(&work->engaged[e].system));
    gk_engaged *engaged = &work->engaged[e];
    between_contacts(setup, engaged, e, what == BY_TABLES);
    take_paths(setup, engaged, e); /* entry by entry: long before quads of the same rows are read again */
    for (int w = 0; w < 2 && what == BY_ROWS; w++) gram(setup, work, engaged, &setup->mesh[e].side[w], k);
    if (GK_ON(setup, residual)) joint_residual(setup, engaged, e);
}

GK_INLINE void mirror(gk_system *s, const int quads)
{
    const int stride = 4 * quads;
    for (int block = 1; block < quads; block++)
        for (int i = 4 * block; i < 4 * block + 4; i++)
            for (int j = 0; j < 4 * block; j++) {
                s->D[j * stride + i] = s->D[i * stride + j];
                s->A[j * stride + i] = s->A[i * stride + j];
            }
    for (int i = s->contacts; i < s->n; i++)
        for (int j = i / 4 * 4; j < i; j++) {
            s->D[j * stride + i] = s->D[i * stride + j];
            s->A[j * stride + i] = s->A[i * stride + j];
        }
}

/* the upper block rows of D and A */
void gk_compliance_mirror(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_SIZED(s->stride / 4, mirror, s)
}
