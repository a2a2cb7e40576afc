"""The planetary set in motion: what the turning axes of the carrier do to the masses in them (docs/theory.md, 3.10). At
rest: turns, transmission error, how planets share the load, forces on pins and bearings. Engagements of one gear feel
each other through what is static in it. As a differential the third shaft follows by Willis' equation."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from driven import begun, stepped

import gearfmu as gf
from gearfmu import cli
from gearfmu.api.models import with_port_kinds
from gearfmu.body import load_bodies
from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import SPIN, LinearModel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import TeResult, loaded_te
from gearfmu.stagefile.stage import load_stage
from tests.relations.kinds import KINDS, assembled, bodies_of

H, STEP = 5e-6, 2e-5


def turning(model: StageModel, torque: float, carrier: float, **parameters: float) -> Kernel:
    """At rest under `torque` (N·m) on the carrier, the sun's in balance, then at these speeds (rad/s) of rolling."""
    kernel = model.kernel(**{"level": 0.0, "h": H, **parameters})
    loads = {"carrier.tau": torque, "sun.tau": -torque / 4}
    return begun(kernel, loads | {"carrier.w_start": carrier, "sun.w_start": 4 * carrier})


def test_pins_hold_the_planets_against_their_centrifugal_load(planetary: StageModel) -> None:
    """m a Ω² outward, at once and exactly: the set is unloaded, no mesh touches."""
    planet, radius, speed = load_bodies(load_stage("planetary54"))[1], 0.045, 85.0
    load = planet.total_mass * radius * speed**2
    for on in (1.0, 0.0):
        kernel = turning(planetary, 0.0, speed, **{"effect.centrifugal": on})
        outward = [kernel.get("pin.planet1.fx"), kernel.get("pin.planet2.fy"), -kernel.get("pin.planet3.fx")]
        assert outward == pytest.approx([on * load] * 3, rel=1e-9, abs=1e-9)
        across = [kernel.get("pin.planet1.fy"), kernel.get("pin.planet2.fx")]
        assert across == pytest.approx([0.0, 0.0], abs=1e-6 * load)


def test_two_integrators_see_the_same_set(planetary: StageModel) -> None:
    """The step with its rotation in half steps, and the explicit peer with the same forces as accelerations, at one
    step: pairs of the ring end with their flanks, and when that is seen depends on the step (0.8 % from 0.5 to
    0.25 µs on either method). Coriolis forces are 7 % of a pin's ripple at 300 rad/s, the methods differ by 0.2 %."""
    names = ("sun_planet1.te", "pin.planet1.fx")
    methods = {}
    for name, settings in {
        "dg4": {"h": 5e-7},
        "central": {"h": 5e-7, "integrator": 3.0},
        "without": {"h": 5e-7, "effect.coriolis": 0.0},
    }.items():
        kernel = turning(planetary, 600.0, 300.0, **{"effect.contact_damping": 0.0, **settings})
        methods[name] = stepped(kernel, 20, STEP, *names)
    swing = methods["dg4"].std(axis=0)
    apart = {name: np.sqrt(((method - methods["dg4"]) ** 2).mean(axis=0)) / swing for name, method in methods.items()}
    assert np.all(apart["central"] < 3e-3) and np.all(apart["without"] > 5e-3)


def test_the_load_of_an_uneven_set_turns_with_the_carrier() -> None:
    """One pin out of its place: what the sun's bearing carries keeps its size and turns by the carrier's angle."""
    kernel = turning(gf.assemble("planetary54/stage_pin_error"), 600.0, 85.0, h=1e-5)
    found = stepped(kernel, 800, STEP, "bearing.sun.fx", "bearing.sun.fy", "carrier.gear.phi")
    own = (found[:, 0] + 1j * found[:, 1]) * np.exp(-1j * found[:, 2])
    early, late = own[100:300].mean(), own[600:].mean()
    assert found[-1, 2] > 1.2 and abs(early) > 20.0
    assert abs(late - early) < 0.05 * abs(early)


# ---- at rest ---------------------------------------------------------------------------------------------------------
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


# ---- engagements of one gear -----------------------------------------------------------------------------------------
# Compliance between them at every level beside that of level full, where all stored modes are dynamic; it stays
# positive; and without the far part it errs.
RIGID, FAST, STANDARD, FULL = 0.0, 1.0, 2.0, 3.0
LIMITS = {RIGID: 5e-4, FAST: 2e-4, STANDARD: 1e-4}  # of the own compliance


def linear(blob: bytes, level: float) -> LinearModel:
    """The set at rest under TORQUE at a level."""
    return begun(Kernel(blob, {"level": level}), {"carrier.tau": TORQUE, "sun.tau": -TORQUE / 4}).linearise()


