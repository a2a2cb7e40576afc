/* Rows of contacts: strips of all tooth pairs, λ ≥ 0. Their law is in problem/gk_law.c, their damper's limits are in
 * gk_solve.c. */
#include "problem/gk_row.h"
#include "problem/gk_rows.h"

/* lists the strips of all places, with what they remember */
void gk_row_contact_list(const gk_forming *f, double h, gk_system *s)
{
    GK_ASSERT(gk_is_mesh(f->setup, f->e));
    const gk_mesh *mesh = &f->setup->mesh[f->e];
    const gk_meshing *meshing = &GK_OF(f->data, meshing)[f->e];
    const gk_engaged *engaged = &f->work->engaged[f->e];
    static const gk_memory fresh;
    const double damping = GK_ON(f->setup, contact_damping) ? 2.0 * mesh->damping / h : 0.0;
    const double slice = f->setup->slices / f->model->engagement[f->e].width, per_cosine = 1.0 / mesh->cosine;
    int n = 0;
    for (int p = 0; p < engaged->places; p++) {
        const gk_place *place = &engaged->place[p];
        const gk_memory *memory = place->memory < 0 ? &fresh : &meshing->memory[place->memory];
        for (int i = 0; i < GK_STRIPS(s); i++, n++) {
            const gk_point *point = gk_point_of(f->setup, place, i);
            const double width = mesh->strip_width[i] * point->share;
            s->kind[n] = ROW_CONTACT;
            s->joint.port[n] = s->joint.which[n] = -1;
            s->flank.place_of[n] = p;
            s->force0[n] = memory->force[i];
            s->dashpot.end0[n] = memory->end[i];
            s->dashpot.mean0[n] = memory->damper[i];
            s->dashpot.coefficient[n] = damping * width;
            s->weight[n] = width * slice;
            s->flank.width[n] = width * per_cosine;
            s->flank.per_width[n] = 1.0 / s->flank.width[n];
            s->flank.curvature[n] = point->curvature;
            for (int k = 0; k < GAPS - 1 && mesh->rides; k++) s->flank.opens[k][n] = point->opens[k];
        }
    }
    s->contacts = s->n = n;
    gk_law_set(f->model, f->setup, mesh, s);
}

/* Undeformed gap at the predicted poses, which contain the rigid motion of the gears by the ground group: that has been
 * read with the oscillators, and is taken away. */
void gk_row_contact_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b)
{
    GK_ASSERT(b->from == 0 && b->end == s->contacts);
    (void)h;
    const gk_mesh *mesh = &f->setup->mesh[f->e];
    const gk_engaged *engaged = &f->work->engaged[f->e];
    gk_rows_without_rigid(f->setup, f->work, f->e, f->work->ground_y, s->g);
    for (int p = 0, i = b->from; p < engaged->places; p++)
        for (int strip = 0; strip < GK_STRIPS(s); strip++, i++) {
            const gk_point *point = gk_point_of(f->setup, &engaged->place[p], strip);
            s->g[i] += point->gap;
            s->rigid[0][i] = point->gradient[PHIA], s->rigid[1][i] = point->gradient[PHIB];
            if (mesh->frame >= 0) s->rigid[2][i] = -point->gradient[PHIA] - point->gradient[PHIB];
        }
}

int gk_row_contact_begin(const gk_forming *f, gk_system *s, const gk_row_block *b)
{
    GK_ASSERT(gk_system_is_sound(s));
    const gk_engaged *engaged = &f->work->engaged[f->e];
    for (int i = b->from; i < b->end; i++) {
        const int memory = engaged->place[s->flank.place_of[i]].memory;
        s->flank.recalled[i] = memory >= 0;
        s->g0[i] = memory < 0 ? gk_max(s->g[i], s->g0[i])
                              : s->g0[i] + GK_OF(f->data, meshing)[f->e].memory[memory].gap[i % GK_STRIPS(s)];
        s->dashpot.apart[i] = s->g0[i] + gk_solve_quasi_static(s, i);
        s->active[i] = s->force0[i] > 0.0 || s->g[i] < 0.0;
        s->dashpot.clip[i] = s->force0[i] > 0.0 && s->dashpot.coefficient[i] > 0.0 ? 0 : 2;
    }
    return 0;
}

int gk_row_contact_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong)
{
    GK_ASSERT(gk_system_is_sound(s) && wrong);
    const int films = gk_film_on(s);
    int count = 0;
    for (int i = b->from; i < b->end; i++) {
        const double touching = films ? s->film->left[i] : 0.0;
        wrong[i] = s->active[i] ? s->force[i] < 0.0 : gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i) < touching;
        count += wrong[i];
    }
    return count;
}

void gk_row_contact_flip(gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i) && i < s->contacts);
    s->active[i] = !s->active[i];
    if (s->active[i]) return;
    if (!(s->force0[i] > 0.0)) s->dashpot.clip[i] = 2; /* closed at neither end */
    s->dashpot.hold[i] = s->dashpot.clip[i] != 2;
    s->force[i] = 0.0;
}

void gk_row_contact_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b)
{
    GK_ASSERT(engaged->places >= 0 && engaged->places <= MAX_PAIRS);
    const gk_system *s = &engaged->system;
    gk_memory *memory = GK_OF(data, meshing)[engaged->index].memory;
    for (int p = 0, i = b->from; p < engaged->places; p++, memory++)
        for (int strip = 0; strip < GK_STRIPS(s); strip++, i++) {
            memory->force[strip] = s->force[i];
            memory->gap[strip] = gk_solve_end_gap(s, i) + gk_solve_quasi_static(s, i);
            memory->damper[strip] = s->dashpot.mean[i];
            memory->end[strip] = s->dashpot.end[i];
            if (GK_ON(setup, friction)) memory->ratio[strip] = engaged->glide->ratio[i];
            if (GK_ON(setup, hertz) && s->force[i] > s->flank.law[i / 4].high[i % 4] * s->flank.width[i])
                data->status |= STATUS_LAW;
        }
}
