"""The form of the kernel's C sources, read by regular expressions: order of the folders in includes and calls, lengths,
parameters, headers. What breaks a rule today is listed in tests/reference/c_sources.json, a list that only shrinks:

    python tests/c_sources.py          what breaks the rules and is not listed, and what is listed without need
    python tests/c_sources.py --write  store the list anew
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

FILE = Path(__file__).parent / "reference" / "c_sources.json"
SOURCES = Path(__file__).resolve().parents[1] / "gearfmu" / "kernel" / "src"
ORDER = ("base", "model", "setup", "force", "problem", "integrate", "run", "fmi2")  # a file knows those before its own
CONTRACTS = ("gk.h", "problem/gk_row.h")  # declare the functions of many files: for use from outside; kinds of rows
MOST_LINES, MOST_PARAMETERS = 400, 6
RULES = ("includes", "calls", "lines", "parameters", "headers", "names")

_STRING_OR_COMMENT = re.compile(r'"(?:\\.|[^"\\\n])*"' + r"|'(?:\\.|[^'\\\n])*'|/\*.*?\*/|//[^\n]*", re.S)
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+"([^"]+)"', re.M)
_DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
_OTHERWISE = re.compile(r"^[ \t]*#[ \t]*(?:else|elif)\b.*?(?=^[ \t]*#[ \t]*endif\b)", re.M | re.S)
_DEFINE = re.compile(r"^[ \t]*#[ \t]*define[ \t]+(\w+)", re.M)
_ATTRIBUTE = re.compile(r"\bGK_HOT\b|__(?:attribute|declspec)(?:__)?\s*\(\((?:[^()]|\([^()]*\))*\)\)")
_ASSERT = re.compile(r"\bGK_ASSERT\((?:[^()]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*\);")  # not in the product
_FUNCTION = re.compile(r"\b(\w+)\s*\(")
_BY_TYPE = re.compile(r"^\s*\w+_function\s+(\w+)\s*;?$")
_WORD = re.compile(r"\b[A-Za-z_]\w*\b")
_TAG = re.compile(r"\b(?:struct|enum|union)\s+(\w+)\s*\{")


@dataclass(frozen=True)
class Function:
    """A definition (body: its text) or a declaration (body None)."""

    name: str
    parameters: int
    static: bool
    body: str | None


@dataclass
class Source:
    """One file. path: below the folder of sources; text: without comments and strings."""

    path: str
    raw: str
    text: str = field(init=False)

    def __post_init__(self) -> None:
        self.includes = _INCLUDE.findall(_STRING_OR_COMMENT.sub(_without_comment, self.raw))
        self.text = _STRING_OR_COMMENT.sub(_blank, self.raw)

    @property
    def folder(self) -> str:
        """ "" for a file that lies in none."""
        return self.path.rpartition("/")[0]

    @property
    def header(self) -> bool:
        return self.path.endswith(".h")

    @property
    def lines(self) -> int:
        return self.raw.count("\n")

    @cached_property
    def functions(self) -> list[Function]:
        """Definitions and declarations at file level, in order."""
        plain = _ASSERT.sub("", _DIRECTIVE.sub("", _OTHERWISE.sub(_blank, self.text)))
        plain = _ATTRIBUTE.sub("", plain)
        return [function for head, body in _pieces(plain) if (function := _function(head, body)) is not None]

    @cached_property
    def words(self) -> set[str]:
        """Every identifier outside directives."""
        return set(_WORD.findall(_DIRECTIVE.sub("", self.text)))

    @cached_property
    def defines(self) -> set[str]:
        """Functions, macros, types and constants of enumerations that this file makes known."""
        plain = _DIRECTIVE.sub("", self.text)
        found = set(_DEFINE.findall(self.text)) | {f.name for f in self.functions} | set(_TAG.findall(plain))
        found |= set(re.findall(r"\}\s*(\w+)\s*;", plain)) | set(re.findall(r"\btypedef\b[^;{}]*?\b(\w+)\s*;", plain))
        for items in re.findall(r"\benum\b\s*\w*\s*\{([^}]*)\}", plain):
            found |= {words[0] for item in items.split(",") if (words := _WORD.findall(item))}
        return found


def _blank(match: re.Match[str]) -> str:
    return " " + "\n" * match.group().count("\n")


def _without_comment(match: re.Match[str]) -> str:
    return match.group() if match.group()[0] in "\"'" else _blank(match)


def _pieces(text: str) -> Iterator[tuple[str, str | None]]:
    """What stands at file level: head and, in braces, body; a declaration has none."""
    begin = opened = depth = 0
    for match in re.finditer(r"[{};]", text):
        at, what = match.start(), match.group()
        if what == "{":
            opened = at if depth == 0 else opened
            depth += 1
        elif what == "}":
            depth -= 1
            if depth == 0 and text[begin:opened].rstrip().endswith(")"):
                yield text[begin:opened], text[opened : at + 1]
                begin = at + 1
        elif depth == 0:
            if "{" not in text[begin:at]:
                yield text[begin:at], None
            begin = at + 1


def _function(head: str, body: str | None) -> Function | None:
    if (by_type := _BY_TYPE.match(head)) and body is None:
        return Function(by_type.group(1), 0, False, None)
    found = _FUNCTION.search(head)
    if found is None or "=" in head[: found.start()] or re.search(r"\btypedef\b|\(\s*\*", head[: found.end() + 1]):
        return None
    depth, count, at = 1, 1, found.end()
    while depth and at < len(head):
        depth += {"(": 1, ")": -1}.get(head[at], 0)
        count += head[at] == "," and depth == 1
        at += 1
    nothing = head[found.end() : at - 1].strip() in ("", "void")
    static = re.search(r"\bstatic\b|\bGK_INLINE\b", head[: found.start()]) is not None
    return Function(found.group(1), 0 if nothing else count, static, body)


@dataclass(frozen=True)
class Sources:
    """All files below a folder."""

    files: dict[str, Source]

    @classmethod
    def below(cls, folder: Path = SOURCES) -> Sources:
        paths = sorted(p for p in folder.rglob("*") if p.suffix in (".c", ".h"))
        return cls(
            {str(p.relative_to(folder)): Source(str(p.relative_to(folder)), p.read_text("utf-8")) for p in paths}
        )

    @cached_property
    def defined(self) -> dict[str, str]:
        """Function that other files can call → the file that defines it."""
        return {
            f.name: path
            for path, source in self.files.items()
            for f in source.functions
            if f.body is not None and (not f.static or source.header)
        }

    def broken(self) -> dict[str, dict[str, int]]:
        """Rule → violation → its size (1 where it has none)."""
        return {rule: dict(sorted(getattr(self, rule)().items())) for rule in RULES}

    def includes(self) -> dict[str, int]:
        """A file includes none of a folder after its own."""
        return {
            f"{path} includes {name}": 1
            for path, source in self.files.items()
            for name in source.includes
            if _rank(name) > _rank(path)
        }

    def calls(self) -> dict[str, int]:
        """A function uses none of a folder after its own."""
        found = {}
        for path, source in self.files.items():
            for f in source.functions:
                for word in set(_WORD.findall(f.body or "")) & self.defined.keys():
                    if _rank(self.defined[word]) > _rank(path):
                        found[f"{path} {f.name} uses {word} of {self.defined[word]}"] = 1
        return found

    def lines(self) -> dict[str, int]:
        """A file has at most MOST_LINES lines."""
        return {path: source.lines for path, source in self.files.items() if source.lines > MOST_LINES}

    def parameters(self) -> dict[str, int]:
        """A function has at most MOST_PARAMETERS parameters, unless FMI gives them."""
        return {
            f"{path} {f.name}": f.parameters
            for path, source in self.files.items()
            for f in source.functions
            if f.body is not None and f.parameters > MOST_PARAMETERS and not re.match("fmi2[A-Z]", f.name)
        }

    def headers(self) -> dict[str, int]:
        """A header declares the functions of one file. Size: how many other files' functions are there."""
        found = {}
        for path, source in self.files.items():
            of = {self.defined.get(f.name, path) for f in source.functions if f.body is None} - {path}
            if source.header and path not in CONTRACTS and len(of) > 1:
                found[path] = len(of)
        return found

    def names(self) -> dict[str, int]:
        """A header includes those whose names it uses."""
        makers = defaultdict(set)
        for path, source in self.files.items():
            for name in source.defines if source.header else ():
                makers[name].add(path)
        found = {}
        for path, source in self.files.items():
            if source.header:
                at_hand = {path, *source.includes}
                foreign = {w: makers[w] for w in source.words if w in makers and not makers[w] & at_hand}
                found |= {f"{path} uses {min(of)}": 1 for of in foreign.values()}
        return found


