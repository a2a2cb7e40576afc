"""Nodal contact on two blocks: exact penalty, impact and momentum; what the kernel refuses; and nothing changes for
those who do not ask for it. On gears: exact answer for rigid flanks and its convergence, energy through changes of
contact, the same mean loaded transmission as the line contact of the same modes, helical gears, and the planetary set
of the paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun, stepped
from flat import FlatBody, FlatContact, flat_blob
from small_model import pair_blob, with_nodes

from evidence.energy.free import Rattle, energies, free_pair, started
from gearfmu.body import Body
from gearfmu.errors import ModelError, SimulationError
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stage.assembly.meshes import flank_nodes, mesh_penalty
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage

DG4, RK45, CENTRAL = 0, 2, 3
FULL, PAPER = 3, 4
LINE, NODAL = 1, 2
PENALTY, SPEED = 2e9, 0.1  # N/m³, m/s; the penalty of with_nodes
AREA = 1.0 * 0.01**2 / (2 * 0.01)  # m²: face width times arc length of the flank that a flat body has in name
MASSES = (0.8, 1.7)


def blocks(omega: float = 0.0, damping: float = 0.0) -> bytes:
    """Two blocks 1 m wide that just touch, rigid or with one mode each."""
    bodies = [
        FlatBody(m, np.array([omega] if omega else []), np.zeros(1 if omega else 0),
                 np.full((1, 1 if omega else 0), 0.4), np.zeros((1, 1)))
        for m in MASSES
    ]  # fmt: skip
    return flat_blob("blocks", bodies, FlatContact(damping=damping))


def run(blob: bytes, h: float, steps: int, names: tuple[str, ...], **parameters: float) -> np.ndarray:
    """(steps, names) after every step; the left block is thrown against the right one."""
    kernel = Kernel(blob, {"level": PAPER, "contact": NODAL, "left.w_start": SPEED, "h": h} | parameters)
    kernel.initialize()
    return stepped(kernel, steps, h, *names)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("nodes", [(2, 2), (9, 5), (40, 33)])
def test_rigid_blocks_are_a_spring_of_penalty_times_area(share: float, nodes: tuple[int, int]) -> None:
    """Whoever's nodes and however many: half a sine of amplitude v √(m K), K = k A; momentum and energy are kept."""
    reduced, stiffness = MASSES[0] * MASSES[1] / sum(MASSES), PENALTY * AREA
    h = 2e-6
    found = run(with_nodes(blocks(), share, nodes), h, 1400, ("mesh.force", "left.w", "right.w"))
    time, length = (np.arange(len(found)) + 1) * h, math.pi * math.sqrt(reduced / stiffness)
    peak = SPEED * math.sqrt(reduced * stiffness)
    exact = np.where(time < length, peak * np.sin(math.pi * time / length), 0.0)
    assert time[-1] > length and np.abs(found[:, 0] - exact).max() < 1e-5 * peak
    left = SPEED * (MASSES[0] - MASSES[1]) / sum(MASSES)
    assert found[-1, 1] == pytest.approx(left, rel=1e-5)
    assert found[-1, 2] == pytest.approx(SPEED + left, rel=1e-5)


def test_elastic_blocks_keep_momentum_and_energy() -> None:
    """Modes in contact, undamped: momentum to rounding, energy as the integrator keeps it, and with central
    differences of nearly second order."""
    blob = with_nodes(blocks(omega=6e3))
    names = ("left.gear.w", "right.gear.w", "energy.stored", "mesh.force")
    found = run(blob, 2e-6, 2000, names, **{"integrator": RK45})
    momentum = found[:, :2] @ np.array(MASSES)
    assert found[:, 3].max() > 0.0 and found[-1, 3] == 0.0
    assert np.abs(momentum / (MASSES[0] * SPEED) - 1).max() < 1e-9
    assert np.abs(found[:, 2] / (0.5 * MASSES[0] * SPEED**2) - 1).max() < 1e-5
    drifts = [np.ptp(run(blob, h, round(4e-3 / h), names, integrator=CENTRAL)[:, 2]) for h in (16e-6, 4e-6)]
    assert 0.5 * math.log2(drifts[0] / drifts[1]) > 1.4


def test_damping_takes_energy_and_never_pulls() -> None:
    found = run(with_nodes(blocks(damping=2e3)), 2e-6, 1400, ("energy.stored", "mesh.force"))
    assert found[-1, 0] < 0.99 * found[0, 0] and np.diff(found[:, 0]).max() < 1e-7 * found[0, 0]
    assert found[:, 1].min() == 0.0


