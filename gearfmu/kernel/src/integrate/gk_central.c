/* central: explicit central differences (velocity form) in the dynamic coordinates, contact forces each step from the
 * static complementarity problem of what is massless at the new positions. The massless-boundary scheme of
 * Monjaraz-Tec, Gross and Krack (docs/theory.md, 3.7), on the same residual, law and gaps as dg4: the peer it is
 * compared with.
 *
 *     v½ = v + ½h a,   x₁ = x + h v½,   0 ≤ λ₁ ⊥ g(x₁) + C λ₁ + δ(λ₁) ≥ 0,   a₁ = M⁻¹(f + Wᵀλ₁ − K x₁ − damping at v½ +
 * ½h a),   v₁ = v½ + ½h a₁
 *
 * 2nd order while contacts keep their status; stable while ¼h²ω² + hχ < 1 with all contacts closed (eq. 16a): ω² of the
 * stiffness, χ of the dashpots, which are taken explicitly. Accelerations are kept where dg4 keeps forces. */
#include "model/gk_core.h"

enum { PLACES_TRIED = 8, POWER = 150 };
static const double FIRST = 1e-6; /* s: where the search for the limit begins */

/* trial state ← positions and speeds after h with the accelerations at its start */
static void approach(const gk_setup *setup, const gk_data *data, double h)
{
    gk_work *work = setup->work;
    const gk_real *q = data->modal, step = (gk_real)h, half = (gk_real)(0.5 * h);
    for (int d = 0; d < RIGID; d++) {
        work->trial_rigid[d] = data->x[d] + h * (data->v[d] + 0.5 * h * data->f[d]);
        work->trial_rigid[RIGID + d] = data->v[d] + h * data->f[d]; /* the speed that dampers see */
    }
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        const gk_real *v = q + n, *a = v + n;
        for (int i = 0; i < n; i++) {
            work->trial[g][i] = q[i] + step * (v[i] + half * a[i]);
            work->trial[g][n + i] = v[i] + step * a[i];
        }
        q += 3 * n;
    }
}

/* positions of the trial state, speeds by the mean of both accelerations */
static void arrive(const gk_setup *setup, gk_data *data, double h)
{
    const gk_work *work = setup->work;
    gk_real *q = data->modal;
    const gk_real half = (gk_real)(0.5 * h);
    for (int d = 0; d < RIGID; d++) {
        const double a = work->stage_rigid[0][RIGID + d];
        data->v[d] += 0.5 * h * (data->f[d] + a);
        data->x[d] = work->trial_rigid[d];
        data->f[d] = a;
    }
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        const gk_real *a = work->stage[g][0] + n;
        for (int i = 0; i < n; i++) {
            q[i] = work->trial[g][i];
            q[n + i] += half * (q[2 * n + i] + a[i]);
            q[2 * n + i] = a[i];
        }
        q += 3 * n;
    }
}

static int overlaps(const gk_model *model, const gk_work *work)
{
    for (int p = 0; p < work->places; p++)
        if (work->place[p].gap < -model->overlap_max) return 1;
    return 0;
}

/* One step of length h. GK_OK, or GK_DIVERGED / GK_PENETRATION with data unchanged. γ has no meaning here. */
gk_outcome gk_central_step(const gk_model *model, const gk_setup *setup, gk_data *data, double h, double gamma)
{
    gk_work *work = setup->work;
    const gk_coefficients *k = &work->explicit_rows;
    (void)gamma;
    for (int g = 0; g < 2; g++) work->outer_speed[g] = (work->outer[g] - work->outer_before[g]) / h;
    if (!(data->rk_h >
          0.0)) { /* the first step: what stands where accelerations belong are the forces of the equilibrium */
        approach(setup, data, 0.0);
        if (!gk_rk45_evaluate(model, setup, data, k, 0, work->outer_before)) return GK_DIVERGED;
        arrive(setup, data, 0.0);
        data->rk_h = h;
    }
    approach(setup, data, h);
    const double outer[2] = {work->outer[0], work->outer[1]};
    if (!gk_rk45_evaluate(model, setup, data, k, 0, outer)) return GK_DIVERGED;
    if (overlaps(model, work)) return GK_PENETRATION;
    arrive(setup, data, h);
    gk_step_remember(setup, data);
    gk_rk45_angles(setup, data);
    data->rounds += work->system.rounds;
    data->steps++;
    memcpy(work->system.force0, work->system.z, sizeof work->system.z); /* reported force: that of the end */
    return GK_OK;
}

