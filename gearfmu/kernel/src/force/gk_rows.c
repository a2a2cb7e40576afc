/* Displacement rows of the dynamic modes at the places of contact and at the bore, in body-fixed lanes.
 * A place's row is the tooth-0 table at its roll (four grid rolls), turned to its tooth (docs/theory.md, eq. 3): (a, b)
 * → (a cos θ − b sin θ, a sin θ + b cos θ), θ = 2πνj/z. */
#include "model/gk_core.h"

static void place_rows(const gk_setup *setup, const gk_gear *gear, int g, const gk_place *p, gk_real *out)
{
    const gk_modal *modal = &setup->modal[g];
    const int n = 2 * modal->n / LANES, P = n / 2, strips = GK_STRIPS(setup); /* in halves of LANES */
    const gk_real w0 = (gk_real)p->weight[g][0], w1 = (gk_real)p->weight[g][1], w2 = (gk_real)p->weight[g][2],
                  w3 = (gk_real)p->weight[g][3];
    const gk_half *t0 = (const gk_half *)modal->rows + ((size_t)p->flank * gear->rolls + p->index[g]) * strips * n;
    const gk_half *t1 = t0 + strips * n, *t2 = t1 + strips * n, *t3 = t2 + strips * n;
    const gk_half *c = (const gk_half *)modal->cosine + p->tooth[g] * P,
                  *s = (const gk_half *)modal->sine + p->tooth[g] * P;
    gk_half *to = (gk_half *)out;
    for (int strip = 0; strip < strips; strip++, t0 += n, t1 += n, t2 += n, t3 += n, to += n)
        for (int k = 0; k < P; k++) {
            const gk_half first = (w0 * t0[k] + w1 * t1[k]) + (w2 * t2[k] + w3 * t3[k]);
            const gk_half second = (w0 * t0[P + k] + w1 * t1[P + k]) + (w2 * t2[P + k] + w3 * t3[P + k]);
            to[k] = first * c[k] - second * s[k];
            to[P + k] = first * s[k] + second * c[k];
        }
}

/* x and y stay away where no bearing reads them */
static void bore_rows(const gk_modal *modal, int radial, const double *axes, gk_real *out)
{
    const int n = 2 * modal->n / LANES;
    memcpy(out + BORE_RZ * modal->n, modal->bore + BORE_RZ * modal->n, (size_t)modal->n * sizeof *out);
    if (!radial) return;
    const gk_real c = (gk_real)axes[0], s = (gk_real)axes[1];
    const gk_half *x = (const gk_half *)modal->bore, *y = x + n;
    gk_half *to = (gk_half *)out;
    for (int k = 0; k < n; k++) {
        to[k] = c * x[k] - s * y[k];
        to[n + k] = s * x[k] + c * y[k];
    }
}

/* fills work->attitude and work->basis of both gears for the places found: a row a strip and place, then the three bore
 * rows in inertial axes */
void gk_rows_form(const gk_model *model, const gk_setup *setup, const double *frame, gk_work *work)
{
    for (int g = 0; g < 2; g++) {
        const gk_modal *modal = &setup->modal[g];
        work->attitude[g] = frame[g ? PHIB : PHIA] + model->gear[g].phase;
        gk_sincos(work->attitude[g], &work->axes[g][1], &work->axes[g][0]);
        if (!GK_LANES(setup, g)) continue;
        size_t row = (size_t)GK_STRIPS(setup) * modal->n;
        for (int p = 0; p < work->places; p++)
            place_rows(setup, &model->gear[g], g, &work->place[p], work->basis[g] + p * row);
        bore_rows(modal, GK_HAS(bearings) && setup->link[BEARING_0X + 2 * g], work->axes[g],
                  work->basis[g] + work->places * row);
    }
}
