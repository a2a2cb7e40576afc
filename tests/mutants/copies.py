"""Copies of the checkout in which defects are planted, and runs of tests in them."""

from __future__ import annotations

import ast
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from draw import Defect

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build" / "mutants"
LEFT_OUT = shutil.ignore_patterns("__pycache__", ".*_cache", ".hypothesis", ".git", ".venv", "lib")
PATIENCE = 7200.0  # s of the clock for one run of tests, on a machine with other work; processor time is limited too


@dataclass(frozen=True)
class Run:
    """Outcome of tests: the first that failed ("" for none), processor seconds, and lines that ran."""

    failed: str
    seconds: float
    lines: dict[str, list[int]] = field(default_factory=dict)


def nearest(lines: Sequence[str], defect: Defect) -> int:
    """Number of the line of that text which lies nearest to where it was; ValueError where there is none."""
    found = [n for n, line in enumerate(lines, start=1) if line.strip() == defect.before]
    if not found:
        raise ValueError(f"{defect.file}: {defect.before!r} stands there no more")
    return min(found, key=lambda n: abs(n - defect.line))


class Copy:
    """A copy of the checkout at a fixed place, so that objects of the kernel are found again."""

    def __init__(self, name: str) -> None:
        self.root = KEPT / name / "checkout"
        self.objects = KEPT / name / "objects"
        shutil.rmtree(self.root, ignore_errors=True)
        shutil.copytree(ROOT, self.root, ignore=_left_out)
        self.objects.mkdir(exist_ok=True)
        self.sound = b""

    def build(self, coverage: bool = False) -> str:
        """Builds the kernel; returns the compiler's last message, "" for none."""
        line = [sys.executable, "-c", "import watched; watched.build_product()"]
        done = subprocess.run(line, cwd=self.root, env=self._setting(coverage), capture_output=True, text=True)
        if not done.returncode and not self.sound:
            self.sound = self.library().read_bytes()
        return (done.stderr.strip() or "failed").splitlines()[-1] if done.returncode else ""

    def run(self, tests: Sequence[str], seconds: float, coverage: bool = False) -> Run:
        """Runs tests until one fails or `seconds` of processor time are over."""
        result = self.objects / "result.json"
        result.unlink(missing_ok=True)
        line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "watched", *tests]
        line += [] if coverage else ["-x"]
        setting = self._setting(coverage) | {"MUTANTS_RESULT": str(result), "MUTANTS_SECONDS": str(seconds)}
        text = ""
        with subprocess.Popen(
            line, cwd=self.root, env=setting, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
        ) as process:
            try:
                text = process.communicate(timeout=PATIENCE)[0].decode(errors="replace")
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
        found = json.loads(result.read_text(encoding="utf-8")) if result.exists() else {}
        failed = found.get("failed", "")
        if not failed and process.returncode not in (0, 1, 2, 5):  # ended by a signal, or no test began
            failed = found.get("at", "") or "import: " + (text.strip() or "nothing").splitlines()[-1][:100]
        return Run(failed, found.get("seconds", 0.0), found.get("lines", {}))

    @contextmanager
    def planted(self, defect: Defect) -> Iterator[bool]:
        """The copy with a defect; whether it compiles, to other code than without it."""
        path = self.root / defect.file
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines(keepends=True)
        number = nearest(lines, defect) - 1
        old = lines[number]
        lines[number] = old.replace(defect.before, defect.after)
        path.write_text("".join(lines), encoding="utf-8")
        try:
            yield self._changed(path, text)
        finally:
            path.write_text(text, encoding="utf-8")
            if path.suffix != ".py":
                self.build()  # else the library does not belong to the sources

    def _changed(self, path: Path, before: str) -> bool:
        if path.suffix == ".py":
            try:
                trees = [ast.dump(ast.parse(text)) for text in (before, path.read_text(encoding="utf-8"))]
            except SyntaxError:
                return False
            return trees[0] != trees[1]
        return not self.build() and self.library().read_bytes() != self.sound

    def library(self) -> Path:
        return next((self.root / "gearfmu" / "kernel" / "lib").rglob("gearfmu_kernel.so"))

    def lines(self, modules: Sequence[str], seconds: float) -> Iterator[tuple[str, Run]]:
        """Runs each test module in a process of its own, and tells which lines it ran."""
        for name in modules:
            for old in self.objects.glob("*.gcda"):
                old.unlink()
            run = self.run([name], seconds, coverage=True)
            yield name, replace(run, lines=run.lines | self._lines_of_c())

    def _lines_of_c(self) -> dict[str, list[int]]:
        """Lines of C sources that ran under coverage since the counts were last removed, by file."""
        counts = sorted(map(str, self.objects.glob("*.gcda")))
        if not counts:
            return {}
        line = ["gcov", "--json-format", "--stdout", *counts]
        printed = subprocess.run(line, capture_output=True, text=True, check=True, cwd=self.objects).stdout
        found: dict[str, set[int]] = {}
        for document in printed.splitlines():
            for file in json.loads(document)["files"]:
                path = Path(file["file"])
                if path.is_relative_to(self.root / "gearfmu"):
                    ran = (entry["line_number"] for entry in file["lines"] if entry["count"])
                    found.setdefault(str(path.relative_to(self.root)), set()).update(ran)
        return {name: sorted(lines) for name, lines in found.items()}

    def _setting(self, coverage: bool) -> dict[str, str]:
        path = os.pathsep.join([str(self.root), str(self.root / "tests" / "mutants"), os.environ.get("PYTHONPATH", "")])
        own = {"PYTHONPATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        own |= {"MUTANTS_OBJECTS": str(self.objects), "GEARFMU_CACHE": str(self.objects / "plans")}
        return {**os.environ, **own, **({"MUTANTS_LINES": "1"} if coverage else {})}


def _left_out(folder: str, names: list[str]) -> set[str]:
    """Caches, and of the checkout itself what builds and runs leave there."""
    made = {"build", "out"} if Path(folder) == ROOT else set()
    return LEFT_OUT(folder, names) | made & set(names)