#ifndef GK_WIDE
/* What the undamped scheme keeps while contacts keep their status and the law is straight: ½ v M v + V(x) − ⅛h² a M a,
 * V with the contacts' energy */
double gk_central_energy(const gk_setup *setup, const gk_data *data, double h)
{
    const gk_real *q = data->modal;
    double sum = 0.0;
    for (int d = 0; d < RIGID; d++)
        if (setup->inverse_mass[d] > 0.0) sum += data->f[d] * data->f[d] / setup->inverse_mass[d];
    for (int g = 0; g < 2; g++) {
        const int n = setup->modal[g].n;
        for (int i = 0; i < n; i++) sum += (double)q[2 * n + i] * q[2 * n + i];
        q += 3 * n;
    }
    return gk_step_energy(setup, data, &setup->work->explicit_rows) - 0.125 * h * h * sum;
}

/* Cholesky factor of the whole massless compliance at a position, contacts closed under the full load (that is
 * stiffest); 0: not positive */
static int closed(const gk_model *model, const gk_setup *setup, double position)
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    const double full = model->torque_max / (model->gear[0].r_b * setup->width);
    gk_data empty;
    memset(&empty, 0, sizeof empty);
    memset(work->frame, 0, sizeof work->frame);
    memset(work->speed, 0, sizeof work->speed);
    work->frame[PHIA] = 2.0 * GK_PI * position / model->gear[0].teeth;
    work->frame[PHIB] = -work->frame[PHIA] * model->gear[0].r_b / model->gear[1].r_b;
    if (model->kind == KIND_FLAT) work->frame[XB] = -model->distance, work->frame[PHIA] = work->frame[PHIB] = 0.0;
    work->y[0] = work->zero[0], work->y[1] = work->zero[1];
    work->places = gk_flank_find(model, setup, work->frame, 50e-6, work->place);
    if (work->places < 0) return work->places = 0, 0;
    for (int p = 0; p < work->places; p++) work->place[p].memory = -1;
    gk_rows_form(model, setup, work->frame, work);
    gk_system_form(model, setup, &empty, &work->explicit_rows, work);
    for (int i = 0; i < s->n; i++) {
        s->active[i] = s->kind[i] == ROW_CONTACT || s->kind[i] == ROW_SPRING;
        s->slope[i] = i < s->contacts ? gk_law_at(&s->local[s->place_of[i]], s->width[i], full * s->width[i]).slope
                                      : 0.0;
    }
    gk_limit_compliance(s, full, 0, s->J);
    return gk_limit_cholesky(s->J, s->n);
}

typedef struct quotient {
    double stiff, damped;
} quotient; /* ω², χ of a shape */

/* One round of power iteration with ¼h² M⁻¹(K + WᵀC⁻¹W) + h M⁻¹(damping + WᵀC⁻¹ S c S C⁻¹W) on the trial speeds;
 * returns Rayleigh's quotients of both parts */
