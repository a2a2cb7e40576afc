"""All that can be found wrong with an FMU: what fmpy checks, and what only shows when it is opened and called."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from lxml import etree

from gearfmu.errors import FmuError, Problem
from gearfmu.fmu.probes import CHECKS
from gearfmu.fmu.symbols import exported_symbols
from gearfmu.kernel.build import SUFFIX, fmi_headers, host_platform

TIMEOUT = 300  # s without an answer: of a single check, as big stages take long to initialise
EXPORT_AGAIN = "export the FMU again"
TERMINALS_SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


def validate(path: str | Path) -> list[Problem]:
    """All problems of the FMU at `path`; an empty list when there are none.

    Checks the XML against schema and rules (fmpy), units, start values, terminals, stage, exported symbols and, when
    there is a binary for this machine, its answers to right and wrong calls in a process of its own.
    Raises FmuError when the file cannot be read as an FMU at all."""
    file = Path(path)
    with tempfile.TemporaryDirectory(prefix="gearfmu-validate-") as work:
        folder = _unpack(file, Path(work) / "fmu")
        found = [("modelDescription.xml", text, EXPORT_AGAIN) for text in validate_fmu(str(file))]
        try:
            description = fmpy.read_model_description(str(folder), validate=False)
        except Exception as error:  # fmpy stumbles over what its own validation has found
            found = found or [("modelDescription.xml", str(error), EXPORT_AGAIN)]
        else:
            found += _contents(folder, description)
        return [Problem(str(file), field, value, remedy) for field, value, remedy in found]


def _unpack(file: Path, folder: Path) -> Path:
    try:
        fmpy.extract(str(file), str(folder))
    except Exception as error:  # zipfile raises many kinds on damaged archives
        raise FmuError(f"{file}: cannot be read as an FMU: {error}") from error
    if not (folder / "modelDescription.xml").is_file():
        raise FmuError(f"{file}: cannot be read as an FMU: it holds no modelDescription.xml")
    return folder


def _contents(folder: Path, description: ModelDescription) -> list[tuple[str, str, str]]:
    if description.coSimulation is None or not description.fmiVersion.startswith("2."):
        return [("modelDescription.xml", f"FMI {description.fmiVersion}", "only FMI 2.0 co-simulation is looked at")]
    found = [finding for check in (_units, _terminals, _stage, _binaries) for finding in check(folder, description)]
    if (folder / "binaries" / host_platform()).is_dir():
        found += _answers(folder)
    return found


def _units(folder: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    with_base = {unit.name for unit in description.unitDefinitions if unit.baseUnit is not None}
    for variable in description.modelVariables:
        if variable.type == "Real" and variable.unit not in with_base:
            yield variable.name, f"unit {variable.unit}", "declare a unit with its SI base units in UnitDefinitions"


def _terminals(folder: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    """fmpy does not look at this file; its FMI 3.0 schema does."""
    file = folder / "terminalsAndIcons" / "terminalsAndIcons.xml"
    if not file.is_file():
        return
    schema = etree.XMLSchema(etree.parse(str(TERMINALS_SCHEMA)))
    try:
        tree = etree.parse(str(file))
    except etree.XMLSyntaxError as error:
        yield file.name, str(error), EXPORT_AGAIN
        return
    for found in () if schema.validate(tree) else schema.error_log:
        yield f"{file.name}:{found.line}", found.message, EXPORT_AGAIN
    known = {variable.name for variable in description.modelVariables}
    for member in tree.iter("TerminalMemberVariable"):
        if member.get("variableName") not in known:
            yield f"{file.name}: {member.get('variableName')}", "is no variable of the FMU", EXPORT_AGAIN


def _stage(folder: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    """An FMU of ours says which stage it is, and means the model beside it."""
    from gearfmu.fmu.stage_file import MODEL_FILE, STAGE_FILE, read_stage_file  # with all of stages and bodies

    if not (folder / MODEL_FILE).is_file():
        return
    if not (folder / STAGE_FILE).is_file():
        yield STAGE_FILE, "is missing", f"scenes refuse an FMU that does not name its stage: {EXPORT_AGAIN}"
        return
    try:
        named = read_stage_file((folder / STAGE_FILE).read_bytes(), "")["hashes"]["model"]
    except FmuError as error:
        yield "", "", str(error)
        return
    if named != description.guid:
        yield f"{STAGE_FILE}: hashes.model", named, f"the guid is {description.guid}: {EXPORT_AGAIN}"


def _binaries(folder: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    simulation = description.coSimulation
    places = [place for place in sorted((folder / "binaries").glob("*")) if place.name in SUFFIX]
    if not places:
        yield "binaries", "no binary for a platform known here", f"export for {', '.join(SUFFIX)}"
    for place in places:
        library = place / (simulation.modelIdentifier + SUFFIX[place.name])
        if not library.is_file():
            yield f"binaries/{place.name}", f"{library.name} is missing", "name the file by the modelIdentifier"
        elif place.name != "darwin64":
            yield from _symbols(library, exact=not simulation.needsExecutionTool)


def _symbols(library: Path, exact: bool) -> Iterator[tuple[str, str, str]]:
    """All co-simulation functions of FMI 2; a native FMU of ours exports nothing else but those of model exchange,
    which some loaders demand, and the gk_ functions."""
    exported, wanted = exported_symbols(library), fmi_functions()
    for name in sorted(wanted - exported):
        yield library.name, f"{name} is not exported", "importers look up every function of FMI 2"
    ours = any(name.startswith("gk_") for name in exported)
    beyond = exported - wanted - exchange_functions() if exact and ours else set()
    for name in sorted(n for n in beyond if not n.startswith("gk_")):
        yield library.name, f"{name} is exported", "hide it: another FMU in the process could take it for its own"


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


def _answers(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Findings of the probes; after a crash the remaining ones go on in a new process."""
    left = list(CHECKS)
    while left:
        text, ending = _probe(folder, left)
        begun = None
        for line in text.splitlines():
            try:
                report = json.loads(line)
            except ValueError:
                continue  # something the FMU printed itself
            if not isinstance(report, dict):
                continue
            begun = report.get("begin", begun)
            if report.get("end") in left:
                left.remove(report["end"])
                yield from (tuple(finding) for finding in report["found"])
        if begun is None:
            raise FmuError(f"the probes could not be started: {ending}")
        if begun in left:
            left.remove(begun)
            yield begun, ending, f"it brings its process down: `python -m gearfmu.fmu FOLDER {begun}` shows it"


def _probe(folder: Path, checks: list[str]) -> tuple[str, str]:
    """Output of a probe process and how it ended; it is stopped when a check does not answer within TIMEOUT."""
    command, output = [sys.executable, "-m", "gearfmu.fmu", str(folder), *checks], ""
    with tempfile.TemporaryFile("w+", errors="replace") as said:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said, text=True, errors="replace")
        lines: queue.Queue[str | None] = queue.Queue()
        reader = threading.Thread(target=_read, args=(process.stdout, lines), daemon=True)
        reader.start()
        try:
            while (line := lines.get(timeout=TIMEOUT)) is not None:
                output += line
            code, late = process.wait(), False
        except queue.Empty:
            process.kill()
            code, late = process.wait(), True
        reader.join(1.0)
        said.seek(0)
        return (
            output,
            f"no answer within {TIMEOUT} s" if late else f"ended with code {code} {said.read().strip()[-300:]}",
        )


def _read(stream: Any, lines: queue.Queue[str | None]) -> None:
    """Lines of a process as they come, None at the end."""
    for line in stream:
        lines.put(line)
    stream.close()
    lines.put(None)
