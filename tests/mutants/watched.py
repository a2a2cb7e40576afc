"""A pytest plugin for runs that judge: keeps objects of the kernel between builds, limits processor time, and records
what failed or which lines ran. Settings are environment variables, since pytest starts in a process of its own."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from gearfmu.kernel import build

ROOT = Path(__file__).resolve().parents[2]
OBJECTS = "MUTANTS_OBJECTS"  # folder of compiled sources, kept between runs
RESULT = "MUTANTS_RESULT"  # JSON file: what failed, seconds, whether all ran, and lines where they are asked for
SECONDS = "MUTANTS_SECONDS"  # processor time after which no further test starts
LINES = "MUTANTS_LINES"  # "1": lines that ran are recorded
LONGEST = 40.0  # s of processor time of one test; a defect may never end
COVERAGE = ["--coverage"] if os.environ.get(LINES) else []
PRODUCT = ("cc", "-O1", build.PORTABLE, *COVERAGE, "-Wl,--no-as-needed", "-lm")


def objects(line: Sequence[str], own_flags: Sequence[str], files: Sequence[Path], folder: Path) -> list[Path]:
    """As `build._objects`, but a source that was compiled before with equal headers and flags is not compiled again."""
    headers = hashlib.sha256(b"".join(p.read_bytes() for p in build.sources() if p.suffix != ".c"))
    kept = []
    for target, command in build._compilations(line, own_flags, files, folder).items():
        source = Path(command[command.index("-c") + 1])
        key = headers.copy()
        key.update(" ".join(command[:-1]).encode() + source.read_bytes())
        path = Path(os.environ[OBJECTS]) / f"{target.stem}-{key.hexdigest()[:16]}.o"
        if not path.exists():
            build._run([*command[:-1], str(path)])
        kept.append(path)
    return kept


def build_product() -> None:
    """The kernel of this checkout at -O1, which has the bits of -O3 in a fraction of the time of the compiler."""
    name = build.host_platform()
    build._objects = objects
    build.build_library(out=build.HERE / "lib" / name / (build.STEM + build.SUFFIX[name]), compiler=PRODUCT)


def _compile(arguments: Sequence[str | Path], folder: Path | None = None) -> None:
    """As `builds._compile`, with kept objects."""
    words, folder = list(map(str, arguments)), Path(folder or ".")
    files = [Path(w) for w in words if w.endswith(".c")]
    rest = [w for w in words if not w.endswith(".c")]
    flags = [w for w in rest if w.startswith("-") and w not in ("-shared", "-c", "-o")]
    line = ["cc", *build.FLAGS, f"-I{build.HERE / 'src'}", *flags]
    made = objects(line, [f"-I{ROOT / 'tests' / 'kernel'}", *COVERAGE], files, folder)
    if "-c" in rest:
        for path in made:
            shutil.copy(path, folder / f"{path.stem.rpartition('-')[0]}.o")
    else:
        rest[rest.index("-o") + 1] = str(folder / rest[rest.index("-o") + 1])
        build._run(["cc", *rest, *COVERAGE, *map(str, made), "-lm"])


class Watch:
    """The plugin of one session."""

    def __init__(self) -> None:
        self.failed, self.at, self.cover = "", "", None
        self.limit, self.before = float(os.environ.get(SECONDS, "1e9")), 0.0
        if COVERAGE:
            import coverage

            self.cover = coverage.Coverage(data_file=None, include=[f"{ROOT}/gearfmu/*"], config_file=False)
            self.cover.start()

    def pytest_configure(self, config: pytest.Config) -> None:
        build._objects = objects
        if builds := sys.modules.get("builds"):
            builds._compile = _compile

    def pytest_collection_finish(self) -> None:
        if COVERAGE:
            self.before = used()  # imports tell nothing of a module

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        if used() - self.before > self.limit:
            item.session.shouldstop = "time"
            return True
        self.at = item.nodeid
        self.write()
        signal.setitimer(signal.ITIMER_PROF, LONGEST if not COVERAGE else 0.0)
        return None

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def pytest_unconfigure(self) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self.at = ""
        self.write()

    def write(self) -> None:
        result: dict[str, Any] = {
            "failed": self.failed,
            "at": self.at,
            "seconds": used() - self.before,
        }
        if self.cover and not self.at:
            self.cover.stop()
            data = self.cover.get_data()
            result["lines"] = {str(Path(f).relative_to(ROOT)): sorted(data.lines(f)) for f in data.measured_files()}
        Path(os.environ[RESULT]).write_text(json.dumps(result), encoding="utf-8")


def used() -> float:
    """Processor time of this process and its ended children, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def pytest_configure(config: pytest.Config) -> None:
    watch = Watch()
    config.pluginmanager.register(watch, "watch")
    watch.pytest_configure(config)
