"""Picture of a loaded transmission error: one curve a torque (Harris map), and the mesh stiffness below."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gearfmu.files import written_whole
from gearfmu.report.style import panels, styled


def write_plot(result: Any, path: Path) -> None:
    """Write a TeResult, te (T, P) m and stiffness (T, P) N/m over position (P,) in pitches, as PNG or what the
    suffix says."""
    with styled():
        figure, (upper, lower) = panels((2.6, 1.9))
        for torque, error, stiffness in zip(result.torque, result.te, result.stiffness, strict=True):
            upper.plot(result.position, 1e6 * error, label=f"{torque:.4g} N·m", marker=".", ms=2.5)
            lower.plot(result.position, 1e-6 * stiffness, marker=".", ms=2.5)
        upper.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=6, borderaxespad=0.1)
        upper.set_ylabel("transmission error in µm")
        lower.set_ylabel("mesh stiffness in N/µm")
        lower.set(xlabel="position in pitches", xlim=(0, 1))
        with written_whole(path) as temporary:
            figure.savefig(temporary, dpi=150)
