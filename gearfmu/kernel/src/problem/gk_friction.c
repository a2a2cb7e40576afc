/* Friction of the flanks within a step (docs/theory.md, 3.12). Along the profile of gear A every contact has a mean
 * force p̄ against the sliding Δs in the step. Gears that roll on: p̄ = c λ̄,
 *     c = −µ Δs/(ε h) for |Δs| < ε h, else −µ sgn Δs,    ε = a share of the largest sliding speed on the path,
 * and c at the end follows it as that of a spring and a dashpot in series does, to ±µ at most.
 * Gears that stand or swing about rest: an elastic contact with a slider; it sticks, Δs = 0, as long as friction at the
 * end of the step, |p₁| ≤ µ (λ₁ + f_d), can hold it, and p̄ is the mean of both ends. Either way −p̄ Δs ≥ 0. Solved by
 * active sets, together with the normal forces. */
#include "problem/gk_work.h"

static const double FADES = 0.02;  /* of the largest sliding speed: below it friction fades */
static const double STEADY = 2.0;  /* mean speed over its deviation: above it gears roll */
static const double RECENT = 1e-3; /* s: of these means */
static const double ALMOST = 1e-7; /* of a limit */
enum { PATIENT = 8 };              /* rounds */

/* ---- the start of the step --------------------------------------------------------------------------------------- */
/* forces that the states contain */
static void recall_friction(const gk_engaged *engaged, const gk_meshing *meshing, gk_glide *glide)
{
    const gk_system *s = &engaged->system;
    const int strips = GK_STRIPS(s);
    for (int i = 0; i < s->contacts; i++) {
        const int memory = engaged->place[s->flank.place_of[i]].memory;
        const double ratio = memory < 0 ? 0.0 : meshing->memory[memory].ratio[i % strips];
        glide->start[i] = ratio * s->force0[i];
        glide->start_end[i] = ratio * (s->force0[i] + s->dashpot.end0[i]);
        glide->mean[i] = glide->step[i] = glide->last[i] = glide->start[i];
        glide->end[i] = glide->start_end[i];
        glide->ratio[i] = ratio;
        glide->limit[i] = glide->full[i] = 0;
        glide->others[i] = glide->others_start[i] = 0.0;
    }
}

/* limit at which friction works against a sliding that is more than `creep` */
static signed char against(double sliding, double creep)
{
    return (signed char)(sliding > creep ? -1 : sliding < -creep ? 1 : 0);
}

/* where friction is to begin with: at the limit of the last step, or where the speed puts it */
static signed char first_limit(const gk_glide *glide, const gk_system *s, int i)
{
    static const double STUCK = 1e-6;
    if (!glide->rolls && s->force0[i] > 0.0 && fabs(glide->ratio[i]) < (1.0 - STUCK) * glide->most[i]) return 0;
    if (!glide->rolls && s->force0[i] > 0.0) return glide->ratio[i] > 0.0 ? 1 : -1;
    return against(glide->begin[i] - glide->lead[i], glide->creep[i]);
}

/* coefficient of friction of every contact by the forces of the last step, and where it fades */
static void find_coefficients(const gk_model *model, const gk_setup *setup, const gk_data *data, double h, int e,
                              gk_engaged *engaged)
{
    const gk_mesh *mesh = &setup->mesh[e];
    const gk_system *s = &engaged->system;
    gk_glide *glide = engaged->glide;
    const double frame = mesh->frame < 0 ? 0.0 : GK_OF(data, v)[mesh->frame];
    const double speed[2] = {GK_OF(data, v)[mesh->spin[0]] - frame, GK_OF(data, v)[mesh->spin[1]] - frame};
    const gk_meshing *meshing = &GK_OF(data, meshing)[e];
    gk_sliding at = {.turns = speed[0]};
    glide->rolls = fabs(meshing->rolling) > STEADY * meshing->unsteady; /* a gear that rings about rest sticks */
    for (int i = 0; i < s->contacts; i++) at.total += s->force0[i];
    for (int i = 0; i < s->contacts; i++) {
        const gk_point *point = gk_point_of(setup, &engaged->place[s->flank.place_of[i]], i % GK_STRIPS(s));
        at.load = s->force0[i] * s->flank.per_width[i];
        at.slides = fabs(speed[0] * point->slide[PHIA] + speed[1] * point->slide[PHIB]);
        at.rolls = fabs(speed[0]) * point->roll[0] + fabs(speed[1]) * point->roll[1];
        glide->most[i] = gk_lubrication_coefficient(&mesh->friction, model->engagement[e].width, &at);
        glide->creep[i] = glide->rolls ? FADES * mesh->friction.sliding * fabs(meshing->rolling) * h : 0.0;
        glide->lead[i] = glide->rolls ? gk_glide_lead(mesh, point, speed, h) : 0.0;
        glide->limit[i] = first_limit(glide, s, i);
    }
}

