"""Inputs of evidence as hashes: the kernel's sources, assembled models, Python code by import graph, files.

An input of a target (`needs` in ledger.json) is one of

    kernel        C sources below gearfmu/kernel/src, without comments
    stage NAME    the assembled model of a shipped stage, for its file, its bodies and the code of UPSTREAM
    reduction     the code of UPSTREAM, for what reduces bodies or assembles stages of its own
    code          modules that the target's command runs, and those that they import, down to UPSTREAM and PLUMBING
    other text    files by a pattern from the root

Comments, docstrings and empty lines count nowhere, nor do the dates of tables in pages.
"""

from __future__ import annotations

import ast
import hashlib
import io
import re
import tokenize
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import accumulate
from pathlib import Path

import numpy as np

import gearfmu
from evidence.pages_made import MARK
from gearfmu.cli import VERBS
from gearfmu.stage.assembly.blob import read_blob

KERNEL = "gearfmu/kernel/src"
# from a stage file to its model
UPSTREAM = ("stagefile", "geometry", "fem", "femesh", "reduction", "body", "stage/assembly")
# names for users, and what carries numbers without changing them
PLUMBING = ("__init__.py", "api", "errors.py", "extras.py", "files.py", "quantities.py")
BARRIERS = tuple(f"gearfmu/{part}" for part in (*UPSTREAM, *PLUMBING))
C_WORDS = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'|/\*.*?\*/|//[^\n]*', re.DOTALL)
PROGRAM = re.compile(r"python (?:-m ([\w.]+)|([\w/]+\.py))|\bgearfmu (\w+)")
SMALL = 64  # numbers of an array


def rounded_hash(blob: bytes) -> str:
    """12 hex digits that tell models apart, whatever the processor and the number of threads that made them: of small
    arrays five digits of every float, of large ones type, shape and norm (modes of equal frequency are any of many)."""
    said = []
    for name, value in read_blob(blob).items():
        if isinstance(value, str):
            said.append(f"{name} {value}")
            continue
        large = value.dtype.kind == "f" and value.size > SMALL
        numbers = [float(np.linalg.norm(value.astype(float)))] if large else value.ravel().tolist()
        rounded = [f"{number:.4e}" if isinstance(number, float) else number for number in numbers]
        said.append(f"{name} {value.dtype} {value.shape} {rounded}")
    return hashlib.sha256("\n".join(said).encode()).hexdigest()[:12]


def short(content: bytes) -> str:
    """SHA-256, 12 hex digits."""
    return hashlib.sha256(content).hexdigest()[:12]


@cache
def stage_hash(name: str) -> str:
    """Hash of the assembled model of a shipped stage, the same on every machine."""
    return rounded_hash(gearfmu.assemble(name).blob)


def python_code(text: str) -> str:
    """Python source without comments, docstrings and empty lines; equal in every version of Python."""
    starts = list(accumulate((len(line) for line in text.splitlines(keepends=True)), initial=0))
    words, before = [], tokenize.NEWLINE
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        alone = token.type == tokenize.STRING and before in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
        if alone or token.type == tokenize.COMMENT:
            words.append([starts[line - 1] + column for line, column in (token.start, token.end)])
        if token.type not in (tokenize.COMMENT, tokenize.NL):
            before = token.type
    for begin, end in reversed(words):
        text = text[:begin] + text[end:]
    return _dense(text)


def c_code(text: str) -> str:
    """C source without comments and empty lines."""
    bare = C_WORDS.sub(lambda word: " " if word[0].startswith("/") else word[0], text)
    return _dense(bare)


def _dense(text: str) -> str:
    return "\n".join(line.rstrip() for line in text.splitlines() if line.strip())


def read(path: Path) -> bytes:
    """The bytes of a file; of source code those that decide what it does."""
    if path.suffix == ".py":
        return python_code(path.read_text(encoding="utf-8")).encode()
    if path.suffix in (".c", ".h", ".inc"):
        return c_code(path.read_text(encoding="utf-8")).encode()
    if path.suffix == ".md":
        return MARK.sub(r"\1\4", path.read_text(encoding="utf-8")).encode()
    return path.read_bytes()


