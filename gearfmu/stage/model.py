"""The model of a stage: the constant blob that the kernel runs. From here on no finite elements, no HDF5."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel, Variable
from gearfmu.spec.expand import as_general
from gearfmu.spec.general import GeneralStage
from gearfmu.spec.planetary import PlanetarySpec
from gearfmu.spec.stage import StageSpec
from gearfmu.spec.turning import Shafts, shafts_of
from gearfmu.stage.blob import blob_hash


@dataclass(frozen=True)
class StageModel:
    """A stage ready to run: the blob is all the kernel needs; spec and bodies' hashes say where it came from."""

    spec: StageSpec | GeneralStage | PlanetarySpec
    blob: bytes
    body_hashes: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.spec.name

    @cached_property
    def stage(self) -> GeneralStage:
        """The stage in the terms of any stage: a pair file or a set expanded."""
        return as_general(self.spec)

    @cached_property
    def shafts(self) -> Shafts:
        """Input, output and ratio. SpecError where the stage has no two ports that its meshes connect."""
        return shafts_of(self.stage)

    @property
    def pair(self) -> StageSpec:
        """The spec of a stage that is written as one pair. ModelError for any other."""
        if not isinstance(self.spec, StageSpec):
            raise ModelError(f"stage {self.name} is not written as one pair: this is for pair files only")
        return self.spec

    @property
    def hash(self) -> str:
        """SHA-256 of the blob, 64 hex digits."""
        return blob_hash(self.blob)

    def kernel(self, **parameters: float) -> Kernel:
        """A fresh instance; dots in parameter names are written as they are: kernel(**{"effect.hertz": 0})."""
        return Kernel(self.blob, parameters)

    def kernel_variables(self) -> list[Variable]:
        """All variables of this model in the order of the kernel's table."""
        return list(self.kernel().variables.values())
