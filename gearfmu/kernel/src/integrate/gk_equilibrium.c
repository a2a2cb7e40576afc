/* What statics solve for (docs/theory.md, 4): spins, dynamic oscillators of the ground group, soft modes of gears with
 * several engagements. The forces that are left on them, and the tangent of these over the active rows W of the
 * island's engagements, K = diag(0, ω²) + Σ Wᵀ J⁻¹ W. */
#include "integrate/gk_equilibrium.h"
#include "integrate/gk_motions.h"
#include "problem/gk_exchange.h"

/* Lists the unknowns. Soft modes are those of a gear with several engagements through which these feel each other:
 * softer, with the gear's own mass, than a few per cent of a contact. */
void gk_equilibrium_unknowns(gk_equilibrium *r)
{
    const gk_base *base = &r->setup.base;
    int count = r->setup.spins + base->n;
    for (int g = 0; g < r->model->gears; g++) {
        const gk_modal *m = &r->setup.modal[g];
        const double *x = base->centre[g] + base->from[g], mobility = gk_dot_quads(x, x, base->width[g] / 4);
        const double yields = r->model->gear[g].local / r->model->gear[g].width;
        r->soft[g] = 0, r->soft_at[g] = count;
        for (int i = 0; i < m->n && r->setup.engagements_of[g] > 1 && r->soft[g] < MAX_SOFT; i++)
            if (m->omega[i] > 0.0 && mobility > yields * m->omega[i] * m->omega[i]) r->lane[g][r->soft[g]++] = i;
        count += r->soft[g];
    }
    r->unknowns = count;
}

/* moves the unknowns by a share of the move */
void gk_equilibrium_go(gk_equilibrium *r, double share)
{
    GK_ASSERT(gk_finite(share));
    const int spins = r->setup.spins;
    for (int d = 0; d < spins; d++) GK_OF(r->data, x)[d] += share * r->move[d];
    for (int i = 0; i < r->setup.base.n; i++) r->work->rest_ground[i] += share * r->move[spins + i];
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++)
            r->work->rest_modes[g][r->lane[g][i]] += (gk_real)(share * r->move[r->soft_at[g] + i]);
}

/* Fills the forces that are left, by the contact problems as they have been solved. */
void gk_equilibrium_forces(gk_equilibrium *r)
{
    GK_ASSERT(r->force && r->unknowns >= r->setup.spins + r->setup.base.n);
    const gk_base *base = &r->setup.base;
    const int spins = r->setup.spins;
    for (int d = 0; d < spins; d++) r->force[d] = r->given[d];
    for (int e = 0; e < r->model->engagements; e++) {
        const gk_mesh *mesh = &r->setup.mesh[e];
        const gk_system *s = &r->work->engaged[e].system;
        for (int l = 0; l < mesh->spins && gk_equilibrium_has(r, e); l++)
            r->force[mesh->spin[l]] += gk_dot_quads(s->rigid[l], s->z, s->stride / 4);
    }
    for (int d = 0; d < spins; d++)
        if (!gk_equilibrium_moves(r, d)) r->force[d] = 0.0;
    gk_exchange_scatter(r->model, &r->setup, r->work, gk_step_force, gk_step_force);
    gk_frame_load(r->model, &r->setup, r->data, r->work->ground_force);
    for (int i = 0; i < base->n; i++)
        r->force[spins + i] = r->work->ground_force[i] - base->omega2[i] * r->work->rest_ground[i];
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++) {
            const int lane = r->lane[g][i];
            const double omega = r->setup.modal[g].omega[lane];
            r->force[r->soft_at[g] + i] = (double)r->work->force[g][lane] -
                                          omega * omega * (double)r->work->rest_modes[g][lane];
        }
}

/* row of an engagement on the soft modes of a side's gear */
static double *soft_row(const gk_equilibrium *r, int w, int row)
{
    return r->work->soft_rows + (w * MAX_ROWS + row) * MAX_SOFT;
}

/* Fills the rows of an engagement on the soft modes of both gears. */
static void find_soft_rows(gk_equilibrium *r, int e)
{
    const gk_system *s = &r->work->engaged[e].system;
    const gk_rows rows = gk_rows_of_gaps(&r->setup, r->work, e);
    for (int w = 0; w < 2; w++) {
        const int g = r->setup.mesh[e].side[w].gear, n = r->setup.modal[g].n;
        for (int row = 0; row < s->contacts && r->soft[g]; row++) {
            double unit[MAX_STRIDE] = {0};
            gk_real *out = r->work->trial[g];
            memset(out, 0, 2 * (size_t)n * sizeof *out);
            unit[row] = 1.0;
            gk_exchange_push_modes(&rows, w, unit, unit, out, out + n);
            for (int i = 0; i < r->soft[g]; i++) soft_row(r, w, row)[i] = (double)out[r->lane[g][i]];
        }
    }
}

