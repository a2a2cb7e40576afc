"""What all tests share: results that are made once, a budget of processor time, and needs of a test that a machine may
lack, with one message for each."""

from __future__ import annotations

import gc
import importlib.util
import resource
import shutil
from pathlib import Path

import pytest
import reuse
from builds import double_library as double_build
from builds import inner_library as inner_build
from hypothesis import settings

REMEDY = {
    "chromium": "apt-get install chromium",
    "wine": "apt-get install wine wine64",
    "gcc": "apt-get install gcc",
    "clang": "apt-get install clang",
    "ccx": "apt-get install calculix-ccx",
}


PARTS = {  # of the full tests: 1 has every scene of the hard cases, what nobody names is of the last
    1: ("stability",),
    2: ("relations/test_a", "relations/test_b", "relations/test_c"),
    3: ("relations/",),
    4: ("stage",),
    5: ("kernel", "fmu", "cosim", "planning"),
    6: ("",),
}
BUDGET = 20.0  # core-minutes of the tests that are not full; the aim is 12
SPENT = pytest.StashKey[list[float]]()

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
reuse.share()  # before the modules of tests import what is replaced


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "needs(*names): programs or Python packages this test cannot do without")
    config.stash[SPENT] = []


# ---- parts of the full tests -----------------------------------------------------------------------------------------
def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part", type=int, choices=PARTS, help="only the tests of one part of six")


def part_of(path: Path) -> int:
    """The part of a file of tests."""
    name = path.relative_to(Path(__file__).parent).as_posix()
    return next(part for part, heads in PARTS.items() if name.startswith(heads))


def pytest_collection_finish() -> None:
    """What collecting made stays: the collector of garbage need not go through it again and again."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    wanted = config.option.part
    if wanted:
        config.hook.pytest_deselected(items=[item for item in items if part_of(item.path) != wanted])
        items[:] = [item for item in items if part_of(item.path) == wanted]


# ---- budget: core-minutes of this process or its workers, with all that they started ---------------------------------
def core_minutes() -> float:
    """Processor time of this process and of its children that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used) / 60


def is_worker(config: pytest.Config) -> bool:
    return hasattr(config, "workerinput")


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    """A worker has ended."""
    node.config.stash[SPENT].append(getattr(node, "workeroutput", {}).get("core_minutes", 0.0))


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """The session fails where the whole of the fast tests takes more than the budget."""
    config = session.config
    if is_worker(config):
        config.workeroutput["core_minutes"] = core_minutes()  # type: ignore[attr-defined]
        return
    if not config.stash[SPENT]:  # no workers: all was done here
        config.stash[SPENT].append(core_minutes())
    if over_budget(config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def over_budget(config: pytest.Config) -> bool:
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS and config.option.markexpr == "not full"
    return whole and not config.option.keyword and sum(config.stash[SPENT]) > BUDGET


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    spent, of = sum(config.stash[SPENT]), f" of {BUDGET:g}" if config.option.markexpr == "not full" else ""
    over = over_budget(config)
    terminalreporter.write_line(f"{spent:.1f}{of} core-minutes{': over budget' * over}", red=over, bold=True)


# ---- needs -----------------------------------------------------------------------------------------------------------


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test marked `needs("chromium")` or `needs("libcosimpy")` where that is missing, naming the remedy."""
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            if name in REMEDY and shutil.which(name) is None:
                pytest.skip(f"needs the program {name}: {REMEDY[name]}")
            if name not in REMEDY and importlib.util.find_spec(name) is None:
                pytest.skip(f"needs the Python package {name}: pip install {name}")


@pytest.fixture(scope="session")
def double_library() -> Path:
    """The kernel with modal states and rows in double, for comparison to the last digits."""
    return double_build()


@pytest.fixture(scope="session")
def inner_library() -> Path:
    """Kernel and inner_probe.c in one library."""
    return inner_build()
