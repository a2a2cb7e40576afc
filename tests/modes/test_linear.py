"""The linearised stage: oscillators by hand, difference quotients of statics, free vibration of the kernel, springs
varied one by one, ports and chains."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
from slices import by_functions_alone

from gearfmu.body import load_bodies
from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import LinearModel
from gearfmu.modes.linear import Linearised, followed, full_kernel, linearised, shaft_rows, stage_modes
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.run.limits import largest_torque, places_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import ChainSpec

TORQUE = 302.0
FREE = {name: {"kind": "torque", "chain": None} for name in ("pinion", "wheel")}


@dataclass(frozen=True)
class Stage:
    """A shipped stage with its bodies, assembled."""

    spec: Any
    bodies: list[Any]
    model: StageModel

    @cached_property
    def kernel(self) -> Kernel:
        return full_kernel(self.model)


def shipped(name: str) -> Stage:
    spec = load_stage(name)
    bodies = load_bodies(spec)
    return Stage(spec, bodies, assemble(spec, bodies))


@pytest.fixture(scope="module")
def fzg() -> Stage:
    return shipped("fzg_c")


@pytest.fixture(scope="module")
def stages(fzg: Stage) -> dict[str, Stage]:
    """Spur, helical, a train."""
    return {"fzg_c": fzg, "helical_demo": shipped("helical_demo"), "two_stage": shipped("two_stage")}


def with_ports(stage: Stage, **ports: dict) -> StageModel:
    changed = {name: port.model_copy(update=ports.get(name, {})) for name, port in stage.spec.ports.items()}
    return assemble(rewritten(stage.spec, ports=changed), stage.bodies)


# ---- by hand --------------------------------------------------------------------------------------------------------
def by_hand(**values: Any) -> Linearised:
    """One coordinate, one row that is a contact, no supports, but for what is given."""
    none = {field.name: np.zeros(0) for field in fields(LinearModel)}
    empty = np.zeros((0, 1))
    one = {"group": [0], "number": [0], "mass": [1.0], "omega": [0.0], "zeta": [0.0], "label": [[0, 0, 0, 0]],
           "force": [1.0], "dashpot": [0.0], "te": [-1.0], "rows": [[1.0]], "residual": [[0.0]], "own": [[1.0]],
           "support_rows": empty, "support_forces": empty, "support_damping": empty, "damper_rows": empty}  # fmt: skip
    arrays = {name: np.asarray(value) for name, value in (none | one | values).items()}
    return Linearised(LinearModel(**arrays | {"engagements": 1}))


def test_one_oscillator_behind_two_flexibilities_in_series() -> None:
    """2 kg on 3 µm/N of its own and 1 µm/N of residual; the dashpot lies beside the 3 µm/N."""
    system = by_hand(mass=[2.0], residual=[[1e-6]], own=[[3e-6]], dashpot=[5.0], label=[[-1, 0, 0, 0]])
    frequency, damping, shares, _ = system.modes(1)
    omega = np.sqrt(1 / 4e-6 / 2)
    assert frequency[0] == pytest.approx(omega / (2 * np.pi), rel=1e-12)
    assert damping[0] == pytest.approx(0.5 * 5.0 * omega * 3e-6 * 3 / 4, rel=1e-12)
    assert shares[0] == pytest.approx([0, 0, 1, 0])


def test_a_mode_of_a_body_keeps_its_damping() -> None:
    frequency, damping, shares, mesh_force = by_hand(omega=[900.0], zeta=[0.02], rows=[[0.0]]).modes(1)
    assert (2 * np.pi * frequency[0], damping[0], mesh_force[0, 0]) == pytest.approx((900.0, 0.02, 0.0))
    assert shares[0] == pytest.approx([0, 0, 0, 1])


def test_a_support_and_its_damper() -> None:
    """A mounted oscillator of 900 rad/s whose spring of 2 µm/N carries 300 N per unit: share 2e-6·300²/900²; its damper
    alone gives c (2e-6·300)²/(2·900)."""
    system = by_hand(omega=[900.0], rows=[[0.0]], support_compliance=[2e-6], support_rows=[[300.0]],
                     support_forces=[[0.0]], damper=[40.0], damper_rows=[[6e-4]])  # fmt: skip
    _, damping, shares, _ = system.modes(1)
    assert shares[0] == pytest.approx([0, 2e-6 * 300**2 / 900**2, 0, 1 - 2e-6 * 300**2 / 900**2])
    assert damping[0] == pytest.approx(40 * 6e-4**2 / (2 * 900), rel=1e-12)


# ---- by other methods -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "bearings"),
    [("fzg_c", 1.0), ("fzg_c", 0.0), ("helical_demo", 1.0), ("two_stage", 1.0)]
    + [pytest.param(name, 0.0, marks=pytest.mark.full) for name in ("helical_demo", "two_stage")],
)
def test_statics_are_the_tangent_of_the_contact_routine(stages: dict[str, Stage], name: str, bearings: float) -> None:
    """Angle of the input per torque with the output held: statics of (29) – modes, residual, local law, bearings,
    shafts – against a difference quotient, where no tip edge carries (its contact moves along the edge, which (29) does
    not know)."""
    model = stages[name].model
    torque, pitch = 0.5 * largest_torque(model), max((place.pitch for place in places_of(model)), key=abs)
    level = 1.0 if name == "two_stage" else 3.0
    kernel = model.kernel(**{"level": level, "effect.bearings": bearings, "effect.tip_contact": 0.0})
    kernel.prepare()
    for place in (3, 5, 7):
        ends = [kernel.transmission(-place / 8 * pitch, torque * (1 + e)).phi for e in (-1e-4, 1e-4)]
        mine, theirs = (
            input_compliance(linearised(model, torque, place / 8, kernel)),
            np.diff(ends)[0] / (2e-4 * torque),
        )
        print(f"{name}, bearings {bearings:g}, {place}/8: {mine:.5e} rad/(N m), {mine / theirs - 1:+.1e}")
        assert mine == pytest.approx(theirs, rel=3e-3)


def input_compliance(system: Linearised) -> float:
    """Angle of the first port's bore under a unit moment there, the second port's bore held, others free."""
    linear, own = system.linear, system.linear.own.copy()
    ports = {int(port): row for row, (mesh, port, *_) in enumerate(linear.label) if mesh < 0}
    assert set(ports) == {0, 1}
    own[ports[0], ports[0]], own[ports[1], ports[1]] = 1e6, 1e-16
    stiffness = replace(system, linear=replace(linear, own=own)).stiffness
    row, residual = ports[0], linear.residual
    inner = np.linalg.inv(residual + own)
    load = linear.rows.T @ (np.eye(len(own))[row] - inner @ residual[:, row])
    moved = np.linalg.solve(stiffness, load)
    force = -inner @ (linear.rows @ moved + residual[:, row])
    return float(linear.rows[row] @ moved + residual[row] @ force + residual[row, row])


# ---- free vibration of the kernel -----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Pluck:
    """A stage at rest under a twist (rad) of its input, which then changes by a thousandth: internal step (s), four of
    them to a communication step, number of those, every how manieth is kept, outputs to read, level."""

    twist: float
    h: float
    steps: int
    keep: int
    outputs: tuple[str, ...]
    level: float = 3.0


PLUCKS = {
    "fzg_c": Pluck(0.03, 2.5e-6, 1200, 2, ("pinion.gear.w", "bearing.pinion.fx")),
    "helical_demo": Pluck(0.03, 2.5e-6, 1200, 2, ("pinion.gear.w", "bearing.pinion.fz")),
    # not input.gear.w, in which two lines 4 Hz apart ring; kept densely: a line of 4119 Hz would be seen at 2130 Hz
    "two_stage": Pluck(0.05, 5e-6, 1500, 4, ("bearing.intermediate_left.fz", "stage2.te"), 1.0),
}


def ring(model: StageModel, pluck: Pluck, **parameters: float) -> tuple[Linearised, dict[str, np.ndarray]]:
    """Linear model at rest, and of every output (k, 3) frequency, damping ratio and amplitude of what rings."""
    kernel = model.kernel(**{"level": pluck.level, "h": pluck.h} | parameters)
    kernel.set(f"{model.shafts.input}.phi", pluck.twist)
    kernel.initialize()
    system = Linearised(kernel.linearise())
    kernel.set(f"{model.shafts.input}.phi", 1.001 * pluck.twist)
    signal = np.array([_outputs_after(kernel, i, pluck) for i in range(pluck.steps)])[2 :: pluck.keep]
    lines = [decaying_sinusoids(values - values.mean(), 4 * pluck.h * pluck.keep, 40) for values in signal.T]
    return system, dict(zip(pluck.outputs, lines, strict=True))


def _outputs_after(kernel: Kernel, step: int, pluck: Pluck) -> list[float]:
    kernel.step(step * 4 * pluck.h, 4 * pluck.h)
    return [kernel.get(name) for name in pluck.outputs]


def decaying_sinusoids(values: np.ndarray, step: float, order: int) -> np.ndarray:
    """(k, 3): frequency (Hz), damping ratio, amplitude of a sum of decaying sinusoids: matrix pencil (Hua and Sarkar
    1990) on the `order` largest singular vectors."""
    half = len(values) // 2
    _, _, right = sl.svd(sl.hankel(values[: len(values) - half], values[len(values) - half - 1 :]), full_matrices=False)
    basis = right[:order].T
    poles = np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])
    amplitude = np.linalg.lstsq(poles[None] ** np.arange(len(values))[:, None], values.astype(complex), rcond=None)[0]
    s = np.log(poles) / step
    found = np.stack([np.abs(s) / (2 * np.pi), -s.real / np.abs(s), 2 * np.abs(amplitude)], axis=1)
    found = found[(s.imag > 0) & (found[:, 1] > 0.001) & (found[:, 1] < 0.05)]
    return found[found[:, 2] > 0.05 * found[:, 2].max()]


@pytest.mark.parametrize("name", list(PLUCKS))
def test_a_plucked_stage_rings_at_these_frequencies(stages: dict[str, Stage], name: str) -> None:
    """The run of the kernel, not its matrices: mesh position frozen, contact dashpots off, every other damper on."""
    system, lines = ring(stages[name].model, PLUCKS[name], **{"effect.roll_motion": 0, "effect.contact_damping": 0})
    frequency, damping, *_ = system.modes(40)
    for output, found in lines.items():
        nearest = np.abs(frequency / found[:, :1] - 1).argmin(axis=1)
        off, loss = found[:, 0] / frequency[nearest] - 1, found[:, 1] / damping[nearest] - 1
        print(f"{name} {output}: {found[:, 0].round(1)} Hz, off {off}, damping {found[:, 1]}, off {loss}")
        assert len(found) >= 3 and np.abs(off).max() < 6e-4 and np.abs(loss).max() < 0.02


def test_the_mesh_mode_loses_what_it_does_in_a_run(fzg: Stage) -> None:
    """With contact dashpots, frozen and turning: 95 % of a tooth's residual is in their path while its other flank is
    out of sight, 75 % where all flanks count (mesh position frozen). All of it would lose visibly more."""
    pluck = replace(PLUCKS["fzg_c"], outputs=("pinion.gear.w",))
    for turning in (0.0, 1.0):
        system, lines = ring(fzg.model, pluck, **{"effect.roll_motion": turning})
        frequency, damping, *_ = system.modes(12)
        mesh = int(system.modes(12)[3][:, 0].argmax())
        heard = lines["pinion.gear.w"]
        own = heard[np.abs(heard[:, 0] / frequency[mesh] - 1).argmin()]
        more = whole_residual(fzg.model, pluck, system, 0.95 if turning else 0.75).modes(12)[1][mesh]
        print(f"turning {turning:g}: mesh mode {own[0]:.0f} Hz, {own[1]:.3%}; linearised {frequency[mesh]:.0f} Hz, "
              f"{damping[mesh]:.3%}, with the whole residual {more:.3%}")  # fmt: skip
        assert own[0] == pytest.approx(frequency[mesh], rel=6e-3)
        assert own[1] == pytest.approx(damping[mesh], rel=0.03) and more > 1.03 * damping[mesh]


def test_slices_of_their_own_ring_and_lose_as_the_linear_model_says(stages: dict[str, Stage]) -> None:
    """The mesh mode of helical teeth, dashpots on, gears turning: what slices yield beside their width functions is in
    motion as it is in statics. Width functions alone ring higher and lose less: both are seen."""
    pluck, model = replace(PLUCKS["helical_demo"], outputs=("pinion.gear.w",)), stages["helical_demo"].model
    system, lines = ring(model, pluck, **{"effect.roll_motion": 1.0})
    alone, _ = ring(by_functions_alone(model), replace(pluck, steps=200), **{"effect.roll_motion": 1.0})
    said, others = (mesh_mode(linear) for linear in (system, alone))
    heard = lines["pinion.gear.w"]
    own = heard[np.abs(heard[:, 0] / said[0] - 1).argmin()]
    print(f"run {own[0]:.0f} Hz, {own[1]:.3%}; linear {said[0]:.0f} Hz, {said[1]:.3%}; by width functions {others}")
    assert own[0] == pytest.approx(said[0], rel=2e-3) and own[1] == pytest.approx(said[1], rel=0.02)
    assert others[0] > 1.002 * said[0] and others[1] < 0.97 * said[1]


def mesh_mode(system: Linearised) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of the mode that moves the mesh most."""
    frequency, damping, _, mesh_force = system.modes(30)
    mesh = int(mesh_force[:, 0].argmax())
    return float(frequency[mesh]), float(damping[mesh])


