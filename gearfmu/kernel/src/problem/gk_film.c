/* Squeeze film between open flanks that approach (docs/theory.md, 2.9 and 3.13). Reynolds for a line contact, no
 * tension: with thickness d, roughness r, reach H
 *     f = −c(d) ḋ where ḋ < 0, else 0;   c(d) = 3√2 π η b R^3/2 [(d + r)^-3/2 − (H + r)^-3/2]
 * A contact whose gap is open at the start of a step stands on such a film, in series with everything that yields. For
 * the mean force λ1 of the step the exact solution is I(d0) − I(d1) = hλ1, I = ∫ c dd; where that ends below 0 flanks
 * touch. So 0 ≤ λ1, gap + deflection ≥ d1(λ1) is one more local law, d1 decreasing and convex. The force at the end of
 * the step is its mean, z = 2λ1 − λ0, which is right to second order for what has mass and lets no force ring in what
 * has none; beyond what closes the film z grows as that of a contact. Contact dampers wait until flanks touch. Where no
 * time passes (rk45, central) the speed of approach is given: f = c(d)·speed. */
#include "problem/gk_work.h"

static const double TOUCHES = 1e-9; /* m: flanks that are closer touch */
static const double THIN = 0.999;   /* of the reach: beyond it there is no film to speak of */
static const double SHARPEST = 1.0; /* 1/m: flatter contacts count as that */
enum { NEWTON_LIMIT = 40 };

static double inverse_root(const gk_film *film, int i, double d) { return 1.0 / sqrt(d + film->cut[i]); }

/* c(d) and I(d) of a row, factors included; u: (d + r)^-½ */
static double resistance(const gk_film *film, int i, double u)
{
    const double far = film->inverse_root[i];
    return film->factor[i] * (u * u * u - far * far * far);
}

static double impulse(const gk_film *film, int i, double d, double u)
{
    const double far = film->inverse_root[i];
    return -film->factor[i] * (2.0 * u + d * far * far * far);
}

/* ---- the start of the step --------------------------------------------------------------------------------------- */
static void clear(gk_system *s)
{
    gk_film *film = s->film;
    memset(film, 0, sizeof *film);
    s->films = 0;
}

/* A film that begins: r, and 3√2 π η b R^3/2 */
static void begin_film(const gk_mesh *mesh, const gk_system *s, int i)
{
    gk_film *film = s->film;
    double mean = 0.0;
    for (int k = 0; k < GAPS - 1 && s->flank.yields > 0.0; k++) mean += s->flank.opens[k][i] / GAPS;
    film->cut[i] = mesh->film_cut + mean;
    film->inverse_root[i] = inverse_root(film, i, GK_FILM_REACH);
    const double curvature = gk_max(s->flank.curvature[i], SHARPEST);
    film->factor[i] = 13.328648814475098 * mesh->friction.viscosity * s->flank.width[i] / (curvature * sqrt(curvature));
}

static void stand(gk_system *s)
{
    if (!s->films) return;
    for (int i = 0; i < s->contacts; i++)
        if (s->film->factor[i] > 0.0) s->active[i] = s->force0[i] > 0.0 || s->g[i] < s->film->open[i];
    gk_solve_status(s);
    gk_solve_settle(s);
}

/* films of engagement e in a step h; the start of the step has been recalled */
void gk_film_begin(const gk_setup *setup, gk_work *work, int e, double h)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(h > 0.0);
    gk_system *s = &work->engaged[e].system;
    gk_film *film = s->film;
    clear(s);
    film->step = h;
    for (int i = 0; i < s->contacts; i++) {
        const double open = s->g0[i] + gk_solve_quasi_static(s, i);
        if (!s->flank.recalled[i] || !(open > TOUCHES) || !(open < THIN * GK_FILM_REACH)) continue;
        begin_film(&setup->mesh[e], s, i);
        film->open[i] = film->left[i] = open;
        film->sinks[i] = 1.0;
        s->dashpot.coefficient[i] = 0.0, s->dashpot.clip[i] = 2; /* the contact damper acts on flanks that touch */
        film->delta0[i] = s->local.delta[i], film->potential0[i] = s->local.potential[i];
        const double u = inverse_root(film, i, open), at_open = impulse(film, i, open, u);
        film->at_open[i] = at_open;
        film->closes[i] = (at_open - impulse(film, i, 0.0, inverse_root(film, i, 0.0))) / h;
        s->films++;
    }
    stand(s);
}

/* the same where no time passes, for given rates of the gaps */
void gk_film_begin_rates(const gk_setup *setup, gk_work *work, int e, const double *rate)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(rate);
    gk_system *s = &work->engaged[e].system;
    gk_film *film = s->film;
    clear(s);
    for (int i = 0; i < s->contacts; i++) {
        if (!(rate[i] < 0.0)) continue;
        begin_film(&setup->mesh[e], s, i);
        film->open[i] = film->left[i] = GK_FILM_REACH;
        film->speed[i] = -rate[i];
        film->closes[i] = resistance(film, i, inverse_root(film, i, 0.0)) * film->speed[i];
        s->films++;
    }
    stand(s);
}

