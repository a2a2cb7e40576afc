"""Any pair is either refused with a reason or gives valid meshes: z 12–80, profile shifts, module, face width, bore.
Many helical gears and rings mesh well."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from sections import section

from gearfmu.femesh.mesh import FeMesh, rotated
from gearfmu.femesh.quality import scaled_jacobian, volume
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry, involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.stagefile.checks.gears import Meshed, mesh_problems
from gearfmu.stagefile.forms.expand import pair_gears
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.tables.bodies import BodySpec, GearSpec, Material, MeshSpec, PairSpec
from gearfmu.stagefile.tables.connections import Bearing

Found = tuple[str, float | str, str]  # field, value, remedy
STEEL = Material(youngs_modulus=206e9, poisson_ratio=0.3, density=7850)


def pair_of(teeth, shifts, module, widths, bores, widening) -> tuple[PairSpec, list[GearSpec]]:
    """A pair of the standard rack at the centre distance without backlash plus `widening` modules; bores in root
    radii.
    """
    alpha = math.radians(20)
    inv_w = float(involute.inv(alpha)) + 2 * sum(shifts) * math.tan(alpha) / sum(teeth)
    cos_w = math.cos(involute.inverse_inv(max(inv_w, 1e-6)))
    distance = module * (sum(teeth) / 2 * math.cos(alpha) / cos_w + widening)
    shortening = max(0.0, sum(shifts) + sum(teeth) / 2 + widening - distance / module)
    gears = []
    for index in (0, 1):
        root = module * (teeth[index] - 2.5 + 2 * shifts[index])
        gears.append(
            GearSpec(
                name=("pinion", "wheel")[index],
                teeth=teeth[index],
                profile_shift=shifts[index],
                tip_diameter=module * (teeth[index] + 2 * shifts[index] + 2 - 2 * shortening),
                face_width=widths[index] * module,
                bore_diameter=bores[index] * root,
                tip_edge_radius=0.04 * module,
                material=STEEL,
                bearing=Bearing(stiffness=3e8),
                body=BodySpec(strip_half_width=0.1 * module),
            )
        )
    backlash = (2 * math.tan(alpha) * max(widening, 0) + 0.02) * module
    pair = PairSpec(center_distance=distance, normal_module=module, pressure_angle=alpha, backlash=backlash)
    return pair, gears


def cut_gap(mesh: FeMesh) -> float:
    """Largest distance (m) of nodes on one cut, turned by a pitch, from those on the other."""
    return float(
        np.abs(rotated(mesh.nodes[mesh.cut_minus], 2 * math.pi / mesh.teeth) - mesh.nodes[mesh.cut_plus]).max()
    )


def check_meshes(pair: PairSpec, gears: list[GearSpec], scale: float) -> None:
    for gear in gears:
        shape = gear_geometry(gear, pair)
        mesh = gear_sector(shape, gear.face_width, MeshSpec(scale=scale))
        assert scaled_jacobian(mesh).min() > 0.35
        assert volume(mesh) == pytest.approx(section(shape)[0] * gear.face_width, rel=5e-4)
        assert cut_gap(mesh) <= 1e-12 * shape.r_a


def problems_of(pair: PairSpec, gears: list[GearSpec]) -> list[Found]:
    pinion, wheel = pair_gears(pair, gears)
    return list(mesh_problems(Meshed((pinion, wheel), pair.center_distance, pair.backlash, None)))


def check_reasons(problems: list[Found]) -> None:
    for field, value, remedy in problems:
        assert field.split(".")[0] in ("bodies", "distance", "backlash")
        assert value != "" and len(remedy) > 20


def both(values: st.SearchStrategy) -> st.SearchStrategy:
    return st.tuples(values, values)


PAIRS = {
    "teeth": both(st.integers(12, 80)),
    "shifts": both(st.floats(-0.5, 0.9)),
    "module": st.floats(0.5e-3, 20e-3),
    "widths": both(st.floats(1, 20)),
    "bores": both(st.floats(0.05, 0.98)),
    "widening": st.floats(-0.1, 0.2),
}


def valid_mesh_or_a_reason(scale: float, numbers: dict) -> None:
    pair, gears = pair_of(**numbers)
    problems = problems_of(pair, gears)
    event("refused" if problems else "meshed")
    check_reasons(problems)
    if not problems:
        check_meshes(pair, gears, scale)


@settings(max_examples=200)
@given(st.fixed_dictionaries(PAIRS))
def test_valid_mesh_or_a_reason(numbers: dict) -> None:
    valid_mesh_or_a_reason(0.3, numbers)


@pytest.mark.full
@settings(max_examples=3000)
@given(st.fixed_dictionaries(PAIRS), st.sampled_from([0.2, 0.5, 1.0]))
def test_valid_mesh_or_a_reason_at_length(numbers: dict, scale: float) -> None:
    valid_mesh_or_a_reason(scale, numbers)


HELICAL = {
    "teeth": st.integers(12, 80),
    "shift": st.floats(-0.2, 0.8),
    "beta": st.floats(-35, 35),
    "width": st.floats(1, 15),
    "bore": st.floats(0.1, 0.8),
}


@settings(max_examples=60)
@given(st.fixed_dictionaries(HELICAL))
def test_helical_sectors_of_any_angle_are_sound(numbers: dict) -> None:
    """Up to 35° and face widths of 15 modules: positive Jacobians, the volume of the section times the width, cuts one
    pitch apart; gears with a pointed tooth are left out."""
    m, beta = 2e-3, math.radians(numbers["beta"])
    root = m * (numbers["teeth"] / math.cos(beta) / 2 - 1.25 + numbers["shift"])
    shape = GearGeometry(
        z=numbers["teeth"], m=m, alpha=math.radians(20), x=numbers["shift"], r_a=root + 2.1 * m, tip_edge=0.04 * m,
        r_bore=numbers["bore"] * root, h_fp=1.25 * m, rho_fp=0.38 * m, beta=beta,
    )  # fmt: skip
    if shape.tip_land_half_angle <= 0 or shape.r_f - shape.r_bore < 1.1 * m:
        event("left out")
        return
    width = numbers["width"] * m
    layers = max(2, math.ceil(abs(shape.twist) * width / 0.1))
    mesh = gear_sector(shape, width, MeshSpec(flank=8, thickness=2, root=4, rim=2, width=layers))
    assert scaled_jacobian(mesh).min() > 0.3
    assert volume(mesh) == pytest.approx(section(shape)[0] * width, rel=5e-4)
    assert cut_gap(mesh) <= 1e-12 * shape.r_a


def test_ordinary_pairs_are_not_refused() -> None:
    """A grid of everyday gears must pass: the checks may not refuse everything."""
    refused = []
    for small in (18, 25, 40):
        for large in (20, 45, 80):
            for shifts in ((0.0, 0.0), (0.3, -0.1), (0.5, 0.4)):
                pair, gears = pair_of((small, large), shifts, 3e-3, (8, 8), (0.4, 0.6), 0.0)
                refused += problems_of(pair, gears)
                check_meshes(pair, gears, 0.3)
    assert not refused


@settings(max_examples=25, derandomize=True)
@given(
    z=st.integers(36, 160), x=st.floats(-0.3, 0.5), tip=st.floats(0.5, 0.9), fillet=st.floats(0.1, 0.3),
    rim=st.floats(1.1, 6), scale=st.sampled_from([0.5, 1.0]),
)  # fmt: skip
def test_many_rings_mesh_well(z, x, tip, fillet, rim, scale):
    m, r = 2e-3, 1e-3 * z
    r_f = r + m * (x + 1.25)
    ring = InternalGearGeometry(
        z, m, math.radians(20), x, r + m * (x - tip), 0.04 * m, r_f, r_f + rim * m, fillet * m
    )  # fmt: skip
    if ring.s_tip <= 0 or ring.fillet_centre[1] <= 0 or ring.tip_land_half_angle < 0:
        event("no such ring")
        return
    mesh = gear_sector(ring, 5 * m, MeshSpec(width=1, scale=scale))
    assert scaled_jacobian(mesh).min() > 0.35
    assert volume(mesh) == pytest.approx(section(ring)[0] * 5 * m, rel=5e-4)
    assert cut_gap(mesh) < 1e-12 * r + 1e-15