/* What a contact yields along the profile by itself: as much as its local law does above its upper bound */
double gk_friction_local_yield(const gk_system *s, int i)
{
    GK_ASSERT(i >= 0 && i < s->contacts);
    return s->flank.law[i / 4].slope_high[i % 4] * s->flank.per_width[i];
}

/* Weight θ of the end of the step in the mean coefficient, c̄ = (1 − θ) c₀ + θ c₁. What a contact yields along the
 * profile and (8l) are a spring and a dashpot in series: towards a constant sliding c goes as e^(−t/τ), τ = Y µλ/ε,
 * and θ = 1/(1 − e^(−x)) − 1/x, x = h/τ, holds for that exactly: ½ where it is slow, 1 where it is over in the step.
 */
static double weight_of_end(const gk_glide *glide, const gk_system *s, int i)
{
    static const double SLOW = 1e-2, OVER = 40.0;
    const double springs = glide->most[i] * s->force0[i] * glide->yields[i * s->stride + i];
    if (!(s->force0[i] > 0.0) || !(glide->creep[i] < OVER * springs)) return 1.0;
    const double x = glide->creep[i] / springs;
    return x < SLOW ? 0.5 + x / 12.0 : 1.0 / (1.0 - gk_exp(-x)) - 1.0 / x;
}

/* The friction of engagement e in the step k; its problem has been formed */
void gk_friction_form(const gk_model *model, const gk_setup *setup, const gk_data *data, const gk_coefficients *k,
                      gk_work *work, int e)
{
    GK_ASSERT(k->h > 0.0);
    gk_engaged *engaged = &work->engaged[e];
    gk_glide *glide = engaged->glide;
    gk_system *s = &engaged->system;
    memcpy(glide->gap, s->g, (size_t)s->stride * sizeof *s->g);
    glide->expressed = glide->anew = 0;
    gk_glide_rows(setup, work, e);
    memcpy(glide->D, s->D, (size_t)(s->n * s->stride) * sizeof *s->D);
    recall_friction(engaged, &GK_OF(data, meshing)[e], glide);
    gk_glide_freely(setup, data, work, k->h, e);
    find_coefficients(model, setup, data, k->h, e, engaged);
    if (!engaged->kept.again) gk_glide_moves(setup, k, work, e);
    gk_glide_yields(s, glide);
    const gk_mesh *mesh = &setup->mesh[e];
    const int follows = glide->rolls && (mesh->rides || mesh->coupled); /* a spur pair alone gains nothing by it */
    for (int i = 0; i < s->contacts; i++) {
        const double yields = gk_friction_local_yield(s, i);
        glide->yields[i * s->stride + i] += yields;
        glide->damps[i] = gk_min(0.5 * s->dashpot.coefficient[i] * yields, 0.5);
        glide->by_end[i] = follows ? weight_of_end(glide, s, i) : 1.0;
    }
    glide->held0 = gk_friction_held0(glide, s);
}

/* ---- the step ---------------------------------------------------------------------------------------------------- */
/* sliding in the step */
static void find_sliding(gk_glide *glide, const gk_system *s)
{
    const int quads = s->stride / 4, across = (s->contacts + 3) / 4;
    double late[MAX_STRIDE];
    for (int i = 0; i < s->stride; i++)
        late[i] = i < s->n ? s->force[i] + s->dashpot.end[i] - s->force0[i] - s->dashpot.end0[i] : 0.0;
    for (int k = 0; k < s->contacts; k++)
        glide->slid[k] = glide->free[k] + glide->others[k] - glide->others_start[k] +
                         (gk_dot_quads(glide->gap_moves + k * s->stride, s->z, quads) +
                          gk_dot_quads(glide->gap_yields + k * s->stride, late, quads));
    for (int j = 0; j < s->contacts; j++) {
        const double more = glide->end[j] - glide->start_end[j];
        if (glide->step[j] != 0.0) gk_axpy(glide->step[j], glide->moves + j * s->stride, glide->slid, 0, across);
        if (more != 0.0) gk_axpy(more, glide->yields + j * s->stride, glide->slid, 0, across);
    }
}

