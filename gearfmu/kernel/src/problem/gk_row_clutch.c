/* Rows of clutches: friction at the level of speeds. A sticking one takes any λ up to |z| = bound, a slipping one takes
 * z = ±bound against its slip. They know no compliance at once and stand last in the problem. */
#include "problem/gk_row.h"

void gk_row_clutch_recall(const gk_forming *f, gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    s->force0[i] = 0.0;
    s->joint.bound[i] = 2.0 * GK_OF(f->data, shaft)[s->joint.port[i]][V_CAPACITY];
    s->joint.clutches++;
}

/* half a step of slip; a clutch goes on as it was */
void gk_row_clutch_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b)
{
    for (int i = b->from; i < b->end; i++) {
        s->g[i] += 0.5 * h * gk_row_joint_reading(f, s, i, f->work->speed);
        s->active[i] = (unsigned char)GK_OF(f->data, locked)[s->joint.port[i]];
        s->joint.slip[i] = s->g[i] > 0.0 ? -s->joint.bound[i] : s->joint.bound[i];
    }
}

int gk_row_clutch_begin(const gk_forming *f, gk_system *s, const gk_row_block *b)
{
    (void)f;
    for (int i = b->from; i < b->end; i++) s->dashpot.clip[i] = 2, s->g0[i] = s->g[i];
    return 0;
}

/* a sticking one slips beyond its bound; friction of a slipping one must oppose the slip */
int gk_row_clutch_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong)
{
    int count = 0;
    for (int i = b->from; i < b->end; i++) {
        wrong[i] = s->active[i] ? fabs(s->z[i]) > s->joint.bound[i]
                                : s->joint.bound[i] > 0.0 && s->z[i] * gk_solve_end_gap(s, i) > 0.0;
        count += wrong[i];
    }
    return count;
}

void gk_row_clutch_flip(gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    s->active[i] = !s->active[i];
    if (!s->active[i]) s->joint.slip[i] = s->force[i] > 0.0 ? s->joint.bound[i] : -s->joint.bound[i];
    s->force[i] = 0.0;
}

void gk_row_clutch_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b)
{
    (void)setup;
    const gk_system *s = &engaged->system;
    for (int i = b->from; i < b->end; i++) GK_OF(data, joint)
    [s->joint.port[i]][JOINT_CLUTCH] = (gk_joint_state){0.5 * s->z[i], s->dashpot.mean[i], s->dashpot.end[i]};
}
