"""Pictures of the README from the trace of the demo: python docs/pictures/make.py [out/demo/trace.h5]
(its chart of error against time: docs/pictures/cost.py)"""

from __future__ import annotations

import base64
import re
import sys
from pathlib import Path

from gearfmu.body import load_stage_bodies
from gearfmu.files import write_text, written_whole
from gearfmu.report import picture, plots
from gearfmu.spec.expand import as_general
from gearfmu.spec.stage import load_stage
from gearfmu.stage.trace import Trace

HERE = Path(__file__).parent
NAMESPACES = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'

trace = Trace.load(sys.argv[1] if len(sys.argv) > 1 else "out/demo/trace.h5")
spec = load_stage(trace.meta["stage"])
pair = picture.deformed_pair(trace, as_general(spec), "mesh", load_stage_bodies(spec))
mesh = plots.mesh_force_and_error(trace, "mesh")
if pair is None or mesh is None:
    sys.exit("the trace lacks mesh force, transmission error or gear angles")
with written_whole(HERE / "deformed_pair.png") as temporary:
    temporary.write_bytes(base64.b64decode(re.search(r"base64,([^\"]+)", pair.picture)[1]))
write_text(HERE / "mesh.svg", mesh.picture.replace("<svg", NAMESPACES, 1))
