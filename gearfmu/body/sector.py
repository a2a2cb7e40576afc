"""The finite elements of one sector of a body, for pictures, shapes and facts."""

from __future__ import annotations

from gearfmu.body.imported import imported_sector_mesh
from gearfmu.errors import BodyError
from gearfmu.femesh import FeMesh, sector_mesh
from gearfmu.reduction.carrier import scaled_sector
from gearfmu.spec.general import GeneralStage
from gearfmu.spec.members import members
from gearfmu.spec.pair import StageSpec
from gearfmu.spec.planetary import PlanetarySpec


def body_sector(spec: StageSpec | GeneralStage | PlanetarySpec, name: str, scale: float = 1.0) -> FeMesh:
    """One sector of the body `name` of a stage. scale : factor on all element counts, but for an imported gear's.

    BodyError for an imported carrier and for imported gears without a sector of hexahedra.
    """
    toothed = members(spec)
    if name not in toothed:
        assert isinstance(spec, PlanetarySpec)
        return _carrier_sector(spec, scale)
    member = toothed[name]
    if member.gear.imported is not None:
        return imported_sector_mesh(member)
    own = member.gear.body.mesh
    return sector_mesh(member.geometry, member.gear.face_width, own.model_copy(update={"scale": own.scale * scale}))


def _carrier_sector(spec: PlanetarySpec, scale: float) -> FeMesh:
    if spec.carrier.imported is not None:
        raise BodyError(
            f"{spec.carrier.imported.file}: an imported carrier is taken as a whole and has no sector: use the "
            "pictures of your own finite-element program"
        )
    return scaled_sector(spec, scale)
