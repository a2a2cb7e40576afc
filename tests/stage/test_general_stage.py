"""A train of two stages with elastic gears and shafts in one model: sections, phases of the teeth, and statics through
the whole train."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.errors import ModelError
from gearfmu.stage.assembly.assemble import MODEL_VERSION, general_sections
from gearfmu.stage.assembly.blob import order_sections
from gearfmu.stage.assembly.groups import mount
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stagefile.forms.general import EngagementSpec, PlacedPort, RotorSpec, Stage
from gearfmu.stagefile.forms.shapes import gears_in_mesh, mesh_shape
from gearfmu.stagefile.tables.connections import SupportSpec

A = 0.0915
SHAFT = {
    "kind": "shaft",
    "sections": [{"length": 0.1, "outer_diameter": 0.03}, {"length": 0.1, "outer_diameter": 0.04}],
    "material": {"youngs_modulus": 206e9, "poisson_ratio": 0.3, "density": 7850.0},
    "stored_to": 60e3,
}


@pytest.fixture(scope="module")
def train(spec) -> Stage:
    """Twice the FZG pair in series, the second stage at 50 degrees, on three shafts."""
    pair = spec
    gears = {
        f"{name}{i}": pair.bodies[name].model_copy(update={"name": f"{name}{i}"})
        for i in (1, 2)
        for name in pair.bodies
    }
    seats = [
        SupportSpec(name=gear, body=gear, to=shaft, radial="rigid", axial="rigid", tilt="rigid", torsion="rigid")
        for gear, shaft in (("pinion1", "in"), ("wheel1", "mid"), ("pinion2", "mid"), ("wheel2", "out"))
    ]
    bearings = [
        SupportSpec(name=f"{shaft}{i}", body=shaft, at=at, radial=3e8, axial=1e8 if i == 0 else None, tilt=2e4)
        for shaft in ("in", "mid", "out")
        for i, at in enumerate((0.01, 0.19))
    ]
    common = {"backlash": 1e-4, "damping": 2e5, "speed_max": 600.0}
    out = (A + A * math.cos(math.radians(50)), A * math.sin(math.radians(50)))
    return Stage(
        name="train",
        source=spec.source,
        bodies=gears | {name: SHAFT for name in ("in", "mid", "out")},
        rotors={
            "first": RotorSpec(axis=(0, 0), bodies={"pinion1": 0.06, "in": 0.0}),
            "second": RotorSpec(axis=(A, 0), bodies={"wheel1": 0.06, "pinion2": 0.13, "mid": 0.0}),
            "third": RotorSpec(axis=out, bodies={"wheel2": 0.13, "out": 0.0}),
        },
        engagements=(
            EngagementSpec(name="one", gears=("pinion1", "wheel1"), torque_max=300, **common),
            EngagementSpec(name="two", gears=("pinion2", "wheel2"), torque_max=450, **common),
        ),
        supports=(*seats, *bearings),
        ports={
            "input": PlacedPort(body="in", at=0.0, kind="spring", k=2e4, c=0.1),
            "output": PlacedPort(body="out", at=0.2, kind="torque"),
        },
    )


@pytest.fixture(scope="module")
def sections(train, bodies):
    return general_sections(train, [*bodies, *bodies], rolls=12)


def test_sections_of_a_train_are_complete(train, sections):
    ordered = order_sections(sections)
    counts = dict(
        zip(("version", "slices", "rotors", "gears", "engagements", "ports"), ordered["counts"][:6], strict=True)
    )
    assert counts == {"version": MODEL_VERSION, "slices": 5, "rotors": 3, "gears": 4, "engagements": 2, "ports": 2}
    assert ordered["support_names"].split("|")[:6] == [
        f"seat.pinion1.{d}" for d in ("fx", "fy", "fz", "mx", "my", "mz")
    ]
    assert [sections[f"size{g}"][0] for g in range(4)] == [0, 1, 1, 2]
    assert np.array_equal(sections["ground_list1_0"], sections["ground_list2_0"])  # two gears of one rotor
    assert not set(sections["ground_list0_0"]) & set(sections["ground_list1_0"])
    assert [sections[f"gear{g}"][13] for g in range(4)] == [0.06, 0.06, 0.13, 0.13]
    assert sections["port_kinds"].tolist() == [[0, 0, 0], [2, 1, 0]]
    assert sections["limits"][3] == pytest.approx(2 * math.pi / (600 * 16))
    megabytes = sum(np.asarray(v).nbytes for v in sections.values() if not isinstance(v, str)) / 1e6
    print("sections:", f"{megabytes:.0f} MB at 12 rolls,", sections["omega_ground0"].size, "ground oscillators")


def test_seats_carry_the_whole_torque_and_bearings_the_mesh_force(train, bodies):
    """Statics of one rotor: a force along the line of action on its gear and the reaction of the spin; forces on
    supports balance it."""
    layout = stage_layout(train, [*bodies, *bodies])
    group = mount(layout)
    force = np.array([0.0, 1.0, 0.3])
    rows = group.rigid(2)[:3]  # pinion2, loaded at its rigid frame: no elastic rows of its own
    q = (rows.T @ force) / group.omega**2
    forces = dict(zip(layout.support_names(), group.kappa @ group.support_rows @ q, strict=True))
    for direction, want in zip(("fx", "fy", "fz"), force, strict=True):
        bearings = sum(v for k, v in forces.items() if k.startswith("bearing.mid") and k.endswith(direction))
        assert forces[f"seat.pinion2.{direction}"] == pytest.approx(want, abs=1e-9)
        assert bearings == pytest.approx(want, abs=1e-9)
    others = [abs(v) for k, v in forces.items() if ".in" in k or ".out" in k or "pinion1" in k or "wheel" in k]
    assert max(others) < 1e-9
    left, right = forces["bearing.mid0.fy"], forces["bearing.mid1.fy"]
    assert left < right  # the gear stands nearer to the right bearing


def test_teeth_touch_in_every_engagement_at_angle_zero(train):
    """Drive gap of tooth 0 on tooth 0 is a whole number of pitches, from the closed form at the actual positions."""
    phases = tooth_phases(train)
    rack = SimpleNamespace(
        normal_module=0.0045, pressure_angle=math.radians(20), helix_angle=0.0, center_distance=A, backlash=1e-4
    )
    pair = gears_in_mesh(rack, (train.bodies["pinion1"], train.bodies["wheel1"]))
    assert phases["wheel1"] == pair.wheel_phase
    for mesh in train.engagements:
        pair = mesh_shape(train, mesh)
        a, b = pair.gears
        (x, y), (u, v) = (train.rotors[train.rotor_of(gear)].axis for gear in mesh.gears)
        t = math.atan2(v - y, u - x) - pair.alpha_wt
        roll_a = a.r_b * (phases[mesh.gears[0]] + a.psi_b - t)
        roll_b = b.r_b * (phases[mesh.gears[1]] + b.psi_b - t - math.pi)
        assert pair.length - roll_a - roll_b == pytest.approx(0, abs=1e-12)


def test_a_ring_of_gears_whose_axes_do_not_fit_is_refused(train):
    """Three gears in a triangle, each with each: only certain places of the axes fit the teeth."""
    rotors = {
        name: rotor.model_copy(update={"bodies": dict(list(rotor.bodies.items())[:1])})
        for name, rotor in train.rotors.items()
    }
    meshes = [
        train.engagements[0],
        train.engagements[0].model_copy(update={"name": "x", "gears": ("wheel1", "wheel2")}),
        train.engagements[0].model_copy(update={"name": "y", "gears": ("wheel2", "pinion1")}),
    ]
    loose = train.model_copy(update={"rotors": rotors, "engagements": tuple(meshes)})
    axes = {"first": (0.0, 0.0), "second": (0.0915, 0.0), "third": (0.05, 0.11)}
    loose = loose.model_copy(
        update={"rotors": {name: rotor.model_copy(update={"axis": axes[name]}) for name, rotor in rotors.items()}}
    )
    with pytest.raises(ModelError, match="move an axis"):
        tooth_phases(loose)
