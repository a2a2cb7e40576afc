/* Sensors: points of the housing that nothing loads. A host samples them once a communication step, so each tells its
 * mean acceleration over the step, (v₁ − v₀)/H: what moves faster is averaged and not folded back. */
#include "run/gk_sensors.h"
#include "run/gk_run.h"

/* speeds of the sensors by that of the dynamic oscillators */
void gk_sensors_speed(const gk_model *model, const gk_setup *setup, const double *speed, double *out)
{
    GK_ASSERT(speed && out && model->sensors <= MAX_SENSORS);
    const gk_base *base = &setup->base;
    for (int i = 0; i < model->sensors; i++)
        out[i] = gk_dot_span(base->sensor_span[i], base->sensor_rows + i * base->n, speed);
}

/* mean accelerations of a communication step of length H; before: speeds at its beginning */
void gk_sensors_means(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data, double H,
                      const double *before)
{
    GK_ASSERT(H > 0.0 && before);
    if (!model->sensors) return;
    double after[MAX_SENSORS], *const moved = work->tally + 4 * setup->base.n, *const speed = moved + setup->base.n;
    gk_supports_motion(setup, work, data, moved, speed);
    gk_sensors_speed(model, setup, speed, after);
    for (int i = 0; i < model->sensors; i++) GK_OF(data, sensor)[i][V_ACCELERATION] = (after[i] - before[i]) / H;
}
