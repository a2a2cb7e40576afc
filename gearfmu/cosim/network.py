"""A torsional network: inertias, nodes of constant speed, springs, clutches, torque sources and ports. It is linear
between events, with one set of matrices for each mode, and its states are propagated exactly by matrix exponentials.

State   x = [φ (n), w (n), impulse on every driven node (d)]
Input   u = [torque on every node (n), capacity·sign of every slipping clutch (c)]
Mode    a sign for every clutch: 0 sticks, ±1 slips with that sign of the slip.

With W = M⁻¹ − M⁻¹DᵀG⁻¹DM⁻¹, G = DM⁻¹Dᵀ and D the slip rows of the sticking clutches, the accelerations are W f and the
sticking torques G⁻¹D M⁻¹ f (Lagrange multipliers; f: all other torques; M⁻¹ = 0 at driven nodes).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np
from scipy.linalg import expm

from gearfmu.cosim.signals import Ramp


@dataclass(frozen=True)
class Inertia:
    """A rigid inertia, kg·m², with its initial angle, rad, and speed, rad/s."""

    name: str
    inertia: float
    phi: float = 0.0
    w: float = 0.0


@dataclass(frozen=True)
class Driven:
    """A node that turns at the constant speed w, rad/s, whatever the torque on it."""

    name: str
    phi: float = 0.0
    w: float = 0.0


@dataclass(frozen=True)
class Spring:
    """Spring k and damper c on the extension s = Σ factor·φ of the nodes in `on`.

    Torque on a node = −factor·(k·s + c·ds/dt). Factors 1 and −1: a shaft, k in N·m/rad. Radii: a gear pair, k in N/m.
    """

    name: str
    on: Mapping[str, float]
    k: float
    c: float = 0.0


@dataclass(frozen=True)
class Clutch:
    """Dry clutch between nodes a and b. Slip = w_a − w_b; its torque drives b and brakes a.

    `capacity`: torque it transmits when it slips, N·m; when it sticks it holds up to `peak` times that.
    """

    name: str
    a: str
    b: str
    capacity: Ramp
    peak: float = 1.0


@dataclass(frozen=True)
class Source:
    """Torque on a node, N·m, as a function (time, angle, speed) of that node."""

    name: str
    node: str
    torque: Callable[[float, float, float], float]


@dataclass(frozen=True)
class Network:
    """The whole network. `torque_ports`: port → node (torque in, motion out; a driven node yields to no torque)."""

    nodes: tuple[Inertia | Driven, ...]
    springs: tuple[Spring, ...] = ()
    clutches: tuple[Clutch, ...] = ()
    sources: tuple[Source, ...] = ()
    torque_ports: Mapping[str, str] = field(default_factory=dict)


Mode = tuple[int, ...]
CACHE_SIZE = 512  # transitions kept; a run uses one or two step sizes and a handful of modes


@dataclass(frozen=True)
class ModeMatrices:
    """x' = A x + B u and the outputs y = C x + D u in the order of `Dynamics.output_names`."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray


