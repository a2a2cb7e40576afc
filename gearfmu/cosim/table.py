"""docs/drivetrain.md from the one table of values: python -m gearfmu.cosim.table > docs/drivetrain.md"""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from gearfmu.spec.base import Quantity, Spec
from gearfmu.spec.drivetrain import PassengerCar, TestRig, table
from gearfmu.spec.parts import TABLES, Drivetrain
from gearfmu.spec.scene import load_scene, shipped_scenes
from gearfmu.spec.shaft_loads import ShaftLoad

INTRODUCTION = """# Drivetrains and scenes

This page is made by `python -m gearfmu.cosim.table > docs/drivetrain.md` from `gearfmu/spec/drivetrain.py` and the
shipped scenes. A scene may give other values in its table `[passenger_car]` or `[test_rig]`. "Assumed" means: of the
size that is usual in such a car, taken from no measurement.

## Signs
All angles about +z; an external pair counter-rotates, so that everything behind the wheel gear turns negatively while
the pinion turns positively. In a spring port the outside gives `.phi`, `.w`, `.a` of the spring's outer end and
receives `.tau`, the torque on the outside.

## Where the cut lies
The stage is cut off at compliant elements, and the springs belong to the stage. With `chain_in_fmu = true` both cuts
lie at soft springs, and a communication step of 1 ms is possible ([coupling](coupling.md)):

    engine ─┤ dual-mass flywheel ─ secondary mass ─ clutch ─ disc ─ input shaft ─ pinion
              wheel ─ output shaft ─ final drive ─ half shafts ├─ road wheels ─ tyres ─ vehicle

What stands between ┤ and ├ is stage (FMU or kernel): two ports with a chain. The wheel's chain keeps its clutch closed
(capacity 1e6 N·m), so that its two inertias, half the final drive each, are one.
With `chain_in_fmu = false` secondary mass, clutch and disc, final drive and half shafts are computed outside; the cuts
are input shaft and output shaft."""


def page() -> str:
    """The text of docs/drivetrain.md."""
    return (
        "\n\n".join(
            [
                INTRODUCTION,
                *(_drivetrain(kind, title) for kind, title in ((PassengerCar, "Passenger car"), (TestRig, "Test rig"))),
                _shaft_loads(),
                _parts(),
                _scenes(),
            ]
        )
        + "\n"
    )


def _drivetrain(kind: type[PassengerCar] | type[TestRig], title: str) -> str:
    what = " ".join((kind.__doc__ or "").split())
    rows = [
        (
            f"`{row.name}`",
            row.meaning,
            "given by the scene" if row.value is None else f"{row.value:g}",
            row.unit,
            row.source,
        )
        for row in table(kind)
    ]
    return f"## {title}\n{what}\n\n" + _table(("name", "meaning", "value", "unit", "source"), rows)


def _shaft_loads() -> str:
    what = " ".join((ShaftLoad.__doc__ or "").split())
    rows = [(f"`{name}`", field.description or "") for name, field in ShaftLoad.model_fields.items()]
    about = f"A scene may give the torques on the stage's ports instead, `[shaft_loads.PORT]`. {what}"
    return f"## Torques on the shafts\n{about}\n\n" + _table(("name", "meaning"), rows)


def _parts() -> str:
    about = " ".join((Drivetrain.__doc__ or "").split())
    rows = []
    for name, kind in TABLES.items():
        own = [field for field in kind.model_fields if field not in ShaftLoad.model_fields]
        rows += [(f"`{name}`", f"`{field}`", *_meaning(kind, field)) for field in own]
    text = f"A scene may build its drivetrain itself, `[drivetrain]`, round any number of the stage's ports. {about}"
    text += " A torque has the laws of `[shaft_loads]` besides; how it starts: [howto-scene](howto-scene.md)."
    return f"## Own parts\n{text}\n\n" + _table(("table", "field", "meaning", "unit", "default"), rows)


def _meaning(kind: type[Spec], name: str) -> tuple[str, str, str]:
    field = kind.model_fields[name]
    inner = [item for part in get_args(field.annotation) for item in getattr(part, "__metadata__", ())]
    unit = next((item.unit for item in (*field.metadata, *inner) if isinstance(item, Quantity)), "")
    default = "" if field.is_required() or field.default is None else f"{field.default:g}"
    return field.description or "", unit, default


def _scenes() -> str:
    rows = []
    for name in shipped_scenes():
        scene = load_scene(name)
        rows.append(
            (
                f"`{name}`",
                scene.description,
                f"{scene.duration:g} s",
                f"{1e6 * scene.coupling.step:g} µs",
                scene.coupling.master,
                scene.stage.level,
            )
        )
    return "## Scenes\n" + _table(("name", "what", "duration", "communication step", "master", "level"), rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    print(page(), end="")
