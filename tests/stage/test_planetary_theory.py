"""Planetary sets of rigid bodies against theory: natural frequencies and mode classes of Lin & Parker 1999, what a pure
torque excites, how planets share the load, mesh phasing, free flight. Speeds, torques, momentum: test_set_scenes.py.

The kernel keeps rows in single precision, which shows as some 1e-8 to 1e-7."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import lin_parker
import numpy as np
import pytest
from driven import begun, give, stepped
from rigid_set import SPRINGS, TORQUE, Motion, Rigid, RigidSet, kernel_of
from scipy.integrate import cumulative_trapezoid

from gearfmu.kernel import Kernel
from gearfmu.modes.linear import linearised
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import TeResult, loaded_te

KNOWN = lin_parker.published()["params"]
ALONE = 0.2  # of a mesh period: every mesh has one pair in contact at a contact ratio of 1.02
FLOATING = Rigid(0.4, 0.39, 1e4)  # sun: 2e-5 of a mesh's stiffness
H = 2e-6


def slow(*values: object, name: str | None = None) -> Any:
    """A case for make test-full."""
    return pytest.param(*values, marks=pytest.mark.full, id=name)


def natural(rigid: RigidSet) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and shapes in the plane of the loaded set, from the linearised kernel."""
    model = rigid.model()
    system = linearised(model, 1.0, ALONE, kernel_of(model))
    assert len(system.linear.label) == 2 * rigid.planets and np.ptp(system.linear.label[:, 0]) == 2 * rigid.planets - 1
    return Motion(rigid, model).plane_modes(system)


@pytest.mark.parametrize("planets", [3, slow(4), 5])
def test_natural_frequencies_are_those_of_lin_and_parker(planets: int) -> None:
    rigid = RigidSet(planets)
    found, shapes = natural(rigid)
    printed = np.sort(lin_parker.published()["published"][str(planets)])
    on_paper, paper_shapes = lin_parker.modes(*lin_parker.matrices(KNOWN, rigid.angles()))
    assert found.size == printed.size and found[0] < 0.01
    assert np.allclose(found[1:], printed[1:], rtol=5e-4)
    assert np.allclose(found[1:], on_paper[1:], rtol=2e-7)
    classes = [lin_parker.class_of(shape, planets) for shape in shapes.T]
    assert classes == [lin_parker.class_of(shape, planets) for shape in paper_shapes.T]
    counted = [classes.count(name) for name in ("rotational", "translational", "planet")]
    assert counted == [6, 12, 3 * (planets - 3)]
    pairs = found[[name == "translational" for name in classes]].reshape(6, 2)
    assert np.allclose(pairs[:, 0], pairs[:, 1], rtol=2e-7)


def excitation(rigid: RigidSet) -> float:
    """Largest modal force of torques on carrier and sun that hold each other, on modes that are not rotational, over
    the largest on those that are."""
    _, shapes = natural(rigid)
    force = np.abs(shapes[lin_parker.CARRIER + 2] / rigid.base("carrier")
                   - shapes[lin_parker.SUN + 2] / rigid.base("sun") / rigid.ratio)  # fmt: skip
    rotational = np.array([lin_parker.class_of(shape, rigid.planets) == "rotational" for shape in shapes.T])
    return float(force[~rotational].max() / force[rotational].max())


def response(rigid: RigidSet) -> float:
    """A step of both torques at a standing mesh: what central bodies move across the axis and planets move unlike each
    other, over what planets move."""
    kernel = kernel_of(rigid.model(), h=H, **{"effect.roll_motion": 0.0})
    loads = {"carrier.tau": 100.0, "sun.tau": -100.0 / rigid.ratio}
    begun(kernel, loads)
    give(kernel, {name: 1.5 * torque for name, torque in loads.items()})
    planets = range(1, rigid.planets + 1)
    central = [f"{name}.{d}" for name in ("sun.gear", "ring.gear", "bearing.carrier") for d in "xy"]
    pins = [f"pin.planet{k}.{d}" for k in planets for d in "xy"]
    found = stepped(kernel, 100, 10 * H, *central, *pins, *(f"planet{k}.gear.phi" for k in planets))
    across, local, spin = np.split(found, [6, 6 + 2 * rigid.planets], axis=1)
    local = (local[:, ::2] + 1j * local[:, 1::2]) * np.exp(-1j * rigid.angles())
    unlike = np.abs(local - local.mean(axis=1, keepdims=True)).max()
    turned_unlike = rigid.base("planet") * np.ptp(spin, axis=1).max()
    return float(max(np.abs(across).max(), unlike, turned_unlike) / np.abs(local).max())