class Dynamics:
    """Matrices of a network for every mode, formed once and kept; immutable from outside, so that units may share
    it."""

    def __init__(self, network: Network) -> None:
        self.network = network
        self.node = {node.name: k for k, node in enumerate(network.nodes)}
        self.driven = [k for k, node in enumerate(network.nodes) if isinstance(node, Driven)]
        self.n, self.n_clutches, self.n_driven = len(network.nodes), len(network.clutches), len(self.driven)
        self.inverse_inertia = np.array([1.0 / p.inertia if isinstance(p, Inertia) else 0.0 for p in network.nodes])
        self.extension = np.zeros((len(network.springs), self.n))
        for row, spring in zip(self.extension, network.springs, strict=True):
            for name, factor in spring.on.items():
                row[self.node[name]] += factor
        self.slip = np.zeros((self.n_clutches, self.n))
        for row, clutch in zip(self.slip, network.clutches, strict=True):
            row[self.node[clutch.a]] += 1.0
            row[self.node[clutch.b]] -= 1.0
        self.states, self.inputs = 2 * self.n + self.n_driven, self.n + self.n_clutches
        self.output_names = _output_names(network)
        self.matrices = cache(self._build)  # of one mode
        self.transition = lru_cache(maxsize=CACHE_SIZE)(self.transition_once)  # kept; at an event it is used once

    def transition_once(self, mode: Mode, h: float) -> np.ndarray:
        """S (states, states + 2·inputs) with x(h) = S [x(0), u(0), u(h)], exact for an input that is linear in time.
        Van Loan, IEEE Trans. Autom. Control 23 (1978) 395."""
        m, nx, nu = self.matrices(mode), self.states, self.inputs
        block = np.zeros((nx + 2 * nu, nx + 2 * nu))
        block[:nx, :nx], block[:nx, nx : nx + nu] = m.a * h, m.b * h
        block[nx : nx + nu, nx + nu :] = np.eye(nu)
        e = expm(block)[:nx]
        ramp = e[:, nx + nu :]
        return np.ascontiguousarray(np.hstack([e[:, :nx], e[:, nx : nx + nu] - ramp, ramp]))

    def _build(self, mode: Mode) -> ModeMatrices:
        n, nx, nu = self.n, self.states, self.inputs
        k, c = (np.array([getattr(spring, name) for spring in self.network.springs])[:, None] for name in "kc")
        spring = np.hstack([self.extension * k, self.extension * c, np.zeros((len(k), self.n_driven))])
        slipping = np.array(mode, dtype=bool)
        f_x, f_u = -self.extension.T @ spring, np.hstack([np.eye(n), -self.slip.T * slipping])
        free_x, free_u = self.inverse_inertia[:, None] * f_x, self.inverse_inertia[:, None] * f_u
        stick_x, stick_u = self._stick_torques(slipping, free_x, free_u)
        clutch_to_node = -self.inverse_inertia[:, None] * self.slip.T
        acc_x, acc_u = free_x + clutch_to_node @ stick_x, free_u + clutch_to_node @ stick_u
        on_x, on_u = (f_x - self.slip.T @ stick_x)[self.driven], (f_u - self.slip.T @ stick_u)[self.driven]
        a, b = np.zeros((nx, nx)), np.zeros((nx, nu))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n], b[n : 2 * n], a[2 * n :], b[2 * n :] = acc_x, acc_u, on_x, on_u
        stick_u[:, n:] += np.diag(slipping.astype(float))
        return ModeMatrices(a, b, *self._outputs(a, b, spring, (stick_x, stick_u)))

    def _stick_torques(
        self, slipping: np.ndarray, free_x: np.ndarray, free_u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        stick_x, stick_u = np.zeros((self.n_clutches, self.states)), np.zeros((self.n_clutches, self.inputs))
        rows = self.slip[~slipping]
        if len(rows):
            delassus = rows * self.inverse_inertia @ rows.T
            stick_x[~slipping] = np.linalg.solve(delassus, rows @ free_x)
            stick_u[~slipping] = np.linalg.solve(delassus, rows @ free_u)
        return stick_x, stick_u

    def _outputs(
        self, a: np.ndarray, b: np.ndarray, spring: np.ndarray, clutch: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        n, nx, nu = self.n, self.states, self.inputs
        extension, slip = np.zeros_like(spring), np.zeros((self.n_clutches, nx))
        extension[:, :n], slip[:, n : 2 * n] = self.extension, self.slip
        c = np.vstack([np.eye(2 * n, nx), a[n:], spring, extension, clutch[0], slip])
        rest = [b[n:], np.zeros((2 * len(spring), nu)), clutch[1], np.zeros((self.n_clutches, nu))]
        return c, np.vstack([np.zeros((2 * n, nu)), *rest])


def _output_names(network: Network) -> dict[str, int]:
    nodes, springs = [p.name for p in network.nodes], [p.name for p in network.springs]
    clutches, driven = [p.name for p in network.clutches], [p.name for p in network.nodes if isinstance(p, Driven)]
    names = [f"{name}.{key}" for key in ("phi", "w", "a") for name in nodes] + [f"{name}.tau" for name in driven]
    names += [f"{name}.{key}" for key in ("tau", "extension") for name in springs]
    names += [f"{name}.{key}" for key in ("tau", "slip") for name in clutches]
    return {name: k for k, name in enumerate(names)}
