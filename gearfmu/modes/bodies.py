"""Modes of one body of a stage, made from its finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearfmu.body import Body
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.femesh.carrier import whole_carrier
from gearfmu.modes.cyclic import Progress, cyclic_modes
from gearfmu.modes.shapes import BodyModes
from gearfmu.modes.whole import whole_modes
from gearfmu.reduction.carrier import carrier_full_order, evenly_spaced, scaled_sector
from gearfmu.reduction.toothed import RING_SCALE, toothed_full_order
from gearfmu.stagefile.forms.expand import CARRIER
from gearfmu.stagefile.forms.general import RingBody, Stage, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.tables.housing import HousingBody

AGREEMENT = 1e-6  # relative: frequencies made again against those of the file


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
