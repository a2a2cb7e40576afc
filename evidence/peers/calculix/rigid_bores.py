"""Our gears with rigid bores, to compare like with like where CalculiX's bores are clamped node by node.

Only the static tables are made anew, those of `bore_coupling = "rigid"`: `te` needs no more.
"""

from __future__ import annotations

from dataclasses import replace

from gearfmu.body import Body, load_bodies
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_geometry


def rigid_bore_bodies(spec: Stage) -> list[Body]:
    """The stored bodies of a pair with the static tables of gears whose bores are rigid. Their modes stay as they were:
    of use at level rigid only."""
    return [_with_rigid_bore(spec, index, body) for index, body in enumerate(load_bodies(spec))]


def _with_rigid_bore(spec: Stage, index: int, stored: Body) -> Body:
    gear = spec.gears[index]
    geometry = gear_geometry(gear, spec.written.pair, (1, -1)[index])
    sector = gear_sector(geometry, gear.face_width, gear.body.mesh)
    body = SectorBody(sector, gear.material, *tooth_flank(geometry, gear), rigid_bore=True)
    tables = static_tables(body, [])
    flank = replace(stored.flank, static=tables.static_ff, node=tables.static_fb)
    return replace(stored, flank=flank, static=tables.static_bb)
