"""The page itself: one HTML file that carries its own style and pictures and refers to nothing outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from gearfmu.report.plots import Plot
from gearfmu.report.results import REACHED_THE_END

CSS = """
:root{--ink:#23262b;--muted:#6a7079;--line:#e3e6ea;--accent:#1f5a92}
*{box-sizing:border-box}
body{margin:0;background:#f4f5f7;color:var(--ink);font:15px/1.5 "Helvetica Neue",Arial,"Liberation Sans",sans-serif}
main{max-width:1060px;margin:0 auto;padding:28px 20px 60px}
header h1{font-size:26px;margin:0 0 2px;letter-spacing:-.01em}
header p{margin:0 0 14px;color:var(--muted)}
section{background:#fff;border:1px solid var(--line);border-radius:6px;padding:16px 20px 12px;margin:0 0 16px}
h2{font-size:16px;margin:0 0 8px}
h3{font-size:14px;margin:14px 0 4px}
figure{margin:0}
svg,img{display:block;width:100%;height:auto}
figcaption,.note{color:var(--muted);font-size:13px;margin:6px 0 4px}
a{color:var(--accent)}
.facts{display:grid;grid-template-columns:repeat(4,1fr);gap:1px;background:var(--line);
border:1px solid var(--line);border-radius:6px;overflow:hidden;margin:0 0 16px}
.facts div{background:#fff;padding:9px 14px}
.facts b{display:block;font-size:18px;font-weight:600;letter-spacing:-.01em;overflow-wrap:anywhere}
.facts span{color:var(--muted);font-size:12.5px}
.ok,.bad{display:inline-block;border-radius:4px;padding:1px
9px;font-size:13px;font-weight:600;vertical-align:5px;margin-left:8px}
.ok{background:#dff0e4;color:#20623a}.bad{background:#f8dcd9;color:#8f2018}
.warning{border-left:4px solid #c8642b;background:#fdf4ec;border-radius:4px;padding:10px 16px;margin:0 0
16px;font-size:14px}
table{border-collapse:collapse;font-size:13.5px;min-width:min(560px,100%)}
th,td{text-align:left;padding:4px 22px 4px 0;border-bottom:1px solid var(--line);vertical-align:top}
th{color:var(--muted);font-weight:500}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}
code{font:12.5px ui-monospace,"DejaVu Sans Mono",Menlo,monospace;overflow-wrap:anywhere}
details summary{cursor:pointer;font-weight:600}
@media (max-width:700px){.facts{grid-template-columns:repeat(2,1fr)}}
@media print{body{background:#fff}section{break-inside:avoid}}
"""


def page(title: str, body: Sequence[str]) -> str:
    """The whole document around the given parts."""
    meta = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    top = f'<!DOCTYPE html>\n<html lang="en"><head>{meta}<title>{escape(title)}</title><style>{CSS}</style></head>'
    return top + "<body><main>\n" + "\n".join(body) + "\n</main></body></html>\n"


def head(title: str, outcome: str, subtitle: str) -> str:
    """Title with the outcome as a badge."""
    kind = "ok" if outcome in REACHED_THE_END else "bad"
    badge = f'<span class="{kind}">{escape(outcome)}</span>'
    return f"<header><h1>{escape(title)}{badge}</h1><p>{escape(subtitle)}</p></header>"


def facts(pairs: Mapping[str, str]) -> str:
    """The row of tiles: what it is → value."""
    tiles = "".join(f"<div><b>{escape(value)}</b><span>{escape(label)}</span></div>" for label, value in pairs.items())
    return f'<div class="facts">{tiles}</div>'


def figure(plot: Plot) -> str:
    """A section with one plot, its caption and the link to its data."""
    link = f'<a href="data/{plot.name}.csv">data/{plot.name}.csv</a>'
    return (
        f"<section><h2>{escape(plot.title)}</h2><figure>{plot.picture}"
        f"<figcaption>{escape(plot.caption)} {link}</figcaption></figure></section>"
    )


def section(title: str, *parts: str) -> str:
    """A titled section around ready-made parts."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def details(title: str, *parts: str) -> str:
    """A section that opens on a click."""
    return f"<section><details><summary>{escape(title)}</summary>{''.join(parts)}</details></section>"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the first column is text, the others numbers, right-aligned."""
    marks = ["", *[' class="n"'] * (len(header) - 1)]
    top = "".join(f"<th{mark}>{escape(cell)}</th>" for mark, cell in zip(marks, header, strict=True))
    body = "".join(
        "<tr>" + "".join(f"<td{mark}>{escape(cell)}</td>" for mark, cell in zip(marks, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{top}</tr>{body}</table>"


def pairs_table(pairs: Mapping[str, str]) -> str:
    """A table of name and text."""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td><code>{escape(value)}</code></td></tr>" for name, value in pairs.items()
    )
    return f"<table>{rows}</table>"


def note(text: str) -> str:
    """A small remark."""
    return f'<p class="note">{escape(text)}</p>'


def warning(text: str) -> str:
    """A remark that must not be overlooked."""
    return f'<p class="warning">{escape(text)}</p>'
