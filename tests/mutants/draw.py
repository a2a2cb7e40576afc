"""Draws defects from the sources: a line of code, what is done to it, and where in it.

C and Python are read by the same lexer: an edit stays in one line, and what does not compile, or compiles to the same
code, is drawn again by the caller. Kept tools do not serve: mutmut and cosmic-ray know Python only and neither dropped
terms nor constants a little off, universalmutator's rules are expressions over lines and see strings and comments."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHON = "geometry stagefile scenefile rexs femesh fem reduction body stage modes cosim planning".split()
PYTHON += [f"study/{name}.py" for name in "norm order limits ladder reference".split()]
PYTHON += [f"report/{name}.py" for name in "metrics levels mesh_cycle signals runup campbell".split()]
NOT_NUMBERS = "kernel/src/fmi2 gk_ranges.h gk_text.c /schema.py /table.py reduction/methods/ transient.py".split()

TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\w*)|(?P<name>[A-Za-z_]\w*)|(?P<space>\s+)"
    r"|(?P<op>->|\+\+|--|<<=|>>=|\*\*=?|//=?|[-+*/%&|^=!<>:]=|&&|\|\||<<|>>|\S)"
)
TEXT_C = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)
TEXT_PYTHON = re.compile(
    r'""".*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|#[^\n]*',
    re.DOTALL,
)
SKIPPED = re.compile(
    r"\s*(#\s*(include|if|else|endif|undef|error)|import |from |def |class |@|raise |assert |GK_ASSERT)"
)
WORDS = {"return", "in", "and", "or", "not", "if", "else", "elif", "yield", "is", "case", "lambda", "while", "for"}
TYPES = {"int", "float", "str", "bool", "double", "char", "void", "const", "None", "tuple", "list", "dict", "object"}
TURNED = {"<": "<= > >=", "<=": "< >", ">": ">= < <=", ">=": "> <", "==": "!=", "!=": "=="}
SWAPPED = {"sin": "cos", "sine": "cosine", "gk_sin": "gk_cos", "min": "max", "gk_min": "gk_max", "minimum": "maximum"}
SWAPPED |= {new: old for old, new in SWAPPED.items()}
ARGUMENTS = re.compile(r"(?<=[A-Za-z0-9_]\()([\w.]+|[\w]+->[\w]+), ([\w.]+|[\w]+->[\w]+)(?=[,)])")
CALLED = re.compile(r"(?:getattr|setattr|isinstance|zip|range)\($")  # a swap there is seen by the first call
GUARD = re.compile(r"^\s*(?:\} else |el)?if (?P<cond>.+?)(?P<end>:|)$")
PART = re.compile(r" (?:&&|\|\||and|or) (?:[\w.>\[\]!<=+* -]+?)(?=\)| &&| \|\||:$| and | or |$)")


@dataclass(frozen=True)
class Defect:
    """A line of a file (from 1) whose text `before` becomes `after`; both without indentation."""

    file: str
    line: int
    kind: str
    before: str
    after: str


@dataclass(frozen=True)
class Token:
    kind: str
    text: str
    start: int
    end: int


def files(root: Path = ROOT) -> list[Path]:
    """Sources that decide numbers: the kernel, and packages from geometry to report metrics."""
    source = root / "gearfmu" / "kernel" / "src"
    found = [p for p in source.rglob("*") if p.suffix in (".c", ".h")]
    for name in PYTHON:
        path = root / "gearfmu" / name
        found += path.rglob("*.py") if path.is_dir() else [path] * path.exists()
    return sorted(p for p in found if not any(part in p.as_posix() for part in NOT_NUMBERS))


def drawn(seed: int, root: Path = ROOT) -> Iterator[Defect]:
    """Defects without end: every line of code that offers any is as likely as another, and so is every kind in it."""
    dice = random.Random(seed)
    lines = [(path, number) for path in files(root) for number in sorted(possible(path))]
    while True:
        path, number = dice.choice(lines)
        offered = possible(path)[number]
        kind = dice.choice(sorted({kind for kind, *_ in offered}))
        _, start, end, new = dice.choice([edit for edit in offered if edit[0] == kind])
        text = path.read_text(encoding="utf-8").splitlines()[number - 1]
        after = text[:start] + new + text[end:]
        yield Defect(path.relative_to(root).as_posix(), number, kind, text.strip(), after.strip())


Edit = tuple[str, int, int, str]  # kind, columns that are replaced, by what


@cache
def possible(path: Path) -> dict[int, list[Edit]]:
    """Edits of every line of a file that offers any, by its number."""
    text = path.read_text(encoding="utf-8")
    code = (TEXT_PYTHON if path.suffix == ".py" else TEXT_C).sub(_masked, text)
    found = {n: edits(line) for n, line in enumerate(code.splitlines(), start=1) if not SKIPPED.match(line)}
    return {n: offered for n, offered in found.items() if offered}


def _masked(match: re.Match[str]) -> str:
    """Comments and texts as blanks and quotes of equal length."""
    kept = '"' if match[0][0] in "\"'" else " "
    return re.sub(r"[^\n]", kept, match[0])


