/* Forces on the strips of a tooth at given lengths of roll: what they are to the modes of its gear group and to the
 * ground oscillators. */
#include "setup/gk_node.h"
#include "setup/gk_push.h"

/* adds Σ over rolls and width functions of weighted rows, modes from `first` on */
static void add_rows(const gk_node *n, const gk_spot *p, int first, double weight[4][MAX_FUNCTIONS], double *sum)
{
    const int modes = n->gear->modes, A = n->model->functions;
    const gk_real *row = n->flank->rows + (size_t)((p->flank * n->model->rolls + p->grid.index) * A) * (size_t)modes;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < A; a++, row += modes) {
            for (int k = first; k < modes; k++) sum[k] += weight[i][a] * row[k];
            weight[i][a] = 0.0;
        }
}

/* adds a row of tooth 0 turned to another tooth, modes from `first` on, which begins no pair's second */
static void add_turned(const gk_gear *gear, int tooth, int first, const double *row, double *sum)
{
    double cosine[MAX_TEETH], sine[MAX_TEETH];
    for (int m = 0; m < gear->z; m++) gk_sincos(2.0 * GK_PI * m / gear->z, &sine[m], &cosine[m]);
    for (int k = first; k < gear->modes; k++) {
        const int m = (int)((int64_t)gear->diameter[k] * tooth % gear->z);
        if (gear->member[k] == 1) {
            sum[k] += row[k] * cosine[m] - row[k + 1] * sine[m];
            sum[k + 1] += row[k] * sine[m] + row[k + 1] * cosine[m];
            k++;
        } else {
            sum[k] += row[k] * cosine[m];
        }
    }
}

/* Adds the modal forces of a gear group, modes from `first` on, by outward forces on the strips of a tooth at these
 * lengths of roll; row: scratch of all modes. Strips in one cell of the grid of rolls, as those of a spur gear, are one
 * row. */
void gk_node_push(const gk_model *model, const gk_setup *setup, const gk_strip_load *load, int first, double *row,
                  double *sum)
{
    GK_ASSERT(gk_is_gear(model, load->gear) && load->strips <= MAX_SLICES);
    GK_ASSERT(first >= 0 && first <= model->gear[load->gear].modes);
    const gk_gear *gear = &model->gear[load->gear];
    const gk_node n = {.model = model, .gear = gear, .flank = &setup->flank[load->gear]};
    double weight[4][MAX_FUNCTIONS] = {{0}};
    gk_spot p = {.flank = load->flank, .grid.index = -1}, next = p;
    memset(row + first, 0, (size_t)(gear->modes - first) * sizeof *row);
    for (int strip = 0; strip < load->strips; strip++) {
        next.grid = gk_grid_at(model, gear, load->roll[strip]);
        if (p.grid.index >= 0 && next.grid.index != p.grid.index) add_rows(&n, &p, first, weight, row);
        p = next;
        for (int i = 0; i < 4; i++)
            for (int a = 0; a < model->functions; a++)
                weight[i][a] += load->force[strip] * p.grid.weight[i] * load->width[strip][a];
    }
    add_rows(&n, &p, first, weight, row);
    add_turned(gear, load->tooth, first, row, sum);
}

/* adds the forces on ground oscillators that are not dynamic, by outward forces on the strips of a tooth of one gear */
void gk_node_push_ground(const gk_model *model, const gk_setup *setup, int e, int which, const gk_strip_load *load,
                         double *sum)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(which == 0 || which == 1);
    GK_ASSERT(setup->mesh[e].side[which].gear == load->gear);
    const gk_mesh *mesh = &setup->mesh[e];
    gk_node n = {.model = model,
                 .setup = setup,
                 .e = &model->engagement[e],
                 .gear = &model->gear[load->gear],
                 .side = &mesh->side[which],
                 .flank = &setup->flank[load->gear]};
    const int set = setup->base.set, reads = n.gear->ground[set].reads, motions = gk_node_motions(n.gear);
    const int32_t *list = n.gear->ground[set].list;
    double motion[12 + MAX_LOW], all[12 + MAX_LOW] = {0};
    gk_sincos(n.gear->helix, &n.helix_sine, &n.helix_cosine);
    for (int strip = 0; strip < load->strips; strip++) {
        const double roll = load->roll[strip], z = load->z[strip], sg = load->flank ? -1.0 : 1.0;
        gk_spot p = {
            .flank = load->flank, .grid = gk_grid_at(model, n.gear, roll), .nominal = roll, .roll = roll, .z = z};
        p.middle = roll - sg * z * gk_node_tan(n.gear->helix);
        memcpy(p.width, load->width[strip], sizeof p.width);
        if (load->force[strip] == 0.0) continue;
        gk_node_motion_at(&n, &p, motion);
        for (int i = 0; i < motions; i++) all[i] += load->force[strip] * motion[i];
    }
    for (int i = 0; i < motions; i++) {
        const double *row = gk_node_motion(n.gear, set, i);
        for (int k = 0; k < reads; k++)
            if (setup->base.slot[list[k]] < 0) sum[list[k]] += all[i] * row[k];
    }
}
