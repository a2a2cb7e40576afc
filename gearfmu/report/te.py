"""Picture of a loaded transmission error: one curve a torque (Harris map), and the mesh stiffness below."""
from __future__ import annotations

from typing import Any

from gearfmu.report.style import panels, standalone_svg, styled


def te_svg(result: Any) -> str:
    """SVG file text of a TeResult: te (T, P) m and stiffness (T, P) N/m over position (P,) in pitches."""
    with styled():
        figure, (upper, lower) = panels((2.4, 1.7))
        for torque, error, stiffness in zip(result.torque, result.te, result.stiffness, strict=True):
            upper.plot(result.position, 1e6 * error, label=f"{torque:.4g} N·m", marker=".", ms=2.5)
            lower.plot(result.position, 1e-6 * stiffness, marker=".", ms=2.5)
        upper.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=6, borderaxespad=0.1)
        upper.set_ylabel("transmission error in µm")
        lower.set_ylabel("mesh stiffness in N/µm")
        lower.set(xlabel="position in pitches", xlim=(0, 1))
        return standalone_svg(figure, "te")
