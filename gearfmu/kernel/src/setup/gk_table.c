/* Compliance between the points of a gear, on the roll grid: the static residual of what is not dynamic
 * (docs/theory.md, eq. 2) and, for the step of a run, what a force moves within the step (D) and at corrects (the κ
 * part of C′). A sum over modes between two places depends on their rolls and tooth offset only, so it is done once on
 * the grid and interpolated with the weights of the rows on both sides: the same matrix as from the rows themselves, at
 * a cost that does not know the number of modes. */
#include "model/gk_core.h"

/* flexibilities of a table's sums over modes, in the order of the stored modes: cell = base − Σ N Nᵀ flexibility */
typedef struct recipe {
    int modes, kinds, is_static[KINDS];
    const double *flexibility[KINDS];
} recipe;

/* row on tooth `offset`, times the flexibility of each mode, so that a dot product with a tooth-0 row gives the sum
 * over modes */
static void turned_row(const gk_gear *gear, int modes, const double *row, int offset, const double *flexibility,
                       double *out)
{
    for (int k = 0; k < modes; k++) {
        double sine, cosine;
        gk_sincos(2.0 * GK_PI * (double)((int64_t)gear->diameter[k] * offset % gear->z) / gear->z, &sine, &cosine);
        if (gear->part[k] == 1) {
            out[k] = (row[k] * cosine - row[k + 1] * sine) * flexibility[k];
            out[k + 1] = (row[k] * sine + row[k + 1] * cosine) * flexibility[k + 1];
            k++;
        } else {
            out[k] = row[k] * cosine * flexibility[k];
        }
    }
}

