/* Functions of FMI 2.0 that this FMU does not offer: each refuses, says so and changes nothing. Some loaders look up
 * those of model exchange in every FMU, also where only co-simulation is declared. */
#include "fmi2/fmi2_face.h"
#pragma GCC diagnostic ignored "-Wunused-parameter"

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    return face_absent(c, __func__);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    return face_absent(c, __func__);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    return face_absent(c, __func__);
}

fmi2Status fmi2CancelStep(fmi2Component c) { return face_absent(c, __func__); }

/* ---- model exchange: some loaders look these up in every FMU, also where only co-simulation is declared ---------- */
fmi2Status fmi2EnterEventMode(fmi2Component c) { return face_absent(c, __func__); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) { return face_absent(c, __func__); }

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return face_absent(c, __func__); }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    return face_absent(c, __func__);
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return face_absent(c, __func__); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) { return face_absent(c, __func__); }

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) { return face_absent(c, __func__); }

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    return face_absent(c, __func__);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) { return face_absent(c, __func__); }

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    return face_absent(c, __func__);
}
