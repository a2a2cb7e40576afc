"""Stage, scene and body files with a fault each, and the messages that they were refused with: broken.json.

A case is the name of a shipped file and what is changed in it: "what stands there => what is written instead", several
changes apart by ";;". `PYTHONPATH=.:tests/stagefile python tests/stagefile/broken.py` writes the messages anew: for a
case that was added with an empty list, or a message that was changed on purpose.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py

from gearfmu.body import load_bodies
from gearfmu.cosim.scene_run import in_drivetrain
from gearfmu.errors import GearfmuError, Problem, SpecError
from gearfmu.files import seal
from gearfmu.scenefile.scene import SHIPPED, load_scene, shipped_scenes
from gearfmu.stage import assemble
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

STORED = Path(__file__).with_suffix(".json")
Change = tuple[str, str]  # what stands there, what is written instead


def _read(change: str) -> list[Change]:
    pairs = [part.split(" => ") for part in change.split(" ;; ")]
    return [(old.replace("\\n", "\n"), new.replace("\\n", "\n")) for old, new in pairs]


def _changed(text: str, changes: list[Change]) -> str:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def _stage(name: str, changes: list[Change], folder: Path) -> None:
    path, shipped = folder / "stage.toml", find_stage(name)
    text = shipped.read_text(encoding="utf-8").replace('base = "', f'base = "{shipped.parent.as_posix()}/')
    for deck in shipped.parent.glob("*.inp"):
        (folder / deck.name).symlink_to(deck)
    path.write_text(_changed(text, changes), encoding="utf-8")
    stage = load_stage(path)
    assemble(stage, load_bodies(load_stage(name)))


def _scene(name: str, changes: list[Change], folder: Path) -> None:
    path = folder / "scene.toml"
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    path.write_text(_changed(text, changes), encoding="utf-8")
    scene = load_scene(path)
    in_drivetrain(scene, load_stage(scene.stage.name))


def _spoilt(file: str, spoil: Callable[[Path], None], name: str, folder: Path) -> None:
    """In the folder of a shipped stage: copies of its file and of one body, links to the other bodies."""
    for path in find_stage(name).parent.glob("*"):
        if path.name in (file, "stage.toml"):
            (folder / path.name).write_bytes(path.read_bytes())
        else:
            (folder / path.name).symlink_to(path)
    spoil(folder / file)
    load_bodies(load_stage(folder))


def _edited(edit: Callable[[h5py.File], None]) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            edit(file)
        seal(path)

    return spoil


def _first_dataset(file: h5py.File) -> str:
    names: list[str] = []
    file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return sorted(names)[0]


def _replaced(old: str, new: str) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        stage = path.parent / "stage.toml"
        stage.write_text(_changed(stage.read_text(encoding="utf-8"), [(old, new)]), encoding="utf-8")

    return spoil


SPOILT: dict[str, Callable[[Path], None]] = {
    "missing": Path.unlink,
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-4096]),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-1] + bytes([path.read_bytes()[-1] ^ 1])),
    "other format": _edited(lambda file: file.attrs.modify("format", "gearfmu-trace")),
    "other version": _edited(lambda file: file.attrs.modify("format_version", 9)),
    "lost dataset": _edited(lambda file: file.__delitem__(_first_dataset(file))),
    "other numbers": _replaced('density = "7850 kg/m^3"', 'density = "7800 kg/m^3"'),
}


def stored() -> dict[str, list[str]]:
    """Lines of the message by the name of the case."""
    return json.loads(STORED.read_text(encoding="utf-8"))


def case(name: str) -> Callable[[Path], None]:
    """What is done in an empty folder and refused."""
    file, _, change = name.partition(": ")
    if file.endswith(".h5"):
        stage, _, body = file.partition("/")
        return partial(_spoilt, body, SPOILT[change], stage)
    return partial(_scene if file in shipped_scenes() else _stage, file, _read(change))


def message(name: str, folder: Path) -> list[str]:
    """The lines that it is refused with, the folder left away; none where it is not refused."""
    try:
        case(name)(folder)
    except GearfmuError as error:
        said = f"{type(error).__name__}: {error}".replace(str(folder), "…")
        shipped = str(find_stage("fzg_c").parents[1])
        return re.sub(r"0x[0-9a-f]+", "0x…", said.replace(shipped, "shipped")).splitlines()
    return []


def problems(changes: dict[str, Any], stage: Path | str = "fzg_c") -> dict[str, Problem]:
    """All that is wrong with a stage after these changes, by field; none where the stage loads."""
    try:
        load_stage(stage, changes)
    except SpecError as error:
        assert str(error) == "\n".join(map(str, error.problems))
        return {problem.field: problem for problem in error.problems}
    return {}


if __name__ == "__main__":
    messages = {}
    for case_name in stored():
        with tempfile.TemporaryDirectory() as temporary:
            messages[case_name] = message(case_name, Path(temporary))
    STORED.write_text(json.dumps(messages, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
