"""Refinement: a discretisation twice as fine moves results by less than the product states: every harmonic of the mesh
by 1 dB or 1 nm (slices of helical teeth: 7 nm from 7 on, 4 nm from 10 on), the order levels of forces by 1 dB or 1e-3
of the mean. And no level is worse than a cheaper one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from kinds import COARSE, FULL, KINDS, Kind, assembled, at_level, bodies_of, listed, some

from gearfmu.body import load_bodies
from gearfmu.body.toothed import reduced_gear
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.assembly.teeth import ROLLS
from gearfmu.stage.run.simulate import simulate
from gearfmu.stage.run.te import loaded_te
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec
from gearfmu.study.bench import Point, measure, models_for
from gearfmu.study.ladder import window
from gearfmu.study.norm import errors

HARMONICS = 8
LEVEL, LENGTH = 1.0, 1e-9  # dB, m
SHARE = 1e-3  # of the mean force: below it an order is not heard


def harmonics(kind: Kind, model: StageModel, load: float = 1.0, positions: int = 64, **parameters: float) -> np.ndarray:
    """(HARMONICS,) m, rms, of the static transmission error under `load` times the torque."""
    return loaded_te(model, [load * kind.torque], positions, **parameters).harmonics(HARMONICS)[0]


Of = Callable[[Kind], np.ndarray]


def own(**changed: float) -> Of:
    """Harmonics of the kind's own model."""
    return lambda kind: harmonics(kind, kind.model(), **changed)


def with_bodies(**finer: Any) -> Of:
    """Harmonics of the internal pair with other bodies."""

    def found(kind: Kind) -> np.ndarray:
        body = COARSE.model_copy(update=finer)
        bodies = {name: old.model_copy(update={"body": body}) for name, old in kind.stage.bodies.items()}
        stage = kind.stage.model_copy(update={"bodies": bodies})
        return harmonics(kind, assembled(stage, {gear.name: reduced_gear(gear) for gear in stage.gears}))

    return found


def with_twice_the_rolls(kind: Kind) -> np.ndarray:
    return harmonics(kind, assemble(kind.stage, listed(kind.stage, bodies_of(kind.file)), 2 * ROLLS))


MESH = MeshSpec(
    flank=8, thickness=2, root=4, rim=4, width=4
)  # with four along a flank a tenth of the eighth is missing
FINER_MESH = MESH.model_copy(update={"scale": 1.5})
ALL = ("pair", "internal", "helical", "train")
PARTS = ("helical", "train")  # lines of contact in parts (docs/theory.md, 2.6): margins 1.1 to 4
REFINED: list[tuple[str, tuple[str, ...], Of, Of, float]] = [  # what is refined, kinds, coarse, fine, least
    ("slices from 5", ALL[:2], own(slices=5.0), own(slices=10.0), LENGTH),
    ("slices from 7", PARTS, own(slices=7.0), own(slices=14.0), 7e-9),
    ("slices from 7 at part load", PARTS, own(load=0.3, slices=7.0), own(load=0.3, slices=14.0), 7e-9),
    ("slices from 10", PARTS, own(slices=10.0), own(slices=20.0), 4e-9),
    ("positions", ALL, own(), own(positions=128), LENGTH),
    ("modes", ("internal",), own(), with_bodies(modes=200), LENGTH),
    ("roll points", ("internal",), own(), with_bodies(roll_points=16), LENGTH),
    ("width functions", ("internal",), own(), with_bodies(width_functions=5), LENGTH),
    ("mesh", ("internal",), with_bodies(mesh=MESH), with_bodies(mesh=FINER_MESH), LENGTH),
    ("rolls", ("pair", "helical"), own(), with_twice_the_rolls, LENGTH),
]
QUICK_ONES = {("slices from 5", "pair"), ("positions", "pair"), ("positions", "internal"), ("modes", "internal")}
QUICK_ONES |= {("rolls", "pair")}


