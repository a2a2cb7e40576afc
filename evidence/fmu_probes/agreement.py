"""Does modelDescription.xml agree with the binary beside it? The binary's own table of variables is the truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fmpy import read_model_description
from fmpy.model_description import ScalarVariable

from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.fmu.description import value_text
from gearfmu.fmu.units import unit_of
from gearfmu.kernel import Kernel, Variable
from gearfmu.kernel.build import SUFFIX, host_platform


def compare(folder: Path) -> Iterator[tuple[str, str, str]]:
    """(field, value, what to do) for every difference; nothing for an FMU whose binary has no table of ours."""
    library = kernel_library(folder)
    blob = folder / "resources" / "model.gkb"
    if library is None or not blob.is_file():
        return
    kernel = Kernel(blob.read_bytes(), library=library)
    description = read_model_description(str(folder), validate=False)
    listed = {v.name: v for v in description.modelVariables}
    table = kernel.variables
    for name in sorted(table.keys() ^ listed.keys()):
        yield name, "only in " + ("the binary" if name in table else "modelDescription.xml"), "export again"
    for name in table.keys() & listed.keys():
        for field, ours, theirs in _fields(table[name], listed[name]):
            if ours != theirs:
                yield f"{name}: {field}", str(theirs), f"the binary says {ours}: export again"


def kernel_library(folder: Path) -> Path | None:
    """The host's kernel library inside an unpacked FMU: its binary, or with runtime python a file in resources."""
    suffix = SUFFIX[host_platform()]
    places = [folder / "binaries" / host_platform(), folder / "resources"]
    files = [file for place in places for file in sorted(place.glob(f"*{suffix}"))]
    return next((file for file in files if "gk_variable" in exported_symbols(file)), None)


def _fields(ours: Variable, theirs: ScalarVariable) -> Iterator[tuple[str, object, object]]:
    yield "valueReference", ours.reference, theirs.valueReference
    yield "type", ours.type, theirs.type
    yield "causality", ours.causality, theirs.causality
    yield "unit", unit_of(ours), theirs.unit
    if ours.causality != "output":
        yield "start", value_text(ours, ours.start), theirs.start
