"""A carrier made elsewhere before reduction: its mesh in the set's frame, its bore and bolts as node sets.

A carrier has no flanks by which it could be placed. It must lie where the set has it, and that is checked: the axes of
bore and bolts, each found as the circle that fits its nodes best (Kåsa, IEEE Trans. Instrum. Meas. 25 (1976)).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.geometry.mesh import CarrierGeometry
from gearfmu.reduction.couplings import full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.files import elements_of, naming, ready_matrices, set_coupling, sound_mesh, whole_facts
from gearfmu.reduction.memory import CARRIER_FACTORS, MESH_COARSER, require_memory, whole_need
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry

_OFF = 2e-3  # of the bolt circle's radius: how far an axis may lie from where the stage file has it


def imported_carrier(carrier: CarrierBody) -> tuple[FullOrder, dict[str, Any]]:
    """The imported carrier of a planetary set before reduction, and plain facts about its mesh: interfaces bolt0 … and
    bore, each coupled as the file says.

    Masters lie on the bolts' axes at z = 0 and on the set's axis in the middle of the bore. MeshError lists every node
    set that does not lie where the set has it, and says what is wrong with mesh or matrices.
    """
    geometry, source = carrier_geometry(carrier), carrier.imported
    assert source is not None
    mesh = sound_mesh(source)
    with naming(Path(source.file)):
        require_memory(whole_need(mesh.nodes.size, 3 * carrier.modes, CARRIER_FACTORS), MESH_COARSER)
        names = {f"bolt{k}": name for k, name in enumerate(source.bolts)} | {"bore": source.bore}
        members = {interface: mesh.node_set(name) for interface, name in names.items()}
        points = _points(mesh, members, names, geometry)
        matrices = ready_matrices(source, mesh, np.eye(3), carrier.material)
        faces = solids.boundary(mesh.elements)
        couplings = [set_coupling(mesh, faces, names[i], carrier.coupling_of(i), points[i], i) for i in names]
        body = elements_of(mesh, matrices, carrier.material)
        full = full_order("carrier", body, couplings, ("bore",), geometry.a)
    return full, whole_facts(mesh, full.size)


def _points(
    mesh: ImportedMesh, members: dict[str, np.ndarray], names: dict[str, str], geometry: CarrierGeometry
) -> dict[str, np.ndarray]:
    """Where the masters are: bolts as the set has them, the bore in its own middle. MeshError for sets elsewhere."""
    points, problems = {}, []
    for interface, own in members.items():
        nodes = mesh.nodes[own]
        low, high = nodes[:, 2].min(), nodes[:, 2].max()
        bolt = interface != "bore"
        points[interface] = geometry.bolt_axis(int(interface[4:])) if bolt else np.array([0, 0, 0.5 * (low + high)])
        centre, meant = circle_centre(nodes[:, :2]), points[interface][:2]
        if np.linalg.norm(centre - meant) > _OFF * geometry.a:
            where = " and ".join(f"({1e3 * x:.4g}, {1e3 * y:.4g})" for x, y in (centre, meant))
            whose = f"'{names[interface]}' ({interface})"
            problems.append(f"the axis of {whose} and that of the set lie apart, at {where} mm")
        elif bolt and not low < 0 < high:
            span = f"z = {1e3 * low:.4g} … {1e3 * high:.4g} mm"
            problems.append(f"'{names[interface]}' ({interface}) at {span} is not where the planet sits, about z = 0")
    if problems:
        frame = "axis z through the origin, z = 0 at the planets' mid-width, bolt 0 on +x, bolts counter-clockwise"
        raise MeshError("; ".join(problems) + f". Model the carrier in the set's frame: {frame}")
    return points


def circle_centre(points: np.ndarray) -> np.ndarray:
    """(2,) centre of the circle that fits points (P, 2) best; exact for any points of one circle. MeshError for points
    in one line."""
    middle = points.mean(axis=0)
    local = points - middle
    size = max(float(np.abs(local).max()), 1e-300)
    system = np.column_stack([2 * local / size, np.ones(len(local))])
    if np.linalg.matrix_rank(system, tol=1e-6) < 3:
        raise MeshError("the nodes of a bore or bolt lie in one line: name the node set of its surface")
    found = np.linalg.lstsq(system, (local**2).sum(axis=1) / size**2, rcond=None)[0]
    return middle + size * found[:2]
