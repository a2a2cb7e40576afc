"""A full-order body as operators: mass product, flexibility, shifted solutions, lowest modes; rigid motion explicit.

With C q = 0 held and λ what holds it, at a real shift σ (rad²/s²)
    (K − σM) q + Cᵀλ = f,   C q = 0;        σ = 0 of a free body:  q = P K⁺ Pᵀ f,  P = I − R Rᵀ M
(inertia relief and mean-axis gauge, R the rigid modes that nothing holds, mass-normalised). λ comes from the small
Schur complement of the rows C, so that averaging couplings are held as exactly as nodes are.
Theory, eqs. 18 to 20. Source: inertia relief and attachment modes: Craig & Kurdila, Fundamentals of Structural
Dynamics (2006), ch. 17.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.factor import FactorError
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.repeated import RepeatedFactor
from gearfmu.fem.solver import Solves, definite_factor, symmetric_factor
from gearfmu.reduction.full_order import FullOrder

_NEAR = 1e-4  # relative distance of a shift to an eigenvalue at which it moves
_GUESSED = 1e-3  # the same for an eigenvalue that is only estimated
_MOVE = 3e-3  # by how much it moves
_SHAPES = 1e-7  # residual of mode shapes, relative; ω² is then exact to 1e-14
_RANK = 1e-12  # relative size at which a small symmetric system counts as singular
_KNOWN: WeakKeyDictionary[FullOrder, Elastic] = WeakKeyDictionary()


def elastic(body: FullOrder) -> Elastic:
    """The operators of a body, made once for each FullOrder object: factors and modes are kept with it."""
    if body not in _KNOWN:
        _KNOWN[body] = Elastic(body)
    return _KNOWN[body]


class Elastic:
    """Operators of a body under its constraints; vectors are (N, k).

    rigid : (N, r) mass-normalised rigid modes that nothing holds. elastic : number of elastic degrees of freedom.
    twin : operators of the same body with other constraints, whose factor is used. pieces : factors and modes that were
    made once and are kept.
    """

    dtype = float

    def __init__(self, body: FullOrder, twin: Elastic | None = None):
        self._twin = twin
        self.pieces: dict[str, Any] = {}
        self.stiffness, self.mass_matrix = body.stiffness, body.mass
        self.cells, self.node_of_dof, self.size = body.cells, body.node_of_dof, body.size
        self.parts = body.parts
        self._kernel = body.rigid
        empty = sp.csr_array((0, body.size))
        self.constraints = empty if body.constraints is None else body.constraints
        self.rigid = self._free_motions()
        self._mass_rigid = self.mass_matrix @ self.rigid
        self.elastic = body.size - self.rigid.shape[1] - self.constraints.shape[0]

    def kept(self, name: str, make: Callable[[], Any]) -> Any:
        """What is kept under `name`, made now if it is not there."""
        if name not in self.pieces:
            self.pieces[name] = make()
        return self.pieces[name]

    def _free_motions(self) -> np.ndarray:
        fields = self._kernel
        if not fields.shape[1]:
            return fields
        fields = fields / np.sqrt(np.einsum("ij,ij->j", fields, self.mass_matrix @ fields))
        held = self.constraints @ fields
        if len(held):
            held = held / (np.abs(held).max(axis=1, initial=0.0)[:, None] + np.finfo(float).tiny)
            fields = fields @ sl.null_space(held, rcond=1e-9)
        gram = fields.T @ (self.mass_matrix @ fields)
        return sl.solve_triangular(np.linalg.cholesky(gram), fields.T, lower=True).T

    def mass(self, vectors: np.ndarray) -> np.ndarray:
        """M v."""
        product: np.ndarray = self.mass_matrix @ vectors
        return product

    def balance(self, loads: np.ndarray) -> np.ndarray:
        """Pᵀ f: loads together with the inertia forces of the rigid motion they cause."""
        return loads - self._mass_rigid @ (self.rigid.T @ loads)

    def gauge(self, vectors: np.ndarray) -> np.ndarray:
        """P u: displacement without its rigid part and, against rounding, without what C would still see of it."""
        if self.constraints.shape[0]:
            vectors = vectors - self.constraints.T @ self._spread.solve(self.constraints @ vectors)
        return vectors - self.rigid @ (self._mass_rigid.T @ vectors)

    @cached_property
    def _spread(self) -> _SmallSystem:
        """C Cᵀ."""
        return _SmallSystem((self.constraints @ self.constraints.T).toarray())

    @property
    def _supported(self) -> Solves:
        """The body on statically determinate supports of the kernel of K, where loads find nothing; K⁻¹ of it."""
        if self._twin is not None:
            return self._twin._supported
        return self.kept("factor of K", self._support)

    def _support(self) -> Solves:
        kernel, shared = self._kernel, np.arange(self.size)
        if self.parts is not None:
            shared = np.unique(self.parts.border)
        count = kernel.shape[1]
        held = shared[sl.qr(kernel[shared].T, mode="r", pivoting=True)[1][:count]] if count else np.empty(0, int)
        if self.parts is not None:
            return self.by_parts(0.0, held)
        return _Supported(self, np.setdiff1d(shared, held))

    def by_parts(self, shift: float, held: np.ndarray | None = None) -> RepeatedFactor:
        """K − σM factorised part by part; it is never made as a whole."""
        assert self.parts is not None

        def block(index: np.ndarray) -> sp.csr_array:
            return sp.csr_array(self.stiffness[index][:, index] - shift * self.mass_matrix[index][:, index])

        def product(vectors: np.ndarray) -> np.ndarray:
            image: np.ndarray = self.stiffness @ vectors
            return image - shift * self.mass(vectors) if shift else image

        return RepeatedFactor(block, product, self.parts, (self.cells, self.node_of_dof), held)

    @cached_property
    def _holding(self) -> tuple[np.ndarray, _SmallSystem]:
        """Response to Cᵀ on the supports, and the system of λ and the rigid motion on the supports."""
        response = self._supported.solve(self.constraints.T.toarray())
        coupling, rows = self.constraints @ self._kernel, self.constraints.shape[0]
        zero = np.zeros((coupling.shape[1],) * 2)
        return response, _SmallSystem(np.block([[self.constraints @ response, -coupling], [-coupling.T, zero]]), rows)

    def flexibility(self, loads: np.ndarray) -> np.ndarray:
        """The static response to loads (N, k): P K⁺ Pᵀ f for a free body, with what is held held."""
        balanced = self.balance(loads)
        solution = self._supported.solve(balanced)
        if self.constraints.shape[0]:
            response, system = self._holding
            rows = self.constraints.shape[0]
            known = np.vstack([self.constraints @ solution, -self._kernel.T @ balanced])
            small = system.solve(known)
            solution = solution - response @ small[:rows] + self._kernel @ small[rows:]
        return self.gauge(solution)

    def shifted(self, shift: float, near: np.ndarray | None = None) -> Shifted:
        """Solutions at a shift, rad²/s²; one within 1e-4 of an eigenvalue moves by 0.3 % and more until it is not.

        near : estimates of eigenvalues, as far as they are known; a shift at one of them moves before it is factorised.
        The last two are kept."""
        name = f"factor at {shift:.12g}"
        for old in [key for key in self.pieces if key.startswith("factor at") and key != name][:-1]:
            if name not in self.pieces:
                del self.pieces[old]
        return self.kept(name, lambda: self._clear_of_eigenvalues(shift, near))

    def _clear_of_eigenvalues(self, shift: float, near: np.ndarray | None) -> Shifted:
        known = np.empty(0) if near is None else near
        for attempt in range(1, 9):
            try:
                if not np.any(np.abs(known - shift) < _GUESSED * shift):
                    found = Shifted(self, shift)
                    if shift <= 0 or found.distance() > _NEAR * shift:
                        return found
            except FactorError:
                assert shift > 0, "K − σM of a negative shift is positive definite"
            shift *= 1 + attempt * _MOVE
        raise FactorError(f"no shift near {shift:.6g} rad²/s² is far enough from every eigenvalue")

    def modes(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The `count` lowest elastic modes (fewer when the body has fewer): ω² (k,) and mass-normalised shapes (N, k).

        Raises ModesError."""
        if "modes" in self.pieces and len(self.pieces["modes"][0]) < min(count, self.elastic):
            del self.pieces["modes"]
        block = 24 if count > 60 else 8
        squared, shapes = self.kept("modes", lambda: lowest_modes(self, count, _SHAPES, block))
        return squared[:count], shapes[:, :count]


