"""Pictures of the README, from the trace of the demo: python docs/pictures/make.py [out/demo/trace.h5]"""

from __future__ import annotations

import base64
import re
import sys
from pathlib import Path

from gearfmu.body import load_stage_bodies
from gearfmu.files import write_text, written_whole
from gearfmu.report import picture, plots
from gearfmu.report.levels import levels_path, read_levels
from gearfmu.report.style import panels, styled
from gearfmu.spec.stage import load_stage
from gearfmu.stage.trace import Trace

HERE = Path(__file__).parent
NAMESPACES = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'

trace = Trace.load(sys.argv[1] if len(sys.argv) > 1 else "out/demo/trace.h5")
spec = load_stage(trace.meta["stage"])
pair = picture.deformed_pair(trace, spec, load_stage_bodies(spec))
mesh = plots.mesh_force_and_error(trace)
if pair is None or mesh is None:
    sys.exit("the trace lacks mesh force, transmission error or gear angles")
with written_whole(HERE / "deformed_pair.png") as temporary:
    temporary.write_bytes(base64.b64decode(re.search(r"base64,([^\"]+)", pair.picture)[1]))
write_text(HERE / "mesh.svg", mesh.picture.replace("<svg", NAMESPACES, 1))

scenes = {"pair_loaded": "302 N·m, 2000 rpm", "pair_light": "80 N·m, 6000 rpm"}
prices = read_levels(levels_path(spec))
with styled():
    figure, (axes,) = panels((2.5,))
    for scene, label in scenes.items():
        rows = [row for row in prices if row["scene"] == scene]
        time = [float(row["time_per_second"]) for row in rows]
        error = [100 * float(row["te_error"]) for row in rows]
        axes.loglog(time, error, "o-", label=label)
        for row, x, y in zip(rows, time, error, strict=True):
            axes.annotate(row["level"], (x, y), textcoords="offset points", xytext=(7, 4))
    axes.set(xlabel="CPU time per simulated second", ylabel="transmission error, rms error in %")
    for axis, ticks in ((axes.xaxis, (1, 1.5, 2, 3, 4, 5, 6)), (axes.yaxis, (0.5, 1, 2, 5, 10, 20, 50))):
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks((), minor=True)
    axes.legend(loc="upper right")
    with written_whole(HERE / "cost.svg") as temporary:
        figure.savefig(temporary, format="svg")
