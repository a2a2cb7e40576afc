"""Quasi-static loaded transmission error of an engagement over one pitch, or of a planetary set over one mesh period:
output held, torque on the input, by the contact routine of the step.

In the axes of a carrier everything repeats after one mesh period: sun and ring have moved on by one tooth each, and the
mounts of the ring are smeared round its rim. Where pins have no position errors, each planet repeats the others with a
delay of a part of the period: its mean share over the period is 1."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearfmu.geometry.iso6336 import mesh_stiffness
from gearfmu.geometry.mesh import set_ratio
from gearfmu.kernel import Kernel, TeState
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.assembly.shown import Card, Shown, plot_over
from gearfmu.stage.run.limits import MeshPlace, each_load, place_of
from gearfmu.stagefile.forms.general import GearBody, Stage
from gearfmu.stagefile.forms.shapes import face_width, gear_shape, mesh_shape, toothed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GEARS = ("sun", "ring")  # central gears of a set, whose meshes with the planets share the load
TANGENT = 1e-4
LEAST = 1e-5  # of torque_max: for smaller torques te is extrapolated along its tangent to the unloaded pair
SHARES = 4
COMMON = ("position", "failed")  # of a result: not one row a torque
SOFTER = 0.9  # of the mesh stiffness of ISO: below it the reason is given
WHY_SOFTER = (
    ": teeth on discs that do not yield; here bodies, and the shafts of a train, twist and bend, and averaging bores "
    "lose their shape"
)


@dataclass(frozen=True, repr=False)
class TeResult(Shown):
    """torque (T,) N·m · position (P,) in pitches, of a set in mesh periods · te (T, P) m, positive under load
    · stage_stiffness (T, P) N/m, tangent dF/dte with shafts and bearings, F along the line of action; of a set
    d(T_s/r_bs)/dte of all meshes with carrier and bearings · failed (T,): why a torque has no equilibrium, "" where it
    has one; its rows are NaN then.

    Of a mesh (size 0 of a set): mesh_stiffness (T, P) N/m, the same tangent of the mesh alone, bores held on their
    axes; with rigid bearings it is the stage stiffness · shares (T, P, K): part of the mesh force that each tooth pair
    carries, pairs in the order in which they come into mesh: a pair keeps its column through the pitch, sorted by tooth
    number · over_width (T, S): force of each slice over the mean of all slices, mean over the positions
    · iso_stiffness N/m: c_γα of ISO 6336-1 times the common face width.

    Of a set (size 0 of a mesh), by central gear, C as `centrals`: sharing (T, P, C, N), normal force of each planet
    over the mean of all · force (T, P, C) N, that mean."""

    torque: np.ndarray
    position: np.ndarray
    te: np.ndarray
    mesh_stiffness: np.ndarray
    stage_stiffness: np.ndarray
    shares: np.ndarray
    over_width: np.ndarray
    failed: tuple[str, ...]
    iso_stiffness: float = math.nan
    sharing: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 0, 0)))
    force: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 0)))

    @property
    def card(self) -> Card:
        """How a session shows it: its size and its `rows`."""
        positions = f"Loaded transmission error, {len(self.torque)} torques at {self.position.size} positions"
        return Card(positions, self.rows, 2)

    @property
    def centrals(self) -> tuple[str, ...]:
        """Central gears by whose meshes the planets share the load; none of a mesh."""
        return GEARS[: self.sharing.shape[2]]

    @property
    def found(self) -> TeResult:
        """The result without the torques that have no equilibrium."""
        kept = np.array([not why for why in self.failed], bool)
        rows = {n: v[kept] for n, v in vars(self).items() if np.ndim(v) and len(v) and n not in COMMON}
        return replace(self, **rows | {"failed": ("",) * int(kept.sum())})

    @property
    def pitches(self) -> int:
        """Pitches that the positions cover."""
        return int(self.position[-1]) + 1

    @property
    def load_factor(self) -> np.ndarray:
        """(T, C): mesh load factor K_γ (ISO 6336-1) at every central gear, the largest share at any position."""
        return self.sharing.max(axis=(1, 3), initial=0.0)

    def harmonics(self, count: int = 5) -> np.ndarray:
        """(T, K) m, rms: harmonics 1 … `count` of the mesh in the transmission error (`mesh_harmonics`)."""
        return mesh_harmonics(self.te, count, self.pitches)

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For every torque its error and stiffness in words, then K_γ at every central gear with the mean share of each
        planet; with rigid bearings the stage has the stiffness of its mesh."""
        rows = []
        for i, (torque, why) in enumerate(zip(self.torque, self.failed, strict=True)):
            te = f"mean {1e6 * self.te[i].mean():.3f} µm, peak to peak {1e6 * np.ptp(self.te[i]):.3f} µm"
            rows.append((f"{torque:.1f} N·m", why or f"{te}, {self._stiffness(i)}"))
            for g, gear in enumerate(() if why else self.centrals):
                shares = self.sharing[i].mean(axis=0)[g]
                means = f"means of planets 1 … {len(shares)}: {' '.join(f'{share:.3f}' for share in shares)}"
                rows.append(("", f"{gear}: K_gamma {self.load_factor[i, g]:.3f}; {means}"))
        if math.isfinite(self.iso_stiffness):
            why = WHY_SOFTER if np.nanmean(self.mesh_stiffness) < SOFTER * self.iso_stiffness else ""
            rows.append(("ISO 6336-1", f"c_gamma times face width {1e-6 * self.iso_stiffness:.1f} N/µm{why}"))
        return rows

    def _stiffness(self, i: int) -> str:
        stage = f"{1e-6 * self.stage_stiffness[i].mean():.1f} N/µm"
        if self.centrals:
            return f"stage stiffness at the sun's base circle {stage}"
        mesh = f"mesh stiffness {1e-6 * self.mesh_stiffness[i].mean():.1f} N/µm"
        same = np.array_equal(self.mesh_stiffness[i], self.stage_stiffness[i])
        return mesh if same else f"{mesh}, stage stiffness {stage} (with shafts and bearings)"

    def plot(self, figure: Figure | None = None) -> np.ndarray:
        """Draw transmission error about its mean, and mesh stiffness or shares of the planets at the largest torque,
        over the pitch or mesh period with matplotlib; returns the axes. figure : a new one when None."""
        found = self.found
        names = [f"{torque:g} N·m" for torque in found.torque]
        about = {
            f"{name}: {1e6 * row.mean():.2f} µm, peak to peak {1e6 * np.ptp(row):.2f} µm": 1e6 * (row - row.mean())
            for name, row in zip(names, found.te, strict=True)
        }
        panels: dict[str, Mapping[str, np.ndarray]] = {"error less its mean in µm": about}
        for g, gear in enumerate(found.centrals):
            most = found.sharing[np.argmax(np.abs(found.torque)), :, g].T
            panels[f"{gear}: force over the mean"] = {f"planet {k + 1}": row for k, row in enumerate(most)}
        if found.mesh_stiffness.size:
            panels["mesh stiffness in N/µm"] = dict(zip(names, 1e-6 * found.mesh_stiffness, strict=True))
        return plot_over(("position in pitches", found.position), panels, figure)

    def columns(self) -> dict[str, np.ndarray]:
        """The table of the result, torques one below the other: torque_Nm, position, te_um, mesh_stiffness_N_per_um,
        stage_stiffness_N_per_um, share_1 …; of a set without the mesh stiffness and with sun_force_N and ring_force_N
        of the mean planet, sun_share_1 …, ring_share_1 …"""
        rows, positions = self.te.shape
        found = {
            "torque_Nm": np.repeat(self.torque, positions),
            "position": np.tile(self.position, rows),
            "te_um": 1e6 * self.te.ravel(),
        }
        if self.mesh_stiffness.size:
            found["mesh_stiffness_N_per_um"] = 1e-6 * self.mesh_stiffness.ravel()
        found["stage_stiffness_N_per_um"] = 1e-6 * self.stage_stiffness.ravel()
        found |= {f"share_{k + 1}": self.shares[:, :, k].ravel() for k in range(self.shares.shape[2])}
        found |= {f"{gear}_force_N": self.force[:, :, g].ravel() for g, gear in enumerate(self.centrals)}
        for g, gear in enumerate(self.centrals):
            found |= {f"{gear}_share_{k + 1}": self.sharing[:, :, g, k].ravel() for k in range(self.sharing.shape[3])}
        return found