def whole_residual(model: StageModel, pluck: Pluck, system: Linearised, share: float) -> Linearised:
    """All of a tooth's residual in the path: without dampers the kernel keeps the local law alone in S."""
    kernel = model.kernel(**{"level": 3.0, "effect.contact_damping": 0.0})
    kernel.set("pinion.phi", pluck.twist)
    kernel.initialize()
    law = kernel.linearise().own
    path = (system.linear.own - law) / share
    return replace(system, linear=replace(system.linear, own=law + path, residual=system.compliance - law - path))


# ---- sums, shares, ports --------------------------------------------------------------------------------------------


def stiffer(fzg: Stage, group: int, factor: float) -> StageModel:
    """The pair with all bearings (group 1) or ports (2) stiffer by a factor."""
    if group == 2:
        return with_ports(fzg, **{name: {"k": factor * port.k} for name, port in fzg.spec.ports.items()})
    gears = tuple(
        g.model_copy(update={"bearing": g.bearing.model_copy(update={"stiffness": factor * g.bearing.stiffness})})
        for g in fzg.spec.written.gears
    )
    return assemble(rewritten(fzg.spec, gears=gears), fzg.bodies)


@pytest.mark.parametrize("group", [1, 2])
def test_shares_are_what_stiffer_springs_raise(fzg: Stage, group: int) -> None:
    """Rayleigh: dω²/ω² = share · dk/k, by models with springs 1 % stiffer and softer; under little load, so that they
    stand in the same place."""
    ends = [linearised(stiffer(fzg, group, factor), 1.0, 3 / 8).modes(6)[0] for factor in (1 / 1.01, 1.01)]
    raised = np.log(ends[1] / ends[0]) / np.log(1.01)
    shares = linearised(fzg.model, 1.0, 3 / 8, fzg.kernel).modes(6)[2][:, group]
    print(f"group {group}: shares {shares}, by difference {raised}")
    assert raised == pytest.approx(shares, rel=2e-3, abs=1e-4)


