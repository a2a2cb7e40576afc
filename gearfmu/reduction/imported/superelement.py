"""A housing that another program has reduced: K and M over the motions of its seats and feet and over modal
coordinates, as a FullOrder whose interfaces are rows of the unit matrix.

Its rigid motion follows from the places of its points: R of the points, and of the modal coordinates z whatever leaves
no force on them, K_zz z = −K_zp R; 0 for those of modes with the points held (Craig–Bampton). Sensors and places on
its skin are points of it, or what its recovery gives. Rotations are rad; where one unit of length in the files is L,
forces on points are L⁻¹ times moments (theory, section 7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem.bulk_data import bulk_cards, bulk_number
from gearfmu.fem.coupling import master_rows, rigid_fields
from gearfmu.fem.matrices import read_labelled, read_recovery, read_unknowns
from gearfmu.fem.nastran_matrices import Labelled
from gearfmu.femesh.abaqus import read_deck
from gearfmu.femesh.imported import read_surface
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface
from gearfmu.reduction.imported.housing import ImportedHousing, Surface, enclosed
from gearfmu.stagefile.tables.housing import HousingBody, HousingReducedSpec

MOST = 3000  # unknowns: matrices are full
RIGID = 1e-5  # largest force of a rigid motion, relative to that of the single stiffnesses in it
ALIKE = 1e-3  # by how much the mass along x, y and z may differ
MASSLESS = 1e-12  # least eigenvalue of M, scaled to a unit diagonal
HELD = -1  # component of a modal coordinate


@dataclass(frozen=True)
class _Read:
    """Matrices in SI, place (3,) m of every point, number of every unknown (point, component), and what recovery gives:
    rows (r, N) and their numbers."""

    stiffness: np.ndarray
    mass: np.ndarray
    points: Mapping[int, np.ndarray]
    number: Mapping[tuple[int, int], int]
    recovery: sp.csr_array
    recovered: Mapping[tuple[int, int], int]

    def place(self, label: int, what: str) -> np.ndarray:
        if label not in self.points:
            raise MeshError(f"{what}: point {label} lies in no GRID card and no *NODE of the file: add it")
        return self.points[label]

    def motion(self, label: int, components: range, what: str) -> sp.csr_array:
        """Rows of the components of a point, of the superelement or of its recovery. MeshError for one that is none."""
        size, found = len(self.stiffness), []
        for component in components:
            key = (label, component)
            if key in self.number:
                found.append(sp.csr_array(([1.0], ([0], [self.number[key]])), (1, size)))
            elif key in self.recovered:
                found.append(self.recovery[[self.recovered[key]]])
            else:
                there = ", ".join(map(str, sorted({point for point, c in self.number if c != HELD})[:12]))
                raise MeshError(f"{what}: no row {label}.{component + 1}; points of the superelement: {there}")
        return sp.csr_array(sp.vstack(found))


def superelement(housing: HousingBody) -> ImportedHousing:
    """The superelement of a housing as its finite elements would be. MeshError for points, rows and matrices that do
    not belong together, and for matrices that are no free body's."""
    source = housing.reduced
    assert source is not None
    read = _read(source)
    seats = [_interface(read, source, "seats", *at) for at in source.seats.items()]
    feet = [_interface(read, source, "feet", *at) for at in source.feet.items()]
    rigid = _rigid_motion(read, source)
    _check_mass(read.mass, rigid, source)
    size, sensors = len(read.stiffness), []
    for name, label in source.sensors.items():
        rows = read.motion(label, range(3), f"sensors.{name}")
        sensors.append(Interface(name, rows, COMPONENTS[:3], read.place(label, f"sensors.{name}"), "nodes"))
    surface, skin = _surface(read, source)
    full = FullOrder(
        name=housing.name,
        stiffness=sp.csr_array(read.stiffness),
        mass=sp.csr_array(read.mass),
        rigid=rigid,
        interfaces=(*seats, *feet),
        ground=tuple(source.feet),
        length=max(float(np.linalg.norm(i.point)) for i in (*seats, *feet)),
        cells=np.zeros((1, 1), int),
        node_of_dof=np.zeros(size, int),
    )
    facts = {"file": Path(source.stiffness).name, "method": "superelement", "dof_body": size}
    return ImportedHousing(full, facts, {}, tuple(sensors), surface, skin)


def _interface(read: _Read, source: HousingReducedSpec, group: str, name: str, label: int) -> Interface:
    what, turning = f"{group}.{name}", source.rotations.get(name)
    if turning is None:
        rows = read.motion(label, range(6), what)
    else:
        turned = read.motion(turning, range(3), f"rotations.{name}")
        rows = sp.csr_array(sp.vstack([read.motion(label, range(3), what), turned]))
    return Interface(name, rows, COMPONENTS, read.place(label, what), "rigid")