def test_a_model_with_nodes_that_are_not_asked_for_is_the_same() -> None:
    """Line contact, by name and at every level but paper, and level paper without nodes: equal to the last bit."""
    plain = pair_blob(("torque", "torque"))
    nodal = with_nodes(plain, penalty=1e14)
    for level, parameters in ((FULL, {}), (PAPER, {"contact": LINE}), (PAPER, {"integrator": 1})):
        runs = [_pair_run(blob, level, parameters) for blob in (plain, nodal)]
        assert np.array_equal(*runs)
    assert not np.array_equal(_pair_run(plain, PAPER, {}), _pair_run(nodal, PAPER, {}))


def _pair_run(blob: bytes, level: int, parameters: dict[str, float]) -> np.ndarray:
    kernel = Kernel(blob, {"level": level, "pinion.w_start": 200.0, "wheel.w_start": -133.0} | parameters)
    kernel.initialize()
    return stepped(kernel, 40, 5e-6, "mesh.force", "mesh.te", "energy.stored")


@pytest.mark.parametrize(
    ("blob", "parameters", "words"),
    [
        (with_nodes(blocks()), {"integrator": DG4, "level": FULL}, "use integrator rk45 or central"),
        (with_nodes(blocks()), {"contact_penalty": 0.0}, "contact_penalty is 0"),
        (blocks(), {}, "no flank nodes"),
    ],
    ids=["dg4", "penalty", "no nodes"],
)
def test_what_nodal_contact_cannot_do_is_refused(blob: bytes, parameters: dict[str, float], words: str) -> None:
    with pytest.raises((ModelError, SimulationError), match=words):
        run(blob, 2e-6, 1, ("mesh.force",), **parameters)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"nodes0": np.array([1, 5], np.int32)}, "number of nodes of a flank = 1 is out of range"),
        ({"nodes1": np.array([9, 10000], np.int32)}, "number of nodes of a flank = 10000 is out of range"),
        ({"nodes1": None}, "nodes of a flank are missing"),
        ({"nodal": np.array([[-1.0, 0.5]])}, "penalty of nodal contact, N/m3, = -1 is out of range"),
        ({"nodal": np.array([[1e14, 1.5]])}, "numbers of nodal contact are out of range"),
        ({"nodal": np.array([1e14])}, "nodal has the wrong length"),
    ],
)
def test_a_blob_with_wrong_nodes_is_refused(damage: dict, words: str) -> None:
    sections = dict(read_blob(with_nodes(blocks()))) | damage
    with pytest.raises(ModelError, match=words):
        Kernel(write_blob({name: value for name, value in sections.items() if value is not None}))


# ---- on gears --------------------------------------------------------------------------------------------------------
ROLLING, TORQUE = 209.44, 302.0  # rad/s, N·m of the pinion
STIFF = 2e14  # N/m³, penalty


def with_numbers(spec: Stage, **nodal: object) -> Stage:
    """The stage with other numbers of [contact.nodal]."""
    contact = spec.written.contact
    return rewritten(spec, contact=contact.model_copy(update={"nodal": contact.nodal.model_copy(update=nodal)}))


def test_default_penalty_gives_hertz_half_width(relief_spec: Stage, pair: PairGeometry) -> None:
    """An elastic foundation p = k (δ − x²/2R) carries 2/3 k b³/R on ±b; with Hertz's b² = 4 f R/(π E*) that is f."""
    stage = relief_spec
    penalty = mesh_penalty(stage, stage.engagements[0])
    load = relief_spec.written.torque_max / pair.gears[0].r_b / relief_spec.written.gears[0].face_width
    pitch = pair.path["C"]
    radius, modulus = pitch * (pair.length - pitch) / pair.length, 206e9 / (2 * (1 - 0.3**2))
    half = math.sqrt(4 * load * radius / (math.pi * modulus))
    assert 2 / 3 * penalty * half**3 / radius == pytest.approx(load, rel=1e-12)
    assert [flank_nodes(stage, gear) for gear in stage.gears] == [(41, 13), (41, 13)]


