"""The ledger of evidence: what every table, picture and generated page was made from, and which of them are stale.

    python evidence/ledger.py check              lists what is stale; exit code 1 if README.md shows any of it
    python evidence/ledger.py make [TARGET …]    makes stale targets, all or those named, one after the other
    python evidence/ledger.py make --again TARGET …    current ones too
    python evidence/ledger.py forget TARGET …    files made without a record are taken as they are, and are stale

ledger.json has one entry a target: `command`; `needs`, input → hash when the target was made, "" where unknown;
`makes`, file → hash; `made` (date), `minutes`, `ended` (last line that the command printed). Inputs: `kernel` (the
golden digests of the shipped build: a rewrite that leaves all bits ages nothing), `stage NAME` (the assembled model,
so stage file, bodies and assembly), `reduction` (the version of bodies), and files, by patterns. Comments and
docstrings of Python files do not count. `kernel` leaves out the golden runs with friction, `kernel friction`, and those
of stages whose slices have gaps of their own, as helical ones, `kernel slices`.
A command that fails leaves its target stale.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any

from gearfmu.body.layout import ALGORITHM_VERSION
from gearfmu.files import write_text
from gearfmu.kernel.build import BEHAVIOUR, library_path
from gearfmu.stage.build.blob import rounded_hash

ROOT = Path(__file__).resolve().parents[1]
GOLDEN = "tests/reference/golden_runs.json"
KERNEL = ("kernel", "kernel friction", "kernel slices")
SLICES = ("helical", "deviating", "train")  # in the names of golden runs
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
Entry = dict[str, Any]


def short(content: bytes) -> str:
    """SHA-256, 12 hex digits."""
    return hashlib.sha256(content).hexdigest()[:12]


@cache
def stage_hash(name: str) -> str:
    """Hash of the assembled model of a shipped stage, the same on every machine."""
    from gearfmu.body import load_bodies
    from gearfmu.spec.stage import load_stage
    from gearfmu.stage import assemble

    spec = load_stage(name)
    return rounded_hash(assemble(spec, load_bodies(spec)).blob)


def content(path: Path) -> bytes:
    """Bytes of a file; of a Python file those that decide what it does."""
    if path.suffix != ".py":
        return path.read_bytes()
    code = re.sub(r'^\s*""".*?"""\n', "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    lines = [re.sub(r"(^|\s+)# .*", "", line) for line in code.splitlines()]
    return "\n".join(line for line in lines if line.strip()).encode()


def golden_runs(path: Path, need: str) -> bytes:
    """The golden digests of the shipped kernel's runs that one of KERNEL stands for."""
    runs = json.loads(path.read_bytes())["float"]

    def of(name: str) -> str:
        if any(word in name for word in SLICES):
            return KERNEL[2]
        return KERNEL["friction" in name]

    chosen = {name: bits for name, bits in runs.items() if of(name) == need}
    return json.dumps(chosen, sort_keys=True).encode()


