"""PyUnit: a torsional network as a unit. Exact between events for inputs linear in time; clutches stick and slip at exact instants."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gearfmu.cosim.dynamics import Dynamics, Mode
from gearfmu.cosim.events import Event, Margins, first_event, initial_mode, switch
from gearfmu.cosim.network import Network
from gearfmu.errors import CouplingError

MAX_EVENTS = 200  # within one step; more means the parts have no solution (or the step is absurdly long)


@dataclass
class _State:
    """Everything that changes."""

    time: float
    x: np.ndarray  # (states,)
    mode: Mode
    torque: np.ndarray  # (n,) port torques, N·m, held over the step
    motion: np.ndarray  # (d, 3) φ, w, a of the driven nodes at the start of the step
    tau_mean: np.ndarray  # (d,) N·m
    work: float  # J, of the motion ports on the network since the start
    events: tuple[Event, ...]

    def copy(self) -> _State:
        return replace(self, x=self.x.copy(), torque=self.torque.copy(), motion=self.motion.copy(), tau_mean=self.tau_mean.copy())


class Handle(NamedTuple):
    """Resolved names: `outputs` for get, `inputs` = flat positions for set (None where a name is no input)."""

    names: tuple[str, ...]
    outputs: np.ndarray | None
    inputs: tuple[tuple[str, int], ...] | None
    buffer: np.ndarray


class PyUnit:
    """Unit of a Network.

    Inputs: `<port>.tau` of a torque port (torque on the node, held over the step); `<port>.phi`, `.w`, `.a` of a motion port: the node moves with constant
    acceleration; a difference between the given angle and the one it has reached is blended over the step. Outputs: `.phi`, `.w`, `.a` of ports and nodes,
    `.tau` (torque on the outside) and `.tau_mean` of motion ports, `.tau` and `.extension` of springs, `.tau`, `.slip`, `.locked` of clutches, `.tau` of
    sources, `energy.work`, `energy.stored`.

    micro_step : s, largest step between evaluations of sources and events; None: the communication step. Sources are taken linear over a micro-step between
    their values at its ends (predictor and corrector, second order); everything else is exact. An event that comes and goes within a micro-step is not seen.
    """

    def __init__(self, network: Network, micro_step: float | None = None) -> None:
        self.network, self.dynamics, self.micro_step = network, Dynamics(network), micro_step
        d = self.dynamics
        self._torque_ports = {port: d.node[node] for port, node in network.torque_ports.items()}
        self._motion_ports = {port: d.driven.index(d.node[node]) for port, node in network.motion_ports.items()}
        self._sources = [(d.node[source.node], source.torque) for source in network.sources]
        self._hybrid = bool(d.n_clutches or d.gaps)
        self._outputs = self._name_outputs()
        self._z = np.zeros(d.states + 2 * d.inputs)
        self._state = self._start(0.0)

    # -- life -------------------------------------------------------------------------------------------------------------------------------------------
    def initialize(self, time: float) -> None:
        """Start at `time` from the initial angles and speeds of the nodes; what motion ports were given before replaces that of their nodes."""
        given, torque = self._state.motion, self._state.torque
        self._state = self._start(time)
        self._state.torque[:] = torque
        for k in self._motion_ports.values():
            node = self.dynamics.driven[k]
            self._state.motion[k] = given[k]
            self._state.x[node], self._state.x[self.dynamics.n + node] = given[k, :2]
        self._state.mode = initial_mode(self.dynamics, self._state.x, self._inputs(time, self._state.x), self._capacity(time, time)[0])

    def save(self) -> _State:
        """A copy of everything that changes."""
        return self._state.copy()

    def restore(self, state: _State) -> None:
        """Back to a saved state."""
        self._state = state.copy()

    @property
    def events(self) -> tuple[Event, ...]:
        """Instants at which a clutch locked or slipped or a backlash closed or opened, in order."""
        return self._state.events

    # -- variables --------------------------------------------------------------------------------------------------------------------------------------
    def resolve(self, names: Sequence[str]) -> Handle:
        """Handle of variables; raises CouplingError with the known names."""
        inputs = {f"{port}.tau": ("torque", k) for port, k in self._torque_ports.items()}
        for port, k in self._motion_ports.items():
            inputs |= {f"{port}.{key}": ("motion", 3 * k + i) for i, key in enumerate(("phi", "w", "a"))}
        unknown = [name for name in names if name not in self._outputs and name not in inputs]
        if unknown:
            raise CouplingError(f"no variable {', '.join(unknown)}; inputs: {', '.join(sorted(inputs))}; outputs: {', '.join(sorted(self._outputs))}")
        outputs = np.array([self._outputs[name] for name in names]) if all(name in self._outputs for name in names) else None
        places = tuple(inputs[name] for name in names) if all(name in inputs for name in names) else None
        return Handle(tuple(names), outputs, places, np.zeros(len(names)))

    def set(self, handle: Handle, values: Sequence[float]) -> None:
        """Inputs for the next step."""
        if handle.inputs is None:
            raise CouplingError(f"not all of {', '.join(handle.names)} are inputs")
        state = self._state
        for (kind, k), value in zip(handle.inputs, values, strict=True):
            (state.torque if kind == "torque" else state.motion.reshape(-1))[k] = value

    def get(self, handle: Handle) -> np.ndarray:
        """Values (k,) at the current time, in the handle's buffer."""
        if handle.outputs is None:
            raise CouplingError(f"not all of {', '.join(handle.names)} are outputs")
        state, m = self._state, self.dynamics.matrices(self._state.mode)
        u = self._inputs(state.time, state.x)
        linear = m.c @ state.x + m.d @ u
        handle.buffer[:] = np.concatenate([linear, self._other_outputs(u)])[handle.outputs]
        return handle.buffer

    # -- stepping ---------------------------------------------------------------------------------------------------------------------------------------
    def step(self, time: float, h: float) -> None:
        """From `time` to time + h."""
        state = self._state
        state.x[2 * self.dynamics.n :] = 0.0
        self._start_motion(h)
        count = max(1, math.ceil(h / self.micro_step - 1e-9)) if self.micro_step else 1
        for k in range(count):
            self._micro_step(time + h * k / count, h / count)
        state.time = time + h
        state.tau_mean[:] = state.x[2 * self.dynamics.n :] / h
        self._end_motion(h)

    def _start_motion(self, h: float) -> None:
        state, d = self._state, self.dynamics
        for k in self._motion_ports.values():
            phi, w, _ = state.motion[k]
            state.x[d.n + d.driven[k]] = w + (phi - state.x[d.driven[k]]) / h

    def _end_motion(self, h: float) -> None:
        state, d = self._state, self.dynamics
        for k in self._motion_ports.values():
            _, w, a = state.motion[k]
            state.x[d.n + d.driven[k]] = w + a * h

    def _micro_step(self, time: float, h: float) -> None:
        state, done = self._state, 0.0
        full = h
        for _ in range(MAX_EVENTS):
            t0, rest = time + done, full - done
            x0, u0 = state.x, self._inputs(t0, state.x)
            capacity = self._capacity(t0, time + full)
            self._fill_clutches(u0, capacity[0])
            x1, u1 = self._attempt(t0, rest, x0, u0, capacity[1], keep=done == 0.0)
            found = first_event(self.dynamics, state.mode, Margins(x0, u0, x1, u1, *capacity, rest)) if self._hybrid else None
            if found is None:
                self._advance(x1)
                return
            self._advance(found.x)
            state.mode = switch(self.dynamics, state.mode, found, state.x)
            state.events += (Event(t0 + found.fraction * rest, found.part, found.what(state.mode)),)
            done += found.fraction * rest
            if done >= full:
                return
        raise CouplingError(f"more than {MAX_EVENTS} stick–slip or backlash events between {time} and {time + h} s; choose a shorter micro_step")

    def _attempt(self, time: float, h: float, x0: np.ndarray, u0: np.ndarray, capacity: np.ndarray, keep: bool) -> tuple[np.ndarray, np.ndarray]:
        d, z = self.dynamics, self._z
        s = (d.transition if keep else d.transition_once)(self._state.mode, h)
        z[: d.states], z[d.states : d.states + d.inputs] = x0, u0
        u1 = u0.copy()
        self._fill_clutches(u1, capacity)
        z[d.states + d.inputs :] = u1
        x1 = s @ z
        if self._sources:
            u1[: d.n] = self._node_torques(time + h, x1)
            z[d.states + d.inputs :] = u1
            x1 = s @ z
        return x1, u1

    def _advance(self, x1: np.ndarray) -> None:
        state, d = self._state, self.dynamics
        for k in self._motion_ports.values():
            impulse, node = 2 * d.n + k, d.driven[k]
            mean_speed = 0.5 * (state.x[d.n + node] + x1[d.n + node])
            state.work -= (x1[impulse] - state.x[impulse]) * mean_speed
        state.x = x1

    # -- inputs and outputs -----------------------------------------------------------------------------------------------------------------------------
    def _start(self, time: float) -> _State:
        d, nodes = self.dynamics, self.network.nodes
        x = np.array([p.phi for p in nodes] + [p.w for p in nodes] + [0.0] * d.n_driven, dtype=float)
        motion = np.array([[nodes[k].phi, nodes[k].w, 0.0] for k in d.driven], dtype=float).reshape(-1, 3)
        state = _State(time, x, ((0,) * d.n_clutches, (0,) * len(d.gaps)), np.zeros(d.n), motion, np.zeros(d.n_driven), 0.0, ())
        self._state = state
        state.mode = initial_mode(d, x, self._inputs(time, x), self._capacity(time, time)[0])
        return state

    def _node_torques(self, time: float, x: np.ndarray) -> np.ndarray:
        torque, n = self._state.torque.copy(), self.dynamics.n
        for node, function in self._sources:
            torque[node] += function(time, x[node], x[n + node])
        return torque

    def _inputs(self, time: float, x: np.ndarray) -> np.ndarray:
        d = self.dynamics
        u = np.zeros(d.inputs)
        u[: d.n] = self._node_torques(time, x)
        u[d.n + d.n_clutches : -1] = self._state.motion[:, 2]
        u[-1] = 1.0
        if d.n_clutches:
            self._fill_clutches(u, self._capacity(time, time)[0])
        return u

    def _capacity(self, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
        ends = [clutch.capacity.ends(t0, t1) for clutch in self.network.clutches]
        return np.array([max(e[0], 0.0) for e in ends]), np.array([max(e[1], 0.0) for e in ends])

    def _fill_clutches(self, u: np.ndarray, capacity: np.ndarray) -> None:
        n = self.dynamics.n
        u[n : n + self.dynamics.n_clutches] = np.array(self._state.mode[0]) * capacity

    def _other_outputs(self, u: np.ndarray) -> np.ndarray:
        state, d, n = self._state, self.dynamics, self.dynamics.n
        sources = [function(state.time, state.x[node], state.x[n + node]) for node, function in self._sources]
        locked = [float(sign == 0) for sign in state.mode[0]]
        return np.array([*state.tau_mean, *locked, *sources, state.work, self.energy()])

    def energy(self) -> float:
        """Kinetic energy of the inertias and potential energy of the springs, J."""
        state, d = self._state, self.dynamics
        w = state.x[d.n : 2 * d.n]
        energy = sum(0.5 * w[k] ** 2 / m for k, m in enumerate(d.inverse_inertia) if m > 0)
        for row, spring in zip(d.extension, self.network.springs, strict=True):
            s = float(row @ state.x[: d.n])
            stretched = s if s > 0 or not spring.backlash else min(s + spring.backlash, 0.0)
            energy += 0.5 * spring.k * stretched**2
        return energy

    def _name_outputs(self) -> dict[str, int]:
        d, network = self.dynamics, self.network
        names = dict(d.output_names)
        driven = [network.nodes[k].name for k in d.driven]
        other = [f"{name}.tau_mean" for name in driven] + [f"{clutch.name}.locked" for clutch in network.clutches]
        other += [f"{source.name}.tau" for source in network.sources] + ["energy.work", "energy.stored"]
        first = len(names)
        names |= {name: first + k for k, name in enumerate(other)}
        aliases = {}
        for port, node in network.torque_ports.items():
            aliases |= {f"{port}.{key}": names[f"{node}.{key}"] for key in ("phi", "w", "a")}
        for port, node in network.motion_ports.items():
            aliases |= {f"{port}.{key}": names[f"{node}.{key}"] for key in ("tau", "tau_mean")}
        return names | aliases