def rigid_error(spec: Stage, bodies: list[Body], along: int, nodes_of: str = "both") -> float:
    """Largest error of the force (share of the largest) while rigid teeth meet and part, one pair in contact."""
    pair = spec.written.geometry
    a = pair.gears[0]
    roll = a.r_b * (a.psi_b + pair.alpha_wt + math.pi / a.z)  # half a pitch after the flanks of tooth 0 met
    radius = roll * (pair.length - roll) / pair.length
    free = free_pair(with_numbers(spec, along=along, across=5, penalty=STIFF, nodes_of=nodes_of), bodies)
    off = {"effect.elastic": 0.0, "effect.bearings": 0.0, "effect.roll_motion": 1.0}
    kernel = started(free, Rattle(position=0.5, speed=0.05, offset=28e-6), {"level": PAPER, **off})
    force, te, pairs = stepped(kernel, 300, 2e-6, "mesh.force", "mesh.te", "mesh.pairs").T
    depth = np.maximum(te - 2e-6, 0.0)
    exact = spec.written.gears[0].face_width * 4 * math.sqrt(2) / 3 * STIFF * math.sqrt(radius) * depth**1.5
    assert pairs.max() == 1 and force.max() > 500
    return float(np.abs(force - exact).max() / force.max())


def test_rigid_flanks_are_an_elastic_foundation(spec: Stage, bodies: list[Body]) -> None:
    """f = 4/3 b k √(2R) δ^(3/2): the error falls with the distance of the nodes, of one gear or of both."""
    errors = {along: rigid_error(spec, bodies, along) for along in (41, 513)}
    one_sided = rigid_error(spec, bodies, 513, "a")
    assert errors[513] < 0.01 < errors[41] and one_sided < 0.015


@pytest.mark.parametrize("elastic", [0.0, 1.0])
def test_energy_through_impacts_on_both_flanks(spec: Stage, bodies: list[Body], elastic: float) -> None:
    """Undamped free rattle, places of contact moving: what is left is the error of the integrator, which central
    differences have at second order."""
    free = free_pair(with_numbers(spec, along=81), bodies)
    settings = {"level": PAPER, "effect.elastic": elastic, "effect.roll_motion": 1.0}
    kernel = started(free, Rattle(position=0.5, speed=0.2), settings)
    run = energies(kernel, 4e-6, 1.2e-3)
    assert run.changes >= 3 and run.drift < 5e-4


def mean_te(model: StageModel, torque: float, **parameters: float) -> tuple[float, float]:
    """Mean transmission error (m) and mesh force (N) over a mesh period after one to settle."""
    teeth = model.stage.written.gears[0].teeth
    period = 2 * math.pi / (ROLLING * teeth)
    settings = {"level": PAPER, "integrator": 2} | parameters
    trace = simulate(model, Steady(model, ROLLING, torque), 2 * period, period / 200, settings)
    assert trace.meta["outcome"] == "completed"
    return float(trace["mesh.te"][-200:].mean()), float(trace["mesh.force"][-200:].mean())


def test_mean_transmission_is_that_of_line_contact(relief_spec: Stage, bodies: list[Body]) -> None:
    """Same truncated modes, one mesh period: 81 nodes against five slices with the local law of Hertz. Measured: 0.2 %
    of the mean transmission error, 0.1 % of the mean force."""
    model = assemble(with_numbers(relief_spec, along=81), bodies)
    line, nodal = mean_te(model, TORQUE, contact=LINE), mean_te(model, TORQUE)
    assert nodal == pytest.approx(line, rel=5e-3) and nodal != line


def test_helical_gears_and_their_axial_force(helical: StageModel) -> None:
    """Mean transmission as with line contact; the bearings carry the axial force of a normal to the flank."""
    runs = []
    for law in (LINE, NODAL):
        trace = simulate(helical, Steady(helical, ROLLING, 150.0), 4e-4, 2e-6, {"level": PAPER, "contact": law})
        runs.append([trace[name][100:].mean() for name in ("mesh.te", "mesh.force", "bearing.pinion.fz")])
    assert runs[1] == pytest.approx(runs[0], rel=0.02)


def test_the_papers_planetary_set(planetary: StageModel) -> None:
    """Level paper: 400 modes a gear, carrier of 120, nodal contact in all eight meshes, rk45; 600 N·m on the carrier at
    85 rad/s. Forces stay around those of the static balance, opposite planets carry the same."""
    loads = {"carrier.tau": 600.0, "sun.tau": -150.0, "carrier.w_start": 85.0, "sun.w_start": 340.0}
    kernel = begun(planetary.kernel(level=PAPER), loads)
    assert "nodal" in kernel.warning and kernel.get("solver.n_dyn") > 2500
    meshes = [f"{central}_planet{k}.force" for central in ("sun", "ring") for k in (1, 2, 3, 4)]
    force = stepped(kernel, 3, 1e-5, *meshes)
    assert np.all(force[:, :4] < -1000) and np.all(force[:, 4:] > 1000)
    for mesh in (0, 1, 4, 5):
        assert np.allclose(force[:, mesh], force[:, mesh + 2], rtol=0.02)
