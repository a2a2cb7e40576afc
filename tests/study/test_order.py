"""Observed orders: of constant stiffness against the exact motion, of a turning mesh against a reference of the same
model; the exact motion against another solver.

The schemes hold the velocity that belongs to their sampled motion, which is ẋ + (h²/12)·x⃛: a motion that begins with a
speed and a changing force starts with an error of second order, once, and goes on with that of the scheme.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
from flat import FlatBody, FlatContact, flat_blob
from scipy.integrate import solve_ivp

from gearfmu.kernel import Kernel
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.bench import Point, measure, models_for
from gearfmu.study.ladder import fitting, window
from gearfmu.study.norm import errors

INTEGRATORS = {"dg4": 0, "em": 1, "rk45": 2}
EXPECTED = {"dg4": 4, "em": 2}  # for constant stiffness; after an impact 2
FULL_LEVEL = 3
END, COUNTS = 576e-6, (12, 16, 20, 28)  # s and steps: closed contact, errors above the rounding of rows
MESH_STEPS, MESH_REFERENCE = (5e-6, 1.25e-6), 0.625e-6 / 3  # s


def _body(mass: float, frequency: tuple[float, ...], rows: tuple[tuple[float, ...], ...]) -> FlatBody:
    omega = 2 * np.pi * np.array(frequency)
    return FlatBody(mass, omega, np.zeros(omega.size), np.array(rows), np.diag([4e-8, 1.5e-8]))


@dataclass(frozen=True)
class FlatPair:
    """Left body thrown with `speed` (m/s) against the right one at rest; contact 1 m wide in an even number of slices,
    with width functions P0 and P2."""

    left: FlatBody = field(default_factory=lambda: _body(0.8, (1.9e3,), ((0.5,), (0.3,))))
    right: FlatBody = field(default_factory=lambda: _body(1.7, (3.0e3,), ((0.6,), (-0.3,))))
    slices: int = 2
    speed: float = 0.2

    @property
    def bodies(self) -> tuple[FlatBody, FlatBody]:
        return self.left, self.right

    def blob(self) -> bytes:
        """The model that the kernel runs."""
        return flat_blob("flat_pair", self.bodies, FlatContact(slices=self.slices, degrees=(0, 2)))


def contact_rows(pair: FlatPair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rows (slices, n) of the gaps by mass-normalised coordinate (each body's rigid motion first), compliance
    (slices, slices) m/N, ω (n,)."""
    edges = np.linspace(-1, 1, pair.slices + 1)
    second = np.diff(0.5 * (edges**3 - edges)) / np.diff(edges)  # mean of P2 over each slice
    weights = np.stack([np.ones(pair.slices), 5 * second], axis=1)
    parts: list[np.ndarray] = []
    omega: list[np.ndarray] = []
    compliance = np.zeros((pair.slices, pair.slices))
    for body, direction in zip(pair.bodies, (-1, 1), strict=True):
        parts += [np.full((pair.slices, 1), direction / np.sqrt(body.mass)), -weights @ body.rows]
        omega += [np.zeros(1), body.omega]
        compliance += weights @ body.residual @ weights.T
    return np.hstack(parts), compliance, np.concatenate(omega)


def contact_frequencies(pair: FlatPair) -> np.ndarray:
    """Angular frequencies (k,), rad/s, of the two bodies while they are in contact: eigenvalues of Ω² + WᵀC⁻¹W, their
    common rigid motion left out."""
    rows, springs, omega = _linear(pair)
    square = np.linalg.eigvalsh(np.diag(omega**2) + rows.T @ springs @ rows)
    return np.sqrt(square[square > 1e-9 * square.max()])


def exact_force(pair: FlatPair, time: np.ndarray) -> np.ndarray:
    """Contact force (t,) N at `time` (t,) while the contact that closes at time 0 stays closed."""
    rows, springs, omega = _linear(pair)
    square, shape = np.linalg.eigh(np.diag(omega**2) + rows.T @ springs @ rows)
    v0 = np.zeros(omega.size)
    v0[0] = pair.speed * np.sqrt(pair.left.mass)
    root = np.sqrt(np.maximum(square, 0.0))
    part = np.where(root > 1.0, np.sin(np.outer(time, root)) / np.maximum(root, 1.0), time[:, None])
    q = (part * (shape.T @ v0)) @ shape.T
    return -(q @ rows.T @ springs).sum(axis=1)


