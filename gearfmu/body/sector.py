"""The finite elements of one sector of a body, for pictures, shapes and facts."""

from __future__ import annotations

from gearfmu.errors import BodyError
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.carrier import scaled_sector
from gearfmu.reduction.imported.gear import BORE, checked_gear
from gearfmu.stagefile.forms.general import Stage, ToothedBody
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
        return _imported_sector(table)
    own = table.body.mesh
    return gear_sector(gear_shape(table), table.face_width, own.model_copy(update={"scale": own.scale * scale}))


def _imported_sector(gear: ToothedBody) -> FeMesh:
    """The sector mesh of an imported gear, as of one meshed here."""
    found = checked_gear(gear)
    cut = found.cut
    if cut is None or set(cut.elements) != {"hexahedron20"} or found.matrices is not None:
        raise BodyError(
            f"{found.mesh.source}: this needs hexahedra, our own matrices and a mesh that repeats itself from tooth to "
            "tooth; use the pictures of your own finite-element program"
        )
    sets = {"rim" if found.flank.internal else BORE: found.bore_of_cut}
    return FeMesh(cut.nodes, cut.elements["hexahedron20"], sets, gear.teeth, cut.cut_minus, cut.cut_plus)
