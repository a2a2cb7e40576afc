"""PyUnit: a torsional network as a unit. Exact between events for inputs linear in time; clutches stick and slip at
exact instants."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gearfmu.cosim.events import Attempt, Event, first_event, initial_mode, switch
from gearfmu.cosim.network import Dynamics, Mode, Network
from gearfmu.cosim.py_outputs import NetworkLog, Outputs, State
from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError

MAX_EVENTS = 200  # within one micro-step; more means that the parts have no solution or the step is absurdly long


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


Loads = list[tuple[int, tuple[int, ...], tuple[Callable[[float, float, float], float], ...]]]


def _loads(network: Network, numbers: Mapping[str, int]) -> Loads:
    """(node, torque ports, sources) of every node that has any."""
    ports, found = list(network.torque_ports.values()), []
    for name, node in numbers.items():
        on = tuple(k for k, port in enumerate(ports) if port == name)
        sources = tuple(source.torque for source in network.sources if source.node == name)
        if on or sources:
            found.append((node, on, sources))
    return found


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
    `.tau` of sources, `energy.work`, `energy.stored`. `log` keeps them for many times at once.

    micro_step : s, largest step between evaluations of sources and events; None: the communication step. Sources are
    taken linear over a micro-step between their values at its ends (predictor and corrector, second order);
    everything else is exact. An event that comes and goes within a micro-step is not seen.
    """

    def __init__(self, network: Network, micro_step: float | None = None) -> None:
        self.network, self.dynamics, self.micro_step = network, Dynamics(network), micro_step
        d = self.dynamics
        self._torque_ports = {port: k for k, port in enumerate(network.torque_ports)}
        self._motion_ports = {port: d.driven.index(d.node[node]) for port, node in network.motion_ports.items()}
        self._loads = _loads(network, d.node)
        self._clutches = slice(d.n, d.n + d.n_clutches)
        self._hybrid = bool(d.n_clutches or d.gaps)
        self.is_smooth = not self._hybrid and not self._motion_ports
        self._outputs = Outputs(d)
        self._output_rows: dict[tuple[tuple[str, ...], Mode], np.ndarray] = {}
        self._z = np.zeros(d.states + 2 * d.inputs)
        self._x0, self._u0, self._u1 = np.split(self._z, [d.states, d.states + d.inputs])
        self._u0[-1] = self._u1[-1] = 1.0
        self._port_nodes = [d.node[node] for node in network.torque_ports.values()]
        self.state = self._start(0.0)  # everything that changes; not to be changed from outside

    # -- life ----------------------------------------------------------------------------------------------------------
    def initialize(self, time: float) -> None:
        """Start at `time` from the initial angles and speeds of the nodes; what motion ports were given before
        replaces that of their nodes."""
        d, given = self.dynamics, self.state
        self.state = state = self._start(time)
        state.torque, state.motion = given.torque, given.motion
        for k in self._motion_ports.values():
            node = d.driven[k]
            state.x[node], state.x[d.n + node] = given.motion[k, :2]
        state.mode = self._mode_of(time, state.x)

    def save(self) -> State:
        """A copy of everything that changes."""
        return self.state.copy()

    def restore(self, state: State) -> None:
        """Back to a saved state."""
        self.state = state.copy()

    # -- variables -----------------------------------------------------------------------------------------------------
    def resolve(self, names: Sequence[str]) -> Handle:
        """Handle of variables; raises CouplingError with the known names."""
        inputs = {f"{port}.tau": ("torque", k) for port, k in self._torque_ports.items()}
        for port, k in self._motion_ports.items():
            inputs |= {f"{port}.{key}": ("motion", 3 * k + i) for i, key in enumerate(("phi", "w", "a"))}
        position = self._outputs.position
        unknown = [name for name in names if name not in position and name not in inputs]
        if unknown:
            known = f"inputs: {', '.join(sorted(inputs))}; outputs: {', '.join(sorted(position))}"
            raise CouplingError(f"no variable {', '.join(unknown)}; {known}")
        outputs = (
            np.array([position[name] for name in names], dtype=int) if all(name in position for name in names) else None
        )
        places = tuple(inputs[name] for name in names) if all(name in inputs for name in names) else None
        special = np.flatnonzero(outputs >= self._outputs.linear) if outputs is not None else np.zeros(0, dtype=int)
        return Handle(tuple(names), outputs, places, special, np.zeros(len(names)))

    def outputs(self) -> dict[str, Variable]:
        """All outputs by name."""
        return {name: _variable(name) for name in self._outputs.position}

    def log(self, names: Sequence[str], points: int) -> NetworkLog:
        """Keeps these outputs at up to `points` times."""
        return NetworkLog(self._outputs, names, lambda: self.state)

    def set(self, handle: Handle, values: Sequence[float] | np.ndarray) -> None:
        """Inputs for the next step."""
        if handle.inputs is None:
            raise CouplingError(f"not all of {', '.join(handle.names)} are inputs")
        state = self.state
        torque, motion = list(state.torque), state.motion.copy()
        for (kind, k), value in zip(handle.inputs, values, strict=True):
            if kind == "torque":
                torque[k] = float(value)
            else:
                motion.flat[k] = value
        state.torque, state.motion = tuple(torque), motion

    def get(self, handle: Handle) -> np.ndarray:
        """Values (k,) at the current time, in the handle's buffer."""
        if handle.outputs is None:
            raise CouplingError(f"not all of {', '.join(handle.names)} are outputs")
        state, rows = self.state, self._rows(handle)
        if rows.shape[1] > self.dynamics.states:
            np.dot(rows, np.concatenate([state.x, self._inputs(state.time, state.x)]), out=handle.buffer)
        else:
            np.dot(rows, state.x, out=handle.buffer)
        for place in handle.special:
            handle.buffer[place] = self._outputs.special(handle.outputs[place], state)
        return handle.buffer

    def _rows(self, handle: Handle) -> np.ndarray:
        """Rows of the outputs on [x, u], or on x alone when no input reaches them, kept for each mode."""
        key = (handle.names, self.state.mode)
        if key not in self._output_rows:
            m, states = self.dynamics.matrices(self.state.mode), self.dynamics.states
            rows = np.zeros((len(handle.names), states + self.dynamics.inputs))
            assert handle.outputs is not None, "`get` refuses others"
            linear = np.setdiff1d(np.arange(len(handle.names)), handle.special)
            rows[linear] = np.hstack([m.c, m.d])[handle.outputs[linear]]
            self._output_rows[key] = rows if rows[:, states:].any() else np.ascontiguousarray(rows[:, :states])
        return self._output_rows[key]

    # -- stepping ------------------------------------------------------------------------------------------------------
    def step(self, time: float, h: float) -> None:
        """From `time` to time + h."""
        state, d = self.state, self.dynamics
        if d.n_driven:
            self._start_motion(h)
        count = max(1, math.ceil(h / self.micro_step - 1e-9)) if self.micro_step else 1
        for k in range(count):
            start, part = time + h * k / count, h / count
            if self._hybrid:
                self._hybrid_step(start, part)
            else:  # straight through preset memory
                self._advance(self._foreseen(start, part).dot(self._z))
        state.time = time + h
        if d.n_driven:
            self._end_motion(h)

    def _start_motion(self, h: float) -> None:
        state, d = self.state, self.dynamics
        state.x = state.x.copy()
        state.x[2 * d.n :] = 0.0
        for k in self._motion_ports.values():
            phi, w, _ = state.motion[k]
            state.x[d.n + d.driven[k]] = w + (phi - state.x[d.driven[k]]) / h

    def _end_motion(self, h: float) -> None:
        state, d = self.state, self.dynamics
        state.tau_mean = state.x[2 * d.n :] / h
        for k in self._motion_ports.values():
            _, w, a = state.motion[k]
            state.x[d.n + d.driven[k]] = w + a * h

    def _foreseen(self, time: float, h: float) -> np.ndarray:
        """Preset memory [x, u at the start, u at the end] of a step under the held torques, sources at its end by
        predictor and corrector, and the matrix that makes the state at its end of it."""
        state, d = self.state, self.dynamics
        s, n = d.transition(state.mode, h), d.n
        self._x0[:] = state.x
        if d.n_driven:
            self._u0[n:-1] = self._u1[n:-1] = state.motion[:, 2]
        self._node_torques(self._u0, time, state.x.tolist())
        self._u1[:n] = self._u0[:n]
        if self.network.sources:
            self._node_torques(self._u1, time + h, s.dot(self._z).tolist())
        return s

    def in_one_step(self, h: float) -> bool:
        """Whether a step of h s is one product with a matrix: `foresee`, then `complete`."""
        return self.is_smooth and not (self.micro_step and h > self.micro_step * (1.0 + 1e-9))

    def foresee(self, time: float, h: float) -> np.ndarray:
        """[x, u at the start, u at the end] (memory of the unit) of the step from `time` under the held torques."""
        self._foreseen(time, h)
        if self.dynamics.n_driven:
            self._x0[2 * self.dynamics.n :] = 0.0
        return self._z

    def complete(self, tau: Sequence[float], time: float, h: float) -> None:
        """The step just foreseen, under these torques of the torque ports instead of the held ones."""
        state, d = self.state, self.dynamics
        for node, new, held in zip(self._port_nodes, tau, state.torque, strict=True):
            change = new - held
            self._u0[node] += change
            self._u1[node] += change
        state.torque = tuple(tau)
        state.x, state.time = d.transition(state.mode, h).dot(self._z), time + h
        if d.n_driven:
            state.tau_mean = state.x[2 * d.n :] / h

    def _hybrid_step(self, time: float, h: float) -> None:
        state, d, done = self.state, self.dynamics, 0.0
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
        s = (d.transition if keep else d.transition_once)(self.state.mode, h)
        self._x0[:], self._u0[:], self._u1[:] = self.state.x, u0, u1
        x1 = s.dot(self._z)
        if self.network.sources:
            self._node_torques(u1, time + h, x1.tolist())
            self._u1[:] = u1
            x1 = s.dot(self._z)
        return x1, u1

    def _advance(self, x1: np.ndarray) -> None:
        state, d = self.state, self.dynamics
        for k in self._motion_ports.values():
            impulse, node = 2 * d.n + k, d.driven[k]
            state.work -= (x1[impulse] - state.x[impulse]) * 0.5 * (state.x[d.n + node] + x1[d.n + node])
        state.x = x1

    # -- inputs and outputs --------------------------------------------------------------------------------------------
    def _start(self, time: float) -> State:
        d, nodes = self.dynamics, self.network.nodes
        x = np.array([p.phi for p in nodes] + [p.w for p in nodes] + [0.0] * d.n_driven, dtype=float)
        motion = np.array([[nodes[k].phi, nodes[k].w, 0.0] for k in d.driven], dtype=float).reshape(-1, 3)
        mode, torque = ((0,) * d.n_clutches, (0,) * len(d.gaps)), (0.0,) * len(self._torque_ports)
        state = State(time, x, mode, torque, motion, np.zeros(d.n_driven), 0.0, ())
        self.state = state
        state.mode = self._mode_of(time, x)
        return state

    def _mode_of(self, time: float, x: np.ndarray) -> Mode:
        """The mode that a state alone decides; without clutch and backlash there is one."""
        if not self._hybrid:
            return (), ()
        return initial_mode(self.dynamics, x, self._inputs(time, x), self._capacity(time, time)[0])

    def _node_torques(self, u: np.ndarray, time: float, x: Sequence[float]) -> None:
        """Port torques and sources into the first n places of u (zero where there are none)."""
        n, torque = self.dynamics.n, self.state.torque
        for node, ports, sources in self._loads:
            total = 0.0
            for port in ports:
                total += torque[port]
            for source in sources:
                total += source(time, x[node], x[n + node])
            u[node] = total

    def _inputs(self, time: float, x: np.ndarray, capacity: np.ndarray | None = None) -> np.ndarray:
        d = self.dynamics
        u = np.zeros(d.inputs)
        u[-1] = 1.0
        self._node_torques(u, time, x.tolist())
        if d.n_driven:
            u[self._clutches.stop : -1] = self.state.motion[:, 2]
        if d.n_clutches:
            u[self._clutches] = self.state.mode[0] * (self._capacity(time, time)[0] if capacity is None else capacity)
        return u

    def _capacity(self, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
        ends = [clutch.capacity.ends(t0, t1) for clutch in self.network.clutches]
        return np.array([max(e[0], 0.0) for e in ends]), np.array([max(e[1], 0.0) for e in ends])
