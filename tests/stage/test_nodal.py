"""Nodal contact on gears: exact answer for rigid flanks and its convergence, energy through changes of contact, the
same mean loaded transmission as the line contact of the same modes, helical gears, and the planetary set of the
paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun, stepped

from evidence.energy.free import Rattle, energies, free_pair, started
from gearfmu.body import Body
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.assembly.meshes import flank_nodes, mesh_penalty
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage

PAPER, LINE, NODAL = 4, 1, 2
SPEED, TORQUE = 209.44, 302.0  # rad/s, N·m of the pinion
PENALTY = 2e14  # N/m³


def with_nodes(spec: Stage, **nodal: object) -> Stage:
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
    free = free_pair(with_nodes(spec, along=along, across=5, penalty=PENALTY, nodes_of=nodes_of), bodies)
    off = {"effect.elastic": 0.0, "effect.bearings": 0.0, "effect.roll_motion": 1.0}
    kernel = started(free, Rattle(position=0.5, speed=0.05, offset=28e-6), {"level": PAPER, **off})
    force, te, pairs = stepped(kernel, 300, 2e-6, "mesh.force", "mesh.te", "mesh.pairs").T
    depth = np.maximum(te - 2e-6, 0.0)
    exact = spec.written.gears[0].face_width * 4 * math.sqrt(2) / 3 * PENALTY * math.sqrt(radius) * depth**1.5
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
    differences have at second order (tests/kernel/test_nodal_blocks.py)."""
    free = free_pair(with_nodes(spec, along=81), bodies)
    settings = {"level": PAPER, "effect.elastic": elastic, "effect.roll_motion": 1.0}
    kernel = started(free, Rattle(position=0.5, speed=0.2), settings)
    run = energies(kernel, 4e-6, 1.2e-3)
    assert run.changes >= 3 and run.drift < 5e-4


def mean_te(model: StageModel, torque: float, **parameters: float) -> tuple[float, float]:
    """Mean transmission error (m) and mesh force (N) over a mesh period after one to settle."""
    teeth = model.stage.written.gears[0].teeth
    period = 2 * math.pi / (SPEED * teeth)
    settings = {"level": PAPER, "integrator": 2} | parameters
    trace = simulate(model, Steady(model, SPEED, torque), 2 * period, period / 200, settings)
    assert trace.meta["outcome"] == "completed"
    return float(trace["mesh.te"][-200:].mean()), float(trace["mesh.force"][-200:].mean())


def test_mean_transmission_is_that_of_line_contact(relief_spec: Stage, bodies: list[Body]) -> None:
    """Same truncated modes, one mesh period: 81 nodes against five slices with the local law of Hertz. Measured: 0.2 %
    of the mean transmission error, 0.1 % of the mean force."""
    model = assemble(with_nodes(relief_spec, along=81), bodies)
    line, nodal = mean_te(model, TORQUE, contact=LINE), mean_te(model, TORQUE)
    assert nodal == pytest.approx(line, rel=5e-3) and nodal != line


def test_helical_gears_and_their_axial_force(helical: StageModel) -> None:
    """Mean transmission as with line contact; the bearings carry the axial force of a normal to the flank."""
    runs = []
    for law in (LINE, NODAL):
        trace = simulate(helical, Steady(helical, SPEED, 150.0), 4e-4, 2e-6, {"level": PAPER, "contact": law})
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
