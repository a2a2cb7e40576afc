"""The effects that a scene may call for: one table. docs/effects.md, `gearfmu effects` and the tests are made from it.

What an effect costs is measured (evidence/price/effects_cost.py) and lies beside this file in effects_cost.csv.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.place import place_of
from gearfmu.stage.run.te import statics_of

COSTS = "effects_cost.csv"


@dataclass(frozen=True)
class Effect:
    """One effect. title: in words; formula and equation: what it computes, and where docs/theory.md derives it.

    matters: when a scene needs it; off: what the model is without it; code: where it enters the kernel; switch: how to
    turn it off; off_setting: the kernel's parameters that do so, empty where the data of the stage decide; test: the
    test by hand calculation; carried: a planetary set has it, a spur pair does not; of_data: its parameter is there
    where the stage file gives it something to do; kept: why a plan (gearfmu/planning) never leaves it out, "" where the
    error budget decides. -DGK_WITHOUT=<name> builds a kernel that has no code for it.
    """

    name: str
    title: str
    formula: str
    equation: str
    matters: str
    off: str
    code: str
    switch: str
    test: str
    off_setting: Mapping[str, float]
    carried: bool = False
    of_data: bool = False
    kept: str = ""


@dataclass(frozen=True)
class Cost:
    """Instructions of an internal step: effect on, off, and in a build without its code (nan: no such build)."""

    effect: str
    on: float
    off: float
    without: float

    @property
    def share(self) -> float:
        """What the effect costs, as part of the step with it."""
        return 1.0 - self.off / self.on

    @property
    def price_of_off(self) -> float:
        """What a step pays for the effect being there and off: off / without − 1."""
        return self.off / self.without - 1.0


DISSIPATION = "it dissipates: no short window shows slow growth without it"


def _switched(name: str, **others: Any) -> Effect:
    """An effect with a boolean parameter of its own, effect.<name>."""
    variable = f"effect.{name}"
    return Effect(
        name=name,
        switch=f"variable `{variable}`; in a scene `[stage.effects] {name} = false`; `--set {variable}=false`",
        off_setting={variable: 0.0},
        **{"test": f"tests/stage/test_effects.py::test_{name}"} | others,
    )


EFFECTS: tuple[Effect, ...] = (
    _switched(
        "elastic",
        title="elastic bodies",
        formula="m ẍ = F, J φ̈ = M and q̈ + 2ζω q̇ + ω² q = Σ Nλ; C_static",
        equation="1 (eqs. 1, 2)",
        matters="always, except for estimates of rigid-body motion: rigid gears on held axes deflect by a tenth",
        off="rigid gears; contacts have their local law alone, bearings and ports as before",
        code="gk_choose.c (gk_choose): no modes, no tables of compliance",
        kept="a stage consists of its bodies",
    ),
    Effect(
        name="modes",
        title="number of dynamic modes",
        formula="modes below the cut are states, those above are compliance; cut in the widest gap within 15 %",
        equation="1 (eq. 2)",
        matters="where body resonances lie in the band, or mesh harmonics reach the tooth modes (40–60 kHz on fzg_c)",
        off="level `rigid`: bodies follow their loads statically",
        code=(
            "gk_choose.c (gk_choose_modes), gk_setup.c (fill_modal), gk_rows.c, gk_flow.c, gk_advance.c (predict_gear, "
            "correct_damped)"
        ),
        switch="parameter `level`; cut frequencies `[levels]` in stage.toml; number stored `gears.X.body.modes`",
        off_setting={"level": 0.0},
        test="tests/stage/test_effects.py::test_modes",
    ),
    Effect(
        name="residual",
        title="residual",
        formula="C_res = C_static − Σ N Nᵀ/ω² over the dynamic modes",
        equation="1 (eq. 2)",
        matters="always: a fifth of the compliance of fzg_c beside 400 modes a gear",
        off="truncated modes, as in the paper",
        code="gk_residual.c (gk_residual_store), gk_compliance.c (between_contacts, joint_residual)",
        switch="level `paper` alone",
        off_setting={"level": 4.0, "integrator": 1.0},
        test="tests/stage/test_effects.py::test_residual",
        kept="it is a static part of the stiffness",
    ),
    _switched(
        "hertz",
        title="load-dependent local compliance",
        formula="δ(λ) = λ(c − ½ a ln βλ)",
        equation="2.4 (eqs. 7, 8)",
        matters="light load, rattle, engagement: fzg_c yields 8 % more at 80 than at 600 N·m, 17 % more at 8",
        off="its secant at `torque_max`: a linear law",
        code="gk_law.c; the balance of closed steps in gk_balance.c",
    ),
    Effect(
        name="slices",
        title="slices across the face width",
        formula="tₐ = (2a + 1) × mean of P_a over the slice; one force a slice (mirrored slices: one row)",
        equation="1 (load patch and slices)",
        matters="load over the width (ends of fzg_c: 5 % less than the mean); transmission error by 0.02 %",
        off="1 slice: load uniform over the width",
        code="gk_strips.c, gk_row_contact.c (gk_row_contact_list)",
        switch="parameter `slices` (1 … 20); `[contact] slices` in stage.toml, `[stage] slices` in a scene",
        off_setting={"slices": 1.0},
        test="tests/stage/test_effects.py::test_slices",
    ),
    _switched(
        "coast_flank",
        title="coast flank",
        formula="g of sg = −1, with the allowance (j_wt − j_wt,nominal) cos α_wt; of sg = +1 in meshes that a torque "
        "in +z on the first port drives by sg = −1",
        equation="2.1 (eq. 4)",
        matters="rattle, reversal, engagement, every start; not where drive flanks stay closed",
        off="teeth pass through the backlash",
        code="gk_flank.c (gk_flank_find), gk_kinematics.c (gk_kinematics_carrying)",
    ),
    _switched(
        "contact_damping",
        title="contact damping",
        formula="F = max(0, F_c + min(F_c, F_d)), F_d = c b × rate of the deflection of the contact's own path",
        equation="2.5, 3.4",
        matters="level of the mesh resonance and its side bands",
        off="modal damping, bearings and ports alone damp the mesh",
        code="gk_compliance.c (take_paths), gk_solve.c (limit_dashpots), gk_tangent.c",
        kept=DISSIPATION,
    ),
    _switched(
        "tip_relief",
        title="tip relief",
        formula="g → g + δ_A(s_A) + δ_B(s_B), δ(s) = c (s − s₀)²₊, slope in the gradient",
        equation="2.2 (eq. 5)",
        matters="wherever the stage has it: it is as large as the transmission error",
        off="unmodified involutes",
        code="gk_section.c (relief)",
        kept="it is the shape of the teeth",
    ),
    _switched(
        "tip_contact",
        title="tip corners",
        formula="g = ℓ − s′ − ρ + δ_c + δ_c′ u/(1 + u/ρ) + δ_o: tip edge of radius ρ on the other involute",
        equation="2.3 (eq. 6)",
        matters="whenever a loaded pair reaches the end of a flank: without relief always",
        off=(
            "flanks end at their tip roll. Exact while no loaded pair gets there (fzg_c_relief: up to about 100 N·m); "
            "else energy is lost and status bit 16 is set"
        ),
        code="gk_section.c (corner_contact)",
    ),
    _switched(
        "bearings",
        title="bearings",
        formula="λ/k at the bore node in x and y, c = 2D √(k m)",
        equation="3.9",
        matters="bearing forces and the mesh mode: more than half of the static compliance of fzg_c",
        off="bores held on their axes; bearing forces are reactions",
        code="gk_setup.c (fill_base), gk_advance.c (damp_supports)",
        kept="without it bearing forces are reactions, another output",
    ),
    _switched(
        "housing",
        title="elastic housing",
        formula="one more free body of the ground group: bearings between shafts and seats, feet on the ground",
        equation="1 (eq. 2d)",
        matters="forces at bearings and mounts below some kHz: on rigid ground sensors err by 12 dB",
        off="bearings rest on rigid ground: the stage without its housing, bit for bit; sensors and mounts are 0",
        code="gk_choose.c (gk_choose): another set of ground oscillators; gk_sensors.c",
        kept="without it sensors and mounts have no signal",
        test="tests/stage/test_housing.py::test_without_its_housing_it_is_the_stage_on_the_ground_bit_for_bit",
        of_data=True,
    ),
    _switched(
        "modal_damping",
        title="modal damping",
        formula="2ζω q̇",
        equation="1 (eq. 1)",
        matters="always; a switch for conservation tests",
        off="ζ = 0 for every elastic mode",
        code="gk_flow.c (oscillator_of)",
        kept=DISSIPATION,
    ),
    _switched(
        "roll_motion",
        title="motion of the contact along the flanks",
        formula="places, rows, stiffness, normals and curvatures at the rolls of the moment",
        equation="3.3",
        matters="always; a switch for conservation tests: a moving mesh does work",
        off="places and rows of the start, linear gaps",
        code="gk_engage.c",
        kept="a switch for conservation tests",
    ),
    Effect(
        name="pitch_errors",
        title="pitch errors",
        formula="β → β + F_p/r, s → s + sg r_b F_p/r, g → g − sg F_p cos α of that tooth",
        equation="2.1 (eq. 4a)",
        matters="shaft orders and side bands; single teeth that come into mesh early or late",
        off="all teeth in their places",
        code="gk_flank.c (misplace)",
        switch="data of the stage: `gears.X.index_deviation` in stage.toml",
        off_setting={},
        test="tests/stage/test_pitch_errors.py::test_a_protruding_tooth_holds_the_pinion_back_while_it_is_in_mesh",
    ),
    _switched(
        "flank_deviations",
        title="flank modifications and deviations",
        formula="g → g + d_A(tooth, z, s_A) + d_B(tooth, z, s_B): cubics through tables, slope in the gradient",
        equation="2.2 (eqs. 5a to 5f)",
        matters="corrected or measured flanks: micrometres are as large as the transmission error",
        off="involutes with parabolic tip relief; leads too are left out",
        code="gk_deviation.c (gk_deviation_at), gk_section.c (gk_section_depth), gk_strips.c (fill_deviations)",
        test="tests/stage/test_flanks.py::test_unloaded_te_is_the_gap_of_the_modified_profile",
        of_data=True,
    ),
    _switched(
        "runout",
        title="eccentricity and wobble",
        formula="axis of the toothing at C + e (cos, sin)(φ + ψ), tilted by θ about (−sin, cos)(φ + χ)",
        equation="2.1 (eqs. 4c, 4d)",
        matters="shaft orders, side bands of the mesh; wobble moves the load across the face width",
        off="teeth run true",
        code="gk_deviation.c (gk_runout_move, gk_runout_turn)",
        test="tests/stage/test_flanks.py::test_an_eccentric_gear_moves_te_by_its_eccentricity_once_a_turn",
        of_data=True,
    ),
    _switched(
        "coriolis",
        title="Coriolis forces in a carrier's axes",
        formula="v̇ = −2Ω Pᵀ J P v on the rigid masses that a carrier carries, and its own",
        equation="3.10 (eq. 17f)",
        matters="fast sets: 0.3 % of the mesh forces' ripple at 85 rad/s of the carrier, 3.2 % at 300",
        off="masses move as in fixed axes",
        code="gk_frame.c (gk_frame_turn)",
        test="tests/stage/test_planetary_theory.py::test_a_sun_in_free_flight_moves_straight_on",
        carried=True,
    ),
    _switched(
        "centrifugal",
        title="centrifugal load on planets",
        formula="F = Ω² Σ m a on the places of the planets",
        equation="3.10 (eq. 17g)",
        matters="pin forces and meshes: 60 N a planet at 85 rad/s (2.6 % of the ripple), 750 N at 300 (26 %)",
        off="pins carry mesh forces alone",
        code="gk_frame.c (gk_frame_press, gk_frame_load)",
        test="tests/stage/test_planetary_motion.py::test_pins_hold_the_planets_against_their_centrifugal_load",
        carried=True,
    ),
    _switched(
        "gyroscopic",
        title="gyroscopic and Coriolis forces on tilting and elastic bodies",
        formula="v̇ = −2 (Ω H + Ω_f Q) v; of tilts H = −½ J_p J: moment J_p Ω θ̇",
        equation="3.11 (eqs. 17j to 17l)",
        matters=(
            "fast bodies that tilt or bend: at speed_max frequencies below 15 kHz move by 2 % (helical_demo), 5 % "
            "(two_stage), 4 % (planetary54), 0.4 % (fzg_c)"
        ),
        off="bodies tilt and vibrate as at rest",
        code="gk_frame.c (gk_frame_turn, gk_frame_predict)",
        test="tests/kernel/test_gyroscopic.py::test_a_kicked_pair_whirls_as_its_linear_system",
    ),
    _switched(
        "friction",
        title="friction of the flanks",
        formula="p = −µ λ sgn v along the profile, fading below 2 % of the largest sliding speed; sticks at standstill",
        equation="2.8, 3.12 (eqs. 8k to 8n, 17m to 17o)",
        matters=(
            "forces across the line of action (a jump by 2 µ F at the pitch point), losses, damping of rattle. Off "
            "unless the stage says `[contact] friction = {…}`"
        ),
        off="flanks slide without resistance",
        code="gk_friction.c, gk_glide.c, gk_lubrication.c, gk_flank.c (glide), gk_residual.c (gk_residual_store_along)",
        test="tests/stage/test_friction.py::test_force_across_the_line_of_action_jumps_at_the_pitch_point",
        kept=DISSIPATION,
    ),
    _switched(
        "film",
        title="squeeze film in open gaps",
        formula="f = −c(d) ḋ while flanks approach, c = 3√2 π η b R^(3/2) [(d + r)^(−3/2) − (H + r)^(−3/2)], "
        "H = 100 µm",
        equation="2.9, 3.13 (eqs. 8q to 8s, 17q to 17s)",
        matters=(
            "light-load rattle, reversal, engagement: it takes momentum from an approach; nothing where flanks stay "
            "closed. Off unless the stage says `[contact] film = {…}`"
        ),
        off="dry flanks meet with the speed they have",
        code="gk_film.c, gk_solve.c (dashpots_and_sums), gk_tangent.c, gk_balance.c",
        test="tests/stage/test_film.py::test_a_falling_body_sinks_as_the_exact_solution",
        kept=DISSIPATION,
    ),
)


def costs() -> dict[str, Cost]:
    """Measured costs by name of the effect."""
    text = files("gearfmu.stage").joinpath(COSTS).read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {r["effect"]: Cost(r["effect"], float(r["on"]), float(r["off"]), float(r["without"])) for r in rows}


def torque_on_flanks_alone(model: StageModel, mesh: str | None = None, positions: int = 24) -> float:
    """Largest input torque (N·m, at most what brings the engagement to its torque_max) at which the flanks of an
    engagement, the first when None, carry alone at these positions of its pitch, statically: up to it tip corners may
    be off. To 1 %."""
    place = place_of(model, mesh)
    kernels = [statics_of(model, **{"effect.tip_contact": on}) for on in (1.0, 0.0)]

    def alone(torque: float) -> bool:
        for i in range(positions):
            at = -place.pitch * i / positions
            on, off = (abs(kernel.transmission(at, torque, place.number).te) for kernel in kernels)
            if off - on > 1e-6 * on:
                return False
        return True

    low, high = 0.0, place.most
    if alone(high):
        return high
    while high - low > 0.01 * high and high > 1e-3 * place.most:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if alone(middle) else (low, middle)
    return low
