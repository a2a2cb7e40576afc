/* The one scalar of a step that keeps its energy (docs/theory.md, eq. 12; discrete gradient after Gonzalez 1996): η =
 * α·direction on the rows that close or open, α such that the quasi-static part's energy changes by what the forces do
 * to the gaps. */
#include "problem/gk_system.h"

#ifndef GK_ENERGY_LIMIT /* rounds of the search for α; a test builds a kernel with none */
#define GK_ENERGY_LIMIT 12
#endif
static const double BALANCE = 1e-9; /* relative defect of energy left after a change of status */
#ifdef GK_DOUBLE_MODES
static const double STEADY_BALANCE = 1e-9, COUPLED_BALANCE = 1e-9, COUPLED_CHANGE = 1e-9;
#else
static const double STEADY_BALANCE = 1e-7;  /* rows in float are good to 1e-7 */
static const double COUPLED_CHANGE = 1e-7;  /* what engagements exchange is in single precision */
static const double COUPLED_BALANCE = 1e-6; /* engagements know each other's gaps to 1e-7; what is left waits */
#endif

typedef struct balance {
    double defect, c1, c2, scale, rounding;
} balance;

static int open_balance(const balance *b, double tolerance)
{
    return !(fabs(b->defect) <= tolerance * b->scale + b->rounding);
}

/* change of the gap over the step as the energy balance sees it: what a given torque does to the quasi-static part is
 * work from outside and counts with its quasi-static displacement alone */
static double gap_change(const gk_system *s, int i)
{
    const int rests = (s->active[i] && !gk_film_sinks(s, i)) || gk_row_is_given(s, i);
    return (rests ? -gk_solve_quasi_static(s, i) : gk_solve_end_gap(s, i)) - s->g0[i];
}

static double share(const gk_system *s, int i)
{
    return 0.5 * (s->force0[i] + s->force[i] + gk_film_carried(s, i) + s->alpha * s->direction[i]);
} /* ½ (λ₀ + λ₁ + α d); of a film λ₁ + ½ α d */

static int takes_part(const gk_system *s, int i)
{
    return gk_row_yields(s, i) && (s->force[i] != 0.0 || s->force0[i] != 0.0 || s->direction[i] != 0.0);
}

/* Δ = U₁ − U₀ + ½ (λ₀ + λ₁ + α d)·(g₁ − g₀), and what earlier steps left of it: small defects of the same sign do not
 * add up */
static balance defect(const gk_system *s)
{
    const gk_account *account = &s->energy;
    const double owed = account->correction + account->rubbing + account->shift0 - account->shift;
    balance b = {owed - account->stored0, 0.0, 0.0, fabs(account->stored0), 0.0};
    if (gk_film_on(s)) b.defect += gk_film_lost(s);
    for (int i = 0; i < s->n; i++) {
        if (!takes_part(s, i)) continue;
        if (s->force[i] != 0.0) {
            const double energy = 0.5 * s->force[i] * (s->Al[i] + s->others.deflection[i] + s->linear[i]) +
                                  s->local.potential[i];
            b.defect += energy;
            b.scale += fabs(energy);
        }
        const double change = gap_change(s, i);
        b.defect += share(s, i) * change;
        b.rounding += 4e-16 * (fabs(s->force0[i]) + fabs(s->force[i])) * fabs(change); /* a contact that only grazes */
        if (gk_film_sinks(s, i)) b.rounding += 1e-15 * (fabs(s->force0[i]) + fabs(s->force[i])) * s->film->open[i];
    }
    return b;
}

/* p = dλ/dα and w_d = dη_d/dα */
static void sensitivity(const gk_system *s, double *p, double *damper)
{
    double moved[MAX_STRIDE], path[MAX_STRIDE];
    gk_solve_times(s, s->D, s->direction, moved);
    for (int i = 0; i < s->stride; i++) p[i] = i < s->n && s->active[i] ? -moved[i] : 0.0;
    gk_tangent_solve(s, p);
    gk_solve_path(s, p, path);
    for (int i = 0; i < s->n; i++) {
        damper[i] = s->dashpot.gain[i] * (path[i] + s->local.slope[i] * p[i]) + s->dashpot.pull[i] * p[i];
    }
}