def mesh_harmonics(te: np.ndarray, count: int, pitches: int = 1) -> np.ndarray:
    """(T, count), rms in the unit of te (T, P), whose P positions are even over so many pitches: harmonics of the mesh,
    NaN from half the number of positions on, where they cannot be distinguished from lower ones."""
    lines = np.abs(np.fft.rfft(te, axis=1))[:, pitches : pitches * count + 1 : pitches] * math.sqrt(2) / te.shape[1]
    lines[:, (te.shape[1] // pitches + 1) // 2 - 1 :] = np.nan
    return np.pad(lines, ((0, 0), (0, count - lines.shape[1])), constant_values=np.nan)


def set_error(stage: Stage) -> tuple[float, float]:
    """(r_b,s, 1 + z_r/z_s) of te = r_b,s (φ_s − (1 + z_r/z_s) φ_c), the transmission error of a planetary set; m, 1."""
    sun, ring = (toothed(stage, name) for name in GEARS)
    return gear_shape(sun).r_b, set_ratio(sun.teeth, ring.teeth)


def loaded_te(
    model: StageModel,
    torques: Sequence[float],
    positions: int = 41,
    mesh: str | None = None,
    pitches: int = 1,
    progress: Callable[[float, str], None] | None = None,
    **parameters: float,
) -> TeResult:
    """Transmission error at positions i/N of one pitch or mesh period, or of more (no end point), the output held.

    Of an engagement te = r_bA φ_A + r_bB φ_B, in a ring r_bA φ_A − r_bB φ_B, where gear A, without load, would be at
    position · 2π/z_A. Of a planetary set te = r_b,s (φ_s − (1 + z_r/z_s) φ_c), angles of the bores of sun and carrier;
    without load it is ± the mean backlash of the two meshes along the line of action.

    torques: N·m on the input (the first port; `StageModel.shafts`); positive drives, 0 is the limit of a vanishing
    driving torque: the unloaded (kinematic) transmission error. mesh: name of the engagement; None: the first, of
    a set all. pitches: teeth of gear A for all that differs from tooth to tooth. progress: called with the part done
    and the torque. parameters: of the kernel, e.g. slices=10; with "effect.bearings" 0 axes are held.

    A torque without equilibrium is named in `failed` with its limit; SimulationError(no_equilibrium) where none has
    one.
    """
    planets = len(model.stage.engagements) // len(GEARS) if model.stage.carriers and mesh is None else 0
    place = place_of(model, f"{GEARS[0]}_planet1" if planets else mesh)
    at = _of_set(model, place, planets, parameters) if planets else _of_mesh(model, place, parameters)
    position, least = np.arange(pitches * positions) / positions, LEAST * place.most
    found: list[list[_Point]] = [[] for _ in torques]

    def solve(i: int, torque: float) -> None:
        carried = torque if abs(torque) >= least else math.copysign(least, torque)
        for j, part in enumerate(position):
            if progress:
                progress((i + j / position.size) / len(torques), f"{torque:g} N·m")
            point = at(part, carried)
            found[i].append(point._replace(te=point.te + (torque - carried) / point.tangent))

    failed = each_load(model, torques, solve)
    like = next(row[0] for row, why in zip(found, failed, strict=True) if not why)
    missing = [_Point(*(np.full(np.shape(value), np.nan) for value in like))] * position.size
    rows = [missing if why else row for row, why in zip(found, failed, strict=True)]
    values = [np.array([[point[k] for point in row] for row in rows]) for k in range(len(like))]
    te, _, alone, whole, shares, load, force = values
    load, mean = np.abs(load.sum(axis=1)), force.mean(axis=3)
    even = np.maximum(load.sum(axis=1, keepdims=True) / max(load.shape[1], 1), 1e-300)
    own = te, alone, whole, shares, load / even, failed, math.nan if planets else _by_iso(model, place)
    return TeResult(np.asarray(torques, float), position, *own, force / mean[..., None], mean)


class _Point(NamedTuple):
    """Equilibrium at a position: te m, its tangent dT/dte N; stiffness of mesh and stage N/m; share of each tooth pair
    (K,); load of each slice (S,) N; force of each planet by central gear (C, N) N."""

    te: float | np.ndarray
    tangent: float | np.ndarray
    alone: float | np.ndarray
    whole: float | np.ndarray
    shares: np.ndarray
    load: np.ndarray
    force: np.ndarray


_At = Callable[[float, float], _Point]  # position in pitches, torque N·m → equilibrium


def _of_mesh(model: StageModel, place: MeshPlace, parameters: Mapping[str, float]) -> _At:
    held = statics_of(model, **{**parameters, "effect.bearings": 0.0})
    kernel = statics_of(model, **parameters) if parameters.get("effect.bearings", 1.0) else held

    def at(part: float, torque: float) -> _Point:
        angle = -part * place.pitch
        state = kernel.transmission(angle, torque, place.number)
        tangent = _tangent(lambda load: kernel.transmission(angle, load, place.number).te, torque)
        firm = tangent
        if kernel is not held:
            firm = _tangent(lambda load: held.transmission(angle, load, place.number).te, torque)
        load = np.sum(list(state.forces.values()), axis=0)
        stiffness = firm / place.lever, tangent / place.lever
        return _Point(state.te, tangent, *stiffness, _shares(state, int(part)), load, np.zeros((0, 1)))

    return at


def _of_set(model: StageModel, place: MeshPlace, planets: int, parameters: Mapping[str, float]) -> _At:
    """Tangents of a position start from its equilibrium; engagements are those of the sun, then those of the ring."""
    kernel, none = statics_of(model, **parameters), np.zeros(0)
    shafts, (r_b, ratio) = model.shafts, set_error(model.stage)

    def error(angle: float, torque: float, keep: bool) -> float:
        phi = {shafts.input: kernel.transmission(angle, torque, keep=keep).phi, shafts.output: angle}
        return float(r_b * (phi["sun"] - ratio * phi["carrier"]))

    def at(part: float, torque: float) -> _Point:
        angle = -part * place.pitch
        te, meshes = error(angle, torque, False), range(len(GEARS) * planets)
        states = [kernel.transmission_at(mesh) for mesh in meshes]
        force = np.array([_total(state) for state in states]).reshape(len(GEARS), planets)
        tangent = _tangent(lambda load: error(angle, load, True), torque)
        return _Point(te, tangent, none, abs(tangent / place.lever) * planets, none, none, force)

    return at


def _by_iso(model: StageModel, place: MeshPlace) -> float:
    """`TeResult.iso_stiffness` of an engagement."""
    mesh = model.stage.engagements[place.number]
    a, b = (toothed(model.stage, gear) for gear in mesh.gears)
    e_a, e_b = a.material.youngs_modulus, b.material.youngs_modulus
    shape, dedendum = mesh_shape(model.stage, mesh), a.rack.dedendum if isinstance(a, GearBody) else 1.25
    return face_width(model.stage, mesh) * mesh_stiffness(shape, dedendum, 2 * e_a * e_b / (e_a + e_b))


def statics_of(model: StageModel, **parameters: float) -> Kernel:
    """The kernel prepared for statics: level `rigid`, all flexibility is static. Torque and angle act on the bores:
    chains of the ports, whose clutches are open at the start, are left out. parameters: of the kernel."""
    kernel = model.kernel(**{"level": 0.0, **parameters})
    kernel.prepare()
    return kernel


def _tangent(error: Callable[[float], float], torque: float) -> float:
    """dT/dte (N) by a central difference of ±TANGENT·T; error: te (m) under a torque (N·m)."""
    ends = [error(torque * (1 + sign * TANGENT)) for sign in (-1, 1)]
    return 2 * TANGENT * torque / (ends[1] - ends[0])


def _shares(state: TeState, turned: int) -> np.ndarray:
    """Shares by tooth number of gear A: pair k of the path is tooth k − 2 …, counted from the tooth that leaves
    the mesh, which is one before for every whole pitch that it has turned."""
    total, shares = _total(state) or 1.0, np.zeros(SHARES)
    for (_, tooth), forces in state.forces.items():
        place = tooth + turned + SHARES // 2
        if 0 <= place < SHARES:
            shares[place] += sum(forces) / total
    return shares


def _total(state: TeState) -> float:
    """Mesh force, N."""
    return sum(sum(slices) for slices in state.forces.values())
