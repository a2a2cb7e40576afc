"""Documentation inside the FMU: one page with all variables, and the licences of what the FMU contains."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib import metadata

from gearfmu.errors import FmuError
from gearfmu.fmu.description import Identity
from gearfmu.kernel import Variable

FMI_NOTICE = """
The interface declarations of the FMI 2.0 headers were compiled into the binary:
Copyright (C) 2008-2011 MODELISAR consortium, 2012-2019 Modelica Association Project "FMI". All rights reserved.
2-Clause BSD License: redistribution and use in source and binary forms, with or without modification, are permitted
provided that (1) redistributions of source code retain the above copyright notice, these conditions and the following
disclaimer, (2) redistributions in binary form reproduce them in the documentation and/or other materials provided.
THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS" AND ANY EXPRESS OR IMPLIED WARRANTIES ARE
DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDERS OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL,
SPECIAL, EXEMPLARY, OR CONSEQUENTIAL DAMAGES ARISING IN ANY WAY OUT OF THE USE OF THIS SOFTWARE.
"""

NOTES = """
<p>An elastic gear stage with its own solver (FMI 2.0 co-simulation). All angles and torques are about +z, so an
external pair counter-rotates. The torque <code>tau</code> of a spring or fixed port is exerted on the outside; that of
a torque port acts on the stage.</p>
<ul>
<li>Inputs <code>.phi</code>, <code>.w</code>, <code>.a</code> of a spring port are held and extrapolated within a step:
connect all three where the other side has them.</li>
<li>A refused call (wrong order, value out of range, negative step) returns fmi2Error and changes nothing.</li>
<li>A step that the solver gives up returns fmi2Discard; fmi2LastSuccessfulTime says how far it came.</li>
<li>The whole state can be saved, restored and serialised, bit for bit, also into a new process.</li>
</ul>
"""

STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}"
    "td,th{padding:.1em .8em;text-align:left}"
)


def page(identity: Identity, variables: Sequence[Variable]) -> str:
    """documentation/index.html: conventions and one table of all variables; refers to nothing outside of itself."""
    head = ("name", "causality", "type", "unit", "start", "description")
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in _row(v)) + "</tr>\n" for v in variables)
    title = escape(identity.name)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n<p>{escape(identity.description)}</p>{NOTES}"
        f"<table><tr>{''.join(f'<th>{name}</th>' for name in head)}</tr>\n{rows}</table>\n"
        f"<p>Model {identity.guid}, gearfmu {escape(identity.version)}.</p></body></html>\n"
    )


def licences(native: bool) -> dict[str, str]:
    """Licence files by name: ours, and pythonfmu's where its binary is part of the FMU.

    Raises FmuError when an installation has lost its licence file."""
    texts = {"license.txt": _licence_of("gearfmu") + FMI_NOTICE}
    return texts if native else {**texts, "pythonfmu.txt": _licence_of("pythonfmu")}


def _row(variable: Variable) -> tuple[str, ...]:
    start = "" if variable.causality == "output" else f"{variable.start:g}"
    if variable.type == "Enumeration":
        start = variable.items[int(variable.start)]
    kind = " | ".join(variable.items) if variable.type == "Enumeration" else variable.type
    return variable.name, variable.causality, kind, variable.unit, start, variable.description


def _licence_of(package: str) -> str:
    distributions = metadata.distributions(name=package)  # a checkout's egg-info may stand before the installation
    files = [file for distribution in distributions for file in distribution.files or []]
    found = next((f for f in files if f.name.upper().startswith("LICENSE") and ".dist-info" in str(f)), None)
    if found is None:
        raise FmuError(f"the installation of {package} has lost its licence, which an FMU must carry: reinstall it")
    return found.read_text(encoding="utf-8")
