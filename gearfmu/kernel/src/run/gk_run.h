/* Communication steps and their outputs. */
#ifndef GK_RUN_H
#define GK_RUN_H
#include "base/gk_lanes.h"
#include "base/gk_check.h"
#include "integrate/gk_integrate.h"

struct gk_tally { /* integrals over a communication step */
    double mesh[MAX_ENGAGEMENTS], highest[MAX_ENGAGEMENTS], port[MAX_PORTS];
    double support[MAX_SUPPORTS], last[MAX_SUPPORTS]; /* forces that contacts and joints put on the supports directly;
                                                         last: at the end of the step before */
    double sensed[MAX_SENSORS];                       /* speeds of the sensors at the beginning */
    double *moved, *speed, *last_moved, *last_speed;  /* (ground oscillators) what moves springs and dashpots of the
                                                        supports */
    double *now[2];                                   /* scratch of the same size */
};

/* Force of a row at the end of the step: λ, and what its damper does there. Second order in h; a contact never
 * pulls. */
static inline double gk_reported(const gk_system *s, int i)
{
    GK_ASSERT(gk_is_row(s, i));
    return s->force[i] + s->dashpot.end[i];
}

/* gk_amplitudes.c */
void gk_amplitudes(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data);
void gk_amplitudes_of_contacts(const gk_model *model, const gk_setup *setup, const gk_work *work, int e, int which,
                               double *modes, double *ground);
void gk_amplitudes_of_ports(const gk_model *model, const gk_setup *setup, const gk_work *work, double *ground);
/* gk_supports.c: vectors of the ground oscillators, and of the supports */
GK_HOT void gk_supports_motion(const gk_setup *setup, const gk_work *work, const gk_data *data, double *moved,
                               double *speed);
GK_HOT gk_supports_function gk_supports_by_motion;
GK_HOT void gk_supports_add_direct(const gk_model *model, const gk_setup *setup, const gk_work *work,
                                   const gk_data *data, double *out);
GK_HOT void gk_supports_forces(const gk_model *model, const gk_setup *setup, const gk_work *work, const gk_data *data,
                               double *out, double *of_spring);
GK_HOT void gk_supports_turn(const gk_model *model, const gk_data *data, double sense, double *force);
/* gk_tally.c */
GK_HOT void gk_tally_begin(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                           gk_tally *tally);
GK_HOT gk_tally_function gk_tally_count;
GK_HOT void gk_tally_means(const gk_model *model, const gk_setup *setup, gk_data *data, double H,
                           const gk_tally *tally);
/* gk_outputs.c */
void gk_outputs_start(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data);
void gk_outputs_bores(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data);
void gk_outputs_end(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double H, double h,
                    const gk_tally *tally);
int gk_outputs_balance(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, double h, int first);
#endif
