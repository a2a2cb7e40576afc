"""Builds the one shared library of the project from the C files below gearfmu/kernel/src: the gk_ API and the FMI 2
entry points.

One source list, one set of flags (docs/architecture.md, Kernel): contraction of products and sums is off and there is
no fast-math, so that gcc, clang and zig, Linux and Windows give the same bits. `-Bsymbolic` and hidden visibility keep
a second FMU in the same process from running the first one's kernel.

    python -m gearfmu.kernel [--platform win64] [--sanitize]

This file is also loaded by setup.py before anything is installed: it imports the standard library and gearfmu.errors.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import os
import platform as _platform
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from pathlib import Path

from gearfmu.errors import GearfmuError

HERE = Path(__file__).resolve().parent
STEM = "gearfmu_kernel"
SUFFIX = {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib", "aarch64-linux": ".so"}
INTEL = ("x86_64", "amd64")
ZIG_TARGETS = {
    "linux64": ("x86_64-linux-gnu.2.17",),
    "win64": ("x86_64-windows-gnu",),
    "darwin64": ("x86_64-macos.11.0", "aarch64-macos.11.0"),  # one file for both
}
FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-tree-slp-vectorize",  # gcc's makes fused operations of sums beside differences in spite of the flag above
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-Wall",
    "-Wextra",
    "-Werror",
)
TWIN_FLAGS = ("-O1",)  # of sources that run/gk_wide.c holds once more for AVX2: as fast as -O3 there, in half the time
PORTABLE = "-DGK_PORTABLE"  # without run/gk_wide.c: the same sources once, half the time of the compiler
_SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
_TWIN = re.compile(r'^#include "(\w+/\w+\.c)"', re.MULTILINE)
_LINKER = ("-l", "-Wl,")  # flags that no compilation takes
_EVERY = 5.0  # s between lines of progress
REBUILD = "python -m gearfmu.kernel"
BEHAVIOUR = "GEARFMU_BEHAVIOUR"
_PAGE = 14  # Apple processors have pages of 2^14 bytes
ZIG = "ziglang==0.16.0"  # a C compiler as a Python package, as in pyproject.toml
CROSS = f"pip install {ZIG}"


class BuildError(GearfmuError):
    """The kernel library cannot be built, is missing or does not belong to the sources beside it."""


def host_platform() -> str:
    """Name of this machine's platform in an FMU: "linux64", "win64" and "darwin64" of FMI 2; "aarch64-linux" of FMI 3,
    since linux64 is for x86-64.

    Raises BuildError on a 32-bit or unknown system or processor."""
    system, processor = _platform.system(), _platform.machine()
    intel = {"Linux": "linux64", "Windows": "win64"}.get(system) if processor.lower() in INTEL else None
    arm = "aarch64-linux" if (system, processor.lower()) in (("Linux", "aarch64"), ("Linux", "arm64")) else None
    name = intel or arm or ("darwin64" if system == "Darwin" else None)
    if name is None or sys.maxsize <= 2**32:
        raise BuildError(
            f"no kernel for this system ({system} {processor}): gearfmu runs on 64-bit {', '.join(SUFFIX)}"
        )
    return name


def sources(folder: Path = HERE) -> list[Path]:
    """C sources, headers and tables below `folder`/src in a fixed order; empty when there are none."""
    found = (p for p in (folder / "src").rglob("*") if p.suffix in (".c", ".h", ".inc"))
    return sorted(found, key=lambda p: p.name)


def source_hash(files: Sequence[Path]) -> str:
    """SHA-256 (hex) over names and contents of `files` and over the flags: what decides the bits of the library.

    Line ends count as one, so that a checkout on Windows has the same hash."""
    digest = hashlib.sha256("\n".join(FLAGS + TWIN_FLAGS).encode())
    for path in files:
        digest.update(b"\0" + path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def fingerprint() -> str:
    """The kernel's part of the key of stored results, hex: the variable GEARFMU_BEHAVIOUR (`make evidence` sets it to
    the hashes of the golden runs, those with friction and those with slices apart, after it has checked them), else the
    SHA-256 of the host's library."""
    return os.environ.get(BEHAVIOUR) or hashlib.sha256(library_path().read_bytes()).hexdigest()


