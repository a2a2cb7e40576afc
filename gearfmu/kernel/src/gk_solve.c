/* The complementarity problem of a step and the one scalar that keeps its energy (docs/theory.md, eqs. 10 and 12; discrete gradient after Gonzalez 1996).
 *
 *   closed contact, bilateral row, sticking clutch:   g + D z + C′λ + δ(λ) = 0,   z = λ + η;   open contact: λ = 0 and g + D z + C′λ ≥ 0;   slipping clutch: z = ±bound.
 *   η = α·direction + dashpot; the dashpot on the massless path of a row that is closed at both ends is 2c/h times the change of the path's deflection (C′ + K)λ + δ
 *   (K: the κ part, so that C′ + K is the compliance itself), limited to |λ₀ + λ₁| (no pull).
 * Active-set Newton: tangent J = D (I + (2c/h)(C″ + K)) + C″, C″ = C′ + diag δ′, of the active rows, LU with partial pivoting; chord steps; all violated rows flip at once, after four rounds
 * without progress only the last one (block principal pivoting, Júdice & Pires 1994). */
#include "gk_core.h"

enum { ROUND_LIMIT = 40, CHORD_LIMIT = 12, ENERGY_LIMIT = 12 };
#ifdef GK_DOUBLE_MODES
static const double SOLVED = 1e-11, STEADY_BALANCE = 1e-9;
#else
static const double SOLVED = 1e-9, STEADY_BALANCE = 1e-7; /* rows in float are good to 1e-7 */
#endif
static const double BALANCE = 1e-9; /* relative defect of energy left after a change of status */

static int is_contact(const gk_system *s, int i) { return s->kind[i] == ROW_CONTACT; }
static int is_clutch(const gk_system *s, int i) { return s->kind[i] == ROW_CLUTCH; }

/* columns that can carry force: active rows, given torques, clutches, open contacts that η reaches */
static void list_columns(gk_system *s)
{
    s->columns = 0;
    for (int i = 0; i < s->n; i++)
        if (s->active[i] || s->kind[i] == ROW_TORQUE || is_clutch(s, i) || s->direction[i] != 0.0) s->column[s->columns++] = i;
}

static double times(const gk_system *s, const double *matrix, int i, const double *x)
{
    const double *row = matrix + (size_t)i * s->n;
    double sum = 0.0;
    for (int c = 0; c < s->columns; c++) sum += row[s->column[c]] * x[s->column[c]];
    return sum;
}

double gk_solve_massless(const gk_system *s, int i)
{ /* (C′λ)ᵢ + δ(λᵢ) */
    double slope, sum = times(s, s->C, i, s->force);
    return is_contact(s, i) ? sum + gk_law_approach(&s->local[i], s->force[i], &slope) : sum;
}

double gk_solve_end_gap(const gk_system *s, int i) { return s->g[i] + times(s, s->D, i, s->z); } /* g₁ = g + D z */

/* path = C′λ + δ of the active rows and, where a dashpot may act, the deflection of the massless path; z of every row from λ, α and the dashpots */
static void total_force(gk_system *s)
{
    for (int a = 0; a < s->rank; a++) {
        const int i = s->map[a];
        s->path[i] = gk_solve_massless(s, i);
        if (s->damping[i] != 0.0) s->squeeze[i] = s->path[i] + times(s, s->K, i, s->force);
    }
    for (int i = 0; i < s->n; i++) {
        s->eta[i] = s->alpha * s->direction[i];
        if (s->active[i] && s->clip[i] != 2)
            s->eta[i] += s->clip[i] ? s->clip[i] * (s->force0[i] + s->force[i]) : s->damping[i] != 0.0 ? s->damping[i] * (s->squeeze[i] - s->squeeze0[i]) : 0.0;
        if (!is_clutch(s, i)) s->z[i] = s->force[i] + s->eta[i];
        else if (s->active[i]) s->z[i] = s->force[i];
    }
}

/* J = D (I + (2c/h) (C″ + K)) + C″ of the active rows at the present λ: C″ + K is gathered into rows without gaps first, so that the product runs over contiguous memory */
static void tangent(gk_system *s)
{
    const int n = s->n, m = s->rank;
    double *J = s->J, *squeeze = J + (size_t)m * m;
    for (int a = 0; a < m; a++) {
        const double *c = s->C + (size_t)s->map[a] * n, *kappa = s->K + (size_t)s->map[a] * n;
        for (int b = 0; b < m; b++) squeeze[a * m + b] = c[s->map[b]] + kappa[s->map[b]];
        squeeze[a * m + a] += s->slope[s->map[a]];
    }
    for (int a = 0; a < m; a++) {
        const double *d = s->D + (size_t)s->map[a] * n;
        double *row = J + (size_t)a * m;
        for (int b = 0; b < m; b++) {
            const int j = s->map[b];
            row[b] = d[j] * (s->clip[j] == 2 ? 1.0 : 1.0 + s->clip[j]) + s->C[(size_t)s->map[a] * n + j];
        }
        row[a] += s->slope[s->map[a]];
        for (int e = 0; e < m; e++) {
            const int k = s->map[e];
            if (s->damping[k] == 0.0 || s->clip[k]) continue;
            const double weight = d[k] * s->damping[k], *c = squeeze + (size_t)e * m;
            for (int b = 0; b < m; b++) row[b] += weight * c[b];
        }
    }
}

