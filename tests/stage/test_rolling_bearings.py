"""Stages on rolling bearings: loads balance the meshes, load and stiffness agree, the linear model has them whole.
Bearing forces and port torques of a pair: T/r_b along the line of action, and no force left over on average."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from driven import begun

from gearfmu.bearing.rest import rest
from gearfmu.body import Body, load_bodies
from gearfmu.errors import ModelError
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.modes.linear import Linearised
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.assembly import rolling
from gearfmu.stage.assembly.assemble import settled
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.rolling import SETTLED, Settled
from gearfmu.stage.run.limits import beyond_limits
from gearfmu.stage.run.simulate import simulate
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import OperatingSpec, PortSpec

TRAIN, PAIR = "two_stage/stage_bearings", "helical_demo/stage_bearings"


@cache
def loaded(name: str) -> tuple[Any, list[Any]]:
    spec = load_stage(name)
    return spec, load_bodies(spec)


@cache
def found(name: str, torque: float | None = None) -> Settled:
    return settled(*loaded(name), torque)


@cache
def model(name: str) -> StageModel:
    return assemble(*loaded(name))


def mesh_force(stage: Any, number: int, torque: float) -> tuple[float, float]:
    """Across and along the axes, N, of an engagement whose gear A has that torque, N·m."""
    gear = mesh_shape(stage, stage.engagements[number]).gears[0]
    return torque / gear.r_b, torque / gear.r_b * math.tan(abs(gear.beta_b))


# ---- loads ----------------------------------------------------------------------------------------------------------
def test_bearings_of_a_shaft_carry_its_meshes() -> None:
    """The first shaft has one mesh, the last one another: T/r_b across and T tan β_b/r_b along the axis, to 1e-3:
    displaced axes turn the line of action a little."""
    stage, states = loaded(TRAIN)[0], found(TRAIN).rests
    for shaft, number, torque in (("input", 0, 100.0), ("output", 1, 100.0 * 61 / 25)):
        across, along = mesh_force(stage, number, torque)
        total = states[f"{shaft}_left"].load + states[f"{shaft}_right"].load
        assert math.hypot(*total[:2]) == pytest.approx(across, rel=1e-3)
        assert abs(total[2]) == pytest.approx(along, rel=1e-3)
        assert states[f"{shaft}_right"].load[2] == 0.0  # rollers


@pytest.mark.parametrize("name", [TRAIN, PAIR])
def test_load_and_stiffness_agree(name: str) -> None:
    own = found(name)
    assert own.iterations <= 4
    for support, state in own.rests.items():
        bearing = own.bearings[support]
        alone = rest(bearing, state.load)
        assert alone.displacement == pytest.approx(state.displacement, rel=1e-5, abs=1e-10)
        free = np.ix_(bearing.directions, bearing.directions)
        scale = np.outer(*2 * [np.array([1, 1, 1, 0.03, 0.03])[list(bearing.directions)]])
        apart = np.abs(alone.stiffness[free] - own.tangents[support]) / scale
        assert apart.max() < 2 * SETTLED * np.abs(own.tangents[support] / scale).max()


def test_a_turned_stage_has_turned_bearings() -> None:
    """All axes 40° further about z: loads and stiffnesses turn with them, averaged over the cage to 0.3 %
    (0.12 %); unturned they would be 11 % off."""
    spec, bodies = loaded(PAIR)
    c, s = math.cos(math.radians(40)), math.sin(math.radians(40))
    turned = {
        name: rotor.model_copy(
            update={"axis": (c * rotor.axis[0] - s * rotor.axis[1], s * rotor.axis[0] + c * rotor.axis[1])}
        )
        for name, rotor in spec.rotors.items()
    }
    plane = np.array([[c, -s], [s, c]])
    other, own = settled(spec.model_copy(update={"rotors": turned}), bodies), found(PAIR)
    for name, state in own.rests.items():
        assert other.rests[name].load[:2] == pytest.approx(plane @ state.load[:2], abs=0.1)
        one, two = own.tangents[name][:2, :2], other.tangents[name][:2, :2]
        assert np.abs(two - plane @ one @ plane.T).max() < 3e-3 * np.abs(one).max()


def test_without_load_only_preload_holds() -> None:
    """The tangent of a preloaded pair is the second derivative in its middle; rings do not move."""
    own = found(PAIR, 0.0)
    for name, bearing in own.bearings.items():
        assert own.rests[name].load == pytest.approx(np.zeros(5), abs=1e-6)
        assert own.tangents[name] == pytest.approx(bearing.stiffness(np.zeros(5)), rel=1e-9, abs=1e-3)
        assert own.rests[name].loads.min() > 0.0  # all balls are pressed


def test_an_axial_load_on_the_open_side_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The input shaft is pushed towards +z; an angular contact bearing that carries −z lets it go. Of one iteration."""
    monkeypatch.setattr(rolling, "SETTLED", math.inf)
    spec, bodies = loaded(TRAIN)
    angular = spec.bearings["6306"].model_copy(update={"contact_angle": math.radians(25.0), "clearance": 0.0})

    def facing(side: str) -> Settled:
        supports = [s.model_copy(update={"carries": side}) if s.name == "input_left" else s for s in spec.supports]
        changed = {"bearings": spec.bearings | {"6306": angular}, "supports": tuple(supports)}
        return settled(spec.model_copy(update=changed), bodies)

    with pytest.raises(ModelError, match="cannot carry 100 N"):
        facing("-z")
    assert facing("+z").rests["input_left"].load[2] > 0.0


