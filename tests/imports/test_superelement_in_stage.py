"""From a deck of CalculiX to motion, report and sound: a train in a housing whose matrices CalculiX wrote is the train
in the housing that this program makes of the same mesh."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from bored import BORES, SENSORS, Block, block
from decks import write_deck

import gearfmu as gf
from gearfmu.fem.coupling import rigid_fields
from gearfmu.fem.matrices import read_unknowns
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.reading.files import find_stage

HOUSED = "two_stage/stage_housed"
BANDS = {"left": (0, 28), "right": (100, 168)}  # mm along the shafts
BEARINGS = {"input": (10, 110), "intermediate": (10, 125), "output": (20, 160)}
SEATS = {f"{bore}_{side}": (bore, *band) for bore in BEARINGS for side, band in BANDS.items()}
FEET = [f"foot{k}" for k in range(4)]
MOVED, TURNED = 9001, 9101  # first nodes of the rigid bodies
STEP = """*MATERIAL, NAME=CAST
*ELASTIC
72000., 0.33
*DENSITY
2.7e-9
*SOLID SECTION, ELSET=EALL, MATERIAL=CAST
*STEP
*FREQUENCY, SOLVER=MATRIXSTORAGE
10
*END STEP
"""


def deck(folder: Path) -> tuple[Block, np.ndarray]:
    """The block of second order as mesh.inp, and as job.inp with a rigid body for every seat and foot; and the places
    (10, 3) mm where those move."""
    made = block((0, 28, 100, 168), SEATS)
    cells, sets = {"hexahedron20": made.cells}, {name.upper(): own for name, own in made.sets.items()}
    write_deck(folder / "mesh.inp", made.nodes, cells, sets)
    places = [(*BORES[bore].axis, z) for bore, own in BEARINGS.items() for z in own]
    places += [tuple(made.nodes[made.sets[name]].mean(axis=0)) for name in FEET]
    tail = ["*NODE"]
    for k, point in enumerate(places):
        tail += [f"{first + k}, " + ", ".join(f"{x:.9g}" for x in point) for first in (MOVED, TURNED)]
    for k, name in enumerate([*SEATS, *FEET]):
        tail.append(f"*RIGID BODY, NSET={name.upper()}, REF NODE={MOVED + k}, ROT NODE={TURNED + k}")
    write_deck(folder / "job.inp", made.nodes, cells, sets, "\n".join([*tail, STEP]))
    return made, np.array(places)


def skin(folder: Path, made: Block, places: np.ndarray) -> None:
    """outside.bdf, and recovery.mtx of those of its points that rigid bodies have: they are no unknowns of CalculiX."""
    used = np.unique(made.skin)
    cards = [f"GRID,{n + 1},," + ",".join(f"{x:.9g}" for x in made.nodes[n]) for n in used]
    cards += [f"CQUAD4,{k},1," + ",".join(str(n + 1) for n in face) for k, face in enumerate(made.skin, 1)]
    (folder / "outside.bdf").write_text("\n".join(["BEGIN BULK", *cards, "ENDDATA", ""]), encoding="ascii")
    rows = [(int(label), int(c)) for label, c in read_unknowns(folder / "job.dof")]
    found, labels = [], []
    for k, name in enumerate([*SEATS, *FEET]):
        columns = [rows.index((first + k, c)) for first in (MOVED, TURNED) for c in range(3)]
        for n in made.sets[name]:
            moved = np.zeros((3, len(rows)))
            moved[:, columns] = rigid_fields(made.nodes[n] - places[k])
            found.append(moved)
            labels += [f"{n + 1}.{c}" for c in (1, 2, 3)]
    scipy.io.mmwrite(folder / "recovery.mtx", sp.coo_array(np.vstack(found)), precision=16)
    (folder / "recovery.txt").write_text("\n".join(labels) + "\n", encoding="ascii")


def inline(field: str, values: dict) -> str:
    return f"{field} = {{ {', '.join(f'{name} = {value}' for name, value in values.items())} }}"


def ours() -> str:
    sets = {"seats": SEATS, "feet": FEET, "sensors": SENSORS}
    named = [inline(field, {name: f'"{name.upper()}"' for name in own}) for field, own in sets.items()]
    table = ['file = "mesh.inp"', 'length = "1 mm"', 'skin = "OUTSIDE"', 'seat_coupling = "rigid"', *named]
    material = 'material = { youngs_modulus = "72 GPa", poisson_ratio = 0.33, density = "2700 kg/m^3" }'
    return "\n".join([material, 'method = "modal"', "[bodies.housing.import]", *table])


def of_calculix(made: Block) -> str:
    number = {name: k for k, name in enumerate([*SEATS, *FEET])}
    points = {
        "seats": {name: MOVED + number[name] for name in SEATS},
        "feet": {name: MOVED + number[name] for name in FEET},
        "rotations": {name: TURNED + k for name, k in number.items()},
        "sensors": {name: int(made.sets[name][0]) + 1 for name in SENSORS},
    }
    named = [inline(field, own) for field, own in points.items()]
    files = {
        "file": "job.inp", "length": "1 mm", "mass_unit": "1 t", "stiffness": "job.sti", "mass": "job.mas",
        "unknowns": "job.dof", "recovery": "recovery.mtx", "recovered": "recovery.txt", "surface": "outside.bdf",
    }  # fmt: skip
    return "\n".join(["[bodies.housing.reduced]", *(f'{key} = "{file}"' for key, file in files.items()), *named])


def run(folder: Path, name: str, housing: str) -> tuple[Trace, Path, float]:
    """The train in a housing of that table for 20 ms, its stage file, and its sound power level, dB."""
    text = find_stage(HOUSED).read_text(encoding="utf-8")
    own = f'[bodies.housing]\nkind = "housing"\nmodes = 120\ndynamic_to = "8 kHz"\n{housing}\n\n'
    text = re.sub(r"\[bodies\.housing\].*?(?=\[\[supports\]\])", own, text, count=1, flags=re.DOTALL)
    stage = folder / f"{name}.toml"
    stage.write_text(text.replace('base = "stage.toml"', 'base = "base.toml"'), encoding="utf-8")
    (folder / "housing.h5").unlink(missing_ok=True)
    gf.reduce(gf.load(stage))
    trace = gf.simulate(stage, "100 N*m", "1500 rpm", "20 ms", level="fast", step="25 us")
    return trace, stage, float(gf.sound_power(trace, stage, start="5 ms").total()[0])


@pytest.mark.full
@pytest.mark.needs("ccx")
def test_a_train_in_a_housing_of_calculix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces, accelerations, report and sound power. Margin: 9e-6 of a sensor, 1e-7 of the mesh
    force, 5e-7 dB."""
    monkeypatch.setattr("gearfmu.body.sound.PATCHES", 150)
    library = find_stage("two_stage").parent
    shutil.copy(library / "stage.toml", tmp_path / "base.toml")
    for body in (path for path in library.glob("*.h5") if "housing" not in path.name):
        shutil.copy(body, tmp_path)
    made, places = deck(tmp_path)
    subprocess.run(["ccx", "job"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    skin(tmp_path, made, places)
    runs = [run(tmp_path, name, table) for name, table in (("ours", ours()), ("calculix", of_calculix(made)))]
    (one, _, power), (other, stage, heard) = runs
    page = gf.write_report(other, tmp_path / "report", stage=stage)
    assert "Sound power" in page.read_text(encoding="utf-8")
    assert heard == pytest.approx(power, abs=1e-3)
    ends = {
        "sensor": (".ax", ".ay", ".az"),
        "mount": (".fx", ".fy", ".fz"),
        "stage1": (".force",),
        "stage2": (".force",),
    }
    for group, ending in ends.items():
        own = [name for name in one.channels if name.startswith(group) and name.endswith(ending)]
        found, wanted = (np.stack([of[name] for name in own]) for of in (other, one))
        assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max(), group