/* x ← a⁻¹ x by rows, a (n, n) close to symmetric positive definite, x (n, columns): no pivoting */
static void solve_small(double *a, int n, double *x, int columns)
{
    for (int k = 0; k < n; k++)
        for (int i = k + 1; i < n; i++) {
            const double f = a[i * n + k] / a[k * n + k];
            if (f == 0.0) continue;
            for (int j = k; j < n; j++) a[i * n + j] -= f * a[k * n + j];
            for (int c = 0; c < columns; c++) x[i * columns + c] -= f * x[k * columns + c];
        }
    for (int k = n - 1; k >= 0; k--)
        for (int c = 0; c < columns; c++) {
            for (int j = k + 1; j < n; j++) x[k * columns + c] -= a[k * n + j] * x[j * columns + c];
            x[k * columns + c] /= a[k * n + k];
        }
}

/* Friction by the present forces and how it follows them: p̄ = mean + Σ by_z Δz, at the end of the step end + end_by_z Δz
 * + end_by_mean Δp̄. At a limit the end is µ (λ₁ + f_d), below it what makes Δs = −ε h p̄/(µ λ̄). The mean is that of
 * both ends, p̄ = ½ (p₀ + p₁), plus what a dashpot takes where the contact sticks, (τ/h) (p₁ − p₀); of gears that roll on
 * coefficients have the mean c̄ = (1 − θ) c₀ + θ c₁. The slopes are those of some rounds ago as long as no contact has
 * another status: then the factors of the normal forces still serve. */
typedef struct laws {
    double mean[MAX_CONTACTS], end[MAX_CONTACTS]; /* of contacts below the limit 0, and the end without its mean */
    double by_z[MAX_CONTACTS], end_by_z[MAX_CONTACTS], end_by_mean[MAX_CONTACTS];
    signed char held[MAX_CONTACTS]; /* below the limit */
} laws;

/* would the mean of both ends push along the sliding? Then there is none. */
static int turns_round(const gk_glide *glide, int j)
{
    return glide->limit[j] && !glide->rolls && glide->limit[j] * glide->start_end[j] < -glide->most_end[j];
}

static void find_laws(gk_glide *glide, const gk_system *s, laws *law)
{
    for (int j = 0; j < s->contacts; j++) {
        const int touches = glide->most_force[j] > 0.0;
        const int held = touches && !glide->limit[j] && (glide->rolls || glide->most_end[j] > 0.0);
        if (!held) glide->full[j] = 0;
        const double ratio = glide->limit[j] * glide->most[j], last = ratio + glide->full[j] * glide->most[j];
        const double end = last * (s->force[j] + s->dashpot.end[j]), by_z = s->dashpot.hold[j] ? 0.0 : last;
        const int turns = turns_round(glide, j) || (!touches && s->force0[j] > 0.0);
        const int follows = held && !glide->full[j];
        const double still = held || !touches || turns ? 0.0
                             : glide->rolls            ? 0.5 * ratio * s->force0[j]
                                                       : 0.5 * (glide->start_end[j] + end - by_z * s->z[j]);
        law->held[j] = (signed char)held;
        law->by_z[j] = turns ? 0.0 : 0.5 * ratio;
        law->mean[j] = still + law->by_z[j] * s->z[j];
        law->end_by_z[j] = by_z;
        law->end_by_mean[j] = !follows       ? 0.0
                              : glide->rolls ? glide->share[j] / glide->by_end[j]
                                             : 1.0 / (0.5 + glide->damps[j]);
        law->end[j] = !follows ? end
                      : glide->rolls
                          ? (1.0 - 1.0 / glide->by_end[j]) * glide->ratio[j] * (s->force[j] + s->dashpot.end[j])
                          : (glide->damps[j] - 0.5) * law->end_by_mean[j] * glide->start_end[j];
    }
}

