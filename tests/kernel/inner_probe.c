/* Opens inner functions of the kernel to tests: places of contact with gap and gradient, the local law. Compiled together with gearfmu/kernel/src. */
#include "gk_core.h"

/* out: per place {flank, tooth, gap, gradient[6], roll A, roll B, curvature} */
GK_API int probe_places(const gk_model *model, const gk_setup *setup, const double *frame, double reach, double *out)
{
    gk_place place[MAX_PAIRS];
    int found = gk_flank_find(model, setup, frame, reach, place);
    for (int i = 0; i < found; i++, out += 12) {
        out[0] = place[i].flank;
        out[1] = place[i].key.tooth;
        out[2] = place[i].gap;
        memcpy(out + 3, place[i].gradient, sizeof place[i].gradient);
        out[9] = place[i].roll[0];
        out[10] = place[i].roll[1];
        out[11] = place[i].curvature;
    }
    return found;
}

/* out: {approach, slope, energy} of one slice at `force` */
GK_API void probe_law(const gk_model *model, const gk_setup *setup, double curvature, double force, double *out)
{
    gk_local law;
    gk_law_set(model, setup, curvature, &law);
    law.width = setup->width / setup->slices;
    out[0] = gk_law_approach(&law, force, &out[1]);
    out[2] = gk_law_energy(&law, force);
}

GK_API double probe_mu(const gk_model *model, const gk_setup *setup, double h, double gamma) { return gk_limit_mu(model, setup, h, gamma); }

/* a prepared setup keeps this γ, whatever its limit is */
GK_API void probe_set_gamma(gk_setup *setup, double gamma) { setup->gamma = gamma; }
