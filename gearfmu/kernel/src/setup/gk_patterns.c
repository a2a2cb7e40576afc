/* Flanks of a gear that reads many ground oscillators, as a planet those of its carrier, feel them in few patterns: the
 * rows of its tables are combinations of far fewer than there are oscillators. They are found by Gram and Schmidt, the
 * row that is told worst first, each oscillator weighed by what it yields in a short step. The rows of the tables
 * become those combinations to the last bit, so that whoever reads them has the same model. Rigid motion and the angles
 * of ports are patterns of their own, in front. */
#include "setup/gk_patterns.h"
#include "setup/gk_tables.h"

static const double TOLD = 3e-4;    /* of the longest row: what patterns leave out */
static const double SHORT = 1e-4;   /* s: of the motion that weighs oscillators */
enum { WORTH = 2 * MOST_PATTERNS }; /* least oscillators of a gear */

static int same(gk_span a, int from, int width) { return a.from == from && a.width == width; }

/* has the gear engagements whose rows on its oscillators are its own, and meets it other gears on all or on none? */
static int suits(const gk_model *model, const gk_setup *setup, int g)
{
    const gk_base *base = &setup->base;
    const int from = base->from[g], width = base->width[g];
    size_t rows = 0;
    if (width < WORTH || setup->engagements_of[g] < 2) return 0;
    for (int i = 0; i < 2 * model->engagements; i++) {
        const gk_mesh *mesh = &setup->mesh[i / 2];
        const gk_side *side = &mesh->side[i % 2];
        if (side->gear != g) continue;
        if (mesh->joined || !same(mesh->part[i % 2], from, width) || model->engagement[i / 2].kind == MESH_FLAT)
            return 0;
        rows += (size_t)((side->nodes + 1) * side->candidates * setup->strips);
    }
    if (rows > gk_side_scratch(model)) return 0;
    for (int other = 0; other < model->gears; other++)
        if (base->width[other] && base->from[other] < from + width && from < base->from[other] + base->width[other] &&
            !same((gk_span){from, width}, base->from[other], base->width[other]))
            return 0;
    return 1;
}

/* ports whose rows read oscillators of the gear get slots behind the rigid motions; 0: there are too many */
static int take_ports(const gk_model *model, gk_setup *setup, int g)
{
    gk_base *base = &setup->base;
    int count = 0;
    for (int p = 0; p < model->ports; p++) base->port_slot[g][p] = -1;
    for (int p = 0; p < model->ports; p++) {
        const double *row = base->port_rows + p * base->n + base->from[g];
        int read = 0;
        for (int i = 0; i < base->width[g]; i++) read |= row[i] != 0.0;
        if (!read) continue;
        if (SPACE + count == FIRST_PATTERN) return 0;
        memcpy(base->pattern[g] + (SPACE + count) * base->width[g], row, (size_t)base->width[g] * sizeof *row);
        base->port_slot[g][p] = SPACE + count++;
    }
    for (int m = 0; m < base->motions[g]; m++) {
        const int c = base->motion[g][m];
        memcpy(base->pattern[g] + c * base->width[g], base->moved[g][c], (size_t)base->width[g] * sizeof(double));
    }
    return 1;
}

typedef struct rows { /* of all sides of a gear */
    gk_side *side[2 * MAX_ENGAGEMENTS];
    double *left[2 * MAX_ENGAGEMENTS]; /* square of what patterns do not tell of each row */
    int count[2 * MAX_ENGAGEMENTS], sides, width;
} rows;

static rows rows_on(const gk_model *model, gk_setup *setup, int g, const double *weight, double *room)
{
    rows all = {.width = setup->base.width[g]};
    for (int side = 0; side < 2 * model->engagements; side++) {
        gk_side *of = &setup->mesh[side / 2].side[side % 2];
        if (of->gear != g) continue;
        all.side[all.sides] = of, all.left[all.sides] = room;
        const int count = all.count[all.sides++] = (of->nodes + 1) * of->candidates * setup->strips;
        for (int i = 0; i < count; i++) {
            double *row = of->ground + (size_t)i * (size_t)all.width;
            for (int k = 0; k < all.width; k++) row[k] *= weight[k];
            *room++ = gk_dot_quads(row, row, all.width / 4);
        }
    }
    return all;
}

/* the row that is told worst: what of it is new, of length 1; returns how long that was */
static double next_pattern(const rows *all, const double *known, int count, double *out)
{
    int side = 0, row = 0;
    for (int s = 0; s < all->sides; s++)
        for (int i = 0; i < all->count[s]; i++)
            if (all->left[s][i] > all->left[side][row]) side = s, row = i;
    memcpy(out, all->side[side]->ground + (size_t)row * (size_t)all->width, (size_t)all->width * sizeof *out);
    for (int twice = 0; twice < 2; twice++)
        for (int k = 0; k < count; k++) {
            const double *other = known + k * all->width;
            gk_axpy(-gk_dot_quads(other, out, all->width / 4), other, out, 0, all->width / 4);
        }
    const double length = sqrt(gk_dot_quads(out, out, all->width / 4));
    for (int i = 0; i < all->width && length > 0.0; i++) out[i] /= length;
    return length;
}

