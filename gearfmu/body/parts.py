"""Results of every method to a gear body, and its pictures, for bodies meshed here and made elsewhere; how a body was
made."""

from __future__ import annotations

import math
import platform
import sys
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.body.body import Flank, Picture, Sensors, Shapes, Tangent, turn_sectors, whole_surface
from gearfmu.fem import surface
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.cyclic.modal import Modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics
from gearfmu.stagefile.tables.bodies import MeshSpec

DRAWN = MeshSpec(flank=8, thickness=2, root=4, rim=4, width=1, thickness_grading=1.25)
_PICTURE_LOADS = 5
_DRAWN_TWIST = 0.08  # rad: largest turn of the section within a drawn layer
_OFFSETS = 3  # the kernel reads tooth offsets −3 … 3


@dataclass(frozen=True)
class Parts:
    """A reduced gear without its names and numbers: modes, static tables, error, plain facts of the mesh, pictures,
    mass matrix (6, 6) of the rigid body, of a ring the sensor on its rim."""

    modes: Modes
    statics: Statics
    error: FrfError
    facts: dict[str, Any]
    picture: Picture
    inertia: np.ndarray
    sensors: Sensors | None = None


def tooth_flank(geometry: Any, gear: Any, internal: bool = False) -> tuple[ToothFlank, Points]:
    """Flank and load points of a gear: geometry (GearGeometry or InternalGearGeometry) and what a spec says about
    it."""
    flank = ToothFlank(
        geometry.r_b,
        geometry.psi_b,
        geometry.s_form,
        geometry.s_tip,
        gear.face_width,
        gear.body.strip_half_width,
        internal,
        geometry.beta_b,
    )
    return flank, Points(flank.chebyshev_rolls(gear.body.roll_points), gear.body.width_functions)


def drawn_counts(geometry: Any, face_width: float) -> MeshSpec:
    """Element counts of the coarse sector from which a gear is drawn: one layer, more where the section turns with
    z."""
    layers = max(1, math.ceil(abs(geometry.twist) * face_width / _DRAWN_TWIST))
    return DRAWN.model_copy(update={"width": layers})


def kept_offsets(static_ff: np.ndarray) -> np.ndarray:
    """Of the table (2, 2, z, …) of all tooth offsets those that the kernel reads (2, 2, 7, …)."""
    if static_ff.shape[2] <= 2 * _OFFSETS + 1:
        return static_ff
    return np.concatenate([static_ff[:, :, : _OFFSETS + 1], static_ff[:, :, -_OFFSETS:]], axis=2)


def tangent_of(modes: Modes, statics: Statics, points: Points) -> Tangent | None:
    """Rows and tables of the loads along the profile; None where none were made."""
    if statics.static_tt is None or statics.static_nt is None or modes.tangent_rows is None:
        return None
    rows = modes.tangent_rows.reshape(2, len(points.rolls), points.functions, -1)
    return Tangent(rows, statics.static_nt, statics.static_tt)


def flank_of(teeth: int, load_points: tuple[ToothFlank, Points], modes: Modes, statics: Statics) -> Flank:
    """The flank of a body: its geometry and load points, rows of the modes and static tables at them."""
    flank, points = load_points
    return Flank(
        teeth=teeth,
        internal=flank.internal,
        r_b=flank.r_b,
        psi_b=flank.psi_b,
        beta_b=flank.base_helix_angle,
        face_width=flank.face_width,
        strip_half_width=flank.strip_half_width,
        roll_range=np.array(flank.roll_range),
        roll=points.rolls,
        diameter=modes.nodal_diameter,
        part=modes.part,
        parity=modes.parity,
        rows=modes.flank_rows.reshape(2, len(points.rolls), points.functions, -1),
        static=kept_offsets(statics.static_ff),
        node=statics.static_fb,
        tangent=tangent_of(modes, statics, points),
    )


def rim_sensor(body: SectorBody, modes: Modes) -> Sensors | None:
    """The patch of a ring's rim in sector 0; None of an external gear."""
    return Sensors(("rim",), body.patch_point[None], modes.patch_rows) if body.internal else None


def pictured_loads(points: Points) -> list[int]:
    """Flat indices of the uniform loads on flank 0 at a few rolls from form circle to tip."""
    rolls, functions = len(points.rolls), points.functions
    chosen = sorted({round(k) for k in np.linspace(0, rolls - 1, _PICTURE_LOADS)})
    return [roll * functions for roll in chosen]


def sector_shapes(sector: Outline, modes: Modes) -> Shapes | None:
    """Surface of a sector in all modes; None where the modes were made without it."""
    if modes.surface is None:
        return None
    return Shapes(sector.points.astype("f4"), sector.quads, sector.ahead.astype(int), modes.surface.astype("f4"))


def sector_picture(sector: Outline, body: SectorBody, modes: Modes, statics: Statics) -> Picture:
    """Pictures of a gear reduced on one sector, from the outline of a coarse sector mesh of the same gear."""
    pictured = pictured_loads(body.points)
    points, quads = whole_surface(sector, body.teeth)
    loads = [unfold_sectors(picture, sector) for picture in statics.pictures]
    return Picture(
        points.astype("f4"),
        quads,
        np.array(loads, "f4"),
        body.points.rolls[[load // body.points.functions for load in pictured]],
        sector_shapes(sector, modes),
    )


def provenance(seconds: float) -> dict[str, Any]:
    """Program versions, CPU seconds of the reduction and the peak memory of the process so far."""
    return {
        "gearfmu": metadata.version("gearfmu"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "cpu_s": round(seconds, 1),
        "peak_memory_GB": _peak_memory(),
    }


def _peak_memory() -> float | None:
    """Largest resident memory of this process so far; None where the system does not report it (Windows)."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1e9 if sys.platform == "darwin" else 1e6), 2)


@dataclass(frozen=True)
class Outline:
    """The drawn surface of one sector: points (P, 3) drawn once a sector, quads (Q, 4) of their numbers, `ahead` (Q,
    4): true where the point meant is that of the next sector; sample (P, N): displacement of the points from that of
    the finite-element nodes."""

    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    sample: sp.csr_array


def outline(drawn: FeMesh, nodes: np.ndarray) -> Outline:
    """Surface of the coarse sector mesh `drawn`: the corners of its outer faces.

    nodes (N, 3): the finite-element mesh of the same sector, from whose four nearest nodes the points take their
    displacement (inverse squares of the distance: good enough to look at).
    """
    quads = surface.outer_faces(drawn.elements, drawn.cut_minus, drawn.cut_plus)[:, :4]
    stand_in = np.arange(len(drawn.nodes))
    stand_in[drawn.cut_plus] = drawn.cut_minus
    used, local = np.unique(stand_in[quads], return_inverse=True)
    points = drawn.nodes[used]
    return Outline(points, local.reshape(quads.shape), stand_in[quads] != quads, _sampling(points, nodes))


def unfold_sectors(shapes: np.ndarray, sector: Outline) -> np.ndarray:
    """Displacement (z·P, 3) from that of every sector in its own frame, (z, 3N)."""
    return turn_sectors(np.stack([sector.sample @ shape.reshape(-1, 3) for shape in shapes])).reshape(-1, 3)


def _sampling(points: np.ndarray, nodes: np.ndarray) -> sp.csr_array:
    distance, nearest = cKDTree(nodes).query(points, k=4)
    weight = 1 / (distance**2 + (1e-6 * np.ptp(nodes)) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 4)
    return sp.coo_array((weight.ravel(), (rows, nearest.ravel())), (len(points), len(nodes))).tocsr()
