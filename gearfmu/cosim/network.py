"""Description of a torsional network: inertias, driven nodes, springs with backlash, clutches, torque sources,
ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from gearfmu.cosim.signals import Signal
from gearfmu.errors import CouplingError


@dataclass(frozen=True)
class Inertia:
    """A rigid inertia, kg·m², with its initial angle, rad, and speed, rad/s."""

    name: str
    inertia: float
    phi: float = 0.0
    w: float = 0.0


@dataclass(frozen=True)
class Driven:
    """A node whose motion is prescribed: by a motion port, else by its constant speed w, rad/s."""

    name: str
    phi: float = 0.0
    w: float = 0.0


@dataclass(frozen=True)
class Spring:
    """Spring k and damper c on the extension s = Σ factor·φ of the nodes in `on`.

    Torque on a node = −factor·(k·e + c·ds/dt), e = s outside the dead zone [−backlash, 0], measured from its near
    end. The damper acts always. Factors 1 and −1: a shaft, k in N·m/rad. Radii: a gear pair, k in N/m; its drive
    flanks touch at s = 0, its coast flanks at −backlash.
    """

    name: str
    on: Mapping[str, float]
    k: float
    c: float = 0.0
    backlash: float = 0.0


@dataclass(frozen=True)
class Clutch:
    """Dry clutch between nodes a and b. Slip = w_a − w_b; its torque drives b and brakes a.

    `capacity`: torque it transmits when it slips, N·m; when it sticks it holds up to `peak` times that.
    """

    name: str
    a: str
    b: str
    capacity: Signal
    peak: float = 1.0


@dataclass(frozen=True)
class Source:
    """Torque on a node, N·m, as a function (time, angle, speed) of that node."""

    name: str
    node: str
    torque: Callable[[float, float, float], float]


@dataclass(frozen=True)
class Network:
    """The whole network. `torque_ports`: port → node (torque in, motion out; a driven node yields to no torque).
    `motion_ports`: port → driven node (motion in, torque out)."""

    nodes: tuple[Inertia | Driven, ...]
    springs: tuple[Spring, ...] = ()
    clutches: tuple[Clutch, ...] = ()
    sources: tuple[Source, ...] = ()
    torque_ports: Mapping[str, str] = field(default_factory=dict)
    motion_ports: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problems = [*_name_problems(self), *_node_problems(self), *_value_problems(self)]
        if problems:
            raise CouplingError("; ".join(problems))


def _name_problems(network: Network) -> list[str]:
    parts = (*network.nodes, *network.springs, *network.clutches, *network.sources)
    names = [part.name for part in parts]
    return [f"{name!r} names two parts; give each its own name" for name in sorted(set(names)) if names.count(name) > 1]


def _node_problems(network: Network) -> list[str]:
    known = {node.name for node in network.nodes}
    used = [(spring.name, name) for spring in network.springs for name in spring.on]
    used += [(clutch.name, name) for clutch in network.clutches for name in (clutch.a, clutch.b)]
    used += [(source.name, source.node) for source in network.sources]
    used += [*network.torque_ports.items(), *network.motion_ports.items()]
    problems = [
        f"{part}: there is no node {name!r}; known: {', '.join(sorted(known))}"
        for part, name in used
        if name not in known
    ]
    driven = {node.name for node in network.nodes if isinstance(node, Driven)}
    return problems + [
        f"port {port}: node {name!r} is an inertia; a motion needs a driven node"
        for port, name in network.motion_ports.items()
        if name in known - driven
    ]


def _value_problems(network: Network) -> list[str]:
    problems = [
        f"{node.name}: inertia {node.inertia} kg·m² must be positive"
        for node in network.nodes
        if isinstance(node, Inertia) and not node.inertia > 0
    ]
    for spring in network.springs:
        problems += [
            f"{spring.name}: {key} = {getattr(spring, key)} must not be negative"
            for key in ("k", "c", "backlash")
            if not getattr(spring, key) >= 0
        ]
    return problems + [
        f"{clutch.name}: peak {clutch.peak} must be at least 1" for clutch in network.clutches if not clutch.peak >= 1
    ]
