"""Quasi-static transmission error and load sharing of a planetary set over one mesh period, by the contact routine of
the step.

In the axes of the carrier everything repeats after one mesh period: sun and ring have moved on by one tooth each, and
the mounts of the ring are smeared round its rim. Where pins stand in their places, a planet does a part of the period
later what the others do: its mean share over the period is 1."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.errors import ModelError
from gearfmu.geometry.planetary import set_ratio
from gearfmu.kernel import Kernel, TeState
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.shapes import gear_shape, toothed
from gearfmu.stage.build.model import StageModel
from gearfmu.stage.run.limits import each_load
from gearfmu.stage.run.place import place_of
from gearfmu.stage.run.te import (
    LEAST,
    TANGENT,
    LoadedResult,
    TeResult,
    common_columns,
    error_text,
    loaded_te,
    plot_te,
    statics_of,
)

GEARS = ("sun", "ring")  # whose meshes with the planets share the load


@dataclass(frozen=True, repr=False)
class SetTeResult(LoadedResult):
    """torque (T,) N·m · position (P,) in mesh periods · te (T, P) m · stage_stiffness (T, P) N/m, tangent
    d(T_s/r_bs)/dte of all meshes with carrier and bearings · sharing (T, P, 2, N): normal force of each planet over the
    mean of all, at the sun and at the ring · force (T, P, 2) N, that mean · failed (T,): why a torque has no
    equilibrium, "" where it has one; its rows are NaN then."""

    torque: np.ndarray
    position: np.ndarray
    te: np.ndarray
    stage_stiffness: np.ndarray
    sharing: np.ndarray
    force: np.ndarray
    failed: tuple[str, ...]

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For every torque the error, then K_γ at sun and ring with the mean share of each planet."""
        rows = []
        for torque, row, stiffness, factor, sharing, why in zip(
            self.torque, self.te, self.stage_stiffness, self.load_factor, self.sharing, self.failed, strict=True
        ):
            if why:
                rows.append((f"{torque:.1f} N·m", why))
                continue
            mean = f"stage stiffness at the sun's base circle {1e-6 * stiffness.mean():.1f} N/µm"
            rows.append((f"{torque:.1f} N·m", f"{error_text(row)}, {mean}"))
            for gear, most, shares in zip(GEARS, factor, sharing.mean(axis=0), strict=True):
                means = " ".join(f"{share:.3f}" for share in shares)
                rows.append(("", f"{gear}: K_gamma {most:.3f}; means of planets 1 … {len(shares)}: {means}"))
        return rows

    def plot(self, figure: Any = None) -> np.ndarray:
        """Draw transmission error about its mean and shares of the planets at the largest torque over the mesh period
        with matplotlib; returns the axes. figure : of matplotlib, a new one when None."""
        found = self.found
        most = found.sharing[np.argmax(np.abs(found.torque))]
        shares = {
            f"{gear}: force over the mean": {f"planet {k + 1}": row for k, row in enumerate(most[:, g].T)}
            for g, gear in enumerate(GEARS)
        }
        return plot_te(found, shares, figure)

    @property
    def load_factor(self) -> np.ndarray:
        """(T, 2): mesh load factor K_γ (ISO 6336-1) at sun and ring, the largest share at any position."""
        return self.sharing.max(axis=(1, 3))

    def columns(self) -> dict[str, np.ndarray]:
        """The table of the result, torques one below the other: torque_Nm, position, te_um, stage_stiffness_N_per_um,
        sun_force_N and ring_force_N of the mean planet, sun_share_1 …, ring_share_1 …"""
        found = common_columns(self) | {"stage_stiffness_N_per_um": 1e-6 * self.stage_stiffness.ravel()}
        found |= {f"{gear}_force_N": self.force[:, :, g].ravel() for g, gear in enumerate(GEARS)}
        for g, gear in enumerate(GEARS):
            found |= {f"{gear}_share_{k + 1}": self.sharing[:, :, g, k].ravel() for k in range(self.sharing.shape[3])}
        return found