@pytest.mark.full
def test_elastic_shafts_have_their_share(stages: dict[str, Stage]) -> None:
    """Shafts of 1 % stiffer steel and as heavy: their share, beside what their ends yield beyond the stored modes."""
    train = stages["two_stage"]
    shafts = [body for body in train.spec.bodies if not hasattr(train.spec.bodies[body], "teeth")]
    assert shafts
    own = linearised(train.model, 150.0, 0.3, train.kernel, shaft_rows(train.model, train.bodies)).modes(8)
    without = linearised(train.model, 150.0, 0.3, train.kernel).modes(8)
    extra = own[2][:, 2] - without[2][:, 2]
    assert np.allclose(own[0], without[0]) and extra.min() > 0 and extra.max() < 1
    harder = {name: body.model_copy(update={"material": body.material.model_copy(
        update={"youngs_modulus": 1.01 * body.material.youngs_modulus})}) if name in shafts else body
        for name, body in train.spec.bodies.items()}  # fmt: skip
    model = assemble(train.spec.model_copy(update={"bodies": harder}), train.bodies)
    raised = 2 * np.log(linearised(model, 150.0, 0.3).modes(8)[0] / own[0]) / np.log(1.01)
    print(f"shafts: shares {extra}, by difference {raised}")
    assert raised == pytest.approx(extra, rel=0.1, abs=0.02)


