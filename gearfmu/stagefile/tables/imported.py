"""[gears.<name>.import], of a planetary set [sun.import], [planet.import], [ring.import], [carrier.import]: a body
from finite elements made elsewhere (docs/howto-import.md)."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import model_validator

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.reading.base import Quantity, Spec, Text, entry, refuse
from gearfmu.stagefile.reading.files import FILES

FlankTolerance = Annotated[float, Quantity("flank_tolerance")]
SurfaceCoupling = Literal["averaging", "rigid"]
ELSEWHERE = "finite elements made elsewhere; meshed here when the table is absent"


class SourceSpec(Spec):
    """What every import names: where its nodes lie, its units, and ready-made matrices; paths relative to the file that
    says so."""

    file: Text = entry("mesh: .inp, .bdf, .msh or .vtu")
    length: Annotated[float, Quantity("length_unit")] = entry(
        'one length unit of the file, "1 mm" for a mesh in millimetres'
    )
    stiffness: Text = entry("ready-made stiffness matrix: .mtx, .npz, .sti, .op4 or .pch", "")
    mass: Text = entry("ready-made mass matrix, with stiffness", "")
    unknowns: Text = entry("CalculiX .dof file: node and direction of each row; without it x, y, z node by node", "")
    force_unit: Annotated[float, Quantity("force_unit")] = entry(
        'one unit of force of the stiffness matrix, "1 N"', 1.0
    )
    mass_unit: Annotated[float, Quantity("mass_unit")] = entry(
        'one unit of mass of the mass matrix, "1 t" with millimetres, newtons and seconds', 1.0
    )

    @model_validator(mode="after")
    def _both_matrices(self) -> SourceSpec:
        if bool(self.stiffness) != bool(self.mass):
            raise refuse("stiffness and mass come together: give both files or none")
        if self.unknowns and not self.stiffness:
            raise refuse("unknowns sorts the rows of ready-made matrices: give stiffness and mass too")
        return self


class FilesSpec(SourceSpec):
    """Mesh of a body, its units, and, where they are ready-made, its matrices."""

    axis: Literal["x", "y", "z"] = entry("axis of the body in the file", "z")
    ignore: tuple[Text, ...] = entry("node sets of reference nodes that belong to no element", ())


class ImportSpec(FilesSpec):
    """The finite elements of a gear; its place, tilt and the angle of its teeth are found by the involute fit."""

    bore: Text = entry("node set of the bore; without it the nodes on the stage's bore diameter", "")
    bore_coupling: SurfaceCoupling = entry("averaging (RBE3) or rigid (RBE2) master node of the bore", "averaging")
    flank_tolerance: FlankTolerance = entry("largest distance of a corner node from the best involute", 5e-6)


class RingImportSpec(FilesSpec):
    """The finite elements of a ring, placed by the involute fit of its tooth spaces."""

    rim: Text = entry("node set of the rim; without it the nodes on the stage's rim diameter", "")
    flank_tolerance: FlankTolerance = entry("largest distance of a corner node from the best involute", 5e-6)

    @property
    def bore(self) -> str:
        """The rim takes the place of the bore."""
        return self.rim

    @property
    def bore_coupling(self) -> str:
        """A rim is averaged, whole and by its patches."""
        return "averaging"


class CarrierImportSpec(FilesSpec):
    """The finite elements of a carrier, in the set's frame: z = 0 at the planets' mid-width, bolt 0 on +x."""

    bore: Text = entry("node set of the bore")
    bolts: tuple[Text, ...] = entry("node sets of the bolts' seats, counter-clockwise from bolt 0 on +x")


def import_inputs(spec: SourceSpec) -> dict[str, Any]:
    """What the import contributes to the hash of a body: its fields, with the SHA-256 of each file for its name.

    spec : its files as they can be opened. SpecError for every file that is not there, by its field alone.
    """
    values, problems = spec.model_dump(exclude_none=True), []
    for field in FILES:
        if not getattr(spec, field, ""):
            continue
        path = Path(getattr(spec, field))
        try:
            values[field] = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            remedy = f"{path} cannot be read ({error.strerror}): write the path relative to the stage file"
            problems.append(Problem("", field, path.name, remedy))
    if problems:
        raise SpecError(problems)
    return values