def _linear(pair: FlatPair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rows, stiffness of the contact, ω. Slices that mirror each other are one contact: the inverse is that of the
    symmetric part."""
    rows, compliance, omega = contact_rows(pair)
    return rows, np.linalg.pinv(compliance), omega


def force_errors(pair: FlatPair, integrator: int, count: int) -> tuple[float, float]:
    """Relative rms of what is left of the contact force when harmonics of the exact contact frequencies are taken out;
    largest difference from the exact force over its largest value. Two bodies pressed together by their own speed."""
    h = END / count
    parameters = {"left.w_start": pair.speed, "h": h, "integrator": integrator, "level": FULL_LEVEL}
    kernel = Kernel(pair.blob(), parameters | {"effect.hertz": 0, "slices": pair.slices})
    kernel.initialize()
    found = np.empty(count)
    for k in range(count):
        kernel.step(k * h, h)
        found[k] = kernel.get("mesh.force")
    time = h * np.arange(1, count + 1)
    wanted = exact_force(pair, time)
    assert kernel.get("solver.retried_steps") == 0 and min(wanted.min(), found.min()) > 0, "contact must stay closed"
    angle = np.outer(time, contact_frequencies(pair))
    basis = np.hstack([np.sin(angle), np.cos(angle)])
    left = found - basis @ np.linalg.lstsq(basis, found, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2) / np.mean(found**2))), float(np.abs(found - wanted).max() / wanted.max())


def order(steps: tuple[float, ...], found: list[float]) -> float:
    """Seen between the last two steps (s)."""
    return float(np.log(found[-2] / found[-1]) / np.log(steps[-2] / steps[-1]))


def test_exact_motion_is_that_of_a_numerical_solution() -> None:
    pair = FlatPair()
    rows, compliance, omega = contact_rows(pair)
    springs, n = np.linalg.pinv(compliance), omega.size
    stiffness = np.diag(omega**2) + rows.T @ springs @ rows
    start = np.zeros(2 * n)
    start[n] = pair.speed * np.sqrt(pair.left.mass)
    time = np.linspace(0, END, 20)
    tight = {"rtol": 1e-11, "atol": 1e-16}
    solved = solve_ivp(lambda t, y: [*y[n:], *(-stiffness @ y[:n])], (0, END), start, "DOP853", time, **tight)
    wanted = -(springs @ rows @ solved.y[:n]).sum(axis=0)
    np.testing.assert_allclose(exact_force(pair, time), wanted, atol=1e-8 * wanted.max())
    assert contact_frequencies(pair).max() * END / min(COUNTS) < 1.2, "a mode would be trapezoidal"


def test_constant_stiffness_is_of_fourth_order_and_an_impact_of_second() -> None:
    steps = tuple(END / count for count in COUNTS)
    left, whole = {}, {}
    for name, number in INTEGRATORS.items():
        left[name], whole[name] = zip(*(force_errors(FlatPair(), number, count) for count in COUNTS), strict=True)
    print(left, whole)
    for name, expected in EXPECTED.items():
        assert order(steps, left[name]) == pytest.approx(expected, abs=0.25)
        assert order(steps, whole[name]) == pytest.approx(2, abs=0.25)
    assert left["dg4"][-1] < 1e-7 < left["em"][-1]
    assert max(*left["rk45"], *whole["rk45"]) < 5e-6  # its tolerance, at every h


@pytest.mark.parametrize(("dashpots", "ordered", "most"), [(True, ("dg4", "em"), 1e-2), (False, ("dg4",), 1e-3)])
def test_a_turning_mesh_is_of_second_order(dashpots: bool, ordered: tuple[str, ...], most: float) -> None:
    """em without dashpots is far from its limit at these steps (12 % at 2.5 µs). rk45 takes the contact dashpots up to
    first order in c, 0.7 % here; without dashpots it comes to the same motion."""
    short = window(load_scene("pair_loaded"), quick=True).model_copy(update={"duration": 0.02})
    scene, changes = (short, {}) if dashpots else without_dashpots(short)
    model, slices = models_for(scene, **changes), scene.stage.slices
    reference = measure(scene, model, Point("rigid", "dg4", MESH_REFERENCE, slices)).signals
    steps = tuple(fitting(scene.coupling.step, h) for h in MESH_STEPS)
    for name in (*ordered, "rk45"):
        runs = [measure(scene, model, Point("rigid", name, h, slices)) for h in steps]
        found = [errors(run.signals, reference).te for run in runs]
        print(name, found)
        assert order(steps, found) > 1.6 if name in ordered else max(found) < most, name


def without_dashpots(scene: SceneSpec) -> tuple[SceneSpec, Mapping[str, object]]:
    """The scene on shafts without damping, and changes of the stage that take the other dashpots away."""
    written = load_stage(scene.stage.name).written
    gears = [
        g.model_copy(update={"bearing": g.bearing.model_copy(update={"damping_ratio": 0.0})}) for g in written.gears
    ]
    rig = scene.test_rig.model_copy(update={"pinion_shaft_damping": 0.0, "wheel_shaft_damping": 0.0})
    changes = {"gears": tuple(gears), "contact": written.contact.model_copy(update={"damping": 0.0})}
    return scene.model_copy(update={"test_rig": rig}), changes
