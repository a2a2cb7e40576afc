"""An FMU file from a stage model: XML from the kernel's table, the model blob, a byte copy of the kernel library, and
the kernel's C sources for platforms without a binary.

FMI 2.0.4 has no build description; sources/buildDescription.xml has the form of FMI 3.0 (2.5.4), which newer importers
read. Flags are those of the shipped binaries: with them gcc, clang and zig give the same bits."""

from __future__ import annotations

import hashlib
import math
import re
import zipfile
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TypedDict

from typing_extensions import Unpack

from gearfmu.errors import FmuError
from gearfmu.files import written_whole
from gearfmu.fmu.description import Identity, document, element, model_description, named, terminals_and_icons
from gearfmu.fmu.documentation import licences, page
from gearfmu.fmu.stage_file import MODEL_FILE, STAGE_FILE, stage_file
from gearfmu.kernel import Kernel
from gearfmu.kernel.build import FLAGS, HERE, SUFFIX, BuildError, fmi_headers, host_platform, library_path, sources
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.forms.general import Stage

FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
SYSTEM_HEADERS = "errno float math stdarg stddef stdint stdio stdlib string".split()  # all that the sources include
# At the head of every file that is compiled: what no attribute exports stays inside, whatever flags an importer takes
HIDDEN = "".join(f"#include <{name}.h>\n" for name in SYSTEM_HEADERS) + (
    "#if defined(__GNUC__) && !defined(_WIN32)\n#pragma GCC visibility push(hidden)\n#endif\n#line 1\n"
)
COMPILER_OPTIONS = " ".join(flag for flag in FLAGS if not flag.startswith("-W"))

TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
RUNTIMES = ("native", "python")
LONGEST_NAME = 40


class Extras(TypedDict, total=False):
    """Optional contents of an FMU. terminals : terminalsAndIcons.xml, which FMI Library 3 refuses in FMI 2
    (docs/howto-fmu.md). sources : the C sources of the binary and a build description (native only). author,
    copyright, license : of the model, for its description; nothing is said there without them."""

    terminals: bool
    sources: bool
    author: str
    copyright: str
    license: str


RIGHTS = ("author", "copyright", "license")


def export(
    model: StageModel,
    path: str | Path,
    runtime: str = "native",
    platforms: Sequence[str] | None = None,
    **extras: Unpack[Extras],
) -> Path:
    """Write `model` as an FMI 2.0 co-simulation FMU and return its path.

    runtime: "native" (the kernel library is the FMU's binary; no Python on the importing machine) or "python"
    (pythonfmu's binary, for Python hosts; the same library works below). platforms: "host", "linux64", "win64",
    "darwin64"; all whose kernel is installed when None.
    The same model gives the same bytes; the file appears whole or not at all.
    Raises FmuError for unknown options and BuildError when a platform's library is missing or stale."""
    if runtime not in RUNTIMES:
        raise FmuError(f"runtime = {runtime!r}: use {' or '.join(RUNTIMES)}")
    libraries = _installed() if platforms is None else _asked(platforms)
    if extras.get("sources") and runtime != "native":
        raise FmuError("sources belong to the compiled FMU: export with runtime native")
    files = _native_files(model, libraries, extras) if runtime == "native" else _python_files(model, libraries, extras)
    if not extras.get("terminals"):
        del files[TERMINALS]
    return write_archive(path, files)


def _asked(platforms: Sequence[str]) -> dict[str, Path]:
    names = list(dict.fromkeys(host_platform() if p == "host" else p for p in platforms))
    if not names:
        raise FmuError('platforms is empty: name at least one, e.g. "host"')
    return {name: library_path("host" if name == host_platform() else name) for name in names}


def _installed() -> dict[str, Path]:
    """This machine's library, and those of other platforms that belong to the same sources."""
    found = _asked(["host"])
    for name in SUFFIX:
        try:
            found.setdefault(name, library_path(name))
        except BuildError:
            continue
    return found


def write_archive(path: str | Path, files: Mapping[str, bytes]) -> Path:
    """A zip file with these members in this order, without times or other traces of the machine; returns its path."""
    target = Path(path)
    with written_whole(target) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            member = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED
            member.create_system = 3
            member.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(member, content)
    return target