/* the tangent as LU with partial pivoting */
static void factorise(gk_system *s)
{
    double *J = s->J;
    s->rank = 0;
    for (int i = 0; i < s->n; i++) {
        s->slope[i] = 0.0;
        if (!s->active[i]) continue;
        if (is_contact(s, i)) gk_law_approach(&s->local[i], s->force[i], &s->slope[i]);
        s->map[s->rank++] = i;
    }
    const int m = s->rank;
    tangent(s);
    for (int k = 0; k < m; k++) {
        int best = k;
        for (int a = k + 1; a < m; a++)
            if (fabs(J[(size_t)a * m + k]) > fabs(J[(size_t)best * m + k])) best = a;
        s->pivot[k] = best;
        if (best != k)
            for (int b = 0; b < m; b++) {
                double t = J[(size_t)k * m + b];
                J[(size_t)k * m + b] = J[(size_t)best * m + b];
                J[(size_t)best * m + b] = t;
            }
        const double inverse = 1.0 / J[(size_t)k * m + k];
        for (int a = k + 1; a < m; a++) {
            double *row = J + (size_t)a * m;
            const double f = row[k] *= inverse;
            if (f != 0.0)
                for (int b = k + 1; b < m; b++) row[b] -= f * J[(size_t)k * m + b];
        }
    }
    s->rounds++;
}

static void back_solve(const gk_system *s, double *x)
{
    const int m = s->rank;
    const double *J = s->J;
    for (int k = 0; k < m; k++) {
        double t = x[s->pivot[k]];
        x[s->pivot[k]] = x[k];
        x[k] = t;
    }
    for (int a = 1; a < m; a++)
        for (int b = 0; b < a; b++) x[a] -= J[(size_t)a * m + b] * x[b];
    for (int a = m - 1; a >= 0; a--) {
        for (int b = a + 1; b < m; b++) x[a] -= J[(size_t)a * m + b] * x[b];
        x[a] /= J[(size_t)a * m + a];
    }
}

/* λ of the active rows for the present set: chord iteration, tangent renewed when it is slow. Only the local law and its dashpots are not linear, so that after the first residual
 * what a step leaves is e + D K e with e = δ(λ + x) − δ(λ) − δ′x. */
static void newton(gk_system *s)
{
    double x[MAX_ROWS], e[MAX_ROWS], last = INFINITY;
    list_columns(s);
    factorise(s);
    total_force(s);
    for (int a = 0; a < s->rank; a++) x[a] = -(gk_solve_end_gap(s, s->map[a]) + s->path[s->map[a]]);
    for (int round = 0; round < CHORD_LIMIT; round++) {
        double change = 0.0, size = 0.0, unused;
        back_solve(s, x);
        for (int a = 0; a < s->rank; a++) {
            const int i = s->map[a];
            e[a] = 0.0;
            if (is_contact(s, i)) e[a] = -gk_law_approach(&s->local[i], s->force[i], &unused) - s->slope[i] * x[a];
            s->force[i] += x[a];
            if (is_contact(s, i)) e[a] += gk_law_approach(&s->local[i], s->force[i], &unused);
            change = gk_max(change, fabs(x[a]));
            size = gk_max(size, fabs(s->force[i]));
        }
        if (!s->curved || !(change > SOLVED * size)) break;
        for (int a = 0; a < s->rank; a++) {
            x[a] = -e[a];
            for (int b = 0; b < s->rank; b++)
                if (s->clip[s->map[b]] == 0) x[a] -= s->D[(size_t)s->map[a] * s->n + s->map[b]] * s->damping[s->map[b]] * e[b];
        }
        if (change > 0.2 * last) {
            factorise(s);
            total_force(s);
            for (int a = 0; a < s->rank; a++) x[a] = -(gk_solve_end_gap(s, s->map[a]) + s->path[s->map[a]]);
        }
        last = change;
    }
    total_force(s);
}

/* one row's verdict: does it contradict its status? */
static int violated(gk_system *s, int i)
{
    if (is_contact(s, i)) {
        if (s->active[i]) return s->force[i] < 0.0;
        return gk_solve_end_gap(s, i) + gk_solve_massless(s, i) < 0.0;
    }
    if (!is_clutch(s, i)) return 0;
    if (s->active[i]) return fabs(s->z[i]) > s->bound[i];
    return s->bound[i] > 0.0 && s->z[i] * gk_solve_end_gap(s, i) > 0.0; /* friction must oppose slip */
}

