/* Interpolation of rows along the flank: cubic convolution (Keys 1981, a = −½), continuously differentiable and exact for
 * parabolas; quadratic extrapolation gives the points at the ends. */
#include "setup/gk_setup.h"

/* f(−1) = 3 f0 − 3 f1 + f2 where the grid begins, and likewise where it ends */
static void close_ends(const double k[4], int cell, int rolls, double *w)
{
    for (int i = 0; i < 4; i++) w[i] = k[i];
    if (cell == 0) {
        w[0] = k[1] + 3.0 * k[0], w[1] = k[2] - 3.0 * k[0], w[2] = k[3] + k[0], w[3] = 0.0;
    } else if (cell == rolls - 2) {
        w[3] = k[2] + 3.0 * k[3], w[2] = k[1] - 3.0 * k[3], w[1] = k[0] + k[3], w[0] = 0.0;
    }
}

/* beyond the ends of the flank: the value there, no slope */
gk_grid gk_grid_at(const gk_model *model, const gk_gear *gear, double roll)
{
    const double low = gk_min(gear->s_form, gear->s_tip), high = gk_max(gear->s_form, gear->s_tip);
    const double share = (gk_clamp(roll, low, high) - gear->s_form) / (gear->s_tip - gear->s_form);
    const double u = share * (model->rolls - 1), per_roll = (model->rolls - 1) / (gear->s_tip - gear->s_form);
    const int cell = (int)u < model->rolls - 2 ? (int)u : model->rolls - 2;
    const double x = u - cell, x2 = x * x, x3 = x2 * x, moves = roll < low || roll > high ? 0.0 : per_roll;
    const double k[4] = {-0.5 * x + x2 - 0.5 * x3, 1.0 - 2.5 * x2 + 1.5 * x3, 0.5 * x + 2.0 * x2 - 1.5 * x3,
                         -0.5 * x2 + 0.5 * x3};
    const double d[4] = {moves * (-0.5 + 2.0 * x - 1.5 * x2), moves * (-5.0 * x + 4.5 * x2),
                         moves * (0.5 + 4.0 * x - 4.5 * x2), moves * (-x + 1.5 * x2)};
    gk_grid at = {.index = (int)gk_clamp(cell - 1, 0, model->rolls - 4)};
    close_ends(k, cell, model->rolls, at.weight);
    close_ends(d, cell, model->rolls, at.slope);
    return at;
}