def content_identifier(name: str, contents: Sequence[bytes]) -> str:
    """modelIdentifier: the stage's name as a C name, and twelve hex digits over all that decides what the FMU does.

    Two FMUs with different contents never share a file or module name within one process."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)[:LONGEST_NAME] or "stage"
    return f"{'_' if plain[0].isdigit() else ''}{plain}_{digest.hexdigest()[:12]}"


def _native_files(model: StageModel, libraries: Mapping[str, Path], extras: Extras) -> dict[str, bytes]:
    binaries = {name: path.read_bytes() for name, path in libraries.items()}
    code = source_files() if extras.get("sources") else {}
    identifier = content_identifier(model.name, [model.blob, *binaries.values(), *code.values()])
    files = _common_files(model, identifier, extras, sources=tuple(name for name in code if name.endswith(".c")))
    files |= {f"sources/{name}": content for name, content in code.items()}
    if code:
        files["sources/buildDescription.xml"] = build_description(identifier, list(code))
    for name, content in binaries.items():
        files[f"binaries/{name}/{identifier}{libraries[name].suffix}"] = content
    return files


def _python_files(model: StageModel, libraries: Mapping[str, Path], extras: Extras) -> dict[str, bytes]:
    """pythonfmu's binary loads resources/<slavemodule>.py; the module's name carries the content hash, else two FMUs in
    one process would share the first one's module. pythonfmu is found by its metadata: where an FMU of it has run, the
    import system knows only the copy inside that FMU."""
    try:
        frame = Path(str(metadata.distribution("pythonfmu").locate_file("pythonfmu")))
    except metadata.PackageNotFoundError:
        raise FmuError("runtime python needs the package pythonfmu: pip install pythonfmu") from None
    slave = Path(__file__).with_name("slave.py").read_text(encoding="utf-8")
    binaries = {name: path.read_bytes() for name, path in libraries.items()}
    identifier = content_identifier(model.name, [model.blob, slave.encode(), *binaries.values()])
    files = _common_files(model, identifier, extras, native=False)
    for name, library in libraries.items():
        binary = next(iter((frame / "resources" / "binaries" / name).glob(f"*{library.suffix}")), None)
        if binary is None:
            raise FmuError(f"pythonfmu has no binary for {name}: export with runtime native")
        files[f"binaries/{name}/{identifier}{library.suffix}"] = binary.read_bytes()
        files[f"resources/{identifier}_kernel{library.suffix}"] = binaries[name]
    slave = slave.replace("@GUID@", model.guid).replace("@LIBRARY@", f"{identifier}_kernel")
    files[f"resources/{identifier}.py"] = slave.encode()
    files["resources/slavemodule.txt"] = identifier.encode()
    for source in sorted(frame.glob("*.py")):
        files[f"resources/pythonfmu/{source.name}"] = source.read_bytes()
    return files


def _common_files(
    model: StageModel, identifier: str, extras: Extras, native: bool = True, sources: tuple[str, ...] = ()
) -> dict[str, bytes]:
    variables = named(list(Kernel(model.blob).variables.values()), model.stage)
    identity = Identity(
        model.name,
        identifier,
        model.guid,
        metadata.version("gearfmu"),
        model.stage.description,
        native,
        sources,
        {name: text for name in RIGHTS if (text := str(extras.get(name, "")))},
        nominals(model.stage),
    )
    icon = Path(__file__).with_name("icons") / f"{'set' if model.stage.carriers else 'pair'}.png"
    return {
        "modelDescription.xml": model_description(identity, variables),
        "model.png": icon.read_bytes(),
        TERMINALS: terminals_and_icons(variables),
        "documentation/index.html": page(identity, variables).encode(),
        **{f"documentation/licenses/{name}": text.encode() for name, text in licences(native).items()},
        MODEL_FILE: model.blob,
        STAGE_FILE: stage_file(model),
    }


def nominals(stage: Stage) -> dict[str, float]:
    """Unit → size of outputs of that unit, one digit: torque, force and speed that the first mesh is made for, and a
    hundredth of a millimetre."""
    mesh, teeth = stage.engagements[0], {gear.name: gear for gear in stage.gears}
    gear = teeth[mesh.gears[0]]
    radius = 0.5 * gear.teeth * gear.normal_module / math.cos(gear.helix_angle) * math.cos(gear.pressure_angle)
    sizes = {"N.m": mesh.torque_max, "N": mesh.torque_max / radius, "rad/s": mesh.speed_max}
    return {unit: float(f"{size:.0e}") for unit, size in sizes.items()} | {"m": 1e-5}


def source_files() -> dict[str, bytes]:
    """Path below sources/ → content: the C files of the kernel, included files, and the headers of FMI 2."""
    root = HERE / "src"
    own = {path.relative_to(root).as_posix(): path for path in sources()}
    head = {".c": HIDDEN.encode()}
    return {name: head.get(path.suffix, b"") + path.read_bytes() for name, path in sorted(own.items())} | {
        name: (fmi_headers() / name).read_bytes() for name in FMI_HEADERS
    }


def build_description(identifier: str, names: list[str]) -> bytes:
    """buildDescription.xml for these files."""
    compiled = (element("SourceFile", name=name) for name in names if name.endswith(".c"))  # the others are included
    options = {"language": "C99", "compiler": "gcc", "compilerOptions": COMPILER_OPTIONS}
    files = element("SourceFileSet", *compiled, element("IncludeDirectory", name="."), **options)
    library = element("Library", name="m", external="true")
    configuration = element("BuildConfiguration", files, library, modelIdentifier=identifier)
    return document(element("fmiBuildDescription", configuration, fmiVersion="3.0"))
