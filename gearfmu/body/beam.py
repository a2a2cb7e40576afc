"""A shaft as a beam: stepped circular sections, Timoshenko bending, torsion and extension; reduced to modes and static
residual at its interface nodes.

Deflection and rotation are interpolated separately, with polynomials of fourth order in every element: the static beam
(cubic between loads) is among them, so deflection at nodes is exact whatever the mesh, there is no shear locking, and
frequencies converge with the eighth power of the element length. (Elements whose shape functions solve the static beam
converge with the second power only once they are shorter than the shaft is thick.) Shear coefficient of a hollow
circular section: Cowper 1966 (J. Appl. Mech. 33, 335). Axes: z along the shaft; bending in the planes x–z (u_x, r_y)
and y–z (u_y, −r_x) is alike, so every bending frequency comes twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import scipy.linalg as sl

from gearfmu.body.body import Body, Exact, How, Node
from gearfmu.reduction.full_order import COMPONENTS

FINEST = 1e-9  # m: nodes nearer than that are one
ORDER = 4
ELEMENTS = 12  # at least, along a shaft
ALONG, TURNING = 2, 5
PLANES = ((0, 4, 1.0), (1, 3, -1.0))  # deflection, rotation and its sign


@dataclass(frozen=True)
class Section:
    """A cylinder of a shaft: length, outer diameter and bore, m."""

    length: float
    outer: float
    bore: float = 0.0

    @property
    def area(self) -> float:
        """m²."""
        return math.pi / 4 * (self.outer**2 - self.bore**2)

    @property
    def second_moment(self) -> float:
        """About a diameter, m⁴; half the polar one."""
        return math.pi / 64 * (self.outer**4 - self.bore**4)

    def shear_factor(self, poisson: float) -> float:
        """κ of the area that carries shear."""
        m = (self.bore / self.outer) ** 2
        return 6 * (1 + poisson) * (1 + m) ** 2 / ((7 + 6 * poisson) * (1 + m) ** 2 + (20 + 12 * poisson) * m)


@dataclass(frozen=True)
class Steel:
    """Young's modulus, Pa, Poisson's ratio, density, kg/m³."""

    youngs_modulus: float
    poisson_ratio: float
    density: float

    @property
    def shear_modulus(self) -> float:
        """Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


@dataclass(frozen=True)
class Shaft:
    """Sections from z = 0 on, material, interfaces at `places` (K,) m along z."""

    sections: Sequence[Section]
    material: Steel
    places: Sequence[float]

    @cached_property
    def steps(self) -> np.ndarray:
        """Ends of the sections, m."""
        return np.cumsum([section.length for section in self.sections])

    def section_at(self, z: float) -> Section:
        """The section that z, no step, lies in."""
        return self.sections[int(np.searchsorted(self.steps[:-1], z, "right"))]

    def ends(self, longest: float) -> np.ndarray:
        """Element ends: all steps and interfaces, and between them so many that no element is longer than `longest`."""
        steps = distinct(np.concatenate([[0.0], self.steps, self.places]))
        parts = [np.linspace(a, b, max(1, math.ceil((b - a) / longest)) + 1)[:-1] for a, b in pairwise(steps)]
        return np.append(np.concatenate(parts), steps[-1])


def distinct(places: np.ndarray) -> np.ndarray:
    """The places, m, ascending, those that are one once."""
    ordered = np.sort(places)
    return ordered[np.diff(ordered, prepend=-np.inf) > FINEST]


