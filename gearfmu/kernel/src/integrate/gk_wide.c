/* The step in wider vectors: the same sources once more, compiled for AVX2, chosen by our own cpuid (the compilers'
 * dispatch does not link everywhere). Sums have fixed lanes and nothing is contracted, so both give the same bits. */
#if defined(__x86_64__) && defined(__GNUC__)
#include "base/gk_check.h"
#include <cpuid.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef GK_PROFILE
#include <x86intrin.h>
#endif

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define GK_WIDE /* only what a step runs through */
#define gk_flow_for gk_flow_for_avx2
#define gk_flow_known gk_flow_known_avx2
#define gk_flank_find gk_flank_find_avx2
#define gk_flank_move gk_flank_move_avx2
#define gk_flank_clearance gk_flank_clearance_avx2
#define gk_frozen_find gk_frozen_find_avx2
#define gk_nodal_leave gk_nodal_leave_avx2
#define gk_nodal_press gk_nodal_press_avx2
#define gk_rows_pose gk_rows_pose_avx2
#define gk_rows_form gk_rows_form_avx2
#define gk_rows_read gk_rows_read_avx2
#define gk_rows_form_ground gk_rows_form_ground_avx2
#define gk_rows_without_rigid gk_rows_without_rigid_avx2
#define gk_rows_scatter gk_rows_scatter_avx2
#define gk_rows_turn_back gk_rows_turn_back_avx2
#define gk_rows_turn_forth gk_rows_turn_forth_avx2
#define gk_side_step gk_side_step_avx2
#define gk_block_of gk_block_of_avx2
#define gk_block_tabulate gk_block_tabulate_avx2
#define gk_block_along_normal gk_block_along_normal_avx2
#define gk_block_along_own gk_block_along_own_avx2
#define gk_block_between gk_block_between_avx2
#define gk_node_tan gk_node_tan_avx2
#define gk_node_roll gk_node_roll_avx2
#define gk_node_size gk_node_size_avx2
#define gk_node_blend gk_node_blend_avx2
#define gk_node_motion_at gk_node_motion_at_avx2
#define gk_node_gather gk_node_gather_avx2
#define gk_node_turn gk_node_turn_avx2
#define gk_node_take gk_node_take_avx2
#define gk_node_begin gk_node_begin_avx2
#define gk_node_room gk_node_room_avx2
#define gk_grounded_room gk_grounded_room_avx2
#define gk_grounded_side gk_grounded_side_avx2
#define gk_grounded_times gk_grounded_times_avx2
#define gk_residual_size gk_residual_size_avx2
#define gk_residual_begin gk_residual_begin_avx2
#define gk_residual_gather gk_residual_gather_avx2
#define gk_residual_gather_along gk_residual_gather_along_avx2
#define gk_residual_store gk_residual_store_avx2
#define gk_residual_store_along gk_residual_store_along_avx2
#define gk_side_fill gk_side_fill_avx2
#define gk_compliance_form gk_compliance_form_avx2
#define gk_compliance_mirror gk_compliance_mirror_avx2
#define gk_ground_add gk_ground_add_avx2
#define gk_form_system gk_form_system_avx2
#define gk_form_rates gk_form_rates_avx2
#define gk_law_set gk_law_set_avx2
#define gk_law_bounds gk_law_bounds_avx2
#define gk_law_slope gk_law_slope_avx2
#define gk_law_apply gk_law_apply_avx2
#define gk_solve_contacts gk_solve_contacts_avx2
#define gk_solve_clear gk_solve_clear_avx2
#define gk_balance_plain gk_balance_plain_avx2
#define gk_couple_island gk_couple_island_avx2
#define gk_couple_recall gk_couple_recall_avx2
#define gk_rows_form_along gk_rows_form_along_avx2
#define gk_rows_read_ground_along gk_rows_read_ground_along_avx2
#define gk_rows_read_local_along gk_rows_read_local_along_avx2
#define gk_rows_push_local_along gk_rows_push_local_along_avx2
#define gk_rows_push_modes_along gk_rows_push_modes_along_avx2
#define gk_rows_read_modes_along gk_rows_read_modes_along_avx2
#define gk_film_begin gk_film_begin_avx2
#define gk_film_begin_rates gk_film_begin_rates_avx2
#define gk_film_apply gk_film_apply_avx2
#define gk_film_lost gk_film_lost_avx2
#define gk_film_grows gk_film_grows_avx2
#define gk_film_power gk_film_power_avx2
#define gk_friction_form gk_friction_form_avx2
#define gk_friction_solve gk_friction_solve_avx2
#define gk_friction_held gk_friction_held_avx2
#define gk_friction_defect gk_friction_defect_avx2
#define gk_friction_watch gk_friction_watch_avx2
#define gk_friction_settle gk_friction_settle_avx2
#define gk_far_form gk_far_form_avx2
#define gk_far_between gk_far_between_avx2
#define gk_shared_form gk_shared_form_avx2
#define gk_shared_read gk_shared_read_avx2
#define gk_rows_read_local gk_rows_read_local_avx2
#define gk_rows_push_local gk_rows_push_local_avx2
#define gk_rows_form_bores gk_rows_form_bores_avx2
#define gk_rows_push_bores gk_rows_push_bores_avx2
#define gk_rows_read_bores gk_rows_read_bores_avx2
#define gk_rows_push_modes gk_rows_push_modes_avx2
#define gk_rows_read_modes gk_rows_read_modes_avx2
#define gk_solve_settle gk_solve_settle_avx2
#define gk_solve_begin gk_solve_begin_avx2
#define gk_solve_begin_dashpots gk_solve_begin_dashpots_avx2
#define gk_solve_status gk_solve_status_avx2
#define gk_solve_times gk_solve_times_avx2
#define gk_solve_path gk_solve_path_avx2
#define gk_solve_stored gk_solve_stored_avx2
#define gk_tangent_factorise gk_tangent_factorise_avx2
#define gk_tangent_solve gk_tangent_solve_avx2
#define gk_balance_solve gk_balance_solve_avx2
#define gk_step_once gk_step_once_avx2
#define gk_memory_recall gk_memory_recall_avx2
#define gk_memory_find gk_memory_find_avx2
#define gk_memory_keep gk_memory_keep_avx2
#define gk_memory_forget gk_memory_forget_avx2
#define gk_step_energy gk_step_energy_avx2
#define gk_step_force gk_step_force_avx2
#define gk_step_z gk_step_z_avx2
#define gk_frame_turn gk_frame_turn_avx2
#define gk_frame_turn_gear gk_frame_turn_gear_avx2
#define gk_frame_gear_rates gk_frame_gear_rates_avx2
#define gk_frame_press gk_frame_press_avx2
#define gk_frame_load gk_frame_load_avx2
#define gk_frame_rates gk_frame_rates_avx2
#define gk_rk45_evaluate gk_rk45_evaluate_avx2
#define gk_rk45_resist gk_rk45_resist_avx2
#define gk_rk45_angles gk_rk45_angles_avx2
#define gk_rk45_squeeze gk_rk45_squeeze_avx2
#define gk_rk45_step gk_rk45_step_avx2
#define gk_central_step gk_central_step_avx2
#define gk_supports_motion gk_supports_motion_avx2
#define gk_supports_by_motion gk_supports_by_motion_avx2
#define gk_supports_add_direct gk_supports_add_direct_avx2
#define gk_supports_forces gk_supports_forces_avx2
#define gk_supports_turn gk_supports_turn_avx2
#define gk_tally_begin gk_tally_begin_avx2
#define gk_tally_count gk_tally_count_avx2
#define gk_tally_means gk_tally_means_avx2
#include "force/gk_law.c"
#include "setup/gk_flow.c"
#include "force/gk_flank.c"
#include "force/gk_frozen.c"
#include "force/gk_rows.c"
#include "setup/gk_block.c"
#include "setup/gk_node.c"
#include "setup/gk_grounded.c"
#include "setup/gk_residual.c"
#include "setup/gk_tables.c"
#include "setup/gk_moves.c"
#include "problem/gk_compliance.c"
#include "problem/gk_ground.c"
#include "problem/gk_form.c"
#include "problem/gk_film.c"
#include "problem/gk_tangent.c"
#include "problem/gk_solve.c"
#include "problem/gk_balance.c"
#include "problem/gk_friction.c"
#include "problem/gk_far.c"
#include "problem/gk_shared.c"
#include "problem/gk_couple.c"
#include "force/gk_nodal.c"
#include "integrate/gk_frame.c"
#include "integrate/gk_memory.c"
#include "integrate/gk_step.c"
#include "integrate/gk_rk45.c"
#include "integrate/gk_central.c"
#include "run/gk_supports.c"
#include "run/gk_tally.c"
#undef gk_step_once
#undef gk_central_step
#undef gk_rk45_step
#undef gk_tally_count
#undef gk_side_fill
#undef gk_side_step
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

