"""What follows from the numbers of a stage (ISO 21771), SI and degrees: plain facts under their names."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gearfmu.geometry import PairGeometry
from gearfmu.geometry.mesh import PlanetaryGeometry, common_width
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.shapes import carrier_geometry, largest_half_width, mesh_shape, set_carrier, set_geometry


def derived(stage: Stage) -> dict[str, Any]:
    """Working pressure angle, contact ratio, radii; of a general stage under the name of every mesh."""
    spec = stage.written
    if isinstance(spec, PlanetarySpec):
        return _derived_set(spec)
    if not isinstance(spec, StageSpec):
        return {mesh.name: _derived_pair(mesh_shape(spec, mesh), mesh.gears) for mesh in spec.engagements}
    pair = spec.geometry
    helix = _derived_helix(spec, pair) if spec.pair.helix_angle else {}
    return _derived_pair(pair, [gear.name for gear in spec.gears]) | helix


def _derived_pair(pair: Any, names: Sequence[str]) -> dict[str, Any]:
    """What follows from the numbers of two gears in mesh."""
    return {
        "working_pressure_angle_deg": math.degrees(pair.alpha_wt),
        "contact_ratio": pair.contact_ratio,
        "base_pitch": pair.base_pitch,
        **_radii(dict(zip(names, pair.gears, strict=True))),
    }


def _radii(shapes: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    return {name: {"r_b": s.r_b, "r_f": s.r_f, "r_a": s.r_a} for name, s in shapes.items()}


def _derived_helix(spec: StageSpec, pair: PairGeometry) -> dict[str, Any]:
    """What a helical pair has besides: angles of the transverse section, overlap of the common face width."""
    overlap = pair.gears[0].overlap_ratio(common_width(spec.gears))
    return {
        "transverse_pressure_angle_deg": math.degrees(pair.gears[0].alpha_t),
        "base_helix_angle_deg": math.degrees(pair.gears[0].beta_b),
        "overlap_ratio": overlap,
        "total_contact_ratio": pair.contact_ratio + overlap,
        "virtual_teeth": {g.name: s.z_virtual for g, s in zip(spec.gears, pair.gears, strict=True)},
    }


def _derived_set(spec: PlanetarySpec) -> dict[str, Any]:
    """What follows from the numbers of a planetary set."""
    g = set_geometry(spec)
    shapes: dict[str, Any] = {"sun": g.sun_mesh.gears[0], "planet": g.ring_mesh.planet, "ring": g.ring_mesh.ring}
    carrier = carrier_geometry(set_carrier(spec))
    torque = spec.mesh_torque * spec.planet.teeth / spec.sun.teeth
    return {
        "speed_ratio_sun_to_carrier": g.ratio,
        "working_pressure_angle_deg": {
            "sun_planet": math.degrees(g.sun_mesh.alpha_wt), "planet_ring": math.degrees(g.ring_mesh.alpha_wt)
        },
        "contact_ratio": {"sun_planet": g.sun_mesh.contact_ratio, "planet_ring": g.ring_mesh.contact_ratio},
        "ring_least_tip_radius": g.ring_mesh.least_tip_radius,
        "gap_between_planets": g.neighbour_clearance,
        "sun_torque_in_one_mesh": spec.mesh_torque,
        "largest_hertz_half_width_planet_ring": largest_half_width(spec.gears[1:], g.ring_mesh, torque),
        "carrier_mass": carrier.volume * spec.carrier.material.density,
        **_radii(shapes),
        **(_derived_set_helix(spec, g) if spec.set.helix_angle else {}),
    }  # fmt: skip


def _derived_set_helix(spec: PlanetarySpec, g: PlanetaryGeometry) -> dict[str, Any]:
    """What a helical set has besides: angle and overlap, and what torque_max presses along the axis in the mean."""
    sun = g.sun_mesh.gears[0]
    axial = spec.torque_max / g.ratio / spec.set.planets / sun.r * math.tan(abs(sun.beta))
    apart = g.sun_mesh.r_w[1] + g.ring_mesh.r_w[0]
    return {
        "base_helix_angle_deg": math.degrees(sun.beta_b),
        "overlap_ratio": sun.overlap_ratio(common_width(spec.gears)),
        "axial_force_of_a_mesh": axial,
        "tilting_moment_on_a_pin": axial * apart,
    }
