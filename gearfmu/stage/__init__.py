"""The stage as the kernel runs it: model, quasi-static transmission error, standalone simulation, traces."""

from __future__ import annotations

from gearfmu.stage.assembly import assemble
from gearfmu.stage.model import StageModel
from gearfmu.stage.simulate import Steady, simulate
from gearfmu.stage.te import TeResult, loaded_te
from gearfmu.stage.trace import Channel, Trace

__all__ = ["Channel", "StageModel", "Steady", "TeResult", "Trace", "assemble", "loaded_te", "simulate"]