# ---- the linear model -----------------------------------------------------------------------------------------------
def test_springs_given_as_tangents_are_the_springs() -> None:
    """A bearing whose tangent is diagonal makes the support that a file with these stiffnesses makes."""
    spec, bodies = loaded("two_stage")
    rolled = loaded(TRAIN)[0]
    held = {s.name: s for s in spec.supports if s.to is None}
    tangents = {}
    for name, s in held.items():
        values = [s.radial, s.radial, s.axial, s.tilt, s.tilt]
        tangents[name] = np.diag([value for value in values if value is not None])
    for one, two in zip(
        stage_layout(spec, bodies).supports, stage_layout(rolled, bodies, tangents=tangents).supports, strict=True
    ):
        assert (one.name, one.first, one.second, one.directions) == (two.name, two.first, two.second, two.directions)
        assert two.compliance == pytest.approx(one.compliance, rel=1e-14, abs=0)
        assert two.damping == pytest.approx(one.damping, rel=1e-14)


def springs(of: StageModel) -> tuple[dict[str, Any], np.ndarray]:
    """Sections of the blob, and the compliance of all supports."""
    sections = read_blob(of.blob)
    own = np.asarray(sections["support_compliance0"])
    return sections, np.diag(own) + np.asarray(sections["support_coupling0"]).reshape(own.size, own.size)


@pytest.mark.parametrize("name", [pytest.param(TRAIN, marks=pytest.mark.full), PAIR])
def test_the_blob_holds_the_whole_tangent(name: str) -> None:
    sections, compliance = springs(model(name))
    names = [entry.split(".")[1] for entry in str(sections["support_names"]).split("|")]
    kinds = [entry.split(".")[0] for entry in str(sections["support_names"]).split("|")]
    for support, tangent in found(name).tangents.items():
        own = [i for i, entry in enumerate(names) if entry == support and kinds[i] == "bearing"]
        assert compliance[np.ix_(own, own)] @ tangent == pytest.approx(np.eye(len(own)), abs=1e-9)
        others = [i for i in range(len(names)) if i not in own]
        assert not compliance[np.ix_(own, others)].any()
    assert "support_coupling1" not in sections  # held


def test_displacements_and_dampers_follow_the_whole_tangent() -> None:
    """At rest a displacement output is the compliance times all forces of its bearing; dampers press through κ K_s⁻¹ on
    the supports."""
    kernel = begun(model(PAIR).kernel(level=1.0), {"pinion.phi": 0.01})
    sections, compliance = springs(model(PAIR))
    forces = np.array([kernel.get(entry) for entry in str(sections["support_names"]).split("|")])
    moved = np.array([kernel.get(entry) for entry in str(sections["displacement_names"]).split("|")])
    assert np.abs(forces).max() > 1000.0
    assert moved == pytest.approx(compliance @ forces, rel=1e-9, abs=1e-15)
    assert np.abs(moved - np.diag(compliance) * forces).max() > 0.01 * np.abs(moved).max()  # coupling matters
    linear = kernel.linearise()
    size = len(forces)
    kappa, rows = (np.asarray(sections[key]).reshape(size, -1) for key in ("kappa0", "damper_rows0"))
    expected = kappa @ compliance @ (np.asarray(sections["damper0"])[:, None] * rows)
    ground = linear.group == 0
    wanted = expected[:, linear.number[ground]]
    assert np.abs(linear.support_damping[:, ground] - wanted).max() < 1e-9 * np.abs(wanted).max()


def test_energy_of_coupled_directions_is_that_of_bearings() -> None:
    """Shares of the modes are those of the same stage with the coupling counted by hand, and none is negative."""
    linear_model = model(PAIR)
    kernel = linear_model.kernel(level=3.0)
    kernel.prepare()
    kernel.transmission(0.0, 100.0)
    linear = kernel.linearise()
    own, without = (Linearised(linear, coupling=c) for c in (linear_model.support_coupling, None))
    squared, shapes, _ = own.shapes(6)
    shares, bare = own.values(squared, shapes)[2], without.values(squared, shapes)[2]
    forces = np.linalg.solve(own.compliance, linear.rows @ shapes)
    pressed = linear.support_rows @ shapes - linear.support_forces @ forces
    _, compliance = springs(linear_model)
    by_hand = np.einsum("sk,st,tk->k", pressed, compliance, pressed) / squared
    assert shares[:, 1] == pytest.approx(by_hand, rel=1e-9)
    assert shares.min() > -1e-9 and np.abs(shares - bare).max() > 1e-3


