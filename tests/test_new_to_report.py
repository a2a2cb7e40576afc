"""From the first command of the pages to a report, for every kind of stage, by the commands that stand there.

Only what makes bodies dear is changed: they get few elements.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from verbs import ROOT, call

from gearfmu.stage import Trace

TINY = {"modes": 40, "roll_points": 8, "width_functions": 3, "flank": 6, "thickness": 2, "width": 2, "root": 3}
CARRIER = {"around": 2, "sides": 2, "bolt": 2, "disc": 3, "plate": 2, "neck": 2, "length": 2}
FOLDER = {"pair": "my_pair", "set": "my_set", "train": "my_train", "imported pinion": "mine"}


def words(line: str) -> list[str]:
    """The words of a command line; a comment ends it."""
    found = re.findall(r'"([^"]*)"|(\S+)', line.split(" #")[0])
    return [quoted or plain for quoted, plain in found]


def lines(page: str, pattern: str = r"^gearfmu .+$|^c[pd] .+$|^cat .+$|^ccx .+$") -> list[str]:
    """Command lines of a page, in its order."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [line for line in re.findall(pattern, text, flags=re.MULTILINE) if line]


def walk(kind: str) -> list[str]:
    """The command lines of a kind, from `new` to the run that ends in a report."""
    if kind == "pair":
        return [line for line in lines("tutorial.md") if "my_pair" in line]
    if kind == "set":
        return [line for line in lines("howto-own-stage.md") if "my_set" in line]
    if kind == "imported pinion":
        found = lines("howto-import.md")
        return found[: found.index(next(line for line in found if "simulate" in line)) + 1]
    made = re.findall(r"^\d\. `(gearfmu [^`]+)`", (ROOT / "docs" / "howto-train.md").read_text("utf-8"), re.MULTILINE)
    shown = [line.replace("two_stage", "my_train") for line in lines("howto-train.md") if "two_stage" in line]
    return [*made, *shown]


def with_few_elements(path: Path) -> None:
    """The counts of a stage file made small."""
    text = path.read_text(encoding="utf-8")
    for key, value in (TINY | CARRIER).items():
        text = re.sub(rf"^{key} = \d+", f"{key} = {value}", text, flags=re.MULTILINE)
    path.write_text(text, encoding="utf-8")


@pytest.mark.full
@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.needs("ccx")) if "imported" in kind else kind for kind in FOLDER]
)
def test_the_pages_lead_from_new_to_a_report(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for place in ("examples", "reduced_models"):
        (tmp_path / place).symlink_to(ROOT / place)
    done = []
    for line in walk(kind):
        verb, *rest = words(line)
        if verb == "cp":
            for source in rest[:-1]:
                shutil.copy(source, rest[-1])
        elif verb == "cat":
            with Path(rest[-1]).open("a", encoding="utf-8") as file:
                file.write(Path(rest[0]).read_text(encoding="utf-8"))
        elif verb == "ccx":
            subprocess.run([verb, *rest], check=True, stdout=subprocess.DEVNULL)
        elif verb == "cd":
            monkeypatch.chdir(rest[0])
        else:
            code, out, err = call(*rest)
            assert code == 0, f"{line}\n{out}\n{err}"
            done.append(rest[0])
            if rest[0] == "new" and kind != "imported pinion":
                with_few_elements(tmp_path / FOLDER[kind] / "stage.toml")
            if rest[0] == "new" and kind == "set":
                page = (ROOT / "docs" / "howto-own-stage.md").read_text(encoding="utf-8")
                (scene,) = re.findall(r"```toml\n(name = .+?)```", page, flags=re.DOTALL)
                (tmp_path / "my_set_run.toml").write_text(scene, encoding="utf-8")
    (trace,) = [path for path in tmp_path.rglob("trace.h5") if "reduced_models" not in path.parts]
    assert Trace.load(trace).time.size > 100
    assert {"new", "reduce"} <= set(done) and call("report", trace.parent)[0] == 0
    assert (trace.parent / "report.html").stat().st_size > 1e5
