/* Effects (gk_effects.inc): which are on, and which this build has code for. */
#ifndef GK_EFFECTS_H
#define GK_EFFECTS_H

typedef struct gk_effects {
#define GK_EFFECT(name, variable, needs, refusal) int name;
#define GK_PART(name)
#include "model/gk_effects.inc"
#undef GK_EFFECT
#undef GK_PART
} gk_effects;

/* A kernel built with -DGK_WITHOUT=tip_relief has no code for that effect: what an effect costs while it is off is
 * measured against it (evidence/price/effects_cost.py) */
#ifndef GK_WITHOUT
#define GK_WITHOUT nothing
#endif
enum {
    EFFECT_nothing,
#define GK_EFFECT(name, variable, needs, refusal) EFFECT_##name,
#define GK_PART(name) EFFECT_##name,
#include "model/gk_effects.inc"
#undef GK_EFFECT
#undef GK_PART
};
#define GK_NUMBER(name) EFFECT_##name
#define GK_NUMBER_OF(name) GK_NUMBER(name)
#define GK_HAS(effect) (GK_NUMBER_OF(GK_WITHOUT) != EFFECT_##effect)
#define GK_ON(setup, effect) (GK_HAS(effect) && (setup)->on.effect)
#endif
