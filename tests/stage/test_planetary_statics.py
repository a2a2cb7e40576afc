"""A planetary set at rest: turns, transmission error, how planets share the load, forces on pins and bearings."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu import cli
from gearfmu.api.models import with_port_kinds
from gearfmu.body import load_bodies
from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import SPIN
from gearfmu.modes.linear import linearised
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.place import place_of
from gearfmu.stage.run.te import TeResult, loaded_te, statics_of
from gearfmu.stagefile.forms.expand import rewritten, with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import turns
from gearfmu.stagefile.stage import load_stage

TORQUE = 600.0  # N·m on the carrier, driving
R_SUN = 1.25e-3 * 18 * math.cos(math.radians(20))  # base radius of sun and planets, m
MEAN = TORQUE / 4 / (4 * R_SUN)  # mean mesh force, N
POSITIONS = 8
PLANETS = [f"planet{k + 1}" for k in range(4)]


def with_pins(spec: Stage, **errors: tuple[float, float]) -> Stage:
    """pin1=(radial, tangential) in m."""
    pins = {int(name[3:]): error for name, error in errors.items()}
    return rewritten(spec, set=spec.written.set.model_copy(update={"pin_errors": pins}))


@pytest.fixture(scope="module")
def spec() -> Stage:
    found = load_stage("planetary54")
    return found


@pytest.fixture(scope="module")
def parts(spec: Stage) -> list[Any]:
    return load_bodies(spec)


@pytest.fixture(scope="module")
def model(spec: Stage, parts: list[Any]) -> StageModel:
    return assemble(spec, parts)


@pytest.fixture(scope="module")
def ideal(model: StageModel) -> TeResult:
    return loaded_te(model, [TORQUE], POSITIONS)


@pytest.fixture(scope="module")
def at_rest(model: StageModel) -> Kernel:
    """In static equilibrium under torques on carrier and sun."""
    kernel = model.kernel(**{"level": 0.0})
    kernel.set("carrier.tau", TORQUE)
    kernel.set("sun.tau", -TORQUE / 4)
    kernel.initialize()
    return kernel


@pytest.mark.parametrize("name", ["planetary54", pytest.param("two_stage", marks=pytest.mark.full)])
def test_without_coast_flanks_the_set_is_driven_through_those_that_carry(name: str) -> None:
    """A planet presses the ring with one flank and is pressed by the sun on the other, a train's intermediate shaft
    turns the other way: which flanks are left out is decided mesh by mesh. Against that load teeth pass through."""
    stage = load_stage(name)
    first, second = list(stage.ports)[:2]
    driven = assemble(with_port_kinds(stage, {first: "torque", second: "torque"}), load_bodies(stage))
    ratio = driven.shafts.ratio
    found = []
    for torque, coast in ((TORQUE / 10, 1.0), (TORQUE / 10, 0.0), (-TORQUE / 10, 0.0)):
        kernel = driven.kernel(**{"level": 0.0, "effect.coast_flank": coast})
        kernel.set(f"{first}.tau", torque)
        kernel.set(f"{second}.tau", -torque * ratio)
        if torque < 0:
            with pytest.raises(SimulationError, match="no static equilibrium"):
                kernel.initialize()
            continue
        kernel.initialize()
        found.append([kernel.get(f"{mesh.name}.force") for mesh in driven.stage.engagements])
    assert min(found[0]) < -50 and max(found[0]) > 50
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_the_how_to_has_what_te_says(ideal: TeResult, at_rest: Kernel) -> None:
    """docs/howto-planetary.md: transmission error of a mesh at rest at level rigid to 0.01 µm, K_gamma of ideal pins
    to its digits."""
    page = (Path(__file__).parents[2] / "docs" / "howto-planetary.md").read_text(encoding="utf-8")
    said = re.search(r"`sun_planet1.te` of `planetary54` is −([\d.]+) µm at `rigid`", page)
    factors = re.search(r"\| ideal pins \| ([\d.]+) / ([\d.]+) \|", page)
    assert said is not None and factors is not None
    assert 1e6 * at_rest.get("sun_planet1.te") == pytest.approx(-float(said[1]), abs=0.01)
    assert ideal.load_factor[0] == pytest.approx([float(number) for number in factors.groups()], abs=1e-3)


def force(kernel: Kernel, name: str) -> np.ndarray:
    return np.array([kernel.get(f"{name}.f{direction}") for direction in "xyz"])


def test_turns_are_those_of_willis(model: StageModel) -> None:
    turning = turns(model.stage, "carrier")
    assert {name: float(turn) for name, turn in turning.items()} == {
        "carrier": 1, "sun": 4, "ring": 0, **dict.fromkeys(PLANETS, -2)
    }  # fmt: skip
    assert model.shafts.ratio == pytest.approx(0.25)


@pytest.mark.parametrize("mesh", ["sun_planet2", "ring_planet3"])
def test_torque_on_the_input_over_mesh_force(model: StageModel, mesh: str) -> None:
    """Power through the sun, four planets sharing it: T = 4 F r_b · 4; the largest is what K_gamma leaves of
    torque_max, and the tangent stiffness of each mesh is positive."""
    place = place_of(model, mesh)
    assert abs(place.lever) == pytest.approx(16 * R_SUN, rel=1e-12)
    assert place.most == pytest.approx(model.stage.written.torque_max * model.stage.written.set.load_sharing)
    assert loaded_te(model, [TORQUE], 2, mesh=mesh).stage_stiffness.min() > 0


def test_mean_mesh_force_holds_the_torque(ideal: TeResult) -> None:
    """T_s/(N r_b); 1e-3: the slope of the tip relief in the arm of the torque; 2e-3 where a tip edge carries, off the
    line of action."""
    assert np.allclose(ideal.force, MEAN, rtol=2e-3)
    assert np.allclose(ideal.force.mean(axis=1), MEAN, rtol=6e-4)


def test_planets_opposite_each_other_carry_alike(ideal: TeResult) -> None:
    """The set is the same after half a turn, after a quarter half a mesh period later; 1e-3: mean tooth of the ring."""
    sharing = ideal.sharing[0]
    assert np.abs(sharing[:, :, :2] - sharing[:, :, 2:]).max() < 2e-4
    assert np.ptp(sharing[:, :, 0]) > 0.01
    later = np.roll(sharing[:, :, 0], POSITIONS // 2, axis=0)
    assert np.abs(sharing[:, :, 1] - later).max() < 3e-4


def test_shares_of_a_mesh_period_average_to_one(ideal: TeResult) -> None:
    assert np.allclose(ideal.sharing.sum(axis=3), 4, rtol=1e-12)
    assert np.abs(ideal.sharing.mean(axis=1) - 1).max() < 1e-3
    assert np.all(ideal.load_factor > 1.005) and np.all(ideal.load_factor < 1.02)


def test_the_next_mesh_period_is_the_same(model: StageModel, ideal: TeResult) -> None:
    kernel, pitch = statics_of(model), abs(place_of(model, "sun_planet1").pitch)
    for periods in (1, 8, -9):  # 9: sixty degrees of the carrier
        at = (periods + 3 / POSITIONS) * pitch
        error = R_SUN * (at - 4 * kernel.transmission(at, TORQUE).phi)
        assert error == pytest.approx(ideal.te[0, 3], abs=1e-11)


def test_progress_is_the_part_done_and_the_torque(model: StageModel) -> None:
    told: list[tuple[float, str]] = []
    loaded_te(model, [60.0, TORQUE], 1, progress=lambda part, text: told.append((part, text)))
    assert told == [(0.0, "60 N·m"), (0.5, f"{TORQUE:g} N·m")]


@pytest.mark.full
def test_unloaded_error_is_the_backlash_of_both_meshes(model: StageModel, spec: Stage) -> None:
    """Its zero lies in the middle: ± j cos α, to what of the mesh is relieved everywhere (0.12 µm); loaded, it grows
    with the torque."""
    result = loaded_te(model, [0.0, 60.0, TORQUE], 2)
    assert np.allclose(
        result.te[0], -spec.written.set.backlash * math.cos(spec.written.set.pressure_angle), atol=0.15e-6
    )
    assert np.all(np.diff(result.te, axis=0) < -5e-6) and np.all(result.stage_stiffness > 0)
    other = loaded_te(model, [-TORQUE], 2)
    assert np.allclose(other.te, -result.te[2], atol=2e-6)  # flanks of the other side, another phase of the mesh


@pytest.mark.full
def test_a_pin_that_stands_forward_carries_more(
    model: StageModel, spec: Stage, parts: list[Any], ideal: TeResult
) -> None:
    """The driving carrier presses with the planet whose pin stands ahead of its place; the sum stays, and twice the
    error shifts the load twice as far."""
    once, twice = (loaded_te(assemble(with_pins(spec, pin0=(0.0, e)), parts), [TORQUE], 4) for e in (6e-6, 12e-6))
    shift = [result.sharing.mean(axis=1)[0] - 1 for result in (once, twice)]
    assert np.all(shift[1][:, 0] > 0.06) and np.all(shift[1][:, [1, 3]] < -0.02)
    assert np.allclose(shift[1], 2 * shift[0], atol=2e-3)
    assert np.allclose(twice.force, MEAN, rtol=1e-3)
    assert np.all(twice.load_factor > 1.06)
    behind = loaded_te(assemble(with_pins(spec, pin2=(0.0, -12e-6)), parts), [TORQUE], 4)
    assert np.allclose(behind.sharing.mean(axis=1)[0, :, 2] - 1, -shift[1][:, 0], atol=5e-3)


def test_torques_on_the_set_balance(spec: Stage, parts: list[Any]) -> None:
    """On the carrier, what holds the sun, and from the ring's mounts; the ratio is that of the teeth but for the slope
    of the tip relief."""
    held = spec.ports["sun"].model_copy(update={"kind": "fixed"})
    kernel = assemble(with_ports(spec, {"sun": held}), parts).kernel(**{"level": 0.0})
    kernel.set("carrier.tau", TORQUE)
    kernel.initialize()
    sun, mounts = kernel.get("sun.tau"), kernel.get("bearing.ring.mz")
    assert sun + mounts == pytest.approx(TORQUE, rel=1e-7)  # modes are kept in single precision
    assert sun == pytest.approx(TORQUE / 4, rel=1e-3)


def test_a_pin_carries_what_the_meshes_press_on_its_planet(at_rest: Kernel) -> None:
    """Across the axis both mesh forces push a planet along its tangent: 2 F cos α and nothing along its radius, but for
    their difference."""
    for k, planet in enumerate(PLANETS):
        angle = math.pi / 2 * k
        radial, tangential = (
            np.array([math.cos(angle), math.sin(angle), 0]),
            np.array([-math.sin(angle), math.cos(angle), 0]),
        )
        at_sun, at_ring = (abs(at_rest.get(f"{gear}_{planet}.force")) for gear in ("sun", "ring"))
        pin = force(at_rest, f"pin.{planet}")
        c, s = math.cos(math.radians(20)), math.sin(math.radians(20))
        assert abs(pin @ tangential) == pytest.approx((at_sun + at_ring) * c, rel=2e-3)
        assert abs(pin @ radial) == pytest.approx(abs(at_sun - at_ring) * s, abs=2e-3 * at_sun)


def test_forces_of_symmetric_planets_cancel_in_the_bearings(at_rest: Kernel) -> None:
    for name in ("sun", "ring", "carrier"):
        assert np.linalg.norm(force(at_rest, f"bearing.{name}")[:2]) < 1e-3 * MEAN, name


@pytest.mark.parametrize("relief", [0.0, 1.0])
def test_one_natural_motion_is_rigid_rotation(model: StageModel, relief: float) -> None:
    """The standing ring has no spin among the coordinates; all together turn freely, but that a frozen mesh rolls along
    the tip relief. Next come motions of some kHz."""
    kernel = model.kernel(**{"level": 0.0, "effect.tip_relief": relief, "effect.tip_contact": relief})
    kernel.prepare()
    system = linearised(model, TORQUE, 0.3, kernel)
    linear = system.linear
    assert (linear.group == SPIN).sum() == 6 and np.all(np.isfinite(linear.mass))
    scale = 1 / np.sqrt(linear.mass)
    squared, shapes = np.linalg.eigh(scale[:, None] * system.stiffness * scale)
    assert np.sqrt(np.abs(squared[0])) / 2 / np.pi < (20 if relief else 1e-2)
    assert np.all(squared[1:] > (2 * np.pi * 1000) ** 2)
    turned = (scale * shapes[:, 0])[linear.group == SPIN]  # in the order of the rotors, the ring left out
    assert np.allclose(turned / turned[-1], [4, -2, -2, -2, -2, 1], rtol=5e-3)


def between_rings_teeth(model: StageModel, level: float) -> float:
    """Static compliance, m/N, between the teeth of the ring that two neighbouring planets press: what their residual
    and all dynamic oscillators yield."""
    kernel = model.kernel(level=level)
    kernel.prepare()
    try:
        kernel.transmission(0.0, TORQUE)
    except SimulationError:
        pass  # the rows are those of the last iteration
    linear = kernel.linearise()
    moving = linear.omega > 0
    rows = linear.rows[:, moving] / linear.omega[moving]
    first, second = (linear.label[:, 0] == 4 + k for k in range(2))  # ring_planet1, ring_planet2
    return float((linear.residual + rows @ rows.T)[np.ix_(first, second)].mean())


@pytest.mark.full
def test_level_does_not_change_how_the_ring_yields_between_planets(model: StageModel) -> None:
    """Ovalisation of the ring, −20 nm/N between neighbours, is in its modes at level fast; at level rigid too:
    the transmission error is 39 µm too large without it."""
    assert between_rings_teeth(model, 0.0) == pytest.approx(between_rings_teeth(model, 1.0), rel=0.05, abs=1e-9)


@pytest.mark.full
def test_statics_find_their_equilibrium_at_level_fast(model: StageModel) -> None:
    statics_of(model, level=1.0).transmission(0.0, TORQUE)


@pytest.mark.full
def test_the_verb_writes_a_tidy_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "te.csv"
    arguments = ["te", "planetary54", "--torque", "600 N*m", "--positions", "4", "--out", str(out)]
    assert cli.outcome(arguments) == 0
    said = capsys.readouterr().out
    assert "sun: K_gamma 1.0" in said and "ring: K_gamma 1.0" in said
    with open(out, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 and out.with_suffix(".png").exists()
    for row in rows:
        for gear in ("sun", "ring"):
            assert sum(float(row[f"{gear}_share_{k + 1}"]) for k in range(4)) == pytest.approx(4)
            assert float(row[f"{gear}_force_N"]) == pytest.approx(MEAN, rel=1e-3)


def test_the_verb_refuses_held_bearings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["te", "planetary54", "--torque", "600 N*m", "--rigid-bearings", "--out", str(tmp_path / "te.csv")]
    assert cli.outcome(arguments) != 0
    assert "load of a planetary set is shared by the compliance of its bearings" in " ".join(
        capsys.readouterr().err.replace("│", " ").split()
    )
