"""The ledger of evidence: what every table, picture and generated page was made from, and which of them are stale.

    python -m evidence.ledger check                    lists what is stale; exit code 1 if any of it is of tier 1
    python -m evidence.ledger make [--tier 2]          makes what is stale of tier 1, or of tiers 1 and 2
    python -m evidence.ledger make [--again] TARGET …  makes those; --again: current ones too, stored rows forgotten
    python -m evidence.ledger make --again --tier 1    makes all of a tier from nothing
    python -m evidence.ledger forget TARGET …          files made without a record are taken as they are, and are stale
    python -m evidence.ledger carry TARGET --reason "…" [--made ROWS.csv] [--but COLUMN …]
                                                       keeps a table whose inputs moved without moving it: names three
                                                       rows, drawn by chance; with those rows made again, compares them
    python -m evidence.ledger pages                    writes date and commit of tables into the pages that show them

ledger.json has one entry a target: `tier` (1: README and study, always current; 2: validation, made for a release);
`command`; `alone`, where nothing else may run beside it (prices, own processes); `rows`, the target under whose key its
rows are stored; `needs`, input → hash when the target was made, "" where unknown (sources.py says what an input is);
`makes`, file → hash; `made` (date), `commit`, `minutes`, `ended` (last line that the command printed), `key` (of stored
rows), `carried` (reason, date, rows made again). A target is stale while its command runs, and when it fails.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from evidence.pages_made import write_pages
from evidence.rows_again import agree, drawn
from evidence.sources import Sources, short
from gearfmu.files import write_text
from gearfmu.kernel.build import BEHAVIOUR, library_path

ROOT = Path(__file__).resolve().parents[1]
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
SIDE_BY_SIDE = 2  # commands at a time
Entry = dict[str, Any]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Ledger:
    """The entries of `file` about the files below `root`."""

    root: Path = ROOT
    file: Path = Path(__file__).with_suffix(".json")
    edits: Mapping[str, bytes] = field(default_factory=dict)  # trial: file → other content
    lock: threading.Lock = field(default_factory=threading.Lock)

    def read(self) -> dict[str, Entry]:
        """Target → entry, in the order of making."""
        return dict(json.loads(self.file.read_text(encoding="utf-8")))

    def sources(self) -> Sources:
        """The inputs as they are now."""
        return Sources(self.root, self.edits)

    def inputs(self, name: str) -> dict[str, str]:
        """Present hashes of the inputs of a target."""
        entry, sources = self.read()[name], self.sources()
        return {need: sources.digest(need, entry["command"]) for need in entry["needs"]}

    def stale(self) -> dict[str, list[str]]:
        """Stale targets → what is wrong with each. What is made from a stale file of its tier is stale."""
        found: dict[str, list[str]] = {}
        old: dict[str, int] = {}
        sources = self.sources()
        for name, entry in self.read().items():
            known = [need for need, digest in entry["needs"].items() if digest]
            moved = [need for need in known if sources.digest(need, entry["command"]) != entry["needs"][need]]
            wrong = [f"{need} moved" for need in moved]
            if len(known) < len(entry["needs"]):
                wrong.append(entry["ended"] if entry["ended"].startswith("exit") else "made from what is not known")
            wrong += [f"{file} is not what was recorded" for file in self.touched(entry, sources)]
            below = [file for file, tier in old.items() if tier <= entry["tier"]]
            wrong += [f"{file} is stale" for file in below if any(fnmatch(file, need) for need in entry["needs"])]
            if wrong:
                found[name] = wrong
                old |= dict.fromkeys(entry["makes"], entry["tier"])
        return found

    def touched(self, entry: Entry, sources: Sources | None = None) -> list[str]:
        """Files of the entry that were written, or removed, without a record."""
        sources = sources or self.sources()
        return [file for file, digest in entry["makes"].items() if sources.digest(file) != digest]

    def make(self, name: str, again: bool = False, tell: Tell = print) -> bool:
        """Run the command of a target and record it; whether it ended well. Inputs are those from before the run."""
        entries, started, needs = self.read(), time.monotonic(), self.inputs(name)
        entry = entries[name]
        home = entry.get("rows", name)
        own = short(f"{needs}{time.time() if again else ''}".encode())
        key = own if home == name else entries[home].get("key", own)
        self.record(name, {}, ended="exit: interrupted")
        code, last = run(entry["command"], self.root, os.environ | {BEHAVIOUR: key}, tell)
        ended, minutes = f"exit {code}: {last}" if code else last, round((time.monotonic() - started) / 60, 1)
        facts = {
            "made": f"{datetime.date.today()}",
            "commit": commit(self.root, entries),
            "minutes": minutes,
            "ended": ended,
        }
        self.record(name, {} if code else needs, **facts, key=key, carried=None)
        return not code

    def record(self, name: str, needs: Mapping[str, str], **more: Any) -> None:
        """Write the files of a target as they are, made from `needs`; those not given are unknown."""
        with self.lock:
            entries = self.read()  # again: others may have recorded theirs
            known = {need: needs.get(need, "") for need in entries[name]["needs"]}
            entry = entries[name] | more | {"needs": known}
            entries[name] = {key: value for key, value in entry.items() if value is not None or key == "minutes"}
            sources = self.sources()
            entries[name]["makes"] = {file: sources.digest(file) for file in entry["makes"]}
            write_pages(self.root, entries)
            write_text(self.file, json.dumps(entries, indent=1, ensure_ascii=False) + "\n")


def commit(root: Path, entries: Mapping[str, Entry]) -> str:
    """The commit of a checkout, with "+" where anything but evidence and pages differs from it; "" outside one."""
    if not (root / ".git").exists():
        return ""
    number, changed = (
        subprocess.run(["git", *words], cwd=root, capture_output=True, text=True).stdout.split()
        for words in (("rev-parse", "--short=12", "HEAD"), ("diff", "--name-only", "HEAD"))
    )
    made = {file for entry in entries.values() for file in entry["makes"]} | {"evidence/ledger.json"}
    return number[0] + "+" * any(file not in made and not file.endswith(".md") for file in changed)


def dated(root: Path, entries: Mapping[str, Entry]) -> dict[str, str]:
    """Date and commit of what is made now."""
    return {"made": f"{datetime.date.today()}", "commit": commit(root, entries)}


def run(command: str, folder: Path, setting: Mapping[str, str], tell: Tell = print) -> tuple[int, str]:
    """Exit code of a command and the beginning of its last line; what it prints is told as it comes."""
    last, paths = "", [str(folder), str(folder / "evidence"), setting.get("PYTHONPATH", "")]
    fixed = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{setting['PATH']}"}
    fixed |= {"PYTHONPATH": os.pathsep.join(path for path in paths if path), "PYTHONUNBUFFERED": "1"}
    environment = {**ONE_THREAD, **setting, **fixed}
    with subprocess.Popen(
        command, shell=True, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout or ():
            tell(line.rstrip("\n"))
            last = line.strip() or last
    return process.returncode, last[:100]


def cost(entries: Iterable[Entry]) -> str:
    """What the entries took last time."""
    minutes = [entry["minutes"] for entry in entries]
    unknown = sum(value is None for value in minutes)
    return f"{sum(value or 0 for value in minutes):.0f} min" + (f" and {unknown} of unknown cost" if unknown else "")


def check(ledger: Ledger, tell: Tell = print) -> int:
    """List what is stale; 1 where any of it is of tier 1."""
    entries, stale = ledger.read(), ledger.stale()
    for name, wrong in stale.items():
        tell(f"stale, tier {entries[name]['tier']}: {name}: {'; '.join(wrong)}")
    of_those = cost(entries[name] for name in stale)
    tell(f"{len(stale)} of {len(entries)} stale, {of_those}" if stale else "all current")
    return int(any(entries[name]["tier"] == 1 for name in stale))


def make(ledger: Ledger, names: list[str], tier: int = 1, again: bool = False, tell: Tell = print) -> int:
    """Make the named targets, or all up to a tier, where they are stale; the number of commands that failed. With
    `again` current ones too: without names, all of exactly this tier."""
    entries, started = ledger.read(), time.monotonic()
    unknown = [name for name in names if name not in entries]
    if unknown:
        sys.exit(f"no target {', '.join(unknown)}; there are {', '.join(entries)}")
    wanted = names or [name for name, e in entries.items() if (e["tier"] == tier if again else e["tier"] <= tier)]
    stale = {} if again else ledger.stale()
    due = [name for name in entries if name in wanted and (again or name in stale)]
    if any("kernel" in entries[name]["needs"] for name in due):
        library_path()  # of the sources of this moment, or an error that says how to build it
    tell(f"{len(due)} to make, last time {cost(entries[name] for name in due)}")
    failed = Crew(ledger, due, again, tell).work()
    spent = (time.monotonic() - started) / 60
    for each in sorted({entries[name]["tier"] for name in due}):
        tell(f"tier {each}: {cost(e for n, e in ledger.read().items() if n in due and e['tier'] == each)} of commands")
    tell(f"{len(due)} made in {spent:.1f} min" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return len(failed)


class Crew:
    """Makes targets, two at a time where neither is to run alone, each after those whose files it needs."""

    def __init__(self, ledger: Ledger, due: list[str], again: bool, tell: Tell) -> None:
        self.ledger, self.again, self.tell = ledger, again, tell
        self.entries, self.count = ledger.read(), len(due)
        self.left, self.running, self.failed = list(due), set[str](), list[str]()
        self.changed = threading.Condition()

    def work(self) -> list[str]:
        """Make all of them; those that failed."""
        threads = []
        with self.changed:
            while self.left or self.running:
                name = self.next()
                if name is None:
                    self.changed.wait()
                    continue
                self.left.remove(name)
                self.running.add(name)
                threads.append(threading.Thread(target=self.one, args=(name,)))
                threads[-1].start()
        for thread in threads:
            thread.join()
        return self.failed

    def next(self) -> str | None:
        """A target that may begin now."""
        busy = len(self.running) == SIDE_BY_SIDE or any(self.entries[name].get("alone") for name in self.running)
        open_files = {file for name in (*self.left, *self.running) for file in self.entries[name]["makes"]}
        for name in () if busy else self.left:
            entry = self.entries[name]
            waits = any(fnmatch(file, need) for file in open_files - set(entry["makes"]) for need in entry["needs"])
            home = entry.get("rows", name)
            waits |= home != name and home in (*self.left, *self.running)
            if not waits and not (entry.get("alone") and self.running):
                return name
        return None

    def one(self, name: str) -> None:
        """Make a target, say how it went and wake the others."""
        entry, began = self.entries[name], self.count - len(self.left)
        self.tell(f"== {began} of {self.count}: {name} (last time {cost([entry])}): {entry['command']}")
        good = False
        try:
            good = self.ledger.make(name, self.again, lambda line: self.tell(f"{name}: {line}"))
        finally:
            with self.changed:
                self.running.remove(name)
                self.failed += [] if good else [name]
                now = self.ledger.read()[name]
                self.tell(f"== {name}: {cost([now])}, {now['ended']}; {len(self.left)} left")
                self.changed.notify()


def carry(ledger: Ledger, name: str, reason: str, made: Path | None, but: list[str], tell: Tell = print) -> int:
    """Keep a table whose inputs moved: three rows, drawn by the hash of the inputs, made again in `made` and equal but
    for the columns `but`. Without `made`: name the rows. 1 where a row differs or is not there."""
    entry, needs = ledger.read()[name], ledger.inputs(name)
    table = next((ledger.root / file for file in entry["makes"] if file.endswith(".csv")), None)
    if table is None or ledger.touched(entry):
        sys.exit(f"{name} has no table as recorded: make it")
    rows = drawn(table, short(f"{needs}".encode()))
    for row in rows:
        tell(f"row: {row}")
    if made is None:
        return 0
    wrong = agree(rows, made, but)
    for text in wrong:
        tell(text)
    if not wrong:
        facts = {"reason": reason, **dated(ledger.root, ledger.read()), "rows": rows}
        ledger.record(name, needs, carried=facts)
    return int(bool(wrong))


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=("check", "make", "forget", "carry", "pages"))
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--tier", type=int, choices=(1, 2), default=1)
    parser.add_argument("--again", action="store_true", help="current targets too")
    parser.add_argument("--reason", help="why inputs moved without moving the table")
    parser.add_argument("--made", type=Path, help="CSV with the drawn rows, made again")
    parser.add_argument("--but", action="append", default=[], metavar="COLUMN", help="column of times")
    chosen, ledger = parser.parse_intermixed_args(), Ledger()
    if chosen.verb == "check":
        return check(ledger)
    if chosen.verb == "carry":
        if len(chosen.targets) != 1 or not chosen.reason:
            parser.error("carry takes one target and --reason")
        return carry(ledger, chosen.targets[0], chosen.reason, chosen.made, chosen.but)
    if chosen.verb == "forget":
        for name in chosen.targets:
            ledger.record(name, {})
        return 0
    if chosen.verb == "pages":
        return write_pages(ledger.root, ledger.read())
    return min(make(ledger, chosen.targets, chosen.tier, chosen.again), 99)


if __name__ == "__main__":
    sys.exit(main())