def test_ports(fzg: Stage) -> None:
    """With torques on both shafts the stage turns freely: one rigid mode, which is not shown, in place of the
    lowest."""
    fixed = {name: {"kind": "fixed", "chain": None, "k": None, "c": None} for name in FREE}
    models = {"free": with_ports(fzg, **FREE), "spring": fzg.model, "fixed": with_ports(fzg, **fixed)}
    values = {name: np.linalg.eigvalsh(linearised(model, TORQUE, 0.375).stiffness) for name, model in models.items()}
    assert abs(values["free"][0]) < 1e-6 * values["free"][1] and values["spring"][0] > 0
    first = {name: linearised(model, TORQUE, 0.375).modes(1)[0][0] for name, model in models.items()}
    assert first["spring"] < first["fixed"] and first["spring"] < first["free"]


def test_a_chain_with_heavy_inertia_holds_the_shaft(fzg: Stage) -> None:
    """Inertia 10 kg·m² behind the chain's shaft: the same as that shaft as a port spring, and one slow mode more."""
    chain = ChainSpec(inertia="10 kg*m^2", disc_inertia="1e-3 kg*m^2", shaft_k="15e3 N*m/rad", shaft_c="0.2 N*m*s/rad")
    chained = with_ports(fzg, pinion={"kind": "spring", "chain": chain})
    spring = with_ports(fzg, pinion={"kind": "spring", "k": 15e3, "c": 0.2, "chain": None})
    one, other = (linearised(model, TORQUE, 0.375) for model in (chained, spring))
    assert len(one.linear.mass) == len(other.linear.mass) + 1
    (slow, *_), pinion = one.modes(1), fzg.bodies[0]
    mesh = loaded_te(fzg.model, [TORQUE], 8).stage_stiffness[0, 3] * pinion.flank.r_b**2
    behind = 1 / (1 / 15e3 + 1 / mesh + 1 / (40e3 * (pinion.flank.teeth / fzg.bodies[1].flank.teeth) ** 2))
    assert slow[0] == pytest.approx(np.sqrt((20e3 + behind) / 10) / (2 * np.pi), rel=2e-3)
    for theirs, mine in zip(other.modes(6)[:3], one.modes(7)[:3], strict=True):
        assert np.allclose(mine[1:], theirs, rtol=1e-3, atol=1e-5)