@pytest.mark.parametrize(
    ("name", "coarse", "fine", "least"),
    [
        pytest.param(name, *rest, id=f"{what}, {name}", marks=[FULL] * ((what, name) not in QUICK_ONES))
        for what, names, *rest in REFINED
        for name in names
    ],
)
def test_harmonics_hardly_move(name: str, coarse: Of, fine: Of, least: float) -> None:
    one, other = coarse(KINDS[name]), fine(KINDS[name])
    change = 20 * np.log10(np.maximum(one, 1e-30) / np.maximum(other, 1e-30))
    wrong = (np.abs(change) > LEVEL) & (np.abs(one - other) > least)
    assert not wrong.any(), [f"{k + 1}: {one[k]:.3g} → {other[k]:.3g}" for k in np.flatnonzero(wrong)]


def orders_of_a_run(speed: float, slices: int, teeth: int = 23) -> Mapping[str, np.ndarray]:
    """Amplitudes of orders 0 … 7 of the mesh frequency, by channel of forces; of the settled half of a run."""
    kind = KINDS["helical"]
    model = kind.model().driven_by_springs()
    trace = simulate(model, Steady(model, speed, kind.torque), 16e-3, 20e-6, at_level(model, slices=float(slices)))
    half = len(trace.time) // 2
    waves = np.exp(1j * speed * teeth * trace.time[half:, None] * np.arange(13))
    columns = np.hstack([waves.real, waves.imag[:, 1:]])
    return {
        name: np.hypot(found[:8], np.r_[0.0, found[13:20]])
        for name, channel in trace.channels.items()
        if name.endswith((".force_mean", ".fx_mean", ".fy_mean", ".fz_mean"))
        for found in [np.linalg.lstsq(columns, channel.values[half:], rcond=None)[0]]
    }


@pytest.mark.parametrize("speed", [209.0, pytest.param(400.0, marks=FULL)])
def test_orders_of_a_run_hardly_depend_on_the_slices(speed: float) -> None:
    """Of all forces with 5, 7 and 10: those that reach SHARE of the mean mesh force agree within 3 dB, margin 1.3."""
    runs = [orders_of_a_run(speed, slices) for slices in (5, 7, 10)]
    least = SHARE * runs[0]["mesh.force_mean"][0]
    for name in runs[0]:
        found = np.array([run[name][1:] for run in runs])
        low, high = found.min(axis=0), found.max(axis=0)
        assert (20 * np.log10(high / low)[high > least] < 3.0).all(), (name, found)


def run(name: str, level: str, h: float = 0.0, step: float = 20e-6, duration: float = 3e-3) -> Trace:
    """A kind's own run; h 0: the default step of the level."""
    kind = KINDS[name]
    model = kind.model().driven_by_springs()
    return simulate(model, Steady(model, kind.speed, kind.torque), duration, step, at_level(model, level, h=h))


def alternating(trace: Trace, ending: str, every: float = 20e-6) -> np.ndarray:
    """(channels, samples) of the last two thirds, without means."""
    skip = round(every / (trace.time[1] - trace.time[0]))
    rows = np.array([c.values[::skip] for name, c in trace.channels.items() if name.endswith(ending)])
    rows = rows[:, rows.shape[1] // 3 :]
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))


def rms(rows: np.ndarray) -> float:
    return float(np.sqrt(np.mean(rows**2)))


BANDS = (500.0, 2000.0, 6000.0, 16000.0)  # Hz


def bands(rows: np.ndarray, every: float = 20e-6) -> np.ndarray:
    """(channels, bands) rms of the rows between neighbouring frequencies of BANDS."""
    frequency = np.fft.rfftfreq(rows.shape[1], every)
    power = np.abs(np.fft.rfft(rows * np.hanning(rows.shape[1]))) ** 2
    return np.sqrt(np.diff([power[:, frequency < edge].sum(axis=1) for edge in BANDS], axis=0).T) / rows.shape[1]


