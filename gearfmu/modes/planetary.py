"""Modes of the bodies of a planetary set."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearfmu.body.imported import imported_full_order
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.femesh.carrier import whole_carrier
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.modes.cyclic import Progress, cyclic_modes
from gearfmu.modes.shapes import BodyModes
from gearfmu.modes.whole import whole_modes
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.toothed import RING_SCALE, ring_full_order
from gearfmu.spec.members import member_of


def set_body_modes(spec: Any, name: str, count: int, progress: Progress | None = None, scale: float = 1.0) -> BodyModes:
    """The `count` lowest elastic modes of a free body of a PlanetarySpec, with its modal damping: sun, planet and ring
    by one sector; the carrier with its bolts and bore coupled as the file says. The ring's mounts are left out.

    scale : factor on all element counts.
    """
    gear = getattr(spec, name)
    if name == "carrier" and gear.imported is None:
        found = _carrier(spec, count, progress, scale)
    else:
        found = cyclic_modes(name, body_sector(spec, name, scale), gear.material, count, progress)
    return _damped(found, gear.modal_damping)


def uncoupled_carrier_modes(spec: Any, count: int, progress: Progress | None = None, scale: float = 1.0) -> BodyModes:
    """The lowest elastic modes of the free carrier without its couplings: bolts and bore deform as they like.

    BodyError for an imported carrier and for planets at uneven angles, which have no sector that repeats.
    """
    angles = CarrierGeometry.of(spec).angles
    even = 2 * np.pi * np.arange(len(angles)) / len(angles)
    if spec.carrier.imported is not None or not np.allclose(angles, even, atol=1e-9):
        why = "only a carrier meshed here, of evenly spaced planets, is taken without couplings"
        raise BodyError(f"{spec.source}: {why}")
    sector = body_sector(spec, "carrier", scale)
    found = cyclic_modes("carrier_uncoupled", sector, spec.carrier.material, count, progress)
    return _damped(found, spec.carrier.modal_damping)


def mounted_ring_modes(spec: Any, count: int, progress: Progress | None = None, scale: float = RING_SCALE) -> BodyModes:
    """The lowest modes of the ring on its mounts, with all its teeth.

    scale : factor on all element counts; at 1 a whole ring is too much. BodyError for a ring without mounts.
    """
    if spec.ring.mounts is None:
        raise BodyError(f"{spec.source}: the ring has no mounts: leave --mounted away, or add [ring.mounts]")
    if progress:
        progress("finite elements", 0.1)
    mesh = body_sector(spec, "ring", scale).full()
    if spec.ring.imported is None:
        full = ring_full_order(spec, scale)
    else:
        full = imported_full_order(member_of(spec, "ring"))
    found = whole_modes(full, mesh, {}, spec.ring.material, count)
    return _damped(replace(found, name="ring_on_mounts"), spec.ring.modal_damping)


def _carrier(spec: Any, count: int, progress: Progress | None, scale: float) -> BodyModes:
    if progress:
        progress("finite elements", 0.1)
    sector = body_sector(spec, "carrier", scale)
    mesh = whole_carrier(CarrierGeometry.of(spec), sector)
    slaves = {f"bolt{k}": sector.sector_nodes(k)[sector.sets["bolt"]] for k in range(sector.teeth)}
    return whole_modes(
        carrier_full_order(spec, scale), mesh, slaves | {"bore": mesh.sets["bore"]}, spec.carrier.material, count
    )


def _damped(found: BodyModes, damping_ratio: float) -> BodyModes:
    """Every mode with the damping ratio that the file gives the body."""
    assert np.isnan([mode.damping_ratio for mode in found.modes]).all()
    return replace(found, modes=tuple(replace(mode, damping_ratio=damping_ratio) for mode in found.modes))