def _rank(path: str) -> int:
    """Place of a file's folder in ORDER; before all for those in none, and for headers from outside."""
    folder = path.rpartition("/")[0]
    return ORDER.index(folder) if folder else -1


def alone(header: Path) -> str:
    """Complaints of the compiler about a header that is included first; "" where it needs nothing before it."""
    from gearfmu.kernel.build import fmi_headers

    line = ["cc", "-std=c99", "-fsyntax-only", "-x", "c", f"-I{SOURCES}", f"-I{fmi_headers()}", str(header)]
    return subprocess.run(line, capture_output=True, text=True).stderr


def stored() -> dict[str, dict[str, int]]:
    """The list of what breaks a rule: rule → violation → size."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def new(found: Mapping[str, Mapping[str, int]], known: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Violations that are not listed, or larger than listed."""
    return [
        f"{rule}: {name}" + (f" ({size}, listed {known[rule].get(name, 0)})" if size > 1 else "")
        for rule, of in found.items()
        for name, size in of.items()
        if size > known[rule].get(name, 0)
    ]


def gone(found: Mapping[str, Mapping[str, int]], known: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Listed violations that are none any more."""
    return [f"{rule}: {name}" for rule, of in known.items() for name in of if name not in found[rule]]


def main() -> None:
    parser = argparse.ArgumentParser(description="Form of the kernel's C sources.")
    parser.add_argument("--write", action="store_true", help="store what breaks the rules")
    write, found = parser.parse_args().write, Sources.below().broken()
    if write:
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        print(*(f"{rule}: {len(of)}" for rule, of in found.items()), sep="\n")
        return
    problems = [f"new: {p}" for p in new(found, stored())] + [f"gone: {p}" for p in gone(found, stored())]
    print(*problems, sep="\n")
    sys.exit(min(len(problems), 99))


if __name__ == "__main__":
    main()