def library_path(platform: str = "host") -> Path:
    """The built library of `platform` ("host", "linux64", "win64"), known to come from the sources beside it.

    Raises BuildError, naming the remedy, when there is none or when it was built from other sources."""
    name = _platform_name(platform)
    option = "" if platform == "host" else f" --platform {name}"
    folders = _package_folders()
    found = [f / "lib" / name / (STEM + SUFFIX[name]) for f in folders]
    library = next((p for p in found if p.is_file()), None)
    if library is None:
        needs = "" if name == host_platform() else f" (it needs the cross compiler: {CROSS})"
        raise BuildError(
            f"no kernel library for {name} (looked for {', '.join(map(str, found))}): "
            f"build it with `{REBUILD}{option}`{needs}"
        )
    files = next((s for s in map(sources, folders) if s), [])
    if files and _built_from(library) != source_hash(files):
        raise BuildError(
            f"{library} was built from other sources than those in {files[0].parent}: "
            f"rebuild it with `{REBUILD}{option}`"
        )
    return library


def build_library(
    platform: str = "host",
    sanitize: bool = False,
    pattern: bool = False,
    real: str = "float",
    out: str | Path | None = None,
    compiler: Sequence[str] | None = None,
) -> Path:
    """Compile and link the library; returns its path.

    platform: "host", or "linux64" / "win64" / "darwin64" (Intel and Apple in one file) cross-compiled with ziglang.
    sanitize: AddressSanitizer and UBSan, any finding ends the process (system compiler).
    pattern:  uninitialised variables are filled with a pattern (-ftrivial-auto-var-init).
    real:     type of modal rows and states, "float" (product) or "double" (tests: -DGK_DOUBLE_MODES).
    out:      file to write; default lib/<platform>[-variant]/ in the package.
    compiler: another command with flags of its own, e.g. ("gcc", "-O0"); its flags come last.
    Written under a temporary name, then renamed; a text file beside it holds the hash of the sources.
    Raises BuildError with the compiler's messages."""
    name, files = _platform_name(platform), sources()
    if real not in ("float", "double"):
        raise BuildError(f"real = {real!r}: use 'float' or 'double'")
    if not files:
        raise BuildError(f"no kernel sources in {HERE / 'src'}: reinstall gearfmu")
    variant = [("sanitize", sanitize), ("pattern", pattern), ("double", real == "double"), ("other", compiler)]
    folder = HERE / "lib" / "-".join([name, *(label for label, on in variant if on)])
    target = Path(out) if out else folder / (STEM + SUFFIX[name])
    commands, own_flags = ([compiler[:1]], compiler[1:]) if compiler else (_compilers(name, sanitize), ())
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".build-") as work:
        parts = [Path(work) / str(k) / target.name for k in range(len(commands))]
        flags = [*FLAGS, *_variant_flags(sanitize, pattern, real)]
        link = ["-shared", *_link_flags(name, sanitize), *own_flags]
        compiled = [p for p in files if p.suffix == ".c"]
        for command, part in zip(commands, parts, strict=True):
            part.parent.mkdir()
            line = [*command, *flags, *([] if name == "win64" else ["-fPIC"]), *_folders()]
            objects = _objects(line, [f for f in own_flags if not f.startswith(_LINKER)], compiled, part.parent)
            _run([*command, *flags, *link, "-o", str(part), *map(str, objects), *_libraries(name)])
        made = parts[0] if len(parts) == 1 else _universal(parts, Path(work) / target.name)
        digest = Path(work) / "digest"
        digest.write_text(source_hash(files) + "\n")
        os.replace(made, target)
        os.replace(digest, _sidecar(target))
    return target


def current_library() -> Path:
    """The host's library in this checkout: built where it is missing or comes from other sources or flags."""
    library = HERE / "lib" / host_platform() / (STEM + SUFFIX[host_platform()])
    current = library.is_file() and _built_from(library) == source_hash(sources(HERE))
    return library if current else build_library()


def compile_program(source: Path, out: Path, platform: str = "host", sanitize: bool = False) -> Path:
    """Compile one C program that loads FMUs (tests, benchmarks) with the library's compiler and flags; returns `out`.

    Raises BuildError with the compiler's messages."""
    name = _platform_name(platform)
    line = [*_compilers(name, sanitize)[0], *FLAGS, *_variant_flags(sanitize, pattern=False, real="float"), *_folders()]
    _run([*line, "-o", str(out), str(source), *_libraries(name)])
    return out


