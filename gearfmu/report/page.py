"""The page itself: one HTML file that carries style, scripts, numbers and pictures and refers to nothing outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from gearfmu.extras import MissingPackage
from gearfmu.report.chart import Chart, Plot
from gearfmu.report.figures import chart_element, chart_numbers
from gearfmu.report.names import minus
from gearfmu.report.packed import Pack, squeezed
from gearfmu.report.results import REACHED_THE_END

if TYPE_CHECKING:
    from gearfmu.report.moving import View

NO_SCRIPT = "A script inside this page draws the figures; it is switched off. Their data lie in the folder data."


def page(title: str, body: Sequence[str], plots: Sequence[Plot] = (), stage: View | None = None) -> str:
    """The whole document around the given parts. plots: those among them whose charts the script draws; stage: the
    numbers of the turning view (`moving.View`), None without one."""
    charts = {plot.name: plot.picture for plot in plots if isinstance(plot.picture, Chart)}
    meta = '<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1">'
    style = f"<style>{_own('page.css')}</style>"
    top = f'<!DOCTYPE html>\n<html lang="en"><head>{meta}<title>{escape(title)}</title>{style}</head>'
    scripts = _scripts(charts, stage) if charts or stage is not None else ""
    return f"{top}<body><main>\n" + "\n".join(body) + f"\n</main>{scripts}</body></html>\n"


def _scripts(charts: Mapping[str, Chart], stage: View | None) -> str:
    pack = Pack()
    content: dict[str, Any] = {"figures": {name: chart_numbers(chart, pack) for name, chart in charts.items()}}
    if stage is not None:
        content["stage"] = stage.numbers(pack)
    carried = f'<script type="text/plain" id="numbers">{pack.text(content)}</script>'
    if charts:
        carried += f'<script type="text/plain" id="plotly">{_plotly()}</script>'
    names = (["stage.js"] if stage is not None else []) + ["report.js"]
    return f"<noscript><p>{NO_SCRIPT}</p></noscript>{carried}<script>{''.join(_own(name) for name in names)}</script>"


@cache
def _own(name: str) -> str:
    return (files("gearfmu.report") / "web" / name).read_text(encoding="utf-8")


@cache
def _plotly() -> str:
    """Plotly's script, packed: 4.8 MB become 2.0 MB. The build put it beside the other scripts (setup.py)."""
    script = files("gearfmu.report") / "web" / "plotly.min.js"
    if not script.is_file():
        raise MissingPackage(f"reports need plotly's script, which the build puts at {script}: install gearfmu again")
    return squeezed(script.read_bytes())


def head(title: str, outcome: str, subtitle: str) -> str:
    """Title with the outcome as a badge."""
    kind = "ok" if outcome in REACHED_THE_END else "bad"
    badge = f'<span class="{kind}">{escape(outcome)}</span>' if outcome else ""
    return f"<header><h1>{escape(title)}{badge}</h1><p>{escape(subtitle)}</p></header>"


def contents(links: Mapping[str, str]) -> str:
    """Links to sections: id → words."""
    return "<nav>" + "".join(f'<a href="#{name}">{escape(words)}</a>' for name, words in links.items()) + "</nav>"


def tiles(results: Sequence[tuple[str, str, str]]) -> str:
    """The key results: value, unit, description."""
    found = "".join(
        f"<div><b>{escape(minus(value))}<small>{escape(unit)}</small></b><span>{escape(label)}</span></div>"
        for value, unit, label in results
    )
    return f'<div class="tiles">{found}</div>' if found else ""


def facts(pairs: Mapping[str, str]) -> str:
    """Conditions of the run: description → value."""
    rows = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in pairs.items())
    return f'<dl class="run">{rows}</dl>'


def figure(plot: Plot, folder: str = "data", file: str = "") -> str:
    """A section with one plot, its caption and the link to its data: `file`, else a file of its name in `folder`."""
    at = escape(file or f"{folder}/{plot.name}.csv", quote=True)
    link = f'<a href="{at}">{at}</a>'
    seen = chart_element(plot.name, plot.picture) if isinstance(plot.picture, Chart) else _told(plot)
    return (
        f'<section id="{escape(plot.name, quote=True)}"><h2>{escape(plot.title)}</h2><figure>{seen}'
        f"<figcaption>{escape(plot.caption)} {link}</figcaption></figure></section>"
    )


def stage_view(title: str, caption: str, most: float) -> str:
    """The place of the turning stage with its controls; the script `stage.js` draws it and then shows them. most:
    displacement (m) at the end of the scale of colours."""
    label = escape(f"{title}. {caption}", quote=True)
    return (
        f'<section id="stage" class="stage"><h2>{escape(title)}</h2><figure>'
        f'<canvas role="img" tabindex="0" aria-label="{label}"></canvas><div class="controls">'
        '<button type="button" class="play">Play</button><button type="button" class="closer">Mesh close up</button>'
        '<label>time <input class="moment" type="range" min="0" max="1" step="0.001" value="0">'
        "<output></output></label>"
        '<label>enlarged <input class="enlarge" type="range" min="-1" max="0.7" step="0.01" value="0">'
        '<span class="factor"></span></label><span class="legend">0<span class="scale"></span>'
        f"{1e6 * most:.3g} µm</span>"
        '</div><p class="wait note">The view is drawn when its data are unpacked.</p>'
        f'<figcaption class="note">{escape(caption)}</figcaption></figure></section>'
    )


def _told(plot: Plot) -> str:
    """A picture with its caption for those who do not see it."""
    return str(plot.picture).replace('alt=""', f'alt="{escape(plot.title, quote=True)}: see the caption"', 1)


def section(title: str, *parts: str, name: str = "") -> str:
    """A titled section around ready-made parts; name: target of links."""
    mark = f' id="{name}"' if name else ""
    return f"<section{mark}><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def details(title: str, *parts: str) -> str:
    """A section that opens on a click."""
    return f"<section><details><summary>{escape(title)}</summary>{''.join(parts)}</details></section>"


class Ready(str):
    """A cell of a table that is HTML already."""


def _cell(text: str) -> str:
    return text if isinstance(text, Ready) else escape(text)


def table(header: Sequence[str], rows: Sequence[Sequence[str]], text: Sequence[int] = (0,)) -> str:
    """A table; columns of the numbers `text` are text, the others numbers, right-aligned."""
    marks = ["" if k in text else ' class="n"' for k in range(len(header))]
    top = "".join(f"<th{mark}>{_cell(cell)}</th>" for mark, cell in zip(marks, header, strict=True))
    body = "".join(
        "<tr>" + "".join(f"<td{mark}>{_cell(cell)}</td>" for mark, cell in zip(marks, row, strict=True)) + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><tr>{top}</tr>{body}</table></div>'


def pairs_table(pairs: Mapping[str, str]) -> str:
    """A table of name and text."""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td><code>{escape(value)}</code></td></tr>" for name, value in pairs.items()
    )
    return f'<div class="scroll"><table>{rows}</table></div>'


def note(text: str) -> str:
    """A small remark."""
    return f'<p class="note">{escape(text)}</p>'


def warning(text: str) -> str:
    """A remark that must not be overlooked."""
    return f'<p class="warning">{escape(text)}</p>'