/* do the slopes that D contains belong to the same status? */
static int slopes_stand(const gk_glide *glide, const laws *law, int contacts)
{
    int same = glide->expressed;
    for (int j = 0; j < contacts && same; j++)
        same = glide->held[j] == law->held[j] && glide->by_own_z[j] == law->by_z[j] &&
               glide->end_by_z[j] == law->end_by_z[j] && (glide->end_by_mean[j] != 0.0) == (law->end_by_mean[j] != 0.0);
    return same;
}

/* Contacts below the limit: the mean of their friction, and with `slopes` how it follows the normal forces */
static void hold(gk_glide *glide, const gk_system *s, laws *law, int slopes)
{
    const int columns = slopes ? s->n + 1 : 1;
    int held[MAX_CONTACTS], n = 0;
    for (int j = 0; j < s->contacts; j++) held[n] = j, n += law->held[j] != 0;
    double *const all_a = glide->small, *const all_x = all_a + n * n;
    for (int k = 0; k < n; k++) { /* Δs without friction of these contacts */
        const int i = held[k];
        const double *moved = glide->gap_moves + i * s->stride, *yielded = glide->gap_yields + i * s->stride;
        double rest = gk_friction_slid(glide, i), *a = all_a + k * n, *x = all_x + k * columns;
        for (int r = 0; r < columns - 1; r++) x[r] = -(moved[r] + yielded[r]);
        for (int j = 0; j < s->contacts; j++) {
            const int at = j * s->stride + i;
            const double moves = 2.0 * glide->moves[at], yields = glide->yields[at];
            rest += moves * (law->mean[j] - glide->mean[j]) + yields * (law->end[j] - glide->end[j]);
            if (slopes) x[j] -= moves * law->by_z[j] + yields * law->end_by_z[j];
        }
        x[columns - 1] = -rest;
        for (int j = 0; j < n; j++) {
            const int at = held[j] * s->stride + i;
            a[j] = 2.0 * glide->moves[at] + law->end_by_mean[held[j]] * glide->yields[at];
        }
        a[k] += glide->creep[i] / glide->most_force[i];
    }
    solve_small(all_a, n, all_x, columns);
    for (int k = 0; k < n; k++) {
        const int j = held[k];
        law->mean[j] = all_x[k * columns + columns - 1];
        law->end[j] += law->end_by_mean[j] * law->mean[j];
        if (slopes) memcpy(glide->by_z + j * s->stride, all_x + k * columns, (size_t)s->n * sizeof(double));
    }
}

/* what friction follows of the present z in its mean */
static double followed(const gk_glide *glide, const gk_system *s, int j)
{
    if (!glide->held[j]) return glide->by_own_z[j] * s->z[j];
    double sum = 0.0;
    for (int r = 0; r < s->n; r++) sum += glide->by_z[j * s->stride + r] * s->z[r];
    return sum;
}

/* D with friction as a function of the forces in the step */
static void apply_slopes(const gk_glide *glide, gk_system *s)
{
    const int quads = s->stride / 4;
    memcpy(s->D, glide->D, (size_t)(s->n * s->stride) * sizeof *s->D);
    for (int j = 0; j < s->contacts; j++) {
        const double *moved = glide->gap_moves + j * s->stride, *yielded = glide->gap_yields + j * s->stride;
        double each[MAX_STRIDE];
        for (int i = 0; i < s->stride; i++) each[i] = 2.0 * moved[i] + glide->end_by_mean[j] * yielded[i];
        if (glide->end_by_z[j] != 0.0) gk_axpy(glide->end_by_z[j], yielded, s->D + j * s->stride, 0, quads);
        if (!glide->held[j] && glide->by_own_z[j] != 0.0)
            gk_axpy(glide->by_own_z[j], each, s->D + j * s->stride, 0, quads);
        for (int r = 0; r < s->n && glide->held[j]; r++)
            gk_axpy(glide->by_z[j * s->stride + r], each, s->D + r * s->stride, 0, quads);
    }
}

/* gaps with friction, less what D knows of it */
static void apply(const gk_glide *glide, gk_system *s)
{
    const int quads = s->stride / 4;
    memcpy(s->g, glide->gap, (size_t)s->stride * sizeof *s->g);
    for (int j = 0; j < s->contacts; j++) {
        const double moves = 2.0 * glide->fixed[j] - glide->start[j];
        const double yields = glide->end_fixed[j] + glide->end_by_mean[j] * glide->fixed[j];
        if (moves != 0.0) gk_axpy(moves, glide->gap_moves + j * s->stride, s->g, 0, quads);
        if (yields != 0.0) gk_axpy(yields, glide->gap_yields + j * s->stride, s->g, 0, quads);
    }
}

