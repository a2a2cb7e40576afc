/* The step in wider vectors: the same sources once more as one unit for AVX2, in which functions marked GK_HOT are
 * static. Our own cpuid chooses it (the compilers' dispatch does not link everywhere). Sums have fixed lanes and
 * nothing is contracted, so that both give the same bits. Builds of tests leave it out by GK_PORTABLE. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(GK_PORTABLE)
#include <cpuid.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef GK_PROFILE
#include <x86intrin.h>
#endif
#ifdef GK_CHECK
#include <stdio.h>
#include <stdlib.h>
#endif

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define GK_WIDE
#include "problem/gk_law.c"
#include "setup/gk_flow.c"
#include "force/gk_section.c"
#include "force/gk_parts.c"
#include "force/gk_flank.c"
#include "force/gk_turn.c"
#include "force/gk_field.c"
#include "setup/gk_block.c"
#include "setup/gk_node.c"
#include "setup/gk_grounded.c"
#include "setup/gk_slices.c"
#include "setup/gk_residual.c"
#include "setup/gk_tables.c"
#include "setup/gk_patterns.c"
#include "setup/gk_moves.c"
#include "problem/gk_rows.c"
#include "problem/gk_exchange.c"
#include "problem/gk_compliance.c"
#include "problem/gk_ground.c"
#include "problem/gk_row_contact.c"
#include "problem/gk_row_joint.c"
#include "problem/gk_row_clutch.c"
#include "problem/gk_row_play.c"
#include "problem/gk_form.c"
#include "problem/gk_film.c"
#include "problem/gk_tangent.c"
#include "problem/gk_solve.c"
#include "problem/gk_balance.c"
#include "problem/gk_glide.c"
#include "problem/gk_friction_energy.c"
#include "problem/gk_friction_law.c"
#include "problem/gk_friction.c"
#include "problem/gk_felt.c"
#include "problem/gk_far.c"
#include "problem/gk_pass_read.c"
#include "problem/gk_pass.c"
#include "problem/gk_couple.c"
#include "problem/gk_nodal.c"
#include "problem/gk_engage.c"
#include "integrate/gk_crowd.c"
#include "integrate/gk_frame.c"
#include "integrate/gk_advance.c"
#include "integrate/gk_energy.c"
#include "integrate/gk_closed.c"
#include "integrate/gk_step.c"
#include "integrate/gk_rk45.c"
#include "integrate/gk_central.c"
#include "run/gk_supports.c"
#include "run/gk_sensors.c"
#include "run/gk_tally.c"
#include "run/gk_wide.h"
static const gk_hot AVX2 = GK_HOT_FUNCTIONS;
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

/* AVX2 in the processor, and its registers kept by the system over a task switch */
static int has_avx2(void)
{
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & (1u << 27))) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & (1u << 5));
}

const gk_hot *gk_wide(void) { return has_avx2() ? &AVX2 : NULL; }
#else
#include "run/gk_wide.h"
const gk_hot *gk_wide(void) { return NULL; }
#endif
