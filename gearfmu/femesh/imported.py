"""Finite-element meshes made elsewhere: nodes in metres, quadratic solids, node sets.

.inp is read by `abaqus`, .msh of format 4.1 by `gmsh`; .bdf, older .msh and .vtu by meshio, whose traps are turned
into clear errors here. Elements: hex8, hex20, tet10, also mixed. A hex8 is made a hex20 by mid nodes on its straight
edges: a fully integrated hex8 is 4–13 % too stiff in bending (docs/decisions.md); the price is four times the unknowns.
"""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass, replace
from pathlib import Path

import meshio
import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem.bulk_data import nastran_problems, nastran_sets
from gearfmu.fem.hex20 import EDGES
from gearfmu.femesh.abaqus import read_deck
from gearfmu.femesh.gmsh import is_format_4, read_gmsh
from gearfmu.femesh.mesh import LabelledMesh

_SURFACES = ("vertex", "line", "line3", "triangle", "triangle6", "triangle7", "quad", "quad8", "quad9")
_FORMATS = {".bdf": "nastran", ".nas": "nastran", ".dat": "nastran", ".fem": "nastran", ".msh": "gmsh", ".vtu": "vtu"}


@dataclass(frozen=True)
class ImportedMesh:
    """A mesh made elsewhere.

    nodes : (N, 3) m. elements : "hexahedron20" → (E, 20), "tetra10" → (E, 10) node indices in VTK order. sets : name →
    node indices. labels : (N,) node numbers of the file, −1 for nodes added here. raised : number of hex8 that became
    hex20.
    """

    nodes: np.ndarray
    elements: dict[str, np.ndarray]
    sets: dict[str, np.ndarray]
    labels: np.ndarray
    source: Path
    raised: int = 0

    def node_set(self, name: str) -> np.ndarray:
        """Node indices of a set, capitals or not. MeshError names the sets there are."""
        for own, nodes in self.sets.items():
            if own.upper() == name.upper():
                if len(nodes) == 0:
                    raise MeshError(f"{self.source}: the node set '{own}' is empty: give it its nodes")
                return nodes
        there = ", ".join(sorted(self.sets)) or "none"
        raise MeshError(f"{self.source}: there is no node set '{name}'; sets in the file: {there}")


def repeated_cells(elements: dict[str, np.ndarray]) -> np.ndarray:
    """(E, 20) node indices of elements of every kind; one of fewer nodes repeats its first."""
    return np.concatenate([np.hstack([b, np.repeat(b[:, :1], 20 - b.shape[1], axis=1)]) for b in elements.values()])


def read_mesh(path: str | Path, length: float, ignore: tuple[str, ...] = ()) -> ImportedMesh:
    """The mesh of a file. length : m per length unit of the file. ignore : node sets of reference nodes, left out.

    MeshError for a file that cannot be read or would be read wrongly, for elements other than hex8, hex20 and tet10,
    and for nodes that belong to no element.
    """
    source = Path(path)
    suffix = source.suffix.lower()
    if suffix == ".inp":
        nodes, cells, sets, labels = _indexed(read_deck(source), source, "node set")
    elif suffix == ".msh" and source.is_file() and is_format_4(source):
        nodes, cells, sets, labels = _indexed(read_gmsh(source), source, "physical group")
    elif suffix in _FORMATS:
        nodes, cells, sets, labels = _from_meshio(source, _FORMATS[suffix])
    else:
        known = ", ".join([".inp", *_FORMATS])
        raise MeshError(f"{source}: '{suffix}' is no mesh file that is read here: write one of {known}")
    _refuse_others(cells, source)
    mesh = ImportedMesh(length * nodes, cells, sets, labels, source)
    return _raised(_without_loose_nodes(mesh, ignore))


