"""A pinion in a ring on fixed axes: unloaded geometry against two involutes, the bodies on paper, and the table
of an independent finite-element program; helical: the path of contact of the section, hands that do not fit.
Balance: tests/relations. What helical teeth carry: test_helical_set.py."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from by_hand import BORE, _at, slice_weights
from inner import Inner
from scipy.optimize import minimize, minimize_scalar

from gearfmu.body import Body, reduce_bodies
from gearfmu.errors import SpecError
from gearfmu.geometry.mesh import RingMesh
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage
from tests.relations.kinds import COARSE, bodies_of

REFERENCE = Path(__file__).parents[1] / "reference"
STAGE = REFERENCE / "internal_pair" / "stage.toml"
TORQUE = 100.0  # N·m on the pinion
DRIVE, COAST = 0, 1


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Pinion 18 in a ring 54, on coarse meshes."""
    spec = load_stage(STAGE)
    coarse = {name: body.model_copy(update={"body": COARSE}) for name, body in spec.bodies.items()}
    return spec.model_copy(update={"bodies": coarse})


@pytest.fixture(scope="module")
def mesh(stage: Stage) -> RingMesh:
    found = mesh_shape(stage, stage.engagements[0])
    assert isinstance(found, RingMesh)
    return found


@pytest.fixture(scope="module")
def bodies() -> list[Body]:
    return list(bodies_of("internal").values())


@pytest.fixture(scope="module")
def model(stage: Stage, bodies: list[Body]) -> StageModel:
    return assemble(stage, bodies)


@pytest.fixture(scope="module")
def inner(model: StageModel, inner_library: Path) -> Inner:
    return Inner(inner_library, model.blob)


def rolling(mesh: RingMesh, phi: float, lead: float = 0.0) -> np.ndarray:
    """Pose with the pinion at φ, the ring following without load and ahead by `lead` (m along the line of action)."""
    return np.array([0.0, 0.0, phi, 0.0, 0.0, (mesh.planet.r_b * phi + lead) / mesh.ring.r_b])


def flank_of(stage: Stage, mesh: RingMesh, which: int, pose: np.ndarray, place: tuple[int, int]):
    """Point (2,) m on a flank at a roll (m), in the stage: of gear `which` (0 pinion, 1 ring) at a pose. place: flank
    and number of tooth or space."""
    gear, name = mesh.gears[which], stage.gears[which].name
    axis = np.array(stage.rotors[stage.rotor_of(name)].axis) + pose[3 * which : 3 * which + 2]
    angle = pose[3 * which + 2] + tooth_phases(stage)[name] + 2 * math.pi * place[1] / gear.z
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return lambda roll: axis + turn @ gear.flank_point(roll, 1 - 2 * place[0])


EDGES, HOLLOW = {"pinion": 0, "ring": 1}, (1, -1)


def past(mesh: RingMesh, place, which: int) -> bool:
    """Has the pair left the flank of gear `which`? Its roll stays at the tip then."""
    tip = mesh.gears[which].s_tip
    return place.roll[which] >= tip if which == 0 else place.roll[which] <= tip


@pytest.mark.parametrize("flank", [DRIVE, COAST])
def test_gap_is_the_distance_of_two_involutes(stage: Stage, mesh: RingMesh, inner: Inner, flank: int) -> None:
    """At displaced axes and any angle; open flanks, so that the shortest distance is along the common normal. Thinner
    teeth, which the declared backlash means, are an allowance on the coast side (docs/theory.md, 2.1)."""
    rng, worst, count = np.random.default_rng(4), 0.0, 0
    lead, allowance = (2e-5, 0.0) if flank == DRIVE else (-2e-5, mesh.normal_backlash)
    for phi in rng.uniform(-20.0, 20.0, 6):
        pose = rolling(mesh, phi, lead) + np.append(rng.uniform(-1e-5, 1e-5, 2), np.zeros(4))
        for place in inner.places(pose, 2e-4):
            if place.flank != flank or past(mesh, place, 0) or past(mesh, place, 1):
                continue
            curves = [flank_of(stage, mesh, which, pose, (flank, place.tooth)) for which in (0, 1)]
            near = minimize(
                lambda rolls, curves=curves: 1e9 * np.sum((curves[0](rolls[0]) - curves[1](rolls[1])) ** 2),
                np.array(place.roll) * (1 + 1e-4),
                method="Nelder-Mead",
                options={"xatol": 1e-12, "fatol": 1e-20, "maxiter": 4000},
            )
            distance = math.sqrt(near.fun / 1e9)
            worst, count = max(worst, abs(distance - (place.gap - allowance))), count + 1
            assert near.x[0] == pytest.approx(place.roll[0], abs=2e-6)
            assert place.curvature == pytest.approx(1 / place.roll[0] - 1 / place.roll[1], rel=1e-9)
    assert count >= 6 and worst < 1e-10


