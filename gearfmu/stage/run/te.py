"""Quasi-static loaded transmission error of an engagement over one pitch: output held, torque on the input, by the
contact routine of the step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from typing_extensions import Self

from gearfmu.geometry.iso6336 import mesh_stiffness
from gearfmu.kernel import Kernel, TeState
from gearfmu.spec.forms.general import GearBody, RingBody
from gearfmu.spec.forms.shapes import face_width, mesh_shape
from gearfmu.stage.build.model import StageModel
from gearfmu.stage.build.shown import Card, Shown, plot_over
from gearfmu.stage.run.limits import each_load
from gearfmu.stage.run.place import place_of

TANGENT = 1e-4
LEAST = 1e-5  # of torque_max: below it te goes on along its tangent to the unloaded pair
SHARES = 4
COMMON = ("position", "failed")  # of a result: not one row a torque
SOFTER = 0.9  # of the mesh stiffness of ISO: below it the reason is given
WHY_SOFTER = (
    ": teeth on discs that do not yield; here bodies, and the shafts of a train, twist and bend, and averaging bores "
    "lose their shape"
)


class LoadedResult(Shown):
    """What results of pairs and sets have in common. failed: for every torque why it has no static equilibrium, ""
    where it has one; its rows are NaN then."""

    torque: np.ndarray
    position: np.ndarray
    te: np.ndarray
    failed: tuple[str, ...]

    @property
    def card(self) -> Card:
        """How a session shows it: its size and its `rows`."""
        positions = f"Loaded transmission error, {len(self.torque)} torques at {self.position.size} positions"
        return Card(positions, self.rows, 2)

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For every torque its results in words."""
        raise NotImplementedError

    @property
    def found(self) -> Self:
        """The result without the torques that have no equilibrium."""
        kept = np.array([not why for why in self.failed], bool)
        rows = {name: value[kept] for name, value in vars(self).items() if np.ndim(value) and name not in COMMON}
        return replace(self, **rows | {"failed": ("",) * int(kept.sum())})  # type: ignore[type-var]

    @property
    def pitches(self) -> int:
        """Pitches that the positions cover."""
        return int(self.position[-1]) + 1

    def harmonics(self, count: int = 5) -> np.ndarray:
        """(T, K) m, rms: harmonics 1 … `count` of the mesh in the transmission error (`mesh_harmonics`)."""
        return mesh_harmonics(self.te, count, self.pitches)