def read_surface(source: Path, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3) m, faces (F, 4) as indices, a triangle repeating its last, and labels (N,) of a surface mesh: the
    node numbers of a .bdf, else 1, 2, … length: m per length unit. MeshError for a file that cannot be read, and for
    one without faces."""
    file_format = _FORMATS.get(source.suffix.lower())
    if file_format is None:
        raise MeshError(
            f"{source}: '{source.suffix}' is no surface that is read here: write one of {', '.join(_FORMATS)}"
        )
    mesh = _read_by_meshio(source, file_format)
    wide = {"quad": [0, 1, 2, 3], "triangle": [0, 1, 2, 2]}
    blocks = [block.data[:, wide[block.type]] for block in mesh.cells if block.type in wide]
    if not blocks:
        raise MeshError(
            f"{source}: no quadrilaterals and no triangles of corner nodes: write the outer surface as these"
        )
    return length * np.asarray(mesh.points, float), np.vstack(blocks), _labels(mesh)


def _indexed(mesh: LabelledMesh, source: Path, set_kind: str) -> tuple:
    """A mesh in node numbers as one in indices. set_kind : what the file calls its sets, for messages."""
    cells = {kind: _numbered(block, mesh.labels, source, f"elements ({kind})") for kind, block in mesh.cells.items()}
    sets = {
        name: np.unique(_numbered(members, mesh.labels, source, f"{set_kind} {name}"))
        for name, members in mesh.sets.items()
    }
    return mesh.nodes, cells, sets, mesh.labels


def _numbered(members: np.ndarray, labels: np.ndarray, source: Path, what: str) -> np.ndarray:
    """Node labels as indices."""
    if len(labels) == 0:
        raise MeshError(f"{source}: there is no node in this file")
    place = np.searchsorted(labels, members).clip(max=len(labels) - 1)
    missing = members[labels[place] != members]
    if len(missing):
        raise MeshError(f"{source}: {what} name node {missing.flat[0]}, which is not in the file")
    return place


def _from_meshio(source: Path, file_format: str) -> tuple:
    mesh = _read_by_meshio(source, file_format)
    cells: dict[str, list[np.ndarray]] = {}
    for block in mesh.cells:
        if block.type not in _SURFACES:
            cells.setdefault(block.type, []).append(block.data)
    points = np.asarray(mesh.points, float)
    labels = _labels(mesh)
    sets = _meshio_sets(mesh)
    if file_format == "nastran":
        order = np.argsort(labels)
        for name, members in nastran_sets(source).items():
            sets[name] = order[_numbered(np.array(members), labels[order], source, f"SET {name}")]
    return points, {kind: np.concatenate(blocks) for kind, blocks in cells.items()}, sets, labels


def _labels(mesh: meshio.Mesh) -> np.ndarray:
    """Node numbers of a file, or 1, 2, …"""
    return np.asarray(getattr(mesh, "points_id", np.arange(1, len(mesh.points) + 1)), int)


def _read_by_meshio(source: Path, file_format: str) -> meshio.Mesh:
    if file_format == "nastran" and (problem := nastran_problems(source)):
        raise MeshError(problem)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(source, file_format)
    except (SystemExit, Exception) as error:  # meshio ends the process at some files and asserts at others
        reason = " ".join(f"{error}".split()) if not isinstance(error, SystemExit) else ""
        reason = reason or " ".join(said.getvalue().split()) or type(error).__name__
        raise MeshError(f"{source}: not a {file_format} file that can be read ({reason})") from None


def _meshio_sets(mesh: meshio.Mesh) -> dict[str, np.ndarray]:
    """Node sets: of physical groups (Gmsh), and point data that are 0 and 1 (.vtu)."""
    sets: dict[str, np.ndarray] = {}
    tags = mesh.cell_data.get("gmsh:physical", [])
    for name, (tag, *_) in mesh.field_data.items():
        nodes = [block.data[np.asarray(own) == tag].ravel() for block, own in zip(mesh.cells, tags, strict=False)]
        if nodes and len(found := np.unique(np.concatenate(nodes))):
            sets.setdefault(name, found)
    for name, values in mesh.point_data.items():
        values = np.asarray(values)
        if values.ndim == 1 and np.isin(values, (0, 1)).all():
            sets[name] = np.flatnonzero(values)
    return sets


def _refuse_others(cells: dict[str, np.ndarray], source: Path) -> None:
    if not cells:
        raise MeshError(f"{source}: there are no solid elements in this file: mesh with hex8, hex20 or tet10")
    remedies = {"tetra": "linear tetrahedra (tet4) are far too stiff: mesh with quadratic ones (tet10, C3D10)"}
    wrong = sorted(set(cells) - {"hexahedron", "hexahedron20", "tetra10"})
    if wrong:
        told = [
            remedies.get(kind, f"elements of type {kind} are not taken: use hex8, hex20 or tet10") for kind in wrong
        ]
        raise MeshError(f"{source}: " + "; ".join(f"{len(cells[k])} {t}" for k, t in zip(wrong, told, strict=True)))


def _without_loose_nodes(mesh: ImportedMesh, ignore: tuple[str, ...]) -> ImportedMesh:
    used = np.zeros(len(mesh.nodes), bool)
    for block in mesh.elements.values():
        used[block] = True
    reference = np.zeros(len(mesh.nodes), bool)
    for name in ignore:
        reference[mesh.node_set(name)] = True
    loose = np.flatnonzero(~used & ~reference)
    if len(loose):
        shown = ", ".join(str(label) for label in mesh.labels[loose[:3]])
        raise MeshError(
            f"{mesh.source}: {len(loose)} nodes belong to no element (first: {shown}): delete them, or name the node "
            "set of your reference nodes in `ignore`"
        )
    new = np.cumsum(used) - 1
    return replace(
        mesh,
        nodes=mesh.nodes[used],
        labels=mesh.labels[used],
        elements={kind: new[block] for kind, block in mesh.elements.items()},
        sets={name: new[nodes[used[nodes]]] for name, nodes in mesh.sets.items()},
    )


def _raised(mesh: ImportedMesh) -> ImportedMesh:
    """The same mesh with every hex8 as a hex20: mid nodes on the straight edges, shared with hex20 neighbours. A set
    that holds both ends of an edge gets its middle too."""
    linear = mesh.elements.get("hexahedron")
    if linear is None:
        return mesh
    edges = np.sort(linear[:, EDGES], axis=2).reshape(-1, 2)
    edges, place = np.unique(edges, axis=0, return_inverse=True)
    number = len(mesh.nodes) + np.arange(len(edges))
    raised = np.hstack([linear, number[place.reshape(len(linear), 12)]])
    own = [mesh.elements[kind] for kind in ("hexahedron20",) if kind in mesh.elements]
    others = {kind: block for kind, block in mesh.elements.items() if kind not in ("hexahedron", "hexahedron20")}
    sets = {}
    for name, nodes in mesh.sets.items():
        member = np.zeros(len(mesh.nodes), bool)
        member[nodes] = True
        sets[name] = np.concatenate([nodes, number[member[edges].all(axis=1)]])
    return replace(
        mesh,
        nodes=np.concatenate([mesh.nodes, mesh.nodes[edges].mean(axis=1)]),
        labels=np.concatenate([mesh.labels, np.full(len(edges), -1)]),
        elements={"hexahedron20": np.concatenate([*own, raised])} | others,
        sets=sets,
        raised=len(linear),
    )
