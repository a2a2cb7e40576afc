"""Two methods, one answer: the reduction on one sector against the whole body without any symmetry, spur and helical
gears and rings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import small_gear
import small_ring
from blocks import COUNT, modes_of
from sections import section
from small_gear import BETA, GEAR, WIDTH, Whole, whole
from turned_rows import on_tooth

from gearfmu.fem.coupling import rigid_modes
from gearfmu.geometry.gear import GearGeometry, InternalGearGeometry
from gearfmu.geometry.plane import about_z
from gearfmu.reduction.couplings import Elements, averaging
from gearfmu.reduction.cyclic.flank import flank_loads
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import Modes, elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics, static_tables
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.toothed import toothed_full_order


@dataclass(frozen=True, eq=False)
class Case:
    """A body by one sector, its shape, and what is made of both methods."""

    make: Callable[[float], SectorBody]
    beta: float
    shape: GearGeometry | InternalGearGeometry

    @property
    def sector(self) -> SectorBody:
        return self.make(self.beta)

    @property
    def whole(self) -> Whole:
        return whole(self.sector)

    @cached_property
    def modes(self) -> Modes:
        return elastic_modes(self.sector, COUNT)

    @cached_property
    def statics(self) -> Statics:
        return static_tables(self.sector, [0, 5])

    def rows(self) -> np.ndarray:
        """Of all loads of tooth 0 in the modes, ordered as in `load_matrix`."""
        return np.vstack([self.modes.flank_rows, self.modes.patch_rows, self.modes.tangent_rows])


BODIES = {
    "spur gear": Case(small_gear.coarse, 0.0, GEAR),
    "helical gear": Case(small_gear.coarse, BETA, small_gear.gear(BETA)),
    "spur ring": Case(small_ring.coarse, 0.0, small_ring.GEOMETRY),
    "helical ring": Case(small_ring.coarse, BETA, small_ring.geometry(BETA)),
}
SPUR = BODIES["spur gear"]


@pytest.fixture(scope="module", params=BODIES)
def case(request: pytest.FixtureRequest) -> Case:
    return BODIES[request.param]


def matrix(table: np.ndarray) -> np.ndarray:
    """A table (2, 2, R, R, A, A) between two teeth as a matrix over (side, roll, function)."""
    size = table.shape[0] * table.shape[2] * table.shape[4]
    return table.transpose(0, 2, 4, 1, 3, 5).reshape(size, size)


def test_loads_of_the_sector_are_those_of_the_whole_body(case: Case) -> None:
    """Along the normal and along the profile, made on the mesh of the whole body."""
    full, own = case.sector.mesh.full(), case.sector.flank
    loads = case.whole.loads(0)
    for direction, first in ((own.normal, 0), (own.tangent, case.sector.profile_loads)):
        made = [flank_loads(full.nodes, full.flank[s].quads, own, s, case.sector.points, direction) for s in (0, 1)]
        exact = np.concatenate(made).reshape(case.sector.flank_count, -1)
        assert np.abs(loads[first : first + len(exact)] - exact).max() < 1e-15


def test_frequencies_of_one_sector_are_those_of_the_whole_body(case: Case) -> None:
    squared, _ = modes_of(case.whole.free)
    own = case.modes.frequency
    assert np.allclose(own, (np.sqrt(squared) / (2 * np.pi))[: len(own)], rtol=1e-8)
    assert bool(case.shape.beta) == np.all(case.modes.parity == 0)


def test_rows_of_flanks_profiles_patches_and_bore_are_those_of_the_whole_body(case: Case) -> None:
    """Sums of N Nᵀ over each frequency cluster do not depend on how pairs are turned: tooth 0, bore, and teeth by
    formula."""
    _, shapes = modes_of(case.whole.free)
    omega, held = 2 * np.pi * case.modes.frequency, case.whole.held_rows() @ shapes
    ends = np.flatnonzero(np.diff(omega) / omega[:-1] > 1e-6) + 1
    reduced_0 = np.vstack([case.rows(), case.modes.bore_rows])
    full_0 = np.vstack([case.whole.loads(0) @ shapes, held])
    for tooth in (0, 1, 5, 11):
        reduced = np.vstack([on_tooth(case.modes, case.rows(), tooth, case.shape.z), case.modes.bore_rows])
        full = np.vstack([case.whole.loads(tooth) @ shapes, held])
        for cluster in np.split(np.arange(len(omega)), ends)[:-1]:
            mine, theirs = reduced_0[:, cluster] @ reduced[:, cluster].T, full_0[:, cluster] @ full[:, cluster].T
            assert np.abs(mine - theirs).max() < 1e-6 * np.abs(reduced_0).max() ** 2


def test_static_tables_are_those_of_the_whole_body(case: Case) -> None:
    """All tooth offsets along the normal and to patches of the rim, the own tooth along the profile, signs and all, the
    bore or rim with all six loads."""
    every, points, profile = len(case.whole.loads(0)), case.sector.flank_count, case.sector.profile_loads
    loads = np.vstack([*(case.whole.loads(tooth) for tooth in range(case.shape.z)), case.whole.held_rows()])
    own = np.vstack([case.whole.loads(0), case.whole.held_rows()])
    full = case.whole.free.flexibility(own.T).T @ loads.T
    statics, scale = case.statics, np.abs(full[:every, :-6]).max()
    for tooth in range(case.shape.z):
        there = full[:profile, tooth * every : tooth * every + profile]
        assert np.abs(matrix(statics.static_ff[:, :, tooth]) - there[:points, :points]).max() < 1e-9 * scale
        across = statics.static_fp[:, tooth].reshape(points, -1)
        assert np.abs(across - there[:points, points:]).max(initial=0.0) < 1e-9 * scale
        if case.sector.internal:
            assert np.abs(statics.static_pp[tooth] - there[points:, points:]).max() < 1e-9 * scale
    assert np.abs(matrix(statics.static_nt) - full[:points, profile:every]).max() < 1e-9 * scale
    assert np.abs(matrix(statics.static_tt) - full[profile:every, profile:every]).max() < 1e-9 * scale
    held = statics.static_fb.reshape(points, 6)
    assert np.abs(held - full[:points, -6:]).max() < 1e-9 * np.abs(held).max()
    assert np.abs(statics.static_bb - full[-6:, -6:]).max() < 1e-9 * np.abs(statics.static_bb).max()


def test_inertia_is_that_of_the_whole_body_and_of_its_section(case: Case) -> None:
    fields = rigid_modes(case.whole.elements.nodes)
    inertia = fields.T @ case.whole.free.mass(fields)
    assert np.allclose(case.sector.inertia, inertia, rtol=1e-10, atol=1e-10 * np.abs(inertia).max())
    area, moment = section(case.shape)
    size = case.sector.material.density * case.shape.z * WIDTH
    assert case.sector.inertia[0, 0] == pytest.approx(size * area, rel=2e-3)
    assert case.sector.inertia[5, 5] == pytest.approx(size * moment, rel=3e-3)


# ---- of the spur gear ------------------------------------------------------------------------------------------------
def test_modes_are_in_pairs_sorted_and_of_the_parity_their_rows_show() -> None:
    modes = SPUR.modes
    assert np.all(np.diff(modes.frequency) >= 0)
    first = np.flatnonzero(modes.part == 1)
    assert np.array_equal(modes.part[first + 1], np.full(len(first), 2))
    assert np.array_equal(modes.frequency[first], modes.frequency[first + 1])
    single = modes.part == 0
    assert np.all((modes.nodal_diameter[single] == 0) | (2 * modes.nodal_diameter[single] == GEAR.z))
    rows = np.abs(modes.flank_rows.reshape(2, 4, 3, -1)).max(axis=(0, 1))
    assert np.all(rows[1, modes.parity == 1] == 0)
    assert np.all(rows[[0, 2]][:, modes.parity == -1] == 0)


def test_pictures_are_the_static_displacement_of_every_sector() -> None:
    full = SPUR.whole.free.flexibility(SPUR.whole.loads(0)[[0, 5]].T)
    for tooth in (0, 3, 11):
        for load in (0, 1):
            mine = SPUR.statics.pictures[load, tooth].reshape(-1, 3) @ about_z(2 * np.pi * tooth / GEAR.z).T
            theirs = full[:, load].reshape(-1, 3)[SPUR.sector.mesh.sector_nodes(tooth)]
            assert np.abs(mine - theirs).max() < 1e-9 * np.abs(full).max()


def test_frf_error_is_that_of_a_direct_solution_of_the_whole_gear() -> None:
    """Reference by Taylor series = reference by a direct solution of all equations, at the end of the band and
    beyond."""
    case, modes, free = FrfCase(damping_ratio=0.01, cut=150e3, length=GEAR.r), SPUR.modes, SPUR.whole.free
    found = frf_error(SPUR.sector, modes, SPUR.statics, case)
    flat = np.arange(SPUR.sector.flank_count).reshape(2, 4, 3)[:, [0, 2, 3], :2].ravel()
    rows = np.vstack([SPUR.whole.loads(0)[flat], SPUR.whole.held_rows()])
    rows[-3:] *= case.length
    kept = modes.frequency < found.cut
    near = np.vstack([modes.flank_rows[flat], modes.bore_rows])[:, kept]
    near[-3:] *= case.length
    static = rows @ free.flexibility(rows.T)
    rigid = rows @ free.rigid
    assert found.size == kept.sum()
    for line in (60, -1):
        squared = (2 * np.pi * found.frequency[line]) ** 2
        s = squared / (1 + 2j * case.damping_ratio)
        pencil = sp.csc_matrix(free.stiffness * (1 + 2j * case.damping_ratio) - squared * free.mass_matrix)
        elastic = rows @ free.gauge(spl.splu(pencil, "MMD_AT_PLUS_A").solve(free.balance(rows.T).astype(complex)))
        full = elastic - rigid @ rigid.T / squared
        w2 = (2 * np.pi * modes.frequency[kept]) ** 2
        reduced = ((near / (w2 - s)) @ near.T + static - (near / w2) @ near.T) * s / squared - rigid @ rigid.T / squared
        held = [h[:-6, :-6] - h[:-6, -6:] @ np.linalg.solve(h[-6:, -6:], h[-6:, :-6]) for h in (full, reduced)]
        exact = np.linalg.norm(held[0] - held[1]) / np.linalg.norm(held[0])
        assert found.error[line] == pytest.approx(exact, rel=2e-3, abs=1e-9)
    assert np.all(np.diff(found.error[:50]) > 0)


# ---- of the spur ring on its mounts ----------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def mounted() -> FullOrder:
    return toothed_full_order(small_ring.set_spec().by_file["ring"], small_ring.set_spec().mounts, scale=1.0)


def test_full_order_of_the_mounted_ring_has_the_same_frequencies(mounted: FullOrder) -> None:
    sector, elements = BODIES["spur ring"].sector, BODIES["spur ring"].whole.elements
    assert mounted.size == elements.nodes.size and mounted.rigid.shape[1] == 0 and len(mounted.interfaces) == 24
    difference = abs(mounted.stiffness - on_springs(sector, elements)).max() / abs(mounted.stiffness).max()
    assert difference < 1e-14


def on_springs(sector: SectorBody, elements: Elements) -> sp.csr_array:
    """K of the whole ring with its six springs."""
    mesh = sector.mesh
    patches = [mesh.sector_nodes(4 * mount)[mesh.sets["rim"]] for mount in range(6)]
    rows = sp.vstack([averaging(elements, own, elements.nodes[own].mean(axis=0))[:3] for own in patches])
    return sp.csr_array(elements.stiffness + small_ring.MOUNTS.stiffness * (rows.T @ rows))


def test_input_nodes_lie_in_the_middle_of_their_flanks(mounted: FullOrder) -> None:
    ring, points = small_ring.GEOMETRY, np.array([i.point for i in mounted.interfaces])
    radius, angle = np.hypot(points[:, 0], points[:, 1]), np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.ptp(radius) < 1e-12 and np.diff(angle) == pytest.approx(2 * np.pi / ring.z) and np.all(points[:, 2] == 0)
    roll = np.sqrt(radius[0] ** 2 - ring.r_b**2)
    assert roll**2 == pytest.approx(0.5 * (ring.s_form**2 + ring.s_tip**2), rel=1e-9)
    for interface in mounted.interfaces[:3]:
        assert interface.rows.toarray().sum() == 3 and interface.components == ("ux", "uy", "uz")
