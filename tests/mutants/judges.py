"""Which tests judge a line of the program: those modules that ran it, found by coverage of one run of each module.

The map is one file for each test module in build/mutants/map, made once and again after the module has changed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from copies import KEPT, ROOT, Copy

MAP = KEPT / "map"
FOLDERS = "geometry relations kernel stagefile femesh fem cosim reduction body modes planning stage report rexs".split()
FOLDERS += "study imports . sweeps bearing fmu sound stability".split()
STORED = "test_golden", "test_evidence"  # answers of our own: no judges
OF_TEXTS = "test_said_twice test_builds test_fuzz test_docs test_packages"
OF_TEXTS += " test_notebooks test_examples test_chain test_mutants test_interrupted"
MOST = 6  # modules of the map that are heard before those that it does not know
SECONDS = 2.0  # processor time that a module has to show which lines it runs


@dataclass(frozen=True)
class Judge:
    """A test module: processor time of its run under coverage, s, whether it passes, and lines that it runs."""

    module: str
    seconds: float
    green: bool
    lines: dict[str, list[int]]

    @cached_property
    def size(self) -> int:
        return sum(map(len, self.lines.values()))

    def share(self, file: str) -> float:
        """How much of all that it runs lies in a file."""
        return len(self.lines.get(file, ())) / self.size


def modules() -> Iterator[Path]:
    for folder in FOLDERS:
        for path in sorted((ROOT / "tests" / folder).glob("test_*.py")):
            if not path.stem.startswith((*STORED, *OF_TEXTS.split())):
                yield path


def make_map() -> None:
    """Runs every module that has no current entry."""
    if find_spec("coverage") is None:
        raise SystemExit("the map needs the package coverage: pip install coverage")
    MAP.mkdir(parents=True, exist_ok=True)
    wanted = [str(path.relative_to(ROOT)) for path in modules() if not _place(path).exists()]
    copy = Copy("map")
    if message := copy.build(coverage=True):
        raise SystemExit(message)
    for name, run in copy.lines(wanted, SECONDS):
        entry = {"module": name, "seconds": run.seconds, "green": not run.failed, "lines": run.lines}
        place = _place(ROOT / name)
        for old in MAP.glob(f"{place.name.rpartition('-')[0]}-*.json"):
            old.unlink()
        place.write_text(json.dumps(entry), encoding="utf-8")
        print(f"{run.seconds:5.1f} s {name} {run.failed}", flush=True)


def known() -> list[Judge]:
    """The map: modules that were run under coverage."""
    return [Judge(**json.loads(path.read_text(encoding="utf-8"))) for path in sorted(MAP.glob("*.json"))]


def judges(file: str, line: int) -> list[str]:
    """Modules that run a line, the best first: little time, and much of it in that file. Modules that the map does not
    know yet are judges where they import the file, or lie in the folder of its package."""
    mapped = known()
    ran = [j for j in mapped if j.green and line in j.lines.get(file, ())]
    fit = ran or [j for j in mapped if j.green and j.lines.get(file)]  # what is done at import, and tables of C
    found = [j.module for j in sorted(fit, key=lambda j: max(j.seconds, 0.1) / j.share(file))]
    new = [path for path in modules() if not _place(path).exists()]
    head = {path: path.read_text(encoding="utf-8").partition("\ndef ")[0] for path in new}
    own = rf"^(?:from|import) .*\b{Path(file).stem}\b" if file.endswith(".py") else "^from (?:inner|kinds) import"
    word = re.compile(own, re.MULTILINE)
    new.sort(key=lambda p: (not word.search(head[p]), p.parent.name != file.split("/")[1]))
    unknown = [str(p.relative_to(ROOT)) for p in new if word.search(head[p]) or p.parent.name == file.split("/")[1]]
    first = MOST if ran else 0
    return [*found[:first], *unknown, *found[first:]]


def _place(path: Path) -> Path:
    digest = sha256(path.read_bytes()).hexdigest()[:12]
    return MAP / f"{'.'.join(path.relative_to(ROOT / 'tests').with_suffix('').parts)}-{digest}.json"
