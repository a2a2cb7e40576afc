/* Rows of joints: port, shaft and clutch of the ports that an engagement has. Here springs and given torques. */
#include "problem/gk_row.h"

static gk_row_kind kind_of(const gk_forming *f, int port, int which)
{
    if (which == JOINT_CLUTCH) return ROW_CLUTCH;
    if (which == JOINT_PORT && f->setup->given_torque[port]) return ROW_TORQUE;
    const int held = !(f->setup->joint[port][which].compliance > 0.0);
    return which == JOINT_PORT && f->model->port[port].play > 0.0 && !held ? ROW_PLAY : ROW_SPRING;
}

static void list_one(const gk_forming *f, double h, gk_system *s, int port, int which)
{
    const gk_joint_state *state = &GK_OF(f->data, joint)[port][which];
    const int i = s->n++;
    s->kind[i] = kind_of(f, port, which);
    s->joint.port[i] = port, s->joint.which[i] = which;
    s->weight[i] = 1.0;
    s->force0[i] = state->force;
    s->dashpot.end0[i] = state->end;
    s->dashpot.mean0[i] = state->damper;
    s->dashpot.coefficient[i] = 2.0 * f->setup->joint[port][which].damping / h;
    s->flank.width[i] = s->flank.per_width[i] = 0.0;
    if (gk_verbs_of(s->kind[i])->recall) gk_verbs_of(s->kind[i])->recall(f, s, i);
}

/* lists the live joints of an engagement's ports behind its contacts, clutches last */
void gk_row_joint_list(const gk_forming *f, double h, gk_system *s)
{
    GK_ASSERT(gk_is_mesh(f->setup, f->e));
    const gk_mesh *mesh = &f->setup->mesh[f->e];
    for (int which = 0; which < JOINTS; which++)
        for (int p = 0; p < mesh->ports; p++)
            if (f->setup->joint[mesh->port[p]][which].live) list_one(f, h, s, mesh->port[p], which);
}

/* derivatives of a joint's row by the spins of the engagement; its reading of spins */
double gk_row_joint_reading(const gk_forming *f, gk_system *s, int i, const double *spin)
{
    GK_ASSERT(i >= s->contacts && gk_is_row(s, i));
    const gk_mesh *mesh = &f->setup->mesh[f->e];
    const int port = s->joint.port[i], slot = mesh->port[0] == port ? 0 : 1, chain = f->setup->chained[port];
    const int *chained = mesh->joint_spin[slot];
    int plus = 0, minus = -1;
    while (mesh->spin[plus] != f->model->port[port].rotor) plus++;
    if (s->joint.which[i] == JOINT_SHAFT) minus = chained[1];
    if (s->joint.which[i] == JOINT_CLUTCH) plus = chained[0], minus = chained[1];
    if (s->joint.which[i] == JOINT_PORT && chain) plus = chained[0];
    s->rigid[plus][i] = 1.0;
    if (minus >= 0) s->rigid[minus][i] = -1.0;
    return spin[mesh->spin[plus]] - (minus >= 0 ? spin[mesh->spin[minus]] : 0.0);
}

/* springs measure relative to their outer ends */
void gk_row_joint_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b)
{
    (void)h;
    for (int i = b->from; i < b->end; i++) {
        s->g[i] += gk_row_joint_reading(f, s, i, f->work->spin);
        if (gk_row_has_outer_end(s, i)) s->g[i] -= f->work->outer[s->joint.port[i]];
    }
}

int gk_row_joint_begin(const gk_forming *f, gk_system *s, const gk_row_block *b)
{
    (void)f;
    for (int i = b->from; i < b->end; i++) s->dashpot.clip[i] = 0, s->active[i] = 1;
    return 0;
}

int gk_row_joint_begin_given(const gk_forming *f, gk_system *s, const gk_row_block *b)
{
    int given = 0;
    for (int i = b->from; i < b->end; i++) {
        s->dashpot.clip[i] = 2, s->active[i] = 0;
        s->force[i] = f->work->torque[s->joint.port[i]];
        given |= s->force[i] != s->force0[i];
    }
    return given;
}

double gk_row_joint_twist(const gk_setup *setup, const gk_system *s, int i)
{
    GK_ASSERT(i >= s->contacts && gk_is_row(s, i));
    return s->force[i] * setup->joint[s->joint.port[i]][s->joint.which[i]].compliance;
}

void gk_row_joint_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b)
{
    (void)setup;
    const gk_system *s = &engaged->system;
    for (int i = b->from; i < b->end; i++) GK_OF(data, joint)
    [s->joint.port[i]][s->joint.which[i]] = (gk_joint_state){s->force[i], s->dashpot.mean[i], s->dashpot.end[i]};
}