static void flip(gk_system *s, int i)
{
    s->active[i] = !s->active[i];
    if (is_clutch(s, i)) {
        if (!s->active[i]) s->z[i] = s->force[i] > 0.0 ? s->bound[i] : -s->bound[i];
        s->force[i] = 0.0;
    } else if (!s->active[i]) {
        s->force[i] = 0.0;
    }
}

/* dashpots: act where closed at both ends; limited so that they never pull */
static int limit_dashpots(gk_system *s)
{
    int changed = 0;
    for (int i = 0; i < s->contacts; i++) {
        signed char clip = 2;
        if (s->active[i] && s->force0[i] > 0.0 && s->damping[i] > 0.0) {
            double free = s->damping[i] * (s->squeeze[i] - s->squeeze0[i]), limit = s->force0[i] + s->force[i];
            clip = free > limit ? 1 : free < -limit ? -1 : 0;
        }
        changed |= clip != s->clip[i];
        s->clip[i] = clip;
    }
    return changed;
}

/* λ and z for the present α; starts from the present active set */
void gk_solve_contacts(gk_system *s)
{
    int fewest = MAX_ROWS + 1, patience = 4, dashpot_rounds = 3;
    for (int round = 0; round < ROUND_LIMIT; round++) {
        newton(s);
        unsigned char wrong[MAX_ROWS];
        int count = 0, last = -1;
        for (int i = 0; i < s->n; i++) {
            wrong[i] = (unsigned char)violated(s, i);
            if (wrong[i]) count++, last = i;
        }
        if (!count) {
            if (dashpot_rounds-- > 0 && limit_dashpots(s)) continue;
            return;
        }
        if (count < fewest) fewest = count, patience = 4;
        else patience--;
        if (patience < 0) flip(s, last);
        else
            for (int i = 0; i < s->n; i++)
                if (wrong[i]) flip(s, i);
        for (int i = 0; i < s->contacts; i++) /* a contact that opened has no dashpot */
            if (!s->active[i]) s->clip[i] = 2;
    }
    s->limit_reached = 1;
}

/* stored energy of the massless part: ½ λᵀC′λ + Σ Φ(λ) */
double gk_solve_stored(const gk_system *s, const double *force)
{
    double sum = 0.0;
    for (int i = 0; i < s->n; i++) {
        if (force[i] == 0.0) continue;
        const double *row = s->C + (size_t)i * s->n;
        double c = 0.0;
        for (int j = 0; j < s->n; j++) c += row[j] * force[j];
        sum += 0.5 * force[i] * c;
        if (is_contact(s, i)) sum += gk_law_energy(&s->local[i], force[i]);
    }
    return sum;
}

typedef struct balance { double defect, c1, c2, scale, rounding; } balance;

static int open_balance(const balance *b, double tolerance) { return !(fabs(b->defect) <= tolerance * b->scale + b->rounding); }

/* change of the gap over the step as the energy balance sees it: what a given torque does to the massless part is work from outside and counts with its massless displacement alone */
static double gap_change(const gk_system *s, int i)
{
    if (s->kind[i] == ROW_TORQUE) return -gk_solve_massless(s, i) - s->g0[i];
    return (s->active[i] ? -s->path[i] : gk_solve_end_gap(s, i)) - s->g0[i];
}

static double share(const gk_system *s, int i) { return 0.5 * (s->force0[i] + s->force[i] + s->alpha * s->direction[i]); } /* ½ (λ₀ + λ₁ + α d) */

/* Δ = U₁ − U₀ + ½ (λ₀ + λ₁ + α d)·(g₁ − g₀), and what earlier steps left of it: small defects of the same sign do not add up */
static balance defect(const gk_system *s)
{
    balance b = {s->due - s->stored0, 0.0, 0.0, fabs(s->stored0), 0.0};
    for (int i = 0; i < s->n; i++) {
        if (is_clutch(s, i) || (s->force[i] == 0.0 && s->force0[i] == 0.0 && s->direction[i] == 0.0)) continue;
        if (s->force[i] != 0.0) {
            double slope, approach = is_contact(s, i) ? gk_law_approach(&s->local[i], s->force[i], &slope) : 0.0, path = s->active[i] ? s->path[i] : gk_solve_massless(s, i);
            double energy = 0.5 * s->force[i] * (path - approach) + (is_contact(s, i) ? gk_law_energy(&s->local[i], s->force[i]) : 0.0);
            b.defect += energy;
            b.scale += fabs(energy);
        }
        const double change = gap_change(s, i);
        b.defect += share(s, i) * change;
        b.rounding += 4e-16 * (fabs(s->force0[i]) + fabs(s->force[i])) * fabs(change); /* a contact that only grazes */
    }
    return b;
}

