"""The hash of a body: of its table and of the files that it names, whatever stage it stands in."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.forms.general import Reduced, Stage
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.tables.flanks import TOOTHING
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import import_inputs

ALGORITHMS = {"gear": 3, "ring": 3, "carrier": 3, "housing": 3}  # raised when the numbers of such bodies change
NOT_OF_BODY = {  # fields that shape no body: names, flanks, what holds it, what of it is dynamic
    "gear": {"name", "bearing"} | TOOTHING,
    "ring": {"name", "mounts"} | TOOTHING,
    "carrier": {"name", "bearing"},
    "housing": {"name", "dynamic_to"},
}


def body_inputs(table: Reduced) -> dict[str, Any]:
    """Everything that shapes a body, in SI: every field of its table but `NOT_OF_BODY`, so that a new field counts.

    The addendum of a gear's rack is left out: the tip diameter says where the tooth ends. With finite elements made
    elsewhere the contents of their files count, and not the counts of our own mesh; SpecError when one is missing.
    """
    inputs = table.model_dump(exclude={*NOT_OF_BODY[table.kind], "imported", "reduced"}, exclude_none=True)
    if "rack" in inputs:
        inputs["rack"].pop("addendum")
    if isinstance(table, CarrierBody):
        nodes = ("bore", *(f"bolt{k}" for k in range(len(table.bolts))))
        inputs["coupling"] = {node: table.coupling_of(node) for node in nodes}
    if table.imported is not None:
        inputs.get("body", inputs).pop("mesh", None)
        inputs["import"] = import_inputs(table.imported)
    if isinstance(table, HousingBody) and table.reduced is not None:
        inputs["reduced"] = import_inputs(table.reduced)
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
