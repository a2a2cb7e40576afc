"""A small but complete stage model: the shipped FZG pair with bodies of a few invented modes, a tooth-bending family.

The numbers are of the right size (tooth stiffness, frequencies), the tables consistent (static compliance = modes and a
local part, positive semidefinite), the blob small and quickly made: for tests of the FMU, not of the physics."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from handmade import mass_matrix, toothed

from evidence.fmu_probes.probes import Subject
from gearfmu.body import Body
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.expand import rewritten, with_ports
from gearfmu.stagefile.stage import load_stage

ROLLS, FUNCTIONS = 6, 3
TOOTH_FREQUENCY = 40e3
BENDING, LOCAL = 1.2e-9, 1.0e-9  # m/N at the tip
DENSITY = 7850.0


def small_model(stage: str = "fzg_c/stage_relief", name: str | None = None, **ports: dict) -> StageModel:
    """The stage's model on invented bodies; ports: fields to change by shaft, e.g. wheel={"kind": "torque"}."""
    spec = load_stage(stage)
    changed = {shaft: port.model_copy(update=ports.get(shaft, {})) for shaft, port in spec.ports.items()}
    spec = rewritten(with_ports(spec, changed), name=name or spec.name)
    geometry = spec.written.geometry
    return assemble(spec, [body(spec.gears[i], geometry.gears[i]) for i in (0, 1)])


def references(subject: Subject) -> dict[str, int]:
    """Value references of an FMU's variables by name."""
    return {v.name: v.valueReference for v in subject.variables}


def unpack(fmu: Path, target: Path) -> str:
    """Unpack `fmu`; returns the folder as text."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(target)
    return str(target)


def body(gear, shape) -> Body:
    """A gear whose modes are one pattern of a tooth, by nodal diameter."""
    z = gear.teeth
    diameters = np.concatenate([[0], np.repeat(np.arange(1, (z + 1) // 2), 2), [z // 2] * (z % 2 == 0)]).astype(int)
    n = diameters.size
    part = np.array([0] + [1, 2] * ((n - 1) // 2) + [0] * ((n - 1) % 2))
    frequency = TOOTH_FREQUENCY * (1 + 0.02 * diameters)
    k = np.arange(ROLLS)[::-1]
    roll = (shape.s_form + shape.s_tip) / 2 + (shape.s_tip - shape.s_form) / 2 * np.cos(np.pi * (k + 0.5) / ROLLS)
    shape_of_roll = (roll / shape.s_tip) ** 2
    rows = np.zeros((2, ROLLS, FUNCTIONS, n))
    amplitude = np.sqrt(BENDING / z) * 2 * np.pi * frequency * np.where(part > 0, np.sqrt(2.0), 1.0)
    rows[0, :, 0] = shape_of_roll[:, None] * (amplitude * (part < 2))
    rows[1] = -rows[0]
    flank = {
        "teeth": z,
        "r_b": shape.r_b,
        "face_width": gear.face_width,
        "strip_half_width": gear.body.strip_half_width,
        "diameter": diameters,
        "part": part,
        "roll": roll,
        "rows": rows,
        "static": _static(rows, frequency, diameters, z),
        "node": np.zeros((2, ROLLS, FUNCTIONS, 6)),
    }
    return toothed(
        gear.name,
        flank,
        _mass(gear),
        f"{z:064x}",
        frequency=frequency,
        damping_ratio=np.full(n, gear.modal_damping),
        rows=np.zeros((6, n)),
        static=1e-11 * np.eye(6),
    )


def _mass(gear) -> np.ndarray:
    r, r0 = gear.tip_diameter / 2, gear.bore_diameter / 2
    mass = DENSITY * np.pi * (r**2 - r0**2) * gear.face_width
    return mass_matrix(mass, np.diag([0.3, 0.3, 0.5]) * mass * (r**2 + r0**2))


def _static(rows: np.ndarray, frequency: np.ndarray, diameters: np.ndarray, z: int) -> np.ndarray:
    """Modes of all tooth offsets, plus a part that only the loaded tooth and flank feel."""
    turn = np.cos(2 * np.pi * np.outer(np.arange(z), diameters) / z) / (2 * np.pi * frequency) ** 2
    static = np.einsum("fian,mn,gjbn->fgmijab", rows, turn, rows)
    for function in range(FUNCTIONS):
        static[0, 0, 0, :, :, function, function] += LOCAL / (1 + 3 * function) * (0.1 + 0.9 * np.eye(ROLLS))
        static[1, 1, 0, :, :, function, function] += LOCAL / (1 + 3 * function) * (0.1 + 0.9 * np.eye(ROLLS))
    return static
