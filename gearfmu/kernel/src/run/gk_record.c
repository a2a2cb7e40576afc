/* Many communication steps by one call: rows of inputs in, rows of outputs out. */
#include "run/gk_run.h"

gk_outcome gk_record(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data, gk_recording *r)
{
    GK_ASSERT(model && setup && work && data && r);
    for (r->done = 0; r->done < r->steps; r->done++) {
        const double *in = r->given ? r->input + r->done * r->given : NULL;
        double *out = r->kept ? r->output + r->done * r->kept : NULL;
        gk_outcome outcome = gk_set_many(model, data, r->inputs, r->given, in);
        if (!outcome) outcome = gk_step(model, setup, work, data, (double)(r->first + r->done) * r->H, r->H);
        if (!outcome) outcome = gk_get_many(model, data, r->outputs, r->kept, out);
        if (outcome) return outcome;
    }
    return GK_OK;
}