/* Friction as a function of the normal forces; returns how far it is from what they were solved with, N */
static double express_friction(gk_glide *glide, gk_system *s)
{
    laws law;
    double largest = 0.0;
    find_laws(glide, s, &law);
    const int stand = slopes_stand(glide, &law, s->contacts);
    hold(glide, s, &law, !stand);
    glide->anew |= !stand;
    glide->expressed = 1;
    for (int j = 0; j < s->contacts; j++) {
        if (!stand) {
            glide->held[j] = law.held[j], glide->by_own_z[j] = law.by_z[j];
            glide->end_by_z[j] = law.end_by_z[j], glide->end_by_mean[j] = law.end_by_mean[j];
        }
        glide->fixed[j] = law.mean[j] - followed(glide, s, j);
        glide->end_fixed[j] = law.end[j] - glide->end_by_z[j] * s->z[j] - glide->end_by_mean[j] * law.mean[j];
        largest = gk_max(largest, gk_max(fabs(law.mean[j] - glide->mean[j]), fabs(law.end[j] - glide->end[j])));
    }
    return largest;
}

/* friction at the end of the step, before anything is known of it */
static void guess_end(gk_glide *glide, const gk_system *s)
{
    for (int j = 0; j < s->contacts; j++)
        glide->end[j] = glide->limit[j] ? glide->limit[j] * glide->most[j] * (s->force[j] + s->dashpot.end[j])
                        : glide->rolls  ? glide->share[j] * glide->mean[j]
                                        : glide->start_end[j];
}

/* Mean friction by the present forces; returns the largest change */
static double follow(gk_glide *glide, const gk_system *s)
{
    double largest = 0.0;
    for (int j = 0; j < s->contacts; j++) {
        const double before = glide->mean[j], end = glide->end[j];
        glide->mean[j] = glide->fixed[j] + followed(glide, s, j);
        glide->step[j] = 2.0 * glide->mean[j] - glide->start[j];
        glide->end[j] = glide->end_fixed[j] + glide->end_by_z[j] * s->z[j] + glide->end_by_mean[j] * glide->mean[j];
        largest = gk_max(largest, gk_max(fabs(glide->mean[j] - before), fabs(glide->end[j] - end)));
    }
    return largest;
}

/* what friction may be, in the step and at its end, and how much of its mean is there then where gears roll; returns
 * the largest normal force */
static double find_limits(gk_glide *glide, const gk_system *s)
{
    double largest = 1e-9;
    for (int j = 0; j < s->contacts; j++) {
        const double mean = gk_max(0.0, gk_solve_mean(s, j)), end = gk_max(0.0, s->force[j] + s->dashpot.end[j]);
        glide->share[j] = mean > 0.0 ? gk_clamp(end / mean, 0.0, 2.0) : 0.0;
        glide->most_force[j] = glide->most[j] * mean;
        glide->most_end[j] = glide->most[j] * end;
        largest = gk_max(largest, mean);
    }
    return largest;
}

/* Gears that roll, below the limit in the mean: is the coefficient at the end of the step over it, or no longer? */
static int change_end(gk_glide *glide, int j)
{
    if (!glide->rolls || !glide->held[j]) return 0;
    const double start = glide->ratio[j] / glide->most[j], mean = glide->mean[j] / glide->most_force[j];
    const double end = start + (mean - start) / glide->by_end[j];
    if (glide->full[j] ? glide->full[j] * end >= 1.0 : fabs(mean) > 1.0 || !(fabs(end) > 1.0 + ALMOST)) return 0;
    glide->full[j] = (signed char)(glide->full[j] ? 0 : end > 0.0 ? 1 : -1);
    return 1;
}

/* Where friction contradicts its status: beyond its limit, or at a limit along the sliding of the step. All change at
 * once, later the last one only. Returns how many. */
