"""PyUnit: a torsional network as the drivetrain of a run. Exact between events for inputs linear in time; clutches
stick and slip at exact instants."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gearfmu.cosim.events import Attempt, Event, first_event, initial_mode, switch
from gearfmu.cosim.network import Dynamics, Network
from gearfmu.cosim.py_outputs import NetworkLog, Outputs, State
from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError

MAX_EVENTS = 200  # within one micro-step; more means that the parts have no solution or the step is absurdly long
KEYS = {
    "phi": Variable("rad", "angle"),
    "w": Variable("rad/s", "speed"),
    "a": Variable("rad/s2", "acceleration"),
    "tau": Variable("N.m", "torque"),
    "tau_mean": Variable("N.m", "mean torque of the step"),
    "extension": Variable("rad", "twist of the spring"),
    "slip": Variable("rad/s", "slip speed"),
    "locked": Variable("", "true while the clutch sticks", True),
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
    """A network as the drivetrain of a run.

    `ports` are its torque ports, named after the stage's shafts: torques in (N·m, held over a step), motion out, in
    buffers of φ, w, a port by port. Outputs: `.phi`, `.w`, `.a` of ports and nodes, `.tau` (torque on the outside) and
    `.tau_mean` of driven nodes, `.tau` and `.extension` of springs, `.tau`, `.slip`, `.locked` of clutches, `.tau` of
    sources, `energy.stored`.

    micro_step : s, largest step between evaluations of sources and events; None: the communication step. Sources are
    taken linear over a micro-step between their values at its ends (predictor and corrector, second order);
    everything else is exact. An event that comes and goes within a micro-step is not seen.

    Without clutches a step is one product with a constant matrix. `drive` directly after `ahead` then takes the sources
    at the end of the step from the foreseen motion: they differ from those of the final motion by what the change of
    the torques since the last step moves the nodes, O(h³).
    """

    def __init__(self, network: Network, micro_step: float | None = None) -> None:
        self.network, self.dynamics, self.micro_step = network, Dynamics(network), micro_step
        d = self.dynamics
        self.ports = tuple(network.torque_ports)
        self._nodes = [d.node[node] for node in network.torque_ports.values()]
        self._speeds = [d.n + node for node in self._nodes]
        self._loads = _loads(network, d.node)
        self._outputs = Outputs(d)
        self._z = np.zeros(d.states + 2 * d.inputs)
        self._x0, self._u0, self._u1 = np.split(self._z, [d.states, d.states + d.inputs])
        self._h, self._ahead = 0.0, np.zeros(0)  # step, and rows that make the motion ahead of it from _z
        self._foreseen: np.ndarray | None = None  # the state that _z begins at
        self._start(0.0, (0.0,) * len(self.ports))

    # -- life ----------------------------------------------------------------------------------------------------------
    def initialize(self, time: float) -> None:
        """Start at `time` from the initial angles and speeds of the nodes, under the torques that are held."""
        self._start(time, self.state.torque)

    def _start(self, time: float, torque: tuple[float, ...]) -> None:
        d, nodes = self.dynamics, self.network.nodes
        x = np.array([p.phi for p in nodes] + [p.w for p in nodes] + [0.0] * d.n_driven, dtype=float)
        self.state = State(time, x, (0,) * d.n_clutches, torque, np.zeros(d.n_driven), (0.0, 0.0), ())
        if d.n_clutches:
            self.state.mode = initial_mode(d, x, self._inputs(time, x), self._capacity(time, time)[0])

    def save(self) -> State:
        """A copy of everything that changes."""
        return self.state.copy()

    def restore(self, state: State) -> None:
        """Back to a saved state."""
        self.state = state.copy()

    # -- ports and outputs ---------------------------------------------------------------------------------------------
    def hold(self, torque: Sequence[float]) -> None:
        """Hold these torques on the ports from now on."""
        self.state.torque = tuple(torque)

    def now(self, out: np.ndarray) -> None:
        """φ, w, a of the ports at present, under the held torques."""
        state, m = self.state, self.dynamics.matrices(self.state.mode)
        rows = np.hstack([m.a[self._speeds], m.b[self._speeds]])
        out[0::3], out[1::3] = state.x[self._nodes], state.x[self._speeds]
        out[2::3] = np.dot(rows, np.concatenate([state.x, self._inputs(state.time, state.x)]))

    def ahead(self, time: float, h: float, out: np.ndarray) -> None:
        """φ, w of the ports at present, and the constant accelerations that end where the held torques lead in h s."""
        if self.dynamics.n_clutches or (self.micro_step and h > self.micro_step * (1.0 + 1e-9)):
            saved = self.save()
            self.step(time, h)
            out[0::3], out[1::3] = saved.x[self._nodes], saved.x[self._speeds]
            out[2::3] = 2.0 * (self.state.x[self._nodes] - out[0::3] - out[1::3] * h) / h**2
            self.restore(saved)
            return
        if h != self._h:
            self._prepare(h)
        self._foresee(time, h)
        self._x0[2 * self.dynamics.n :] = 0.0
        np.dot(self._ahead, self._z, out=out)
        self._foreseen = self.state.x

    def _prepare(self, h: float) -> None:
        """Rows that make φ, w and the acceleration ahead of [x, u at the start, u at the end]."""
        step, self._h = self.dynamics.transition(self.state.mode, h), h
        rows: np.ndarray = np.zeros((3 * len(self._nodes), step.shape[1]))
        for k, (node, speed) in enumerate(zip(self._nodes, self._speeds, strict=True)):
            rows[3 * k, node] = rows[3 * k + 1, speed] = 1.0
            rows[3 * k + 2] = 2.0 * (step[node] - rows[3 * k] - h * rows[3 * k + 1]) / h**2
        self._ahead = rows

    def outputs(self) -> dict[str, Variable]:
        """All outputs by name."""
        return {name: _variable(name) for name in self._outputs.position}

    def log(self, names: Sequence[str], points: int) -> NetworkLog:
        """Keeps these outputs at up to `points` times."""
        return NetworkLog(self._outputs, names, lambda: self.state)

    @property
    def exchanged(self) -> tuple[float, float]:
        """J that came in through the ports: signed sum, sum of magnitudes."""
        return self.state.exchanged

    # -- stepping ------------------------------------------------------------------------------------------------------
    def drive(self, torque: Sequence[float], time: float, h: float) -> None:
        """From `time` to time + h under these torques on the ports; counts their work."""
        before = self.state.x
        if self._foreseen is before and h == self._h:
            self._complete(torque, time, h)
        else:
            self.hold(torque)
            self.step(time, h)
        state, (work, throughput) = self.state, self.state.exchanged
        for tau, node in zip(state.torque, self._nodes, strict=True):
            given = tau * (state.x.item(node) - before.item(node))
            work += given
            throughput += abs(given)
        state.exchanged = work, throughput

    def _complete(self, torque: Sequence[float], time: float, h: float) -> None:
        """The step just foreseen, under these torques instead of the held ones."""
        state, d = self.state, self.dynamics
        for node, new, held in zip(self._nodes, torque, state.torque, strict=True):
            change = new - held
            self._u0[node] += change
            self._u1[node] += change
        state.torque = tuple(torque)
        state.x, state.time = d.transition(state.mode, h).dot(self._z), time + h
        if d.n_driven:
            state.tau_mean = state.x[2 * d.n :] / h

    def step(self, time: float, h: float) -> None:
        """From `time` to time + h under the held torques."""
        state, d = self.state, self.dynamics
        if d.n_driven:
            state.x = state.x.copy()
            state.x[2 * d.n :] = 0.0
        count = max(1, math.ceil(h / self.micro_step - 1e-9)) if self.micro_step else 1
        for k in range(count):
            start, part = time + h * k / count, h / count
            if d.n_clutches:
                self._hybrid_step(start, part)
            else:  # straight through preset memory
                state.x = self._foresee(start, part).dot(self._z)
        state.time = time + h
        if d.n_driven:
            state.tau_mean = state.x[2 * d.n :] / h

    def _foresee(self, time: float, h: float) -> np.ndarray:
        """Sets preset memory [x, u at the start, u at the end] to a step under the held torques, sources at its end by
        predictor and corrector; returns the matrix that makes the state at its end of it."""
        s, n = self.dynamics.transition(self.state.mode, h), self.dynamics.n
        self._x0[:] = self.state.x
        self._node_torques(self._u0, time, self.state.x.tolist())
        self._u1[:n] = self._u0[:n]
        if self.network.sources:
            self._node_torques(self._u1, time + h, s.dot(self._z).tolist())
        return s

    def _hybrid_step(self, time: float, h: float) -> None:
        state, d, done = self.state, self.dynamics, 0.0
        for _ in range(MAX_EVENTS):
            start, rest = time + done, h - done
            capacity = self._capacity(start, time + h)
            u0, u1 = self._inputs(start, state.x, capacity[0]), self._inputs(start, state.x, capacity[1])
            x1, u1 = self._attempt(start, rest, u0, u1, keep=done == 0.0)
            found = first_event(d, state.mode, Attempt(state.x, u0, x1, u1, *capacity, rest))
            state.x = x1 if found is None else found.x
            if found is None:
                return
            state.x = state.x.copy()
            state.mode = switch(d, state.mode, found, state.x)
            part, what = self.network.clutches[found.clutch].name, "slip" if state.mode[found.clutch] else "lock"
            state.events += (Event(start + found.fraction * rest, part, what),)
            done += found.fraction * rest
            if done >= h:
                return
        raise CouplingError(
            f"more than {MAX_EVENTS} stick–slip events between {time} and {time + h} s; choose a shorter micro_step"
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

    # -- inputs --------------------------------------------------------------------------------------------------------
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
        self._node_torques(u, time, x.tolist())
        if d.n_clutches:
            u[d.n :] = self.state.mode * (self._capacity(time, time)[0] if capacity is None else capacity)
        return u

    def _capacity(self, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
        ends = [clutch.capacity.ends(t0, t1) for clutch in self.network.clutches]
        return np.array([max(e[0], 0.0) for e in ends]), np.array([max(e[1], 0.0) for e in ends])
