"""What finite elements feel when they turn, against the thin rotating ring (Bryan 1890) and a small gear as a whole."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as sl
import small_gear
from blocks import STEEL, ring_sector

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.spinning import growth, leave_axial, stress_stiffness, turn_quarter
from gearfmu.reduction.cyclic.modal import FamilySpin, elastic_modes, family_spin

RADIUS, THICKNESS, HEIGHT, SECTORS = 0.05, 5e-4, 4e-3, 24


@pytest.fixture(scope="module")
def ring() -> SimpleNamespace:
    """A thin ring as `family_spin` takes a body, and the space of its motion in the plane."""
    mesh = ring_sector((1, 2, 2), RADIUS - THICKNESS / 2, RADIUS + THICKNESS / 2, HEIGHT, SECTORS)
    stiffness, mass = hex20.assemble(mesh.nodes, mesh.elements, STEEL)
    space = sector_spaces(Sector(mesh.nodes, mesh.elements, stiffness, mass, SECTORS, mesh.cut_minus, mesh.cut_plus))[0]
    grown = growth(space, mesh.nodes, mass)
    stress = stress_stiffness(mesh.nodes, mesh.elements, STEEL, grown)
    return SimpleNamespace(
        teeth=SECTORS, mesh=mesh, mass_matrix=mass, stress_stiffness=stress, growth=grown, space=space
    )


def ring_pair(ring: SimpleNamespace, n: int) -> FamilySpin:
    """The lowest pair of nodal diameter n, in the plane."""
    harmonic = ring.space.harmonic(n)
    _, shapes = lowest_modes(harmonic, 1)
    return family_spin(ring, n, 2, ring.space.to_nodes @ harmonic.expand(shapes * np.sqrt(2 / SECTORS)))


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_thin_ring_splits_as_bryan_says(ring: SimpleNamespace, n: int) -> None:
    """In its own axes its pairs move at σ = −gΩ ± √(ω² + (B + g²)Ω²), g = 2n/(n² + 1), B + g² = n²(n² − 1)²/(n² + 1)²:
    the patterns lag behind the ring."""
    pair = ring_pair(ring, n)
    g = -pair.coupling[0, 0].imag
    print(n, g / (2 * n / (n**2 + 1)) - 1, (pair.stiffening[0] + g**2) / (n * (n**2 - 1) / (n**2 + 1)) ** 2 - 1)
    assert abs(pair.coupling[0, 0].real) < 1e-12
    assert g == pytest.approx(2 * n / (n**2 + 1), rel=1e-3)
    assert pair.stiffening[0] + g**2 == pytest.approx((n * (n**2 - 1) / (n**2 + 1)) ** 2, rel=5e-3)


def test_a_thin_ring_grows_by_its_hoop_stress(ring: SimpleNamespace) -> None:
    """ρ R³ / E per square of the speed; the elements are ν t/R softer across."""
    radial = (ring.growth.reshape(-1, 3) * leave_axial(ring.mesh.nodes.ravel()).reshape(-1, 3)).sum(axis=1)
    radial /= np.hypot(*ring.mesh.nodes[:, :2].T)
    assert radial == pytest.approx(STEEL.density * RADIUS**3 / STEEL.youngs_modulus, rel=1e-2)


def test_the_modes_of_a_gear_turn_as_those_of_its_whole_model() -> None:
    """Frequencies in turning axes at a tenth of the lowest one, from sectors and from the whole gear: the 16 lowest
    modes of each, coupled and stiffened."""
    body, whole = small_gear.coarse(), small_gear.whole(small_gear.coarse())
    modes = elastic_modes(body, 16)
    count = modes.frequency.size
    squared, shapes = lowest_modes(whole.free, count)
    assert np.sqrt(squared) == pytest.approx(2 * np.pi * modes.frequency, rel=1e-6)
    speed = 0.1 * np.sqrt(squared[0])
    coupling = shapes.T @ (whole.free.mass_matrix @ turn_quarter(shapes))
    by_sectors = whirling(squared, modes.spin.coupling, speed)
    assert by_sectors == pytest.approx(whirling(squared, coupling, speed), rel=1e-6)
    split = np.abs(by_sectors / np.sort(np.sqrt(squared)) - 1)
    assert 0.01 < split.max() < 0.1


def whirling(squared: np.ndarray, coupling: np.ndarray, speed: float) -> np.ndarray:
    """(n,) rad/s, ascending: q̈ + 2Ω G q̇ + ω² q = 0."""
    n = squared.size
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(squared), -2 * speed * coupling]])
    return np.sort(np.abs(sl.eigvals(matrix).imag))[::2]


def test_no_mode_feels_euler_s_acceleration() -> None:
    """∫ρ φ · (e_z × X) vanishes for every pattern: an angular acceleration of the body meets its moment of inertia and
    nothing else, its distributed load is that of the inertia relief."""
    body = small_gear.coarse()
    load = body.mass_matrix @ turn_quarter(body.mesh.nodes.ravel())
    for space in body.spaces:
        harmonic = space.harmonic(0)
        squared, shapes = lowest_modes(harmonic, 6)
        fields = space.to_nodes @ harmonic.expand(shapes)
        scale = np.sqrt(body.inertia[5, 5] / body.teeth)
        assert np.abs(load @ fields).max() < 1e-9 * scale
