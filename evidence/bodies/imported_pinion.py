"""The pinion of fzg_c, exported and imported again by every method: frequencies and loaded transmission error
against the native body on the same mesh. Writes imported_pinion.csv; the rows with CalculiX need `ccx`."""

from __future__ import annotations

import argparse
import csv
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import scipy.sparse as sp

from gearfmu.body import ReducedBody, load_bodies, reduce_body
from gearfmu.fem import solids
from gearfmu.femesh import FeMesh, gear_sector, write_vtu
from gearfmu.femesh.deck import write_deck
from gearfmu.geometry import GearGeometry
from gearfmu.spec.reading.library import find_stage
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import assemble, loaded_te

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tests" / "imports"))
from gears import tetrahedra  # noqa: E402

TORQUE, POSITIONS, COMPARED = 302.0, 12, 60
SETTINGS = {
    "modes = 400": "modes = 120",
    "roll_points = 28": "roll_points = 16",
    "# scale": "scale",
    "flank = 20": "flank = 20\nscale = 0.5",
}
SECTION = '[gears.pinion.import]\nlength = "1 mm"\nfile = "pinion{}"\n{}\n'
READY = 'stiffness = "pinion{}"\nmass = "pinion{}"\n{}mass_unit = "1 t"'


def stage(folder: Path, section: str = "") -> StageSpec:
    text = find_stage("fzg_c").read_text(encoding="utf-8")
    head, rest = text.split("[gears.wheel]")
    for old, new in SETTINGS.items():
        head = head.replace(old, new)
    (folder / "stage.toml").write_text(f"{head}{section}\n[gears.wheel]{rest}", encoding="utf-8")
    return load_stage(folder / "stage.toml")


def deck(folder: Path, mesh: FeMesh, material: dict | None = None) -> str:
    write_deck(mesh, folder / "pinion.inp", material)
    return SECTION.format(".inp", 'bore = "BORE"')


def vtu(folder: Path, mesh: FeMesh) -> str:
    write_vtu(mesh, folder / "pinion.vtu")
    return SECTION.format(".vtu", 'bore = "bore"').replace("1 mm", "1 m")


def calculix(folder: Path, mesh: FeMesh, material: dict) -> str:
    section = deck(folder, mesh, material)
    subprocess.run(["ccx", "pinion"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return section + READY.format(".sti", ".mas", 'unknowns = "pinion.dof"\n') + "\n"


def matrices(folder: Path, mesh: FeMesh, material: object) -> str:
    stiffness, mass = solids.assemble(mesh.nodes, {"hexahedron20": mesh.elements}, material)
    sp.save_npz(folder / "pinionk.npz", sp.csr_matrix(1e-3 * stiffness))
    sp.save_npz(folder / "pinionm.npz", sp.csr_matrix(1e-3 * mass))
    return deck(folder, mesh) + READY.format("k.npz", "m.npz", "") + "\n"


def tet10(folder: Path, mesh: FeMesh) -> str:
    points, cells = tetrahedra(mesh)
    meshio.Mesh(points, [("tetra10", cells)]).write(folder / "pinion.vtu")
    return SECTION.format(".vtu", "").replace("1 mm", "1 m")


def hex8(folder: Path, mesh: FeMesh) -> str:
    corners, cells = np.unique(mesh.elements[:, :8], return_inverse=True)
    meshio.Mesh(mesh.nodes[corners], [("hexahedron", cells.reshape(-1, 8))]).write(folder / "pinion.vtu")
    return SECTION.format(".vtu", "").replace("1 mm", "1 m")


def keyway(folder: Path, mesh: FeMesh) -> str:
    """Without the elements on the bore within one pitch of tooth 0."""
    middle = mesh.nodes[mesh.elements].mean(axis=1)
    radius, angle = np.hypot(middle[:, 0], middle[:, 1]), np.arctan2(middle[:, 1], middle[:, 0])
    near = (radius < 1.05 * radius.min()) & (np.abs(angle) < np.pi / 16)
    used, cells = np.unique(mesh.elements[~near], return_inverse=True)
    meshio.Mesh(mesh.nodes[used], [("hexahedron20", cells.reshape(-1, 20))]).write(folder / "pinion.vtu")
    return SECTION.format(".vtu", "").replace("1 mm", "1 m")


def cases(sector: FeMesh, material: object) -> dict[str, Callable[[Path], str]]:
    whole = sector.full()
    return {
        "meshed here": lambda folder: "",
        "sector, .inp": lambda folder: deck(folder, sector),
        "sector, .vtu": lambda folder: vtu(folder, sector),
        "sector, K and M of CalculiX": lambda folder: calculix(folder, sector, material.model_dump()),
        "sector, hex8 raised to hex20": lambda folder: hex8(folder, sector),
        "sector, tet10": lambda folder: tet10(folder, sector),
        "whole gear, .inp": lambda folder: deck(folder, whole),
        "whole gear, K and M in .npz": lambda folder: matrices(folder, whole, material),
        "whole gear with a keyway": lambda folder: keyway(folder, whole),
    }


def row(name: str, spec: StageSpec, body: ReducedBody, native: ReducedBody, wheel: ReducedBody) -> dict:
    te = 1e6 * loaded_te(assemble(spec, [body, wheel]), [TORQUE], POSITIONS, rigid_bearings=True).te[0]
    facts = body.mesh
    unequal = facts.get("teeth_deviation", 0.0) > 1e-3  # its oscillators cannot be numbered like the native modes
    middle = len(body.roll) // 2
    own, other = (b.static_ff[0, 0, 0, middle, middle, 0, 0] for b in (body, native))
    return {
        "case": name,
        "method": facts.get("method", "native"),
        "dof_body": facts["dof_body"],
        "cpu_s": body.provenance["cpu_s"],
        "fit_max_um": f"{facts['fit']['residual_max_um']:.1e}" if "fit" in facts else "",
        "frequencies_off": ""
        if unequal
        else f"{np.abs(body.frequency[:COMPARED] / native.frequency[:COMPARED] - 1).max():.1e}",
        "tooth_compliance_off": f"{own / other - 1:.1e}",
        "te_mean_um": f"{te.mean():.4f}",
        "te_peak_to_peak_um": f"{np.ptp(te):.4f}",
        "teeth_off_their_mean": f"{facts['teeth_deviation']:.1e}" if "teeth_deviation" in facts else "",
        "frf_error": f"{body.frf.max_error:.1e}",
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "imported_pinion.csv")
    out = parser.parse_args().out
    wheel = load_bodies(load_stage("fzg_c"))[1]
    rows: list[dict] = []
    native: ReducedBody | None = None
    with tempfile.TemporaryDirectory() as scratch:
        spec = stage(Path(scratch))
        gear = spec.gears[0]
        sector = gear_sector(GearGeometry.of(gear, spec.pair), gear.face_width, gear.body.mesh)
        for name, make in cases(sector, gear.material).items():
            if "CalculiX" in name and shutil.which("ccx") is None:
                print(f"{name}: left out, apt-get install calculix-ccx")
                continue
            folder = Path(tempfile.mkdtemp(dir=scratch))
            section = make(folder)
            spec = stage(folder, section)
            body = reduce_body(spec, "pinion")
            native = native or body
            rows.append(row(name, spec, body, native, wheel))
            print("  ".join(f"{key} {value}" for key, value in rows[-1].items() if value != ""), flush=True)
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
