"""A planetary set at rest: turns, transmission error, how planets share the load, forces on pins and bearings."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from driven import begun

from gearfmu import cli
from gearfmu.api.models import with_port_kinds
from gearfmu.body import load_bodies
from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import TeResult, loaded_te
from gearfmu.stagefile.stage import load_stage

TORQUE = 600.0  # N·m on the carrier, driving
R_SUN = 1.25e-3 * 18 * math.cos(math.radians(20))  # base radius of sun and planets, m
MEAN = TORQUE / 4 / (4 * R_SUN)  # mean mesh force, N
POSITIONS = 8


@pytest.fixture(scope="module")
def ideal(planetary: StageModel) -> TeResult:
    return loaded_te(planetary, [TORQUE], POSITIONS)


@pytest.fixture(scope="module")
def at_rest(planetary: StageModel) -> Kernel:
    """In static equilibrium under torques on carrier and sun."""
    return begun(planetary.kernel(level=0.0), {"carrier.tau": TORQUE, "sun.tau": -TORQUE / 4})


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
        loads = {f"{first}.tau": torque, f"{second}.tau": -torque * ratio}
        if torque < 0:
            with pytest.raises(SimulationError, match="no static equilibrium"):
                begun(kernel, loads)
            continue
        begun(kernel, loads)
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


@pytest.mark.parametrize("mesh", ["sun_planet2", "ring_planet3"])
def test_torque_on_the_input_over_mesh_force(planetary: StageModel, mesh: str) -> None:
    """Power through the sun, four planets sharing it: T = 4 F r_b · 4; the largest is what K_gamma leaves of
    torque_max, and the tangent stiffness of each mesh is positive."""
    place = place_of(planetary, mesh)
    assert abs(place.lever) == pytest.approx(16 * R_SUN, rel=1e-12)
    assert place.most == pytest.approx(planetary.stage.written.torque_max * planetary.stage.written.set.load_sharing)
    assert loaded_te(planetary, [TORQUE], 2, mesh=mesh).stage_stiffness.min() > 0


def test_mean_mesh_force_holds_the_torque_and_shares_average_to_one(ideal: TeResult) -> None:
    """T_s/(N r_b); 1e-3: the slope of the tip relief in the arm of the torque; 2e-3 where a tip edge carries, off the
    line of action."""
    assert np.allclose(ideal.force, MEAN, rtol=2e-3)
    assert np.allclose(ideal.force.mean(axis=1), MEAN, rtol=6e-4)
    assert np.allclose(ideal.sharing.sum(axis=3), 4, rtol=1e-12)
    assert np.abs(ideal.sharing.mean(axis=1) - 1).max() < 1e-3
    assert np.all(ideal.load_factor > 1.005) and np.all(ideal.load_factor < 1.02)


def test_a_pin_carries_what_the_meshes_press_on_its_planet(at_rest: Kernel) -> None:
    """Across the axis both mesh forces push a planet along its tangent: 2 F cos α and nothing along its radius, but for
    their difference."""
    along, across = math.cos(math.radians(20)), math.sin(math.radians(20))
    for k in range(4):
        at_sun, at_ring = (abs(at_rest.get(f"{gear}_planet{k + 1}.force")) for gear in ("sun", "ring"))
        pin = complex(*(at_rest.get(f"pin.planet{k + 1}.f{axis}") for axis in "xy")) * (-1j) ** k
        assert abs(pin.imag) == pytest.approx((at_sun + at_ring) * along, rel=2e-3)
        assert abs(pin.real) == pytest.approx(abs(at_sun - at_ring) * across, abs=2e-3 * at_sun)


def test_the_verb_refuses_held_bearings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["te", "planetary54", "--torque", "600 N*m", "--rigid-bearings", "--out", str(tmp_path / "te.csv")]
    assert cli.outcome(arguments) != 0
    assert "load of a planetary set is shared by the compliance of its bearings" in " ".join(
        capsys.readouterr().err.replace("│", " ").split()
    )


@pytest.mark.full
def test_unloaded_error_is_the_backlash_of_both_meshes(planetary: StageModel) -> None:
    """Its zero lies in the middle: ± j cos α, to what of the mesh is relieved everywhere (0.12 µm); loaded, it grows
    with the torque."""
    result, form = loaded_te(planetary, [0.0, 60.0, TORQUE], 2), planetary.stage.written.set
    assert np.allclose(result.te[0], -form.backlash * math.cos(form.pressure_angle), atol=0.15e-6)
    assert np.all(np.diff(result.te, axis=0) < -5e-6) and np.all(result.stage_stiffness > 0)
    other = loaded_te(planetary, [-TORQUE], 2)
    assert np.allclose(other.te, -result.te[2], atol=2e-6)  # flanks of the other side, another phase of the mesh