@dataclass(frozen=True)
class Ledger:
    """The entries of `file` about the files below `root`."""

    root: Path = ROOT
    file: Path = Path(__file__).with_suffix(".json")

    def read(self) -> dict[str, Entry]:
        """Target → entry, in the order of making."""
        return dict(json.loads(self.file.read_text(encoding="utf-8")))

    def digest(self, need: str) -> str:
        """The present hash of an input, "missing" where no file fits."""
        if need.startswith("stage "):
            return stage_hash(need.removeprefix("stage "))
        if need == "reduction":
            return f"version {ALGORITHM_VERSION}"
        if need in KERNEL:
            return short(golden_runs(self.root / GOLDEN, need))
        paths = sorted(self.root.glob(need))
        return short(b"\0".join(content(path) for path in paths)) if paths else "missing"

    def inputs(self, name: str) -> str:
        """Hash of all present inputs of a target: what its command need not make again has the same one."""
        return short(" ".join(map(self.digest, self.read()[name]["needs"])).encode())

    def stale(self) -> dict[str, list[str]]:
        """Stale targets → what is wrong with each. What is made from a stale file is stale."""
        found: dict[str, list[str]] = {}
        old: list[str] = []
        for name, entry in self.read().items():
            known = [need for need, digest in entry["needs"].items() if digest]
            wrong = [f"{need} moved" for need in known if self.digest(need) != entry["needs"][need]]
            if len(known) < len(entry["needs"]):
                wrong.append(entry["ended"] if entry["ended"].startswith("exit") else "made from what is not known")
            wrong += [f"{file} is not what was recorded" for file in self.touched(entry)]
            wrong += [f"{file} is stale" for file in old if any(fnmatch(file, need) for need in entry["needs"])]
            if wrong:
                found[name] = wrong
                old += entry["makes"]
        return found

    def touched(self, entry: Entry) -> list[str]:
        """Files of the entry that were written, or removed, without a record."""
        return [file for file, digest in entry["makes"].items() if self.digest(file) != digest]

    def shown(self, page: str = "README.md") -> set[str]:
        """Targets that make the pictures of the page, and what those are made from."""
        entries = self.read()
        files = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", (self.root / page).read_text(encoding="utf-8"))
        found: set[str] = set()
        for name, entry in reversed(entries.items()):
            if any(fnmatch(file, pattern) for file in entry["makes"] for pattern in files):
                found.add(name)
                files += entry["needs"]
        return found

    def golden(self) -> bool:
        """Whether the kernel's runs are the golden ones."""
        command = [sys.executable, "tests/kernel/golden.py", "--library", f"{library_path()}"]
        return subprocess.run(command, cwd=self.root).returncode == 0

    def make(self, name: str) -> bool:
        """Run the command of a target and record it; whether it ended well. Inputs are those from before the run."""
        entry, started = self.read()[name], time.monotonic()
        needs = {need: self.digest(need) for need in entry["needs"]}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        fixed = {"PATH": path, BEHAVIOUR: "+".join(map(self.digest, KERNEL))}
        code, last = run(entry["command"], self.root, ONE_THREAD | os.environ | fixed)
        ended = f"exit {code}: {last}" if code else last
        minutes = round((time.monotonic() - started) / 60, 1)
        self.record(name, {} if code else needs, made=f"{datetime.date.today()}", minutes=minutes, ended=ended)
        return not code

    def record(self, name: str, needs: Mapping[str, str], **more: Any) -> None:
        """Write the files of a target as they are, made from `needs`; those not given are unknown."""
        entries = self.read()  # again: others may have recorded theirs
        known = {need: needs.get(need, "") for need in entries[name]["needs"]}
        files = {file: self.digest(file) for file in entries[name]["makes"]}
        entries[name] |= {"needs": known, "makes": files, **more}
        write_text(self.file, json.dumps(entries, indent=1, ensure_ascii=False) + "\n")


def run(command: str, folder: Path, setting: Mapping[str, str]) -> tuple[int, str]:
    """Exit code of a command and the beginning of its last line; what it prints is shown as it comes."""
    last = ""
    with subprocess.Popen(command, shell=True, cwd=folder, env=setting, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            last = line.strip() or last
    return process.returncode, last[:100]


def cost(entries: Iterable[Entry]) -> str:
    """What the entries took last time."""
    minutes = [entry["minutes"] for entry in entries]
    unknown = sum(value is None for value in minutes)
    return f"{sum(value or 0 for value in minutes):.0f} min" + (f" and {unknown} of unknown cost" if unknown else "")


def check(ledger: Ledger, tell: Callable[[str], None] = print) -> int:
    """List what is stale; 1 where the README shows any of it."""
    entries, stale, shown = ledger.read(), ledger.stale(), ledger.shown()
    for name, wrong in stale.items():
        tell(f"stale: {name}{' (shown by README.md)' if name in shown else ''}: {'; '.join(wrong)}")
    of_those = cost(entries[name] for name in stale)
    tell(f"{len(stale)} of {len(entries)} stale, {of_those}" if stale else "all current")
    return int(bool(shown & set(stale)))


def make(ledger: Ledger, names: list[str], again: bool = False, tell: Callable[[str], None] = print) -> int:
    """Make the named targets, or all, where they are stale; the number of commands that failed."""
    entries, failed = ledger.read(), []
    unknown = [name for name in names if name not in entries]
    if unknown or (again and not names):
        sys.exit(f"no target {', '.join(unknown)}; there are {', '.join(entries)}" if unknown else "name the targets")
    stale = ledger.stale()
    due = [name for name in names or entries if again or name in stale]
    if any(need in entries[name]["needs"] for name in due for need in KERNEL) and not ledger.golden():
        sys.exit(f"the kernel's runs are not those of {GOLDEN}: what is made now would be of neither")
    tell(f"{len(due)} to make, last time {cost(entries[name] for name in due)}")
    for count, name in enumerate(due, 1):
        tell(f"== {count} of {len(due)}: {name} (last time {cost([entries[name]])}): {entries[name]['command']}")
        if not ledger.make(name):
            failed.append(name)
        tell(f"== {name}: {cost([ledger.read()[name]])}, {ledger.read()[name]['ended']}")
    if failed:
        tell(f"failed: {', '.join(failed)}")
    return len(failed)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("check", "make", "forget"))
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--again", action="store_true", help="current targets too")
    chosen, ledger = parser.parse_intermixed_args(), Ledger()
    if chosen.verb == "check":
        return check(ledger)
    if chosen.verb == "forget":
        for name in chosen.targets:
            ledger.record(name, {})
        return 0
    return min(make(ledger, chosen.targets, chosen.again), 99)


if __name__ == "__main__":
    sys.exit(main())
