"""Stiffness and mass matrices made by other programs.

Read: Matrix Market (.mtx), SciPy sparse or dense (.npz, .npy), CalculiX matrix storage (.sti, .mas with .dof), Nastran
DMIG cards (.pch, .dmig) and ASCII OUTPUT4 (.op4; dense, sparse and big-matrix form, real). Not read: binary OUTPUT4
(ask for `ASCII`/`FORMATTED`), OP2, complex matrices, Abaqus .mtx in its own layouts (write `MATRIX INPUT` as coordinate
text), Ansys .full and Harwell–Boeing.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem.bulk_data import mesh_text
from gearfmu.fem.nastran_matrices import Labelled, from_triangle, read_dmig, read_op4

_SYMMETRIC = 1e-9  # largest relative asymmetry
READ = ".mtx, .npz, .npy, .sti/.mas (CalculiX), .pch/.dmig (Nastran DMIG), .op4 (ASCII)"


def read_matrix(path: Path, unknowns: np.ndarray | None, labels: np.ndarray) -> sp.csr_array:
    """A symmetric matrix over the nodes of a mesh, unknown 3·node + component, in the file's units.

    unknowns : (n, 2) node label and component 0 … 2 of each row; None when rows are x, y, z of node after node.
    labels : (N,) node numbers of the mesh. Raises MeshError for what cannot be read, is not symmetric, or misses a
    node.
    """
    matrix, unknowns = _square(path, unknowns)
    if unknowns is not None:
        return _sorted(path, matrix, unknowns, labels)
    if matrix.shape[0] != 3 * len(labels):
        raise MeshError(
            f"{path}: {matrix.shape[0]} rows, but the mesh has {len(labels)} nodes, that is {3 * len(labels)} "
            "unknowns: give `unknowns` when rows were left out or sorted differently"
        )
    return matrix


def read_labelled(path: Path, unknowns: np.ndarray | None) -> Labelled:
    """A symmetric matrix with the label of every row, in the file's units.

    unknowns : (n, 2) label and component 0 … 5 of each row, −1 of a modal coordinate; None where the file says so
    itself (DMIG). Raises MeshError for what cannot be read, is not symmetric, or has no labels."""
    matrix, unknowns = _square(path, unknowns)
    if unknowns is None:
        raise MeshError(f"{path}: give `unknowns`: what each of its {matrix.shape[0]} rows is stands in no such matrix")
    return Labelled(matrix, unknowns)


def _square(path: Path, unknowns: np.ndarray | None) -> tuple[sp.csr_array, np.ndarray | None]:
    """A symmetric matrix and what its rows are, as the file says itself or else as `unknowns` do."""
    found = _read(path)
    own, unknowns = (found.matrix, found.unknowns) if isinstance(found, Labelled) else (found, unknowns)
    matrix = _symmetric(path, own)
    if unknowns is not None and len(unknowns) != (rows := matrix.shape[0]):
        raise MeshError(f"{path}: {rows} rows, but `unknowns` names {len(unknowns)}: they belong to other runs")
    return matrix, unknowns


def read_recovery(path: Path, rows: np.ndarray, columns: int) -> sp.csr_array:
    """A matrix (r, columns) of displacements of further points, in the file's units. rows : (r, 2) label and component
    of each. Raises MeshError."""
    found = _read(path)
    if isinstance(found, Labelled):
        raise MeshError(f"{path}: a DMIG matrix is read as square: write recovery as .op4, .mtx or .npz")
    if found.shape != (len(rows), columns):
        wanted = f"{len(rows)} rows as `recovered`, {columns} columns as the superelement"
        raise MeshError(f"{path}: {found.shape[0]} rows and {found.shape[1]} columns, expected {wanted}")
    return found


def read_unknowns(path: Path) -> np.ndarray:
    """Node label and component (n, 2) of each row from a CalculiX .dof file ("17.3"). Raises MeshError."""
    try:
        pairs = [word.split(".") for word in mesh_text(path).split()]
        return np.array([(int(node), int(component) - 1) for node, component in pairs])
    except ValueError:
        raise MeshError(f"{path}: expected lines such as 17.3, node and direction: is it the .dof file?") from None


def _read(path: Path) -> sp.csr_array | Labelled:
    suffix = path.suffix.lower()
    readers = {
        ".mtx": lambda: sp.csr_array(scipy.io.mmread(path)),
        ".npz": lambda: _from_npz(path),
        ".npy": lambda: sp.csr_array(np.load(path, allow_pickle=False)),
        ".sti": lambda: _from_triangle(path),
        ".mas": lambda: _from_triangle(path),
        ".pch": lambda: read_dmig(path),
        ".dmig": lambda: read_dmig(path),
        ".op4": lambda: read_op4(path),
    }
    if suffix not in readers:
        raise MeshError(f"{path}: '{suffix}' is no matrix file that is read here: {READ}")
    try:
        return readers[suffix]()
    except OSError as error:
        raise MeshError(f"{path}: the file cannot be read ({error.strerror or error}): check the path") from None
    except (ValueError, TypeError, KeyError, IndexError) as error:
        reason = " ".join(str(error).split())
        raise MeshError(f"{path}: no sound {suffix} matrix ({reason}): write it again") from None


def _from_npz(path: Path) -> sp.csr_array:
    with np.load(path, allow_pickle=False) as file:
        names = list(file.files)
        if "format" not in names:
            if len(names) != 1:
                raise ValueError(
                    f"holds {', '.join(names)}; expected one matrix, or one written by scipy.sparse.save_npz"
                )
            return sp.csr_array(file[names[0]])
    return sp.csr_array(sp.load_npz(path))


def _from_triangle(path: Path) -> sp.csr_array:
    """Lines "row column value" of one triangle, as CalculiX writes them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = np.loadtxt(path, ndmin=2)
    if table.size == 0 or table.shape[1] != 3:
        raise ValueError("expected lines with row, column and value")
    rows, columns = table[:, 0].astype(int) - 1, table[:, 1].astype(int) - 1
    size = int(max(rows.max(), columns.max())) + 1
    return from_triangle(sp.coo_array((table[:, 2], (rows, columns)), (size, size)).tocsr())


