"""Picture of a loaded transmission error: one curve a torque (Harris map), stiffness of mesh and stage below; of
a planetary set also how its planets share the load."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from gearfmu.files import written_whole
from gearfmu.report.style import panels, styled


def write_plot(result: Any, path: Path) -> None:
    """Write a TeResult, te (T, P) m, mesh_stiffness (full lines) and stage_stiffness (broken lines), (T, P) N/m, over
    position (P,) in pitches, as PNG or what the suffix says. mesh_stiffness None: of a planetary set, stage alone."""
    with styled():
        figure, (upper, lower) = panels((2.6, 1.9))
        for torque, error in zip(result.torque, result.te, strict=True):
            upper.plot(result.position, 1e6 * error, label=f"{torque:.4g} N·m", marker=".", ms=2.5)
        for name, line in (("mesh stiffness", "-"), ("stage stiffness", "--")):
            curves = getattr(result, name.replace(" ", "_"))
            for k, stiffness in enumerate(() if curves is None else curves):
                lower.plot(result.position, 1e-6 * stiffness, f"C{k}{line}", label="" if k else name)
        lower.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.1)
        upper.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=6, borderaxespad=0.1)
        upper.set_ylabel("transmission error in µm")
        lower.set_ylabel("stiffness in N/µm")
        lower.set_ylim(0, None)
        lower.set(xlabel="position in pitches", xlim=(0, math.ceil(result.position[-1])))
        with written_whole(path) as temporary:
            figure.savefig(temporary, dpi=150)


def write_set_plot(result: Any, path: Path) -> None:
    """Write a SetTeResult, te (T, P) m and sharing (T, P, 2, N) over position (P,) in mesh periods, as PNG or what the
    suffix says. Sharing is that at the largest torque, at the sun in full lines, at the ring in broken ones."""
    most = int(abs(result.torque).argmax())
    with styled():
        figure, (upper, lower) = panels((2.2, 2.6))
        for torque, error in zip(result.torque, result.te, strict=True):
            upper.plot(result.position, 1e6 * error, label=f"{torque:.4g} N·m", marker=".", ms=2.5)
        for planet in range(result.sharing.shape[3]):
            at_sun, at_ring = result.sharing[most, :, :, planet].T
            (line,) = lower.plot(result.position, at_sun, label=f"planet {planet + 1}")
            lower.plot(result.position, at_ring, color=line.get_color(), ls="--")
        for axes in (upper, lower):
            axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=6, borderaxespad=0.1)
        upper.set_ylabel("transmission error in µm")
        lower.set_ylabel(f"force over mean, {result.torque[most]:.4g} N·m\nsun —  ring - -")
        lower.set(xlabel="position in mesh periods", xlim=(0, math.ceil(result.position[-1])))
        with written_whole(path) as temporary:
            figure.savefig(temporary, dpi=150)
