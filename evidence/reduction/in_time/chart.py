"""Curves of the time-domain comparison as pictures of the documentation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.ticker import FuncFormatter

from evidence.tables import read_columns
from gearfmu.files import written_whole
from gearfmu.report.style import INK, panels, styled

HERE = Path(__file__).parent
PICTURES = HERE.parents[2] / "docs" / "pictures"
RUNS = {
    "carrier_planet": {
        "modal 120 | rubin 60": "modal truncation",
        "craig_bampton 120 | rubin 60": "Craig–Bampton",
        "rubin 120 | rubin 60": "Rubin / MacNeal",
        "krylov 120 | rubin 60": "block Krylov",
    },
    "hammering": {
        "krylov 120 | modal 400": "reduced as in the paper",
        "krylov 120 | modal 400 + residual": "with static residual",
    },
    "ring_hammering": {
        "modal 400 | whole": "modal truncation",
        "craig_bampton 400 | whole": "Craig–Bampton",
        "rubin 400 | whole": "Rubin / MacNeal",
        "modal 400 + residual | whole": "modes with static residual",
    },
}
SHOWN = {
    "carrier_planet": ("bolt deflection, µm", "bolt tilt, mrad", "pin elongation, µm"),
    "hammering": ("mesh force, N", "planet speed, rad/s", "sun speed, rad/s"),
    "ring_hammering": ("mesh force, N", "planet speed, rad/s", "tooth of the ring, µm"),
}
FLOOR = 1e-8  # of the differences shown
DIFFERENCE = {
    "carrier_planet": "bolt deflection, µm",
    "hammering": "planet speed, rad/s",
    "ring_hammering": "tooth of the ring, µm",
}


def draw(name: str) -> None:
    """docs/pictures/in_time_<name>.svg: curves of the unreduced bodies and of the reduced ones, and the difference."""
    columns = read_columns(HERE / f"curves_{name}.csv")
    at = 1e3 * columns["time_s"]
    with styled(), rc_context({"svg.hashsalt": name}):
        figure, axes = panels((1.7,) * len(SHOWN[name]) + (2.0,))
        for panel, channel in zip(axes, SHOWN[name], strict=False):
            panel.plot(at, columns[f"{channel} | whole | whole"], color=INK, linewidth=2.4, label="finite elements")
            for run, label in RUNS[name].items():
                panel.plot(at, columns[f"{channel} | {run}"], linewidth=1.0, label=label)
            panel.set_ylabel(channel)
        channel = DIFFERENCE[name]
        whole = columns[f"{channel} | whole | whole"]
        for index, (run, label) in enumerate(RUNS[name].items()):
            off = np.abs(columns[f"{channel} | {run}"] - whole) / np.sqrt(np.mean(whole**2))
            axes[-1].semilogy(at[1:], np.maximum(off[1:], FLOOR), color=f"C{index}", label=label)
        axes[-1].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes[-1].set(xlabel="time, ms", ylabel=f"difference in {channel.split(',')[0]}\nover its rms")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        with written_whole(PICTURES / f"in_time_{name}.svg") as temporary:
            figure.savefig(temporary, format="svg", metadata={"Date": None})
