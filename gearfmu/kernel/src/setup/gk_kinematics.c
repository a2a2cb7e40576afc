/* Speeds of rotors through the engagements: seen from the axes that its gears stand in, an engagement rolls like one on
 * fixed axes (Willis):  r_bA (ω_A − ω_f) + kind r_bB (ω_B − ω_f) = 0. */
#include "setup/gk_kinematics.h"
#include "base/gk_dense.h"

/* rotors of an engagement: gear A's, gear B's, the frame's (−1: the ground) */
static void rotors_of(const gk_model *model, const gk_engagement *e, int rotor[3])
{
    for (int w = 0; w < 2; w++) rotor[w] = model->gear[e->gear[w]].rotor;
    rotor[2] = model->frame[rotor[0]];
}

/* the one rotor of an engagement whose speed is not known yet: 0 … 2; −1: none, or more than one */
static int unknown_of(const int rotor[3], const int known[MAX_ROTORS])
{
    int found = -1;
    for (int i = 0; i < 3; i++) {
        if (rotor[i] < 0 || known[rotor[i]]) continue;
        if (found >= 0) return -1;
        found = i;
    }
    return found;
}

static double speed_of(const gk_model *model, const gk_engagement *e, const int rotor[3], int which,
                       const double *speed)
{
    const double r_a = model->gear[e->gear[0]].r_b, r_b = model->gear[e->gear[1]].r_b;
    if (which == 2) return (r_a * speed[rotor[0]] + e->kind * r_b * speed[rotor[1]]) / (r_a + e->kind * r_b);
    const double here = which ? r_b : r_a, there = which ? r_a : r_b;
    if (rotor[2] < 0) return -e->kind * speed[rotor[1 - which]] * there / here;
    return speed[rotor[2]] - e->kind * (speed[rotor[1 - which]] - speed[rotor[2]]) * there / here;
}

/* rotors whose speed is not known turn as their neighbours make them */
void gk_kinematics_follow(const gk_model *model, int known[MAX_ROTORS], double *speed)
{
    GK_ASSERT(model && known && speed);
    for (int changed = 1; changed;) {
        changed = 0;
        for (int i = 0; i < model->engagements; i++) {
            const gk_engagement *e = &model->engagement[i];
            int rotor[3];
            rotors_of(model, e, rotor);
            const int which = e->kind == MESH_FLAT ? -1 : unknown_of(rotor, known);
            if (which < 0) continue;
            speed[rotor[which]] = speed_of(model, e, rotor, which, speed);
            known[rotor[which]] = changed = 1;
        }
    }
}

/* the rotor that begins the next motion: those that others stand on first; −1: all are known */
static int next_root(const gk_model *model, const int known[MAX_ROTORS])
{
    for (int r = 0; r < model->rotors; r++)
        if (model->frame[r] >= 0 && !known[model->frame[r]]) return model->frame[r];
    for (int r = 0; r < model->rotors; r++)
        if (!known[r]) return r;
    return -1;
}

void gk_kinematics_find(const gk_model *model, gk_motions *motions)
{
    GK_ASSERT(model && motions);
    int known[MAX_ROTORS];
    memset(motions, 0, sizeof *motions);
    for (int r = 0; r < model->rotors; r++) known[r] = model->inertia[r] == 0.0;
    for (int root = next_root(model, known); root >= 0; root = next_root(model, known)) {
        int before[MAX_ROTORS];
        known[root] = 1;
        memcpy(before, known, sizeof before);
        motions->turn[motions->count++][root] = 1.0;
        for (int m = 0; m < motions->count; m++) { /* who follows is the same for all motions */
            memcpy(known, before, sizeof known);
            gk_kinematics_follow(model, known, motions->turn[m]);
        }
    }
}

/* ---- flanks that carry ------------------------------------------------------------------------------------------- */
/* does nothing hold a rotor but the teeth? */
static int is_free(const gk_model *model, int rotor)
{
    for (int p = 1; p < model->ports; p++)
        if (model->port[p].rotor == rotor) return 0;
    return model->inertia[rotor] > 0.0;
}

/* torque on every free rotor per unit force on the drive flanks of an engagement */
static void find_arms(const gk_model *model, const gk_engagement *e, double arms[MAX_ROTORS])
{
    const double r_a = model->gear[e->gear[0]].r_b, r_b = e->kind * model->gear[e->gear[1]].r_b;
    int rotor[3];
    rotors_of(model, e, rotor);
    memset(arms, 0, MAX_ROTORS * sizeof *arms);
    arms[rotor[0]] -= r_a, arms[rotor[1]] -= r_b;
    if (rotor[2] >= 0) arms[rotor[2]] += r_a + r_b;
    for (int r = 0; r < model->rotors; r++)
        if (!is_free(model, r)) arms[r] = 0.0;
}

/* The forces of least squares that balance the torque on every free rotor: where planets or shafts share the load,
 * alike. λ = −Tᵀ y, (T Tᵀ) y = τ. */
void gk_kinematics_carrying(const gk_model *model, int coasts[MAX_ENGAGEMENTS])
{
    GK_ASSERT(model && coasts && model->engagements <= MAX_ENGAGEMENTS);
    static const double SMALL = 1e-9; /* of the diagonal, for what no tooth turns; of the largest force, for none */
    double arms[MAX_ENGAGEMENTS][MAX_ROTORS], force[MAX_ENGAGEMENTS], most = 0.0, trace = 0.0;
    double product[MAX_ROTORS * MAX_ROTORS] = {0}, y[MAX_ROTORS] = {0};
    const int n = model->rotors;
    memset(coasts, 0, MAX_ENGAGEMENTS * sizeof *coasts);
    for (int i = 0; i < model->engagements; i++) {
        if (model->engagement[i].kind == MESH_FLAT) return;
        find_arms(model, &model->engagement[i], arms[i]);
    }
    if (model->ports < 2) return;
    for (int i = 0; i < model->engagements; i++)
        for (int a = 0; a < n; a++)
            for (int b = 0; b < n; b++) product[a * n + b] += arms[i][a] * arms[i][b];
    for (int a = 0; a < n; a++) trace += product[a * n + a];
    for (int a = 0; a < n; a++) product[a * n + a] += SMALL * trace;
    y[model->port[0].rotor] = 1.0;
    if (!gk_cholesky(product, n)) return;
    gk_cholesky_solve(product, y, n);
    for (int i = 0; i < model->engagements; i++) {
        force[i] = 0.0;
        for (int a = 0; a < n; a++) force[i] -= arms[i][a] * y[a];
        most = gk_max(most, fabs(force[i]));
    }
    for (int i = 0; i < model->engagements; i++) coasts[i] = force[i] < -SMALL * most;
}
