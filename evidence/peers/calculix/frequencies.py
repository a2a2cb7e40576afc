"""Elastic frequencies of free bodies by CalculiX: our meshes, 20-node hexahedra (C3D20), all teeth or, where these are
too many, one sector with CalculiX's own cyclic symmetry and every nodal diameter.

    python -m evidence.peers.calculix.frequencies

A case whose deck is that of the table is not run again. Ours, from one sector of the same mesh and its cyclic symmetry,
are compared in tests/modes/test_calculix_frequencies.py. Needs CalculiX's ccx (Debian: calculix-ccx); seconds to some
minutes a case.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evidence.peers.calculix.ccx import deck_path, digest, require_ccx, run
from evidence.peers.calculix.deck import element_lines, node_lines
from evidence.tables import read_rows, write_rows
from gearfmu.body.sector import body_sector
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.modes.cyclic import cyclic_modes
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import Material

COUNT, RIGID = 20, 6
TABLE = Path(__file__).with_suffix(".csv")


@dataclass(frozen=True)
class Case:
    """A body of a shipped stage. scale: of all element counts of its mesh. by_sector: CalculiX gets one sector."""

    name: str
    stage: str
    body: str
    scale: float
    by_sector: bool = False


CASES = {
    case.name: case
    for case in (
        Case("pinion_coarse", "fzg_c", "pinion", 0.4),
        Case("pinion", "fzg_c", "pinion", 0.7),
        Case("ring_coarse", "planetary54", "ring", 0.2),
        Case("ring", "planetary54", "ring", 0.4),
        Case("carrier_coarse", "planetary54", "carrier", 0.5),
        Case("carrier", "planetary54", "carrier", 1.0, by_sector=True),
        Case("pinion_sector_coarse", "fzg_c", "pinion", 0.4, by_sector=True),
        Case("pinion_file", "fzg_c", "pinion", 1.0, by_sector=True),
        Case("ring_file", "planetary54", "ring", 1.0, by_sector=True),
    )
}


def body_of(case: Case) -> tuple[Material, FeMesh]:
    """The body's material and the finite elements of one of its sectors."""
    spec = load_stage(case.stage)
    if spec.carriers:
        return getattr(spec.written, case.body).material, body_sector(spec, case.body, case.scale)
    (gear,) = (gear for gear in spec.gears if gear.name == case.body)
    counts = gear.body.mesh.model_copy(update={"scale": gear.body.mesh.scale * case.scale})
    return gear.material, gear_sector(gear_geometry(gear, spec.written.pair), gear.face_width, counts)


def ours(case: Case) -> np.ndarray:
    """Our lowest elastic frequencies (COUNT,) Hz of a case."""
    material, sector = body_of(case)
    found = cyclic_modes(case.body, sector, material, COUNT)
    return np.concatenate([[mode.frequency] * len(mode.numbers) for mode in found.modes])[:COUNT]


