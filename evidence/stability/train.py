"""The bench of trains: the shipped one, whose two engagements, three shafts and six bearings answer together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

import gearfmu
from evidence.stability.bench import Bench
from evidence.stability.checks import beyond_touch, play_of
from evidence.stability.record import Record, Watched
from gearfmu.stage import StageModel, Steady, loaded_te
from gearfmu.stagefile.forms.shapes import mesh_shape

TRAIN = "two_stage"
PORT_OF = {"stage1": ("input", 0), "stage2": ("output", 1)}  # port that shares a shaft with gear A (0) or B (1)
LIGHT, LARGEST = 20.0, 300.0  # N·m on the input; torque_max of the first mesh
MARGIN = 1.25  # of the softest place at rest: inertia of what lies between mesh and ports


@dataclass(frozen=True)
class Train(Bench):
    """The shipped train."""

    kind = "train"
    watched = Watched(("stage1", "stage2"), ("input", "output"))
    step, nominal, settled, limit = 2e-5, 150.0, (0.06, 0.04), 0.02

    @property
    def model(self) -> StageModel:
        """Its three shafts, assembled."""
        return _train()

    @property
    def ratios(self) -> tuple[float, float]:
        """Of input and output."""
        return 1.0, 1.0 / _train().shafts.ratio

    def wound(self, torque: float) -> tuple[float, float]:
        """By the kernel's own statics."""
        at_rest = Steady(_train(), 0.0, torque)(0.0)
        return at_rest["input.phi"], at_rest["output.phi"]

    def carried(self, record: Record, since: float, until: float) -> dict[str, float]:
        """Torques of both ports, that of the output by the ratio; their sign is that of the first mesh's force."""
        late = record.between(since, until)
        sign = np.sign(late["stage1.force_mean"].mean())
        ratios = {"input": 1.0, "output": abs(_train().shafts.ratio)}
        return {f"the {p}": float(sign * abs(late[f"{p}.tau_mean"].mean()) / ratio) for p, ratio in ratios.items()}

    def depths(self, record: Record, backlash: float | None) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Transmission errors beyond the touch of drive or coast flanks, which hold the twist of shafts and what
        bearings give too; no deeper than the largest load of the run presses them at rest."""
        for mesh, (port, gear) in PORT_OF.items():
            rest, yields, play, radii = _at_rest(mesh)
            depth = beyond_touch(record[f"{mesh}.te"], play)
            load = record[f"{mesh}.force_max"].max(), np.abs(record[f"{port}.tau_mean"]).max() / radii[gear]
            yield f"flanks of {mesh}", depth, np.full(depth.size, rest + MARGIN * yields * max(load))


@lru_cache(maxsize=1)
def _train() -> StageModel:
    return gearfmu.assemble(TRAIN)


@lru_cache(maxsize=2)
def _at_rest(mesh: str) -> tuple[float, float, float, tuple[float, float]]:
    """Of an engagement: largest depth without load (m), depth per mesh force where it is softest (m/N), backlash along
    the line of action and base radii (m)."""
    stage = _train().stage
    found = loaded_te(_train(), [0.0, LIGHT, LARGEST], 8, mesh=mesh)
    shape = mesh_shape(stage, next(m for m in stage.engagements if m.name == mesh))
    play, yields = play_of(stage, mesh), float(1.0 / found.stage_stiffness.min())
    return float(beyond_touch(found.te[0], play).max()), yields, play, (shape.gears[0].r_b, shape.gears[1].r_b)