/* ---- thickness by force ------------------------------------------------------------------------------------------ */
/* I(d1) = I(d0) − h x by Newton from below: I is concave, so that every iterate stays below the root */
static void sink(gk_film *film, int i, double x)
{
    const double first = resistance(film, i, inverse_root(film, i, film->open[i]));
    double d = film->open[i] - film->step * x / first, u, c = first;
    if (x > 0.0) {
        const double aim = film->at_open[i] - film->step * x;
        d = gk_max(d, 0.0);
        for (int round = 0; round < NEWTON_LIMIT; round++) {
            u = inverse_root(film, i, d), c = resistance(film, i, u);
            const double move = (aim - impulse(film, i, d, u)) / c;
            if (!(move > 1e-13 * (d + film->cut[i]))) break;
            d = gk_min(d + move, film->open[i]);
        }
    }
    film->left[i] = d;
    film->yields[i] = film->step / c;
}

/* c(d)·speed = x */
static void follow_speed(gk_film *film, int i, double x)
{
    const double far = film->inverse_root[i], pushed = film->factor[i] * film->speed[i];
    const double cube = gk_max(x, 0.0) / pushed + far * far * far, fifth = gk_exp(-5.0 / 3.0 * gk_log(cube));
    film->yields[i] = 2.0 / 3.0 * fifth / pushed;
    film->left[i] = fifth * cube - film->cut[i] - film->yields[i] * gk_min(x, 0.0);
}

/* thickness of all films by the present forces; after the forces have been settled */
void gk_film_apply(gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(s->film);
    gk_film *film = s->film;
    for (int i = 0; i < s->contacts; i++) {
        if (!(film->factor[i] > 0.0)) continue;
        const double x = s->force[i];
        film->left[i] = film->yields[i] = 0.0;
        if (!(x < film->closes[i])) continue; /* flanks touch */
        if (film->step > 0.0)
            sink(film, i, x);
        else
            follow_speed(film, i, x);
    }
}

/* ---- energy ------------------------------------------------------------------------------------------------------ */
/* deflection of what is linear, its change in the step */
static double deflected(const gk_system *s, int i)
{
    const double before = s->film->open[i] - s->g0[i] - s->film->delta0[i];
    return s->Al[i] + s->others.deflection[i] + s->linear[i] - before;
}

/* as the gaps of the step say, so that the balance has no defect but that of its contacts */
static double sunk_by(const gk_system *s, int i)
{
    return s->active[i] ? s->film->open[i] - gk_solve_end_gap(s, i) - gk_solve_quasi_static(s, i) : 0.0;
}

/* What a film takes in the step: its mean force over what it sinks, and what is lost because the force at the end is
 * the mean. Of one that is squeezed out the part that it carried. */
static double lost(const gk_system *s, int i)
{
    const gk_film *film = s->film;
    const double mean = s->force[i] + 0.5 * s->alpha * s->direction[i], sunk = sunk_by(s, i);
    const double bent = s->force[i] * (s->local.delta[i] - film->delta0[i]) - s->local.potential[i] +
                        film->potential0[i];
    const double late = 0.5 * (s->force[i] - s->force0[i]) * deflected(s, i) + bent;
    if (film->left[i] > 0.0 || !(mean > film->closes[i])) return mean * sunk + late;
    return film->closes[i] * (sunk + late / mean);
}

/* never negative: where strips that hang together would give energy, the balance of the step makes it good */
double gk_film_lost(const gk_system *s)
{
    GK_ASSERT(gk_system_is_sound(s));
    GK_ASSERT(s->film);
    double sum = 0.0;
    for (int i = 0; i < s->contacts; i++)
        if (s->film->sinks[i] != 0.0) sum += lost(s, i);
    return gk_max(sum, 0.0) + s->film->burst;
}

/* of the films that stay open: what gk_film_lost grows with the step's scalar α, linear and (square) squared; by α
 * forces grow by p, deflection without the local law by `linear` */
double gk_film_grows(const gk_system *s, const double *p, const double *linear, double *square)
{
    GK_ASSERT(s->film && p && linear && square);
    const gk_film *film = s->film;
    double sum = 0.0;
    for (int i = 0; i < s->contacts; i++) {
        if (!s->active[i] || film->sinks[i] == 0.0 || !(film->left[i] > 0.0)) continue;
        const double sinks = film->yields[i] * p[i];
        sum += p[i] * (sunk_by(s, i) + s->local.delta[i] - film->delta0[i] + 0.5 * deflected(s, i)) +
               s->force[i] * sinks + 0.5 * (s->force[i] - s->force0[i]) * linear[i];
        *square += p[i] * (sinks + 0.5 * linear[i]);
    }
    return sum;
}

/* where no time passes: power of the films that do not touch */
double gk_film_power(const gk_system *s)
{
    GK_ASSERT(s->film);
    double sum = 0.0;
    for (int i = 0; i < s->contacts; i++) sum += gk_min(s->force[i], s->film->closes[i]) * s->film->speed[i];
    return sum;
}
