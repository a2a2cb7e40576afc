"""terminalsAndIcons/terminalsAndIcons.xml (FMI 3.0, 2.4.9; in FMI 2.0 since 2.0.4): one terminal for each shaft.

The members carry the names of a rotational flange: `phi` and `tau` as in Modelica.Mechanics.Rotational.Interfaces, plus
the speed, the acceleration and the mean torque that a good coupling uses. Which are inputs follows from the port."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from gearfmu.kernel import Variable

MEMBERS = ("phi", "w", "a", "tau", "tau_mean")
KIND = "org.modelica.Modelica.Mechanics.Rotational.Interfaces.Flange_a"


def shafts(variables: Sequence[Variable]) -> dict[str, list[str]]:
    """Names of the variables of each shaft's terminal, e.g. {"pinion": ["pinion.phi", …]}, in the order of MEMBERS."""
    names = [v.name for v in variables if v.causality != "parameter"]
    heads = [name.split(".")[0] for name in names if name.count(".") == 1 and name.endswith(".tau")]
    return {head: [f"{head}.{m}" for m in MEMBERS if f"{head}.{m}" in names] for head in heads}


def terminals_and_icons(variables: Sequence[Variable]) -> bytes:
    """The XML document (UTF-8)."""
    root = ET.Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    terminals = ET.SubElement(root, "Terminals")
    for shaft, names in shafts(variables).items():
        terminal = ET.SubElement(
            terminals,
            "Terminal",
            {
                "name": shaft,
                "matchingRule": "bus",
                "terminalKind": KIND,
                "description": f"rotational flange of shaft {shaft}; all angles about +z",
            },
        )
        for name in names:
            ET.SubElement(
                terminal,
                "TerminalMemberVariable",
                {"variableName": name, "memberName": name.split(".")[1], "variableKind": "signal"},
            )
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
