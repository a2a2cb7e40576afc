"""Stages and runs of golden.py: every integrator, kind of stage and effect once; `adopt`, statics, linear models."""

from __future__ import annotations

import dataclasses
import hashlib
import lzma
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import cache, lru_cache, partial
from pathlib import Path

import numpy as np
from small_model import pair_blob, with_nodes

from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import LinearModel
from gearfmu.stage.assembly.blob import read_blob, write_blob

MODELS = Path(__file__).parents[1] / "reference" / "golden_models"
STEP = 2e-5  # s, communication step
RIGID, FAST, STANDARD, FULL, PAPER, EXPLICIT = map(float, range(6))
DG4, EM, RK45, CENTRAL = map(float, range(4))
FRICTION = {"effect.friction": 1.0}
LESS_DAMPED = {"contact_damping": 21e3}  # a tenth: with all of it friction of helical teeth asks for a lower γ
FILM = {"effect.film": 1.0}
BARE = {f"effect.{name}": 0.0 for name in ("coriolis", "centrifugal", "gyroscopic")}
SIMPLE = {f"effect.{name}": 0.0 for name in ("hertz", "residual", "tip_contact", "coast_flank")}
PLAIN = {f"effect.{name}": 0.0 for name in ("hertz", "tip_relief", "bearings", "modal_damping", "roll_motion")}

Parameters = dict[str, float]
Drive = Callable[[Kernel, int], None]


@dataclasses.dataclass(frozen=True)
class Stage:
    """A model and how it is run: inputs of a communication step, start values, parameters, number of steps."""

    blob: Callable[[], bytes]
    drive: Drive
    start: Mapping[str, float] = dataclasses.field(default_factory=dict)
    parameters: Mapping[str, float] = dataclasses.field(default_factory=dict)
    steps: int = 60

    def kernel(self, parameters: Mapping[str, float], library: Path | None, again: bool = True) -> Kernel:
        """Loaded, not yet initialised; again: in the memory of the last one of this model, which is no longer used."""
        kernel = _kernel(self.blob(), library) if again else Kernel(self.blob(), None, library)
        kernel._lib.gk_defaults(kernel._model, kernel._data)
        for name, value in (dict(self.parameters) | dict(parameters) | dict(self.start)).items():
            kernel.set(name, value)
        self.drive(kernel, 0)
        return kernel


def reversed_torques(speed: Mapping[str, float], torque: Mapping[str, float], every: int) -> Drive:
    """Torques (N·m) by port that reverse after so many steps; outer ends turn at their speed (rad/s) with a twist."""

    def drive(kernel: Kernel, i: int) -> None:
        sense = -0.6 if i // every % 2 else 1.0
        for port in torque:
            if kernel.variables[f"{port}.tau"].causality == "input":
                kernel.set(f"{port}.tau", sense * torque[port])
            else:
                kernel.set(f"{port}.w", speed[port])
                kernel.set(f"{port}.phi", speed[port] * i * STEP + sense * torque[port] * 1e-4)

    return drive


