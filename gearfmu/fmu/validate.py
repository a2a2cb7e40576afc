"""What can be found wrong with an FMU: what fmpy checks, files that do not fit each other, a first run that fails."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import fmpy
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu
from lxml import etree

from gearfmu.errors import FmuError, ModelError, Problem
from gearfmu.fmu.stage_file import MODEL_FILE, STAGE_FILE, read_stage_file
from gearfmu.kernel import Kernel
from gearfmu.kernel.build import SUFFIX, host_platform

TIMEOUT = 600  # s without an end of the first run: big stages take long to initialise
STEPS = 10
EXPORT_AGAIN = "export the FMU again"
TERMINALS_SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


def validate(path: str | Path) -> list[Problem]:
    """All problems of the FMU at `path`; an empty list when there are none.

    Checks the XML against schema and rules (fmpy), units, terminals, stage, names of the binaries and, when there is a
    binary for this machine, a run of ten steps in a process of its own.
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
            found += _contents(file, folder, description)
        return [Problem(str(file), field, value, remedy) for field, value, remedy in found]


def _unpack(file: Path, folder: Path) -> Path:
    try:
        fmpy.extract(str(file), str(folder))
    except Exception as error:  # zipfile raises many kinds on damaged archives
        raise FmuError(f"{file}: cannot be read as an FMU: {error}") from error
    if not (folder / "modelDescription.xml").is_file():
        raise FmuError(f"{file}: cannot be read as an FMU: it holds no modelDescription.xml")
    return folder


def _contents(file: Path, folder: Path, description: ModelDescription) -> list[tuple[str, str, str]]:
    if description.coSimulation is None or not description.fmiVersion.startswith("2."):
        return [("modelDescription.xml", f"FMI {description.fmiVersion}", "only FMI 2.0 co-simulation is looked at")]
    found = [finding for check in (_units, _terminals, _stage, _binaries) for finding in check(folder, description)]
    if (folder / "binaries" / host_platform()).is_dir():
        found += _first_run(file, description)
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
    if not (folder / MODEL_FILE).is_file():
        return
    if not (folder / STAGE_FILE).is_file():
        yield STAGE_FILE, "is missing", f"scenes refuse an FMU that does not name its stage: {EXPORT_AGAIN}"
        return
    try:
        named = read_stage_file((folder / STAGE_FILE).read_bytes(), "")["hashes"]["model"]
        kernel = Kernel((folder / MODEL_FILE).read_bytes())
    except FmuError as error:
        yield "", "", str(error)
        return
    except ModelError as error:
        yield MODEL_FILE, "", f"{error}: {EXPORT_AGAIN}"
        return
    if named != kernel.hash:
        yield f"{STAGE_FILE}: hashes.model", named, f"the model beside it is {kernel.hash}: {EXPORT_AGAIN}"
    if kernel.guid != description.guid:
        yield "modelDescription.xml: guid", description.guid, f"that of the model is {kernel.guid}: {EXPORT_AGAIN}"


def _binaries(folder: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    simulation = description.coSimulation
    places = [place for place in sorted((folder / "binaries").glob("*")) if place.name in SUFFIX]
    if not places:
        yield "binaries", "no binary for a platform known here", f"export for {', '.join(SUFFIX)}"
    for place in places:
        library = place / (simulation.modelIdentifier + SUFFIX[place.name])
        if not library.is_file():
            yield f"binaries/{place.name}", f"{library.name} is missing", "name the file by the modelIdentifier"


def _first_run(file: Path, description: ModelDescription) -> Iterator[tuple[str, str, str]]:
    """Ten steps with start values by fmpy; what brings the process down is a finding."""
    step = float(getattr(description.defaultExperiment, "stepSize", None) or 1e-4)
    end = "os._exit(0)" if description.coSimulation.needsExecutionTool else "pass"  # its interpreter is ended by nobody
    program = f"import os, sys, fmpy; fmpy.simulate_fmu(sys.argv[1], stop_time=float(sys.argv[2])); {end}"
    command = [sys.executable, "-c", program, str(file), repr(STEPS * step)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        yield "fmi2DoStep", f"no end within {TIMEOUT} s", "run it under a debugger"
        return
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip())[-300:]
        yield f"a run of {STEPS} steps", f"ended with code {done.returncode}: {last}", EXPORT_AGAIN