def _symmetric(path: Path, matrix: sp.csr_array) -> sp.csr_array:
    if matrix.shape[0] != matrix.shape[1]:
        raise MeshError(
            f"{path}: the matrix has {matrix.shape[0]} rows and {matrix.shape[1]} columns: it must be square"
        )
    if np.iscomplexobj(matrix.data) or not np.isfinite(matrix.data).all():
        raise MeshError(f"{path}: the matrix holds complex numbers or numbers that are not finite: it must be real")
    largest = np.abs(matrix.data).max(initial=0.0)
    if np.abs((matrix - matrix.T).data).max(initial=0.0) > _SYMMETRIC * largest:
        raise MeshError(f"{path}: the matrix is not symmetric: write both halves, or one half in a symmetric format")
    return sp.csr_array(0.5 * (matrix + matrix.T))


def _sorted(path: Path, matrix: sp.csr_array, unknowns: np.ndarray, labels: np.ndarray) -> sp.csr_array:
    order = np.argsort(labels)
    place = np.searchsorted(labels[order], unknowns[:, 0]).clip(max=len(labels) - 1)
    node = order[place]
    there = (labels[node] == unknowns[:, 0]) & (unknowns[:, 1] >= 0) & (unknowns[:, 1] < 3)
    if not there.all():
        label, component = unknowns[np.flatnonzero(~there)[0]]
        raise MeshError(
            f"{path}: row {label}.{component + 1} is no displacement of a node of the mesh: export solids only"
        )
    target = 3 * node + unknowns[:, 1]
    missing = np.setdiff1d(np.arange(3 * len(labels)), target)
    if len(missing):
        raise MeshError(
            f"{path}: {len(missing)} unknowns of the mesh have no row (first: node {labels[missing[0] // 3]}): export "
            "the free body, without supports and constraints"
        )
    entries = matrix.tocoo()
    size = 3 * len(labels)
    return sp.csr_array(sp.coo_array((entries.data, (target[entries.row], target[entries.col])), (size, size)).tocsr())
