"""The finite elements of one sector of a body, for pictures, shapes and facts."""

from __future__ import annotations

from gearfmu.body.imported import imported_sector_mesh
from gearfmu.errors import BodyError
from gearfmu.femesh import FeMesh, sector_mesh
from gearfmu.reduction.carrier import scaled_sector
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.members import carrier_of, members


def body_sector(stage: Stage, name: str, scale: float = 1.0) -> FeMesh:
    """One sector of the body `name` of a stage. scale : factor on all element counts, but for an imported gear's.

    BodyError for a housing, an imported carrier and for imported gears without a sector of hexahedra.
    """
    toothed = members(stage)
    if name in {housing.name for housing in stage.housings}:
        raise BodyError(f"{stage.source}: {name}: a housing has no sector that repeats: look at it in your own program")
    if name not in toothed:
        carrier = carrier_of(stage)
        if carrier.part.imported is None:
            return scaled_sector(carrier, scale)
        raise BodyError(
            f"{carrier.part.imported.file}: an imported carrier is taken as a whole and has no sector: use the "
            "pictures of your own finite-element program"
        )
    member = toothed[name]
    if member.gear.imported is not None:
        return imported_sector_mesh(member)
    own = member.gear.body.mesh
    return sector_mesh(member.geometry, member.gear.face_width, own.model_copy(update={"scale": own.scale * scale}))
