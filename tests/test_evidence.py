"""The ledger of evidence: every generated file has an entry, none was written without a record; how it ages."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from ledger import GOLDEN, Ledger, check, content, make

ROOT = Path(__file__).resolve().parents[1]

GENERATED = (
    r"evidence/.*\.(csv|json|png|svg)|docs/pictures/.*\.(png|svg)|docs/(stability|variables|effects)\.md|"
    r"gearfmu/.*\.csv|reduced_models/.*\.csv"
)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_every_generated_file_has_one_entry() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    made = [file for entry in Ledger().read().values() for file in entry["makes"]]
    wanted = {file for file in listed if re.fullmatch(GENERATED, file)} - {"evidence/ledger.json"}
    assert len(made) == len(set(made)) and set(made) == wanted


def test_no_file_was_written_without_a_record() -> None:
    ledger = Ledger()
    touched = {name: ledger.touched(entry) for name, entry in ledger.read().items()}
    wrong = {name: files for name, files in touched.items() if files}
    assert not wrong, f"python evidence/ledger.py make --again {' '.join(wrong)} (or forget)"


def test_inputs_exist_and_are_made_before_they_are_used() -> None:
    made: set[str] = set()
    for name, entry in reversed(Ledger().read().items()):
        files = {need for need in entry["needs"] if not re.match(r"kernel|reduction$|stage ", need)}
        assert all(any(ROOT.glob(need)) for need in files), name
        assert not made & files, f"{name} stands before what it is made from"
        made |= set(entry["makes"])


def test_the_readme_shows_its_pictures_and_what_they_are_made_from() -> None:
    assert Ledger().shown() == {"pictures", "cost", "study", "study_sets"}


@pytest.fixture()
def small(tmp_path: Path) -> Ledger:
    """A table made from a stage file and the golden runs, a page made from the table, a picture that fails."""
    targets = {
        "table": ("sed s/in/out/ stage.toml > table.csv; echo done", ["kernel", "*.toml"], ["table.csv"]),
        "page": ("cat table.csv > page.svg", ["table.csv"], ["page.svg"]),
        "picture": ("echo no browser; exit 3", ["kernel"], []),
    }
    entries = {
        name: {"command": command, "needs": dict.fromkeys(needs, ""), "makes": dict.fromkeys(makes, "")}
        | {"made": "", "minutes": None, "ended": ""}
        for name, (command, needs, makes) in targets.items()
    }
    (tmp_path / GOLDEN).parent.mkdir(parents=True)
    (tmp_path / GOLDEN).write_text('{"float": {"loaded/fast": "12"}}')
    (tmp_path / "stage.toml").write_text("in = 1\n")
    (tmp_path / "README.md").write_text("![cost](page.svg)")
    (tmp_path / "ledger.json").write_text(json.dumps(entries))
    return Ledger(tmp_path, tmp_path / "ledger.json")


def test_what_is_stale_is_made_and_only_that(small: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Ledger, "golden", lambda self: True)
    said: list[str] = []
    assert list(small.stale()) == ["table", "page", "picture"] and check(small, said.append) == 1
    assert make(small, [], tell=said.append) == 1 and (small.root / "page.svg").read_text() == "out = 1\n"
    assert small.stale() == {"picture": ["exit 3: no browser"]} and check(small, said.append) == 0
    assert small.read()["table"]["ended"] == "done" and "1 of 3 stale" in said[-1]
    (small.root / GOLDEN).write_text('{"float":\n {"loaded/fast": "12", "helical/friction": "7"}}')
    assert list(small.stale()) == ["picture"]
    (small.root / GOLDEN).write_text('{"float": {"loaded/fast": "13"}}')
    assert small.stale()["table"] == ["kernel moved"] and small.stale()["page"] == ["table.csv is stale"]
    assert make(small, ["table"], tell=said.append) == 0 and list(small.stale()) == ["picture"]
    (small.root / "table.csv").write_text("by hand")
    assert small.stale()["table"] == ["table.csv is not what was recorded"]
    small.record("table", {})
    assert small.stale()["table"] == ["made from what is not known"]


def test_nothing_is_made_by_a_kernel_with_other_runs(small: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Ledger, "golden", lambda self: False)
    with pytest.raises(SystemExit, match="golden_runs"):
        make(small, [], tell=print)
    assert not (small.root / "table.csv").exists()


def test_words_about_code_are_no_input(tmp_path: Path) -> None:
    first, second, third = (tmp_path / f"{name}.py" for name in ("first", "second", "third"))
    first.write_text('"""Says what."""\n\n# why\nx = 1  # one\n')
    second.write_text('"""Says it\n\nbetter."""\nx = 1\n')
    third.write_text("x = 2\n")
    assert content(first) == content(second) != content(third)
