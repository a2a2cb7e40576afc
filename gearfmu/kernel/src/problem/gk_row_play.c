/* Rows of a spring with play, as a spline has: within ±½ of it the shaft is free, on either side the spring takes the
 * rest. A closed side is a bilateral row whose gap counts from that side (joint.slip: ±½ play, joint.bound: ½ play); λ
 * there never pulls. The damper acts while the same side is closed at both ends of a step. */
#include "problem/gk_row.h"

/* the side that is closed under a force */
static double side_of(const gk_system *s, int i, double force)
{
    return force < 0.0 ? s->joint.bound[i] : force > 0.0 ? -s->joint.bound[i] : 0.0;
}

void gk_row_play_recall(const gk_forming *f, gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    s->joint.bound[i] = 0.5 * f->model->port[s->joint.port[i]].play;
    s->joint.slip[i] = side_of(s, i, s->force0[i]);
}

/* counts the gap from another side */
static void change_side(gk_system *s, int i, double side)
{
    const double by = s->joint.slip[i] - side;
    s->joint.slip[i] = side;
    s->g[i] += by, s->g0[i] += by;
    s->active[i] = side != 0.0;
}

/* where it was closed it goes on; else it is where it stood, and closes if it would come beyond */
int gk_row_play_begin(const gk_forming *f, gk_system *s, const gk_row_block *b)
{
    for (int i = b->from; i < b->end; i++) {
        const int closed = s->force0[i] != 0.0;
        const double bound = s->joint.bound[i];
        s->dashpot.clip[i] = closed ? 0 : 2;
        s->g[i] -= s->joint.slip[i];
        s->active[i] = closed;
        if (closed) continue;
        s->g0[i] += GK_OF(f->data, angle)[s->joint.port[i]];
        if (fabs(s->g[i]) > bound) change_side(s, i, s->g[i] > 0.0 ? bound : -bound);
    }
    return 0;
}

static double apart(const gk_system *s, int i) { return gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i); }

int gk_row_play_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong)
{
    int count = 0;
    for (int i = b->from; i < b->end; i++) {
        wrong[i] = s->active[i] ? s->force[i] * s->joint.slip[i] > 0.0 : fabs(apart(s, i)) > s->joint.bound[i];
        count += wrong[i];
    }
    return count;
}

void gk_row_play_flip(gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    change_side(s, i, s->active[i] ? 0.0 : apart(s, i) > 0.0 ? s->joint.bound[i] : -s->joint.bound[i]);
    if (!s->active[i]) s->force[i] = 0.0, s->dashpot.clip[i] = 2;
}

double gk_row_play_twist(const gk_setup *setup, const gk_system *s, int i)
{
    return s->active[i] ? gk_row_joint_twist(setup, s, i) - s->joint.slip[i] : -apart(s, i);
}

void gk_row_play_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b)
{
    gk_row_joint_keep(setup, engaged, data, b);
    for (int i = b->from; i < b->end; i++)
        GK_OF(data, angle)[engaged->system.joint.port[i]] = -gk_row_play_twist(setup, &engaged->system, i);
}
