/* Interpolation on even grids along the flank: cubic convolution (Keys 1981, a = −½), continuously differentiable and
 * exact for parabolas; quadratic extrapolation gives the points at the ends. */
#include "setup/gk_setup.h"

/* f(−1) = 3 f0 − 3 f1 + f2 where the grid begins, and likewise where it ends */
static void close_ends(const double k[4], int cell, int count, double *w)
{
    for (int i = 0; i < 4; i++) w[i] = k[i];
    if (cell == 0) {
        w[0] = k[1] + 3.0 * k[0], w[1] = k[2] - 3.0 * k[0], w[2] = k[3] + k[0], w[3] = 0.0;
    } else if (cell == count - 2) {
        w[3] = k[2] + 3.0 * k[3], w[2] = k[1] - 3.0 * k[3], w[1] = k[0] + k[3], w[0] = 0.0;
    }
}

/* at u, 0 … count − 1; `per`: du by what slopes are taken by */
static gk_grid cubic(double u, int count, double per)
{
    const int cell = (int)u < count - 2 ? (int)u : count - 2;
    const double x = u - cell, x2 = x * x, x3 = x2 * x;
    const double k[4] = {-0.5 * x + x2 - 0.5 * x3, 1.0 - 2.5 * x2 + 1.5 * x3, 0.5 * x + 2.0 * x2 - 1.5 * x3,
                         -0.5 * x2 + 0.5 * x3};
    const double d[4] = {per * (-0.5 + 2.0 * x - 1.5 * x2), per * (-5.0 * x + 4.5 * x2),
                         per * (0.5 + 4.0 * x - 4.5 * x2), per * (-x + 1.5 * x2)};
    gk_grid at = {.index = (int)gk_clamp(cell - 1, 0, count - 4)};
    close_ends(k, cell, count, at.weight);
    close_ends(d, cell, count, at.slope);
    return at;
}

/* on `count` rolls even along the flank; beyond its ends the value there */
gk_grid gk_grid_flank(const gk_gear *gear, int count, double roll)
{
    GK_ASSERT(count >= 4);
    GK_ASSERT(gear->s_tip != gear->s_form);
    const double low = gk_min(gear->s_form, gear->s_tip), high = gk_max(gear->s_form, gear->s_tip);
    const double share = (gk_clamp(roll, low, high) - gear->s_form) / (gear->s_tip - gear->s_form);
    return cubic(share * (count - 1), count, (count - 1) / (gear->s_tip - gear->s_form));
}

/* on the grid of rolls that the model's rows are given on */
gk_grid gk_grid_at(const gk_model *model, const gk_gear *gear, double roll)
{
    GK_ASSERT(model && gear);
    return gk_grid_flank(gear, model->rolls, roll);
}

/* on the POINTS of a flank, which are even in arc length; beyond its ends the value there, without slope */
gk_grid gk_grid_points(const gk_gear *gear, double roll)
{
    GK_ASSERT(gear && gear->s_tip != gear->s_form);
    const double from = gear->s_form * gear->s_form, to = gear->s_tip * gear->s_tip, per = (POINTS - 1) / (to - from);
    const double u = (gk_max(roll, 0.0) * roll - from) * per, inside = gk_clamp(u, 0.0, POINTS - 1);
    return cubic(inside, POINTS, u == inside ? 2.0 * roll * per : 0.0);
}