def fmi_headers() -> Path:
    """Folder of the FMI 2 headers in the installed fmpy (2-clause BSD); raises BuildError when fmpy is missing."""
    spec = importlib.util.find_spec("fmpy")
    for place in (spec.submodule_search_locations or []) if spec else []:
        for folder in (Path(place) / "c-code", Path(place) / "c-code" / "include"):
            if (folder / "fmi2Functions.h").is_file():
                return folder
    raise BuildError("the FMI 2 headers come with the package fmpy, which is not installed here: pip install fmpy")


def _folders() -> list[str]:
    return [f"-I{fmi_headers()}", f"-I{HERE / 'src'}"]


def _platform_name(platform: str) -> str:
    name = host_platform() if platform == "host" else platform
    if name not in SUFFIX:
        raise BuildError(f"unknown platform {name!r}: use host, {', '.join(SUFFIX)}")
    return name


def _package_folders() -> list[Path]:
    """Folders of gearfmu.kernel: with an editable install sources and library may lie in different ones."""
    package = sys.modules.get("gearfmu.kernel")
    folders = [Path(p).resolve() for p in getattr(package, "__path__", [])]
    return folders if HERE in folders else [HERE, *folders]


def _objects(line: Sequence[str], own_flags: Sequence[str], files: Sequence[Path], folder: Path) -> list[Path]:
    """Objects of the sources `files` in `folder`, compiled on all processors."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        running = [pool.submit(_run, command) for command in _compilations(line, own_flags, files, folder).values()]
        try:
            for done in _told(running):
                done.result()
        finally:
            for waiting in running:
                waiting.cancel()
    return [folder / f"{path.stem}.o" for path in files]


def _compilations(
    line: Sequence[str], own_flags: Sequence[str], files: Sequence[Path], folder: Path
) -> dict[Path, list[str]]:
    """Object → command of every source, the longest first."""
    wide = HERE / "src" / "run" / "gk_wide.c"
    twins = set(_TWIN.findall(wide.read_text(encoding="utf-8"))) if _is_x86(line) and wide in files else set()
    commands = {}
    for path in sorted(files, key=lambda p: (p != wide, -p.stat().st_size)):
        cheap = TWIN_FLAGS if f"{path.parent.name}/{path.name}" in twins else ()
        target = folder / f"{path.stem}.o"
        commands[target] = [*line, *cheap, *own_flags, "-c", str(path), "-o", str(target)]
    return commands


def _told(running: Sequence[Future[None]]) -> Iterator[Future[None]]:
    """The calls as they end, with lines of progress on standard error."""
    last = time.monotonic()
    for count, done in enumerate(as_completed(running), start=1):
        yield done
        if time.monotonic() - last > _EVERY and count < len(running):
            last = time.monotonic()
            print(f"kernel: {count} of {len(running)} files compiled", file=sys.stderr, flush=True)


def _is_x86(command: Sequence[str]) -> bool:
    """Does a command compile for x86-64, where run/gk_wide.c is not empty?"""
    target = next((word for word in command if word.startswith(("x86_64-", "aarch64-"))), _platform.machine().lower())
    return target.startswith(("x86_64", "amd64"))


def _universal(parts: Sequence[Path], out: Path) -> Path:
    """Mach-O libraries for several processors in one file (Apple, mach-o/fat.h), as `lipo -create` makes it."""
    contents, at = [part.read_bytes() for part in parts], 1 << _PAGE
    header, body = struct.pack(">II", 0xCAFEBABE, len(contents)), b""
    for content in contents:
        kind, subkind = struct.unpack_from("<II", content, 4)
        header += struct.pack(">IIIII", kind, subkind, at + len(body), len(content), _PAGE)
        body += content + b"\0" * (-len(content) % (1 << _PAGE))
    out.write_bytes(header.ljust(at, b"\0") + body)
    return out


def _compilers(name: str, sanitize: bool) -> list[tuple[str, ...]]:
    """ziglang when installed (old glibc, cross-compiling), else the system's compiler; sanitizers need the latter. More
    than one where the platform's library is for several processors."""
    serves = not sanitize and _zig_serves(name)
    if serves and importlib.util.find_spec("ziglang"):
        zig = (sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=undefined", "-target")
        return [(*zig, target) for target in ZIG_TARGETS[name]]
    if name != host_platform():
        raise BuildError(f"cross-compiling for {name} needs ziglang: {CROSS}")
    if found := system_compiler():
        return [(found,)]
    raise BuildError(f"no C compiler found: install gcc or clang{f', or {CROSS}' if serves else ''}")


def _zig_serves(name: str) -> bool:
    """Whether ziglang's code runs on that platform; on this machine only with an x86-64 processor."""
    return name in ZIG_TARGETS and (name != host_platform() or _platform.machine().lower() in INTEL)


def system_compiler() -> str:
    """The C compiler of this machine: that of the variable CC, else cc, gcc or clang; "" where there is none."""
    return next(filter(shutil.which, filter(None, (os.environ.get("CC"), "cc", "gcc", "clang"))), "")


def build_requirements(platforms: Sequence[str]) -> list[str]:
    """Packages that a build for these platforms ("none": no library; empty: this machine) asks pip for: ziglang where
    it cross-compiles or the machine has no compiler."""
    here = not platforms and not system_compiler() and _zig_serves(host_platform())
    return [ZIG] if here or set(platforms) - {"none"} else []


def _variant_flags(sanitize: bool, pattern: bool, real: str) -> list[str]:
    flags = ["-DGK_DOUBLE_MODES"] if real == "double" else []
    flags += ["-ftrivial-auto-var-init=pattern"] if pattern else []
    checks = [PORTABLE, "-g1", "-O1", "-fno-omit-frame-pointer", *_SANITIZERS]  # -g: twice the time of the compiler
    return flags + (checks if sanitize else [])


def _link_flags(name: str, sanitize: bool) -> list[str]:
    if name == "win64":
        return ["-Wl,-s"]
    if name == "darwin64":
        return ["-Wl,-install_name,@rpath/gearfmu_kernel.dylib"]
    return ["-Wl,-Bsymbolic", *([] if sanitize else ["-Wl,--no-undefined", "-Wl,-s"])]


def _libraries(name: str) -> list[str]:
    """dlopen for programs; sqrt where a compiler without optimisation calls it (IEEE exact in every C library)."""
    return ["-Wl,--as-needed", "-lm", "-ldl"] if name.endswith(("linux64", "-linux")) else []


def _run(command: Sequence[str]) -> None:
    cache = _cache_folder()
    folders = {"ZIG_GLOBAL_CACHE_DIR": str(cache / "zig-global"), "ZIG_LOCAL_CACHE_DIR": str(cache / "zig-local")}
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", env={**folders, **os.environ})
    if done.returncode:
        raise BuildError(f"the compiler failed: {' '.join(command)}\n{done.stdout}{done.stderr}".rstrip())


def _cache_folder() -> Path:
    """zig's caches: in a checkout below build/, else in a folder of the user's among the temporary files."""
    root = HERE.parents[1]
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    return root / "build" if (root / "pyproject.toml").is_file() else Path(tempfile.gettempdir()) / f"gearfmu-{user}"


def _sidecar(library: Path) -> Path:
    return library.with_suffix(".sources")


def _built_from(library: Path) -> str:
    try:
        return _sidecar(library).read_text().strip()
    except OSError:
        return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of this module; exit code 0 on success, 1 with one message when the build failed."""
    parser = argparse.ArgumentParser(prog=REBUILD, description="Build the kernel library from the package's C sources.")
    parser.add_argument("--platform", default="host", help="host (default), linux64, win64 or darwin64")
    parser.add_argument("--sanitize", action="store_true", help="with ASan and UBSan, in a folder of its own")
    parser.add_argument("--pattern", action="store_true", help="fill uninitialised variables, in a folder of its own")
    parser.add_argument("--real", default="float", choices=("float", "double"), help="type of modal rows and states")
    chosen = parser.parse_args(arguments)
    try:
        print(build_library(chosen.platform, chosen.sanitize, chosen.pattern, chosen.real))
    except BuildError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
