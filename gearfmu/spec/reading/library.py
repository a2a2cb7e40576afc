"""Where stages are: the user's own files, and the shipped model library."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError, near_or_all
from gearfmu.spec.reading.base import read_toml

_PACKAGE = Path(__file__).resolve().parents[2]


def library_roots() -> tuple[Path, ...]:
    """Existing folders of shipped models: in an installed package, then in a checkout."""
    candidates = (_PACKAGE / "reduced_models", _PACKAGE.parent / "reduced_models")
    return tuple(root for root in candidates if root.is_dir())


def shipped_stages() -> list[str]:
    """Names that `find_stage` knows: "fzg_c", and "fzg_c/stage_relief" for further stage files of a folder."""
    names = set()
    for root in library_roots():
        for path in root.glob("*/stage*.toml"):
            names.add(path.parent.name if path.name == "stage.toml" else f"{path.parent.name}/{path.stem}")
    return sorted(names)


def find_stage(name: str | os.PathLike[str]) -> Path:
    """The stage file meant by a path, a folder with a stage.toml, a shipped name ("fzg_c/stage_relief") or what a
    shipped file calls itself (`name = "fzg_c_relief"`); the first of these goes before the next.

    SpecError names the nearest shipped stages when there is none.
    """
    own = Path(name)
    for place in (own, *(root / own for root in library_roots() if not own.is_absolute())):
        for path in (place, place / "stage.toml", place.with_name(f"{place.name}.toml") if place.name else place):
            if path.is_file():
                return path
    if own.parent == Path(".") and (named := _shipped_of_name(str(name))) is not None:
        return named
    shipped = shipped_stages()
    hint = near_or_all(str(name), shipped, "give the path of a stage.toml, or one of:", cutoff=0.6)
    raise SpecError([Problem(str(name), "", "", f"there is no such stage: {hint}")])


def _shipped_of_name(name: str) -> Path | None:
    """The shipped stage file that says `name = …` so."""
    files = (path for root in library_roots() for path in sorted(root.glob("*/stage*.toml")))
    return next((path for path in files if read_toml(path).get("name") == name), None)


def model_folder(stage: Any) -> Path:
    """The folder of a stage's file, which also holds its bodies, `<gear name>.h5`."""
    return Path(stage.source).parent
