"""resources/stage.json of an FMU: the stage that its model was made from, for runs that have no stage file.

JSON, SI (docs/file-formats.md). `sha256` is that of everything else in it, so that nothing in it can be changed apart
from the model beside it, whose hash it holds.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

from gearfmu.errors import FmuError, Problem, SpecError
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.stored import stored, stored_files

MODEL_FILE = "resources/model.gkb"
STAGE_FILE = "resources/stage.json"
FORMAT, VERSION = "gearfmu-stage", 1
KEYS = ("name", "kind", "level", "input", "output", "ratio", "teeth", "meshes", "hashes", "files", "stage")
EXPORT_AGAIN = "export it again with this version of gearfmu"


def stage_file(model: StageModel) -> bytes:
    """Contents of resources/stage.json. The same model gives the same bytes, wherever its stage file lies."""
    facts = {"format": FORMAT, "format_version": VERSION, **_facts(model)}
    return (json.dumps(facts | {"sha256": _seal(facts)}, indent=1, allow_nan=False) + "\n").encode()


def read_stage_file(content: bytes, path: str) -> dict[str, Any]:
    """The fields of resources/stage.json, checked but for the stage itself. path : of the FMU, for messages. FmuError
    for a file that is damaged, changed or of another version."""
    try:
        facts = json.loads(content)
    except ValueError as error:
        raise refused(path, "", f"is no JSON ({error}): {EXPORT_AGAIN}") from error
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise refused(path, "", f"is not of format {FORMAT}: {EXPORT_AGAIN}")
    if (version := facts.get("format_version")) != VERSION:
        raise refused(path, str(version), f"this program reads version {VERSION}: {EXPORT_AGAIN}", "format_version")
    missing = [key for key in (*KEYS, "sha256") if key not in facts]
    if missing:
        raise refused(path, "", f"{', '.join(missing)} missing: {EXPORT_AGAIN}")
    if facts.pop("sha256") != _seal(facts):
        raise refused(path, "", f"was changed after the export: {EXPORT_AGAIN}")
    return facts


def refused(path: str, value: str, remedy: str, field: str = "") -> FmuError:
    """FmuError about resources/stage.json or one of its fields."""
    return FmuError(str(Problem(path, f"{STAGE_FILE}: {field}" if field else STAGE_FILE, value, remedy)))


def _facts(model: StageModel) -> dict[str, Any]:
    level = model.kernel().variables["level"]
    try:
        ends: tuple[str | None, str | None, float | None]
        ends = (model.shafts.input, model.shafts.output, model.shafts.ratio)
    except SpecError:  # no two ports that meshes connect: the FMU is for other importers
        ends = (None, None, None)
    limits = ("torque_max", "speed_max")
    return {
        "name": model.name,
        "kind": model.stage.written.kind,
        "level": level.items[int(level.start)],
        **dict(zip(("input", "output", "ratio"), ends, strict=True)),
        "teeth": {gear.name: gear.teeth for gear in model.stage.gears},
        "meshes": {
            mesh.name: {"gears": list(mesh.gears), **{name: getattr(mesh, name) for name in limits}}
            for mesh in model.stage.engagements
        },
        "hashes": {"model": model.hash, "bodies": model.bodies},
        "files": stored_files(model.stage.written),
        "stage": stored(model.stage.written),
    }


def _seal(facts: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True, allow_nan=False).encode()).hexdigest()
