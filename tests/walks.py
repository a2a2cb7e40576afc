"""Counts of what a newcomer has to read: walks, classes, forms, lines. `python tests/walks.py` prints the table; it
needs Python 3.11.

A walk counts the modules of gearfmu in which a function is entered. Its reader opens every top-level function and
class once, in the order of first use, including its methods and inner functions. His stays are runs of one module, his
returns stays in a module that he had left. A walk of a body begins at `make` and leaves out finite elements and
geometry, which are pure functions of arrays and numbers.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ROOT / "gearfmu"
STAGES = ("fzg_c", "planetary54", "two_stage")
SCENES = ("pair_loaded",)
FORMS = r"\b(?:StageSpec|PlanetarySpec)\b"
BODIES = r"^class (?:Body|ReducedBody|InterfaceBody|BeamBody|FreeBody)\b"
DRIVES = r"isinstance\([^()]*\b(?:CarSpec|RigSpec|PassengerCar|TestRig|ShaftLoad|Drivetrain)\w*"
COARSE = {"flank": 3, "thickness": 1, "root": 2, "rim": 1, "width": 2}


def walked(run: Callable[[], object], skip: tuple[str, ...] = ()) -> list[str]:
    """Modules of the top-level functions and classes that `run` enters, in the order of first use: a class is read
    whole, nested functions belong to theirs. skip: packages left out."""
    found = dict[tuple[str, str], None]()

    def entered(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        module, opened = code.co_filename.removeprefix(f"{PRODUCT}/"), code.co_qualname.partition(".")[0]
        ours = module != code.co_filename and not module.startswith(skip)
        if event == "call" and ours and opened != "<module>":
            found.setdefault((module, opened))

    sys.setprofile(entered)
    try:
        run()
    finally:
        sys.setprofile(None)
    return [module for module, _ in found]


def stays(walk: list[str]) -> tuple[int, int]:
    """Stays in modules, and how many of them are returns."""
    found = [module for k, module in enumerate(walk) if k == 0 or walk[k - 1] != module]
    return len(found), len(found) - len(set(found))


def to_model(name: str) -> list[str]:
    """From stage.toml to its model, with stored bodies."""
    from gearfmu.body import load_bodies
    from gearfmu.stage import assemble
    from gearfmu.stagefile.stage import load_stage

    def run() -> None:
        stage = load_stage(name)
        assemble(stage, load_bodies(stage))

    return walked(run)


def to_trace(name: str) -> list[str]:
    """From scene.toml to its trace."""
    import tempfile

    from gearfmu.cosim import run
    from gearfmu.scenefile.scene import load_scene

    with tempfile.TemporaryDirectory() as folder:
        return walked(lambda: run(load_scene(name, {"duration": 2e-3, "settle": 1e-3}), folder, "kernel"))


def to_body() -> list[str]:
    """From the table of a gear to its body."""
    from gearfmu.body.bodies import make
    from gearfmu.stagefile.stage import load_stage

    changes: dict[str, Any] = {f"gears.pinion.body.mesh.{field}": count for field, count in COARSE.items()}
    stage = load_stage("fzg_c", changes | {"gears.pinion.body.modes": 40})
    return walked(lambda: make(stage.by_file["pinion"]), ("fem", "geometry", "stagefile", "quantities.py"))


def signatures(word: str = "Any") -> int:
    """Parameters and results of functions whose annotation has a word."""
    found = 0
    for path in PRODUCT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                own = node.args
                args = [*own.posonlyargs, *own.args, *own.kwonlyargs, *filter(None, (own.vararg, own.kwarg))]
                notes = [arg.annotation for arg in args] + [node.returns]
                found += sum(bool(re.search(rf"\b{word}\b", ast.unparse(note))) for note in notes if note is not None)
    return found


def mentions(pattern: str, but: str = "") -> tuple[int, int]:
    """Lines and files of the product with a pattern. but: a package that is left out."""
    lines = [
        sum(bool(re.search(pattern, line)) for line in path.read_text(encoding="utf-8").splitlines())
        for path in PRODUCT.rglob("*.py")
        if not but or PRODUCT / but not in path.parents
    ]
    return sum(lines), sum(map(bool, lines))


def rows() -> Iterator[tuple[str, str]]:
    """Every count by its name."""
    models = {name: to_model(name) for name in STAGES}
    for name, walk in models.items():
        yield f"stage.toml → model, {name}", f"{len(set(walk))} modules"
    body = to_body()
    for name in SCENES:
        yield f"scene.toml → trace, {name}", f"{len(set(to_trace(name)))} modules"
    yield "table → body, pinion of fzg_c", "{} modules, {} stays, {} returns".format(len(set(body)), *stays(body))
    yield "forms of files below spec", "{} lines in {} files".format(*mentions(FORMS, "stagefile"))
    yield "classes of reduced bodies", f"{mentions(BODIES)[0]}"
    yield "places that ask for a drive by its class", "{} lines in {} files".format(*mentions(DRIVES, "scenefile"))
    yield "annotations with Any", f"{signatures()}"
    sizes = [len(path.read_text(encoding="utf-8").splitlines()) for path in PRODUCT.rglob("*.py")]
    yield (
        "lines of Python in the wheel",
        f"{sum(sizes)} in {len(sizes)} files, {sum(size < 50 for size in sizes)} below 50",
    )


if __name__ == "__main__":
    for what, count in rows():
        print(f"{what}: {count}")
