"""InterfaceBody: a free body that is loaded at interface nodes only (carrier, shaft, housing), reduced; its file.

Oscillators in the mean-axis frame, rigid motion explicit, static compliance of the full model (docs/architecture.md,
docs/file-formats.md). What it was reduced with, and how well it follows its finite elements, is part of it.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.body.layout import ALGORITHM_VERSION, Entry
from gearfmu.body.packing import write_entry
from gearfmu.body.sensed import Sensors, Skin, read_sensed, sensed_problems, write_sensed
from gearfmu.errors import BodyError
from gearfmu.hdf5 import Format, reading, writing

FORMAT = "gearfmu-interface-body"
FORMAT_VERSION = 1
FILE = Format(FORMAT, FORMAT_VERSION, "body", BodyError, "make it again with 'gearfmu reduce STAGE'")


@dataclass(frozen=True)
class InterfaceBody:
    """A free body with m interface rows and n oscillators; shapes, units and meaning: `ENTRIES`.

    interfaces : one entry an interface, in row order: name, kind ("rigid", "averaging", "nodes"), components.
    ground : interfaces held when the error was measured. method, provenance : how it was made. Raises BodyError naming
    every array that cannot be.
    """

    name: str
    input_hash: str
    method: str
    interfaces: tuple[dict[str, Any], ...]
    ground: tuple[str, ...]
    material: dict[str, Any]
    mesh: dict[str, Any]
    provenance: dict[str, Any]
    rigid_mass: np.ndarray
    point: np.ndarray
    rigid_rows: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray
    rows: np.ndarray
    static: np.ndarray
    frf_frequency: np.ndarray
    frf_error: np.ndarray
    length: float
    trusted_to: float
    algorithm_version: int = ALGORITHM_VERSION
    sensors: Sensors | None = None
    skin: Skin | None = None

    def __post_init__(self) -> None:
        if problems := _problems(self):
            raise BodyError(f"body '{self.name}' is not valid: " + "; ".join(problems))

    @property
    def modes(self) -> int:
        """Number n of oscillators."""
        return len(self.frequency)

    @property
    def mass(self) -> float:
        """kg."""
        return float(self.rigid_mass[0, 0])

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) m."""
        return np.array([self.rigid_mass[1, 5], self.rigid_mass[2, 3], self.rigid_mass[0, 4]]) / self.mass

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3) about the origin, kg·m²."""
        return self.rigid_mass[3:, 3:]

    @property
    def max_error(self) -> float:
        """Largest relative error of the transfer matrix over its lines."""
        return float(self.frf_error.max())

    @property
    def band(self) -> tuple[float, float]:
        """Hz, over which the error was measured."""
        return float(self.frf_frequency[0]), float(self.frf_frequency[-1])


ENTRIES = (
    Entry("body/rigid_mass", "rigid_mass", (6, 6), "kg, kg.m, kg.m2", "mass matrix of rigid motion about the origin"),
    Entry("interfaces/point", "point", ("I", 3), "m", "where each interface lies"),
    Entry("interfaces/rigid_rows", "rigid_rows", ("m", 6), "1, m, 1", "rows of rigid motion about the origin"),
    Entry("modes/frequency", "frequency", ("n",), "Hz", "frequencies of the oscillators, ascending, none rigid"),
    Entry("modes/damping_ratio", "damping_ratio", ("n",), "", "modal damping ratio"),
    Entry("modes/rows", "rows", ("m", "n"), "kg-1/2, m-1.kg-1/2", "displacement and rotation of the interfaces"),
    Entry("static/c", "static", ("m", "m"), "m/N, 1/N, 1/(N.m)", "compliance; inertia relief, mean-axis gauge"),
    Entry("frf/frequency", "frf_frequency", ("F",), "Hz", "frequency lines of the error"),
    Entry("frf/error", "frf_error", ("F",), "", "relative Frobenius error with the ground held (paper eq. 3)"),
    Entry("frf/length", "length", (), "m", "length by which rotations are multiplied"),
    Entry("frf/trusted_to", "trusted_to", (), "Hz", "the error stays below 1 % up to this frequency"),
)
TEXTS = {
    "method": "method of reduction",
    "interfaces": "name, kind (rigid: RBE2, averaging: RBE3, nodes) and components of each interface, in row order",
    "ground": "interfaces held when the error was measured",
    "material": "material: youngs_modulus (Pa), poisson_ratio, density (kg/m³)",
    "mesh": "finite-element mesh: element counts, degrees of freedom, quality",
    "provenance": "program versions, time and memory of the reduction",
}


def save_interface_body(body: InterfaceBody, path: str | os.PathLike[str]) -> None:
    """Write a body under a temporary name, then rename it to `path`."""
    with writing(path, FILE) as file:
        file.attrs["name"], file.attrs["input_hash"] = body.name, body.input_hash
        file.attrs["algorithm_version"] = body.algorithm_version
        for text in TEXTS:
            file.attrs[text] = json.dumps(getattr(body, text), sort_keys=True)
        for entry in ENTRIES:
            write_entry(file, entry, np.asarray(getattr(body, entry.field), dtype=entry.kind))
        write_sensed(file, body.sensors, body.skin)


def load_interface_body(path: str | os.PathLike[str]) -> InterfaceBody:
    """Read and check a body file. Raises BodyError: missing, damaged, of another kind or version, or not sound."""
    with reading(path, FILE) as file:
        values: dict[str, Any] = {e.field: file[e.path][()] if e.shape else float(file[e.path][()]) for e in ENTRIES}
        texts: dict[str, Any] = {name: json.loads(file.attrs[name]) for name in TEXTS}
        texts["interfaces"], texts["ground"] = tuple(texts["interfaces"]), tuple(texts["ground"])
        name, input_hash = (str(file.attrs[name]) for name in ("name", "input_hash"))
        version = int(file.attrs.get("algorithm_version", 1))  # files of the first version do not say it
        return InterfaceBody(
            name=name, input_hash=input_hash, algorithm_version=version, **texts, **values, **read_sensed(file)
        )


def interface_facts(body: InterfaceBody) -> dict[str, Any]:
    """Summary for `gearfmu inspect`: what the body can be trusted for, its size, mass and interfaces."""
    return {
        "name": body.name,
        "input_hash": body.input_hash,
        "algorithm_version": body.algorithm_version,
        "facts": {
            "method": body.method,
            "modes": body.modes,
            "frequency_range_Hz": [float(body.frequency[0]), float(body.frequency[-1])],
            "mass_kg": body.mass,
            "centre_of_mass_m": body.centre_of_mass.tolist(),
            "inertia_kgm2": np.diag(body.inertia).tolist(),
            "interfaces": {
                i["name"]: f"{i['kind']}, {len(i['components'])} components, at "
                + ", ".join(f"{1e3 * x:.3g}" for x in point)
                + " mm"
                for i, point in zip(body.interfaces, body.point, strict=True)
            },
        },
        "frf": {
            "band_Hz": list(body.band),
            "max_error": body.max_error,
            "trusted_to_Hz": body.trusted_to,
            "ground": list(body.ground),
            "length_scale_m": body.length,
        },
        "material": body.material,
        "mesh": body.mesh,
        "provenance": body.provenance,
        "datasets": [
            {"path": e.path, "shape": list(np.shape(getattr(body, e.field))), "unit": e.unit, "meaning": e.meaning}
            for e in ENTRIES
        ],
    }


def _problems(body: InterfaceBody) -> list[str]:
    problems, sizes = [], {"I": len(body.interfaces), "m": sum(len(i["components"]) for i in body.interfaces)}
    for entry in ENTRIES:
        value = np.asarray(getattr(body, entry.field))
        expected = tuple(s if isinstance(s, int) else sizes.get(s) for s in entry.shape)
        for symbol, length in zip(entry.shape, value.shape, strict=False):
            sizes.setdefault(str(symbol), length)
        fits = len(value.shape) == len(expected) and all(
            e in (None, n) for e, n in zip(expected, value.shape, strict=True)
        )
        if not fits:
            problems.append(f"{entry.path} has shape {value.shape}, expected {entry.shape}")
        elif not np.all(np.isfinite(value)):
            problems.append(f"{entry.path} holds a number that is not finite")
    if not problems and not (np.all(np.diff(body.frequency) >= 0) and body.frequency.min(initial=1.0) > 0):
        problems.append("modes/frequency must be above 0 and ascending")
    return problems + sensed_problems(body.sensors, body.skin, sizes["m"], len(body.frequency))