gk_step_function gk_step_once, gk_central_step, gk_rk45_step;
gk_tally_function gk_tally_count;
gk_fill_function gk_side_fill;
gk_moves_function gk_side_step;

/* AVX2 in the processor, and its registers kept by the system over a task switch */
static int has_avx2(void)
{
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & (1u << 27))) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & (1u << 5));
}

/* the step of an integrator in the widest vectors of this processor; widest = 0: the baseline */
gk_step_function *gk_wide_step(int widest, gk_integrator integrator)
{
    const int wide = widest > 0 && has_avx2();
    switch (integrator) {
    case RK45: return wide ? gk_rk45_step_avx2 : gk_rk45_step;
    case CENTRAL: return wide ? gk_central_step_avx2 : gk_central_step;
    default: return wide ? gk_step_once_avx2 : gk_step_once;
    }
}

gk_tally_function *gk_wide_count(int widest) { return widest > 0 && has_avx2() ? gk_tally_count_avx2 : gk_tally_count; }
gk_fill_function *gk_wide_fill(int widest) { return widest > 0 && has_avx2() ? gk_side_fill_avx2 : gk_side_fill; }
gk_moves_function *gk_wide_moves(int widest) { return widest > 0 && has_avx2() ? gk_side_step_avx2 : gk_side_step; }
#else
#include "run/gk_run.h"
gk_tally_function *gk_wide_count(int widest)
{
    (void)widest;
    return gk_tally_count;
}
gk_fill_function *gk_wide_fill(int widest)
{
    (void)widest;
    return gk_side_fill;
}
gk_moves_function *gk_wide_moves(int widest)
{
    (void)widest;
    return gk_side_step;
}
gk_step_function *gk_wide_step(int widest, gk_integrator integrator)
{
    (void)widest;
    return integrator == RK45 ? gk_rk45_step : integrator == CENTRAL ? gk_central_step : gk_step_once;
}
#endif
