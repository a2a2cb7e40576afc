"""The ledger of evidence: every generated file has an entry, none was written without a record; how it ages, is made,
carried and shown."""

from __future__ import annotations

import csv
import json
import re
import subprocess
from pathlib import Path

import pytest

from evidence import sources
from evidence.ledger import Ledger, carry, check, make
from evidence.pages_made import filled, made
from evidence.sources import Sources, c_code, python_code

ROOT = Path(__file__).resolve().parents[1]
LAW = "gearfmu/kernel/src/problem/gk_law.c"
GENERATED = (
    r"evidence/.*\.(csv|json|png|svg)|docs/pictures/.*\.(png|svg)|docs/(stability|variables|effects)\.md|"
    r"gearfmu/.*\.csv|reduced_models/.*\.csv"
)
SETTLED = {f"docs/pictures/frf_{name}.svg" for name in ("carrier", "carrier_free", "cost", "growth", "ring")}
SETTLED |= {"docs/pictures/paper_run.png", "docs/pictures/ring_deformation.png"}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_every_generated_file_has_one_entry() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    made = [file for entry in Ledger().read().values() for file in entry["makes"]]
    wanted = {file for file in listed if re.fullmatch(GENERATED, file)} - {"evidence/ledger.json", *SETTLED}
    assert len(made) == len(set(made)) and set(made) == wanted


def test_no_file_was_written_without_a_record() -> None:
    ledger = Ledger()
    touched = {name: ledger.touched(entry) for name, entry in ledger.read().items()}
    wrong = {name: files for name, files in touched.items() if files}
    assert not wrong, f"python -m evidence.ledger make --again {' '.join(wrong)} (or forget)"


def test_inputs_exist_and_are_made_before_they_are_used() -> None:
    """Files of later tiers are taken as they are."""
    made: set[str] = set()
    entries = Ledger().read()
    below = {file for entry in entries.values() if entry["tier"] > 1 for file in entry["makes"]}
    for name, entry in reversed(entries.items()):
        files = {need for need in entry["needs"] if not re.match(r"kernel$|reduction$|code$|stage ", need)}
        later = made & files if entry["tier"] == 1 else set()
        assert all(any(ROOT.glob(need)) for need in files), name
        assert not later - below, f"{name} stands before what it is made from"
        made |= set(entry["makes"])


def test_inputs_follow_from_the_code_that_a_command_runs() -> None:
    """Whoever loads the kernel ages with its sources; whoever uses what makes models names the model or that code."""
    present = Sources(ROOT)
    for name, entry in Ledger().read().items():
        if "code" not in entry["needs"]:
            continue
        modules = present.modules(entry["command"])
        assert any(module.startswith(("evidence/", "gearfmu/commands/", "tests/")) for module in modules), name
        if name in ("cost", "pages", "mutants"):  # rows of a table; tables of the code; all of the code
            continue
        named = " ".join(entry["needs"])
        if "evidence/" in entry["command"].replace(".", "/") and "gearfmu/kernel/instance.py" in modules:
            assert "kernel" in entry["needs"] or "reduction" in entry["needs"], name
        assert "stage " in named or "reduction" in named, name


def test_what_the_readme_shows_is_of_tier_1() -> None:
    shown = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    tiers = {file: entry["tier"] for entry in Ledger().read().values() for file in entry["makes"]}
    assert shown and {tiers[file] for file in shown} == {1}


# A trial: one constant is changed.


