"""Load strips on the surface of an imported gear: any mesh of quadrilaterals and triangles, one tooth or all.

Loads are those of `flank`: a strip of the analytic involute, integrated by Gauss points in roll and width, in intervals
that end at the lines of the mesh where it has such lines. Every Gauss point is looked up on the surface by its arc
length and width, and takes the displacement of the face there: forces and displacements use the same weights, and the
resultant is exact whatever the mesh.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import surface
from gearfmu.fem.surface import Faces
from gearfmu.geometry import involute
from gearfmu.geometry.involute_fit import FitError, FlankPoints, InvoluteFit, fit_involute, flank_faces
from gearfmu.geometry.plane import about_z
from gearfmu.reduction.cyclic.flank import Direction, Points, ToothFlank

_STEEP = 0.3  # largest axial component of a flank face's normal
_INWARD = 0.3  # smallest share of r_b by which a flank face's normal passes the axis
_END = 1e-5  # of the flank: by how much nodes may lie outside form and tip circle and still be on the flank
_ASIDE = 0.3  # of the half tooth thickness: faces further from their involute are no flank (cuts of half a gear)
_OUTSIDE = 0.05  # natural coordinate by which a point may lie beyond the last face
_GRID = 1.5  # crossings of mesh lines per corner up to which a mesh counts as a grid
_GAUSS = np.polynomial.legendre.leggauss(5)
_PER_FACE = 2.0  # intervals per length of a face where the mesh has no lines
_FEWEST = 3


def corner_geometry(
    nodes: np.ndarray, faces: Faces, internal: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corner nodes (F, 4) of all faces (a triangle's third twice), their centres (F, 3) and unit normals out of the
    body; of an internal gear into it, as of the external gear that fills its spaces."""
    corners = faces.corners
    normal = np.cross(nodes[corners[:, 2]] - nodes[corners[:, 0]], nodes[corners[:, 3]] - nodes[corners[:, 1]])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    centre = np.concatenate([nodes[faces.quads[:, :4]].mean(axis=1), nodes[faces.triangles[:, :3]].mean(axis=1)])
    return corners, centre, (-1 if internal else 1) * normal / np.maximum(length, 1e-300)


def fit_flanks(nodes: np.ndarray, faces: Faces, teeth: int, flank: ToothFlank, tolerance: float) -> InvoluteFit:
    """The involutes of a mesh whose axis is near z: fitted to the corner nodes of flank faces between form and tip.

    flank : the one that is meant. MeshError when there are no flanks, or when a node lies further from them than the
    tolerance (m): no involute.
    """
    r_b, internal = flank.r_b, flank.internal
    corners, centre, normal = corner_geometry(nodes, faces, internal)
    try:
        found = flank_faces(centre, normal, teeth, r_b)
        first = fit_involute(_nodes_of(nodes, corners, found, flank), teeth, r_b)
        local = first.in_gear_frame(nodes)
        corners, centre, normal = corner_geometry(local, faces, internal)
        every = _all_between(centre, normal, first, flank)
        fit = fit_involute(_nodes_of(nodes, corners, every, flank), teeth, first.r_b)
    except FitError as error:
        raise MeshError(
            f"no involute flanks of {teeth} teeth found ({error}); give the set that holds them, the number of "
            "teeth, and check the unit of length"
        ) from None
    if fit.worst > tolerance:
        raise MeshError(
            f"the flanks are no involutes: nodes lie up to {1e6 * fit.worst:.3g} µm (rms {1e6 * fit.rms:.3g} µm) off "
            f"the best one (base radius {1e3 * fit.r_b:.5g} mm, asked for {1e3 * r_b:.5g} mm), allowed are "
            f"{1e6 * tolerance:.3g} µm. Mesh the unmodified flank (reliefs belong into the stage file), or raise "
            "`flank_tolerance`"
        )
    return fit


def _all_between(centre: np.ndarray, normal: np.ndarray, fit: InvoluteFit, flank: ToothFlank) -> FlankPoints:
    """All steep faces between form and tip circle, whether they lie on an involute or not."""
    moment = centre[:, 0] * normal[:, 1] - centre[:, 1] * normal[:, 0]
    low, high = flank.radii()
    radius = np.hypot(centre[:, 0], centre[:, 1])
    chosen = (np.abs(normal[:, 2]) < _STEEP) & (np.abs(moment) > _INWARD * flank.r_b) & (radius > low) & (radius < high)
    side = np.where(chosen, np.sign(moment), 0).astype(int)
    base = np.arctan2(centre[:, 1], centre[:, 0]) + side * (
        involute.inv(np.arccos(np.minimum(fit.r_b / np.maximum(radius, fit.r_b), 1.0))) - fit.psi_b
    )
    tooth = np.round(base * fit.teeth / (2 * np.pi))
    side = np.where(np.abs(base - tooth * 2 * np.pi / fit.teeth) < _ASIDE * fit.psi_b, side, 0)
    return FlankPoints(centre, tooth.astype(int) % fit.teeth, side)