def reduce_shaft(
    shaft: Shaft, cut: float, longest: float | None = None, name: str = "shaft", damping_ratio: float = 0.0
) -> Body:
    """The free shaft with its modes below `cut` (Hz), all with one damping ratio; its origin is its centre of mass.

    longest: element, m; the 12th part of the length when None. Nothing is stored: a beam is made in milliseconds.
    """
    ends = shaft.ends(longest or float(shaft.steps[-1]) / ELEMENTS)
    at = np.array([ORDER * int(np.abs(ends - place).argmin()) for place in shaft.places])
    bending = _solve(*bending_matrices(shaft, ends), rigid=2)
    torsion, extension = (_solve(*rod_matrices(shaft, ends, turning), rigid=1) for turning in (True, False))
    motions = [
        *((bending, {deflection: (0, 1.0), rotation: (1, sign)}) for deflection, rotation, sign in PLANES),
        (torsion, {TURNING: (0, 1.0)}),
        (extension, {ALONG: (0, 1.0)}),
    ]
    found, rows, residual = [], [], np.zeros((6 * len(at), 6 * len(at)))
    tilts = [np.zeros((2, bending[1].shape[0] // 2, 6))]  # about x and y, of all nodes
    tilts[0][[0, 1], :, [3, 4]] = 1.0
    for (frequency, shapes), directions in motions:
        own = np.zeros((len(at), 6, frequency.size))
        for direction, (unknown, sign) in directions.items():
            own[:, direction] = sign * shapes[len(directions) * at + unknown]
        stored = frequency < 2 * math.pi * cut
        tilt = np.zeros((2, tilts[0].shape[1], stored.sum()))
        for direction, (unknown, sign) in directions.items():
            if direction in (3, 4):
                tilt[direction - 3] = sign * shapes[unknown :: len(directions), stored]
        tilts.append(tilt)
        rest = (own[..., ~stored] / frequency[~stored]).reshape(6 * len(at), -1)
        residual += rest @ rest.T
        found.append(frequency[stored])
        rows.append(own[..., stored])
    omega = np.concatenate(found)
    order = np.argsort(omega, kind="stable")
    centre, mass = rigid_mass(shaft)
    about_x, about_y = np.concatenate([tilts[0], np.concatenate(tilts[1:], axis=2)[..., order]], axis=2)
    rotary = bending_matrices(shaft, ends)[1][1::2, 1::2]  # ∫ ρI θ_i θ_j of the rotations of the nodes, kg·m²
    turning = about_x.T @ rotary @ about_y
    modes, omega = np.concatenate(rows, axis=2)[..., order].reshape(6 * len(at), -1), omega[order]
    points = [np.array([0.0, 0.0, place]) for place in np.asarray(shaft.places) - centre]
    return Body(
        name=name,
        how=How("0" * 64, "beam", asdict(shaft.material)),
        mass=mass,
        frequency=omega / (2 * math.pi),
        damping_ratio=np.full(omega.size, damping_ratio),
        nodes=tuple(Node(f"node{k}", "section", COMPONENTS, point) for k, point in enumerate(points)),
        rows=modes,
        static=residual + (modes / omega) @ (modes / omega).T,
        exact=Exact(omega, residual, turning - turning.T),
    )


def rigid_mass(shaft: Shaft) -> tuple[float, np.ndarray]:
    """z of the centre of mass, m, and (6, 6) mass about it."""
    middles = shaft.steps - [section.length / 2 for section in shaft.sections]
    rho = shaft.material.density
    masses = np.array([rho * section.area * section.length for section in shaft.sections])
    polar = sum(2 * rho * section.second_moment * section.length for section in shaft.sections)
    centre = float(masses @ middles / masses.sum())
    across = polar / 2 + sum(
        m * ((middle - centre) ** 2 + section.length**2 / 12)
        for m, middle, section in zip(masses, middles, shaft.sections, strict=True)
    )
    return centre, np.diag([*[masses.sum()] * 3, across, across, polar])


def bending_matrices(shaft: Shaft, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K, M of one plane: unknowns w, θ at every node, θ = w′ without shear."""
    return _assemble(shaft, ends, _bending_element, 2)


def rod_matrices(shaft: Shaft, ends: np.ndarray, turning: bool) -> tuple[np.ndarray, np.ndarray]:
    """K, M of torsion (turning), or extension; one unknown a node."""
    return _assemble(shaft, ends, _torsion_element if turning else _extension_element, 1)


def _assemble(shaft: Shaft, ends: np.ndarray, element: Element, unknowns: int) -> tuple[np.ndarray, np.ndarray]:
    size = unknowns * (ORDER * (ends.size - 1) + 1)
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for e, (a, b) in enumerate(pairwise(ends)):
        k, m = element(shaft.section_at(0.5 * (a + b)), shaft.material, _products(b - a))
        own = slice(unknowns * ORDER * e, unknowns * (ORDER * (e + 1) + 1))
        stiffness[own, own] += k
        mass[own, own] += m
    return stiffness, mass


@dataclass(frozen=True)
class _Products:
    """Integrals over an element of products of shape functions (ORDER + 1, ORDER + 1): plain, of slopes, slope ×
    plain."""

    plain: np.ndarray
    slopes: np.ndarray
    mixed: np.ndarray


Element = Callable[[Section, Steel, _Products], tuple[np.ndarray, np.ndarray]]


def _products(length: float) -> _Products:
    values, slopes, weights = _shape_functions()
    slopes = slopes * 2 / length
    weights = weights[:, None] * length / 2
    return _Products(values.T @ (weights * values), slopes.T @ (weights * slopes), slopes.T @ (weights * values))


@cache
def _shape_functions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and slopes (ORDER + 1, ORDER + 1) of the Lagrange polynomials at the Gauss points of −1 … 1, and the
    weights of these."""
    points, weights = np.polynomial.legendre.leggauss(ORDER + 1)
    inner = np.polynomial.legendre.Legendre.basis(ORDER).deriv().roots()
    nodes = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])  # Gauss–Lobatto points
    basis = np.linalg.inv(np.vander(nodes, increasing=True))
    powers = np.arange(1, ORDER + 1) * np.vander(points, ORDER, increasing=True)
    return np.vander(points, ORDER + 1, increasing=True) @ basis, powers @ basis[1:], weights


def _bending_element(section: Section, material: Steel, n: _Products) -> tuple[np.ndarray, np.ndarray]:
    shear = section.shear_factor(material.poisson_ratio) * material.shear_modulus * section.area
    bend = material.youngs_modulus * section.second_moment
    k, m = np.zeros((2 * ORDER + 2,) * 2), np.zeros((2 * ORDER + 2,) * 2)
    k[::2, ::2], k[::2, 1::2], k[1::2, ::2] = shear * n.slopes, -shear * n.mixed, -shear * n.mixed.T
    k[1::2, 1::2] = bend * n.slopes + shear * n.plain
    m[::2, ::2] = material.density * section.area * n.plain
    m[1::2, 1::2] = material.density * section.second_moment * n.plain
    return k, m


def _torsion_element(section: Section, material: Steel, n: _Products) -> tuple[np.ndarray, np.ndarray]:
    polar = 2 * section.second_moment
    return material.shear_modulus * polar * n.slopes, material.density * polar * n.plain


def _extension_element(section: Section, material: Steel, n: _Products) -> tuple[np.ndarray, np.ndarray]:
    return material.youngs_modulus * section.area * n.slopes, material.density * section.area * n.plain


def _solve(stiffness: np.ndarray, mass: np.ndarray, rigid: int) -> tuple[np.ndarray, np.ndarray]:
    """All elastic modes: ω (n,) rad/s, shapes (N, n), the `rigid` lowest left out."""
    squared, shapes = sl.eigh(stiffness, mass)
    return np.sqrt(squared[rigid:]), shapes[:, rigid:]