static quotient round_of_power(const gk_setup *setup, double h)
{
    gk_work *work = setup->work;
    gk_system *s = &work->system;
    const gk_real *u[2] = {work->trial[0] + setup->modal[0].n, work->trial[1] + setup->modal[1].n};
    const double stiff = 0.25 * h * h;
    double *r = work->trial_rigid + RIGID, y[MAX_STRIDE], c[MAX_STRIDE], both[MAX_STRIDE], next[RIGID], down = 0.0,
           size = 0.0;
    quotient up = {0.0, 0.0};
    work->outer_speed[0] = work->outer_speed[1] = 0.0;
    gk_system_rates(setup, work, u, r, y);
    for (int i = 0; i < s->n; i++)
        if (!s->active[i]) y[i] = 0.0;
    gk_limit_solve(s->J, y, s->n);
    memcpy(c, y, (size_t)s->n * sizeof *c);
    gk_rk45_resist(setup, s, c);
    for (int i = 0; i < s->n; i++) up.damped += y[i] * c[i];
    gk_limit_solve(s->J, c, s->n);
    for (int i = 0; i < s->n; i++) both[i] = stiff * y[i] + h * c[i];
    for (int d = 0; d < RIGID; d++) {
        double force = 0.0;
        next[d] = 0.0;
        for (int i = 0; i < s->n; i++)
            force += s->rigid[d][i] * y[i], next[d] += s->rigid[d][i] * both[i] * setup->inverse_mass[d];
        if (setup->inverse_mass[d] > 0.0)
            up.stiff += r[d] * force, down += r[d] * r[d] / setup->inverse_mass[d],
                size += next[d] * next[d] / setup->inverse_mass[d];
    }
    for (int g = 0; g < 2; g++) {
        const gk_modal *m = &setup->modal[g];
        if (!m->n) continue;
        gk_step_scatter(setup, g, y, both, work->force[g], work->reading[g]);
        for (int j = 0; j < m->n; j++) {
            const double of_mode = GK_ON(setup, modal_damping) ? 2.0 * m->zeta[j] * m->omega[j] : 0.0, x = u[g][j];
            const double a = work->reading[g][j] + (stiff * m->omega2[j] + h * of_mode) * x;
            up.stiff += ((double)m->omega2[j] * x + work->force[g][j]) * x, up.damped += of_mode * x * x;
            down += x * x, size += a * a;
            work->stage[g][0][j] = (gk_real)a;
        }
    }
    const double scale = size > 0.0 ? 1.0 / sqrt(size) : 0.0;
    for (int d = 0; d < RIGID; d++) r[d] = next[d] * scale;
    for (int g = 0; g < 2; g++)
        for (int j = 0; j < setup->modal[g].n; j++)
            work->trial[g][setup->modal[g].n + j] = (gk_real)(work->stage[g][0][j] * scale);
    return down > 0.0 ? (quotient){up.stiff / down, up.damped / down} : (quotient){0.0, 0.0};
}

/* Largest stable step over the roll positions, all candidate contacts closed (fewer are softer): ¼h²ω² + hχ = 1 (eq.
 * 16a) for the shape that is worst at this h */
double gk_central_limit(const gk_model *model, const gk_setup *setup)
{
    gk_work *work = setup->work;
    double smallest = INFINITY;
    for (int i = 0; i < (model->kind == KIND_FLAT ? 1 : PLACES_TRIED); i++) {
        double h = FIRST;
        if (!closed(model, setup, (double)i / PLACES_TRIED)) continue;
        for (int d = 0; d < RIGID; d++)
            work->trial_rigid[RIGID + d] = setup->inverse_mass[d] > 0.0 ? sqrt(setup->inverse_mass[d]) : 0.0;
        for (int g = 0; g < 2; g++)
            for (int j = 0; j < setup->modal[g].n; j++)
                work->trial[g][setup->modal[g].n + j] = setup->modal[g].omega[j] > 0.0 ? (gk_real)(1.0 + 0.1 * (j % 7))
                                                                                       : 0;
        for (int round = 0; round < POWER; round++) {
            const quotient of = round_of_power(setup, h);
            h = of.stiff > 0.0 ? 2.0 / (sqrt(of.stiff + of.damped * of.damped) + of.damped) : INFINITY;
            if (!(h < INFINITY)) break;
        }
        smallest = gk_min(smallest, h);
    }
    return smallest;
}
#endif
