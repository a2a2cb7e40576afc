"""PyUnit: a torsional network as a unit. Exact between events for inputs linear in time; clutches stick and slip at
exact instants."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from gearfmu.cosim.dynamics import Dynamics, Mode
from gearfmu.cosim.events import Attempt, Event, first_event, initial_mode, switch
from gearfmu.cosim.network import Network
from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError

MAX_EVENTS = 200  # within one micro-step; more means that the parts have no solution or the step is absurdly long


@dataclass
class _State:
    """Everything that changes."""

    time: float
    x: np.ndarray  # (states,); replaced, never changed in place, so that states may share it
    mode: Mode
    torque: np.ndarray  # (n,) port torques, N·m, held over the step
    motion: np.ndarray  # (d, 3) φ, w, a of the driven nodes at the start of the step
    tau_mean: np.ndarray  # (d,) N·m
    work: float  # J, of the motion ports on the network since the start
    events: tuple[Event, ...]

    def copy(self) -> _State:
        return _State(
            self.time,
            self.x,
            self.mode,
            self.torque.copy(),
            self.motion.copy(),
            self.tau_mean.copy(),
            self.work,
            self.events,
        )


class Handle(NamedTuple):
    """Resolved names. `outputs`: positions for get; `inputs`: (kind, position) for set; None where a name is of the
    other kind only."""

    names: tuple[str, ...]
    outputs: np.ndarray | None
    inputs: tuple[tuple[str, int], ...] | None
    special: np.ndarray  # places of outputs that are not linear in state and input
    buffer: np.ndarray


KEYS = {
    "phi": Variable("rad", "angle"),
    "w": Variable("rad/s", "speed"),
    "a": Variable("rad/s2", "acceleration"),
    "tau": Variable("N.m", "torque"),
    "tau_mean": Variable("N.m", "mean torque of the step"),
    "extension": Variable("rad", "twist of the spring"),
    "slip": Variable("rad/s", "slip speed"),
    "locked": Variable("", "true while the clutch sticks", True),
    "work": Variable("J", "work of the motion ports since the start"),
    "stored": Variable("J", "kinetic and potential energy"),
}


def _variable(name: str) -> Variable:
    part, key = name.rsplit(".", 1)
    about = KEYS[key]
    return about if part == "energy" else about._replace(description=f"{part}: {about.description}")


class PyUnit:
    """Unit of a Network.

    Inputs: `<port>.tau` of a torque port (torque on the node, held over the step); `<port>.phi`, `.w`, `.a` of a
    motion port: the node moves with constant acceleration; a difference between the given angle and the one it has
    reached is blended over the step. Outputs: `.phi`, `.w`, `.a` of ports and nodes, `.tau` (torque on the outside)
    and `.tau_mean` of motion ports, `.tau` and `.extension` of springs, `.tau`, `.slip`, `.locked` of clutches,
    `.tau` of sources, `energy.work`, `energy.stored`.

    micro_step : s, largest step between evaluations of sources and events; None: the communication step. Sources are
    taken linear over a micro-step between their values at its ends (predictor and corrector, second order);
    everything else is exact. An event that comes and goes within a micro-step is not seen.
    """

    def __init__(self, network: Network, micro_step: float | None = None) -> None:
        self.network, self.dynamics, self.micro_step = network, Dynamics(network), micro_step
        d = self.dynamics
        self._torque_ports = {port: d.node[node] for port, node in network.torque_ports.items()}
        self._motion_ports = {port: d.driven.index(d.node[node]) for port, node in network.motion_ports.items()}
        self._sources = [(d.node[source.node], source.torque) for source in network.sources]
        self._clutches = slice(d.n, d.n + d.n_clutches)
        self._hybrid = bool(d.n_clutches or d.gaps)
        self._outputs = self._name_outputs()
        self._output_rows: dict[tuple[tuple[str, ...], Mode], np.ndarray] = {}
        self._z = np.zeros(d.states + 2 * d.inputs)
        self._x0, self._u0, self._u1 = np.split(self._z, [d.states, d.states + d.inputs])
        self._state = self._start(0.0)

    # -- life ----------------------------------------------------------------------------------------------------------
    def initialize(self, time: float) -> None:
        """Start at `time` from the initial angles and speeds of the nodes; what motion ports were given before
        replaces that of their nodes."""
        d, given = self.dynamics, self._state
        self._state = state = self._start(time)
        state.torque[:] = given.torque
        for k in self._motion_ports.values():
            node = d.driven[k]
            state.motion[k] = given.motion[k]
            state.x[node], state.x[d.n + node] = given.motion[k, :2]
        state.mode = initial_mode(d, state.x, self._inputs(time, state.x), self._capacity(time, time)[0])

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

    # -- variables -----------------------------------------------------------------------------------------------------
    def resolve(self, names: Sequence[str]) -> Handle:
        """Handle of variables; raises CouplingError with the known names."""
        inputs = {f"{port}.tau": ("torque", k) for port, k in self._torque_ports.items()}
        for port, k in self._motion_ports.items():
            inputs |= {f"{port}.{key}": ("motion", 3 * k + i) for i, key in enumerate(("phi", "w", "a"))}
        unknown = [name for name in names if name not in self._outputs and name not in inputs]
        if unknown:
            known = f"inputs: {', '.join(sorted(inputs))}; outputs: {', '.join(sorted(self._outputs))}"
            raise CouplingError(f"no variable {', '.join(unknown)}; {known}")
        outputs = (
            np.array([self._outputs[name] for name in names], dtype=int)
            if all(name in self._outputs for name in names)
            else None
        )
        places = tuple(inputs[name] for name in names) if all(name in inputs for name in names) else None
        special = (
            np.flatnonzero(outputs >= len(self.dynamics.output_names))
            if outputs is not None
            else np.zeros(0, dtype=int)
        )
        return Handle(tuple(names), outputs, places, special, np.zeros(len(names)))

    def outputs(self) -> dict[str, Variable]:
        """All outputs by name."""
        return {name: _variable(name) for name in self._outputs}

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
        state, rows = self._state, self._rows(handle)
        if rows.shape[1] > self.dynamics.states:
            np.dot(rows, np.concatenate([state.x, self._inputs(state.time, state.x)]), out=handle.buffer)
        else:
            np.dot(rows, state.x, out=handle.buffer)
        for place in handle.special:
            handle.buffer[place] = self._special[handle.outputs[place]]()
        return handle.buffer

    def _rows(self, handle: Handle) -> np.ndarray:
        """Rows of the outputs on [x, u], or on x alone when no input reaches them, kept for each mode."""
        key = (handle.names, self._state.mode)
        if key not in self._output_rows:
            m, states = self.dynamics.matrices(self._state.mode), self.dynamics.states
            rows = np.zeros((len(handle.names), states + self.dynamics.inputs))
            linear = np.setdiff1d(np.arange(len(handle.names)), handle.special)
            rows[linear] = np.hstack([m.c, m.d])[handle.outputs[linear]]
            self._output_rows[key] = rows if rows[:, states:].any() else np.ascontiguousarray(rows[:, :states])
        return self._output_rows[key]

    # -- stepping ------------------------------------------------------------------------------------------------------
    def step(self, time: float, h: float) -> None:
        """From `time` to time + h."""
        state, d = self._state, self.dynamics
        if d.n_driven:
            self._start_motion(h)
        count = max(1, math.ceil(h / self.micro_step - 1e-9)) if self.micro_step else 1
        for k in range(count):
            (self._hybrid_step if self._hybrid else self._smooth_step)(time + h * k / count, h / count)
        state.time = time + h
        if d.n_driven:
            self._end_motion(h)

    def _start_motion(self, h: float) -> None:
        state, d = self._state, self.dynamics
        state.x = state.x.copy()
        state.x[2 * d.n :] = 0.0
        for k in self._motion_ports.values():
            phi, w, _ = state.motion[k]
            state.x[d.n + d.driven[k]] = w + (phi - state.x[d.driven[k]]) / h

    def _end_motion(self, h: float) -> None:
        state, d = self._state, self.dynamics
        state.tau_mean[:] = state.x[2 * d.n :] / h
        for k in self._motion_ports.values():
            _, w, a = state.motion[k]
            state.x[d.n + d.driven[k]] = w + a * h

    def _smooth_step(self, time: float, h: float) -> None:
        """One micro-step without clutches and backlash: straight through preset memory."""
        state, d = self._state, self.dynamics
        s = d.transition(state.mode, h)
        self._u0[d.n :] = self._u1[d.n :] = 0.0
        self._u0[-1] = self._u1[-1] = 1.0
        if d.n_driven:
            self._u0[d.n : -1] = self._u1[d.n : -1] = state.motion[:, 2]
        self._x0[:] = state.x
        self._node_torques(self._u0, time, state.x)
        self._u1[: d.n] = self._u0[: d.n]
        x1 = s.dot(self._z)
        if self._sources:
            self._node_torques(self._u1, time + h, x1)
            x1 = s.dot(self._z)
        self._advance(x1)

    def _hybrid_step(self, time: float, h: float) -> None:
        state, d, done = self._state, self.dynamics, 0.0
        for _ in range(MAX_EVENTS):
            start, rest = time + done, h - done
            capacity = self._capacity(start, time + h)
            u0, u1 = self._inputs(start, state.x, capacity[0]), self._inputs(start, state.x, capacity[1])
            x1, u1 = self._attempt(start, rest, u0, u1, keep=done == 0.0)
            found = first_event(d, state.mode, Attempt(state.x, u0, x1, u1, *capacity, rest))
            self._advance(x1 if found is None else found.x)
            if found is None:
                return
            state.x = state.x.copy()
            state.mode = switch(d, state.mode, found, state.x)
            state.events += (Event(start + found.fraction * rest, found.part, found.what(state.mode)),)
            done += found.fraction * rest
            if done >= h:
                return
        raise CouplingError(
            f"more than {MAX_EVENTS} stick–slip or backlash events between {time} and {time + h} s; "
            "choose a shorter micro_step"
        )

    def _attempt(
        self, time: float, h: float, u0: np.ndarray, u1: np.ndarray, keep: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """State at the end of a step in the present mode, and the input there with the sources at that state."""
        d = self.dynamics
        s = (d.transition if keep else d.transition_once)(self._state.mode, h)
        self._x0[:], self._u0[:], self._u1[:] = self._state.x, u0, u1
        x1 = s.dot(self._z)
        if self._sources:
            self._node_torques(u1, time + h, x1)
            self._u1[:] = u1
            x1 = s.dot(self._z)
        return x1, u1

    def _advance(self, x1: np.ndarray) -> None:
        state, d = self._state, self.dynamics
        for k in self._motion_ports.values():
            impulse, node = 2 * d.n + k, d.driven[k]
            state.work -= (x1[impulse] - state.x[impulse]) * 0.5 * (state.x[d.n + node] + x1[d.n + node])
        state.x = x1

    # -- inputs and outputs --------------------------------------------------------------------------------------------
    def _start(self, time: float) -> _State:
        d, nodes = self.dynamics, self.network.nodes
        x = np.array([p.phi for p in nodes] + [p.w for p in nodes] + [0.0] * d.n_driven, dtype=float)
        motion = np.array([[nodes[k].phi, nodes[k].w, 0.0] for k in d.driven], dtype=float).reshape(-1, 3)
        state = _State(
            time, x, ((0,) * d.n_clutches, (0,) * len(d.gaps)), np.zeros(d.n), motion, np.zeros(d.n_driven), 0.0, ()
        )
        self._state = state
        state.mode = initial_mode(d, x, self._inputs(time, x), self._capacity(time, time)[0])
        return state

    def _node_torques(self, u: np.ndarray, time: float, x: np.ndarray) -> None:
        """Port torques and sources into the first n places of u."""
        n = self.dynamics.n
        u[:n] = self._state.torque
        for node, function in self._sources:
            u[node] += function(time, x.item(node), x.item(n + node))

    def _inputs(self, time: float, x: np.ndarray, capacity: np.ndarray | None = None) -> np.ndarray:
        d = self.dynamics
        u = np.zeros(d.inputs)
        u[-1] = 1.0
        self._node_torques(u, time, x)
        if d.n_driven:
            u[self._clutches.stop : -1] = self._state.motion[:, 2]
        if d.n_clutches:
            u[self._clutches] = self._state.mode[0] * (self._capacity(time, time)[0] if capacity is None else capacity)
        return u

    def _capacity(self, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
        ends = [clutch.capacity.ends(t0, t1) for clutch in self.network.clutches]
        return np.array([max(e[0], 0.0) for e in ends]), np.array([max(e[1], 0.0) for e in ends])

    def energy(self) -> float:
        """Kinetic energy of the inertias and potential energy of the springs, J."""
        x, d = self._state.x, self.dynamics
        energy = sum(0.5 * x[d.n + k] ** 2 / m for k, m in enumerate(d.inverse_inertia) if m > 0)
        for row, spring in zip(d.extension, self.network.springs, strict=True):
            s = float(row @ x[: d.n])
            stretched = s if s > 0 or not spring.backlash else min(s + spring.backlash, 0.0)
            energy += 0.5 * spring.k * stretched**2
        return float(energy)

    def _special_outputs(self) -> dict[str, Callable[[], float]]:
        """Outputs that are not linear in state and input."""
        network, d = self.network, self.dynamics
        found = {f"{network.nodes[node].name}.tau_mean": partial(self._mean, k) for k, node in enumerate(d.driven)}
        found |= {f"{clutch.name}.locked": partial(self._locked, k) for k, clutch in enumerate(network.clutches)}
        found |= {
            f"{source.name}.tau": partial(self._source, d.node[source.node], source.torque)
            for source in network.sources
        }
        return found | {"energy.work": lambda: self._state.work, "energy.stored": self.energy}

    def _mean(self, k: int) -> float:
        return float(self._state.tau_mean[k])

    def _locked(self, k: int) -> float:
        return float(self._state.mode[0][k] == 0)

    def _source(self, node: int, torque: Callable[[float, float, float], float]) -> float:
        return torque(self._state.time, float(self._state.x[node]), float(self._state.x[self.dynamics.n + node]))

    def _name_outputs(self) -> dict[str, int]:
        """Position of every output: the linear ones, then the special ones, then the ports' names for some of both."""
        network, names, special = self.network, dict(self.dynamics.output_names), self._special_outputs()
        first = len(names)
        names |= {name: first + k for k, name in enumerate(special)}
        self._special = dict(enumerate(special.values(), start=first))
        for port, node in network.torque_ports.items():
            names |= {f"{port}.{key}": names[f"{node}.{key}"] for key in ("phi", "w", "a")}
        for port, node in network.motion_ports.items():
            names |= {f"{port}.{key}": names[f"{node}.{key}"] for key in ("tau", "tau_mean")}
        return names
