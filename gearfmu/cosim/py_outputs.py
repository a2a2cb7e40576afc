"""Outputs of a torsional network from its states, for one instant or for many at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from gearfmu.cosim.events import Event
from gearfmu.cosim.network import Dynamics, Mode


@dataclass(slots=True)
class State:
    """Everything that changes. Its members are replaced, never changed in place, so that states may share them."""

    time: float
    x: np.ndarray  # (states,)
    mode: Mode
    torque: tuple[float, ...]  # of the ports, N·m, held over the step
    tau_mean: np.ndarray  # (d,) N·m, on the driven nodes
    exchanged: tuple[float, float]  # J, given to the network through its ports: signed sum, sum of magnitudes
    events: tuple[Event, ...]  # when a clutch locked or slipped, in order

    def copy(self) -> State:
        """The same values, from now on their own."""
        return State(self.time, self.x, self.mode, self.torque, self.tau_mean, self.exchanged, self.events)


class Table:
    """k states side by side: x (k, states), torques of the sources by name (k,), the states themselves."""

    def __init__(self, dynamics: Dynamics, states: Sequence[State]) -> None:
        self.states, self.x = states, np.array([state.x for state in states])
        self.sources = {}
        for source in dynamics.network.sources:
            node, times = dynamics.node[source.node], [state.time for state in states]
            phi, w = self.x[:, node].tolist(), self.x[:, dynamics.n + node].tolist()
            self.sources[source.name] = np.array(list(map(source.torque, times, phi, w)))


Special = Callable[[Table], np.ndarray]


class Outputs:
    """Names of all outputs and their values: most are linear in state and input, y = C x + D u, some are `special`.

    position : place of every name, linear outputs first; ports have the names of their nodes too.
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self.dynamics, network = dynamics, dynamics.network
        self.linear = len(dynamics.output_names)
        special = self._special_outputs()
        names = dict(dynamics.output_names) | {name: self.linear + k for k, name in enumerate(special)}
        for port, node in network.torque_ports.items():
            names |= {f"{port}.{key}": names[f"{node}.{key}"] for key in ("phi", "w", "a")}
        self.position = names
        self._special: dict[int, Special] = dict(enumerate(special.values(), start=self.linear))

    def values(self, places: Sequence[int], states: Sequence[State]) -> np.ndarray:
        """(k, places) values at k states."""
        found, table = np.zeros((len(states), len(places))), Table(self.dynamics, states)
        known = np.hstack([table.x, self._inputs(table)])
        modes = list(dict.fromkeys(state.mode for state in states))
        for mode in modes:
            rows = np.array([state.mode == mode for state in states]) if len(modes) > 1 else slice(None)
            m, chosen = self.dynamics.matrices(mode), known[rows]
            for column, place in enumerate(places):
                if place < self.linear:
                    found[rows, column] = _combined(np.concatenate([m.c[place], m.d[place]]), chosen)
        for column, place in enumerate(places):
            if place >= self.linear:
                found[:, column] = self._special[place](table)
        return found

    def _inputs(self, table: Table) -> np.ndarray:
        """(k, inputs) u at the states: port torques and sources, capacities of slipping clutches."""
        d, network, states = self.dynamics, self.dynamics.network, table.states
        u = np.zeros((len(states), d.inputs))
        torque = np.array([state.torque for state in states]).reshape(len(states), -1)
        for k, node in enumerate(network.torque_ports.values()):
            u[:, d.node[node]] += torque[:, k]
        for source in network.sources:
            u[:, d.node[source.node]] += table.sources[source.name]
        for k, clutch in enumerate(network.clutches):
            u[:, d.n + k] = [
                state.mode[k] * max(clutch.capacity.ends(state.time, state.time)[0], 0.0) for state in states
            ]
        return u

    def _special_outputs(self) -> dict[str, Special]:
        network, d = self.dynamics.network, self.dynamics
        driven, clutches = [network.nodes[node].name for node in d.driven], [part.name for part in network.clutches]
        found = {f"{name}.tau_mean": _of_states(lambda s, k: s.tau_mean[k], k) for k, name in enumerate(driven)}
        found |= {f"{name}.locked": _of_states(lambda s, k: s.mode[k] == 0, k) for k, name in enumerate(clutches)}
        found |= {f"{source.name}.tau": partial(_of_source, source.name) for source in network.sources}
        return found | {"energy.stored": self.energy}

    def energy(self, table: Table) -> np.ndarray:
        """(k,) kinetic energy of the inertias and potential energy of the springs, J."""
        d, x = self.dynamics, table.x
        energy = np.zeros(len(x))
        for k, m in enumerate(d.inverse_inertia):
            if m > 0:
                energy += 0.5 * x[:, d.n + k] ** 2 / m
        for row, spring in zip(d.extension, d.network.springs, strict=True):
            energy += 0.5 * spring.k * _combined(row, x) ** 2
        return energy


class NetworkLog:
    """Outputs of a network at many times: `take` keeps the state, `rows` makes the values of all of them at once."""

    def __init__(self, outputs: Outputs, names: Sequence[str], state: Callable[[], State]) -> None:
        self._outputs, self._state = outputs, state
        self._kept: list[State] = []
        self._places = [outputs.position[name] for name in names]

    def take(self) -> None:
        """Keep the present."""
        self._kept.append(self._state().copy())

    def rows(self) -> np.ndarray:
        """(times, names) values."""
        return self._outputs.values(self._places, self._kept)


def _combined(row: np.ndarray, table: np.ndarray) -> np.ndarray:
    """table @ row, term by term: a value does not depend on how many rows there are."""
    total = np.zeros(len(table))
    for k in np.flatnonzero(row):
        total += row[k] * table[:, k]
    return total


def _of_states(read: Callable[[State, int], float], k: int) -> Special:
    """What is read off a state alone, of its k-th part."""
    return lambda table: np.array([read(state, k) for state in table.states])


def _of_source(name: str, table: Table) -> np.ndarray:
    return table.sources[name]
