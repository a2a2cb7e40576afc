"""Where the stage of a run comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from gearfmu.cosim.fmu_unit import FmuUnit
from gearfmu.cosim.kernel_unit import KernelUnit
from gearfmu.stage import StageModel


class UnitSource(Protocol):
    """What a run needs of a source: the stage's model, and a fresh unit of it with these start values."""

    @property
    def model(self) -> StageModel: ...

    def unit(self, parameters: Mapping[str, float | bool | str]) -> FmuUnit | KernelUnit: ...


@dataclass(frozen=True)
class Source:
    """The kernel itself (fmu_path None) or an FMU; the model it was made from."""

    model: StageModel
    fmu_path: Path | None = None

    def unit(self, parameters: Mapping[str, float | bool | str]) -> FmuUnit | KernelUnit:
        """A fresh instance with these start values."""
        if self.fmu_path is None:
            return KernelUnit(self.model.blob, parameters)
        return FmuUnit(self.fmu_path, parameters)