@dataclass(frozen=True, repr=False)
class TeResult(LoadedResult):
    """torque (T,) N·m · position (P,) in pitches · te (T, P) m, positive under load · mesh_stiffness (T, P) N/m of the
    mesh alone, tangent dF/dte with F along the line of action and the bores held on their axes · stage_stiffness (T, P)
    N/m, the same tangent with shafts and bearings; with rigid bearings it is the mesh stiffness
    · shares (T, P, K): part of the mesh force that each tooth pair carries, pairs in the order in which they come
    into mesh: a pair keeps its column through the pitch, sorted by tooth number
    · over_width (T, S): force of each slice over the mean of all slices, mean over the positions · failed (T,): why a
    torque has no equilibrium, "" where it has one; its rows are NaN then · iso_stiffness N/m: c_γα of ISO 6336-1 times
    the common face width.
    """

    torque: np.ndarray
    position: np.ndarray
    te: np.ndarray
    mesh_stiffness: np.ndarray
    stage_stiffness: np.ndarray
    shares: np.ndarray
    over_width: np.ndarray
    failed: tuple[str, ...]
    iso_stiffness: float = math.nan

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For every torque its error and stiffness in words; with rigid bearings the stage has that of its mesh."""
        rows = []
        for torque, row, mesh, stage, why in zip(
            self.torque, self.te, self.mesh_stiffness, self.stage_stiffness, self.failed, strict=True
        ):
            text = why or f"{error_text(row)}, mesh stiffness {1e-6 * mesh.mean():.1f} N/µm"
            if not why and not np.array_equal(mesh, stage):
                text += f", stage stiffness {1e-6 * stage.mean():.1f} N/µm (with shafts and bearings)"
            rows.append((f"{torque:.1f} N·m", text))
        if math.isfinite(self.iso_stiffness):
            why = WHY_SOFTER if np.nanmean(self.mesh_stiffness) < SOFTER * self.iso_stiffness else ""
            rows.append(("ISO 6336-1", f"c_gamma times face width {1e-6 * self.iso_stiffness:.1f} N/µm{why}"))
        return rows

    def plot(self, figure: Any = None) -> np.ndarray:
        """Draw transmission error about its mean and mesh stiffness over the pitch with matplotlib; returns the axes.
        figure : of matplotlib, a new one when None."""
        found = self.found
        by_torque = zip(found.torque, 1e-6 * found.mesh_stiffness, strict=True)
        stiffness = {f"{torque:g} N·m": row for torque, row in by_torque}
        return plot_te(found, {"mesh stiffness in N/µm": stiffness}, figure)

    def columns(self) -> dict[str, np.ndarray]:
        """The table of the result, torques one below the other: torque_Nm, position, te_um, mesh_stiffness_N_per_um,
        stage_stiffness_N_per_um, share_1 …"""
        found = common_columns(self)
        for name in ("mesh_stiffness", "stage_stiffness"):
            found[f"{name}_N_per_um"] = 1e-6 * getattr(self, name).ravel()
        return found | {f"share_{k + 1}": self.shares[:, :, k].ravel() for k in range(self.shares.shape[2])}


def mesh_harmonics(te: np.ndarray, count: int, pitches: int = 1) -> np.ndarray:
    """(T, count), rms in the unit of te (T, P), whose P positions are even over so many pitches: harmonics of the mesh,
    NaN from half the number of positions on, where they are not told from lower ones."""
    lines = np.abs(np.fft.rfft(te, axis=1))[:, pitches : pitches * count + 1 : pitches] * math.sqrt(2) / te.shape[1]
    lines[:, (te.shape[1] // pitches + 1) // 2 - 1 :] = np.nan
    return np.pad(lines, ((0, 0), (0, count - lines.shape[1])), constant_values=np.nan)


def error_text(te: np.ndarray) -> str:
    """Mean and peak to peak of a transmission error (m)."""
    return f"mean {1e6 * te.mean():.3f} µm, peak to peak {1e6 * np.ptp(te):.3f} µm"


def plot_te(result: Any, others: Mapping[str, Mapping[str, np.ndarray]], figure: Any = None) -> np.ndarray:
    """`plot_over` of the transmission error about its mean, peak to peak in its name, and of other panels."""
    about = {
        f"{torque:g} N·m: {1e6 * row.mean():.2f} µm, peak to peak {1e6 * np.ptp(row):.2f} µm": 1e6 * (row - row.mean())
        for torque, row in zip(result.torque, result.te, strict=True)
    }
    panels = {"error less its mean in µm": about, **others}
    return plot_over(("position in pitches", result.position), panels, figure)


def common_columns(result: Any) -> dict[str, np.ndarray]:
    """Columns that pairs and sets have in common."""
    rows, positions = result.te.shape
    return {
        "torque_Nm": np.repeat(result.torque, positions),
        "position": np.tile(result.position, rows),
        "te_um": 1e6 * result.te.ravel(),
    }


def loaded_te(
    model: StageModel,
    torques: Sequence[float],
    positions: int = 41,
    rigid_bearings: bool = False,
    mesh: str | None = None,
    pitches: int = 1,
    **parameters: float,
) -> TeResult:
    """te = r_bA φ_A + r_bB φ_B of an engagement at positions i/N of one of its pitches, or of more (no end point): the
    output held so that gear A, without load, would stand at position · 2π/z_A. In a ring te = r_bA φ_A − r_bB φ_B.

    pitches: teeth of gear A for all that differs from tooth to tooth. torques: N·m on the input (the first port;
    `StageModel.shafts`); positive drives, 0 is the limit of a vanishing
    driving torque: the unloaded (kinematic) transmission error. rigid_bearings: the nodes on the axes are held. mesh:
    name of the engagement, the first when None. parameters: of the kernel, e.g. slices=10.
    A torque without equilibrium is named in `failed` with its limit; SimulationError(no_equilibrium) where none has
    one.
    """
    held = statics_of(model, **{**parameters, "effect.bearings": 0.0})
    kernel, place = held if rigid_bearings else statics_of(model, **parameters), place_of(model, mesh)
    position, least = np.arange(pitches * positions) / positions, LEAST * place.most
    te, alone, whole = np.empty((3, len(torques), position.size))
    shares = np.zeros((len(torques), position.size, SHARES))
    carried_by = np.zeros((len(torques), int(kernel.get("slices"))))

    def solve(i: int, torque: float) -> None:
        carried = torque if abs(torque) >= least else math.copysign(least, torque)
        for j, part in enumerate(position):
            at = -part * place.pitch
            state = kernel.transmission(at, carried, place.number)
            tangent = _tangent(kernel, at, carried, place.number)
            firm = tangent if kernel is held else _tangent(held, at, carried, place.number)
            te[i, j] = state.te + (torque - carried) / tangent
            alone[i, j], whole[i, j] = firm / place.lever, tangent / place.lever
            shares[i, j] = _shares(state, int(part))
            carried_by[i] += np.sum(list(state.forces.values()), axis=0)

    failed = each_load(model, torques, solve)
    for values in (te, alone, whole, shares, carried_by):
        values[[bool(why) for why in failed]] = np.nan
    mean = np.maximum(np.abs(carried_by).mean(axis=1, keepdims=True), 1e-300)
    found = te, alone, whole, shares, np.abs(carried_by) / mean
    return TeResult(np.asarray(torques, float), position, *found, failed, _by_iso(model, mesh))


def _by_iso(model: StageModel, name: str | None) -> float:
    """`TeResult.iso_stiffness` of an engagement."""
    mesh = model.stage.engagements[place_of(model, name).number]
    a, b = (model.stage.bodies[gear] for gear in mesh.gears)
    assert isinstance(a, (GearBody, RingBody)) and isinstance(b, (GearBody, RingBody))
    e_a, e_b = a.material.youngs_modulus, b.material.youngs_modulus
    shape, dedendum = mesh_shape(model.stage, mesh), a.rack.dedendum if isinstance(a, GearBody) else 1.25
    return face_width(model.stage, mesh) * mesh_stiffness(shape, dedendum, 2 * e_a * e_b / (e_a + e_b))


def statics_of(model: StageModel, **parameters: float) -> Kernel:
    """The kernel prepared for statics: level `rigid`, all flexibility is static. Torque and angle act on the bores:
    chains of the ports, whose clutches are open at the start, are left out. parameters: of the kernel."""
    kernel = model.kernel(**{"level": 0.0, **parameters})
    kernel.prepare()
    return kernel


def _tangent(kernel: Kernel, phi: float, torque: float, mesh: int) -> float:
    """dT/dte (N) by a central difference of ±TANGENT·T."""
    ends = [kernel.transmission(phi, torque * (1 + sign * TANGENT), mesh).te for sign in (-1, 1)]
    return 2 * TANGENT * torque / (ends[1] - ends[0])


def _shares(state: TeState, turned: int) -> np.ndarray:
    """Shares by tooth number of gear A: pair k of the path is tooth k − 2 …, counted from the tooth that leaves
    the mesh, which is one before for every whole pitch that it has turned."""
    total = sum(sum(forces) for forces in state.forces.values()) or 1.0
    shares = np.zeros(SHARES)
    for (_, tooth), forces in state.forces.items():
        place = tooth + turned + SHARES // 2
        if 0 <= place < SHARES:
            shares[place] += sum(forces) / total
    return shares
