"""The shape of the code: who may import whom, how long files and functions are, what no file may say."""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted((ROOT / "gearfmu").rglob("*.py"))
LARGEST_FILE = 1e6  # bytes: history keeps every version of it
LARGER = {  # files that may be, up to 1.4 MB: tests/body/test_shipped.py
    "reduced_models/helical_demo/pinion.h5",
    "reduced_models/helical_demo/wheel.h5",
    "reduced_models/two_stage/housing.h5",
    "reduced_models/two_stage/pinion1.h5",
    "reduced_models/two_stage/pinion2.h5",
}
INSIDE = {  # sub-packages of a package in reading order; "" are its own files
    "stagefile": ("reading", "tables", "forms", "checks", "", "proposals"),
    "stage": ("assembly", "run", ""),
    "reduction": ("cyclic", "imported"),
}
KERNEL_MAY_IMPORT = {"errors", "files", "kernel"}
KERNEL = ROOT / "gearfmu" / "kernel" / "src"
KERNEL_ORDER = ("base", "model", "setup", "force", "problem", "integrate", "run", "fmi2")


def packages() -> list[str]:
    """Package and file names in reading order, from the list in docs/architecture.md."""
    block = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("```")[3]
    words = [word for line in block.splitlines() for word in line.split("  ")[0].split()]
    return [word.removeprefix("gearfmu/").removesuffix("/").removesuffix(".py") for word in words]


ORDER = {name: rank for rank, name in enumerate(packages())}


def package_of(module: str) -> str:
    """Package of "gearfmu.stage.run.trace" is "stage"; of "gearfmu" itself the empty string, which stands above all."""
    return (module.split(".") + [""])[1]


def imported(text: str, package: list[str]) -> set[str]:
    """Every module of ours that a file in `package` with this text imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            found |= {f"{module}.{alias.name}" for alias in node.names} if module == "gearfmu" else {module}
    return {name for name in found if name.split(".")[0] == "gearfmu"}


@cache
def imports_of(path: Path) -> set[str]:
    """`imported` for a file of ours."""
    package = ["gearfmu", *path.relative_to(ROOT / "gearfmu").parent.parts]
    return imported(path.read_text(encoding="utf-8"), package)


def test_imports_point_upward_only() -> None:
    wrong = []
    for path in SOURCES:
        own = package_of("gearfmu." + path.relative_to(ROOT / "gearfmu").with_suffix("").as_posix().replace("/", "."))
        assert own in ORDER, f"{path} is in no package of docs/architecture.md"
        used = {package_of(module) for module in imports_of(path)}
        below = {name for name in used if name and ORDER.get(name, len(ORDER)) > ORDER[own]}
        wrong += [f"{path} imports {name}" for name in below | (used - KERNEL_MAY_IMPORT if own == "kernel" else set())]
    assert len(SOURCES) > 300 and not wrong


def test_imports_inside_a_package_point_upward_only() -> None:
    wrong = []
    for path in SOURCES:
        package, *rest = path.relative_to(ROOT / "gearfmu").parts
        order, own = INSIDE.get(package, ()), rest[0] if len(rest) > 1 else ""
        if own not in order:
            continue
        words = [name.split(".") for name in imports_of(path) if name.startswith(f"gearfmu.{package}.")]
        used = {word[2] if word[2] in order else "" for word in words} & set(order)
        wrong += [f"{path} imports {name}" for name in used if order.index(name) > order.index(own)]
    assert not wrong


def test_every_way_to_write_an_import_is_seen() -> None:
    text = "from gearfmu import report\ndef f():\n    from ..stage import trace\nimport gearfmu.cli\nimport numpy"
    assert imported(text, ["gearfmu", "stagefile"]) == {"gearfmu.report", "gearfmu.stage", "gearfmu.cli"}
    assert ORDER["errors"] < ORDER["stagefile"] < ORDER["stage"] < ORDER["report"] < ORDER["cli"]


# ---- the kernel ------------------------------------------------------------------------------------------------------
def kernel_sources() -> dict[str, str]:
    """Text of every C source and header by its place."""
    found = {path.relative_to(KERNEL).as_posix(): path for path in KERNEL.rglob("*") if path.suffix in (".c", ".h")}
    return {place: path.read_text(encoding="utf-8") for place, path in found.items()}


def kernel_rank(place: str) -> int:
    """Files that lie in no folder may be included by all."""
    return KERNEL_ORDER.index(place.partition("/")[0]) if "/" in place else -1


def test_includes_and_calls_of_the_kernel_point_upward_only() -> None:
    left_out = re.compile(r"/\*.*?\*/|//[^\n]*|GK_ASSERT\(.*?\);", re.S)
    plain = {place: left_out.sub("", text) for place, text in kernel_sources().items()}
    definition = re.compile(r"^\w[^;{}#=()]*\b(gk_\w+)\([^;{}]*\)\s*\{", re.M)
    defined = {name: place for place, text in plain.items() for name in definition.findall(text)}
    wrong = []
    for place, text in plain.items():
        used = re.findall(r'^#include "([^"]+)"', text, re.M)
        used += [defined[word] for word in set(re.findall(r"\w+", text)) & defined.keys() if place.endswith(".c")]
        wrong += [f"{place} uses {other}" for other in used if kernel_rank(other) > kernel_rank(place)]
    assert len(defined) > 300 and defined["gk_step_once"] == "integrate/gk_step.c" and not wrong
    assert {place.partition("/")[0] for place in plain if "/" in place} == set(KERNEL_ORDER)


def test_files_and_lines_of_the_kernel_are_short() -> None:
    """400 lines of 120 columns; clang-format leaves comments alone."""
    for place, text in kernel_sources().items():
        lines = text.splitlines()
        assert len(lines) <= 400 and max(map(len, lines)) <= 120, place


# ---- files -----------------------------------------------------------------------------------------------------------
def test_modules_and_functions_are_short() -> None:
    """400 and 70 lines; docstrings and numbers of arguments: ruff."""
    wrong = []
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        wrong += [f"{path} has more than 400 lines"] if len(text.splitlines()) > 400 else []
        defined = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
        wrong += [f"{path}: {n.name} has more than 70 lines" for n in defined if (n.end_lineno or 0) - n.lineno >= 70]
    assert not wrong


def test_names_of_test_modules_are_their_own() -> None:
    """Folders of tests are no packages: pytest refuses two modules of one name, but says so only in a whole run."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert names and not [name for name, count in names.items() if count > 1]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_no_file_of_the_repository_is_large_without_being_listed() -> None:
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [ROOT / name for name in names.split("\0") if name]
    large = {str(path.relative_to(ROOT)) for path in paths if path.is_file() and path.stat().st_size > LARGEST_FILE}
    assert large == LARGER, f"not listed: {sorted(large - LARGER)}; no longer large: {sorted(LARGER - large)}"