class _Supported:
    """K⁻¹ of a body of which only the unknowns `free` move."""

    def __init__(self, space: Elastic, free: np.ndarray):
        matrix = sp.csr_array(space.stiffness[free][:, free])
        self._free, self._factor = free, definite_factor(matrix, space.cells, space.node_of_dof[free])

    def solve(self, loads: np.ndarray) -> np.ndarray:
        solution = np.zeros(loads.shape)
        solution[self._free] = self._factor.solve(loads[self._free])
        return solution


class Shifted:
    """(K − σM)⁻¹ with what is held held. `shift` : σ as it is, perhaps moved."""

    def __init__(self, space: Elastic, shift: float):
        self.shift, self.space = shift, space
        self._factor = self._factorised()
        self._response = self._factor.solve(space.constraints.T.toarray()) if space.constraints.shape[0] else None
        if self._response is not None:
            self._system = _SmallSystem(space.constraints @ self._response)

    def _factorised(self) -> Solves:
        space = self.space
        if space.parts is not None:
            return space.by_parts(self.shift)
        matrix = sp.csr_array(space.stiffness - self.shift * space.mass_matrix)
        return symmetric_factor(matrix, space.cells, space.node_of_dof)

    def solve(self, loads: np.ndarray) -> np.ndarray:
        """(K − σM)⁻¹ f under the constraints, loads (N, k)."""
        solution = self._factor.solve(loads)
        if self._response is None:
            return solution
        return solution - self._response @ self._system.solve(self.space.constraints @ solution)

    def distance(self) -> float:
        """About |ω² − σ| of the nearest eigenvalue, rad²/s², from above: 1/‖(K − σM)⁻¹Mv‖ in M after inverse iteration
        from fixed random vectors. A quotient of products instead of norms would cancel where eigenvalues lie on either
        side of σ."""
        mass = self.space.mass_matrix
        vectors = np.random.default_rng(2).standard_normal((self.space.size, 2))
        for _ in range(2):
            loads = mass @ vectors
            vectors = self.solve(loads / np.sqrt(np.einsum("ij,ij->j", vectors, loads)))
        return float(1 / np.sqrt(np.einsum("ij,ij->j", vectors, mass @ vectors).max()))