def write_deck(mesh: FeMesh, material: Material, path: Path) -> None:
    """Free vibration of a body, whole or (`mesh.teeth` > 1) by one sector, in mm, N, tonnes and s."""
    lines = ["*NODE, NSET=ALL", *node_lines(mesh.nodes, digits=14)]
    lines += ["*ELEMENT, TYPE=C3D20, ELSET=BODY", *element_lines(mesh.elements + 1)]
    elastic = f"{1e-6 * material.youngs_modulus:.12g}, {material.poisson_ratio:.12g}"
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", elastic]
    lines += ["*DENSITY", f"{1e-12 * material.density:.12g}", "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL"]
    symmetry, choice = _symmetry(mesh) if mesh.teeth > 1 else ([], [])
    lines += [*symmetry, "*STEP", "*FREQUENCY", f"{COUNT + RIGID}", *choice, "*END STEP"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _symmetry(sector: FeMesh) -> tuple[list[str], list[str]]:
    """CalculiX's cyclic symmetry about z: the tie of both cuts, and the choice of all nodal diameters in the step."""
    lines = []
    for name, cut in (("MINUS", sector.cut_minus), ("PLUS", sector.cut_plus)):
        lines += [f"*NSET, NSET={name}", *(f"{node}," for node in cut + 1), f"*SURFACE, NAME=S{name}, TYPE=NODE", name]
    lines += ["*TIE, NAME=CUT, CYCLIC SYMMETRY, POSITION TOLERANCE=1e-3", "SMINUS, SPLUS"]
    lines += [f"*CYCLIC SYMMETRY MODEL, N={sector.teeth}, TIE=CUT", "0, 0, 0, 0, 0, 1"]
    return lines, [f"*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX={sector.teeth // 2}"]


def frequencies(path: Path) -> np.ndarray:
    """Elastic frequencies (Hz) of a .dat file: the table of eigenvalues without the six rigid modes."""
    text = path.read_text(encoding="ascii")
    rows = re.findall(r"^\s+\d+\s+(\S+)(?:\s+\S+){3}\s*$", text.split("E I G E N V A L U E")[1], re.MULTILINE)
    values = np.array([float(row) for row in rows[: COUNT + RIGID]])
    assert len(values) == COUNT + RIGID and np.all(np.abs(values[:RIGID]) < 1e-4 * values[RIGID])
    return np.sqrt(values[RIGID:]) / (2 * np.pi)


def sector_frequencies(path: Path, teeth: int) -> np.ndarray:
    """The same of a .dat file of one sector: a table for each nodal diameter. CalculiX lists real modes, those of
    diameter 0 and half the teeth, twice as well."""
    found = []
    for diameter, table in enumerate(path.read_text(encoding="ascii").split("E I G E N V A L U E")[1:]):
        rows = re.findall(rf"^ +{diameter} +\d+ +(\S+) +\S+ +\S+ +\S+\s*$", table, re.MULTILINE)
        values = np.array([float(row) for row in rows])[:: 2 if 2 * diameter in (0, teeth) else 1]
        rigid = {0: 2, 1: 4}.get(diameter, 0)
        assert len(values) >= COUNT / 2 and np.all(np.abs(values[:rigid]) < 1e-4 * values[rigid])
        found.append(values[rigid:])
    assert len(found) == teeth // 2 + 1
    return np.sqrt(np.sort(np.concatenate(found))[:COUNT]) / (2 * np.pi)


def solved(case: Case, known: list[dict[str, str]]) -> list[dict[str, Any]]:
    """The table's rows of a case, made by running it; `known` ones that come from the same deck stay."""
    material, sector = body_of(case)
    mesh = sector if case.by_sector else sector.full()
    deck = deck_path(f"frequencies_{case.name}")
    write_deck(mesh, material, deck)
    made = digest(deck)
    if known and all(row["deck_sha256"] == made for row in known):
        return known
    seconds = run(deck)
    result = deck.with_suffix(".dat")
    found = sector_frequencies(result, sector.teeth) if case.by_sector else frequencies(result)
    size = {"nodes": len(mesh.nodes), "elements": len(mesh.elements)}
    head, tail = {"case": case.name}, size | {"seconds": f"{seconds:.0f}", "deck_sha256": made}
    return [head | {"mode": k, "frequency_Hz": f"{f:.4f}"} | tail for k, f in enumerate(found, start=1)]


def main() -> None:
    require_ccx()
    table: dict[str, list[dict[str, Any]]] = {name: [] for name in CASES}
    for row in read_rows(TABLE):
        table[row["case"]].append(row)
    for name, known in table.items():
        table[name] = fresh = solved(CASES[name], known)
        write_rows(TABLE, [row for rows in table.values() for row in rows])
        kept = " (of the same deck)" if fresh is known else ""
        print(f"{name}: {fresh[0]['nodes']} nodes, {fresh[0]['seconds']} s{kept}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