def edits(line: str) -> list[Edit]:
    """What may be done to a line of code."""
    tokens = [Token(str(m.lastgroup), m[0], m.start(), m.end()) for m in TOKEN.finditer(line) if m.lastgroup != "space"]
    found: list[Edit] = []
    brackets: list[bool] = []  # of every open bracket: is it a subscript?
    for i, token in enumerate(tokens):
        before = tokens[i - 1] if i else None
        if token.text in "([{":
            brackets.append(token.text == "[" and _ends_value(before))
        elif token.text in ")]}" and brackets:
            brackets.pop()
        elif token.text in TURNED:
            found += [("comparison", token.start, token.end, new) for new in TURNED[token.text].split()]
        elif token.text in SWAPPED:
            found.append(("swapped", token.start, token.end, SWAPPED[token.text]))
        inside = bool(brackets) and brackets[-1]
        found += _indices(tokens, i) if inside else _constants(tokens, i)
        found += _signs(tokens, i, inside)
    pairs = (m for m in ARGUMENTS.finditer(line) if m[1] != m[2] and not CALLED.search(line[: m.start()]))
    found += [("swapped", m.start(), m.end(), f"{m[2]}, {m[1]}") for m in pairs]
    return [*found, *_guards(line)]


def _ends_value(token: Token | None) -> bool:
    """Does an operator after this token stand between two operands?"""
    if token is None or token.text in WORDS:
        return False
    return token.kind in ("number", "name") or token.text in (")", "]")


def _indices(tokens: Sequence[Token], i: int) -> Iterator[Edit]:
    token, last = tokens[i], tokens[i + 1].text if i + 1 < len(tokens) else ""
    if last not in ("]", ":", ",", "+", "-") or tokens[i - 1].text not in ("[", ":", ",", "+", "-"):
        return
    if token.kind == "number" and token.text.isdigit():
        yield "index", token.start, token.end, str(int(token.text) + 1)
        if int(token.text) > 0:
            yield "index", token.start, token.end, str(int(token.text) - 1)
    elif token.kind == "name" and token.text not in TYPES | WORDS and not token.text[0].isupper():
        yield "index", token.start, token.end, f"{token.text} + 1"
        yield "index", token.start, token.end, f"{token.text} - 1"


def _constants(tokens: Sequence[Token], i: int) -> Iterator[Edit]:
    """Numbers 5 % larger; whole numbers of sums, and of loops of C, one larger."""
    token, before, after = tokens[i], tokens[i - 1].text if i else "", tokens[i + 1].text if i + 1 < len(tokens) else ""
    if token.kind != "number":
        return
    if not token.text.isdigit():
        if re.fullmatch(r"[\d.]+(?:[eE][+-]?\d+)?", token.text) and float(token.text):
            yield "constant", token.start, token.end, f"{float(token.text) * 1.05:.10g}"
    elif {before, after} & {"*", "/"}:
        if int(token.text):
            yield "constant", token.start, token.end, f"{int(token.text) * 1.05:.10g}"
    elif before in ("+", "-", "<", "<=") or after in ("+", "-") or (before == "=" and after == ";"):
        yield "index", token.start, token.end, str(int(token.text) + 1)


def _signs(tokens: Sequence[Token], i: int, inside: bool) -> Iterator[Edit]:
    """Signs turned, and terms and factors dropped."""
    token, before = tokens[i], tokens[i - 1] if i else None
    if token.text in ("+=", "-="):
        yield "sign", token.start, token.end, {"+=": "-=", "-=": "+="}[token.text]
    after = tokens[i + 1] if i + 1 < len(tokens) else None
    if token.text not in ("+", "-", "*", "/") or after is None:
        return
    if not _ends_value(before):
        if token.text == "-" and not inside:
            yield "sign", token.start, token.end, ""
        return
    if after.start == token.end:  # a pointer
        return
    if token.text in "+-":
        yield "sign", token.start, token.end, "-" if token.text == "+" else "+"
    assert before is not None
    if end := _operand(tokens, i):
        yield "term", before.end, end, ""


def _operand(tokens: Sequence[Token], i: int) -> int:
    """Column where the operand after the operator `i` ends, 0 where that is in another line."""
    depth, product = 0, tokens[i].text in "*/"
    stop = {",", ";", "?", ":", "<", ">", "<=", ">=", "==", "!=", "&&", "||", "=", "+", "-", "%", "&", "|", "<<", ">>"}
    stop |= {"*", "/", "//"} if product else set()
    stop |= {"if", "else", "for", "and", "or", "in", "is", "@", "{"}
    for k in range(i + 1, len(tokens)):
        text = tokens[k].text
        if depth == 0 and (text in ")]}" or text in stop) and k > i + 1:
            return tokens[k - 1].end
        depth += (text in "([{") - (text in ")]}")
    return tokens[-1].end if depth == 0 else 0


def _guards(line: str) -> Iterator[Edit]:
    """Conditions that never hold, and parts of conditions dropped."""
    if whole := GUARD.match(line):
        start, end = whole.span("cond")
        if not whole["end"]:  # C: to the bracket that closes the first
            depths = accumulate((c == "(") - (c == ")") for c in line[start:])
            end = next((start + k + 1 for k, depth in enumerate(depths) if depth == 0), 0)
        if end:
            yield "guard", start, end, "False" if whole["end"] else "(0)"
    for match in PART.finditer(line):
        yield "guard", match.start(), match.end(), ""
