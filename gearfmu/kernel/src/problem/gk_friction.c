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

/* friction at the end of the step, before anything is known of it */
static void guess_end(gk_glide *glide, const gk_system *s)
{
    for (int j = 0; j < s->contacts; j++)
        glide->end[j] = glide->limit[j] ? glide->limit[j] * glide->most[j] * (s->force[j] + s->dashpot.end[j])
                        : glide->rolls  ? glide->share[j] * glide->mean[j]
                                        : glide->start_end[j];
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
    const double expressed = glide->moved = gk_friction_express(glide, s);
    if (round && !changed && !(expressed > enough * largest)) return expressed / largest;
    gk_friction_apply(glide, s);
    gk_solve_contacts(s);
    glide->moved = gk_friction_follow(glide, s);
    if (changed) glide->moved = gk_max(glide->moved, expressed); /* by another status, which may not be the last one */
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
