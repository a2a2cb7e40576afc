"""The kernel's C sources inside an FMU, and how they become its binary: for platforms that the FMU brings none for.

FMI 2.0.4 has no build description; sources/buildDescription.xml has the form of FMI 3.0 (2.5.4), which newer importers
read. Flags are those of the shipped binaries: with them gcc, clang and zig give the same bits."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from gearfmu.kernel.build import FLAGS, HERE, fmi_headers, sources

FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
SYSTEM_HEADERS = "errno float math stdarg stddef stdint stdio stdlib string".split()  # all that the sources include
# At the head of every file that is compiled: what no attribute exports stays inside, whatever flags an importer takes
HIDDEN = "".join(f"#include <{name}.h>\n" for name in SYSTEM_HEADERS) + (
    "#if defined(__GNUC__) && !defined(_WIN32)\n#pragma GCC visibility push(hidden)\n#endif\n#line 1\n"
)
COMPILER_OPTIONS = " ".join(flag for flag in FLAGS if not flag.startswith("-W"))


def source_files() -> dict[str, bytes]:
    """Path below sources/ → content: the C files of the kernel, what they include, and the headers of FMI 2."""
    root = HERE / "src"
    own = {path.relative_to(root).as_posix(): path for path in sources()}
    head = {".c": HIDDEN.encode()}
    return {name: head.get(path.suffix, b"") + path.read_bytes() for name, path in sorted(own.items())} | {
        name: (fmi_headers() / name).read_bytes() for name in FMI_HEADERS
    }


def compiled(names: list[str]) -> list[str]:
    """Those of the files that a compiler is given."""
    return [name for name in names if name.endswith(".c")]


def build_description(identifier: str, names: list[str]) -> bytes:
    """buildDescription.xml for these files."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    options = {"language": "C99", "compiler": "gcc", "compilerOptions": COMPILER_OPTIONS}
    files = ET.SubElement(configuration, "SourceFileSet", options)
    for name in compiled(names):
        ET.SubElement(files, "SourceFile", {"name": name})
    ET.SubElement(files, "IncludeDirectory", {"name": "."})
    ET.SubElement(configuration, "Library", {"name": "m", "external": "true"})
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