def compliance(found: LinearModel) -> dict[tuple[tuple[int, ...], tuple[int, ...]], float]:
    """m/N between contacts by their labels: everything but spins and rigid motion."""
    elastic = (found.group != SPIN) & (found.omega > 0.0)
    rows = found.rows[:, elastic] / found.omega[elastic]
    total = found.residual + found.own + rows @ rows.T
    labels = [tuple(int(k) for k in label) for label in found.label]
    contacts = [i for i, label in enumerate(labels) if label[0] >= 0]
    return {(labels[i], labels[j]): total[i, j] for i in contacts for j in contacts}


def error(blob: bytes, level: float, exact: dict) -> float:
    """Largest error of compliance between engagements, over the own compliance of a contact."""
    found = compliance(linear(blob, level))
    pairs = [(a, b) for a, b in found if a[0] != b[0] and (a, b) in exact]
    own = np.mean([value for (a, b), value in exact.items() if a == b])
    assert len(pairs) > 500
    return max(abs(found[pair] - exact[pair]) for pair in pairs) / own


QUICK = ("planetary54", FAST)
CASES = [(name, level) for name in ("planetary54", "helical_set") for level in LIMITS]


@pytest.mark.parametrize(
    ("name", "level"), [pytest.param(*case, marks=[pytest.mark.full] * (case != QUICK)) for case in CASES]
)
def test_engagements_feel_each_other_as_at_level_full(name: str, level: float) -> None:
    blob = gf.assemble(name).blob
    exact = compliance(linear(blob, FULL))
    without = write_blob({name: part for name, part in read_blob(blob).items() if not name.startswith("far_")})
    found, bare = error(blob, level, exact), error(without, level, exact)
    assert found < LIMITS[level] < bare


# ---- as a differential -----------------------------------------------------------------------------------------------
# Sun, ring and carrier turn, each on a port of its own: the spins have two motions.
RATIO = 54 / 18  # teeth of the ring over teeth of the sun
WOUND = 100.0 / 20e3  # rad: what the sun's spring is wound up
PLAY = 0.06e-3 / 22.5e-3  # rad at the sun: half the backlash of either mesh over its reference radius
PLACES = [(0.0, 0.0), (0.3, -0.2), (5.0, 3.0)]  # rad: carrier, ring


def differential(ports: tuple[str, str, str]) -> StageModel:
    """The paper's set, its ring free to turn, with spring ports in this order."""
    kind = KINDS["set"]
    stage = kind.stage
    springs = {name: port.model_copy(update={"kind": "spring"}) for name, port in stage.ports.items()}
    springs["ring"] = springs["sun"].model_copy(update={"body": "ring"})
    free = stage.model_copy(
        update={
            "rotors": stage.rotors | {"ring": stage.rotors["ring"].model_copy(update={"stands": False})},
            "supports": tuple(
                s.model_copy(update={"torsion": None} if s.name == "ring" else {}) for s in stage.supports
            ),
            "ports": {name: springs[name] for name in ports},
        }
    )
    return assembled(free, bodies_of(kind.file))


def wound(model: StageModel, carrier: float, ring: float) -> tuple[float, float, float, float]:
    """Angle of the sun less that of Willis (rad); torques of sun, ring and carrier (N·m), the sun's spring wound up."""
    sun = (1 + RATIO) * carrier - RATIO * ring
    kernel = begun(model.kernel(level=1.0), {"carrier.phi": carrier, "ring.phi": ring, "sun.phi": sun + WOUND})
    turned = {name: kernel.get(f"{name}.gear.phi") for name in ("sun", "ring", "carrier")}
    astray = turned["sun"] - (1 + RATIO) * turned["carrier"] + RATIO * turned["ring"]
    return (astray, *(kernel.get(f"{name}.tau") for name in ("sun", "ring", "carrier")))


@pytest.mark.parametrize(
    "ports", [("ring", "carrier", "sun"), ("carrier", "ring", "sun"), ("sun", "ring", "carrier")], ids="-".join
)
def test_whichever_ports_decide_the_third_shaft_follows_by_willis(ports: tuple[str, str, str]) -> None:
    model = differential(ports)
    for place in PLACES:
        astray, sun, ring, carrier = wound(model, *place)
        assert astray == pytest.approx(PLAY, rel=0.1)  # the rest is the yield of teeth and shafts
        assert sun < -1.0
        assert ring == pytest.approx(RATIO * sun, rel=1e-2)
        assert carrier == pytest.approx(-(1 + RATIO) * sun, rel=1e-2)