/* expansion of Δ in α along the solved direction */
static void expand(const gk_system *s, const double *p, const double *damper, balance *b)
{
    double yields[MAX_STRIDE], path[MAX_STRIDE], w[MAX_STRIDE], late[MAX_STRIDE], moved[MAX_STRIDE], lag[MAX_STRIDE];
    for (int i = 0; i < s->n; i++)
        w[i] = (1.0 + gk_film_lift(s, i)) * p[i] + s->direction[i] + damper[i],
        late[i] = s->dashpot.late[i] * damper[i] + s->dashpot.held[i] * p[i];
    gk_solve_times(s, s->A, p, yields);
    gk_solve_path(s, p, path);
    gk_solve_times(s, s->D, w, moved);
    gk_solve_times(s, s->A, late, lag);
    for (int i = 0; i < s->n; i++) {
        const double lift = gk_film_lift(s, i), direct = (1.0 + lift) * p[i] + s->direction[i];
        if (!gk_row_yields(s, i) || (!takes_part(s, i) && direct == 0.0)) continue;
        const double quasi_static = yields[i] + path[i] + s->local.slope[i] * p[i];
        const int rests = (s->active[i] && !gk_film_sinks(s, i)) || gk_row_is_given(s, i);
        const double gap = rests ? -quasi_static : moved[i] + lag[i];
        b->c1 += s->force[i] * quasi_static + 0.5 * direct * gap_change(s, i) + share(s, i) * gap;
        b->c2 += 0.5 * p[i] * quasi_static + 0.5 * direct * gap;
    }
    if (!gk_film_on(s)) return;
    for (int i = 0; i < s->contacts; i++) yields[i] += path[i];
    b->c1 += gk_film_grows(s, p, yields, &b->c2);
}

static int opened_or_closed(const gk_system *s, int i)
{
    if (i < s->contacts) return (s->force0[i] > 0.0 && !gk_film_sinks(s, i)) != gk_solve_touches(s, i);
    return gk_row_opens(s, i) && (s->force0[i] != 0.0) != (s->force[i] != 0.0);
}

static int status_changed(const gk_system *s)
{
    for (int i = 0; i < s->n; i++)
        if (opened_or_closed(s, i)) return 1;
    return 0;
}

/* the rows that share η: contacts that are closed at either end, joints that close or open; other bearings, shafts and
 * ports only where that finds no balance, because η on them rings their modes */
static void choose_direction(gk_system *s, int all_rows)
{
    for (int i = 0; i < s->n; i++) {
        const int film = gk_film_sinks(s, i) && !gk_solve_touches(s, i);
        const int may = i < s->contacts ? !film : opened_or_closed(s, i) || (all_rows && gk_row_is_stiff(s, i));
        s->direction[i] = may && (s->force0[i] != 0.0 || s->force[i] != 0.0) ? s->weight[i] * gap_change(s, i) : 0.0;
    }
}

static void add(balance *sum, balance b)
{
    sum->defect += b.defect, sum->c1 += b.c1, sum->c2 += b.c2, sum->scale += b.scale, sum->rounding += b.rounding;
}

static balance defect_of_all(const gk_island *island)
{
    balance sum = {0};
    for (int m = 0; m < island->count; m++) add(&sum, defect(island->member[m]));
    return sum;
}

static int any_changed(const gk_island *island)
{
    for (int m = 0; m < island->count; m++)
        if (status_changed(island->member[m])) return 1;
    return 0;
}

/* contacts of all members for the present α */
static void solve_members(const gk_island *island)
{
    if (island->sweep)
        island->sweep(island);
    else
        gk_solve_contacts(island->member[0]);
}

static int all_solved(const gk_island *island)
{
    for (int m = 0; m < island->count; m++)
        if (island->member[m]->limit_reached) return 0;
    return 1;
}

/* Contacts alone, without the scalar: η is the dampers' */
void gk_balance_plain(const gk_island *island)
{
    GK_ASSERT(island->count >= 0 && island->count <= MAX_ENGAGEMENTS);
    GK_ASSERT(island->count < 2 || island->sweep);
    for (int m = 0; m < island->count; m++) gk_solve_clear(island->member[m]);
    solve_members(island);
}

/* the step is balanced but for b: the next ones make that good; the first member keeps the account */
static int leave(const gk_island *island, const balance *b)
{
    for (int m = 0; m < island->count; m++) island->member[m]->energy.error -= island->member[m]->energy.correction;
    island->member[0]->energy.error += b->defect;
    return 1;
}

