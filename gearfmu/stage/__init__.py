"""The stage as the kernel runs it: model, quasi-static transmission error, standalone simulation, traces."""

from __future__ import annotations

from gearfmu.stage.assembly.assemble import assemble
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.simulate import Steady, simulate
from gearfmu.stage.run.te import TeResult, loaded_te
from gearfmu.stage.run.trace import Channel, Trace

__all__ = ["Channel", "StageModel", "Steady", "TeResult", "Trace", "assemble", "loaded_te", "simulate"]