@pytest.mark.parametrize(("planets", "teeth"), [(3, (26, 34)), slow(4, (24, 36)), (5, (26, 34))])
def test_a_pure_torque_excites_rotational_modes_only(planets: int, teeth: tuple[int, int]) -> None:
    rigid = RigidSet(planets, teeth)
    assert excitation(rigid) < 1e-7 and response(rigid) < 2e-7


def test_a_pin_error_excites_other_modes_too() -> None:
    """What the test above measures is not zero by itself."""
    assert response(RigidSet(3, pins={1: (0.0, 1e-5)})) > 1e-2


def periods(rigid: RigidSet, torque: float, times: int = 1) -> TeResult:
    """Statics over one mesh period, at a multiple of the planets' number of positions."""
    return loaded_te(rigid.model(), [torque], times * {3: 12, 4: 12, 5: 10, 6: 12}[rigid.planets], **SPRINGS)


@pytest.mark.parametrize(("planets", "teeth"), [(3, (26, 34)), slow(4, (27, 33)), (5, (26, 34)), slow(6, (37, 23))])
def test_planets_of_an_ideal_set_share_alike(planets: int, teeth: tuple[int, int]) -> None:
    found = periods(RigidSet(planets, teeth, contact_ratio=1.6), 20.0)
    assert found.sharing.mean(axis=1).max() == pytest.approx(1.0, abs=1e-6)
    assert found.load_factor.max() > 1.005  # neighbours mesh at another phase


@pytest.mark.parametrize(
    "rigid",
    [
        pytest.param(RigidSet(5, (18, 18), module=2.5e-3, positions=(0, 14, 29, 43, 58)), id="5"),
        slow(RigidSet(4, positions=(0, 31, 59, 91)), name="4"),
    ],
)
def test_unequally_spaced_planets_carry_alike_under_little_load(rigid: RigidSet) -> None:
    """So all teeth stand where they should, to some 10 nm."""
    assert abs(periods(replace(rigid, contact_ratio=1.4), 20.0).sharing - 1).max() < 0.05


@pytest.mark.parametrize("pins", [{1: (5e-6, 12e-6)}, slow({0: (-20e-6, -15e-6)}), slow({2: (0.0, 25e-6)})])
def test_three_planets_share_alike_whatever_the_error_of_a_pin(pins: dict[int, tuple[float, float]]) -> None:
    """The sun floats to where its three forces are in balance; on a bearing it does not."""
    rigid = RigidSet(3, contact_ratio=1.6, pins=pins, sun=FLOATING)
    assert periods(rigid, 1000.0).sharing.mean(axis=1).max() == pytest.approx(1.0, abs=5e-4)
    assert periods(replace(rigid, sun=Rigid(0.4, 0.39, 1e9)), 1000.0).sharing.mean(axis=1).max() > 1.03


def shares(rigid: RigidSet, torque: float) -> tuple[np.ndarray, np.ndarray]:
    """(2, N) of the kernel and of the paper model, one pair in contact everywhere."""
    model = rigid.model()
    kernel, place = kernel_of(model), place_of(model, "sun_planet1")
    states = [kernel.transmission(-ALONE * place.pitch, torque, mesh) for mesh in range(2 * rigid.planets)]
    forces = np.array([sum(map(sum, state.forces.values())) for state in states]).reshape(2, rigid.planets)
    known = KNOWN | {"k_sun": rigid.sun.bearing}
    on_paper = lin_parker.mesh_forces(known, rigid.angles(), torque / rigid.distance, rigid.pins)
    return tuple(f / f.mean(axis=1)[:, None] for f in (forces, on_paper))  # type: ignore[return-value]


@pytest.mark.parametrize("sun", [Rigid(0.4, 0.39, 1e8), FLOATING], ids=["held", "floating"])
@pytest.mark.parametrize("pins", [{1: (0.5e-6, 1.2e-6)}, {0: (0.0, -1e-6), 3: (0.8e-6, 0.3e-6)}])
@pytest.mark.parametrize("planets", [4, slow(5)])
def test_shares_with_pin_errors_are_those_of_the_paper_model(
    planets: int, pins: dict[int, tuple[float, float]], sun: Rigid
) -> None:
    """1e-4: what the angles of the lines of action change over the way of the sun is not in the paper model."""
    kernel, paper = shares(RigidSet(planets, pins=pins, sun=sun), 300.0)
    assert np.ptp(paper) > 0.02 and np.allclose(kernel, paper, atol=1e-4)