/* what the steps before left to this one */
static double energy_correction_of(const gk_island *island)
{
    double sum = 0.0;
    for (int m = 0; m < island->count; m++) sum += island->member[m]->energy.correction;
    return sum;
}

/* a move of α that brings the defect to 0: the root nearest to 0 of the quadratic; 0: there is none */
static double root_of(const balance *b)
{
    const double root = sqrt(gk_max(0.0, b->c1 * b->c1 - 4.0 * b->defect * b->c2));
    const double divisor = b->c1 + (b->c1 < 0.0 ? -root : root);
    return fabs(divisor) > 0.0 ? -2.0 * b->defect / divisor : 0.0;
}

typedef struct bracket { /* where the defect was negative and where it was positive last; known: 1, 2 */
    double negative, positive;
    int known;
} bracket;

/* The move of α from here: Newton's, or to the middle of the bracket when that leads out of it. Contacts that take
 * turns with α make Newton's moves go to and fro between two quadratics. */
static double kept_within(bracket *ends, double alpha, double defect, double move)
{
    *(defect < 0.0 ? &ends->negative : &ends->positive) = alpha;
    ends->known |= defect < 0.0 ? 1 : 2;
    const double low = gk_min(ends->negative, ends->positive), high = gk_max(ends->negative, ends->positive);
    if (ends->known != 3 || (alpha + move > low && alpha + move < high)) return move;
    return 0.5 * (low + high) - alpha;
}

/* The move of α by the slope that the defect has had since `last`. Friction follows α, which the quadratic does not
 * know: Newton's moves would go to and fro about the root. */
static double secant(double alpha, double defect, double last, double last_defect, double newton)
{
    const double slope = (defect - last_defect) / (alpha - last);
    return slope * newton * defect < 0.0 ? -defect / slope : newton;
}

/* α by Newton on the quadratic; 0 when the limit of iterations is reached, here or in the contacts, as where friction
 * changes sides for ever, or no direction is left */
static int find_alpha(const gk_island *island, balance b, double tolerance)
{
    double p[MAX_STRIDE], damper[MAX_STRIDE], last = 0.0, last_defect = 0.0;
    bracket ends = {0};
    const int rubs = GK_HAS(friction) && island->member[0]->rubs;
    for (int round = 0; round < GK_ENERGY_LIMIT; round++) {
        for (int m = 0; m < island->count; m++) {
            gk_system *s = island->member[m];
            sensitivity(s, s->along, damper);
            expand(s, s->along, damper, &b);
        }
        const double root = root_of(&b);
        if (!(fabs(root) > 0.0)) return 0;
        if (rubs && b.c1 * b.c1 < 4.0 * b.defect * b.c2) return 0;
        const double alpha = island->member[0]->alpha;
        const double move = rubs && round ? secant(alpha, b.defect, last, last_defect, root) : root;
        const double a = kept_within(&ends, alpha, b.defect, move);
        last = alpha, last_defect = b.defect;
        for (int m = 0; m < island->count; m++) {
            gk_system *s = island->member[m];
            memcpy(p, s->along, (size_t)s->stride * sizeof *p);
            s->alpha += a;
            for (int i = 0; i < s->n; i++) s->force[i] += a * p[i];
            gk_law_apply(s);
            gk_solve_settle(s);
        }
        solve_members(island);
        b = defect_of_all(island);
        if (!open_balance(&b, tolerance)) return all_solved(island) && leave(island, &b);
    }
    return 0;
}

/* A step without a root in which flanks touched through a film: energy that is missing has been lost in it */
static int bursts(const gk_island *island, double defect)
{
    for (int m = 0; m < island->count; m++) {
        const gk_system *s = island->member[m];
        for (int i = 0; i < s->contacts; i++)
            if (gk_film_sinks(s, i) && gk_solve_touches(s, i)) {
                s->film->burst -= defect;
                return 1;
            }
    }
    return 0;
}

/* A step without a root in which flanks rub: what is left is friction's, whose means are not those of both ends beside
 * dampers, and counts with what friction takes, as long as that is more. Returns whether it is. */
