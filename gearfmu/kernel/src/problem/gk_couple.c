/* Engagements that share a rotor. Each has a problem of its own, solved with the others' forces as they are; what those do
 * to its gaps goes through the spins and the ground group, gathered and scattered, never through one dense system. Block
 * Gauss–Seidel: in M = D + C′ a rigid coordinate enters with h²/12 at γ = 1, so that two or three sweeps suffice. The sum
 * of all parts is exact, so is the energy they are balanced with. */
#include "problem/gk_work.h"

enum { SWEEPS = 40, D_PART = 0, FORCE_PART = 1, DAMPER_PART = 2, PARTS = 3 };
#ifdef GK_DOUBLE_MODES
static const double TOLERANCE = 1e-11;
#else
static const double TOLERANCE = 1e-7; /* of the largest gap and deflection */
#endif

/* forces of an engagement by what they meet: z (D), λ (A), the dampers' at the end (A) */
static void forces_of(const gk_system *s, double x[PARTS][MAX_STRIDE])
{
    for (int i = 0; i < s->stride; i++) {
        const int row = i < s->n, clutch = row && s->kind[i] == ROW_CLUTCH;
        x[D_PART][i] = row ? s->z[i] : 0.0;
        x[FORCE_PART][i] = row && !clutch ? s->force[i] : 0.0;
        x[DAMPER_PART][i] = row && !clutch ? s->end[i] : 0.0;
    }
}

/* what an engagement's forces give to spins, ground group and the far part of the residual */
static void give(const gk_setup *setup, gk_work *work, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    const gk_system *s = &engaged->system;
    double x[PARTS][MAX_STRIDE];
    forces_of(s, x);
    for (int part = 0; part < PARTS; part++) {
        double *ground = engaged->given_ground + part * setup->base.n;
        memset(ground, 0, (size_t)setup->base.n * sizeof *ground);
        gk_rows_push_ground(setup, engaged, e, x[part], ground);
        for (int l = 0; l < setup->mesh[e].spins; l++)
            engaged->given_spin[part][l] = gk_dot_quads(s->rigid[l], x[part], s->stride / 4);
    }
    for (int w = 0; w < 2; w++) {
        const int g = setup->mesh[e].side[w].gear;
        const size_t n = (size_t)setup->modal[g].n;
        if (setup->engagements_of[g] < 2) continue;
        memset(engaged->given_modes[w], 0, PARTS * n * sizeof(gk_real));
        for (int part = 0; part < PARTS; part++)
            gk_rows_push_modes(setup, work, e, w, x[part], engaged->given_modes[w] + (size_t)part * n);
    }
    memset(engaged->given_far, 0, 2 * (size_t)setup->far * sizeof *engaged->given_far);
    gk_rows_push_far(setup, work, e, x[FORCE_PART], engaged->given_far);
    gk_rows_push_far(setup, work, e, x[DAMPER_PART], engaged->given_far + setup->far);
}

/* sums over the other engagements of the island, weighed: what they do per unit row */
typedef struct field {
    double spin[PARTS][MAX_SPINS];
    double *ground[PARTS], *far[2];
} field;

static field others(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_coefficients *k, int island,
                    int e)
{
    const int n = setup->base.n;
    field f = {.ground = {work->far, work->far + n, work->far + 2 * n},
               .far = {work->far + 3 * n, work->far + 3 * n + setup->far}};
    memset(work->far, 0, (size_t)(3 * n + 2 * setup->far) * sizeof *work->far);
    for (int c = 0; c < model->engagements; c++) {
        const gk_engaged *from = &work->engaged[c];
        if (c == e || setup->mesh[c].island != island) continue;
        for (int part = 0; part < PARTS; part++) {
            for (int l = 0; l < setup->mesh[c].spins; l++)
                f.spin[part][setup->mesh[c].spin[l]] += from->given_spin[part][l];
            gk_axpy(1.0, from->given_ground + part * n, f.ground[part], 0, n / 4);
        }
        for (int i = 0; i < setup->far; i++)
            f.far[0][i] += from->given_far[i], f.far[1][i] += from->given_far[setup->far + i];
    }
    for (int i = 0; i < n; i++) {
        f.ground[D_PART][i] *= k->ground.mobility[i];
        f.ground[FORCE_PART][i] *= k->ground.kappa[i];
        f.ground[DAMPER_PART][i] *= k->ground.kappa[i];
    }
    for (int d = 0; d < setup->spins; d++) {
        f.spin[D_PART][d] *= k->rigid_mobility * setup->inverse_inertia[d];
        f.spin[FORCE_PART][d] *= k->rigid_kappa * setup->inverse_inertia[d];
        f.spin[DAMPER_PART][d] *= k->rigid_kappa * setup->inverse_inertia[d];
    }
    return f;
}