@pytest.mark.parametrize("name", ["pair", pytest.param("train", marks=FULL)])
def test_half_the_step_and_half_the_communication_step(name: str) -> None:
    """Bands of the transmission error and of the bearings' forces, against the same run at half the default step and
    at half the communication step."""
    plain = run(name, "fast")
    h = 0.5 * float(plain["solver.h"][-1])
    bearing = max(
        float(np.abs(c.values).max()) for n, c in plain.channels.items() if n.endswith((".fx_mean", ".fy_mean"))
    )
    for finer in (run(name, "fast", h), run(name, "fast", step=10e-6)):
        for ending, least in ((".te", LENGTH), (".fx_mean", SHARE * bearing), (".fy_mean", SHARE * bearing)):
            if ending == ".te" or finer.time[1] > 15e-6:  # means over other steps are other means
                one, two = bands(alternating(plain, ending)), bands(alternating(finer, ending))
                heard = np.abs(one - two) > least
                assert (np.abs(20 * np.log10(one / two))[heard] < LEVEL).all(), (ending, one, two)


MARGIN = 1.05  # at equal error the sign of what a level leaves out decides: some parts of it cancel


@pytest.mark.parametrize("name", ["pair", *(pytest.param(name, marks=FULL) for name in ("set", "helical"))])
def test_level_full_is_not_worse_than_standard_at_their_default_steps(name: str) -> None:
    """Against level full at a tenth of the step: transmission error and mesh forces."""
    reference = run(name, "full", 0.625e-6)
    for ending in (".te", ".force_mean"):
        exact = alternating(reference, ending)
        standard, full = (rms(alternating(run(name, level), ending) - exact) for level in ("standard", "full"))
        assert full < MARGIN * standard, (ending, full / rms(exact), standard / rms(exact))


@FULL
def test_level_full_is_not_worse_than_standard_under_a_brake() -> None:
    """A set under a brake whose torque follows sampled speeds. Sees: oscillators that the step does not follow, dynamic
    at level full, ring with such a brake (.99 % of the transmission error where standard has .46)."""
    scene, spec = window(load_scene("planetary_paper")), load_stage("planetary54")
    model = models_for(scene, load_bodies(spec), set=spec.written.set, carrier=spec.written.carrier)

    def run(level: str, h: float) -> Any:
        return measure(scene, model, Point(level, h=h, slices=scene.stage.slices)).signals

    exact = run("full", 0.4e-6)
    standard, full = (errors(run(level, 0.0), exact) for level in ("standard", "full"))
    assert full.te < MARGIN * standard.te and full.force < MARGIN * standard.force


# ---- lines of contact in any number of parts -------------------------------------------------------------------------
YIELDS = {  # of the helical pair those that are rigid are quick, the others take eight seconds and more
    "all": {},
    "rigid gears": {"effect.elastic": 0.0},
    "straight contacts": {"effect.hertz": 0.0},
    "rigid gears, straight contacts": {"effect.elastic": 0.0, "effect.hertz": 0.0},
}


@pytest.mark.parametrize(
    "yields", ["rigid gears", *(pytest.param(y, marks=FULL) for y in YIELDS if y != "rigid gears")]
)
@pytest.mark.parametrize("kind", some(["helical"], ["train", "helical_set"]))
def test_any_number_of_parts_finds_equilibrium(kind: Kind, yields: str) -> None:
    """5, 12 and 20 parts, more than any body has width functions: the mean transmission error is that of 12 within
    1 %. Sees: a search that does not end where parts of a line outnumber the width functions of its teeth."""
    found = [loaded_te(kind.model(), [kind.torque], 3, slices=float(n), **YIELDS[yields]) for n in (5, 12, 20)]
    means = np.array([result.te.mean() for result in found])
    assert np.isfinite(means).all()
    assert means[[0, 2]] == pytest.approx(means[1], rel=1e-2)


@pytest.mark.full
@pytest.mark.parametrize("slices", [5, 7])
def test_no_line_of_the_transmission_error_at_the_parts(slices: int) -> None:
    """Of parts that entered one after the other there would be orders k·slices/overlap: none is above its neighbours by
    more than half."""
    kind, overlap = KINDS["helical"], 1.016
    found = loaded_te(kind.model(), [kind.torque], 400, slices=float(slices)).harmonics(80)[0]
    for order in np.round(np.arange(1, 80 * overlap / slices) * slices / overlap).astype(int):
        if 3 < order < 77:
            near = np.r_[found[order - 4 : order - 1], found[order : order + 3]]  # found[k - 1]: order k
            assert found[order - 1] < 1.5 * near.max(), order
