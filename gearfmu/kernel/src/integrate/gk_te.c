/* Calls that ask for a state of rest: under given torques, and the loaded transmission error. */
#include "integrate/gk_integrate.h"

/* angle of a port's bore under its torque: what the rows move it by comes on top of the spin */
static double driven_angle(const gk_model *model, const gk_work *work, int port)
{
    double angle = 0.0;
    for (int e = 0; e < model->engagements; e++) {
        const gk_system *s = &work->engaged[e].system;
        for (int i = s->contacts; i < s->n; i++)
            if (s->joint.port[i] == port && s->joint.which[i] == JOINT_PORT)
                angle = gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i);
    }
    return angle;
}

gk_outcome gk_rest(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, const double *torque,
                   double *phi)
{
    GK_ASSERT(torque && phi);
    gk_boundary b[MAX_PORTS];
    for (int p = 0; p < model->ports; p++) b[p] = (gk_boundary){PORT_TORQUE, torque[p], 0.0, 0.0};
    const gk_outcome outcome = gk_static_solve(model, setup, work, data, b, STATIC_BARE);
    for (int p = 0; p < model->ports && outcome == GK_OK; p++) phi[p] = driven_angle(model, work, p);
    return outcome;
}

/* a port beyond input and output: free, but where carriers turn its spring holds it */
static gk_boundary further(const gk_model *model, int p)
{
    const int held = model->carried && model->port[p].kind != PORT_TORQUE;
    return held ? (gk_boundary){PORT_SPRING, 0.0, 0.0, model->port[p].k} : (gk_boundary){PORT_TORQUE, 0.0, 0.0, 0.0};
}

/* transmission error of an engagement by the angles of its gears and of the rotor that carries it, m */
static double te_of(const gk_model *model, const gk_setup *setup, int e, const double *angle, const double *carried)
{
    const gk_engagement *mesh = &model->engagement[e];
    const gk_gear *A = &model->gear[mesh->gear[0]], *B = &model->gear[mesh->gear[1]];
    const int f = setup->mesh[e].frame;
    const double frame = f < 0 ? 0.0 : carried[f];
    return A->r_b * (angle[A->rotor] - frame) + mesh->kind * B->r_b * (angle[B->rotor] - frame);
}

/* forces of a tooth pair on the slices of the width */
static void spread(const gk_model *model, const gk_setup *setup, const gk_engaged *engaged, int p, double *slice)
{
    const gk_system *s = &engaged->system;
    const gk_mesh *mesh = &setup->mesh[engaged->index];
    const gk_engagement *e = &model->engagement[engaged->index];
    memset(slice, 0, (size_t)setup->slices * sizeof *slice);
    for (int i = 0; i < s->strips && mesh->rides; i++)
        gk_strips_spread(setup, e, engaged->place[p].point[i].end, s->force[p * s->strips + i], slice);
    for (int i = 0; i < setup->slices && !mesh->rides; i++) {
        const int strip = i < s->strips ? i : setup->slices - 1 - i;
        slice[i] = s->force[p * s->strips + strip] * e->width / (setup->slices * mesh->strip_width[strip]);
    }
}

/* Quasi-static transmission (eq. 13): torque on the bore of the first port, the bore of the second held at phi_out,
 * other ports free; what chains the ports have is left out. `keep` continues from the last call; where that leads
 * nowhere, the search begins anew. */
gk_outcome gk_te(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double phi_out,
                 double torque, int keep)
{
    gk_boundary b[MAX_PORTS] = {{PORT_TORQUE, torque, 0.0, 0.0}, {PORT_FIXED, 0.0, phi_out, 0.0}};
    if (model->ports < 2) return GK_BAD_CALL;
    for (int p = 2; p < model->ports; p++) b[p] = further(model, p);
    gk_outcome outcome = GK_NO_EQUILIBRIUM;
    if (keep) outcome = gk_static_solve(model, setup, work, data, b, STATIC_BARE | STATIC_KEEP);
    if (outcome == GK_NO_EQUILIBRIUM) outcome = gk_static_solve(model, setup, work, data, b, STATIC_BARE);
    return outcome;
}

/* The same equilibrium seen at engagement e. out: te (m) by the bores of the ports, angle (rad) of the first port's
 * bore, te of e as its output in motion, by the carrier's own angle, then for every tooth pair of e {flank, tooth of
 * gear A, force of each slice}; room for 3 + MAX_PAIRS·(2 + MAX_SLICES) numbers. */
gk_outcome gk_te_at(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data, int e,
                    double *out, int *places)
{
    GK_ASSERT(out && places);
    double angle[MAX_ROTORS];
    if (model->ports < 2 || e < 0 || e >= model->engagements || data->state_h != 0.0) return GK_BAD_CALL;
    for (int r = 0; r < model->rotors; r++) angle[r] = GK_OF(data, x)[r];
    angle[model->port[0].rotor] = driven_angle(model, work, 0);
    angle[model->port[1].rotor] = work->outer[1];
    const gk_engaged *engaged = &work->engaged[e];
    *out++ = te_of(model, setup, e, angle, angle);
    *out++ = angle[model->port[0].rotor];
    *out++ = te_of(model, setup, e, angle, GK_OF(data, x));
    *places = engaged->places;
    for (int p = 0; p < *places; p++, out += 2 + setup->slices) {
        out[0] = engaged->place[p].key.flank;
        out[1] = engaged->place[p].key.tooth;
        spread(model, setup, engaged, p, out + 2);
    }
    return GK_OK;
}
