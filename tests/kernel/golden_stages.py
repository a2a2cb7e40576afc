"""Golden digests of every other kind of stage and calculation: helical pair, train, sets, friction, film, nodal
contact, deviations, `adopt`, statics and linear models."""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from collections.abc import Callable, Iterator, Mapping
from functools import cache, lru_cache, partial
from pathlib import Path

import numpy as np
from golden_models import golden_model
from small_model import pair_blob, with_nodes

from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import LinearModel
from gearfmu.stage.build.blob import read_blob, write_blob

STEP = 2e-5  # s, communication step
RIGID, FAST, STANDARD, FULL, PAPER, EXPLICIT = map(float, range(6))
DG4, MIX4, EM, RK45, CENTRAL = map(float, range(5))
NODAL = 2.0
FRICTION = {"effect.friction": 1.0}
FILM = {"effect.film": 1.0}
BARE = {f"effect.{name}": 0.0 for name in ("coriolis", "centrifugal", "gyroscopic")}
SIMPLE = {f"effect.{name}": 0.0 for name in ("hertz", "residual", "tip_contact", "coast_flank")}

Parameters = dict[str, float]


@dataclasses.dataclass(frozen=True)
class Stage:
    """A model and how it is run. speed (rad/s), torque (N·m) by port: speeds of outer ends or at the start of ports
    driven by torques, which reverse after so many steps; slices: where a run says no other number."""

    blob: Callable[[], bytes]
    speed: Mapping[str, float]
    torque: Mapping[str, float]
    slices: int = 3
    steps: int = 40
    reversed_every: int = 15

    def kernel(self, parameters: Mapping[str, float], library: Path | None, again: bool = True) -> Kernel:
        """Loaded, not yet initialised; again: in the memory of the last one of this model, which is no longer used."""
        kernel = _kernel(self.blob(), library) if again else Kernel(self.blob(), None, library)
        kernel._lib.gk_defaults(kernel._model, kernel._data)
        for name, value in ({"slices": self.slices} | dict(parameters)).items():
            kernel.set(name, value)
        for port, speed in self.speed.items():
            if f"{port}.w_start" in kernel.variables:
                kernel.set(f"{port}.w_start", speed)
        self.drive(kernel, 0)
        return kernel

    def drive(self, kernel: Kernel, i: int) -> None:
        """Inputs of communication step i: torques that reverse, or outer ends that turn with a twist."""
        sense = -0.6 if i // self.reversed_every % 2 else 1.0
        for port, speed in self.speed.items():
            if kernel.variables[f"{port}.tau"].causality == "input":
                kernel.set(f"{port}.tau", sense * self.torque[port])
            else:
                kernel.set(f"{port}.w", speed)
                kernel.set(f"{port}.phi", speed * i * STEP + sense * self.torque[port] * 1e-4)


@lru_cache(maxsize=1)
def _kernel(blob: bytes, library: Path | None) -> Kernel:
    """Memory of a set is hundreds of megabytes: it is taken once for all runs of a model."""
    return Kernel(blob, None, library)


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


SMALL = {"pinion": 250.0, "wheel": -250.0 * 16 / 24}
HELICAL = {"pinion": 300.0, "wheel": -300.0 * 2 / 3}
SUN, HELICAL_SUN = 1 + 54 / 18, 1 + 64 / 26
STAGES = {
    "pair": Stage(partial(pair_blob, ("torque", "spring")), SMALL, {"pinion": 150.0, "wheel": 0.0}),
    "nodal": Stage(_nodal, SMALL, {"pinion": 150.0, "wheel": 0.0}),
    "helical": Stage(partial(golden_model, "helical_pair"), HELICAL, {"pinion": 200.0, "wheel": 300.0}),
    "deviating": Stage(_deviating, HELICAL, {"pinion": 200.0, "wheel": 300.0}),
    "train": Stage(
        partial(golden_model, "train"), {"input": 500.0, "output": 500.0 * 19 / 73 * 25 / 61},
        {"input": 250.0, "output": -250.0}, steps=16, reversed_every=8,
    ),
    "pin_errors": Stage(
        partial(golden_model, "pin_errors"), {"carrier": 60.0, "sun": 60.0 * SUN},
        {"carrier": 600.0, "sun": -600.0 / SUN}, steps=20, reversed_every=8,
    ),
    "helical_set": Stage(
        partial(golden_model, "helical_set"), {"carrier": 60.0, "sun": 60.0 * HELICAL_SUN},
        {"carrier": 300.0, "sun": -300.0 / HELICAL_SUN}, steps=20, reversed_every=8,
    ),
}  # fmt: skip

