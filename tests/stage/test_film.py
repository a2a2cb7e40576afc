"""Squeeze film in open gaps: exact solutions of a falling body, energy, no tension, and what a stage file says of it.
Stages on oil: tests/relations."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from driven import give, stepped
from flat import FlatContact, flat_blob, rigid_block
from scipy.integrate import solve_ivp

from evidence.energy.free import FreePair, Rattle, energies, started
from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stage.assembly.meshes import REACH, film_impulse
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import FilmSpec

DG4, EM, RK45, CENTRAL = 0.0, 1.0, 2.0, 3.0
MASS, LOAD, SPEED, START = 100.0, 300.0, 0.06, 105e-6  # reduced mass kg, N, m/s, m
OIL = {"viscosity": 1e-3, "roughness": 2e-6, "radius": 1.0, "width": 1.0}  # of a flat engagement
ON = {"effect.film": 1.0, "oil_viscosity": OIL["viscosity"], "film_roughness": OIL["roughness"]}


# ---- a falling body: exact -------------------------------------------------------------------------------------------
def film_resistance(gap: float, viscosity: float, roughness: float, radius: float, width: float) -> float:
    """c of f = −c ḋ (N·s/m) at a gap (m) of two flanks of relative radius of curvature and width (m), docs/theory.md
    (8q); 0 from REACH on."""
    if gap >= REACH:
        return 0.0
    ends = (gap + roughness) ** -1.5 - (REACH + roughness) ** -1.5
    return 3 * math.sqrt(2) * math.pi * viscosity * width * radius**1.5 * ends


def falling(h: float, integrator: float, settings: Mapping[str, float], compliance: float = 0.0) -> Kernel:
    """Two free bodies that approach under LOAD."""
    kernel = Kernel(
        flat_blob("plates", [rigid_block(2 * MASS, compliance)] * 2, FlatContact(gap=START)),
        {"left.w_start": SPEED, "h": h, "level": 3.0, "integrator": integrator, **settings},
    )
    kernel.initialize()
    give(kernel, {"left.tau": LOAD, "right.tau": -LOAD})
    return kernel


def fall(kernel: Kernel, count: int, h: float, *names: str) -> tuple[np.ndarray, ...]:
    """Gap (m) and outputs after each of so many steps of h."""
    right, left, *others = stepped(kernel, count, h, "right.gear.phi", "left.gear.phi", *names).T
    return START + right - left, *others


def reference(end: float) -> object:
    """m d̈ = −F − c(d) ḋ while the gap closes, to 1e-10."""

    def rates(_: float, y: np.ndarray) -> list[float]:
        resisted = film_resistance(y[0], **OIL) * min(y[1], 0.0)
        return [y[1], (-LOAD - resisted) / MASS]

    done = solve_ivp(rates, (0.0, end), [START, -SPEED], method="Radau", rtol=1e-10, atol=1e-15, dense_output=True,
                     max_step=1e-5)  # fmt: skip
    return done.sol


@pytest.mark.parametrize(("integrator", "order"), [(DG4, 2), (EM, 2), (CENTRAL, 2), (RK45, None)])
def test_a_falling_body_sinks_as_the_exact_solution(integrator: float, order: int | None) -> None:
    """From beyond the reach down to 4 µm: the trajectory converges to the solution of the differential equation."""
    end, exact, worst = 4e-3, reference(4e-3), []
    for h in (4e-5, 2e-5, 1e-5):
        kernel, count = falling(h, integrator, ON), round(end / h)
        (d,) = fall(kernel, count, h)
        worst.append(np.abs(d - exact(h * np.arange(1, count + 1))[0]).max())  # type: ignore[operator]
    assert d[-1] < 5e-6 and kernel.get("solver.retried_steps") == 0
    assert worst[-1] < 3e-9 if order else worst[-1] < 1e-10
    if order:
        assert worst[0] / worst[2] > 0.7 * 4**order


def test_momentum_and_thickness_are_the_closed_form() -> None:
    """What the film took is ∫ c dd between the thicknesses, in every step: m Δv + F t = I(d₀) − I(d), exactly. It
    lies between no oil and oil that reaches without end."""
    h = 1e-5
    d, left, right = fall(falling(h, DG4, ON), 400, h, "left.gear.w", "right.gear.w")
    momentum = MASS * (SPEED - left + right) + LOAD * h * np.arange(1, 401)
    expected = np.array([film_impulse(REACH, **OIL) - film_impulse(min(at, REACH), **OIL) for at in d])
    assert momentum == pytest.approx(expected, abs=2e-5 * momentum[-1])
    factor = 3 * math.sqrt(2) * math.pi * OIL["viscosity"]
    endless = factor * 2 * ((d + OIL["roughness"]) ** -0.5 - (REACH + OIL["roughness"]) ** -0.5)
    inside = d < 0.9 * REACH
    assert np.all(momentum[inside] > 0) and np.all(momentum[inside] < endless[inside])


def test_force_is_continuous_where_flanks_touch() -> None:
    """On a soft contact the force goes through the end of the film without a jump: its largest change in a step
    shrinks with the step."""
    largest = []
    for h in (2e-6, 1e-6):
        thin = {**ON, "oil_viscosity": 2e-4, "effect.contact_damping": 0.0}
        kernel = falling(h, DG4, thin, compliance=1e-8)
        _, force, pairs = fall(kernel, round(6e-3 / h), h, "mesh.force", "mesh.pairs")
        touch = int(np.flatnonzero(pairs)[0])
        assert force[touch - 1] > 0 and force.min() >= 0.0
        largest.append(np.abs(np.diff(force[touch - 5 : touch + 5])).max())
    assert largest[1] < 0.65 * largest[0]


def test_a_film_does_not_pull() -> None:
    """Bodies that part feel nothing: half-Sommerfeld."""
    kernel = falling(1e-5, DG4, ON)
    _, force = fall(kernel, 300, 1e-5, "mesh.force")
    assert force[-1] > 0
    give(kernel, {"left.tau": -LOAD, "right.tau": LOAD})
    d, force = fall(kernel, 1200, 1e-5, "mesh.force")
    opening = np.diff(d) > 0
    assert force.min() == 0.0 and opening.any() and not force[1:][opening].any()


# ---- gears -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("start", [Rattle(speed=0.3), Rattle(position=0.6, speed=0.3, play=10e-6),
                                   Rattle(speed=0.2, play=-5e-6), Rattle(position=0.37, load=30.0)])  # fmt: skip
@pytest.mark.parametrize("damped", [0.0, 1.0])
def test_energy_balances_and_never_grows(pair_free: FreePair, start: Rattle, damped: float) -> None:
    """Free rattle, jammed and loaded flanks, in single precision: what is gone stands in the film's loss. Modal damping
    meets an impulse with the speed of the moment, so that one step may give back what others took more; one start in
    twelve has a step whose contacts let the defect jump across zero."""
    grown, back, unsolved = (5e-5, 5e-5, 0) if damped else (2e-6, 1e-7, 1)
    for viscosity in (1e-4, 1e-2):
        settings = {"effect.film": 1.0, "oil_viscosity": viscosity, "h": 1e-5, "level": 1.0,
                    "effect.contact_damping": damped, "effect.modal_damping": damped}  # fmt: skip
        kernel = started(pair_free, start, settings)
        found = energies(kernel, 1e-5, 0.02)
        assert found.drift < 5e-6 and found.growth < grown  # single: 5e-7 without a film, 1.4e-6 with one
        assert found.retried_steps <= unsolved
        assert np.diff(found.dissipated).min() > -back * found.kinetic
        assert 0 < kernel.get("mesh.film_loss") <= 1.001 * found.dissipated[-1]


def test_the_loss_of_films_that_are_squeezed_out_hardly_depends_on_the_step(pair_free: FreePair) -> None:
    """Jammed flanks that meet through oil again and again. Found 3 %; without the last part of a film, what it carried
    before it closed, 31 %."""
    lost = []
    for h in (1e-5, 2.5e-6):
        settings = {"effect.film": 1.0, "oil_viscosity": 1e-2, "h": h, "level": 1.0,
                    "effect.contact_damping": 0.0, "effect.modal_damping": 0.0}  # fmt: skip
        kernel = started(pair_free, Rattle(speed=0.2, play=-5e-6), settings)
        energies(kernel, 1e-5, 0.02)
        lost.append(kernel.get("mesh.film_loss"))
    assert lost[0] == pytest.approx(lost[1], rel=0.1)


def test_off_reads_nothing_of_the_oil(plain: StageModel) -> None:
    bits = []
    for settings in ({}, {"oil_viscosity": 1.0, "film_roughness": 1e-8}):
        trace = simulate(plain, Steady(plain, 100.0, 2.0), 2e-3, 2e-5, {"level": 1.0, **settings})
        bits.append(trace["mesh.te"].tobytes() + trace["mesh.force"].tobytes())
        assert trace["mesh.film_loss"][-1] == 0.0
    assert bits[0] == bits[1]


# ---- what a stage says -----------------------------------------------------------------------------------------------
def test_a_stage_file_turns_the_film_on(spec: Stage, bodies: list[Body]) -> None:
    own = FilmSpec(viscosity=0.05, roughness=2e-6)
    stage = rewritten(spec, contact=spec.written.contact.model_copy(update={"film": own}))
    kernel = assemble(stage, bodies).kernel()
    found = [kernel.get(name) for name in ("effect.film", "oil_viscosity", "film_roughness")]
    assert found == [1.0, 0.05, 2e-6]


def test_nodal_contact_refuses_the_film(spec: Stage, bodies: list[Body]) -> None:
    with pytest.raises(ModelError, match="lines of contact"):
        assemble(spec, bodies).kernel(**{"effect.film": 1.0, "level": 4.0}).prepare()
