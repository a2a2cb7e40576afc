"""The finite elements of one sector of a body, for pictures, shapes and facts."""

from __future__ import annotations

from gearfmu.body.imported import imported_sector_mesh
from gearfmu.errors import BodyError
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.carrier import scaled_sector
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.housing import HousingBody


def body_sector(stage: Stage, name: str, scale: float = 1.0) -> FeMesh:
    """One sector of the body `name` of a stage. scale : factor on all element counts, but for an imported gear's.

    BodyError for a housing, an imported carrier and for imported gears without a sector of hexahedra.
    """
    table = stage.by_file[name]
    if isinstance(table, HousingBody):
        raise BodyError(f"{stage.source}: {name}: a housing has no sector that repeats: look at it in your own program")
    if isinstance(table, CarrierBody):
        if table.imported is None:
            return scaled_sector(table, scale)
        raise BodyError(
            f"{table.imported.file}: an imported carrier is taken as a whole and has no sector: use the "
            "pictures of your own finite-element program"
        )
    if table.imported is not None:
        return imported_sector_mesh(table)
    own = table.body.mesh
    return gear_sector(gear_shape(table), table.face_width, own.model_copy(update={"scale": own.scale * scale}))
