"""How models, results and traces are shown in a session: text and HTML that fit one screen, and plots."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 100  # columns of a terminal
LINES = 18  # rows of a card; further ones are counted


@dataclass(frozen=True)
class Card:
    """A heading, and rows of a name and its text, each of at most so many lines."""

    heading: str
    rows: Sequence[tuple[str, str]]
    lines: int = 1

    @property
    def text(self) -> str:
        """Lines of at most WIDTH columns, names aligned."""
        wide = max((len(name) for name, _ in self._shown), default=0)
        rows = [line for name, text in self._shown for line in self._wrapped(f"  {name:{wide}}  ", text)]
        return "\n".join([*textwrap.wrap(self.heading, WIDTH), *rows])

    def _wrapped(self, name: str, text: str) -> list[str]:
        return textwrap.wrap(
            text, WIDTH, initial_indent=name, subsequent_indent=" " * len(name), max_lines=self.lines, placeholder=" …"
        )

    @property
    def html(self) -> str:
        """A heading and a table."""
        row = "<tr><th style='text-align:left;vertical-align:top'>{}</th><td style='text-align:left'>{}</td></tr>"
        short = ((name, textwrap.shorten(text, WIDTH * self.lines, placeholder=" …")) for name, text in self._shown)
        rows = "".join(row.format(html.escape(name), html.escape(text)) for name, text in short)
        return f"<b>{html.escape(self.heading)}</b><table>{rows}</table>"

    @property
    def _shown(self) -> Sequence[tuple[str, str]]:
        more = len(self.rows) - LINES
        return self.rows if more <= 0 else [*self.rows[:LINES], ("…", f"{more} more")]


class Shown:
    """Shown in a session as its `card`; a dataclass of this kind has repr=False."""

    @property
    def card(self) -> Card:
        """Heading and rows."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return self.card.text

    def _repr_html_(self) -> str:
        return self.card.html


def grouped(names: Iterable[str]) -> list[tuple[str, str]]:
    """Names with dots by all before the last dot: ("mesh", "force te …"); those without a dot by themselves. Meshes
    come first."""
    found: dict[str, list[str]] = {}
    for group, _, last in sorted(name.rpartition(".") for name in names):
        found.setdefault(group, []).append(last)
    meshes = [group for group, own in found.items() if "te" in own]
    return [(group, " ".join(found[group])) for group in dict.fromkeys([*meshes, *found])]


def plot_over(
    across: tuple[str, np.ndarray], panels: Mapping[str, Mapping[str, np.ndarray]], figure: Figure | None = None
) -> np.ndarray:
    """Panels one below the other, each with its label and curves by name, over one axis (label, values). figure: of
    matplotlib, a new one when None. Returns the axes of the panels."""
    import matplotlib.pyplot as plt

    figure = figure or plt.figure(figsize=(9.0, 1.2 + 2.0 * len(panels)), layout="constrained")
    axes: np.ndarray = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (label, curves) in zip(axes, panels.items(), strict=True):
        for name, values in curves.items():
            axis.plot(across[1], values, lw=0.9, label=name)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
        axis.margins(x=0)
        if len(curves) > 1 or not any(label.startswith(name) for name in curves):
            axis.legend(loc="upper right", fontsize="small")
    axes[-1].set_xlabel(across[0])
    return axes
