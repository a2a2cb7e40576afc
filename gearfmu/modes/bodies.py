"""Modes of one body of a stage, made from its finite elements: of one sector (`cyclic`), or of the whole body where it
has rigid couplings at its interfaces or is held by springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearfmu.body import Body
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import rigid_fields
from gearfmu.fem.cyclic import mirror_nodes
from gearfmu.femesh.carrier import whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.modes.cyclic import Progress, cyclic_modes
from gearfmu.modes.shapes import BodyModes, Mode, energy_shares, harmonic_shares
from gearfmu.reduction.carrier import carrier_full_order, evenly_spaced, scaled_sector
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.toothed import RING_SCALE, toothed_full_order
from gearfmu.stagefile.forms.expand import CARRIER
from gearfmu.stagefile.forms.general import RingBody, Stage, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.tables.housing import HousingBody

AGREEMENT = 1e-6  # relative: frequencies made again against those of the file
TOGETHER = 1e-5  # relative: frequencies this close are a pair


def body_modes(stage: Stage, name: str, count: int, progress: Progress | None = None, scale: float = 1.0) -> BodyModes:
    """The `count` lowest elastic modes of a free body (one more where that would split a pair), with its modal damping:
    toothed ones by one sector, without the mounts of a ring; the carrier with its bolts and bore coupled as the file
    says.

    scale : factor on all element counts.
    """
    table = stage.by_file[name]
    if isinstance(table, HousingBody):
        why = "shapes are drawn of gears, rings and carriers: `gearfmu inspect` shows a housing's frequencies"
        raise BodyError(f"{stage.source}: {name} is a housing: {why}")
    if isinstance(table, CarrierBody) and table.imported is None:
        found = _carrier(table, count, progress, scale)
    else:
        mesh, rigid = body_sector(stage, name, scale), None
        if isinstance(table, ToothedBody) and table.rigid_bore:
            rigid = mesh.sets["rim" if isinstance(table, RingBody) else "bore"]
        found = cyclic_modes(name, mesh, table.material, count, progress, rigid)
    return _damped(found, table.modal_damping)


def gear_modes(stage: Stage, stored: Body, count: int, progress: Progress | None = None) -> BodyModes:
    """`body_modes` of a gear, as far as its reduced body has them; stored : that body, whose frequencies they must
    have: BodyError where they differ (a file made by another program version)."""
    found = body_modes(stage, stored.name, min(count, stored.modes), progress)
    return as_stored(found, stored.frequency, stored.damping_ratio)


def as_stored(found: BodyModes, frequency: np.ndarray, damping_ratio: np.ndarray) -> BodyModes:
    """The same modes with the damping ratios (n,) of the stored body, after its frequencies (n,) Hz were compared."""
    first = np.array([mode.numbers[0] - 1 for mode in found.modes])
    known = first < len(frequency)
    difference = np.abs(np.array([mode.frequency for mode in found.modes])[known] / frequency[first[known]] - 1).max()
    if difference > AGREEMENT:
        raise BodyError(
            f"{found.name}: frequencies made from the finite elements differ by {difference:.1e} from those of the "
            "stored body; make it again with 'gearfmu reduce --force STAGE'"
        )
    modes = [
        replace(mode, damping_ratio=float(damping_ratio[mode.numbers[0] - 1]))
        for mode, is_known in zip(found.modes, known, strict=True)
        if is_known
    ]
    return replace(found, modes=tuple(modes))


def uncoupled_carrier_modes(
    stage: Stage, count: int, progress: Progress | None = None, scale: float = 1.0
) -> BodyModes:
    """The lowest elastic modes of the free carrier without its couplings: bolts and bore deform as they like.

    BodyError for an imported carrier and for planets at uneven angles, which have no sector that repeats.
    """
    carrier = stage.by_file[CARRIER]
    assert isinstance(carrier, CarrierBody)
    if carrier.imported is not None or not evenly_spaced(carrier):
        why = "only a carrier meshed here, of evenly spaced planets, is taken without couplings"
        raise BodyError(f"{stage.source}: {why}")
    sector = body_sector(stage, "carrier", scale)
    found = cyclic_modes("carrier_uncoupled", sector, carrier.material, count, progress)
    return _damped(found, carrier.modal_damping)


def mounted_ring_modes(
    stage: Stage, count: int, progress: Progress | None = None, scale: float = RING_SCALE
) -> BodyModes:
    """The lowest modes of the ring on its mounts, with all its teeth.

    scale : factor on all element counts; at 1 a whole ring is too much. BodyError for a ring without mounts.
    """
    ring = stage.by_file["ring"]
    assert isinstance(ring, RingBody)
    if stage.mounts is None:
        raise BodyError(f"{stage.source}: the ring has no mounts: leave --mounted away, or add [ring.mounts]")
    if progress:
        progress("finite elements", 0.1)
    mesh = body_sector(stage, "ring", scale).full()
    full = toothed_full_order(ring, stage.mounts, scale)
    found = whole_modes(full, mesh, {}, ring.material, count)
    return _damped(replace(found, name="ring_on_mounts"), ring.modal_damping)


def _carrier(carrier: CarrierBody, count: int, progress: Progress | None, scale: float) -> BodyModes:
    if progress:
        progress("finite elements", 0.1)
    sector = scaled_sector(carrier, scale)
    mesh = whole_carrier(carrier_geometry(carrier), sector)
    slaves = {f"bolt{k}": sector.sector_nodes(k)[sector.sets["bolt"]] for k in range(sector.teeth)}
    full, slaves = carrier_full_order(carrier, scale), slaves | {"bore": mesh.sets["bore"]}
    return whole_modes(full, mesh, slaves, carrier.material, count)


def _damped(found: BodyModes, damping_ratio: float) -> BodyModes:
    """Every mode with the damping ratio that the file gives the body."""
    assert np.isnan([mode.damping_ratio for mode in found.modes]).all()
    return replace(found, modes=tuple(replace(mode, damping_ratio=damping_ratio) for mode in found.modes))


def whole_modes(
    body: FullOrder, mesh: FeMesh, slaves: dict[str, np.ndarray], material: hex20.Material, count: int
) -> BodyModes:
    """The `count` lowest elastic modes of a FullOrder body (one more where that would split a pair); damping is NaN.

    mesh : its finite elements, all of them. slaves : node numbers of each rigid coupling, by the interface's name.
    The nodal diameter is the harmonic around the axis with most of the surface's mean square. Raises ModesError.
    """
    squared, vectors = elastic(body).modes(count + 1)
    frequency = np.sqrt(squared) / (2 * np.pi)
    mass = hex20.assemble(mesh.nodes, mesh.elements, material)[1][::3, ::3]
    faces = surface.boundary_faces(mesh.elements)
    used, local = np.unique(faces, return_inverse=True)
    modes, k = [], 0
    while k < min(count, len(frequency)):
        pair = k + 1 < len(frequency) and frequency[k + 1] / frequency[k] - 1 < TOGETHER
        numbers = (k + 1, k + 2) if pair else (k + 1,)
        shapes = np.stack([at_nodes(body, vectors[:, n - 1], mesh.nodes, slaves) for n in numbers])
        shares = np.mean([harmonic_shares(mesh.nodes[used], shape[used]) for shape in shapes], axis=0)
        modes.append(
            Mode(
                numbers=numbers,
                frequency=float(frequency[k]),
                damping_ratio=float("nan"),
                parity=_parity(mesh.nodes, shapes[0]),
                nodal_diameter=int(np.argmax(shares)),
                harmonic_share=float(shares.max()),
                energy=np.mean([energy_shares(mesh.nodes, mass, shape) for shape in shapes], axis=0),
                shape=shapes[:, used],
            )
        )
        k += len(numbers)
    return BodyModes(body.name, mesh.nodes[used], local.reshape(-1, 8), tuple(modes))


def at_nodes(body: FullOrder, vector: np.ndarray, nodes: np.ndarray, slaves: dict[str, np.ndarray]) -> np.ndarray:
    """Displacement (N, 3) of all nodes from the unknowns (n,) of the body: slaves move with their masters."""
    flat = np.full(nodes.size, np.nan)
    free = body.node_of_dof < len(nodes)
    numbers = body.node_of_dof[free]
    _, first = np.unique(numbers, return_index=True)
    component = np.arange(len(numbers)) - first[np.searchsorted(numbers[first], numbers)]
    flat[3 * numbers + component] = vector[free]
    shape = flat.reshape(-1, 3)
    for interface in body.interfaces:
        if interface.kind == "rigid":
            mine = slaves[interface.name]
            shape[mine] = rigid_fields(nodes[mine] - interface.point) @ (interface.rows @ vector)
    assert np.isfinite(shape).all(), "every node is an unknown of the body or the slave of a coupling"
    return shape


def _parity(nodes: np.ndarray, shape: np.ndarray) -> int:
    """+1 or −1 for a shape that is symmetric or antisymmetric about the middle of a body which is so, else 0."""
    mirror = mirror_nodes(nodes)
    if mirror is None:
        return 0
    even = float(((shape + shape[mirror] * [1, 1, -1]) ** 2).sum() / (4 * (shape**2).sum()))
    return 1 if even > 0.99 else -1 if even < 0.01 else 0