RUNS: dict[str, tuple[str, Parameters]] = {
    "helical/rigid": ("helical", {"level": RIGID}),
    "helical/fast": ("helical", {"level": FAST}),
    "helical/full": ("helical", {"level": FULL}),
    "helical/mix4": ("helical", {"level": FAST, "integrator": MIX4}),
    "helical/em": ("helical", {"level": FAST, "integrator": EM}),
    "helical/rk45": ("helical", {"level": FAST, "integrator": RK45}),
    "helical/explicit": ("helical", {"level": EXPLICIT}),
    "helical/simple": ("helical", {"level": PAPER, "slices": 2.0} | SIMPLE),
    "helical/friction": ("helical", {"level": FAST, "friction_law": 2.0} | FRICTION),
    "helical/film": ("helical", {"level": FAST} | FILM),
    "deviating/fast": ("deviating", {"level": FAST}),
    "deviating/friction": ("deviating", {"level": RIGID} | FRICTION | FILM),
    "train/rigid": ("train", {"level": RIGID, "slices": 1.0}),
    "train/standard": ("train", {"level": STANDARD, "slices": 2.0}),
    "train/em": ("train", {"level": FAST, "integrator": EM, "slices": 1.0}),
    "pin_errors/rigid": ("pin_errors", {"level": RIGID, "slices": 1.0}),
    "pin_errors/fast": ("pin_errors", {"level": FAST, "slices": 1.0}),
    "pin_errors/em": ("pin_errors", {"level": FAST, "integrator": EM, "slices": 1.0} | BARE),
    "pin_errors/friction": ("pin_errors", {"level": RIGID, "slices": 1.0} | FRICTION),
    "pin_errors/film": ("pin_errors", {"level": RIGID, "slices": 1.0} | FILM),
    "helical_set/rigid": ("helical_set", {"level": RIGID, "slices": 1.0}),
    "helical_set/full": ("helical_set", {"level": FULL, "slices": 1.0}),
    "helical_set/rk45": ("helical_set", {"level": FAST, "integrator": RK45, "slices": 1.0}),
    "pair/film": ("pair", {"level": FAST, "contact_damping": 0.0} | FILM),
    "pair/film_em": ("pair", {"level": FULL, "integrator": EM} | FILM),
    "nodal/paper": ("nodal", {"level": PAPER}),
    "nodal/central": ("nodal", {"level": FULL, "integrator": CENTRAL, "contact": NODAL}),
}
ADOPTIONS: dict[str, tuple[str, Parameters, Parameters]] = {
    "adopt/pair": ("pair", {"level": FAST}, {"level": FULL, "slices": 2.0, "integrator": EM}),
    "adopt/helical_friction": ("helical", {"level": RIGID}, {"level": STANDARD, "slices": 4.0} | FRICTION),
    "adopt/train": ("train", {"level": FAST, "slices": 1.0}, {"level": RIGID, "slices": 1.0}),
}
STATICS: dict[str, tuple[str, Parameters]] = {
    "statics/pair": ("pair", {"level": FAST}),
    "statics/helical": ("helical", {"level": STANDARD}),
    "statics/deviating": ("deviating", {"level": RIGID}),
    "statics/train": ("train", {"level": FAST, "slices": 2.0}),
    "statics/pin_errors": ("pin_errors", {"level": FAST, "slices": 1.0}),
    "statics/helical_set": ("helical_set", {"level": RIGID, "slices": 1.0}),
}


