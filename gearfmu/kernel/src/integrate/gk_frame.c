/* What the axes of a turning carrier do to the masses in them (docs/theory.md, 3.10), half a step each beside the
 * dashpots of the supports. Coriolis force −2Ω m J times the speed, J a quarter turn, on P v, P = √m Φ_xy of every
 * carried body (17f): turned exactly by Cayley's form of the low-rank rotation, without energy. Centrifugal load m
 * Ω² a (17g). */
#include "integrate/gk_integrate.h"

enum { ROUNDS = 5 }; /* Ωh is some 1e-3: every round three digits */

static int carries(const gk_model *model, int rotor)
{
    for (int i = 0; i < model->carried; i++)
        if (model->carried_frame[i] == rotor) return 1;
    return 0;
}

/* half a step of Coriolis forces on the speeds of the ground group */
void gk_frame_turn(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, const gk_data *data,
                   double *v)
{
    const int rows = 2 * model->carried, n = setup->base.n;
    const gk_ground_flow *f = &k->ground;
    double before[2 * MAX_CARRIED], after[2 * MAX_CARRIED], force[2 * MAX_CARRIED];
    if (!GK_ON(setup, coriolis) || !rows) return;
    for (int r = 0; r < rows; r++) before[r] = after[r] = gk_dot_quads(f->turns + r * n, v, n / 4);
    for (int round = 0; round < ROUNDS; round++) {
        for (int b = 0; b < model->carried; b++) {
            const double angle = 0.5 * k->h * data->v[model->carried_frame[b]];
            force[2 * b] = -angle * (before[2 * b + 1] + after[2 * b + 1]);
            force[2 * b + 1] = angle * (before[2 * b] + after[2 * b]);
        }
        for (int r = 0; r < rows; r++) {
            after[r] = before[r];
            for (int c = 0; c < rows; c++) after[r] -= f->coupling[r * rows + c] * force[c];
        }
    }
    for (int r = 0; r < rows; r++) gk_axpy(-force[r], f->turned + r * n, v, 0, n / 4);
}

/* Half a step of centrifugal loads: the kick that at rest gives the displacement F/ω² at the ends of steps. Returns its
 * work; it comes from outside, the carrier's spin does not feel it. */
double gk_frame_press(const gk_model *model, const gk_setup *setup, const gk_coefficients *k, const gk_data *data,
                      double *v)
{
    const gk_base *base = &setup->base;
    const gk_ground_flow *f = &k->ground;
    double work = 0.0;
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++) {
        const double *outward = base->outward + r * base->n, speed2 = data->v[r] * data->v[r];
        for (int i = 0; i < base->n && carries(model, r); i++) {
            if (outward[i] == 0.0 || !(f->a12[i] != 0.0)) continue;
            const double kick = -f->d11[i] / (f->a12[i] * base->omega2[i]) * speed2 * outward[i];
            work += f->inverse_s2[i] * (v[i] + 0.5 * kick) * kick;
            v[i] += kick;
        }
    }
    return work;
}

/* adds the centrifugal loads themselves */
void gk_frame_load(const gk_model *model, const gk_setup *setup, const gk_data *data, double *force)
{
    const gk_base *base = &setup->base;
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        if (carries(model, r)) gk_axpy(data->v[r] * data->v[r], base->outward + r * base->n, force, 0, base->n / 4);
}

/* the accelerations of both, for explicit integrators: speeds of the spins and v of the ground group */
void gk_frame_rates(const gk_model *model, const gk_setup *setup, const double *spin, const double *v, double *a)
{
    const gk_base *base = &setup->base;
    const int n = base->n;
    for (int b = 0; b < model->carried && GK_ON(setup, coriolis); b++) {
        const double *x = base->carried_rows + 2 * b * n, *y = x + n, twice = 2.0 * spin[model->carried_frame[b]];
        const double along = gk_dot_quads(x, v, n / 4), across = gk_dot_quads(y, v, n / 4);
        gk_axpy(twice * across, x, a, 0, n / 4);
        gk_axpy(-twice * along, y, a, 0, n / 4);
    }
    for (int r = 0; r < model->rotors && model->carried && GK_ON(setup, centrifugal); r++)
        if (carries(model, r)) gk_axpy(spin[r] * spin[r], base->outward + r * n, a, 0, n / 4);
}