static int change_status(gk_glide *glide, const gk_system *s, int patient)
{
    int count = 0;
    for (int j = s->contacts - 1; j >= 0 && (patient || !count); j--) {
        const double most = glide->rolls ? glide->most_force[j] : glide->most_end[j];
        const double p = glide->rolls ? glide->mean[j] : glide->end[j];
        if (!(most > 0.0)) { /* apart at the end: what there was may not push along the sliding */
            const int pushes = glide->most_force[j] > 0.0 && glide->mean[j] * gk_friction_slid(glide, j) > 0.0;
            if (pushes) glide->limit[j] = glide->start_end[j] > 0.0 ? -1 : 1, count++;
            if (glide->held[j] && fabs(glide->mean[j]) > glide->most_force[j]) /* what would hold it shows the side */
                glide->limit[j] = glide->mean[j] > 0.0 ? 1 : -1;
            else if (!(glide->most_force[j] > 0.0))
                glide->limit[j] = against(gk_friction_slid(glide, j), glide->creep[j]);
            continue;
        }
        if (change_end(glide, j)) {
            count++;
        } else if (glide->limit[j] ? glide->limit[j] * gk_friction_slid(glide, j) > -glide->creep[j] * (1.0 - ALMOST)
                                   : fabs(p) > most * (1.0 + ALMOST)) {
            glide->limit[j] = (signed char)(glide->limit[j] ? 0 : p > 0.0 ? 1 : -1);
            count++;
        }
    }
    return count;
}

/* Normal forces and friction of an engagement for each other, once. `stands`: where friction is at its limits is known.
 * Returns how much friction has changed, as part of the largest normal force; 1 where it has another status. What is
 * less than `enough` is not solved again. */
double gk_friction_solve(gk_glide *glide, gk_system *s, int round, int stands, double enough)
{
    GK_ASSERT(glide && round >= 0);
    GK_ASSERT(gk_system_is_sound(s));
    const double largest = find_limits(glide, s);
    if (!round) guess_end(glide, s);
    find_sliding(glide, s);
    const int changed = stands || !round ? 0 : change_status(glide, s, round < PATIENT);
    glide->moved = express_friction(glide, s);
    if (round && !changed && !(glide->moved > enough * largest)) return glide->moved / largest;
    apply(glide, s);
    if (glide->anew) {
        apply_slopes(glide, s);
        s->factored = 0;
        gk_solve_settle(s);
    }
    glide->anew = 0;
    gk_solve_contacts(s);
    glide->moved = follow(glide, s);
    if (changed || (!stands && !round)) return 1.0;
    return glide->moved / find_limits(glide, s);
}

/* what friction leaves and takes of energy, for the scalar of the step's energy */
void gk_friction_account(gk_glide *glide, gk_system *s)
{
    GK_ASSERT(glide);
    GK_ASSERT(gk_system_is_sound(s));
    find_sliding(glide, s);
    for (int j = 0; j < s->stride; j++) glide->grown[j] = j < s->contacts ? glide->end[j] - glide->start_end[j] : 0.0;
    s->energy.rubbing = gk_friction_defect(glide, s);
    s->energy.rubbed = gk_friction_taken(glide, s);
}

/* the speed of gear A as a mean over the last millisecond */
void gk_friction_watch(const gk_setup *setup, gk_data *data, double h, int e)
{
    GK_ASSERT(gk_is_mesh(setup, e));
    GK_ASSERT(h > 0.0);
    const gk_mesh *mesh = &setup->mesh[e];
    gk_meshing *meshing = &GK_OF(data, meshing)[e];
    const double speed = GK_OF(data, v)[mesh->spin[0]] - (mesh->frame < 0 ? 0.0 : GK_OF(data, v)[mesh->frame]);
    const double part = data->steps ? h / (RECENT + h) : 1.0;
    meshing->rolling += part * (speed - meshing->rolling);
    meshing->unsteady += part * (fabs(speed - meshing->rolling) - meshing->unsteady);
}

/* the end of the step: friction by which the next one is predicted; returns what it took */
double gk_friction_settle(gk_glide *glide, const gk_system *s)
{
    GK_ASSERT(glide);
    GK_ASSERT(gk_system_is_sound(s));
    for (int j = 0; j < s->contacts; j++) {
        const double end = s->force[j] + s->dashpot.end[j];
        glide->ratio[j] = end > 0.0 ? glide->end[j] / end : 0.0;
        glide->last[j] = glide->ratio[j] * s->force[j];
    }
    return gk_friction_taken(glide, s) - s->energy.unbalanced;
}
