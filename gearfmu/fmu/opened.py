"""An FMU of ours opened again: its model and its stage, read without the stage file."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gearfmu.body import Body, body_hashes, load_bodies
from gearfmu.errors import BodyError, FmuError, ModelError, Problem, SpecError
from gearfmu.fmu.stage_file import EXPORT_AGAIN, MODEL_FILE, STAGE_FILE, read_stage_file, refused
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.assembly.observed import MOTION
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stored import differences, restored, stored_files

MOST_SHOWN = 5  # differences


@dataclass(frozen=True)
class OpenedFmu:
    """path : of the FMU; model : the blob inside it with the stage that it was made from; files : SHA-256 of the files
    that the stage names, by field; their names have no folders."""

    path: Path
    model: StageModel
    files: Mapping[str, str]

    @property
    def observed(self) -> tuple[str, ...]:
        """Gears whose motion is an output."""
        known = self.model.kernel().variables
        return tuple(gear.name for gear in self.model.stage.gears if f"{gear.name}{MOTION}x" in known)

    def problems_of(self, own: Stage) -> list[Problem]:
        """Everything in which the FMU's stage differs from another one, but for the ports; empty for the stage that it
        was exported from."""
        found, name = differences(self.model.stage, own), str(own.source)
        found += [] if stored_files(own.written) == self.files else [("files", "others", "others")]
        remedy = f"{name} says {{}}: name the stage that the FMU was exported from, or export it again"
        problems = [Problem(str(self.path), field, value, remedy.format(other)) for field, value, other in found]
        more = [Problem(str(self.path), "", "", f"and {len(problems) - MOST_SHOWN} more differences")]
        return problems if len(problems) <= MOST_SHOWN else problems[:MOST_SHOWN] + more

    def with_bodies(self, own: Stage) -> tuple[Stage, Sequence[Body]]:
        """The FMU's stage with the files and the reduced bodies that lie beside a stage file. own : the stage of that
        file. BodyError where its bodies are others than those of the FMU, SpecError where its files are."""
        if body_hashes(own) != self.model.body_hashes:
            remedy = f"{own.source} has other bodies: name the stage that the FMU was exported from"
            raise BodyError(str(Problem(str(self.path), "stage", self.model.name, remedy)))
        if self.files:
            if problems := self.problems_of(own):
                raise SpecError(problems)
            return with_ports(own, self.model.stage.ports), load_bodies(own)
        return self.model.stage.model_copy(update={"source": own.source}), load_bodies(own)


def read_fmu(path: str | Path) -> OpenedFmu:
    """The model and the stage inside an FMU of ours. FmuError for a file that is no FMU of ours, that has no
    resources/stage.json, or whose members are damaged or do not belong together."""
    file = Path(path)
    blob, content = _members(file)
    facts = read_stage_file(content, str(file))
    try:
        stage = restored(facts["stage"], file)
        model = StageModel(stage, blob, tuple(facts["hashes"]["bodies"].values()))
        found = model.kernel().hash
    except SpecError as error:
        raise refused(str(file), "", f"{error}; {EXPORT_AGAIN}", "stage") from error
    except ModelError as error:
        raise FmuError(f"{file}: {MODEL_FILE}: {error}; {EXPORT_AGAIN}") from error
    if (named := facts["hashes"]["model"]) != found:
        raise refused(str(file), named, f"the model beside it is {found}: {EXPORT_AGAIN}", "hashes.model")
    return OpenedFmu(file, model, facts["files"])


def _members(path: Path) -> tuple[bytes, bytes]:
    """The model blob and stage.json."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            found = {name: archive.read(name) for name in (MODEL_FILE, STAGE_FILE) if name in names}
    except OSError as error:
        raise FmuError(f"{path}: cannot be read as an FMU: {error.strerror or error}") from error
    except (zipfile.BadZipFile, zlib.error, ValueError, RuntimeError, EOFError) as error:
        raise FmuError(f"{path}: cannot be read as an FMU: {error}") from error
    if MODEL_FILE not in found:
        raise FmuError(f"{path}: {MODEL_FILE} is missing: a scene runs FMUs that gearfmu export has written")
    if STAGE_FILE not in found:
        raise refused(str(path), "", f"is missing, so that nothing says which stage this is: {EXPORT_AGAIN}")
    return found[MODEL_FILE], found[STAGE_FILE]
