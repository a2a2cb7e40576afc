"""Parts of a stage that other files keep. An FMU holds its tables, which need none of its files, and is read back here.
The file of a body holds a hash of that body's table and of the files that it names, whatever stage it belongs to."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Set
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.forms.expand import expand
from gearfmu.stagefile.forms.general import Reduced, Stage
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.reading.base import Spec, validate
from gearfmu.stagefile.reading.files import named_files
from gearfmu.stagefile.stage import stage_class
from gearfmu.stagefile.tables.bodies import TOOTHING
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import import_inputs

FREE = ("description", "ports")  # fields in which two exports of one stage may differ


def stored(spec: Spec) -> dict[str, Any]:
    """The fields of a stage, or of what is written in its file, for JSON, SI, without `source`; files by their names
    without folders."""
    tables = spec.model_dump(mode="json", exclude={"source"})
    for table, key, _ in named_files(tables):
        table[key] = Path(table[key]).name
    return tables


def stored_files(spec: Spec) -> dict[str, str]:
    """SHA-256, hex, of every file that a stage names, by its field ("gears.0.topography"). SpecError for one that
    cannot be read."""
    found = {}
    for table, key, field in named_files(spec.model_dump(mode="json", exclude={"source"})):
        try:
            found[field] = hashlib.sha256(Path(table[key]).read_bytes()).hexdigest()
        except OSError as error:
            remedy = f"cannot be read ({error.strerror}): write the path relative to the stage file"
            raise SpecError.of(getattr(spec, "source", ""), field, table[key], remedy) from error
    return found


def restored(tables: Mapping[str, Any], source: Path) -> Stage:
    """The stage of `stored` tables of what is written in its file. source : the file that held them, for messages.
    SpecError with everything that is wrong."""
    spec, problems = validate(stage_class(tables), {**tables, "source": source}, str(source), from_file=False)
    if spec is None:
        raise SpecError(problems)
    return expand(spec)


def differences(one: Stage, other: Stage) -> list[tuple[str, str, str]]:
    """(field, value, other value) of all differences of two stage files but for descriptions, ports and folders."""
    tables = (stored(stage.written) for stage in (one, other))
    first, second = ({key: value for key, value in own.items() if key not in FREE} for own in tables)
    return list(_differences(first, second, ""))


def _differences(one: Any, other: Any, field: str) -> Iterator[tuple[str, str, str]]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in [*one, *(key for key in other if key not in one)]:
            yield from _differences(one.get(key), other.get(key), f"{field}.{key}" if field else str(key))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from _differences(a, b, f"{field}.{a['name'] if isinstance(a, dict) and 'name' in a else k}")
    elif one != other:
        yield field, _shown(one), _shown(other)


def _shown(value: Any) -> str:
    text = "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


ALGORITHMS = {"gear": 3, "ring": 3, "carrier": 3, "housing": 3}  # raised when the numbers of such bodies change
NOT_OF_BODY = {  # fields that shape no body: names, flanks, what holds it, what of it is dynamic
    "gear": {"name", "bearing"} | TOOTHING,
    "ring": {"name", "mounts"} | TOOTHING,
    "carrier": {"name", "bearing"},
    "housing": {"name", "dynamic_to"},
}


def body_inputs(table: Reduced) -> dict[str, Any]:
    """Everything that shapes a body, in SI: every field of its table but `NOT_OF_BODY`, so that a new field counts."""
    inputs = shaping(table, NOT_OF_BODY[table.kind] | {"reduced"}, exclude_none=True)
    if isinstance(table, CarrierBody):
        nodes = ("bore", *(f"bolt{k}" for k in range(len(table.bolts))))
        inputs["coupling"] = {node: table.coupling_of(node) for node in nodes}
    if isinstance(table, HousingBody) and table.reduced is not None:
        inputs["reduced"] = import_inputs(table.reduced)
    return inputs


def shaping(table: Any, left_out: Set[str], exclude_none: bool = False) -> dict[str, Any]:
    """The fields of the table of a body but those that are left out, SI.

    The addendum of a gear's rack is none of them: the tip diameter says where the tooth ends. With finite elements made
    elsewhere the contents of their files count, and not the counts of our own mesh; SpecError when one is missing.
    """
    inputs: dict[str, Any] = table.model_dump(exclude={"imported", *left_out}, exclude_none=exclude_none)
    if "rack" in inputs:
        inputs["rack"].pop("addendum")
    if table.imported is not None:
        inputs.get("body", inputs).pop("mesh", None)
        inputs["import"] = import_inputs(table.imported)
    return inputs


def body_hash(table: Reduced) -> str:
    """SHA-256 (64 hex digits) of `body_inputs` and the version of the algorithm that makes such bodies."""
    return hash_of(body_inputs(table) | {"algorithm": ALGORITHMS[table.kind]})


def expected_hash(stage: Stage, name: str) -> str:
    """`body_hash` of the body whose file is `name`. SpecError names the field in the stage file."""
    table = stage.by_file[name]
    try:
        return body_hash(table)
    except SpecError as error:
        key = table.table if isinstance(table, HousingBody) else "import"
        place, file = f"{stage.table_of(name)}.{key}", str(stage.source)
        found = [Problem(file, f"{place}.{p.field}", p.value, p.remedy) for p in error.problems]
        raise SpecError(found) from error


def hash_of(inputs: dict[str, Any]) -> str:
    """SHA-256 (64 hex digits) of inputs as JSON: sorted keys, floats in their shortest exact form, −0 as 0."""
    text = json.dumps(_plain(inputs), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value + 0.0 if isinstance(value, float) else value