@dataclass
class Sources:
    """Hashes of inputs below `root` at one moment. edits: file → other content, for trials."""

    root: Path
    edits: Mapping[str, bytes] = field(default_factory=dict)
    _hashes: dict[str, str] = field(default_factory=dict)
    _found: dict[str, list[str]] = field(default_factory=dict)  # by pattern
    _imports: dict[str, frozenset[str]] = field(default_factory=dict)

    def digest(self, need: str, command: str = "") -> str:
        """The present hash of an input of a target with this command, "missing" where no file fits."""
        if need.startswith("stage "):
            return stage_hash(need.removeprefix("stage "))
        files = sorted(set(self._files(need, command)))
        return short(" ".join(map(self.file, files)).encode()) if files else "missing"

    def _files(self, need: str, command: str) -> Iterable[str]:
        if need == "kernel":
            return [file for file in self._glob(f"{KERNEL}/**/*") if file.endswith((".c", ".h", ".inc"))]
        if need == "reduction":
            return [file for part in UPSTREAM for file in self._glob(f"gearfmu/{part}/**/*.py")]
        return self.modules(command) if need == "code" else self._glob(need)

    def _glob(self, pattern: str) -> list[str]:
        """Files by a pattern."""
        if pattern not in self._found:
            paths = [path for path in self.root.glob(pattern) if path.is_file()]
            self._found[pattern] = [path.relative_to(self.root).as_posix() for path in paths]
        return self._found[pattern]

    def file(self, name: str) -> str:
        """Hash of a file."""
        if name not in self._hashes:
            path = self.root / name
            hashed = _file_hash if name not in self.edits else lambda *_: short(self.edits[name])
            self._hashes[name] = hashed(path, path.stat().st_mtime_ns)
        return self._hashes[name]

    @cached_property
    def _modules(self) -> dict[str, str]:
        """Name of a module → its file."""
        files = [file for folder in ("gearfmu", "evidence", "tests") for file in self._glob(f"{folder}/**/*.py")]
        return {file.removesuffix(".py").removesuffix("/__init__").replace("/", "."): file for file in files}

    def modules(self, command: str) -> set[str]:
        """Files of the modules that a command runs and imports, directly or not; BARRIERS end the search."""
        found: set[str] = set()
        left = list(self._programs(command))
        while left:
            file = left.pop()
            if file not in found:
                found.add(file)
                left += self.imports(file)
        return found

    def _programs(self, command: str) -> Iterator[str]:
        """Files of the programs that a command names: modules, scripts and verbs of gearfmu."""
        for module, script, verb in PROGRAM.findall(command):
            name = module or script.removesuffix(".py").replace("/", ".")
            name = name or (VERBS[verb][0].partition(":")[0] if verb in VERBS else "")
            file = self._module(f"{name}.__main__") or self._module(name)
            if file is not None:
                yield file

    def _module(self, name: str, package: str = "") -> str | None:
        """The file of a module below the root, below evidence, or beside a script."""
        names = (name, f"evidence.{name}", f"{package}.{name}")
        return next((self._modules[one] for one in names if one in self._modules), None)

    def imports(self, file: str) -> frozenset[str]:
        """Files of the checkout that a module imports, anywhere in it, BARRIERS left out."""
        if file not in self._imports:
            path, package = self.root / file, file.rpartition("/")[0].replace("/", ".")
            names = _imported(path, path.stat().st_mtime_ns, package)
            files = {found for name in names if (found := self._module(name, package)) is not None}
            self._imports[file] = frozenset(found for found in files if not behind(found))
        return self._imports[file]


def behind(file: str) -> bool:
    """Whether a file is one of BARRIERS, or below one."""
    return any(file == barrier or file.startswith(f"{barrier}/") for barrier in BARRIERS)


@cache
def _file_hash(path: Path, written: int) -> str:
    return short(read(path))


@cache
def _imported(path: Path, written: int, package: str) -> frozenset[str]:
    return frozenset(imported(ast.parse(path.read_text(encoding="utf-8")), package))


def imported(tree: ast.Module, package: str) -> Iterator[str]:
    """Names of modules, or of what may be one, that a module of `package` imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            above = parts[: len(parts) + 1 - node.level] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{name.name}" for name in node.names)