def _loaded(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.phi", 6e-3 + 200.0 * i * STEP)
    kernel.set("wheel.phi", 4e-3 - 200.0 * 16 / 24 * i * STEP)


def _reversing(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.tau", 200.0 if i // 40 % 2 else -150.0)


def _both_free(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.tau", 40.0 if i // 25 % 2 else -20.0)
    kernel.set("wheel.tau", 30.0 if i // 25 % 2 else -55.0)


def _closing(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.phi", 30.0 * i * STEP)
    kernel.set("pinion.clutch.capacity", min(1.0 * i, 120.0))


@lru_cache(maxsize=1)
def _kernel(blob: bytes, library: Path | None) -> Kernel:
    """Memory of a set is hundreds of megabytes: it is taken once for all runs of a model."""
    return Kernel(blob, None, library)


@cache
def golden_model(name: str) -> bytes:
    """Blob of a stored model."""
    return lzma.decompress((MODELS / f"{name}.gkb.xz").read_bytes())


@cache
def _deviating() -> bytes:
    """The helical pair with tooth and flank deviations, leads and run-out of the first gear."""
    sections, rng = dict(read_blob(golden_model("helical_pair"))), np.random.default_rng(4)
    teeth = int(sections["size0"][1])
    return write_blob(
        sections
        | {
            "index0": 1e-4 * rng.standard_normal((2, teeth)),
            "lead0": 3e-6 * np.abs(np.linspace(-1, 1, 33)) * np.ones((2, 1)),
            "flank_size0": np.array([teeth, 3, 9], np.int32),
            "flank0": 2e-6 * rng.standard_normal((teeth, 2, 3, 9)),
            "runout0": np.array([8e-6, -5e-6, 1e-4, 5e-5]),
        }
    )


@cache
def _nodal() -> bytes:
    return with_nodes(pair_blob(("torque", "spring")), penalty=2e13)


def _turning(
    blob: Callable[[], bytes], speed: Parameters, torque: Parameters, steps: int, every: int, slices: float = 3.0
) -> Stage:
    """A stage under torques that reverse. Ports driven by torques start at their speed."""
    causality = {v.name: v.causality for v in Kernel(blob()).variables.values()}
    start = {f"{port}.w_start": value for port, value in speed.items() if f"{port}.w_start" in causality}
    return Stage(blob, reversed_torques(speed, torque, every), start, {"slices": slices}, steps)


@cache
def stages() -> dict[str, Stage]:
    """By name."""
    small, helical = {"pinion": 250.0, "wheel": -250.0 * 16 / 24}, {"pinion": 300.0, "wheel": -300.0 * 2 / 3}
    swung, pinion = partial(pair_blob, ("torque", "spring")), {"pinion": 150.0, "wheel": 0.0}
    both, sun, helical_sun = {"pinion": 200.0, "wheel": 300.0}, 1 + 54 / 18, 1 + 64 / 26
    half = {port: 0.5 * torque for port, torque in both.items()}  # within the law of contact
    free = {"contact_damping": 0.0, "slices": 10}
    train = {"input": 500.0, "output": 500.0 * 19 / 73 * 25 / 61}
    carrier = {"carrier": 60.0, "sun": 60.0 * sun}
    return {
        "loaded": Stage(
            partial(pair_blob, ("spring", "spring")), _loaded, {"pinion.w": 200.0, "wheel.w": -200.0 * 16 / 24}
        ),
        "reversing": Stage(swung, _reversing, steps=100),
        "jammed": Stage(
            partial(pair_blob, ("torque", "fixed")), _reversing, parameters={"backlash": -4e-6, "slices": 5}
        ),
        "rattle": Stage(partial(pair_blob, ("torque", "torque")), _both_free, parameters=free, steps=150),
        "clutch": Stage(
            partial(pair_blob, ("chain", "spring")), _closing, {"pinion.w": 30.0, "pinion.clutch.capacity": 20.0}
        ),
        "pair": _turning(swung, small, pinion, 40, 15),
        "nodal": _turning(_nodal, small, pinion, 40, 15),
        "helical": _turning(partial(golden_model, "helical_pair"), helical, half, 40, 15),
        "deviating": _turning(_deviating, helical, half, 40, 15),
        "train": _turning(partial(golden_model, "train"), train, {"input": 150.0, "output": -150.0}, 16, 8),
        "pin_errors": _turning(
            partial(golden_model, "pin_errors"), carrier, {"carrier": 600.0, "sun": -600.0 / sun}, 20, 8, 1.0
        ),
        "helical_set": _turning(
            partial(golden_model, "helical_set"),
            {"carrier": 60.0, "sun": 60.0 * helical_sun},
            {"carrier": 300.0, "sun": -300.0 / helical_sun},
            20,
            8,
        ),
    }


RUNS: dict[str, tuple[str, Parameters]] = {
    "pair/loaded": ("loaded", {"level": FAST}),
    "pair/paper": ("loaded", {"level": PAPER}),
    "pair/reversing": ("reversing", {"level": STANDARD}),
    "pair/central": ("reversing", {"level": FAST, "integrator": CENTRAL}),
    "pair/jammed": ("jammed", {"level": FULL}),
    "pair/rattle": ("rattle", {"level": FAST}),
    "pair/rattle_em": ("rattle", {"level": FAST, "integrator": EM}),
    "pair/clutch": ("clutch", {"level": RIGID}),
    "pair/plain": ("reversing", {"level": FAST} | PLAIN),
    "pair/film": ("pair", {"level": FAST, "contact_damping": 0.0} | FILM),
    "nodal/paper": ("nodal", {"level": PAPER}),
    "helical/fast": ("helical", {"level": FAST}),
    "helical/explicit": ("helical", {"level": EXPLICIT}),
    "helical/simple": ("helical", {"level": PAPER, "slices": 2.0} | SIMPLE),
    "helical/friction": ("helical", {"level": FAST, "friction_law": 2.0} | FRICTION | LESS_DAMPED),
    "deviating/friction": ("deviating", {"level": RIGID} | FRICTION | FILM | LESS_DAMPED),
    "train/standard": ("train", {"level": STANDARD}),
    "pin_errors/fast": ("pin_errors", {"level": FAST}),
    "pin_errors/em": ("pin_errors", {"level": FAST, "integrator": EM} | BARE),
    "pin_errors/friction": ("pin_errors", {"level": RIGID} | FRICTION),
    "helical_set/full": ("helical_set", {"level": FULL}),
    "helical_set/rk45": ("helical_set", {"level": FAST, "integrator": RK45}),
}
ADOPTIONS: dict[str, tuple[str, Parameters, Parameters]] = {
    "adopt/pair": ("pair", {"level": FAST}, {"level": FULL, "slices": 2.0, "integrator": EM}),
    "adopt/helical_friction": (
        "helical",
        {"level": RIGID},
        {"level": STANDARD, "slices": 4.0} | FRICTION | LESS_DAMPED,
    ),
}
STATICS: dict[str, tuple[str, Parameters]] = {
    "statics/pair": ("pair", {"level": FAST}),
    "statics/deviating": ("deviating", {"level": RIGID}),
    "statics/train": ("train", {"level": FAST}),
    "statics/pin_errors": ("pin_errors", {"level": FAST}),
    "statics/helical_set": ("helical_set", {"level": RIGID}),
}


class Record:
    """Everything that a run answers, for its hash, and a few numbers of it that can be read."""

    def __init__(self) -> None:
        self._hashed = hashlib.sha256()
        self.rows: list[dict[str, float]] = []
        self.numbers: dict[str, float] = {}

    def add(self, *values: float) -> None:
        self._hashed.update(struct.pack(f"<{len(values)}d", *values))

    @property
    def result(self) -> dict[str, float | str]:
        """`bits`: 16 hex digits; then the numbers, SI, to six digits."""
        return {"bits": self._hashed.hexdigest()[:16]} | {k: float(f"{v:.6g}") for k, v in self.numbers.items()}


def _run(kernel: Kernel, stage: Stage, steps: range, record: Record) -> None:
    """Adds all outputs at every communication step, and how the run ends if it ends early."""
    outputs = [v.name for v in kernel.variables.values() if v.causality == "output"]
    for i in steps:
        stage.drive(kernel, i)
        outcome = kernel.try_step(i * STEP, STEP)
        values = [kernel.get(name) for name in outputs]
        record.add(outcome, *values)
        record.rows.append(dict(zip(outputs, values, strict=True)))
        if outcome:
            break


def of_motion(rows: list[dict[str, float]]) -> dict[str, float]:
    """Mean and swing of transmission error and force of the first mesh, share of the samples with a closed contact, rms
    of the bearing forces, energy left by the balance, iterations."""
    mesh = next(name for name in rows[0] if name.endswith(".te")).removesuffix(".te")
    te, force, touch = (np.array([row[f"{mesh}.{last}"] for row in rows]) for last in ("te", "force", "contact"))
    bearings = [name for name in rows[0] if name.startswith("bearing.") and name[-3:] in (".fx", ".fy", ".fz")]
    return {
        "te_mean": te.mean(),
        "te_swing": te.std(),
        "force_mean": force.mean(),
        "force_swing": force.std(),
        "closed": touch.mean(),
        "bearing_rms": float(np.sqrt(np.mean([[row[name] ** 2 for name in bearings] for row in rows]))),
        "energy_left": rows[-1]["energy.residual"],
        "iterations": rows[-1]["solver.iterations"],
    }


def run_result(name: str, stage: Stage, library: Path | None) -> Record:
    """Of a run in RUNS."""
    kernel, record = stage.kernel(RUNS[name][1], library), Record()
    kernel.initialize()
    _run(kernel, stage, range(stage.steps), record)
    record.numbers = of_motion(record.rows)
    return record


def adopt_result(name: str, stage: Stage, library: Path | None) -> Record:
    """Of a run in ADOPTIONS, half of it with either setup."""
    _, before, after = ADOPTIONS[name]
    record, half = Record(), stage.steps // 2
    first, second = stage.kernel(before, library), stage.kernel(after, library, again=False)
    first.initialize()
    _run(first, stage, range(half), record)
    second.adopt(first)
    _run(second, stage, range(half, stage.steps), record)
    record.numbers = of_motion(record.rows)
    return record


def statics_result(name: str, stage: Stage, library: Path | None) -> Record:
    """Of the transmission at some positions, afresh and continued, of the rest under balanced torques, and of every
    array of the linear model under load."""
    kernel, record = stage.kernel(STATICS[name][1], library), Record()
    kernel.prepare()
    ports, meshes = kernel.ports, sum(v.name.endswith(".te") for v in kernel.variables.values())
    torque = 150.0 if "pin" not in name and "set" not in name else 400.0
    found = [
        kernel.transmission(0.01 * i, torque if i < 3 else -torque, mesh=i % meshes, keep=i % 2 == 1) for i in range(4)
    ]
    for at in found:
        record.add(at.te, at.phi, *(number for key, of in at.forces.items() for number in (*key, *of)))
    balance = kernel.transmission(0.1, torque).phi - kernel.transmission(0.0, torque).phi
    rest = kernel.rest({ports[0]: torque, ports[1]: -torque * round(balance / 0.1, 9)})
    kernel.transmission(0.004, torque)
    linear = kernel.linearise()
    record.add(*rest.values())
    for field in dataclasses.fields(LinearModel):
        record.add(*np.asarray(getattr(linear, field.name), float).ravel())
    record.numbers = {f"te_{i}": at.te for i, at in enumerate(found)} | {
        "force_max": max(max(of) for of in found[0].forces.values()),
        "rest": rest[ports[0]],
        "own_mean": float(np.diag(linear.own).mean()),
        "residual_mean": float(np.diag(linear.residual).mean()),
    }
    return record


def cases() -> Iterator[tuple[str, Callable[[Path | None], Record]]]:
    """Name and answer of every run, stage by stage."""
    for of, stage in stages().items():
        for table, answer in ((RUNS, run_result), (ADOPTIONS, adopt_result), (STATICS, statics_result)):
            yield from ((name, partial(answer, name, stage)) for name, (own, *_) in table.items() if own == of)
