"""Symbols and probes of one FMU, after `gearfmu validate`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import fmpy

from evidence.fmu_probes.probes import CHECKS
from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.fmu import validate
from gearfmu.kernel.build import SUFFIX, fmi_headers, host_platform


def findings(path: str | Path, checks: tuple[str, ...] = tuple(CHECKS)) -> list[str]:
    """What `validate` finds; unless its run has failed, what exported symbols and the named probes show too."""
    problems = validate(path)
    found = [str(problem) for problem in problems]
    if any(problem.field.startswith("a run of") for problem in problems):
        return found
    with tempfile.TemporaryDirectory(prefix="gearfmu-probes-") as folder:
        fmpy.extract(str(path), folder)
        native = not fmpy.read_model_description(folder).coSimulation.needsExecutionTool
        for library in sorted(Path(folder, "binaries").glob("*/*")):
            if library.suffix in SUFFIX.values() and library.parent.name != "darwin64":
                found += symbol_findings(library, native)
        if Path(folder, "binaries", host_platform()).is_dir():
            found += [f"{name}: {': '.join(finding)}" for name in checks for finding in CHECKS[name](folder)]
    return found


def symbol_findings(library: Path, exact: bool) -> Iterator[str]:
    """All co-simulation functions of FMI 2; a native FMU of ours exports nothing else but those of model exchange,
    which some loaders demand, and the gk_ functions."""
    exported, wanted = exported_symbols(library), fmi_functions()
    for name in sorted(wanted - exported):
        yield f"{library.name}: {name} is not exported: importers look up every function of FMI 2"
    ours = any(name.startswith("gk_") for name in exported)
    beyond = exported - wanted - exchange_functions() if exact and ours else set()
    for name in sorted(n for n in beyond if not n.startswith("gk_")):
        yield f"{library.name}: {name} is exported: another FMU in the process could take it for its own"


def fmi_functions() -> set[str]:
    """Names of the functions that a co-simulation FMU exports, from the FMI 2 header."""
    common, _, simulation = _declared()
    return common | simulation


def exchange_functions() -> set[str]:
    """Names of the functions that a model exchange FMU exports besides the common ones."""
    return _declared()[1]


@cache
def _declared() -> tuple[set[str], ...]:
    """Functions of the FMI 2 header: common, of model exchange, of co-simulation."""
    text = (fmi_headers() / "fmi2Functions.h").read_text(encoding="utf-8", errors="replace")
    heads = ("Common Functions", "Functions for FMI2 for Model Exchange", "Functions for FMI2 for Co-Simulation")
    places = [*(text.rindex(head) for head in heads), len(text)]
    parts = (text[start:end] for start, end in zip(places, places[1:], strict=False))
    return tuple(
        {line.split()[2].rstrip(";") for line in part.splitlines() if line.strip().startswith("FMI2_Export")}
        for part in parts
    )