def _nodes_of(nodes: np.ndarray, corners: np.ndarray, faces: FlankPoints, flank: ToothFlank) -> FlankPoints:
    """The corner nodes of flank faces, each once, between form and tip circle."""
    chosen = np.flatnonzero(faces.side)
    index, first = np.unique(corners[chosen].ravel(), return_index=True)
    owner = chosen[first // 4]
    points = FlankPoints(nodes[index], faces.tooth[owner], faces.side[owner])
    radius = np.hypot(points.points[:, 0], points.points[:, 1])
    low, high = flank.radii(_END * abs(flank.s_tip - flank.s_form))
    return points.of((radius > low) & (radius < high))


def tooth_loads(
    nodes: np.ndarray,
    faces: Faces,
    flank: ToothFlank,
    points: Points,
    tooth_angle: float = 0.0,
    direction: Direction | None = None,
) -> sp.csr_array:
    """Unit loads of both flanks of one tooth as rows (2·R·A, 3N), order side, roll, function; components x, y, z of the
    frame of `nodes`.

    nodes (N, 3) m in the frame of the gear. tooth_angle : rad, where the tooth stands. direction : as of
    `flank.flank_loads`. MeshError when the faces do not cover the flank from form circle to tip over the face width.
    """
    back = about_z(tooth_angle)
    local = nodes @ back
    direction = direction or flank.normal
    parts = [_flank_part(local, faces, flank, side) for side in (0, 1)]
    sides = [_side_loads(local, part, flank, points, side, direction) for side, part in enumerate(parts)]
    rows = sp.csr_array(sp.vstack(sides))
    turn = sp.kron(sp.identity(len(nodes)), sp.csr_array(back.T), format="csr")
    return rows if tooth_angle == 0.0 else sp.csr_array(rows @ turn)


def middle_node(nodes: np.ndarray, faces: Faces, flank: ToothFlank, tooth_angle: float = 0.0) -> int:
    """The node of flank sg = +1 of a tooth nearest to the flank's middle, half-way along the involute at mid-width.

    nodes (N, 3) m in the frame of the gear. MeshError without a face on the flank.
    """
    local = nodes @ about_z(tooth_angle)
    own = _flank_part(local, faces, flank, 0).nodes
    if len(own) == 0:
        raise MeshError("there is no face on one of the flanks")
    squared = local[own, 0] ** 2 + local[own, 1] ** 2 - flank.r_b**2
    low, high = np.square(flank.roll_range)
    along, across = (squared - 0.5 * (low + high)) / (high - low), local[own, 2] / flank.face_width
    return int(own[(along**2 + across**2).argmin()])


def _flank_part(local: np.ndarray, faces: Faces, flank: ToothFlank, side: int) -> Faces:
    """Faces of one flank of the tooth on +x, with those that reach beyond form and tip circle."""
    sg = 1 - 2 * side
    corners, centre, normal = corner_geometry(local, faces, flank.internal)
    moment = sg * (centre[:, 0] * normal[:, 1] - centre[:, 1] * normal[:, 0])
    radius = np.hypot(local[corners, 0], local[corners, 1])
    angle = sg * np.arctan2(centre[:, 1], centre[:, 0])
    low, high = flank.radii()
    chosen = (
        (np.abs(normal[:, 2]) < _STEEP) & (moment > _INWARD * flank.r_b) & (angle > 0) & (angle < 1.5 * flank.psi_b)
    ) & ((radius.max(axis=1) > low) & (radius.min(axis=1) < high))
    quads, triangles = np.split(chosen, [len(faces.quads)])
    return Faces(faces.quads[quads], faces.triangles[triangles])


def _side_loads(
    local: np.ndarray, part: Faces, flank: ToothFlank, points: Points, side: int, direction: Direction
) -> sp.csr_array:
    arc = (local[:, 0] ** 2 + local[:, 1] ** 2 - flank.r_b**2) / (2 * flank.r_b)
    if len(part.nodes) == 0:
        raise MeshError("there is no face on one of the flanks")
    corners = np.unique(np.concatenate([part.quads[:, :4].ravel(), part.triangles[:, :3].ravel()]))
    half = 0.5 * flank.face_width
    chart = np.column_stack([arc, local[:, 2]])
    lines = _mesh_lines(chart[corners])
    size = _face_size(chart, part)
    across, weight = _gauss(_breaks(lines[1], -half, half, size))
    legendre = np.polynomial.legendre.legvander(across / half, points.functions - 1) * (weight / (2 * half))[:, None]
    rows = []
    for first, last in zip(*flank.strip(points.rolls), strict=True):
        cuts = np.sqrt(2 * flank.r_b * _breaks(lines[0], first, last, size))
        roll, weight = _gauss(cuts)
        along = weight * roll / flank.r_b / (last - first)
        place = np.stack(np.meshgrid(roll**2 / (2 * flank.r_b), across, indexing="ij"), axis=-1).reshape(-1, 2)
        lookup = _on_surface(chart, part, place)
        vectors = direction(roll, side, np.zeros(1))  # of a spur gear the same across the width
        force = np.einsum("p,pc,qa->apqc", along, vectors, legendre).reshape(points.functions, len(place), 3)
        rows += [sp.csr_array((lookup.T @ f).reshape(1, -1)) for f in force]
    return sp.csr_array(sp.vstack(rows))


def _face_size(chart: np.ndarray, part: Faces) -> float:
    """Typical length (m) of the faces in arc length and width."""
    boxes = [np.ptp(chart[block], axis=1).prod(axis=1) for block in (part.quads, part.triangles) if len(block)]
    return float(np.sqrt(np.median(np.concatenate(boxes))))


def _mesh_lines(corners: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Arc lengths and widths at which a structured mesh has its lines, from its corners (P, 2); None for a free
    mesh."""
    lines = []
    for values in corners.T:
        levels, slack = np.sort(values), 1e-6 * np.ptp(values)
        lines.append(levels[np.diff(levels, prepend=levels[0] - 2 * slack) > slack])
    return tuple(lines) if len(lines[0]) * len(lines[1]) < _GRID * len(corners) else (None, None)


def _breaks(lines: np.ndarray | None, low: float, high: float, size: float) -> np.ndarray:
    """low, high and the mesh lines between them; equal intervals, shorter than faces of this size, without lines."""
    if lines is None:
        return np.linspace(low, high, max(_FEWEST, int(np.ceil(_PER_FACE * (high - low) / size))) + 1)
    slack = 1e-6 * np.ptp(lines)
    return np.concatenate([[low], lines[(lines > low + slack) & (lines < high - slack)], [high]])


def _gauss(breaks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * np.diff(breaks)[:, None]
    middle = 0.5 * (breaks[1:] + breaks[:-1])[:, None]
    return (middle + half * _GAUSS[0]).ravel(), (half * _GAUSS[1]).ravel()


def _on_surface(chart: np.ndarray, part: Faces, place: np.ndarray) -> sp.csr_array:
    """(P, N) interpolation at the places (P, 2), arc length and width, from the nodes of the faces."""
    blocks = (
        (part.quads, surface.shape, surface.shape_gradient, _beyond_square, np.zeros(2)),
        (part.triangles, surface.triangle_shape, surface.triangle_gradient, _beyond_triangle, np.full(2, 1 / 3)),
    )
    best, answer = np.full(len(place), np.inf), sp.csr_array((len(place), len(chart)))
    for block, shape, slope, beyond, start in blocks:
        if len(block) == 0:
            continue
        miss, xi, face = _nearest(chart[block], place, (shape, slope, beyond), start)
        better = miss < best
        best = np.where(better, miss, best)
        values = shape(xi) * better[:, None]
        index = np.repeat(np.arange(len(place)), block.shape[1]), block[face].ravel()
        keep = sp.diags_array((~better).astype(float))
        answer = sp.csr_array(keep @ answer + sp.coo_array((values.ravel(), index), answer.shape).tocsr())
    if best.max() > _OUTSIDE:
        lost = place[best > _OUTSIDE]
        raise MeshError(
            f"the faces do not cover the flank: nothing at {1e3 * lost[0, 0]:.4g} mm along the involute, z = "
            f"{1e3 * lost[0, 1]:.4g} mm from mid-width ({len(lost)} of {len(place)} points); does the mesh end before "
            "the form or tip circle of the stage file?"
        )
    return answer


def _nearest(
    corners: np.ndarray, place: np.ndarray, element: tuple[Callable, Callable, Callable], start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each place the face (P,) that holds it, or comes nearest, with natural coordinates (P, 2) inside it and by
    how much these had to be moved (P,)."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    room = 0.1 * (high - low)
    inside = (place[:, None] >= low - room) & (place[:, None] <= high + room)
    point, face = np.nonzero(inside.all(axis=2))
    shape, slope, beyond = element
    xi = np.tile(start, (len(point), 1))
    for _ in range(8):
        here = np.einsum("pn,pnc->pc", shape(xi), corners[face])
        jacobian = np.einsum("pan,pnc->pca", slope(xi), corners[face])
        step = np.linalg.solve(jacobian, (place[point] - here)[..., None])[..., 0]
        xi = np.clip(xi + step, -2.0, 2.0)
    miss, xi = beyond(xi)
    order = np.lexsort((miss, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    result = np.full(len(place), np.inf), np.tile(start, (len(place), 1)), np.zeros(len(place), int)
    for target, source in zip(result, (miss, xi, face), strict=True):
        target[point[first]] = source[first]
    return result


def _beyond_square(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inside = np.clip(xi, -1.0, 1.0)
    return np.abs(xi - inside).max(axis=1), inside


def _beyond_triangle(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inside = np.maximum(xi, 0.0)
    total = np.maximum(inside.sum(axis=1, keepdims=True), 1.0)
    inside = inside / total
    return np.abs(xi - inside).max(axis=1), inside
