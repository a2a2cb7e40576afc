"""modelDescription.xml of FMI 2.0, generated from the kernel's own table of variables, and terminalsAndIcons.xml
(FMI 3.0, 2.4.9; in FMI 2.0 since 2.0.4): one terminal for each shaft.

The kernel's table has one description for all instances of a variable; here each names its own. Members of a terminal
carry the names of a rotational flange: `phi` and `tau` as in Modelica.Mechanics.Rotational.Interfaces, plus speed,
acceleration and mean torque for accurate couplings. Which of them are inputs follows from the kind of port."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from xml.etree import ElementTree as ET

from gearfmu.fmu.units import DISPLAY, base_exponents, unit_of
from gearfmu.kernel import Variable
from gearfmu.kernel.instance import INSTANCES
from gearfmu.stagefile.forms.general import Stage

OF_SUPPORT, OF_MODE = (13, 14, 15), 2**24  # numbers of the table; where references of amplitudes begin
AXES = {"x": "along x", "y": "along y", "z": "along z", "rx": "about x", "ry": "about y", "rz": "about z"}
LOADS = {f"{kind}{axis}": AXES[f"{tilt}{axis}"] for kind, tilt in (("f", ""), ("m", "r")) for axis in "xyz"}
MEMBERS = ("phi", "w", "a", "tau", "tau_mean")
KIND = "org.modelica.Modelica.Mechanics.Rotational.Interfaces.Flange_a"

DEFAULT_STEP = 1e-4
DEFAULT_STOP = 0.1
LOG_CATEGORIES = {
    "logEvents": "life of the instance: made, initialised",
    "logStatusWarning": "the solver works outside of its usual range, e.g. a fallback scheme in use",
    "logStatusDiscard": "a step that stopped early: last good time and reason",
    "logStatusError": "refused calls: what, where, why",
    "logAll": "all of these",
}


@dataclass(frozen=True)
class Identity:
    """Entries of modelDescription.xml about the FMU as a whole.

    identifier: modelIdentifier, a C name; guid: of the model, checked by the binary; native: the binary needs
    nothing else on the importing machine (else Python with pythonfmu's binary); sources: C files below sources/;
    rights: author, copyright and license of the model, which are its maker's; nominals: size of outputs by unit."""

    name: str
    identifier: str
    guid: str
    version: str
    description: str = ""
    native: bool = True
    sources: tuple[str, ...] = ()
    rights: Mapping[str, str] = field(default_factory=dict)
    nominals: Mapping[str, float] = field(default_factory=dict)


def element(tag: str, /, *children: ET.Element, **attributes: str) -> ET.Element:
    """An element of an XML document around others."""
    node = ET.Element(tag, attributes)
    node.extend(children)
    return node


def document(root: ET.Element) -> bytes:
    """The indented document (UTF-8)."""
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def model_description(identity: Identity, variables: Sequence[Variable]) -> bytes:
    """The XML document (UTF-8) for these variables, in their order; raises FmuError for a unit without definition."""
    sources = [element("SourceFiles", *(element("File", name=name) for name in identity.sources))]
    categories = (element("Category", name=name, description=text) for name, text in LOG_CATEGORIES.items())
    experiment = {"startTime": "0", "stopTime": repr(DEFAULT_STOP), "stepSize": repr(DEFAULT_STEP)}
    root = element(
        "fmiModelDescription",
        element("CoSimulation", *(sources if identity.sources else []), **_capabilities(identity)),
        element("UnitDefinitions", *map(_unit, sorted({unit for v in variables if (unit := unit_of(v))}))),
        *_type_definitions(variables),
        element("LogCategories", *categories),
        element("DefaultExperiment", **experiment),
        element("ModelVariables", *(_variable(variable, identity.nominals) for variable in variables)),
        _structure(variables),
        fmiVersion="2.0",
        modelName=identity.name,
        guid=identity.guid,
        description=identity.description,
        version=identity.version,
        **identity.rights,
        generationTool=f"gearfmu {identity.version}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    return document(root)


def enumeration_type(variable: Variable) -> str:
    """Name of the type definition of an enumeration variable."""
    return variable.name.replace(".", "_") + "_type"


def _capabilities(identity: Identity) -> dict[str, str]:
    """No more than implemented: input interpolation, output derivatives and directional derivatives are not offered."""
    able = {
        "canHandleVariableCommunicationStepSize": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "needsExecutionTool": not identity.native,
        "canNotUseMemoryManagementFunctions": not identity.native,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canInterpolateInputs": False,
        "canRunAsynchronuously": False,
        "providesDirectionalDerivative": False,
    }
    return {
        "modelIdentifier": identity.identifier,
        **{name: str(value).lower() for name, value in able.items()},
        "maxOutputDerivativeOrder": "0",
    }


def _unit(unit: str) -> ET.Element:
    base = {base: str(power) for base, power in base_exponents(unit).items()}
    shown = (element("DisplayUnit", name=name, factor=repr(factor)) for name, factor in DISPLAY.get(unit, ()))
    return element("Unit", element("BaseUnit", **base), *shown, name=unit)


def _type_definitions(variables: Sequence[Variable]) -> list[ET.Element]:
    """One element with the enumerations; none without any."""
    found = []
    for variable in (v for v in variables if v.type == "Enumeration"):
        items = (element("Item", name=item, value=str(value)) for value, item in enumerate(variable.items))
        found.append(element("SimpleType", element("Enumeration", *items), name=enumeration_type(variable)))
    return [element("TypeDefinitions", *found)] if found else []


def _variable(variable: Variable, nominals: Mapping[str, float]) -> ET.Element:
    output, changes = variable.causality == "output", "continuous" if variable.type == "Real" else "discrete"
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": "fixed" if variable.causality == "parameter" else changes,
    }
    if variable.causality != "input":
        attributes["initial"] = "calculated" if output else "exact"
    detail = {"declaredType": enumeration_type(variable)} if variable.type == "Enumeration" else {}
    if unit := unit_of(variable):
        detail["unit"] = unit
        if unit in DISPLAY:
            detail["displayUnit"] = DISPLAY[unit][0][0]
        if output and unit in nominals:
            detail["nominal"] = repr(nominals[unit])
    if not output and variable.type != "Boolean":
        detail.update(min=value_text(variable, variable.minimum), max=value_text(variable, variable.maximum))
    if not output:
        detail["start"] = value_text(variable, variable.start)
    return element("ScalarVariable", element(variable.type, **detail), **attributes)


def value_text(variable: Variable, value: float) -> str:
    """A value of this variable as XML writes it: the shortest text that gives the same double, or a whole number."""
    if variable.type == "Boolean":
        return "true" if value else "false"
    return repr(float(value)) if variable.type == "Real" else str(int(value))


def _structure(variables: Sequence[Variable]) -> ET.Element:
    """Outputs follow the inputs only through a step: no direct dependencies. Initial outputs depend on everything."""
    indices = [str(k) for k, v in enumerate(variables, start=1) if v.causality == "output"]
    outputs = (element("Unknown", index=index, dependencies="") for index in indices)
    initial = (element("Unknown", index=index) for index in indices)
    return element("ModelStructure", element("Outputs", *outputs), element("InitialUnknowns", *initial))


def named(variables: Sequence[Variable], stage: Stage) -> list[Variable]:
    """The variables with descriptions that differ: "mesh of planet 3 with the ring: tooth pairs in contact"."""
    subjects = {mesh.name: mesh_name(*mesh.gears) for mesh in stage.engagements}
    subjects |= {f"{name}.gear": f"rotor {spoken(name)}" for name in stage.rotors}
    subjects |= {name: f"shaft {spoken(name)}" for name in stage.ports}
    return [replace(v, description=f"{subject}: {v.description}" if (subject := _subject(v, subjects)) else
                    v.description) for v in variables]  # fmt: skip


def spoken(name: str) -> str:
    """planet3 → planet 3, input_shaft → input shaft."""
    return re.sub(r"(?<=[A-Za-z])(?=\d)", " ", name).replace("_", " ")


def mesh_name(first: str, second: str) -> str:
    """The gear that there are several of comes first: "mesh of planet 3 with the ring"."""
    one, other = sorted((first, second), key=lambda name: not name[-1:].isdigit())
    return f"mesh of {spoken(one)} with {'' if other[-1:].isdigit() else 'the '}{spoken(other)}"


def _subject(variable: Variable, subjects: dict[str, str]) -> str:
    """Shaft, rotor, mesh, support or mode that a variable belongs to; "" for those of the whole stage."""
    place, _, last = variable.name.rpartition(".")
    if variable.reference >= OF_MODE:
        gear, _, motion = place.partition(".")
        return f"gear {spoken(gear)}, {f'rigid {AXES[last]}' if motion else spoken(last)}"
    if variable.reference // INSTANCES in OF_SUPPORT:
        return f"{spoken(place.replace('.', ' '))}, {(AXES | LOADS)[last.removesuffix('_mean')]}"
    while place and place not in subjects:
        place = place.rpartition(".")[0]
    return subjects.get(place, "")


def shafts(variables: Sequence[Variable]) -> dict[str, list[str]]:
    """Names of the variables of each shaft's terminal, e.g. {"pinion": ["pinion.phi", …]}, in the order of MEMBERS."""
    names = [v.name for v in variables if v.causality != "parameter"]
    heads = [name.split(".")[0] for name in names if name.count(".") == 1 and name.endswith(".tau")]
    return {head: [f"{head}.{m}" for m in MEMBERS if f"{head}.{m}" in names] for head in heads}


def terminals_and_icons(variables: Sequence[Variable]) -> bytes:
    """The XML document (UTF-8)."""
    terminals = []
    for shaft, names in shafts(variables).items():
        flange = f"rotational flange of shaft {shaft}; all angles about +z"
        about = {"name": shaft, "matchingRule": "bus", "terminalKind": KIND, "description": flange}
        members = ({"variableName": n, "memberName": n.split(".")[1], "variableKind": "signal"} for n in names)
        terminals.append(element("Terminal", *(element("TerminalMemberVariable", **own) for own in members), **about))
    return document(element("fmiTerminalsAndIcons", element("Terminals", *terminals), fmiVersion="3.0"))
