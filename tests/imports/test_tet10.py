"""Ten-node tetrahedra: what quadratic elements must do exactly, and how fast they converge."""

from __future__ import annotations

import numpy as np
import pytest
from blocks import free_body
from decks import STEEL, brick

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, averaging_rows_uniform, rigid_fields, rigid_modes
from gearfmu.fem.lanczos import lowest_modes


@pytest.fixture(scope="module")
def bar() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    nodes, cells = brick("tetra10", (3, 2, 2), (0.03, 0.01, 0.012))
    return nodes, {"tetra10": cells}


def test_rigid_motion_stretch_and_pure_bending_are_exact(bar) -> None:
    """Pure bending is quadratic in the coordinates: no force inside, the couple at the ends."""
    nodes, elements = bar
    stiffness, mass = solids.assemble(nodes, elements, STEEL)
    scale = np.abs(stiffness).max()
    assert np.abs(stiffness @ rigid_modes(nodes)).max() < 1e-9 * scale * 0.03
    fields = rigid_modes(nodes)
    inertia = fields.T @ (mass @ fields)
    assert inertia[0, 0] == pytest.approx(7850 * 3.6e-6, rel=1e-12)
    assert inertia[5, 5] == pytest.approx(7850 * 3.6e-6 * (0.03**2 + 0.01**2) / 3, rel=1e-12)
    x, y, z = nodes.T
    y = y - 0.005
    z = z - 0.006
    nu, curvature = 0.3, 0.1
    bent = curvature * np.column_stack([x * y, -(x**2) / 2 - nu * (y**2 - z**2) / 2, -nu * y * z])
    force = (stiffness @ bent.ravel()).reshape(-1, 3)
    inner = (x > 1e-9) & (x < 0.03 - 1e-9)
    end = x > 0.03 - 1e-9
    assert np.abs(force[inner]).max() < 1e-9 * np.abs(force).max()
    couple = force[end, 0] @ y[end]
    assert couple == pytest.approx(206e9 * curvature * 0.012 * 0.01**3 / 12, rel=1e-9)


def test_frequencies_converge_with_the_fourth_power() -> None:
    """Free bar, lowest bending mode: against fine hexahedra, the error falls by about 2³ to 2⁴ when elements
    are halved."""
    found = []
    for count in (1, 2):
        nodes, cells = brick("tetra10", (4 * count, count, count), (0.04, 0.01, 0.008))
        body = free_body(*solids.assemble(nodes, {"tetra10": cells}, STEEL), nodes, cells)
        found.append(np.sqrt(lowest_modes(body, 1)[0][0]))
    nodes, cells = brick("hexahedron20", (16, 4, 4), (0.04, 0.01, 0.008))
    body = free_body(*solids.assemble(nodes, {"hexahedron20": cells}, STEEL), nodes, cells)
    exact = np.sqrt(lowest_modes(body, 1)[0][0])
    error = np.array(found) / exact - 1
    print(error)
    assert error[1] < 4e-3 and 6 < error[0] / error[1] < 40


def test_patches_of_triangles_average_like_surfaces(bar) -> None:
    nodes, elements = bar
    faces = solids.boundary(elements).within(np.flatnonzero(nodes[:, 0] == 0))
    assert len(faces.triangles) == 8 and len(faces.quads) == 0
    rows = averaging_rows(nodes, faces)
    motion = np.array([1e-3, -2e-3, 3e-3, 0.01, -0.02, 0.03])
    assert np.allclose(rows @ (rigid_fields(nodes) @ motion).ravel(), motion, rtol=1e-10)
    stretched = np.zeros_like(nodes)
    stretched[:, 0] = (nodes[:, 1] / 0.01) ** 2
    assert (rows @ stretched.ravel())[0] + (rows @ stretched.ravel())[4] * 0.006 - (rows @ stretched.ravel())[
        5
    ] * 0.005 == pytest.approx(1 / 3, rel=1e-9)
    uniform = averaging_rows_uniform(nodes, faces.nodes)
    assert abs((uniform @ stretched.ravel())[0] - (rows @ stretched.ravel())[0]) > 1e-3


def test_an_inverted_tetrahedron_is_refused(bar) -> None:
    nodes, elements = bar
    cells = elements["tetra10"].copy()
    cells[5] = cells[5][[1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    with pytest.raises(MeshError, match="1 elements have a Jacobian determinant"):
        solids.assemble(nodes, {"tetra10": cells}, STEEL)
    assert (solids.jacobian_quality(nodes, cells, "tetra10") <= 0).sum() == 1