def test_bearings_belong_to_the_model() -> None:
    """Torque and numbers of bearings change its hash and the GUID of its FMUs."""
    spec, bodies = loaded(PAIR)
    loose = spec.bearings | {"7305": spec.bearings["7305"].model_copy(update={"preload": 100.0})}
    others = [
        spec.model_copy(update={"operating": OperatingSpec(torque=50.0)}),
        spec.model_copy(update={"bearings": loose}),
    ]
    models = [model(PAIR), *(assemble(other, bodies) for other in others)]
    assert len({own.hash for own in models}) == len({own.guid for own in models}) == 3


def test_energy_is_kept_on_coupled_bearings() -> None:
    """A loaded run with frozen mesh: what the balance leaves is no more than on constant springs, times three."""
    left = []
    for own in (model(PAIR), assemble(*loaded("helical_demo"))):
        trace = simulate(own, Steady(own, 200.0, 100.0), 3e-3, 20e-6, {"level": 1.0, "effect.roll_motion": 0.0})
        assert not trace.meta["warnings"]
        left.append(abs(trace["energy.residual"][-1]))
    assert left[0] <= 3 * left[1] + 1e-7, left


def test_a_run_far_from_the_operating_torque_is_told_so() -> None:
    for torque, said in ((100.0, False), (60.0, False), (199.0, False), (45.0, True), (-100.0, True)):
        assert any("linearised at 100 N·m" in text for text in beyond_limits(model(PAIR), torque)) == said
    assert not beyond_limits(assemble(*loaded("helical_demo")), 30.0)


# ---- forces of a pair against statics --------------------------------------------------------------------------------
LOAD, SPEED = 302.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
FAST = 1
SHAFTS = ("pinion", "wheel")


@pytest.fixture(scope="module")
def held(spec: Stage, bodies: list[Body]) -> StageModel:
    """A given torque on the pinion, the wheel's bore held."""
    ports = {"pinion": PortSpec(kind="torque"), "wheel": PortSpec(kind="fixed")}
    return assemble(with_ports(spec, ports), bodies)


def at_rest(held: StageModel, torque: float) -> Kernel:
    """In equilibrium under the torque (N·m) on the pinion; only flanks carry, along the line of action."""
    return begun(held.kernel(level=FAST, **{"effect.tip_contact": 0.0}), {"pinion.tau": torque})


def bearing(kernel: Kernel, shaft: str, mean: bool = False) -> np.ndarray:
    """Force (2,) of the gear on its bearing, N."""
    return np.array([kernel.get(f"bearing.{shaft}.f{axis}{'_mean' * mean}") for axis in "xy"])


def push(pair: PairGeometry, drive: bool = True) -> np.ndarray:
    """Unit vector (2,) of the contact force on the pinion: away from the wheel by the sine, against the torque by the
    cosine of the working pressure angle. Bores that yield along the line of action do not turn it."""
    return np.array([-math.sin(pair.alpha_wt), math.cos(pair.alpha_wt) * (-1 if drive else 1)])


@pytest.mark.parametrize("torque", [LOAD, 30.0, -LOAD])
def test_at_rest_bearings_and_ports_hold_the_contact_force(
    held: StageModel, spec: Stage, pair: PairGeometry, torque: float
) -> None:
    """On drive and coast flanks."""
    kernel = at_rest(held, torque)
    force = torque / pair.gears[0].r_b
    on_pinion, on_wheel = (bearing(kernel, shaft) for shaft in SHAFTS)
    along = push(pair, drive=torque > 0)
    assert kernel.get("mesh.force") == pytest.approx(force, rel=1e-6)
    assert kernel.get("wheel.tau") == pytest.approx(-torque * 24 / 16, rel=1e-6)
    assert np.allclose(on_pinion, abs(force) * along, rtol=0, atol=5e-5 * abs(force))
    assert np.allclose(on_wheel, -on_pinion, rtol=0, atol=1e-5 * abs(force))
    for gear in spec.written.gears:
        place = np.array([kernel.get(f"{gear.name}.gear.{axis}") for axis in "xy"])
        assert np.allclose(place * gear.bearing.stiffness, bearing(kernel, gear.name), rtol=1e-6)
        assert np.allclose(bearing(kernel, gear.name, mean=True), bearing(kernel, gear.name), rtol=1e-12)


def test_on_average_nothing_is_left_of_contact_and_bearing_forces(relieved: StageModel, pair: PairGeometry) -> None:
    """Steady run over whole mesh periods: no gear gains momentum, so the means over the communication steps add up to
    zero; so do the values at their ends, a bit less."""
    step = 2 * math.pi / 16 / SPEED / 31
    trace = simulate(relieved, Steady(relieved, SPEED, LOAD), 1800 * step, step, {"level": FAST})
    settled = slice(1 + 1800 - 31 * 24, None)
    force = trace["mesh.force_mean"][settled].mean()
    assert force == pytest.approx(LOAD / pair.gears[0].r_b, rel=5e-3)
    wanted = force * push(pair)
    for shaft, sign in zip(SHAFTS, (1, -1), strict=True):
        for kind, share in (("_mean", 3e-3), ("", 6e-3)):
            found = [trace[f"bearing.{shaft}.f{axis}{kind}"][settled].mean() for axis in "xy"]
            assert np.allclose(found, sign * wanted, rtol=0, atol=share * force)
