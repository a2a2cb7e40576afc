/* Coefficients of one oscillator q̈ + 2ζωq̇ + ω²q = f, and of a free mass, for a step of one length. */
#ifndef GK_OSCILLATOR_H
#define GK_OSCILLATOR_H

typedef struct gk_pace {
    double h, gamma, matched; /* s; γ; rad/s, where a response is exact beside rest: the mesh mode */
} gk_pace;

typedef struct gk_oscillator {
    double a11, a12, a21, a22; /* flow of (q, v) */
    double b0q, b0v, bq, bv;   /* by the force at the start and at the end of the step */
    double mobility;           /* displacement of a gap by the force at the end */
    double kappa, inverse_s2;  /* q − κf: displacement; weight of the energy ½v² + ½ω²q² */
    double unit, lead, hold;   /* v = unit ẋ + lead ḟ + hold f: speed of the state by that of the motion */
} gk_oscillator;

gk_oscillator gk_oscillator_of(const gk_pace *pace, double omega, double zeta);
double gk_oscillator_free_kappa(const gk_pace *pace);
/* share of the correction κ that is left: γ lowers it below ½ only */
double gk_oscillator_correction(double gamma);
#endif
