"""A housing as a body: a closed box on a mesh of its own, six seats and two sensors, from finite elements to a file and
back."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp
from blocks import STEEL, box
from small_body import averaging, direct

from gearfmu.body import Body, bodies, load_body, sound
from gearfmu.body.body import How
from gearfmu.body.layout import entries_of, value_of
from gearfmu.body.store import save_body
from gearfmu.body.whole import whole_body
from gearfmu.fem import hex20, solids
from gearfmu.fem.surface import faces_within
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.full_order import FullOrder, Interface
from gearfmu.reduction.imported.housing import ImportedHousing, Surface, enveloping_surface
from gearfmu.reduction.moments import Size
from gearfmu.reduction.transfer import Judging
from gearfmu.sound import skin_of
from gearfmu.stage.assembly.ground_part import ground_part

CELLS, SIZE = (4, 4, 3), (0.16, 0.12, 0.09)
INNER = tuple(size * (count - 2) / count for size, count in zip(SIZE, CELLS, strict=True))
SENSORS = {"top": (0.04, 0.03, 0.045), "side": (0.08, 0.0, 0.015)}
DAMPING = 0.01


@lru_cache(maxsize=1)
def mesh() -> tuple[np.ndarray, np.ndarray]:
    """Walls one element thick round a void."""
    nodes, cells = box(CELLS, SIZE)
    middle = np.abs(nodes[cells].mean(axis=1))
    walls = cells[np.any(middle > np.array(INNER) / 2, axis=1)]
    used, numbers = np.unique(walls, return_inverse=True)
    return nodes[used], numbers.reshape(-1, 20)


@lru_cache(maxsize=1)
def full() -> tuple[FullOrder, tuple[Interface, ...]]:
    """Finite elements with a seat in the middle of every face, "foot" the one that is held, and the sensors."""
    nodes, cells = mesh()
    body = Elements(nodes, cells, *hex20.assemble(nodes, cells, STEEL))
    couplings = []
    for axis in range(3):
        for side, name in ((-1, f"seat{axis}"), (1, f"seat{axis + 3}")):
            on_face = np.abs(nodes[:, axis] - side * SIZE[axis] / 2) < 1e-9
            others = np.delete(np.abs(nodes), axis, axis=1)
            near = on_face & np.all(others <= np.delete(np.array(SIZE) / 4, axis) * 1.001, axis=1)
            chosen = np.flatnonzero(near)
            own = averaging(name if (axis, side) != (2, -1) else "foot", nodes, chosen)
            couplings.append(Coupling(own.name, own.kind, chosen, own.point, own.rows))
    found = [Coupling(name, "nodes", _nearest(nodes, place), np.array(place)) for name, place in SENSORS.items()]
    order = full_order("box", body, [*couplings, *found], ("foot",), 0.1)
    return _parted(order)


@lru_cache(maxsize=1)
def surface() -> tuple[np.ndarray, np.ndarray, sp.csr_array]:
    """The outside of the box: points, faces of four corners, and the rows of their displacement."""
    nodes, cells = mesh()
    outside = np.flatnonzero(np.any(np.abs(np.abs(nodes) - np.array(SIZE) / 2) < 1e-9, axis=1))
    faces = faces_within(cells, outside).corners
    used, numbers = np.unique(faces, return_inverse=True)
    dofs = (3 * used[:, None] + np.arange(3)).ravel()
    rows = sp.csr_array((np.ones(dofs.size), (np.arange(dofs.size), dofs)), (dofs.size, nodes.size))
    return nodes[used], numbers.reshape(-1, 4), rows


def _nearest(nodes: np.ndarray, place: tuple[float, ...]) -> np.ndarray:
    distance = np.linalg.norm(nodes - place, axis=1)
    assert distance.min() < 1e-9
    return np.array([distance.argmin()])


def _parted(order: FullOrder) -> tuple[FullOrder, tuple[Interface, ...]]:
    """Interfaces that are loaded, and sensors."""
    sensors = tuple(i for i in order.interfaces if i.name in SENSORS)
    return replace(order, interfaces=tuple(i for i in order.interfaces if i.name not in SENSORS)), sensors


@pytest.fixture(scope="module")
def body() -> Body:
    order, sensors = full()
    points, faces, rows = surface()
    seen = ImportedHousing(order, {}, {}, sensors, Surface(points, faces, sp.csr_array((len(points), 0)), 0), rows)
    return whole_body(order, How("1" * 64, "krylov"), Size(150), Judging.over(lines=60, damping_ratio=DAMPING), seen)


def test_mass_and_inertia_are_those_of_a_hollow_box(body: Body) -> None:
    solids = [(STEEL.density * np.prod(size), np.array(size)) for size in (SIZE, INNER)]
    mass = solids[0][0] - solids[1][0]
    assert body.total_mass == pytest.approx(mass, rel=1e-12)
    assert np.abs(body.centre_of_mass).max() < 1e-12
    about = [m / 12 * ((size**2).sum() - size**2) for m, size in solids]
    assert np.diag(body.inertia) == pytest.approx(about[0] - about[1], rel=1e-9)


def test_its_lowest_frequencies_are_those_of_its_finite_elements(body: Body) -> None:
    """In Hz, by a dense eigenvalue problem of the free box; six rigid motions come first."""
    order, _ = full()
    values = sl.eigh(order.stiffness.toarray(), order.mass.toarray(), eigvals_only=True, subset_by_index=[0, 15])
    assert body.frequency[:10] == pytest.approx(np.sqrt(values[6:]) / (2 * np.pi), rel=1e-4)


def test_it_comes_back_from_its_file(body: Body, tmp_path: Path) -> None:
    save_body(body, tmp_path / "box.h5")
    back = load_body(tmp_path / "box.h5")
    for entry in entries_of(body):
        found, exact = value_of(back, entry.field), value_of(body, entry.field)
        step = np.abs(exact).max(axis=(1, 2), keepdims=True) / (2.0 ** (entry.bits - 1) - 1) if entry.bits else 0.0
        assert np.all(np.abs(found - exact) <= 0.5 * step), entry.path
    assert back.name == "box" and back.how == body.how and back.sensors.names == tuple(SENSORS)
    assert [node.name for node in back.nodes] == ["seat0", "seat3", "seat1", "seat4", "foot", "seat5"]
    assert back.flank is None and back.spin is None and back.picture is None and back.error.ground == ("foot",)


def test_without_a_named_skin_the_envelope_radiates() -> None:
    """Of the mesh with a hole through one wall: the box round it. Its points move as boundary nodes near them."""
    nodes, cells = mesh()
    holed = np.delete(cells, np.abs(nodes[cells].mean(axis=1) - [SIZE[0] / 2, 0, 0]).sum(axis=1).argmin(), axis=0)
    own = ImportedMesh(nodes, {"hexahedron20": holed}, {}, np.arange(len(nodes)), Path("box.inp"))
    found = enveloping_surface(own, solids.boundary(own.elements))
    around = skin_of(found.points, found.faces, np.zeros((len(found.points), 3, 0)))
    assert around.volume == pytest.approx(np.prod(SIZE), rel=1e-9)
    away = np.linalg.norm(found.sample @ nodes - found.points, axis=1)
    assert np.median(away) < 0.5 * SIZE[0] / CELLS[0] and away.max() < SIZE[0] / CELLS[0]


def test_its_skin_is_closed_and_moves_with_it(body: Body) -> None:
    """Flux of position through it is three times the volume, of translation nothing; a seat moves like its skin."""
    skin = body.skin
    corners = skin.points[skin.faces].astype(float)
    normal = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert np.einsum("fi,fi->", corners.mean(axis=1), normal) == pytest.approx(3 * np.prod(SIZE), rel=1e-6)
    assert np.abs(normal.sum(axis=0)).max() < 1e-9 * np.abs(normal).sum()
    near = np.abs(skin.points - [SIZE[0] / 2, 0, 0.015]).sum(axis=1).argmin()
    side = slice(3, 6)  # rows of the sensor "side", which lies there
    assert np.allclose(skin.modes[6:, near].T, body.sensors.rows[side], atol=2e-3 * np.abs(body.sensors.rows).max())
    assert np.allclose(skin.modes[:6, near].T, body.sensors.rigid_rows[side], atol=2e-3)


def test_it_follows_its_finite_elements_at_seats_and_sensors(body: Body) -> None:
    """Within 1e-6 of the direct solution of a force on a seat."""
    order, sensors = full()
    assert body.error.max_error < 1e-5
    wide = replace(order, interfaces=(*order.interfaces, *sensors), ground=())
    for frequency in (300.0, 6000.0):
        exact = direct(wide, frequency, DAMPING)[36:, :3]
        square = (2 * np.pi * frequency) ** 2
        modal = 1 / ((2 * np.pi * body.frequency) ** 2 * (1 + 2j * DAMPING) - square)
        ours = (body.sensors.rows * modal) @ body.rows[:3].T
        ours = ours - body.sensors.rigid_rows @ np.linalg.solve(body.mass, body.rigid_rows[:3].T) / square
        assert np.abs(ours - exact).max() < 1e-6 * np.abs(exact).max(), frequency


def test_the_ground_group_takes_it_like_a_carrier(body: Body) -> None:
    """Statics at seats: modes and what is left of the compliance, which is positive."""
    part = ground_part(body)
    rows = part.rows.reshape(36, -1)
    whole = (rows / part.omega**2) @ rows.T + part.residual
    scale = np.sqrt(np.diag(body.static))
    assert np.abs((whole - body.static) / np.outer(scale, scale)).max() < 2e-7
    assert np.linalg.eigvalsh(part.residual / np.outer(scale, scale)).min() > -1e-6
    assert np.array_equal(np.vstack([node.rigid_rows for node in part.nodes]), body.rigid_rows)


def test_the_reduction_keeps_its_radiation_matrix_beside_it(body: Body, tmp_path: Path, monkeypatch: Any) -> None:
    """In steps of 2⁻¹⁵ of √(Rᵢᵢ Rⱼⱼ): power of drawn velocities within .03 dB; none of others."""
    monkeypatch.setattr(bodies, "reduce_body", lambda *_: body)
    monkeypatch.setattr(sound, "PATCHES", 80)
    bodies.make_body(None, "box", tmp_path / "box.h5")
    path = sound.sound_path(tmp_path / "box.h5")
    found, made = sound.kept_radiation(body, path), sound.make_radiation(body, None)
    assert found is not None and 0 < (made.frequency <= made.reach).sum() < len(made.frequency)
    assert (found.reach, found.impedance, found.patches) == (made.reach, made.impedance, 80)
    velocity = np.random.default_rng(2).normal(size=(20, made.gram.shape[0]))
    power = [np.einsum("ti,lij,tj->lt", velocity, own.resistance.astype(float), velocity) for own in (found, made)]
    assert np.abs(10 * np.log10(power[0] / power[1])).max() < 0.03
    assert sound.kept_radiation(body, path, 80) is not None and sound.kept_radiation(body, path, 81) is None
    assert sound.kept_radiation(replace(body, how=How("2" * 64, "krylov")), path) is None
