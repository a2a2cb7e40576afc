"""The model of a stage: the constant blob that the kernel runs. From here on no finite elements, no HDF5."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearfmu.errors import ModelError, Problem, SpecError
from gearfmu.kernel import Kernel, Variable
from gearfmu.quantities import quantity_text
from gearfmu.stage.assembly.blob import blob_hash, read_blob, with_guid, write_blob
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.assembly.shown import Card, Shown, grouped
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import Shafts, shafts_of

SPRING = 0  # kind of a port in the blob


OWN_INTEGRATOR = {"paper": "rk45", "explicit": "central"}  # of levels, where dg4 is asked for (gk_choose.c)


def integrator_of(level: str, asked: str, clutch: bool) -> str:
    """What integrates at a level; a clutch on a port keeps dg4."""
    return OWN_INTEGRATOR.get(level, asked) if asked == "dg4" and not clutch else asked


@dataclass(frozen=True, repr=False)
class StageModel(Shown):
    """A stage ready to run: the blob is all the kernel needs; stage and bodies' hashes say where it came from."""

    stage: Stage
    blob: bytes
    body_hashes: tuple[str, ...]

    @property
    def card(self) -> Card:
        """How a session shows it."""
        known = self.kernel_variables()
        meshes = [f"{mesh.name}: {' with '.join(mesh.gears)}" for mesh in self.stage.engagements]
        ports = [f"{name}: {port.kind}" for name, port in self.stage.ports.items()]
        names = {sort: [v.name for v in known if v.causality == sort] for sort in ("input", "parameter", "output")}
        limits, kind = self.stage.limits, self.stage.written.kind
        most = " and ".join(quantity_text(value, unit) for value, unit in limits if value is not None)
        rows = [
            ("ports", ", ".join(ports) + "; input first, then output"),
            ("meshes", ", ".join(meshes)),
            ("bodies", ", ".join(f"{name} {body[:8]}" for name, body in self.bodies.items())),
            *((f"{sort}s", " ".join(f"{group}.({last})" if group else last for group, last in grouped(own)))
              for sort, own in names.items()),
            ("size", f"{len(self.blob) / 1e6:.2f} MB, model {self.hash[:12]}"),
        ]  # fmt: skip
        return Card(f"Stage {self.name} ({kind}{', up to ' * bool(most)}{most}): {self.stage.description}", rows, 3)

    @property
    def name(self) -> str:
        return self.stage.name

    @cached_property
    def shafts(self) -> Shafts:
        """Input, output and ratio. SpecError where the stage has no two ports that its meshes connect."""
        return shafts_of(self.stage)

    @property
    def bodies(self) -> dict[str, str]:
        """Hash of every reduced body that the model was made from, by name: of a set sun, planet, ring, carrier."""
        return dict(zip(self.stage.files, self.body_hashes, strict=True))

    @property
    def hash(self) -> str:
        """SHA-256 of the blob, 64 hex digits."""
        return blob_hash(self.blob)

    @cached_property
    def guid(self) -> str:
        """GUID of its FMUs, 64 hex digits: from what the model was made of, so the same with any numpy and scipy."""
        return self.kernel().guid

    @cached_property
    def support_coupling(self) -> np.ndarray | None:
        """(s, s) m/N …: compliance between different directions of a support; None where there are springs alone."""
        found = read_blob(self.blob).get("support_coupling0") if self.stage.rolling else None
        return None if found is None else np.reshape(np.asarray(found, float), (-1, math.isqrt(len(found))))

    def kernel(self, **parameters: float) -> Kernel:
        """A fresh instance; dots in parameter names are written as they are: kernel(**{"effect.hertz": 0})."""
        return Kernel(self.blob, parameters)

    def driven_by_springs(self) -> StageModel:
        """The same model whose input and output are spring ports, with the k and c that the stage keeps for them.
        SpecError for a torque port that has none, and where one has a chain or is fixed."""
        two = (self.shafts.input, self.shafts.output)
        ports = {name: self.stage.ports[name] for name in two}
        if all(port.kind == "spring" and port.chain is None for port in ports.values()):
            return self
        refused = [
            Problem(str(self.stage.source), f"ports.{name}", port.kind, remedy)
            for name, port in ports.items()
            if (remedy := port.no_spring)
        ]
        if refused:
            raise SpecError(refused)
        sections = read_blob(self.blob)
        kinds = np.array(sections["port_kinds"], np.int32).reshape(-1, 3)
        kinds[[list(self.stage.ports).index(name) for name in two], 1] = SPRING
        changed: dict[str, Any] = {name: port.model_copy(update={"kind": "spring"}) for name, port in ports.items()}
        return replace(
            self, stage=with_ports(self.stage, changed), blob=write_blob(with_guid(sections | {"port_kinds": kinds}))
        )

    def modes_of_levels(self) -> dict[str, int]:
        """How many modes are dynamic at which level; at full all that are stored."""
        found = {}
        for level, name in enumerate(LEVELS):
            kernel = self.kernel(level=float(level))
            kernel.prepare()
            kernel.initialize()
            found[name] = int(kernel.get("solver.n_dyn"))
        return found

    def with_starts(self, starts: Mapping[str, float]) -> StageModel:
        """The same model whose parameters start with other values, SI, an enumeration by its number: what an importer
        finds that sets none. ModelError for a name that is no parameter and for a value out of range."""
        kernel = self.kernel(**starts)
        inputs = [name for name in starts if kernel.variables[name].causality != "parameter"]
        if inputs:
            raise ModelError(f"{', '.join(inputs)}: only parameters have starts of the model's own")
        sections = read_blob(self.blob)
        known = zip(sections.get("start_reference", ()), sections.get("start_value", ()), strict=True)
        chosen = dict(known) | {kernel.variables[name].reference: value for name, value in starts.items()}
        own = {
            "start_reference": np.array(list(chosen), np.int32),
            "start_value": np.array(list(chosen.values()), float),
        }
        return replace(self, blob=write_blob(with_guid(sections | own))) if chosen else self

    def kernel_variables(self) -> list[Variable]:
        """All variables of this model in the order of the kernel's table."""
        return list(self.kernel().variables.values())