def set_error(stage: Stage) -> tuple[float, float]:
    """(r_b,s, 1 + z_r/z_s) of te = r_b,s (φ_s − (1 + z_r/z_s) φ_c), the transmission error of a planetary set."""
    sun, ring = (toothed(stage, name) for name in GEARS)
    return gear_shape(sun).r_b, set_ratio(sun.teeth, ring.teeth)


def stage_te(
    model: StageModel,
    torques: Sequence[float],
    positions: int = 41,
    rigid_bearings: bool = False,
    mesh: str | None = None,
    pitches: int = 1,
    **parameters: float,
) -> TeResult | SetTeResult:
    """`set_te` of a stage with a carrier, of which bearings and mesh mean nothing; `loaded_te` of any other."""
    if model.stage.carriers:
        return set_te(model, torques, positions, pitches, None, **parameters)
    return loaded_te(model, torques, positions, rigid_bearings, mesh, pitches, **parameters)


def set_te(
    model: StageModel,
    torques: Sequence[float],
    positions: int = 41,
    periods: int = 1,
    progress: Callable[[float, str], None] | None = None,
    **parameters: float,
) -> SetTeResult:
    """te = r_b,s (φ_s − (1 + z_r/z_s) φ_c), angles of the bores of sun and carrier, at positions i/N of one mesh period
    or of more (no end point), the output held. Without load it is ± the mean backlash of the two meshes along the line
    of action.

    torques: N·m on the input, the first port; 0 is the limit of a vanishing positive torque. progress: called with the
    part done and the torque. parameters: of the kernel, e.g. slices=10. ModelError where the stage is no planetary set.
    A torque without equilibrium is named in `failed` with its limit; SimulationError(no_equilibrium) where none has
    one.
    """
    if not model.stage.carriers:
        raise ModelError(f"{model.name} is no planetary set: its meshes have transmission errors of their own")
    kernel, place = statics_of(model, **parameters), place_of(model, f"{GEARS[0]}_planet1")
    least, position = LEAST * place.most, np.arange(periods * positions) / positions
    planets = len(model.stage.engagements) // len(GEARS)
    te, stiffness = np.empty((2, len(torques), position.size))
    force = np.empty((len(torques), position.size, len(GEARS), planets))

    def solve(i: int, torque: float) -> None:
        carried = torque if abs(torque) >= least else math.copysign(least, torque)
        for j, part in enumerate(position):
            at = -part * place.pitch
            if progress:
                progress((i + j / position.size) / len(torques), f"{torque:g} N·m")
            error = _error(model, kernel, at, carried)
            force[i, j] = _forces(kernel, at, carried, planets)
            ends = [_error(model, kernel, at, carried * (1 + sign * TANGENT), keep=True) for sign in (-1, 1)]
            tangent = 2 * TANGENT * carried / (ends[1] - ends[0])
            te[i, j] = error + (torque - carried) / tangent
            stiffness[i, j] = abs(tangent / place.lever) * planets

    failed = each_load(model, torques, solve)
    for values in (te, stiffness, force):
        values[[bool(why) for why in failed]] = np.nan
    mean = force.mean(axis=3)
    return SetTeResult(np.asarray(torques, float), position, te, stiffness, force / mean[..., None], mean, failed)


def _error(model: StageModel, kernel: Kernel, at: float, torque: float, keep: bool = False) -> float:
    """te (m), the output's bore at an angle (rad)."""
    shafts, (r_b, ratio) = model.shafts, set_error(model.stage)
    phi = {shafts.input: kernel.transmission(at, torque, keep=keep).phi, shafts.output: at}
    return float(r_b * (phi["sun"] - ratio * phi["carrier"]))


def _forces(kernel: Kernel, at: float, torque: float, planets: int) -> np.ndarray:
    """(2, N): normal forces at sun and ring, going on from the last equilibrium; engagements are those of the sun, then
    those of the ring."""
    states = [kernel.transmission(at, torque, mesh, keep=True) for mesh in range(len(GEARS) * planets)]
    return np.array([_total(state) for state in states]).reshape(len(GEARS), planets)


def _total(state: TeState) -> float:
    return sum(sum(slices) for slices in state.forces.values())
