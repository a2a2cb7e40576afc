"""The files of an imported body: a sound mesh along z, ready-made matrices in SI and in the frame of the body, node
sets as interfaces.

A node set is coupled to a master node at the centre of its nodes, rigidly (RBE2: its nodes move as one rigid body and
leave the unknowns) or by averaging (RBE3: the mean motion of the surface, or of the nodes where they span no surface).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, rigid_fields
from gearfmu.fem.hex20 import Material
from gearfmu.fem.matrices import read_matrix, read_unknowns
from gearfmu.fem.mesh_checks import matrix_problems, mesh_problems, speed_problem
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh, read_mesh, repeated_cells
from gearfmu.reduction.couplings import Coupling, Elements
from gearfmu.stagefile.tables.imported import FilesSpec

Matrices: TypeAlias = tuple[sp.csr_array, sp.csr_array]
"""Stiffness (3N, 3N), N/m, and mass, kg, over the nodes of a mesh: unknown 3·node + component."""


def elements_of(mesh: ImportedMesh, matrices: Matrices | None, material: Material) -> Elements:
    """Finite elements of a mesh with ready-made matrices, or without these those of our own elements."""
    own = matrices or solids.assemble(mesh.nodes, mesh.elements, material)
    return Elements(mesh.nodes, repeated_cells(mesh.elements), *own)


def set_coupling(
    mesh: ImportedMesh,
    faces: Faces,
    node_set: str,
    kind: str = "averaging",
    point: np.ndarray | None = None,
    name: str = "",
) -> Coupling:
    """A node set of the file as an interface, called `name` or like the set.

    faces : the boundary of the mesh. kind : "averaging" or "rigid". point : (3,) m, of its master node (None: mean of
    its nodes). MeshError for a set that is missing, empty, or in one line.
    """
    members = mesh.node_set(node_set)
    point = mesh.nodes[members].mean(axis=0) if point is None else point
    _spanned(mesh, members, node_set)
    rows = None
    if kind == "averaging":
        own, about = faces.within(members), mesh.nodes - point
        if len(own):
            rows = sp.csr_array(averaging_rows(about, own))
    return Coupling(name or node_set, kind, members, point, rows)


def _spanned(mesh: ImportedMesh, members: np.ndarray, name: str) -> None:
    points = mesh.nodes[members] - mesh.nodes[members].mean(axis=0)
    fields = rigid_fields(points / max(np.abs(points).max(), 1e-300)).reshape(-1, 6)
    if np.linalg.matrix_rank(fields, tol=1e-6) < 6:
        raise MeshError(
            f"{mesh.source}: the {len(members)} nodes of '{name}' lie in one line: a master node needs three "
            "that do not"
        )


_AXES = {"x": [1, 2, 0], "y": [2, 0, 1], "z": [0, 1, 2]}


def sound_mesh(source: FilesSpec) -> ImportedMesh:
    """The mesh of a FilesSpec in metres, its axis along z. MeshError lists its faults."""
    file = Path(source.file)
    mesh = read_mesh(file, source.length, tuple(source.ignore))
    mesh = replace(mesh, nodes=mesh.nodes[:, _AXES[source.axis]])
    if problems := mesh_problems(mesh.nodes, mesh.elements, mesh.labels):
        raise MeshError(f"{file}: " + "; ".join(problems))
    return mesh


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """MeshErrors begin with the name of a file: this one, when they name none beside it."""
    try:
        yield
    except MeshError as error:
        raise MeshError(str(error) if str(error).startswith(str(file.parent)) else f"{file}: {error}") from error


def mesh_facts(mesh: ImportedMesh) -> dict[str, Any]:
    """Plain facts about an imported mesh: sizes and quality of its elements."""
    quality = np.concatenate(
        [solids.jacobian_quality(mesh.nodes, block, kind) for kind, block in mesh.elements.items()]
    )
    return {
        "file": mesh.source.name,
        "nodes": len(mesh.nodes),
        "elements": {kind: len(block) for kind, block in mesh.elements.items()},
        "raised_to_quadratic": mesh.raised,
        "scaled_jacobian_min": float(quality.min()),
        "scaled_jacobian_mean": float(quality.mean()),
    }


def whole_facts(mesh: ImportedMesh, size: int) -> dict[str, Any]:
    """`mesh_facts` of a body of `size` unknowns that is reduced as a whole."""
    return mesh_facts(mesh) | {"method": "whole body", "dof_body": size, "dof_sector": size, "teeth": 1}


def ready_matrices(source: FilesSpec, mesh: ImportedMesh, turn: np.ndarray, material: Material) -> Matrices | None:
    """Ready-made matrices of a FilesSpec, checked against mesh and material; None without files.

    mesh : in the frame of the body. turn (3, 3) : from directions along z (`sound_mesh`) to those of that frame.
    MeshError for matrices that are not of this mesh, this material, these units, or not of a free body.
    """
    if not source.stiffness:
        return None
    if mesh.raised:
        raise MeshError("matrices of linear elements (hex8) do not go with quadratic faces: mesh with C3D20 or C3D10")
    unknowns = read_unknowns(Path(source.unknowns)) if source.unknowns else None
    units = source.force_unit / source.length, source.mass_unit
    node_turn = sp.csr_array(turn @ np.eye(3)[_AXES[source.axis]])
    turned = sp.kron(sp.identity(len(mesh.nodes)), node_turn, format="csr")
    stiffness, mass = (
        sp.csr_array(turned @ (factor * read_matrix(Path(name), unknowns, mesh.labels)) @ turned.T)
        for factor, name in zip(units, (source.stiffness, source.mass), strict=True)
    )
    own = solids.assemble(mesh.nodes, mesh.elements, material)[1]
    problems = matrix_problems(stiffness, mass, mesh.nodes, float(own.sum()) / 3)
    if not problems:
        speed = np.sqrt(material.youngs_modulus / material.density)
        problems = speed_problem(stiffness, mass, mesh.nodes, speed)
    if problems:
        raise MeshError("; ".join(problems))
    return stiffness, mass