/* the unknowns that an engagement's rows read: spins, lanes of its part of the ground group, soft modes of both
 * gears */
static int own_unknowns(const gk_equilibrium *r, int e)
{
    const gk_mesh *mesh = &r->setup.mesh[e];
    return mesh->spins + mesh->local + r->soft[mesh->side[0].gear] + r->soft[mesh->side[1].gear];
}

/* Column of one of them, 0 in rows that are not active. Returns its number among all. */
static int own_unknown(const gk_equilibrium *r, int e, int local, double *column)
{
    const gk_mesh *mesh = &r->setup.mesh[e];
    const gk_engaged *engaged = &r->work->engaged[e];
    const gk_system *s = &engaged->system;
    const int lane = local - mesh->spins, mode = lane - mesh->local, first = r->soft[mesh->side[0].gear];
    const int w = mode >= first, width = mesh->part[0].width;
    for (int i = 0; i < s->stride; i++) column[i] = 0.0;
    for (int i = 0; i < s->n; i++) {
        if (!s->active[i]) continue;
        if (lane < 0)
            column[i] = s->rigid[local][i];
        else if (mode < 0)
            column[i] = engaged->ground[(size_t)i * mesh->local + lane];
        else if (i < s->contacts)
            column[i] = soft_row(r, w, i)[mode - w * first];
    }
    if (lane < 0) return mesh->spin[local];
    if (mode >= 0) return r->soft_at[mesh->side[w].gear] + mode - w * first;
    return r->setup.spins + (lane < width ? mesh->part[0].from + lane : mesh->part[1].from + lane - width);
}

/* adds Wᵀ J⁻¹ W of an engagement */
static void add_tangent(gk_equilibrium *r, int e)
{
    gk_system *s = &r->work->engaged[e].system;
    const int own = own_unknowns(r, e);
    double column[MAX_STRIDE], other[MAX_STRIDE];
    if (!s->n) return;
    gk_tangent_factorise(s);
    find_soft_rows(r, e);
    for (int a = 0; a < own; a++) {
        const int i = own_unknown(r, e, a, column);
        gk_tangent_solve(s, column);
        for (int b = 0; b <= a; b++) {
            const int j = own_unknown(r, e, b, other);
            const double k = gk_dot_quads(column, other, s->stride / 4);
            r->tangent[(size_t)i * r->unknowns + j] += k;
            if (a != b) r->tangent[(size_t)j * r->unknowns + i] += k;
        }
    }
}

/* Fills the tangent of the forces that are left; those on spins that stand become 0. */
void gk_equilibrium_tangent(gk_equilibrium *r)
{
    GK_ASSERT(r->tangent && r->loose > 0.0);
    const int n = r->unknowns, spins = r->setup.spins;
    memset(r->tangent, 0, (size_t)(n * n) * sizeof *r->tangent);
    for (int d = 0; d < spins; d++) {
        const double inverse = r->setup.inverse_inertia[d];
        r->tangent[(size_t)d * n + d] = gk_equilibrium_moves(r, d) && inverse > 0.0 ? 1.0 / (r->loose * inverse) : 1.0;
    }
    for (int i = 0; i < r->setup.base.n; i++)
        r->tangent[(size_t)(spins + i) * n + spins + i] = r->setup.base.omega2[i] > 0.0 ? r->setup.base.omega2[i] : 1.0;
    for (int g = 0; g < r->model->gears; g++)
        for (int i = 0; i < r->soft[g]; i++) {
            const double omega = r->setup.modal[g].omega[r->lane[g][i]];
            r->tangent[(size_t)(r->soft_at[g] + i) * (size_t)(n + 1)] = omega * omega;
        }
    for (int e = 0; e < r->model->engagements; e++)
        if (gk_equilibrium_has(r, e)) add_tangent(r, e);
    gk_motions_hold(r);
    for (int d = 0; d < spins; d++) { /* what stands */
        if (gk_equilibrium_moves(r, d) && r->setup.inverse_inertia[d] > 0.0) continue;
        for (int i = 0; i < n; i++) r->tangent[(size_t)d * n + i] = r->tangent[(size_t)i * n + d] = i == d;
        r->force[d] = 0.0;
    }
}
