"""StageSpec and reduced bodies → StageModel: the constant blob that the kernel runs. From here on no finite elements,
no HDF5."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.errors import ModelError
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.kernel import Kernel, Variable
from gearfmu.spec.gear import GearSpec
from gearfmu.spec.ports import PortSpec
from gearfmu.spec.stage import StageSpec, require_spur
from gearfmu.stage.blob import blob_hash, write_blob
from gearfmu.stage.tables import ROLLS, body_sections, resampling, symmetric_functions

MODEL_VERSION = 1
PAIR, FLAT = 0, 1
PORT_KINDS = {"spring": 0, "torque": 1, "fixed": 2}
H_MAX = 7.5e-6
FIXED_K = 1e7
SHARPEST_EDGE = 1e-6
BEARING_K = 16  # place of the bearing stiffness among the numbers of a gear
PORT_CHAIN = 1  # place of the chain's flag among the numbers of a port


@dataclass(frozen=True)
class StageModel:
    """A stage ready to run: the blob is all the kernel needs; spec and bodies' hashes say where it came from."""

    spec: StageSpec
    blob: bytes
    body_hashes: tuple[str, str]

    @property
    def name(self) -> str:
        return self.spec.name

    @property
    def hash(self) -> str:
        """SHA-256 of the blob, 64 hex digits."""
        return blob_hash(self.blob)

    def kernel(self, **parameters: float) -> Kernel:
        """A fresh instance; dots in parameter names are written as they are: kernel(**{"effect.hertz": 0})."""
        return Kernel(self.blob, parameters)

    def kernel_variables(self) -> list[Variable]:
        """All variables of this model in the order of the kernel's table."""
        return list(self.kernel().variables.values())


def assemble(spec: StageSpec, bodies: Sequence[Any], rolls: int = ROLLS) -> StageModel:
    """The model of `spec` with the reduced bodies of its gears, pinion first. rolls: of the even grid that carries
    rows and compliances along a flank.

    ModelError when a body does not belong to its gear: other numbers of teeth, base radius, face width or roll range.
    SpecError for a helical pair.
    """
    require_spur(spec)
    geometry = PairGeometry.of(spec)
    problems = [p for i in (0, 1) for p in _mismatches(spec.gears[i], geometry.gears[i], bodies[i])]
    if problems:
        raise ModelError("; ".join(problems) + ": make the bodies again with `gearfmu reduce`")
    degrees = symmetric_functions(min(body.flank_rows.shape[2] for body in bodies))
    sections: dict[str, Any] = {
        "model": np.array([MODEL_VERSION, PAIR, spec.contact.slices, _coast_shift(geometry)], np.int32),
        "name": spec.name,
        "shafts": "|".join(gear.name for gear in spec.gears),
        "degrees": degrees.astype(np.int32),
        "pair": np.array(
            [
                geometry.a,
                geometry.backlash,
                spec.contact.damping,
                spec.torque_max,
                spec.speed_max,
                spec.levels.fast_cut,
                spec.levels.standard_cut,
                H_MAX,
                geometry.nominal_backlash,
            ]
        ),
    }
    for i in (0, 1):
        gear, shape, body = spec.gears[i], geometry.gears[i], bodies[i]
        phase = geometry.wheel_phase if i else 0.0
        sections[f"gear{i}"] = _gear_numbers(gear, shape, body, phase)
        sections |= _index_numbers(i, gear, shape)
        sections[f"port{i}"] = _port_numbers(spec.ports[gear.name])
        sections |= body_sections(i, body, resampling(body.roll, shape.s_form, shape.s_tip, rolls), degrees)
    return StageModel(spec, write_blob(sections), tuple(body.input_hash for body in bodies))


def _mismatches(gear: GearSpec, shape: GearGeometry, body: Any) -> list[str]:
    pairs = {
        "teeth": (gear.teeth, body.teeth),
        "base radius": (shape.r_b, body.r_b),
        "face width": (gear.face_width, body.face_width),
        "load strip": (gear.body.strip_half_width, body.strip_half_width),
    }
    found = [
        f"body of {gear.name}: {what} {have:g} instead of {want:g}"
        for what, (want, have) in pairs.items()
        if not math.isclose(want, have, rel_tol=1e-9)
    ]
    if not shape.s_form - 1e-9 <= body.roll.min() <= body.roll.max() <= shape.s_tip + 1e-9:
        found.append(
            f"body of {gear.name}: its rolls {body.roll.min():g} … {body.roll.max():g} m "
            f"leave the flank {shape.s_form:g} … {shape.s_tip:g} m"
        )
    return found


def _gear_numbers(gear: GearSpec, shape: GearGeometry, body: Any, phase: float) -> np.ndarray:
    material, relief, edge = gear.material, gear.tip_relief, max(gear.tip_edge_radius, SHARPEST_EDGE)
    local = 2 * (1 - material.poisson_ratio**2) / (math.pi * material.youngs_modulus)
    start = relief.start_roll if relief else shape.s_a
    curve = relief.amount / (shape.s_a - start) ** 2 if relief else 0.0
    inner = shape.s_tip - edge
    mass, inertia = body.mass, body.inertia[2, 2]
    damping = 2 * gear.bearing.damping_ratio * math.sqrt(gear.bearing.stiffness * mass)
    return np.array(
        [
            gear.teeth,
            shape.r_b,
            shape.s_form,
            shape.s_tip,
            shape.psi_b,
            phase,
            mass,
            inertia,
            gear.face_width,
            local,
            gear.body.strip_half_width,
            curve,
            start,
            edge,
            math.hypot(shape.r_b, inner),
            shape.s_tip / shape.r_b - math.atan2(inner, shape.r_b),
            gear.bearing.stiffness,
            damping,
        ]
    )


def _index_numbers(index: int, gear: GearSpec, shape: GearGeometry) -> dict[str, np.ndarray]:
    """Angles (2 flanks, z) rad by which the teeth are out of their places; no section when all are in place."""
    if not any(gear.index_deviation.values()):
        return {}
    angles = np.zeros((2, gear.teeth))
    angles[:, list(gear.index_deviation)] = np.array(list(gear.index_deviation.values())) / shape.r
    return {f"index{index}": angles}


def _port_numbers(port: PortSpec) -> np.ndarray:
    chain = port.chain
    k = port.k if port.k is not None else FIXED_K if port.kind == "fixed" else 1.0
    numbers = [PORT_KINDS[port.kind], float(chain is not None), k, port.c or 0.0]
    return np.array(
        numbers + ([chain.inertia, chain.disc_inertia, chain.shaft_k, chain.shaft_c] if chain else [1.0, 1.0, 1.0, 0.0])
    )


def _coast_shift(geometry: PairGeometry) -> int:
    """The wheel's tooth number that faces the coast flank of the pinion's tooth 0: the one whose gap is the nominal
    backlash."""
    a, b = geometry.gears
    t = geometry.alpha_wt
    gaps = {
        shift: geometry.length
        + a.r_b * (-a.psi_b - t)
        + b.r_b * (geometry.wheel_phase + shift * 2 * math.pi / b.z - b.psi_b - t - math.pi)
        for shift in (-1, 0, 1)
    }
    return min(gaps, key=lambda shift: abs(gaps[shift]))