static double dot(const double *a, const double *b, int n)
{
    double lane[4] = {0, 0, 0, 0};
    int k = 0;
    for (; k + 4 <= n; k += 4)
        for (int l = 0; l < 4; l++) lane[l] += a[k + l] * b[k + l];
    for (; k < n; k++) lane[0] += a[k] * b[k];
    return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/* weightᵀ · cell · weight; cell (A, A) between width functions → (strips, strips) */
static void store_cell(const double *cell, int A, int strips, gk_strip_weights weight, double *out)
{
    for (int s = 0; s < strips; s++)
        for (int t = 0; t < strips; t++) {
            double sum = 0.0;
            for (int a = 0; a < A; a++)
                for (int b = 0; b < A; b++) sum += weight[s][a] * weight[t][b] * cell[a * A + b];
            out[s * strips + t] = sum;
        }
}

static int block_of(int strips, int kinds) { return (kinds * strips * strips + 7) / 8 * 8; }

/* one column of cells: from every flank and roll to (flank `to`, tooth offset o − 3, roll j) */
static void fill_column(const gk_gear *gear, const recipe *r, int strips, gk_strip_weights weight, int to, int o,
                        size_t j, double *scratch, gk_real *ff)
{
    const size_t R = (size_t)gear->rolls, N = (size_t)gear->modes, block = (size_t)block_of(strips, r->kinds);
    const int A = gear->functions;
    double cell[MAX_FUNCTIONS * MAX_FUNCTIONS], between[MAX_SLICES * MAX_SLICES];
    for (int kind = 0; kind < r->kinds; kind++) {
        for (int b = 0; b < A; b++)
            turned_row(gear, r->modes, gear->rows + (((size_t)to * R + j) * A + b) * N, o - 3, r->flexibility[kind],
                       scratch + (size_t)b * r->modes);
        for (int from = 0; from < 2; from++)
            for (size_t i = 0; i < R; i++) {
                const size_t at = (((size_t)(from * 2 + to) * OFFSETS + (size_t)o) * R + i) * R + j;
                for (int a = 0; a < A; a++)
                    for (int b = 0; b < A; b++)
                        cell[a * A + b] = (r->is_static[kind] ? gear->c_ff[at * A * A + a * A + b] : 0.0) -
                                          dot(gear->rows + (((size_t)from * R + i) * A + a) * N,
                                              scratch + (size_t)b * r->modes, r->modes);
                store_cell(cell, A, strips, weight, between);
                gk_real *to_table = ff + at * block + (size_t)(kind * strips * strips);
                for (int c = 0; c < strips * strips; c++) to_table[c] = (gk_real)between[c];
            }
    }
}

static void fill_bore(const gk_gear *gear, const recipe *r, int strips, gk_strip_weights weight, double *scratch,
                      gk_table *table)
{
    const int A = gear->functions, width = 4 * r->kinds;
    const size_t N = (size_t)gear->modes;
    for (int kind = 0; kind < r->kinds; kind++)
        for (int c = 0; c < BORE_ROWS; c++) {
            turned_row(gear, r->modes, gear->bore + (size_t)c * N, 0, r->flexibility[kind], scratch);
            for (int point = 0; point < 2 * gear->rolls; point++)
                for (int s = 0; s < strips; s++) {
                    double sum = 0.0;
                    for (int a = 0; a < A; a++) {
                        const size_t row = (size_t)point * A + a;
                        sum += weight[s][a] * ((r->is_static[kind] ? gear->c_fb[3 * row + (size_t)c] : 0.0) -
                                               dot(gear->rows + row * N, scratch, r->modes));
                    }
                    table->fb[(size_t)width * ((size_t)point * strips + s) + (size_t)(4 * kind + c)] = sum;
                }
            for (int d = 0; d < BORE_ROWS; d++)
                table->bb[kind][3 * d + c] = (r->is_static[kind] ? gear->c_bb[3 * d + c] : 0.0) -
                                             dot(gear->bore + (size_t)d * N, scratch, r->modes);
        }
}

static void fill_table(const gk_model *model, const gk_setup *setup, int g, const recipe *r, gk_table *table)
{
    const gk_gear *gear = &model->gear[g];
    gk_strip_weights weight;
    gk_strips_rows(model, setup, g, weight);
    table->kinds = r->kinds;
    table->block = block_of(setup->strips, r->kinds);
    memset(table->ff, 0, 4 * OFFSETS * (size_t)(gear->rolls * gear->rolls * table->block) * sizeof(gk_real));
    for (int to = 0; to < 2; to++)
        for (int o = 0; o < OFFSETS; o++)
            for (int j = 0; j < gear->rolls; j++)
                fill_column(gear, r, setup->strips, weight, to, o, (size_t)j, setup->flexibility + KINDS * gear->modes,
                            table->ff);
    fill_bore(gear, r, setup->strips, weight, setup->flexibility + KINDS * gear->modes, table);
}

/* residual of a tooth's own strips beyond all stored modes */
static void fill_path(const gk_model *model, const gk_setup *setup, int g, const double *flexibility)
{
    const gk_gear *gear = &model->gear[g];
    const gk_modal *m = &setup->modal[g];
    const size_t R = (size_t)gear->rolls, A = (size_t)gear->functions, N = (size_t)gear->modes,
                 cells = (size_t)(setup->strips * setup->strips + 3) / 4 * 4;
    double *turned = setup->flexibility + KINDS * gear->modes, cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    gk_strip_weights weight;
    gk_strips_rows(model, setup, g, weight);
    for (size_t f = 0; f < 2; f++)
        for (size_t i = 0; i < R; i++) {
            const double *rows = gear->rows + (f * R + i) * A * N,
                         *base = gear->c_ff + ((((f * 2 + f) * OFFSETS + 3) * R + i) * R + i) * A * A;
            for (size_t b = 0; b < A; b++) turned_row(gear, gear->modes, rows + b * N, 0, flexibility, turned + b * N);
            for (size_t a = 0; a < A; a++)
                for (size_t b = 0; b < A; b++)
                    cell[a * A + b] = base[a * A + b] - dot(rows + a * N, turned + b * N, gear->modes);
            store_cell(cell, gear->functions, setup->strips, weight, m->path + (f * R + i) * cells);
        }
}

/* the static tables of a level; without the residual the path is the local law alone */
void gk_table_residual(const gk_model *model, gk_setup *setup)
{
    if (!setup->on.residual) return;
    for (int g = 0; g < 2; g++) {
        const gk_gear *gear = &model->gear[g];
        double *flexibility = setup->flexibility;
        for (int k = 0; k < gear->modes; k++) flexibility[k] = 1.0 / (gear->omega[k] * gear->omega[k]);
        const recipe r = {setup->modal[g].count, 1, {1}, {flexibility}};
        fill_table(model, setup, g, &r, &setup->modal[g].residual);
        fill_path(model, setup, g, flexibility);
    }
}

/* D, −K and Q of the step k */
void gk_table_for(const gk_model *model, const gk_setup *setup, const gk_coefficients *k)
{
    for (int g = 0; g < 2; g++) {
        const gk_gear *gear = &model->gear[g];
        const gk_modal *m = &setup->modal[g];
        const gk_flow *f = &k->flow[g];
        double *moves = setup->flexibility, *yields = moves + gear->modes, *flexibility = yields + gear->modes;
        for (int i = 0, lane = -1; i < m->count; i++) {
            if (gear->part[i] != 2) lane++;
            const int at = gear->part[i] == 2 ? m->pairs + lane : lane;
            moves[i] = -(double)f->mobility[at];
            yields[i] = (double)f->kappa[at];
            flexibility[i] = setup->on.residual ? 1.0 / (gear->omega[i] * gear->omega[i]) : 0.0;
        }
        const recipe r = {m->count, KINDS, {0, 0, setup->on.residual}, {moves, yields, flexibility}};
        fill_table(model, setup, g, &r, &setup->work->table[g]);
    }
    setup->work->table_h = k->h;
    setup->work->table_gamma = k->gamma;
}

/* ---- reading
 * -------------------------------------------------------------------------------------------------------------------------------------------
 */
enum { HALVES = (KINDS * MAX_SLICES * MAX_SLICES + 7) / 8 };

/* Σ w_i w_j cell_ij over the 4 × 4 grid rolls around two places, added to sum */
GK_INLINE void interpolate(const gk_place *p, const gk_place *q, int g, const gk_real *cells, int rolls, gk_half *total,
                           const int halves)
{
    const gk_half *t = (const gk_half *)cells + (size_t)((p->index[g] * rolls + q->index[g]) * halves);
    const gk_real w0 = (gk_real)q->weight[g][0], w1 = (gk_real)q->weight[g][1], w2 = (gk_real)q->weight[g][2],
                  w3 = (gk_real)q->weight[g][3];
    for (int i = 0; i < 4; i++, t += rolls * halves) {
        const gk_real w = (gk_real)p->weight[g][i];
        for (int k = 0; k < halves; k++)
            total[k] += w * ((w0 * t[k] + w1 * t[halves + k]) + (w2 * t[2 * halves + k] + w3 * t[3 * halves + k]));
    }
}

/* a block at (row, column) and its mirror image */
GK_INLINE void put_blocks(const gk_real *value, int kinds, double *const out[KINDS], int stride, int row, int column,
                          const int strips)
{
    for (int kind = 0; kind < kinds; kind++, value += strips * strips) {
        double *here = out[kind] + row * stride + column, *mirrored = out[kind] + column * stride + row;
        for (int a = 0; a < strips; a++)
            for (int b = 0; b < strips; b++) here[a * stride + b] = value[a * strips + b];
        if (row != column)
            for (int a = 0; a < strips; a++)
                for (int b = 0; b < strips; b++) mirrored[b * stride + a] = value[a * strips + b];
    }
}

/* between the strips of places p and q, through both gears */
static void flank_pair(const gk_model *model, const gk_work *work, const gk_table *const table[2], int p, int q,
                       int strips, double *const out[KINDS])
{
    const gk_place *from = &work->place[p], *to = &work->place[q];
    const int halves = table[0]->block / 8;
    gk_half sum[HALVES];
    for (int k = 0; k < halves; k++) sum[k] = (gk_half){0};
    for (int g = 0; g < 2; g++) {
        const int offset = to->number[g] - from->number[g], rolls = model->gear[g].rolls;
        if (offset < -3 || offset > 3) continue;
        const gk_real *cells = table[g]->ff + (size_t)((from->flank * 2 + to->flank) * OFFSETS + offset + 3) *
                                                  (size_t)(rolls * rolls * table[g]->block);
        GK_SIZED(halves, interpolate, from, to, g, cells, rolls, sum)
    }
    GK_STRIPPED(strips, put_blocks, (const gk_real *)sum, table[0]->kinds, out, work->system.stride, p * strips,
                q * strips)
}

typedef struct bores {
    int count, of[BORE_ROWS], row[BORE_ROWS];
} bores; /* rows that pull at a gear's bore: which of x, y, rz, and where they stand */

static bores live_bores(const gk_system *s, int g)
{
    bores b = {0};
    for (int i = 0; i < BORE_ROWS; i++)
        if (s->bore[g][i] >= 0) b.of[b.count] = i, b.row[b.count++] = s->bore[g][i];
    return b;
}

/* strips of a place to the bore of gear g, turned from the tooth's axes into inertial ones */
GK_INLINE void place_bore(const gk_model *model, const gk_setup *setup, int g, const gk_table *table, int p,
                          const bores *b, double *const out[KINDS], const int kinds, const int count)
{
    const gk_work *work = setup->work;
    const gk_place *place = &work->place[p];
    const int strips = GK_STRIPS(setup), stride = work->system.stride;
    const double *turn = setup->modal[g].turn + 2 * place->tooth[g], *axes = work->axes[g], *w = place->weight[g];
    const double cosine = axes[0] * turn[0] - axes[1] * turn[1], sine = axes[1] * turn[0] + axes[0] * turn[1];
    const gk_quad *t = (const gk_quad *)table->fb +
                       (size_t)((place->flank * model->gear[g].rolls + place->index[g]) * strips * kinds);
    for (int a = 0; a < strips; a++)
        for (int kind = 0; kind < kinds; kind++, t++) {
            const gk_quad c = (w[0] * t[0] + w[1] * t[strips * kinds]) +
                              (w[2] * t[2 * strips * kinds] + w[3] * t[3 * strips * kinds]);
            const double pulls[BORE_ROWS] = {c[1] * sine - c[0] * cosine, -c[0] * sine - c[1] * cosine, -c[2]};
            double *matrix = out[kind], *column = matrix + (p * strips + a), *row = matrix + (p * strips + a) * stride;
            for (int i = 0; i < count; i++)
                column[b->row[i] * stride] = row[b->row[i]] = pulls[count == BORE_ROWS ? i : b->of[i]];
        }
}

/* everything of gear g that its bore takes part in */
GK_INLINE void bore_blocks(const gk_model *model, const gk_setup *setup, int g, const gk_table *table, const bores *b,
                           double *const out[KINDS], const int kinds, const int count)
{
    const gk_work *work = setup->work;
    for (int p = 0; p < work->places; p++) place_bore(model, setup, g, table, p, b, out, kinds, count);
    for (int kind = 0; kind < kinds; kind++)
        for (int i = 0; i < count; i++) {
            double *row = out[kind] + b->row[i] * work->system.stride;
            const double *bb = table->bb[kind] + 3 * (count == BORE_ROWS ? i : b->of[i]);
            for (int k = 0; k < count; k++) row[b->row[k]] = bb[count == BORE_ROWS ? k : b->of[k]];
        }
}

/* flank–flank, flank–bore and bore–bore compliance of both gears into out[kind] (stride, stride), symmetric; entries
 * between different gears' bores stay */
void gk_table_put(const gk_model *model, const gk_setup *setup, const gk_table *const table[2],
                  double *const out[KINDS])
{
    const gk_work *work = setup->work;
    for (int p = 0; p < work->places; p++)
        for (int q = p; q < work->places; q++) flank_pair(model, work, table, p, q, GK_STRIPS(setup), out);
    for (int g = 0; g < 2; g++) {
        const bores b = live_bores(&work->system, g);
        if (table[g]->kinds == KINDS && b.count == BORE_ROWS)
            bore_blocks(model, setup, g, table[g], &b, out, KINDS, BORE_ROWS);
        else
            bore_blocks(model, setup, g, table[g], &b, out, table[g]->kinds, b.count);
    }
}

/* P of a place: both teeth */
void gk_table_path(const gk_model *model, const gk_setup *setup, const gk_place *place, double *out)
{
    const int strips = GK_STRIPS(setup), quads = (strips * strips + 3) / 4;
    gk_quad sum[MAX_SLICES * MAX_SLICES / 4];
    for (int k = 0; k < quads; k++) sum[k] = (gk_quad){0};
    for (int g = 0; g < 2; g++) {
        const gk_quad *t = (const gk_quad *)setup->modal[g].path +
                           (size_t)((place->flank * model->gear[g].rolls + place->index[g]) * quads);
        for (int i = 0; i < 4; i++, t += quads)
            for (int k = 0; k < quads; k++) sum[k] += place->weight[g][i] * t[k];
    }
    memcpy(out, sum, (size_t)quads * sizeof *sum);
}