@pytest.fixture()
def current(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Ledger:
    """The ledger as if all of it had been made a moment ago; assembling models is left out."""
    monkeypatch.setattr(sources, "stage_hash", lambda name: f"model of {name}")
    ledger = Ledger()
    entries, now = ledger.read(), ledger.sources()
    for entry in entries.values():
        entry["needs"] = {need: now.digest(need, entry["command"]) for need in entry["needs"]}
    (tmp_path / "ledger.json").write_text(json.dumps(entries))
    return Ledger(file=tmp_path / "ledger.json")


def edited(ledger: Ledger, file: str, pattern: str, new: str) -> set[str]:
    """Names of stale targets after an edit of a file, which must change it."""
    text = (ROOT / file).read_text(encoding="utf-8")
    after, count = re.subn(pattern, new, text, count=1, flags=re.MULTILINE)
    assert count == 1 and after != text
    code = python_code(after) if file.endswith(".py") else c_code(after)
    return set(Ledger(file=ledger.file, edits={file: code.encode()}).stale())


AGING = {  # file, what is changed in it, targets that age, and some that do not
    "kernel": (LAW, r"\b0\.5\b", "0.51", {"study", "study_sets", "steps", "stability", "cost"}, {"in_time"}),
    "reduction": (
        "gearfmu/reduction/carrier.py",
        r"^FINER = 1\.6",
        "FINER = 1.7",
        {"in_time", "calculix_helical"},
        {"study", "steps", "stability", "pages"},
    ),
    "planning": ("gearfmu/planning/judge.py", r"\A", "MORE = 1\n", {"plans"}, {"study"}),
    "coupling": ("gearfmu/cosim/coupled.py", r"\A", "MORE = 1\n", {"study", "study_sets", "cost"}, {"energy"}),
    "program": ("evidence/energy/energy.py", r"\A", "MORE = 1\n", {"energy"}, {"study", "stability", "plans"}),
}


@pytest.mark.parametrize("what", AGING)
def test_a_change_ages_all_that_runs_it(current: Ledger, what: str) -> None:
    assert current.stale() == {}
    file, pattern, new, aged, fresh = AGING[what]
    stale, needs = edited(current, file, pattern, new), {name: set(e["needs"]) for name, e in current.read().items()}
    assert aged <= stale and not fresh & stale
    if what == "kernel":
        assert stale == {name for name, need in needs.items() if "kernel" in need} | {"cost"}
    if what == "reduction":
        assert stale == {name for name, need in needs.items() if {"reduction", "gearfmu/**/*.py"} & need}


def test_words_about_code_are_no_input(current: Ledger) -> None:
    assert not edited(current, LAW, r"\A", "/* why */ // how\n")
    assert not edited(current, "gearfmu/study/norm.py", r"\A", "# why\n")
    first = '"""Says what."""\n\n# why\nx = 1  # one\ny = "# two"\n'
    second = '"""Says it\n\nbetter."""\nx = 1\n\ny = "# two"  # three\n'
    assert python_code(first) == python_code(second) == 'x = 1\ny = "# two"'
    assert c_code('a = 1; /* b\n c */\nd = "/* e */"; // f\n\n') == 'a = 1;\nd = "/* e */";'


# Making, on a small tree.


@pytest.fixture()
def small(tmp_path: Path) -> Ledger:
    """A table made from a stage file and the kernel, a page made from the table, a picture of tier 2 that fails."""
    targets = {
        "table": (1, "cp stage.csv table.csv; echo done", ["kernel", "*stage.csv"], ["table.csv"]),
        "page": (1, "cat table.csv > page.svg", ["table.csv"], ["page.svg"]),
        "picture": (2, "echo no browser; exit 3", ["kernel"], []),
    }
    entries = {
        name: {"tier": tier, "command": command, "needs": dict.fromkeys(needs, ""), "makes": dict.fromkeys(makes, "")}
        | {"made": "", "minutes": None, "ended": ""}
        for name, (tier, command, needs, makes) in targets.items()
    }
    (tmp_path / "gearfmu/kernel/src").mkdir(parents=True)
    (tmp_path / "gearfmu/kernel/src/gk_law.c").write_text("half = 0.5;")
    (tmp_path / "stage.csv").write_text("name,z,s\n" + "".join(f"a{k},{k}.5,{k}\n" for k in range(5)))
    (tmp_path / "README.md").write_text("Made <!-- made: table -->never<!-- -->.\n")
    (tmp_path / "ledger.json").write_text(json.dumps(entries))
    return Ledger(tmp_path, tmp_path / "ledger.json")


def test_what_is_stale_is_made_and_only_that(small: Ledger) -> None:
    said: list[str] = []
    law = small.root / "gearfmu/kernel/src/gk_law.c"
    assert list(small.stale()) == ["table", "page", "picture"] and check(small, said.append) == 1
    assert make(small, [], tell=said.append) == 0 and (small.root / "page.svg").read_text().startswith("name,z")
    assert small.stale() == {"picture": ["made from what is not known"]} and check(small, said.append) == 0
    assert make(small, [], tier=2, tell=said.append) == 1 and small.stale() == {"picture": ["exit 3: no browser"]}
    assert small.read()["table"]["ended"] == "done" and "failed: picture" in said[-1]
    law.write_text("half = 0.51;")
    assert small.stale()["table"] == ["kernel moved"] and small.stale()["page"] == ["table.csv is stale"]
    assert make(small, ["table"], tell=said.append) == 0 and list(small.stale()) == ["picture"]
    assert "1 made" in said[-1]
    (small.root / "table.csv").write_text("by hand")
    assert small.stale()["table"] == ["table.csv is not what was recorded"]
    small.record("table", {})
    assert small.stale()["table"] == ["made from what is not known"]


def test_a_crash_leaves_the_target_stale(small: Ledger, monkeypatch: pytest.MonkeyPatch) -> None:
    make(small, ["table"], tell=str)
    assert "table" not in small.stale()

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("evidence.ledger.run", killed)
    with pytest.raises(KeyboardInterrupt):
        small.make("table", again=True)
    assert small.stale()["table"] == ["exit: interrupted"]


def test_pages_say_when_their_tables_were_made(small: Ledger) -> None:
    make(small, ["table"], tell=str)
    page = (small.root / "README.md").read_text()
    assert page == f"Made <!-- made: table -->{made(small.read()['table'])}<!-- -->.\n" and "20" in page
    entry = {"made": "2026-11-28", "commit": "a401c1e1d2b3", "tier": 2, "minutes": 3}
    text = filled("<!-- tier: 2 -->\n<!-- -->", {"plans": entry}, ROOT)
    assert "| plans | 2026-11-28, commit a401c1e1d2b3 | 3 |" in text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_shows_ledger_and_tables_as_they_are(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == filled(text, Ledger().read(), ROOT / "evidence"), "python -m evidence.ledger pages"


def test_carried_is_what_three_rows_made_again_show(small: Ledger, tmp_path: Path) -> None:
    make(small, ["table"], tell=str)
    (small.root / "gearfmu/kernel/src/gk_law.c").write_text("half = 1.0 / 2.0;")
    said: list[str] = []
    assert carry(small, "table", "rewritten", None, [], said.append) == 0 and len(said) == 3
    assert small.stale()["table"] == ["kernel moved"]
    names = [word for line in said for word in re.findall(r"a\d", line)]
    again = tmp_path / "again.csv"
    again.write_text("name,z,s\n" + "".join(f"{n},{n[1]}.5000000001,9\n" for n in names))
    assert carry(small, "table", "rewritten", again, [], said.append) == 1
    assert carry(small, "table", "rewritten", again, ["s"], said.append) == 0 and "table" not in small.stale()
    entry = small.read()["table"]
    assert entry["carried"]["reason"] == "rewritten" and len(entry["carried"]["rows"]) == 3
    again.write_text("name,z,s\n" + "".join(f"{n},{n[1]}.51,9\n" for n in names))
    assert carry(small, "table", "rewritten", again, ["s"], said.append) == 1
    make(small, ["table"], again=True, tell=str)
    assert "carried" not in small.read()["table"]


def test_two_at_a_time_unless_alone_and_after_their_inputs(small: Ledger) -> None:
    entries = small.read()
    entries |= {"other": dict(entries["picture"], tier=1), "price": dict(entries["picture"], tier=1, alone=True)}
    for name, entry in entries.items():
        made = f"; echo {name} > {file}" if (file := next(iter(entry["makes"]), "")) else ""
        entry["command"] = f"echo {name} >> log; sleep 0.3; echo {name} >> log{made}"
    small.file.write_text(json.dumps(entries))
    assert make(small, [], tell=str) == 0
    log = (small.root / "log").read_text().split()  # begin and end of each
    first, last = ({name: log.index(name) for name in log}, {name: len(log) - log[::-1].index(name) for name in log})
    assert sorted(log) == sorted(2 * ["table", "page", "other", "price"])
    assert max(first["table"], first["other"]) < min(last["table"], last["other"]) - 1, "two at a time"
    assert last["price"] - first["price"] == 2 and last["table"] <= first["page"]


# ---- numbers that README.md quotes -----------------------------------------------------------------------------------
NUMBER = r"(\d[\d.]*(?:e[+-]?\d+)?)"
STUDY, SETS, STEPS = "evidence/study/study.csv", "evidence/study/sets.csv", "evidence/price/steps.csv"
PAIR = {"scene": "pair_loaded", "level": "fast", "h_s": "6.66667e-06", "slices": "5", "integrator": "dg4"}
PAIR_STEP = {"stage": "fzg_c/stage_relief", "level": "fast", "h_s": "6.66667e-06"}
PLANETS = {"planets": "4", "level": "fast", "h_s": "1e-05", "speed": "85", "slices": "5", "off": ""}
Cell = tuple[str, dict[str, str], str]
QUOTES: dict[str, tuple[tuple[Cell, ...], float]] = {
    "At its default step a second of the loaded pair takes # s, # thousand instructions a step, at # % error in "
    "transmission error and # % in mesh force": (
        (
            (STUDY, PAIR, "realtime_factor"),
            (STEPS, PAIR_STEP, "instructions_per_step^"),
            (STUDY, PAIR, "te_error%"),
            (STUDY, PAIR, "force_error%"),
        ),
        0.0,
    ),
    "for # s (pair) to some # s (planetary set) of processor time a second": (
        ((STUDY, PAIR, "realtime_factor"), (SETS, PLANETS | {"against": "full, 0.4 µs"}, "realtime_factor")),
        0.15,
    ),
}


def number(cell: Cell) -> float:
    """What a table says."""
    table, wanted, column = cell
    with (ROOT / table).open(newline="", encoding="utf-8") as file:
        (row,) = [row for row in csv.DictReader(file) if wanted.items() <= row.items()]
    return {"%": 100.0, "^": 1e-3}.get(column[-1], 1.0) * float(row[column.rstrip("%^")])


def agrees(shown: str, value: float, tolerance: float) -> bool:
    """Whether a number rounds, or comes as near as the tolerance, to what is shown."""
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(f"{mantissa}e{exponent or 0}") - value) <= max(0.5001 * last, tolerance * abs(value))


@pytest.mark.parametrize("phrase", QUOTES)
def test_the_readme_says_what_its_tables_say(phrase: str) -> None:
    cells, tolerance = QUOTES[phrase]
    pattern = re.escape(phrase).replace(r"\#", NUMBER).replace(r"\ ", r"\s+")
    place = re.search(pattern, (ROOT / "README.md").read_text(encoding="utf-8"))
    assert place, phrase
    for shown, cell in zip(place.groups(), cells, strict=True):
        assert agrees(shown, number(cell), tolerance), (cell, shown, number(cell))
