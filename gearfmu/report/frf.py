"""Chart of reduction methods: error over frequency."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from matplotlib import rc_context

from gearfmu.reduction.transfer import Reference
from gearfmu.report.style import COLOURS, INK, panels, plain_ticks, saved, styled

LABELS = {
    "modal": "modal truncation",
    "craig_bampton": "Craig–Bampton",
    "rubin": "Rubin / MacNeal",
    "krylov": "block Krylov",
    "static": "static modes",
    "snapshots": "snapshots (POD)",
}


def write_error_chart(curves: Mapping[str, tuple[np.ndarray, np.ndarray]], path: Path, title: str) -> list[Path]:
    """Relative error over frequency, SVG and PNG at `path`; curves: label → frequency (F,) Hz and error (F,), or with
    the label "norm" the norm of the transfer matrix, which gets a panel of its own above."""
    norm = curves.get("norm")
    with styled(), rc_context({"svg.hashsalt": path.stem}):
        figure, axes = panels((1.6, 4.0) if norm is not None else (4.0,))
        if norm is not None:
            axes[0].loglog(*norm, color=INK)
            axes[0].set_ylabel("|H|, m/N")
        for number, (label, (frequency, error)) in enumerate((k, v) for k, v in curves.items() if k != "norm"):
            colour = COLOURS[number % len(COLOURS)]
            axes[-1].loglog(frequency, np.maximum(error, 1e-16), color=colour, label=label)
        for panel in axes:
            plain_ticks(panel)
            panel.yaxis.set_major_formatter(lambda value, _: f"1e{round(np.log10(value))}")
        axes[0].set_title(title, loc="left")
        axes[-1].set_ylabel("relative error (Frobenius)")
        axes[-1].set_xlabel("frequency, Hz")
        axes[-1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return saved(figure, path)


def error_curves(
    exact: Reference, found: Iterable[tuple[str, int, np.ndarray]]
) -> tuple[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """The errors of (method, n, error (F,)) as the text of a CSV file (`method,n,frequency_Hz,error`), and as curves
    for `write_error_chart` with the norm of the exact transfer matrix."""
    frequency, lines = exact.judging.frequency, ["method,n,frequency_Hz,error"]
    curves = {"norm": (frequency, np.linalg.norm(exact.matrix, axis=(1, 2)))}
    for method, size, error in found:
        lines += [f"{method},{size},{f:.6g},{e:.4e}" for f, e in zip(frequency, error, strict=True)]
        curves[f"{label_of(method)}, n = {size}"] = (frequency, error)
    return "\n".join(lines) + "\n", curves


def label_of(method: str) -> str:
    """A method's name for a legend; text behind a blank in `method` stays as it is."""
    name, _, rest = method.partition(" ")
    return f"{LABELS.get(name, name)} {rest}".strip()
