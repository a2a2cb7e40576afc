/* Compliance between two points of a gear's flanks by its tables on the even grid of rolls (gk_spread.c), which hold
 * each pair of flanks once. */
#include "setup/gk_block.h"

gk_block gk_block_of(const gk_node *n, int from, int to, int offset)
{
    gk_block b = {.swapped = offset < 0};
    if (b.swapped) {
        const int other = from;
        from = to, to = other, offset = -offset;
    }
    if (from != to) {
        b.swapped ^= !offset && from == 1;
        b.table = n->compliance->across[offset ? 2 * offset - 1 + from : 0];
        return b;
    }
    b.image = n->gear->mirrored && from == 1;
    b.swapped ^= b.image;
    const int kept = b.image ? 0 : from;
    b.table = offset ? n->compliance->next[kept][offset - 1] : n->compliance->own[kept];
    return b;
}

/* out (n) = Σ of weighed cells (n), in order; a chunk of sums stays in a register */
static void blend_cells(const gk_real *const cell[16], const double weight[16], int n, double *out)
{
    int c = 0;
    for (; c + 2 * GK_CHUNK <= n; c += 2 * GK_CHUNK) {
        gk_chunk a = {0}, b = {0};
        for (int i = 0; i < 16; i++) {
            const gk_some *from = (const gk_some *)(cell[i] + c);
            a += weight[i] * __builtin_convertvector(from[0], gk_chunk);
            b += weight[i] * __builtin_convertvector(from[1], gk_chunk);
        }
        ((gk_chunk *)(out + c))[0] = a, ((gk_chunk *)(out + c))[1] = b;
    }
    for (; c < n; c++) {
        out[c] = 0.0;
        for (int i = 0; i < 16; i++) out[c] += weight[i] * cell[i][c];
    }
}

/* compliance between two points by a block, by width function, (functions, functions) */
void gk_block_tabulate(const gk_node *n, gk_block b, const gk_spot *p, const gk_spot *q, double *cell)
{
    const int A = n->model->functions, R = n->model->rolls;
    const gk_grid *first = b.swapped ? &q->grid : &p->grid, *second = b.swapped ? &p->grid : &q->grid;
    double sum[MAX_FUNCTIONS * MAX_FUNCTIONS], weight[16];
    const gk_real *table[16];
    for (int c = 0; c < 16; c++) {
        const int i = c / 4, j = c % 4;
        weight[c] = first->weight[i] * second->weight[j];
        table[c] = b.table + (size_t)((first->index + i) * R + second->index + j) * (size_t)(A * A);
    }
    blend_cells(table, weight, A * A, sum);
    for (int a = 0; a < A; a++)
        for (int c = 0; c < A; c++) {
            const double value = sum[b.swapped ? c * A + a : a * A + c];
            cell[a * A + c] = b.image ? value * gk_width_sign(n->model, a) * gk_width_sign(n->model, c) : value;
        }
}

/* of the normal displacement at flank `from` per force along the profile at flank `to` of the same tooth */
gk_block gk_block_along_normal(const gk_node *n, int from, int to)
{
    const int image = n->gear->mirrored && from == 1;
    return (gk_block){image ? n->compliance->along_normal[0][1 - to] : n->compliance->along_normal[from][to], 0, image};
}

gk_block gk_block_along_own(const gk_node *n, int from, int to)
{
    const int image = n->gear->mirrored && from == 1;
    if (from != to) return (gk_block){n->compliance->along_across, from == 1, 0};
    return (gk_block){n->compliance->along_own[image ? 0 : from], image, image};
}

/* Compliance between two points by a block */
double gk_block_between(const gk_node *n, gk_block b, int i, int j)
{
    const int A = n->model->functions;
    double sum = 0.0, cell[MAX_FUNCTIONS * MAX_FUNCTIONS];
    gk_block_tabulate(n, b, &n->at[i], &n->at[j], cell);
    for (int a = 0; a < A; a++) sum += n->at[i].width[a] * gk_node_dot(cell + a * A, n->at[j].width, A);
    return sum;
}