@pytest.mark.parametrize(
    ("planets", "teeth"),
    [
        (3, (26, 34)),
        slow(4, (24, 36)),
        slow(4, (27, 33)),
        slow(5, (26, 34)),
        (5, (27, 33)),
        slow(6, (37, 23)),
        slow(6, (38, 22)),
    ],
)
def test_mesh_phasing_suppresses_harmonics(planets: int, teeth: tuple[int, int]) -> None:
    """Harmonic l of the meshes turns the set where l z_s/N is whole, and moves the sun across the axis where l z_s ± 1
    is a multiple of N (R. G. Parker, J. Sound Vib. 236 (2000) 561–573); else it moves planets alone."""
    rigid = RigidSet(planets, teeth, contact_ratio=1.6)
    found = periods(rigid, 600.0, 2)
    count, force = found.position.size, found.sharing[0, :, 0] * found.force[0, :, 0, None]
    turning = np.abs(np.fft.rfft(found.te[0]))
    lateral = np.abs(np.fft.fft(force @ np.exp(1j * rigid.angles()), axis=0))
    order = np.arange(1, count // 2)
    across = np.maximum(lateral[order], lateral[-order])
    left = order * teeth[0] % planets
    turns, moves = left == 0, (left == 1) | (left == planets - 1)
    assert turning[order][~turns].max(initial=0.0) < 2e-5 * turning[order][turns].max()
    assert across[~moves].max() < 1e-5 * force.mean()
    assert not moves.any() or across[moves].max() > 1e-2 * force.mean()
    assert turns.all() == (np.ptp(force, axis=1).max() < 1e-5 * force.mean())


SOFT = 1e4  # N/m: a bearing that does next to nothing within some ms
FREE = RigidSet(
    4, contact_ratio=1.6, positions=(0, 31, 59, 91), ports={"ring": TORQUE},
    **{name: replace(getattr(RigidSet, name), bearing=SOFT) for name in ("sun", "ring", "carrier")},
)  # fmt: skip


@pytest.mark.parametrize("coriolis", [1.0, 0.0])
def test_a_sun_in_free_flight_moves_straight_on(coriolis: float) -> None:
    """At 85 rad/s of the carrier, in axes that stand: where no tooth touches it the sun has the acceleration of its
    bearing, −(k/m + Ω²) x, softening by Ω² being left out of the model; without Coriolis forces it bends by 2Ω v."""
    speed, step = 85.0, 2 * H
    stiffness, rigid = 1e6, replace(FREE, sun=Rigid(0.4, 0.39, 1e6))
    start = {"carrier.w_start": speed, "sun.w_start": speed * rigid.ratio + 2.0, "effect.contact_damping": 0.0}
    kernel = kernel_of(rigid.model(), h=H, **start, **{"effect.coriolis": coriolis})
    kernel.initialize()
    x, y, *force = stepped(
        kernel, 1500, step, "sun.gear.x", "sun.gear.y", *(f"sun_planet{k + 1}.force_max" for k in range(4))
    ).T
    place, touched = x + 1j * y, (np.array(force) > 0).any(axis=0)
    flies = ~np.convolve(touched, np.ones(15), mode="same").astype(bool)[1:-1]
    velocity, here = (place[2:] - place[:-2])[flies] / (2 * step), place[1:-1][flies]
    bent = np.diff(place, 2)[flies] / step**2 + (stiffness / rigid.sun.mass + speed**2) * here
    off = 2j * speed * velocity + 2 * speed**2 * here
    size = np.abs(off).max()
    assert flies.sum() > 200
    assert np.abs(bent - (0.0 if coriolis else off)).max() < 0.01 * size


def own_inertia(rigid: RigidSet, name: str) -> float:
    """kg·m² of a body about its axis."""
    body: Rigid = getattr(rigid, name)
    return body.inertia * rigid.base(name) ** 2


def carried_inertia(rigid: RigidSet) -> float:
    """kg·m² of the carrier with the planets' masses on its bolts."""
    return own_inertia(rigid, "carrier") + rigid.planets * rigid.planet.mass * rigid.distance**2


def released(rigid: RigidSet, start: Sequence[float], steps: int, **parameters: float) -> tuple[Kernel, np.ndarray]:
    """Without load, carrier, sun and ring at their speeds (rad/s). (steps, 6 + 2N + N + 3): x, y of sun, ring and
    carrier, elongation of the pins, speeds of carrier, sun, ring and planets; then angle of the carrier, energy and
    what its balance lacks."""
    planets = range(1, rigid.planets + 1)
    speeds = dict(zip(("carrier", "sun", "ring"), start, strict=True))
    undamped = {"effect.contact_damping": 0.0, **{f"{name}.w_start": speed for name, speed in speeds.items()}}
    kernel = kernel_of(rigid.model(), h=H, **undamped, **parameters)
    kernel.initialize()
    moved = [f"{name}.{d}" for name in ("sun.gear", "ring.gear", "bearing.carrier") for d in "xy"]
    moved += [f"pin.planet{k}.{d}" for k in planets for d in "xy"]
    turning = [f"{name}.gear.w" for name in (*speeds, *(f"planet{k}" for k in planets))]
    names = [*moved, *turning, "carrier.gear.phi", "energy.stored", "energy.residual"]
    return kernel, stepped(kernel, steps, 2 * H, *names)


def spin_momentum(rigid: RigidSet, found: np.ndarray) -> np.ndarray:
    """(steps,) kg·m²/s about the axis of the set."""
    first, planets = 6 + 2 * rigid.planets, rigid.planets
    inertia = [carried_inertia(rigid), *(own_inertia(rigid, name) for name in ("sun", "ring"))]
    inertia += [own_inertia(rigid, "planet")] * planets
    return found[:, first : first + 3 + planets] @ inertia


def impacts(kernel: Kernel, planets: int) -> float:
    return sum(kernel.get(f"{gear}_planet{k + 1}.impacts") for gear in ("sun", "ring") for k in range(planets))


def test_a_free_set_keeps_energy_momentum_and_angular_momentum() -> None:
    """Rattle in standing axes, planets unequally spaced, nothing damped. What is left on the set is the pull of three
    soft bearings: the centre of mass moves as that says, to single precision."""
    still = {"effect.roll_motion": 0.0, "effect.coriolis": 0.0, "effect.centrifugal": 0.0}
    kernel, found = released(FREE, (0.5, -1.0, 0.2), 1000, **still)
    assert impacts(kernel, 4) > 10 and kernel.get("solver.retried_steps") == 0
    assert np.abs(found[:, -1]).max() < 2e-8 * found[0, -2]  # 1.4e-8: passes end at 3e-7 of a gap
    spin = spin_momentum(FREE, found)
    assert np.allclose(spin, spin[0], rtol=1e-12)
    turn = np.exp(-1j * found[:, -3])[:, None] * (found[:, :6:2] + 1j * found[:, 1:6:2])  # ground to carrier axes
    central = np.stack([turn.real, turn.imag], axis=2)
    tangent = FREE.distance * np.stack([-np.sin(FREE.angles()), np.cos(FREE.angles())], axis=1)
    planets = central[:, 2:] + found[:, 6:14].reshape(-1, 4, 2) + found[:, -3, None, None] * tangent
    masses = np.array([FREE.sun.mass, FREE.ring.mass, FREE.carrier.mass])
    moment = np.einsum("b,tbx->tx", masses, central) + FREE.planet.mass * planets.sum(axis=1)
    pull = SOFT * central.sum(axis=1)
    twice = cumulative_trapezoid(cumulative_trapezoid(pull, axis=0, initial=0), axis=0, initial=0)
    uniform = moment + twice * (2 * H) ** 2
    time = 2 * H * np.arange(1, len(found) + 1)
    left = uniform - np.stack([np.polyval(np.polyfit(time, one, 1), time) for one in uniform.T], axis=1)
    size = FREE.sun.mass * np.abs(central[:, 0]).max()
    assert np.abs(left).max() < 1e-5 * size


def test_a_turning_free_set_keeps_its_angular_momentum() -> None:
    """At 85 rad/s of the carrier with rattle, in turning axes with their Coriolis forces; energy to what the moving
    mesh works (docs/theory.md, 6)."""
    kernel, found = released(FREE, (85.0, 85.0 * FREE.ratio + 2.0, 0.0), 1000)
    assert impacts(kernel, 4) > 4 and kernel.get("solver.retried_steps") == 0
    spin = spin_momentum(FREE, found)
    assert np.allclose(spin, spin[0], rtol=1e-12)
    assert np.abs(found[:, -1]).max() < 1e-5 * found[0, -2]