/* expansion of Δ in α along the solved direction p = dλ/dα, w = dz/dα */
static void expand(const gk_system *s, const double *p, const double *w, balance *b)
{
    for (int i = 0; i < s->n; i++) {
        if (is_clutch(s, i)) continue;
        double Cp = times(s, s->C, i, p) + (is_contact(s, i) && p[i] != 0.0 ? s->slope[i] * p[i] : 0.0);
        double Dw = s->kind[i] == ROW_TORQUE ? -Cp : times(s, s->D, i, w), dw = p[i] + s->direction[i];
        if (s->force[i] == 0.0 && s->force0[i] == 0.0 && dw == 0.0) continue;
        b->c1 += s->force[i] * Cp + 0.5 * dw * gap_change(s, i) + share(s, i) * Dw;
        b->c2 += 0.5 * p[i] * Cp + 0.5 * dw * Dw;
    }
}

/* p = dλ/dα on the active rows, w = dz/dα everywhere */
static void sensitivity(const gk_system *s, double *p, double *w)
{
    double x[MAX_ROWS];
    memset(p, 0, (size_t)s->n * sizeof *p);
    for (int a = 0; a < s->rank; a++) x[a] = -times(s, s->D, s->map[a], s->direction);
    back_solve(s, x);
    for (int a = 0; a < s->rank; a++) p[s->map[a]] = x[a];
    for (int i = 0; i < s->n; i++) {
        w[i] = p[i] + s->direction[i];
        if (!s->active[i] || s->clip[i] == 2) continue;
        if (s->clip[i]) w[i] += s->clip[i] * p[i];
        else if (s->damping[i] != 0.0) w[i] += s->damping[i] * (times(s, s->C, i, p) + times(s, s->K, i, p) + (is_contact(s, i) ? s->slope[i] * p[i] : 0.0));
    }
}

/* Contacts alone, without the scalar: η is the dashpots' */
void gk_solve_plain(gk_system *s)
{
    s->alpha = 0.0;
    memset(s->direction, 0, (size_t)s->n * sizeof *s->direction);
    gk_solve_contacts(s);
}

static int status_changed(const gk_system *s)
{
    for (int i = 0; i < s->contacts; i++)
        if ((s->force0[i] > 0.0) != (s->force[i] > 0.0)) return 1;
    return 0;
}

/* the rows that share η: the contacts that are closed at either end; bearings, shafts and ports only where that finds no balance, because η on them rings their modes */
static void choose_direction(gk_system *s, int all_rows)
{
    for (int i = 0; i < s->n; i++) {
        const int may = is_contact(s, i) || (all_rows && s->kind[i] == ROW_SPRING);
        s->direction[i] = may && (s->force0[i] != 0.0 || s->force[i] != 0.0) ? s->weight[i] * gap_change(s, i) : 0.0;
    }
}

/* the step is balanced but for b: the next ones make that good */
static int leave(gk_system *s, const balance *b)
{
    s->owed += b->defect - s->due;
    return 1;
}

/* α by Newton on the quadratic; 0 when the limit of rounds is reached or no direction is left */
static int find_alpha(gk_system *s, balance b)
{
    double p[MAX_ROWS] = {0}, w[MAX_ROWS] = {0};
    for (int round = 0; round < ENERGY_LIMIT; round++) {
        list_columns(s);
        sensitivity(s, p, w);
        expand(s, p, w, &b);
        const double root = sqrt(gk_max(0.0, b.c1 * b.c1 - 4.0 * b.defect * b.c2)), divisor = b.c1 + (b.c1 < 0.0 ? -root : root);
        if (!(fabs(divisor) > 0.0)) return 0;
        const double a = -2.0 * b.defect / divisor;
        s->alpha += a;
        for (int i = 0; i < s->n; i++) s->force[i] += a * p[i];
        gk_solve_contacts(s);
        b = defect(s);
        if (!open_balance(&b, BALANCE)) return leave(s, &b);
    }
    return 0;
}

/* Solves the step: contacts first; where a contact changed status (or the law is curved) the scalar α that makes the massless part's energy change equal its work. */
void gk_solve_energy(gk_system *s)
{
    for (int all_rows = 0; all_rows < 2; all_rows++) {
        gk_solve_plain(s);
        const int changed = status_changed(s);
        if (!changed && !s->curved) return;
        const balance b = defect(s);
        if (!open_balance(&b, changed ? BALANCE : STEADY_BALANCE)) {
            leave(s, &b);
            return;
        }
        choose_direction(s, all_rows);
        if (find_alpha(s, b)) return;
    }
    s->limit_reached = 1;
}
