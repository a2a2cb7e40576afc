"""What moves and loads the ports of a stage: one object, whichever table of a scene describes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gearfmu.cosim.network import Network
from gearfmu.cosim.signals import Signal
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.scenefile.shaft_loads import ShaftLoad
from gearfmu.stagefile.tables.connections import PortSpec

Loads = Mapping[str, ShaftLoad]
Rest = Callable[[Mapping[str, float]], Mapping[str, float]]  # torques (N·m) on ports → bores (rad) at rest


def frequencies_of(loads: Loads) -> tuple[float, ...]:
    """Hz, of the alternating torques among `loads`."""
    return tuple(load.alternating.frequency for load in loads.values() if load.alternating is not None)


@dataclass(frozen=True)
class Drive:
    """Masses, or torques, on the ports of a stage.

    ports : kind, stiffness and damping that the stage's ports need for it; the cut runs through compliant elements,
    which belong to the stage. partner : the torques by port, or a function that makes the network of masses, with
    torque ports of these names; it is given the function that finds the stage's angles at rest. start : start values
    of the stage's parameters, SI; SpecError where they cannot be found. signals : inputs of the stage that are known
    beforehand. silent : patterns of stage outputs without meaning. watched : names of clutches outside the stage, which
    split a run into parts. frequencies : Hz, of alternating torques. with_shafts : the scene with the stiffness and
    damping of other ports, where its start follows from them; None where it does not.
    """

    ports: Mapping[str, PortSpec]
    partner: Callable[[Rest], Network] | Loads
    start: Callable[[], dict[str, float]] = dict
    signals: tuple[tuple[str, Signal], ...] = ()
    silent: tuple[str, ...] = ()
    watched: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()
    with_shafts: Callable[[Mapping[str, PortSpec]], SceneSpec] | None = None
