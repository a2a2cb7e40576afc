"""Text for terminals and pipes of any code page: signs that it lacks are written in ASCII, so that none ends a verb."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

HANDLER = "gearfmu.plain"
_WORDS = {
    "→": "->", "←": "<-", "↔": "<->", "⇒": "=>", "≤": "<=", "≥": ">=", "≠": "!=", "±": "+-", "∓": "-+", "−": "-",
    "–": "-", "—": "-", "…": "...", "·": "*", "⋅": "*", "×": "x", "√": "sqrt ", "∫": "integral ", "∈": "in", "‖": "|",
    "∂": "d", "′": "'", "°": "deg", "µ": "u", "μ": "u", "─": "-", "━": "-", "├": "|", "┤": "|", "⁄": "/",
}  # fmt: skip


def plain(sign: str) -> str:
    """An ASCII text for one character: "->", "alpha", "2" for a raised 2; "?" where there is none."""
    if sign in _WORDS:
        return _WORDS[sign]
    name = unicodedata.name(sign, "").split()
    if name[:1] == ["GREEK"] and "LETTER" in name:
        word = name[name.index("LETTER") + 1].lower()
        return word.capitalize() if "CAPITAL" in name else word
    parts = (_WORDS.get(part, part) for part in unicodedata.normalize("NFKD", sign))
    text = "".join(parts).encode("ascii", "ignore").decode()
    return text if text or unicodedata.combining(sign) else "?"


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(plain, error.object[error.start : error.end])), error.end


def write_plainly() -> None:
    """Lets standard output and standard error write `plain` text for what their encoding lacks."""
    codecs.register_error(HANDLER, _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=HANDLER)
