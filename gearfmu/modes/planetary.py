"""Modes of the bodies of a planetary set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearfmu.body.imported import imported_full_order
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.femesh.carrier import whole_carrier
from gearfmu.modes.cyclic import Progress, cyclic_modes
from gearfmu.modes.shapes import BodyModes
from gearfmu.modes.whole import whole_modes
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.toothed import RING_SCALE, ring_full_order
from gearfmu.spec.forms.expand import CARRIER
from gearfmu.spec.forms.general import Stage, ToothedBody
from gearfmu.spec.forms.members import carrier_of, member_of
from gearfmu.spec.forms.planetary import CarrierSpec


def set_body_modes(
    stage: Stage, name: str, count: int, progress: Progress | None = None, scale: float = 1.0
) -> BodyModes:
    """The `count` lowest elastic modes of a free body of a planetary set, with its modal damping: sun, planet and ring
    by one sector; the carrier with its bolts and bore coupled as the file says. The ring's mounts are left out.

    scale : factor on all element counts.
    """
    part: CarrierSpec | ToothedBody = carrier_of(stage).part if name == CARRIER else member_of(stage, name).gear
    if name == CARRIER and part.imported is None:
        found = _carrier(stage, count, progress, scale)
    else:
        found = cyclic_modes(name, body_sector(stage, name, scale), part.material, count, progress)
    return _damped(found, part.modal_damping)


def uncoupled_carrier_modes(
    stage: Stage, count: int, progress: Progress | None = None, scale: float = 1.0
) -> BodyModes:
    """The lowest elastic modes of the free carrier without its couplings: bolts and bore deform as they like.

    BodyError for an imported carrier and for planets at uneven angles, which have no sector that repeats.
    """
    carrier = carrier_of(stage)
    part, angles = carrier.part, carrier.geometry.angles
    even = 2 * np.pi * np.arange(len(angles)) / len(angles)
    if part.imported is not None or not np.allclose(angles, even, atol=1e-9):
        why = "only a carrier meshed here, of evenly spaced planets, is taken without couplings"
        raise BodyError(f"{stage.source}: {why}")
    sector = body_sector(stage, "carrier", scale)
    found = cyclic_modes("carrier_uncoupled", sector, part.material, count, progress)
    return _damped(found, part.modal_damping)


def mounted_ring_modes(
    stage: Stage, count: int, progress: Progress | None = None, scale: float = RING_SCALE
) -> BodyModes:
    """The lowest modes of the ring on its mounts, with all its teeth.

    scale : factor on all element counts; at 1 a whole ring is too much. BodyError for a ring without mounts.
    """
    member = member_of(stage, "ring")
    if member.mounts is None:
        raise BodyError(f"{stage.source}: the ring has no mounts: leave --mounted away, or add [ring.mounts]")
    if progress:
        progress("finite elements", 0.1)
    mesh = body_sector(stage, "ring", scale).full()
    full = ring_full_order(member, scale) if member.gear.imported is None else imported_full_order(member)
    found = whole_modes(full, mesh, {}, member.gear.material, count)
    return _damped(replace(found, name="ring_on_mounts"), member.gear.modal_damping)


def _carrier(stage: Stage, count: int, progress: Progress | None, scale: float) -> BodyModes:
    if progress:
        progress("finite elements", 0.1)
    carrier, sector = carrier_of(stage), body_sector(stage, CARRIER, scale)
    mesh = whole_carrier(carrier.geometry, sector)
    slaves = {f"bolt{k}": sector.sector_nodes(k)[sector.sets["bolt"]] for k in range(sector.teeth)}
    full, slaves = carrier_full_order(carrier, scale), slaves | {"bore": mesh.sets["bore"]}
    return whole_modes(full, mesh, slaves, carrier.part.material, count)


def _damped(found: BodyModes, damping_ratio: float) -> BodyModes:
    """Every mode with the damping ratio that the file gives the body."""
    assert np.isnan([mode.damping_ratio for mode in found.modes]).all()
    return replace(found, modes=tuple(replace(mode, damping_ratio=damping_ratio) for mode in found.modes))