def _read(source: HousingReducedSpec) -> _Read:
    """The files of a superelement in SI."""
    stated = read_unknowns(Path(source.unknowns)) if source.unknowns else None
    stiffness = read_labelled(Path(source.stiffness), stated)
    mass = read_labelled(Path(source.mass), stated)
    rows = stiffness.unknowns if stated is None else stated
    if len(rows) > MOST:
        remedy = f"reduce to at most {MOST}, or give the mesh with these matrices in the table import"
        raise MeshError(f"{source.stiffness}: {len(rows)} unknowns: {remedy}")
    number = _numbered(rows, source.unknowns)
    turning = set(source.rotations.values())
    arm = np.array([source.length if c >= 3 or point in turning else 1.0 for point, c in number])
    given = _numbered(read_unknowns(Path(source.recovered)) if source.recovered else [], source.recovered)
    recovery = sp.csr_array((0, len(number)))
    if source.recovery:
        recovery = read_recovery(Path(source.recovery), np.array(list(given)), len(number))
    return _Read(
        source.force_unit / source.length * _in_order(stiffness, number, source.stiffness) * np.outer(arm, arm),
        source.mass_unit * _in_order(mass, number, source.mass) * np.outer(arm, arm),
        {label: source.length * point for label, point in read_points(Path(source.file)).items()},
        number,
        sp.csr_array(recovery * arm),
        given,
    )


def _numbered(rows: Sequence[tuple[int, int]] | np.ndarray, file: str) -> dict[tuple[int, int], int]:
    found = {(int(label), int(component)): k for k, (label, component) in enumerate(rows)}
    if len(found) != len(rows):
        raise MeshError(f"{file}: a row of one point and direction comes twice")
    return found


def _in_order(read: Labelled, number: Mapping[tuple[int, int], int], file: str) -> np.ndarray:
    """(N, N) in the order of `number`; what a file leaves out is 0."""
    keys = [(int(label), int(component)) for label, component in read.unknowns]
    if strange := [key for key in keys if key not in number]:
        label, component = strange[0]
        raise MeshError(f"{file}: row {label}.{component + 1} is no row of the stiffness: they belong to other runs")
    place = [number[key] for key in keys]
    found = np.zeros((len(number),) * 2)
    found[np.ix_(place, place)] = read.matrix.toarray()
    return found


def _rigid_motion(read: _Read, source: HousingReducedSpec) -> np.ndarray:
    """(N, 6): translation along and rotation about x, y, z."""
    turned = {label: name for name, label in source.rotations.items()}
    labels = source.seats | source.feet
    fields, known = np.zeros((len(read.number), 6)), np.zeros(len(read.number), bool)
    for (label, component), k in read.number.items():
        if component == HELD:
            continue
        turning = label in turned
        place = read.place(labels[turned[label]] if turning else label, f"row {label}.{component + 1}")
        fields[k], known[k] = master_rows(place)[component + 3 * turning], True
    free = ~known
    if free.any():
        force = read.stiffness[np.ix_(free, known)] @ fields[known]
        fields[free] = -np.linalg.solve(read.stiffness[np.ix_(free, free)], force)
    centred = fields.copy()
    centre = np.mean([read.points[label] for label in labels.values()], axis=0)
    centred[:, 3:] -= fields[:, :3] @ rigid_fields(centre)[:, 3:]
    force, scale = np.abs(read.stiffness @ centred).max(axis=0), (np.abs(read.stiffness) @ np.abs(centred)).max(axis=0)
    if (force > RIGID * scale).any():
        raise MeshError(
            f"{source.stiffness}: rigid motion needs force up to {(force / scale).max():.1e} of the stiffness: reduce "
            "the free body, and check that `unknowns`, the points' places and `length` belong to it"
        )
    return fields


def _check_mass(mass: np.ndarray, rigid: np.ndarray, source: HousingReducedSpec) -> None:
    along = np.einsum("ik,ij,jk->k", rigid[:, :3], mass, rigid[:, :3])
    if along.min() <= 0 or np.ptp(along) > ALIKE * along.max():
        shown = ", ".join(f"{own:.4g}" for own in along)
        raise MeshError(f"{source.mass}: {shown} kg along x, y and z: it must be one positive mass; check its rows")
    size = np.sqrt(np.maximum(np.diag(mass), 0.0))
    if not size.all() or sl.eigvalsh(mass / np.outer(size, size), subset_by_index=[0, 0])[0] < MASSLESS:
        raise MeshError(f"{source.mass}: some motion has no mass: reduce with consistent masses at all points")


def _surface(read: _Read, source: HousingReducedSpec) -> tuple[Surface | None, sp.csr_array | None]:
    """The skin, and its displacement (3P, N) by the unknowns."""
    if not source.surface:
        return None, None
    points, faces, labels = read_surface(Path(source.surface), source.length)
    surface = enclosed(points, faces, source.surface)
    moved = sp.vstack([read.motion(int(label), range(3), "surface") for label in labels])
    return surface, sp.csr_array(sp.kron(surface.sample, sp.identity(3), format="csr") @ moved)


def read_points(path: Path) -> dict[int, np.ndarray]:
    """Coordinates (3,) of every point by its label, in the file's unit. MeshError for a file without points, and for
    points in another system of coordinates."""
    if path.suffix.lower() == ".inp":
        mesh = read_deck(path)
        found = dict(zip(mesh.labels.tolist(), mesh.nodes, strict=True))
    else:
        found = _grids(path)
    if not found:
        raise MeshError(f"{path}: no GRID card and no *NODE: name the file that says where the points lie")
    return found


def _grids(path: Path) -> dict[int, np.ndarray]:
    found = {}
    for card in bulk_cards(path):
        if card[0].rstrip("*") != "GRID":
            continue
        if card[2] not in ("", "0"):
            raise MeshError(f"{path}: GRID {card[1]} is in coordinate system {card[2]}: write it in the basic system")
        try:
            found[int(card[1])] = np.array([bulk_number(text or "0.0") for text in card[3:6]])
        except ValueError as error:
            raise MeshError(f"{path}: GRID {card[1]} cannot be read ({error}): correct this card") from None
    return found
