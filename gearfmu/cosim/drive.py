"""What moves and loads the ports of a stage: one object, whichever table of a scene describes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gearfmu.cosim.masters import Cut, Wiring
from gearfmu.cosim.network import Network
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.shaft_loads import Loaded, ShaftLoads
from gearfmu.cosim.signals import Signal
from gearfmu.cosim.start import Rest
from gearfmu.cosim.units import Unit
from gearfmu.spec.scenes.shaft_loads import ShaftLoad
from gearfmu.spec.tables.ports import PortSpec

Loads = Mapping[str, ShaftLoad]


@dataclass(frozen=True)
class Drive:
    """Masses, or torques, on the ports of a stage.

    ports : kind, stiffness and damping that the stage's ports need for it; the cut runs through compliant elements,
    which belong to the stage. partner : the torques by port, or a function that makes the network of masses, with
    torque ports of these names; it is given the function that finds the stage's angles at rest. start : start values
    of the stage's parameters, SI; SpecError where they cannot be found. signals : inputs of the stage that are known
    beforehand. silent : patterns of stage outputs without meaning. watched : names of clutches outside the stage, which
    split a run into parts. frequencies : Hz, of alternating torques.
    """

    ports: Mapping[str, PortSpec]
    partner: Callable[[Rest], Network] | Loads
    start: Callable[[], dict[str, float]] = dict
    signals: tuple[tuple[str, Signal], ...] = ()
    silent: tuple[str, ...] = ()
    watched: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()

    def cut(self, stage: Unit, rest: Rest, micro_step: float | None, wiring: Wiring) -> Cut | Loaded:
        """The stage joined with it. micro_step: s, of the network; None: the communication step."""
        if callable(self.partner):
            unit = PyUnit(self.partner(rest), micro_step)
            return Cut(stage, unit, tuple(self.ports), self.signals, wiring)
        speeds = {name.removesuffix(".w_start"): speed for name, speed in self.start().items()}
        return Loaded(stage, ShaftLoads(self.partner), speeds)
