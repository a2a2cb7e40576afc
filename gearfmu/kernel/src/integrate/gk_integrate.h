/* The time integrators, statics and the choice of the step. */
#ifndef GK_INTEGRATE_H
#define GK_INTEGRATE_H
#include "problem/gk_engage.h"
#include "problem/gk_work.h"
#include "setup/gk_room.h"
#include "setup/gk_tables.h"

/* gk_step.c */
GK_HOT gk_step_function gk_step_once;
/* gk_frame.c */
GK_HOT void gk_frame_turn(const gk_setup *setup, const gk_coefficients *k, const gk_data *data, int back, double *v);
GK_HOT void gk_frame_predict(const gk_modal *m, const gk_flow *w, double angle, const gk_real *state, gk_work *work,
                             int g);
GK_HOT void gk_frame_finish(const gk_modal *m, const gk_flow *w, double angle, gk_work *work, int g);
GK_HOT void gk_frame_gear_rates(const gk_modal *m, double speed, const gk_real *v, gk_real *a);
GK_HOT double gk_frame_press(const gk_model *model, const gk_setup *setup, const gk_coefficients *k,
                             const gk_data *data, double *v);
GK_HOT void gk_frame_rates(const gk_model *model, const gk_setup *setup, const double *spin, const double *v,
                           double *a);
GK_HOT void gk_frame_load(const gk_model *model, const gk_setup *setup, const gk_data *data, double *force);
/* gk_rk45.c */
GK_HOT int gk_rk45_evaluate(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, int i,
                            const double *outer);
GK_HOT void gk_rk45_resist(const gk_setup *setup, const gk_mesh *mesh, const gk_system *s, double *y);
GK_HOT void gk_rk45_angles(const gk_model *model, const gk_work *work, gk_data *data);
GK_HOT void gk_rk45_squeeze(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data,
                            double step);
/* teeth of any mesh overlap by more than means anything */
GK_HOT int gk_rk45_overlaps(const gk_model *model, const gk_work *work);
GK_HOT gk_step_function gk_rk45_step;
/* gk_central.c */
GK_HOT gk_step_function gk_central_step;
double gk_central_energy(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                         double h);
double gk_central_limit(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data);
/* gk_limit.c */
double gk_limit_gamma(const gk_setup *setup, const gk_work *work, const gk_data *data, double h);
void gk_limit_run(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data, double h);
gk_outcome gk_limit_choose(const gk_model *model, gk_setup *setup, gk_work *work, const gk_data *data,
                           char message[GK_MESSAGE]);
/* gk_static.c. BARE: the boundary acts on the bores, without the ports' chains. KEEP: the search starts from the
 * present angles instead of from the unloaded mesh. */
enum { STATIC_BARE = 1, STATIC_KEEP = 2 };
typedef struct gk_boundary {
    gk_port_kind kind;
    double torque, phi, k;
} gk_boundary;
gk_outcome gk_static_solve(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                           const gk_boundary *boundary, int how);
#endif