def edge_centre(mesh: RingMesh, which: int) -> np.ndarray:
    """Centre (2,) of the tip edge's arc from the axis, tooth or space 0 on its axis, drive flank: inside the tooth by
    the edge's radius along the normal of the flank's end."""
    gear = mesh.gears[which]
    edge = gear.tip_edge
    end, step = gear.flank_point(gear.s_tip, 1), 1e-6
    inwards = gear.s_form - gear.s_tip
    tangent = gear.flank_point(gear.s_tip + math.copysign(step, inwards), 1) - end
    tangent /= np.hypot(*tangent)
    normals = [np.array([-tangent[1], tangent[0]]), np.array([tangent[1], -tangent[0]])]
    # material of the pinion's tooth lies towards its axis of symmetry, of the ring's away from that of its space
    towards = -1.0 if which == 0 else 1.0
    return end + edge * max(normals, key=lambda n: towards * n[1] * np.sign(end[1]))


@pytest.mark.parametrize("edge", EDGES)
def test_a_tip_edge_past_its_flank_is_an_arc_against_the_other_involute(
    stage: Stage, mesh: RingMesh, inner: Inner, edge: str
) -> None:
    """The gap is the shortest distance of the arc's centre from the other flank, less the radius; open flanks. From
    the flank's end on the curvature of the edge takes the place of the flank's."""
    c, o, worst, count = EDGES[edge], 1 - EDGES[edge], 0.0, 0
    for phi in np.linspace(0.0, 2 * math.pi / mesh.planet.z, 60):
        pose = rolling(mesh, phi, 2e-5)
        for place in inner.places(pose, 2e-4):
            if place.flank != DRIVE or not past(mesh, place, c):
                continue
            curves = [flank_of(stage, mesh, which, pose, (DRIVE, place.tooth)) for which in (0, 1)]
            name = stage.gears[c].name
            axis = np.array(stage.rotors[stage.rotor_of(name)].axis) + pose[3 * c : 3 * c + 2]
            angle = pose[3 * c + 2] + tooth_phases(stage)[name] + 2 * math.pi * place.tooth / mesh.gears[c].z
            turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            centre = axis + turn @ edge_centre(mesh, c)
            near = minimize_scalar(
                lambda roll, curve=curves[o], centre=centre: np.hypot(*(curve(roll) - centre)),
                bracket=(place.roll[o], place.roll[o] + 1e-5),
                options={"xtol": 1e-12},
            )
            worst, count = max(worst, abs(near.fun - mesh.gears[c].tip_edge - place.gap)), count + 1
            assert near.x == pytest.approx(place.roll[o], abs=2e-6)
            own = place.curvature - HOLLOW[o] / place.roll[o]
            assert HOLLOW[c] / mesh.gears[c].s_tip - 1e-9 < own < 1 / mesh.gears[c].tip_edge + 1e-9
    assert count >= 3 and worst < 1e-9


def test_gradient_of_the_gap_of_flanks_and_tip_edges(mesh: RingMesh, inner: Inner) -> None:
    """By central differences of the gap, where a pair is on the same pair of curves at both ends."""
    step, seen = 1e-7, dict.fromkeys([(False, False), (True, False), (False, True)], 0)
    for phi in np.linspace(0.0, 2 * math.pi / mesh.planet.z, 30):
        pose = rolling(mesh, phi, lead=1e-5)
        near = [{(p.flank, p.tooth): p for p in inner.places(pose + moved, 1e-3)} for moved in differences(step)]
        for place in inner.places(pose, 2e-4):
            ends = [places[place.flank, place.tooth] for places in near]
            kinds = {(past(mesh, end, 0), past(mesh, end, 1)) for end in (place, *ends)}
            if len(kinds) == 1:
                slopes = (np.array([end.gap for end in ends[6:]]) - [end.gap for end in ends[:6]]) / (2 * step)
                assert place.gradient == pytest.approx(slopes, abs=1e-7 if kinds == {(False, False)} else 1e-6)
                seen[kinds.pop()] += 1
    assert min(seen.values()) > 3, seen


def differences(step: float) -> np.ndarray:
    """(12, 6): steps back, then forward, in every coordinate of a pose."""
    return step * np.vstack([-np.eye(6), np.eye(6)])


def test_te_of_one_tooth_pair_is_that_of_the_bodies_on_paper(stage, mesh: RingMesh, bodies, model) -> None:
    """Both bodies' static tables with bore and rim held, and the local law with the relative curvature 1/s − 1/s'."""
    result = loaded_te(model, [TORQUE], 8, **{"effect.bearings": 0.0})
    alone = int(np.argmax(result.te[0]))
    roll = mesh.planet.r_b * (2 * math.pi / 18 * alone / 8 + mesh.planet.psi_b + mesh.alpha_wt)
    fitting = [roll + k * mesh.base_pitch for k in range(-3, 4)]
    (roll,) = (s for s in fitting if mesh.path["A"] <= s <= mesh.path["E"])
    force, width = TORQUE / mesh.planet.r_b, stage.gears[0].face_width
    total = sum(
        held_compliance(body, s, hollow)
        for body, s, hollow in zip(bodies, (roll, roll + mesh.length), (1, -1), strict=True)
    )
    steel = stage.gears[0].material
    a = 2 * 2 * (1 - steel.poisson_ratio**2) / (math.pi * steel.youngs_modulus)
    load = force / width
    beta = 2 * a / (1 / roll - 1 / (roll + mesh.length))
    local = load * (a * (math.log(4 * COARSE.strip_half_width) - 1) - 0.5 * a * math.log(beta * load))
    assert result.te[0, alone] == pytest.approx(force * total + local, rel=4e-3)  # slices share unevenly