static int rubs_away(const gk_island *island, double defect)
{
    double taken = 0.0;
    for (int m = 0; m < island->count; m++) taken += island->member[m]->rubs ? island->member[m]->energy.rubbed : 0.0;
    if (!(fabs(defect) < taken)) return 0;
    for (int m = 0; m < island->count; m++) {
        gk_system *s = island->member[m];
        if (s->rubs) s->energy.unbalanced = defect * s->energy.rubbed / taken;
    }
    return 1;
}

/* Is the defect that no scalar balances what friction leaves of the energy that it holds, as where it reverses under a
 * light load? The next steps make that good. */
static int friction_owes(const gk_island *island, double defect)
{
    static const double ELSE = 0.1; /* least share of another cause that is told */
    double rubbing = 0.0;
    for (int m = 0; m < island->count; m++)
        rubbing += island->member[m]->rubs ? island->member[m]->energy.rubbing : 0.0;
    return fabs(defect - rubbing) < ELSE * fabs(rubbing);
}

/* a step that cannot be balanced with films goes without them */
static int dry(const gk_island *island)
{
    int dried = 0;
    for (int m = 0; m < island->count; m++) {
        gk_system *s = island->member[m];
        if (!gk_film_on(s)) continue;
        s->films = 0, dried = 1;
        gk_solve_settle(s);
    }
    return dried;
}

/* The account of the invariant's jumps that the step aims at: with those of its contacts that close and open, within a
 * tenth of the energy at its end. Nothing is left of it where the flanks part. Without jumps it stays as it was. */
static void aim(const gk_island *island, int jumps)
{
    static const double MOST = 0.1;
    for (int m = 0; m < island->count; m++) {
        gk_system *s = island->member[m];
        const double most = MOST * gk_solve_stored(s);
        s->energy.shift = jumps ? gk_clamp(s->energy.shift0 + gk_solve_jump(s), -most, most) : s->energy.shift0;
    }
}

/* Solves the step: contacts first; where a contact changed status (or the law is curved) the scalar α that makes the
 * quasi-static part's energy change equal its work and the invariant's jump: on contacts; then without the jump; then
 * on bearings too; then on contacts to the tolerance of a step without change, because contacts that change with α let
 * the defect jump across zero. Contacts that hardly move cannot repay what the steps before left: then the defect
 * waits, as it does in a step without change of status. */
void gk_balance_solve(const gk_island *island)
{
    GK_ASSERT(island->count >= 0 && island->count <= MAX_ENGAGEMENTS);
    GK_ASSERT(island->count < 2 || island->sweep);
    const double steady = island->sweep ? COUPLED_BALANCE : STEADY_BALANCE;
    const double changing = island->count > 1 ? COUPLED_CHANGE : BALANCE;
    int curved = 0, rubs = 0;
    for (int m = 0; m < island->count; m++) {
        curved |= GK_HAS(hertz) && island->member[m]->flank.curved;
        rubs |= GK_HAS(friction) && island->member[m]->rubs;
    }
    curved |= rubs;
    for (int attempt = 0; attempt < 4; attempt++) {
        gk_balance_plain(island);
        const int changed = any_changed(island);
        if (changed || attempt) aim(island, attempt == 0);
        if (!changed && !curved) return;
        const balance b = defect_of_all(island);
        if (!open_balance(&b, changed ? changing : steady)) {
            leave(island, &b);
            return;
        }
        for (int m = 0; m < island->count; m++) choose_direction(island->member[m], attempt == 2);
        if (find_alpha(island, b, attempt < 3 ? changing : steady)) return;
        if (rubs && !changed) break; /* contacts that stick hardly move */
    }
    gk_balance_plain(island);
    aim(island, 0);
    balance b = defect_of_all(island);
    if (b.defect - energy_correction_of(island) < 0.0 && bursts(island, b.defect)) b.defect = 0.0;
    balance own = b;
    own.defect -= energy_correction_of(island); /* what earlier steps left may wait: the step itself is judged */
    if (own.defect > 0.0 && open_balance(&own, steady) && dry(island)) {
        gk_balance_solve(island);
        return;
    }
    if (rubs && open_balance(&own, steady) && rubs_away(island, own.defect)) {
        b.defect -= own.defect;
        own.defect = 0.0;
    }
    leave(island, &b);
    if (open_balance(&own, steady) && !(rubs && friction_owes(island, own.defect)))
        for (int m = 0; m < island->count; m++) island->member[m]->limit_reached = 1;
}
