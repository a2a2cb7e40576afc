/* Which internal step. A closed contact is stable up to μ′ = 1 (gk_closed.c). Oscillators with large κ take most of the
 * compliance, so μ′ goes up and down with h. Default h: the largest with μ′ ≤ 0.9, at most h_max of the stage and
 * 1/40 of the mesh period at speed_max. Any other h lowers γ until μ′ = 0.9: first more oscillators yield at once, then
 * fewer are exponential, then κ is weakened (gk_oscillator.c). Above 1/8 of the period h is refused. */
#include "integrate/gk_closed.h"
#include "integrate/gk_integrate.h"
#include "setup/gk_choose.h"
#include <stdio.h>

static const double MU_MOST = 0.9; /* μ′ of a step */
static const double WITHIN = 0.9,
                    BEYOND = 1.5; /* of the limit of stability: the default; from where on a step is refused */
static const double WARNED = 0.7; /* γ */

/* Does a step of length h with γ keep the bound? */
static int holds(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h,
                 double gamma)
{
    return setup->holds(model, setup, work, data, gk_flow_for(model, setup, &work->room, h, gamma), MU_MOST);
}

/* γ for which μ′ stays at its bound */
static double gamma_for(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    if (holds(model, setup, work, data, h, 1.0)) return 1.0;
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 12; i++) {
        double middle = 0.5 * (low + high);
        if (holds(model, setup, work, data, h, middle))
            low = middle;
        else
            high = middle;
    }
    return low;
}

static const double QUARTER_OCTAVE = 0.84089641525371454; /* 2^(−1/4) */

/* γ of any h: exact for the internal step of the run, else the smaller of its neighbours on the scale; a pure function
 * of setup, state and h */
double gk_limit_gamma(const gk_setup *setup, const gk_work *work, const gk_data *data, double h)
{
    GK_ASSERT(h > 0.0);
    GK_ASSERT(setup->h > 0.0);
    double at = setup->h;
    int i = 0;
    if (!gk_scheme_of(setup->integrator)->corrected) return 0.0;
    if (h == data->table_h && h == work->run_h) return work->run_gamma;
    while (i < GAMMAS - 1 && h < at * (1.0 - 1e-9)) at *= QUARTER_OCTAVE, i++;
    return i && h > at * (1.0 + 1e-9) ? gk_min(setup->gamma_at[i - 1], setup->gamma_at[i]) : setup->gamma_at[i];
}

/* γ of the internal step of the run */
void gk_limit_run(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    GK_ASSERT(h > 0.0);
    if (!gk_scheme_of(setup->integrator)->corrected || work->run_h == h) return;
    if (h != setup->h) setup->keep(model, setup, work, data);
    work->run_gamma = h == setup->h ? setup->gamma_at[0] : gamma_for(model, setup, work, data, h);
    work->run_h = h;
}

static const double LADDER[] = {20e-6, 15e-6, 12.5e-6, 10e-6, 7.5e-6, 6e-6, 5e-6,
                                4e-6,  3e-6,  2.5e-6,  2e-6,  1.5e-6, 1e-6, 0.5e-6};
enum { RUNGS = sizeof LADDER / sizeof *LADDER };

/* The largest step of the ladder, and at most `limit`, that meets the bound with γ = 1; where none does, the one with
 * the largest γ */
static double default_step(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                           double limit, int corrected)
{
    GK_ASSERT(limit > 0.0);
    double most = 0.0, h = limit;
    for (int i = 0; i < RUNGS && most < 1.0; i++) {
        if (i + 1 < RUNGS && LADDER[i + 1] >= limit) continue;
        const double rung = gk_min(LADDER[i], limit);
        const double gamma = corrected ? gamma_for(model, setup, work, data, rung) : 1.0;
        if (gamma > most) most = gamma, h = rung;
    }
    return h;
}

/* the largest step of the ladder below h that meets the bound with γ = 1; 0: none */
static double whole_below(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h)
{
    for (int i = 0; i < RUNGS; i++)
        if (LADDER[i] < h && holds(model, setup, work, data, LADDER[i], 1.0)) return LADDER[i];
    return 0.0;
}

gk_outcome gk_limit_choose(const gk_model *model, gk_setup *setup, gk_work *work, const gk_data *data,
                           char message[GK_MESSAGE])
{
    GK_ASSERT(message && model->period_min > 0.0);
    const double wished = data->stage[V_H];
    GK_ASSERT(!(wished < 0.0));
    const double period = model->period_min;
    const int corrected = gk_scheme_of(setup->integrator)->corrected;
    const double stable = setup->integrator == CENTRAL ? gk_central_limit(model, setup, work, data)
                                                       : INFINITY; /* explicit: a limit of stability */
    double limit = gk_min(gk_longest_step(model), WITHIN * stable), h = wished;
    if (corrected) setup->keep(model, setup, work, data);
    if (!(wished > 0.0)) h = default_step(model, setup, work, data, limit, corrected);
    if (h > period / 8.0) {
        snprintf(message, GK_MESSAGE, "h = %.3g s is more than 1/8 of the mesh period at speed_max; use h <= %.3g s", h,
                 period / 8.0);
        return GK_STEP_TOO_LARGE;
    }
    if (h > stable) {
        snprintf(message, GK_MESSAGE,
                 "h = %.3g s is above the limit of stability of central for this model at this level; use h <= %.3g s",
                 h, WITHIN * stable);
        if (h > BEYOND * stable) return GK_STEP_TOO_LARGE;
    }
    setup->h = h;
    double at = h;
    for (int i = 0; i < GAMMAS; i++, at *= QUARTER_OCTAVE)
        setup->gamma_at[i] = corrected ? gamma_for(model, setup, work, data, at) : 0.0;
    if (corrected && setup->gamma_at[0] < WARNED) {
        const double whole = whole_below(model, setup, work, data, h);
        const int length = snprintf(
            message, GK_MESSAGE, "h = %.3g s exceeds the accuracy limit of dg4 for this model: gamma lowered to %.2f; ",
            h, setup->gamma_at[0]);
        if (whole > 0.0)
            snprintf(message + length, GK_MESSAGE - length, "h <= %.3g s needs no lower gamma", whole);
        else
            snprintf(message + length, GK_MESSAGE - length,
                     "no shorter step does without; less contact damping or more modes bring it down");
    }
    return GK_OK;
}