@pytest.mark.full
def test_mesh_mode_and_its_damping(fzg: Stage) -> None:
    """The contact dashpots of the shipped pair are those that give its mesh mode 3 % of critical."""
    found = stage_modes(with_ports(fzg, **FREE), fzg.bodies, TORQUE, 8, positions=8)
    loudest = found.mesh_force[:, :, 0].mean(axis=0).argmax()
    assert found.damping_ratio[:, loudest].mean() == pytest.approx(0.03, rel=0.1)


def test_a_stage_that_has_moved_on_is_not_at_rest(fzg: Stage) -> None:
    kernel = full_kernel(fzg.model)
    kernel.set("pinion.phi", 0.01)
    kernel.initialize()
    kernel.linearise()
    kernel.step(0.0, 1e-5)
    with pytest.raises(SimulationError):
        kernel.linearise()


# ---- modes followed by shape -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("seed", range(5))
def test_modes_whose_order_changes_keep_their_columns(seed: int) -> None:
    """Fixed mass-normalised shapes, a little disturbed and with any sign, in another order at every position."""
    dice = np.random.default_rng(seed)
    mass = dice.uniform(0.5, 2.0, 12)
    basis = np.linalg.qr(dice.normal(size=(12, 12)))[0][:, :8] / np.sqrt(mass)[:, None]
    shown = [dice.permutation(8) for _ in range(6)]
    shapes = [basis[:, order] * dice.choice([-1, 1], 8) + 0.02 * dice.normal(size=(12, 8)) for order in shown]
    columns = [order[own] for order, own in zip(shown, followed(mass, shapes), strict=True)]
    assert all(np.array_equal(column, columns[0]) for column in columns)
