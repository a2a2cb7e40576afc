"""JSON schema of the stage file, for editors that complete and check TOML."""

from __future__ import annotations

from typing import Any

from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.reading.base import Spec


def stage_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of stage.toml: quantities are text with a unit, gears are tables by name."""
    schema = _form_schema(StageSpec, "gearfmu stage", {"GearSpec": {"name"}})
    schema["properties"]["gears"] = {
        "type": "object", "description": schema["properties"]["gears"]["description"],
        "minProperties": 2, "maxProperties": 2, "additionalProperties": {"$ref": "#/$defs/GearSpec"},
    }  # fmt: skip
    return _with_base(schema)


def set_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of the stage.toml of a planetary set."""
    parts = {"SetGearSpec": {"name"}, "RingSpec": {"name"}}
    return _with_base(_form_schema(PlanetarySpec, "gearfmu planetary set", parts))


def general_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of the stage.toml of a general stage: a table for every body by its name."""
    here = {"GearBody": {"name", "bearing"}, "RingBody": {"name", "mounts"}, "ShaftBody": {"name"}}
    here["CarrierBody"] = {"bearing"}
    schema = _form_schema(Stage, "gearfmu general stage", here)
    schema["required"].append("kind")
    for name in ("Bearing", "MountsSpec"):
        schema["$defs"].pop(name, None)
    for name in ("bodies", "rotors", "ports"):
        schema["properties"][name]["additionalProperties"] = False
    return _with_base(schema)


def _form_schema(kind: type[Spec], title: str, elsewhere: dict[str, set[str]]) -> dict[str, Any]:
    """Schema of a form without `source` and, of its parts by class, without the fields that stand elsewhere."""
    schema = file_schema(kind) | {"title": title}
    for table, names in [(schema, {"source"}), *((schema["$defs"][part], own) for part, own in elsewhere.items())]:
        table["properties"] = {name: field for name, field in table["properties"].items() if name not in names}
        table["required"] = [name for name in table["required"] if name not in names]
    return schema


def _with_base(schema: dict[str, Any]) -> dict[str, Any]:
    """A file that begins with `base` need not say everything."""
    schema["properties"]["base"] = {"type": "string", "description": "file that says everything this one does not"}
    schema["if"] = {"required": ["base"]}
    schema["then"], schema["else"] = {}, {"required": schema.pop("required")}
    return schema


def file_schema(kind: type[Spec]) -> dict[str, Any]:
    """JSON schema of a spec class as it stands in a file: defaults of quantities as text, no null."""
    schema = kind.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return _as_in_file(schema)


def _as_in_file(part: Any) -> Any:
    if isinstance(part, list):
        return [_as_in_file(item) for item in part]
    if not isinstance(part, dict):
        return part
    choices = [choice for choice in part.get("anyOf", []) if choice != {"type": "null"}]
    if part.get("anyOf") and len(choices) == 1:
        part = {key: value for key, value in part.items() if key not in ("anyOf", "default")} | choices[0]
    elif part.get("anyOf"):
        part = part | {"anyOf": choices}
    if "default" in part and part["default"] is None:
        part = {key: value for key, value in part.items() if key != "default"}
    if "unit" in part and isinstance(part.get("default"), (int, float)):
        part = part | {"default": f"{part['default']:g} {part['unit']}"}
    return {key: _as_in_file(value) for key, value in part.items() if not (key == "title" and isinstance(value, str))}
