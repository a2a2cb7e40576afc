"""The bench of pairs: variants of the shipped FZG pair, assembled once a process."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from evidence.stability.bench import Bench
from evidence.stability.checks import CLEARANCE, SOFTEST
from evidence.stability.motion import Turn
from evidence.stability.record import Inputs, Record, Watched
from gearfmu.body import Body, load_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import DeviationClass, Eccentricity, LeadSpec, ProfileSpec, Wobble
from gearfmu.stagefile.tables.connections import PortSpec

RELIEVED, PLAIN = "fzg_c/stage_relief", "fzg_c"
SHAFTS = ("pinion", "wheel")
LOOSE = (PortSpec(kind="spring", k=20e3, c=0.1), PortSpec(kind="torque", k=40e3, c=0.3))
POSITIONS = 16
LARGEST = 600.0  # N·m: torque_max; beyond it shafts are wound up by the compliance at the nominal torque
STANDING_OUT = 250e-6  # m: what the largest DEVIATIONS of both gears take: 80 axes, 76 pitches, 60 profiles, 30 leads
DEVIATIONS: dict[str, Any] = {  # of both gears, each its own draw; a coarse gear
    "deviations": DeviationClass.model_validate({"class": 9, "seed": 1}),
    "profile": ProfileSpec(slope=5e-6, crowning=5e-6),
    "lead": LeadSpec(slope=10e-6, crowning=8e-6),
    "eccentricity": Eccentricity(amount=40e-6, angle=0.5),
    "wobble": Wobble(amount=2e-4),
}


@dataclass(frozen=True)
class Pair(Bench):
    """A shipped pair with changes. bearing: stiffness of both bearings, N/m. pitch_error: index deviation of the
    pinion's tooth 0, m. deviating: every kind of deviation at once, DEVIATIONS. ports: of pinion and wheel; None keeps
    those of the stage."""

    stage: str = RELIEVED
    bearing: float | None = None
    pitch_error: float = 0.0
    deviating: bool = False
    ports: tuple[PortSpec, PortSpec] | None = None

    kind = "pair"
    watched = Watched(("mesh",), SHAFTS, SHAFTS)
    step, nominal, settled, limit = 1e-4, 302.0, (0.1, 0.04), 0.01

    @property
    def model(self) -> StageModel:
        """Pinion and wheel, assembled."""
        return _model(self)

    @property
    def geometry(self) -> PairGeometry:
        """Of the two gears."""
        return self.model.stage.written.geometry

    @property
    def ratio(self) -> float:
        """Speed of the wheel over that of the pinion."""
        gears = self.model.stage.written.gears
        return -float(gears[0].teeth / gears[1].teeth)

    @property
    def ratios(self) -> tuple[float, float]:
        """Of pinion and wheel."""
        return 1.0, self.ratio

    def wound(self, torque: float) -> tuple[float, float]:
        """The pinion's end against the wheel's; torque 0: the teeth in mid-backlash."""
        return _wound(self, torque), 0.0

    def dragged(self, motion: Turn, drag: float) -> tuple[Pair, Inputs]:
        """A loose wheel."""

        def inputs(time: float) -> Mapping[str, float]:
            turn = motion(time)
            return {"pinion.phi": turn.phi, "pinion.w": turn.w, "pinion.a": turn.a, "wheel.tau": drag}

        return replace(self, ports=LOOSE), inputs

    def start(self, inputs: Inputs) -> dict[str, float]:
        """A wheel on a torque port turns with the pinion."""
        return {"wheel.w_start": self.ratio * inputs(0.0)["pinion.w"]} if self.ports == LOOSE else {}

    def carried(self, record: Record, since: float, until: float) -> dict[str, float]:
        """Moment of the mesh on the pinion."""
        return {"the mesh": mean_torque(record.between(since, until), self.geometry)}

    def impulse(self, record: Record, drag: float, since: float) -> float:
        """Over whole periods, in which the wheel gains no speed."""
        a, b = self.geometry.gears
        return mean_torque(record.after(since), self.geometry) * b.r_b / a.r_b / drag

    def depths(self, record: Record, backlash: float | None) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Overlap of the undeformed involutes; deviations stand out of them."""
        pair = self.geometry if backlash is None else replace(self.geometry, backlash=backlash)
        pressed = record["mesh.force_max"] / SOFTEST + CLEARANCE + (STANDING_OUT if self.deviating else 0.0)
        yield "flanks", overlap(record, pair), pressed