def held_compliance(body: Body, roll: float, hollow: int) -> float:
    """m/N of the drive flank of tooth 0 under a load uniform over the width, the bore (hollow −1: the rim) held."""
    weights = slice_weights(5, body.flank.rows.shape[2])
    flank = _at(body, roll, _at(body, roll, body.flank.static[DRIVE, DRIVE, 0]))
    cross, bore = _at(body, roll, body.flank.node[DRIVE][:, :, BORE]), body.static[np.ix_(BORE, BORE)]
    t = body.flank.psi_b - roll / body.flank.r_b
    held = -hollow * np.array([-math.sin(t), math.cos(t), body.flank.r_b])
    side = weights @ cross @ held
    return float(np.mean(weights @ flank @ weights.T + side[:, None] + side[None, :] + held @ bore @ held))


def test_a_ring_that_is_named_first_and_a_tip_that_interferes_are_told(tmp_path: Path) -> None:
    text = STAGE.read_text(encoding="utf-8")
    first = tmp_path / "first.toml"
    first.write_text(text.replace('gears = ["pinion", "ring"]', 'gears = ["ring", "pinion"]'), encoding="utf-8")
    with pytest.raises(SpecError, match="name it second"):
        load_stage(first)
    short = tmp_path / "short.toml"
    short.write_text(text.replace('tip_diameter = "131 mm"', 'tip_diameter = "130 mm"'), encoding="utf-8")
    with pytest.raises(SpecError, match="bodies.ring.tip_diameter.*interference"):
        load_stage(short)


@pytest.mark.full
def test_loaded_te_against_an_independent_program(tmp_path: Path) -> None:
    """CalculiX with bore and rim averaged and no tip edges in contact, every second position of eight. Margin: mean
    0.5 %, peak to peak 2 %, single positions 0.7 %."""
    table = json.loads((REFERENCE / "calculix_te.json").read_text(encoding="utf-8"))["internal"]
    spec, held = load_stage(STAGE), {"effect.bearings": 0.0, "effect.tip_contact": 0.0}
    ours = loaded_te(assemble(spec, reduce_bodies(spec, tmp_path)), [float(torque) for torque in table], 8, **held)
    for here, theirs in zip(1e6 * ours.te[:, ::2], table.values(), strict=True):
        assert here.mean() == pytest.approx(np.mean(theirs), rel=0.03)
        assert np.allclose(here, theirs, rtol=0.03) and np.ptp(here) == pytest.approx(np.ptp(theirs), rel=0.05)


# ---- helical ---------------------------------------------------------------------------------------------------------
WIDTH, MODULE, ANGLE = 20e-3, 2.5e-3, math.radians(20)  # m, m, rad: of the section
WHOLE = math.atan(math.pi * MODULE / WIDTH)  # rad: overlap ratio one


def stage_at(beta: float) -> Stage:
    """The spur pair with a helix of the same transverse section."""
    spur, cosine = load_stage(STAGE), math.cos(beta)
    angles = {"normal_module": MODULE * cosine, "pressure_angle": math.atan(math.tan(ANGLE) * cosine)}
    bodies = {name: gear.model_copy(update=angles | {"helix_angle": beta}) for name, gear in spur.bodies.items()}
    return spur.model_copy(update={"bodies": bodies})


def test_a_helix_of_the_same_transverse_section_has_the_same_path_of_contact() -> None:
    meshes = [mesh_shape(stage, stage.engagements[0]) for stage in (stage_at(WHOLE), stage_at(0.0))]
    helical, spur = (mesh.path for mesh in meshes)
    assert helical == pytest.approx(spur, rel=1e-12)
    assert meshes[0].base_pitch == pytest.approx(meshes[1].base_pitch, rel=1e-12)
    assert meshes[0].gears[0].overlap_ratio(WIDTH) == pytest.approx(1.0, rel=1e-12)


def test_a_ring_of_the_other_hand_is_refused(tmp_path: Path) -> None:
    text = STAGE.read_text(encoding="utf-8")
    twisted = tmp_path / "stage.toml"
    twisted.write_text(
        text.replace("profile_shift = 0.0", 'profile_shift = 0.0\nhelix_angle = "20 deg"'), encoding="utf-8"
    )
    with pytest.raises(SpecError, match="bodies.ring.helix_angle.*one hand: write 20 deg"):
        load_stage(twisted)
