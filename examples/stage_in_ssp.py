"""A system structure (SSP 1.0) with an elastic gear pair in it: torque on the pinion, wheel held, level `fast`.

Tools that read SSP take stage.ssp as it is; here fmpy does. Run: python examples/stage_in_ssp.py [FOLDER]
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

from fmpy.ssp.simulation import simulate_ssp

import gearfmu as gf

INPUTS, OUTPUTS = ["pinion.tau"], ["mesh.te", "mesh.force", "wheel.tau"]
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
fmu, ssp = folder / "fzg_c.fmu", folder / "stage.ssp"
gf.export(gf.assemble("fzg_c", ports={"pinion": "torque", "wheel": "fixed"}), fmu, level="fast")


# connectors that the system and the stage in it have alike, and what joins them
connectors = "".join(
    f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real/></ssd:Connector>'
    for names, kind in ((INPUTS, "input"), (OUTPUTS, "output"))
    for name in names
)
connections = "".join(
    f'<ssd:Connection {element}="stage" startConnector="{name}" endConnector="{name}"/>'
    for names, element in ((INPUTS, "endElement"), (OUTPUTS, "startElement"))
    for name in names
)
structure = f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="stage"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssd:System name="drive">
    <ssd:Connectors>{connectors}</ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="stage" type="application/x-fmu-sharedlibrary" source="resources/{fmu.name}">
        <ssd:Connectors>{connectors}</ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>{connections}</ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
"""
with zipfile.ZipFile(ssp, "w", zipfile.ZIP_DEFLATED) as archive:
    archive.writestr("SystemStructure.ssd", structure)
    archive.write(fmu, f"resources/{fmu.name}")

table = simulate_ssp(str(ssp), stop_time=0.1, step_size=1e-4, input={"pinion.tau": lambda time: 302.0})
te, force, torque = (float(table[name][-1]) for name in OUTPUTS)
print(f"transmission error {1e6 * te:.2f} µm, mesh force {force:.0f} N, torque at the held wheel {torque:.1f} N·m")