class _SmallSystem:
    """Symmetric system, scaled; directions that do not matter (dependent rows) are left out.

    The first `forces` rows are scaled to unit diagonal (those that the supports hold have none: as the smallest), the
    others, which never have one, to unit coupling with them."""

    def __init__(self, matrix: np.ndarray, forces: int | None = None):
        tiny = np.finfo(float).tiny
        diagonal = np.abs(matrix.diagonal()[:forces])
        smallest = diagonal[diagonal > 1e-12 * diagonal.max(initial=0.0)].min(initial=np.inf)
        first = 1 / np.sqrt(np.maximum(diagonal, smallest if np.isfinite(smallest) else 1.0) + tiny)
        second = np.abs(matrix[len(first) :, : len(first)] * first).max(axis=1, initial=0.0)
        self._scale = np.concatenate([first, 1 / np.where(second > 0, second, 1.0)])
        scaled = matrix * np.outer(self._scale, self._scale)
        values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
        keep = np.abs(values) > _RANK * np.abs(values).max(initial=0.0)
        self._values, self._vectors = values[keep], vectors[:, keep]

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """A⁺ rhs."""
        scaled = self._vectors.T @ (self._scale[:, None] * rhs)
        return self._scale[:, None] * (self._vectors @ (scaled / self._values[:, None]))