@lru_cache(maxsize=1)
def _bodies() -> list[Body]:
    return load_bodies(load_stage(PLAIN))


@lru_cache(maxsize=8)
def _model(bench: Pair) -> StageModel:
    return assemble(_spec(bench), _bodies())


def _spec(bench: Pair) -> Stage:
    spec = load_stage(bench.stage)
    gears = []
    for gear in spec.written.gears:
        changes: dict[str, Any] = {}
        if bench.bearing is not None:
            changes["bearing"] = gear.bearing.model_copy(update={"stiffness": bench.bearing})
        if bench.pitch_error and gear is spec.written.gears[0]:
            changes["index_deviation"] = {0: bench.pitch_error}
        gears.append(gear.model_copy(update=changes | (DEVIATIONS if bench.deviating else {})))
    ports = spec.ports if bench.ports is None else dict(zip(SHAFTS, bench.ports, strict=True))
    return rewritten(spec, gears=tuple(gears), ports=ports)


@lru_cache(maxsize=64)
def _wound(bench: Pair, torque: float) -> float:
    """Angle (rad) of the pinion's outer end against the unloaded pair under a torque (N·m) on the pinion: both shafts
    and the mean quasi-static transmission error, backlash included where the torque is negative; without a torque the
    angle that centres the teeth of the pinion in the spaces of the wheel."""
    spec, pair = bench.model.stage, bench.geometry
    if not torque:
        return -0.5 * pair.normal_backlash / pair.gears[0].r_b
    if abs(torque) > LARGEST:
        return _wound(bench, bench.nominal) * torque / bench.nominal
    k = [spec.ports[name].k for name in SHAFTS]
    assert k[0] is not None and k[1] is not None, "both ports are springs"
    shafts = 1.0 / k[0] + 1.0 / (bench.ratio**2 * k[1])
    error = float(np.mean(loaded_te(bench.model, [torque], POSITIONS).te))
    return torque * shafts + error / pair.gears[0].r_b


def mean_torque(record: Record, pair: PairGeometry) -> float:
    """Mean moment of the mesh force about the pinion's axis, N·m."""
    steps = np.diff(record.time)
    return float(pair.gears[0].r_b * (record["mesh.force_mean"][1:] * steps).sum() / steps.sum())


def overlap(record: Record, pair: PairGeometry) -> np.ndarray:
    """(n,) overlap of the undeformed involutes at the sampled positions of the bore nodes, m, positive where they
    interpenetrate: −g of docs/theory eq. 4 on the drive or the coast side, whichever is larger."""
    a, b = pair.gears
    dx = pair.a + record["wheel.gear.x"] - record["pinion.gear.x"]
    dy = record["wheel.gear.y"] - record["pinion.gear.y"]
    distance, base = np.hypot(dx, dy), a.r_b + b.r_b
    length, nominal = np.sqrt(distance**2 - base**2), np.sqrt(pair.a**2 - base**2)
    deepest = np.full(record.time.size, -np.inf)
    for side, backlash in ((1.0, 0.0), (-1.0, pair.normal_backlash)):
        turn = np.arctan2(dy, dx) - side * (np.arccos(base / distance) - np.arccos(base / pair.a))
        te = side * (a.r_b * record["pinion.gear.phi"] + b.r_b * record["wheel.gear.phi"])
        deepest = np.maximum(deepest, te - side * turn * base - (length - nominal) - backlash)
    return deepest