/* shares of a new pattern in all rows */
static void share_out(const rows *all, const double *pattern, int k)
{
    for (int s = 0; s < all->sides; s++)
        for (int i = 0; i < all->count[s]; i++) {
            const double x = gk_dot_quads(all->side[s]->ground + (size_t)i * (size_t)all->width, pattern,
                                          all->width / 4);
            all->side[s]->shares[(size_t)i * MOST_PATTERNS + k] = x;
            all->left[s][i] -= x * x;
        }
}

/* rows of the tables are what their shares say, over oscillators as they were; shares stand side by side */
static void close_rows(const rows *all, const double *pattern, int count, int each)
{
    for (int s = 0; s < all->sides; s++) {
        gk_side *side = all->side[s];
        for (int i = 0; i < all->count[s]; i++) {
            double *row = side->ground + (size_t)i * (size_t)all->width, share[MOST_PATTERNS] = {0};
            memcpy(share, side->shares + (size_t)i * MOST_PATTERNS, (size_t)count * sizeof *share);
            memset(row, 0, (size_t)all->width * sizeof *row);
            for (int k = 0; k < count; k++) gk_axpy(share[k], pattern + k * all->width, row, 0, all->width / 4);
            memcpy(side->shares + (size_t)(i * each), share, (size_t)each * sizeof *share);
        }
    }
}

/* patterns of gear g; 0: they are too many to be worth it, and the rows stay */
static int find_patterns(const gk_model *model, gk_setup *setup, int g, double *room)
{
    gk_base *base = &setup->base;
    const int width = base->width[g], most = MOST_PATTERNS - FIRST_PATTERN;
    double weight[MAX_GROUND + 4 * MAX_ROTORS], inverse[MAX_GROUND + 4 * MAX_ROTORS];
    double *pattern = base->pattern[g] + FIRST_PATTERN * width;
    memset(base->pattern[g], 0, (size_t)(MOST_PATTERNS * width) * sizeof *pattern);
    if (!take_ports(model, setup, g)) return 0;
    for (int i = 0; i < width; i++) {
        inverse[i] = sqrt(base->omega2[base->from[g] + i] + 1.0 / (SHORT * SHORT));
        weight[i] = 1.0 / inverse[i];
    }
    const rows all = rows_on(model, setup, g, weight, room);
    double longest = 0.0, left = INFINITY;
    int count = 0;
    for (; count <= most; count++) {
        double row[MAX_GROUND + 4 * MAX_ROTORS];
        left = next_pattern(&all, pattern, count, row);
        longest = count ? longest : left;
        if (!(left > TOLD * longest) || count == most) break;
        memcpy(pattern + count * width, row, (size_t)width * sizeof *row);
        share_out(&all, row, count);
    }
    const int found = left <= TOLD * longest && longest > 0.0, each = (count + 7) / 8 * 8;
    for (int i = 0; i < count * width; i++) /* forces are scattered by the same numbers in single precision */
        pattern[i] = (double)(gk_real)(pattern[i] * inverse[i % width]) * weight[i % width];
    if (found) close_rows(&all, pattern, count, each);
    for (int s = 0; s < all.sides; s++)
        for (int i = 0; i < all.count[s] * width; i++) all.side[s]->ground[i] *= inverse[i % width];
    for (int i = 0; i < count * width; i++) pattern[i] *= inverse[i % width];
    const int wide = gk_whole_halves(width);
    memset(base->flanks[g], 0, (size_t)(each * wide) * sizeof *base->flanks[g]);
    for (int i = 0; i < count * width; i++) base->flanks[g][i / width * wide + i % width] = (gk_real)pattern[i];
    return found ? FIRST_PATTERN + each : 0;
}

void gk_patterns_find(const gk_model *model, gk_setup *setup, double *room)
{
    GK_ASSERT(model && setup && room);
    for (int g = 0; g < model->gears; g++) {
        setup->base.patterns[g] = 0;
        if (setup->on.elastic && !GK_ON(setup, friction) && setup->base.pattern[g] && suits(model, setup, g))
            setup->base.patterns[g] = find_patterns(model, setup, g, room);
    }
}

/* what a force on a pattern of one gear does to those of another in the step k: by mobility, by −κ */
static void fill_between(const gk_setup *setup, const gk_coefficients *k, int to, int from, gk_real *out)
{
    const gk_base *base = &setup->base;
    const int rows = base->patterns[from], columns = base->patterns[to], n = base->width[to];
    const double *by[2] = {k->ground.mobility + base->from[to], k->ground.kappa + base->from[to]};
    for (int kind = 0; kind < 2; kind++)
        for (int i = 0; i < rows; i++)
            for (int j = 0; j < columns; j++) {
                const double *a = base->pattern[from] + i * n, *b = base->pattern[to] + j * n;
                double sum = 0.0;
                for (int l = 0; l < n; l++) sum += a[l] * b[l] * by[kind][l];
                *out++ = (gk_real)(kind ? -sum : sum);
            }
}

void gk_patterns_between(const gk_model *model, const gk_setup *setup, const gk_coefficients *k,
                         gk_real *(*between)[MAX_GEARS])
{
    const gk_base *base = &setup->base;
    for (int to = 0; to < model->gears; to++)
        for (int from = 0; from < model->gears; from++)
            if (gk_patterns_meet(base, to, from)) fill_between(setup, k, to, from, between[to][from]);
}