/* adds what the rows of an engagement read of a gear's modes under the forces of its other engagements */
static void take_modes(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e,
                       int which, double read[PARTS][MAX_STRIDE])
{
    const int g = setup->mesh[e].side[which].gear, n = setup->modal[g].n;
    gk_real *sum = work->scaled;
    for (int part = 0; part < PARTS; part++) {
        const gk_real *by = part == D_PART ? k->flow[g].mobility : k->flow[g].kappa;
        memset(sum, 0, (size_t)n * sizeof *sum);
        for (int c = 0; c < model->engagements; c++)
            for (int w = 0; w < 2 && c != e; w++) {
                const gk_real *given = work->engaged[c].given_modes[w] + part * n;
                for (int i = 0; i < n && setup->mesh[c].side[w].gear == g; i++) sum[i] += given[i];
            }
        for (int i = 0; i < n; i++) sum[i] *= by[i];
        gk_rows_read_modes(setup, work, e, which, sum, read[part]);
    }
}

/* what the others do to the rows of an engagement: gaps in the step (outer), deflection at once (beyond). Returns how much
 * that has changed, against the largest gap and deflection. */
static double take(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_coefficients *k, int e)
{
    gk_engaged *engaged = &work->engaged[e];
    gk_system *s = &engaged->system;
    field f = others(model, setup, work, k, setup->mesh[e].island, e);
    double read[PARTS][MAX_STRIDE], far[2][MAX_STRIDE], change = 0.0, scale = 1e-12;
    for (int part = 0; part < PARTS; part++) {
        gk_rows_read_ground(setup, engaged, e, f.ground[part], read[part]);
        for (int l = 0; l < setup->mesh[e].spins; l++)
            gk_axpy(f.spin[part][setup->mesh[e].spin[l]], s->rigid[l], read[part], 0, s->stride / 4);
    }
    for (int w = 0; w < 2; w++)
        if (setup->engagements_of[setup->mesh[e].side[w].gear] > 1) take_modes(model, setup, work, k, e, w, read);
    for (int i = 0; i < 2; i++) gk_rows_read_far(model, setup, work, e, f.far[i], far[i]);
    for (int i = 0; i < s->n; i++) {
        const int clutch = s->kind[i] == ROW_CLUTCH;
        const double outer = read[D_PART][i] + (clutch ? 0.0 : far[1][i] - read[DAMPER_PART][i]);
        const double beyond = clutch ? 0.0 : far[0][i] - read[FORCE_PART][i];
        change = gk_max(change, fabs(outer + beyond - s->outer[i] - s->beyond[i]));
        scale = gk_max(scale, fabs(s->g[i]) + fabs(s->Dz[i]) + fabs(s->Al[i]));
        s->outer[i] = outer, s->beyond[i] = beyond;
    }
    return change / scale;
}

/* sweeps until what engagements do to each other no longer changes */
static void sweep(const gk_island *island)
{
    const gk_coupled *c = island->context;
    double change = INFINITY;
    for (int e = 0; e < c->model->engagements; e++)
        if (c->setup->mesh[e].island == c->island) give(c->setup, c->work, e);
    for (int round = 0; round < SWEEPS && !(change < TOLERANCE); round++) {
        change = 0.0;
        for (int e = 0; e < c->model->engagements; e++) {
            if (c->setup->mesh[e].island != c->island) continue;
            change = gk_max(change, take(c->model, c->setup, c->work, c->k, e));
            gk_solve_contacts(&c->work->engaged[e].system);
            give(c->setup, c->work, e);
        }
    }
    if (!(change < TOLERANCE)) island->member[0]->limit_reached = 1;
}

gk_island gk_couple_island(gk_coupled *c)
{
    gk_island island = {.context = c};
    for (int e = 0; e < c->model->engagements; e++)
        if (c->setup->mesh[e].island == c->island) island.member[island.count++] = &c->work->engaged[e].system;
    island.sweep = island.count > 1 ? sweep : NULL;
    return island;
}

/* the start of the step: under λ0 the others deflect too */
void gk_couple_recall(gk_coupled *c)
{
    for (int e = 0; e < c->model->engagements; e++)
        if (c->setup->mesh[e].island == c->island) give(c->setup, c->work, e);
    for (int e = 0; e < c->model->engagements; e++) {
        gk_system *s = &c->work->engaged[e].system;
        if (c->setup->mesh[e].island != c->island) continue;
        take(c->model, c->setup, c->work, c->k, e);
        for (int i = 0; i < s->n; i++) {
            if (s->kind[i] == ROW_CLUTCH) continue;
            if (i >= s->contacts || s->recalled[i]) s->g0[i] -= s->beyond[i];
            s->stored0 += 0.5 * s->force0[i] * s->beyond[i];
        }
    }
}