class Digest:
    """SHA-256 over numbers."""

    def __init__(self) -> None:
        self._hashed = hashlib.sha256()

    def add(self, *values: float) -> None:
        self._hashed.update(struct.pack(f"<{len(values)}d", *values))

    @property
    def text(self) -> str:
        """16 hex digits."""
        return self._hashed.hexdigest()[:16]


def _run(kernel: Kernel, stage: Stage, steps: range, digest: Digest) -> None:
    """Adds all outputs at every communication step, and how the run ends if it ends early."""
    outputs = [v.name for v in kernel.variables.values() if v.causality == "output"]
    for i in steps:
        stage.drive(kernel, i)
        outcome = kernel.try_step(i * STEP, STEP)
        digest.add(outcome, *(kernel.get(name) for name in outputs))
        if outcome:
            break


def run_digest(name: str, library: Path | None) -> str:
    """Of a run in RUNS."""
    stage, digest = STAGES[RUNS[name][0]], Digest()
    kernel = stage.kernel(RUNS[name][1], library)
    kernel.initialize()
    _run(kernel, stage, range(stage.steps), digest)
    return digest.text


def adopt_digest(name: str, library: Path | None) -> str:
    """Of a run in ADOPTIONS, half of it with either setup."""
    of, before, after = ADOPTIONS[name]
    stage, digest = STAGES[of], Digest()
    first, second = stage.kernel(before, library), stage.kernel(after, library, again=False)
    first.initialize()
    half = stage.steps // 2
    _run(first, stage, range(half), digest)
    second.adopt(first)
    _run(second, stage, range(half, stage.steps), digest)
    return digest.text


def statics_digest(name: str, library: Path | None) -> str:
    """Of the transmission at some positions, afresh and continued, of the rest under balanced torques, and of the
    linear model."""
    of, parameters = STATICS[name]
    stage, digest = STAGES[of], Digest()
    kernel = stage.kernel(parameters, library)
    kernel.prepare()
    ports = kernel.ports
    meshes = sum(v.name.endswith(".te") for v in kernel.variables.values())
    torque = next(iter(stage.torque.values()))
    for i in range(4):
        found = kernel.transmission(0.01 * i, torque if i < 3 else -torque, mesh=i % meshes, keep=i % 2 == 1)
        digest.add(found.te, found.phi, *(number for key, of in found.forces.items() for number in (*key, *of)))
    balance = stage.speed[ports[0]] / stage.speed[ports[1]]
    rest = kernel.rest({ports[0]: torque, ports[1]: -torque * balance})
    digest.add(*rest.values())
    return f"{digest.text} {_linear(kernel, torque)}"


def _linear(kernel: Kernel, torque: float) -> str:
    """Of every array of the linear model under load."""
    digest = Digest()
    kernel.transmission(0.004, torque)
    linear = kernel.linearise()
    for field in dataclasses.fields(LinearModel):
        digest.add(*np.asarray(getattr(linear, field.name), float).ravel())
    return digest.text


def cases() -> Iterator[tuple[str, Callable[[str, Path | None], str]]]:
    """Name and digest of everything here, stage by stage."""
    for stage in STAGES:
        for table, digest in ((RUNS, run_digest), (ADOPTIONS, adopt_digest), (STATICS, statics_digest)):
            yield from ((name, digest) for name, (of, *_) in table.items() if of == stage)


def stage_digests(library: Path | None = None, part: str = "") -> dict[str, str]:
    """Case → digest, with this build of the kernel; part: of the names of those that are made."""
    return {name: digest(name, library) for name, digest in cases() if part in name}
