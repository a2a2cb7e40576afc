"""Error of the time step: every level against itself at 0.625 µs, from a common state.

    python -m evidence.accuracy.step_error

A run makes 1.2 ms with the step of the reference, then goes on with the step under test; samples at the end of every
step over the next 8.4 ms. Error: rms of the difference over rms of the ripple, of the lines up to 10 kHz under a Hann
window, in per cent: transmission error, mesh forces, forces of bearings and pins. The lines of the reference are those
of all its samples. Samples of it at the instants of the steps alone fold what lies above 1/2h into the band (aliases):
`aliases` is what these err by in the mesh forces, `sampled` the error of the run against them.

Prints the rows of TABLE and writes them to step_error.csv beside this file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import gearfmu
from evidence.tables import told, write_rows
from gearfmu.kernel import Kernel
from gearfmu.kernel.instance import Recording
from gearfmu.stage import StageModel, Steady

REFERENCE, SETTLED, WINDOW = 0.625e-6, 1.2e-3, 8.4e-3  # s
HIGHEST = 10e3  # Hz
PUSHED = (3.19999e-3, 3.24999e-3)  # s: from the step at 3.2 ms to that before 3.25 ms
LEVELS = {"fast": 1.0, "standard": 2.0}
EFFECTS = {
    "friction": {"effect.friction": 1.0},
    "film": {"effect.film": 1.0},
    "still": {"effect.gyroscopic": 0.0},
}
SUPPORT = re.compile(r"(bearing|pin)\.\w+\.f[xy]$")


@dataclass(frozen=True)
class Scene:
    """A stage under a torque (N·m) at a speed (rad/s) of its input. by_torques: both of its ports hold a torque,
    that of the output changed by this part of it for 50 µs (`pulse`)."""

    stage: str
    torque: float
    speed: float
    by_torques: bool = False
    pulse: float = 0.0

    def model(self) -> StageModel:
        model = gearfmu.assemble(self.stage)
        return model if self.by_torques else model.driven_by_springs()

    def inputs(self, model: StageModel, parameters: dict[str, float]) -> Callable[[float], dict[str, float]]:
        """Inputs by time; what a run starts with is among them."""
        if not self.by_torques:
            return Steady(model, self.speed, self.torque, parameters=parameters)
        ratio, source, out = float(model.shafts.ratio), model.shafts.input, model.shafts.output
        torques = {f"{source}.tau": self.torque, f"{out}.tau": -self.torque * ratio}
        start = {f"{source}.w_start": self.speed, f"{out}.w_start": self.speed / ratio}
        pushed = torques | {f"{out}.tau": (1.0 + self.pulse) * torques[f"{out}.tau"]}
        return lambda time: (pushed if PUSHED[0] <= time < PUSHED[1] else torques) if time else torques | start


SCENES = {
    "pair": Scene("fzg_c", 302.0, 432.0),
    "relieved": Scene("fzg_c/stage_relief", 302.0, 200.0),
    "helical": Scene("helical_demo", 300.0, 200.0),
    "train": Scene("two_stage", 100.0, 150.0),
    "set": Scene("planetary54", 600.0, 85.0, by_torques=True),
    "frozen": Scene("planetary54", 600.0, 0.0, by_torques=True, pulse=0.02),
    "helical_set": Scene("helical_set", 300.0, 60.0, by_torques=True),
}


def channels(model: StageModel, kernel: Kernel) -> dict[str, list[str]]:
    """Names of the outputs that are judged together."""
    names = [v.name for v in kernel.variables.values() if v.causality == "output"]
    return {
        "te": [f"{shaft}.gear.phi" for shaft in (model.shafts.input, model.shafts.output)],
        "force": [name for name in names if name.endswith(".force")],
        "support": [name for name in names if SUPPORT.match(name)],
    }


def run(
    model: StageModel, scene: Scene, parameters: dict[str, float], h: float
) -> tuple[dict[str, np.ndarray], str, int]:
    """Samples (n, k) of each kind of channel at the ends of steps, from the end of the common part on; what the kernel
    says of the step; unsolved steps."""
    inputs = scene.inputs(model, parameters)
    kernel = Kernel(model.blob, parameters | {"h": h})
    for name, value in inputs(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    wanted = channels(model, kernel)
    names = [name for group in wanted.values() for name in group]
    for first, count, step in ((0, round(SETTLED / REFERENCE), REFERENCE), (1, round(WINDOW / h), h)):
        record = Recording(kernel, names, count, step)
        for i in range(count):
            now = first * SETTLED + i * step
            for name, value in inputs(now).items() if now else ():
                kernel.set(name, value)
            kernel.step(now, step)
            record.rows[i + 1] = [kernel.get(name) for name in names]
    ends = np.cumsum([len(group) for group in wanted.values()])[:-1]
    found = dict(zip(wanted, np.split(record.rows, ends, axis=1), strict=True))
    found["te"] = found["te"] @ np.array([[1.0], [-float(model.shafts.ratio)]])
    return found, kernel.warning, int(kernel.get("solver.retried_steps"))


def lines(rows: np.ndarray, every: int, h: float) -> np.ndarray:
    """Spectrum up to HIGHEST under a Hann window of samples (n, k), `every` of them in a step h."""
    steps = (len(rows) - 1) // every
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(len(rows)) / (every * steps))
    length = every * (steps + 1)
    kept = np.fft.rfftfreq(length, h / every) <= HIGHEST
    return np.fft.rfft(window[:, None] * (rows - rows.mean(axis=0)), length, axis=0)[kept] / every


def error(reference: np.ndarray, found: np.ndarray) -> float:
    """Of lines, in per cent."""
    return float(100 * np.linalg.norm(found - reference) / np.linalg.norm(reference))


TABLE = (  # scene, level, effects other than by default, steps in µs
    ("pair", "fast", (), (5.0, 10.0, 15.0)),
    ("relieved", "fast", (), (5.0, 10.0, 15.0)),
    ("relieved", "fast", ("friction",), (5.0, 10.0, 15.0)),
    ("relieved", "fast", ("film",), (5.0, 10.0)),
    ("relieved", "fast", ("still",), (10.0,)),
    ("helical", "fast", (), (5.0, 10.0)),
    ("helical", "fast", ("friction",), (5.0, 10.0)),
    ("helical", "fast", ("film",), (5.0, 10.0)),
    ("train", "fast", (), (5.0, 12.5)),
    ("train", "fast", ("friction",), (5.0, 12.5)),
    ("set", "fast", (), (5.0, 10.0, 12.5)),
    ("set", "fast", ("friction",), (5.0, 10.0)),
    ("set", "fast", ("still",), (12.5,)),
    ("set", "standard", (), (10.0, 12.5)),
    ("frozen", "fast", (), (5.0, 10.0, 12.5)),
    ("helical_set", "fast", (), (5.0, 10.0)),
    ("helical_set", "fast", ("friction",), (5.0, 10.0)),
)


def rows(name: str, level: str, effects: Sequence[str], steps: Sequence[float]) -> Iterator[dict[str, str]]:
    """A row of the table for every step (µs)."""
    scene = SCENES[name]
    model = scene.model()
    parameters = {"level": LEVELS[level]} | {key: value for effect in effects for key, value in EFFECTS[effect].items()}
    reference, _, _ = run(model, scene, parameters, REFERENCE)
    for h in steps:
        found, said, unsolved = run(model, scene, parameters, 1e-6 * h)
        every = round(1e-6 * h / REFERENCE)
        whole = {kind: rows[: (len(found[kind]) - 1) * every + 1] for kind, rows in reference.items()}
        errors = {
            kind: error(lines(whole[kind], every, 1e-6 * h), lines(rows, 1, 1e-6 * h)) for kind, rows in found.items()
        }
        samples, force = lines(whole["force"][::every], 1, 1e-6 * h), lines(found["force"], 1, 1e-6 * h)
        errors["sampled"] = error(samples, force)
        errors["aliases"] = error(lines(whole["force"], every, 1e-6 * h), samples)
        lowered = re.search(r"gamma lowered to ([\d.]+\d)", said)
        gamma = lowered[1] if lowered else "1"
        yield {"scene": name, "level": level, "effect": "+".join(effects), "h_us": f"{h:g}"} | {
            **{kind: f"{e:.3g}" for kind, e in errors.items()},
            "gamma": gamma,
            "unsolved": f"{unsolved}",
        }


if __name__ == "__main__":
    write_rows(Path(__file__).with_suffix(".csv"), told(row for line in TABLE for row in rows(*line)))
