"""Bodies in time: the scheme, its joints, and reduced bodies against the same bodies unreduced."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
import scipy.sparse as sp
from small_body import tiny

from evidence.reduction.in_time.transient import Assembly, Joints, Member, Motion, Scheme, integrate
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size
from gearfmu.reduction.oscillators import oscillators

SPRING, PENALTY, SPEED = 3e8, 1e9, 0.5  # N/m, N/m, m/s
FORCE = 2e3  # N
WINDOW = Scheme(step=1e-6, end=0.2e-3)


def joints(body: FullOrder, kinds: str, gap: float = 0.0) -> Joints:
    """Two rings, one in the frame of the other: their bores by three springs ("s"), the first ring's first bolt in
    contact with the second's along x ("c"), the first ring's bore on the ground by six springs ("g")."""
    rows, size = {i.name: 6 * k for k, i in enumerate(body.interfaces)}, body.rows().shape[0]
    ends = {
        "s": [((rows["bore"] + k, 1.0), (rows["bore"] + k, -1.0), SPRING) for k in range(3)],
        "c": [((rows["bolt_1"], 1.0), (rows["bolt_1"], -1.0), PENALTY)],
        "g": [((rows["bore"] + k, 1.0), (0, 0.0), SPRING if k < 3 else 1e-3 * SPRING) for k in range(6)],
    }
    chosen = [(kind, *end) for kind in kinds for end in ends[kind]]
    first, second = (
        sp.csr_array(
            ([end[side][1] for end in chosen], (range(len(chosen)), [end[side][0] for end in chosen])),
            shape=(len(chosen), size),
        )
        for side in (1, 2)
    )
    contact = np.array([end[0] == "c" for end in chosen])
    return Joints((first, second), np.array([end[3] for end in chosen]), np.where(contact, gap, 0.0), contact)


def pushed(kinds: str, start: float = 0.0, force: float = FORCE, gap: float = 0.0) -> Assembly:
    """Two equal rings with these joints; a force on the first one's second bolt grows in 0.1 ms, and the second ring
    flies against the first at `start`, m/s, so that contacts close."""
    body = tiny()
    load = np.zeros(body.rows().shape[0])
    load[[6 * k for k, i in enumerate(body.interfaces) if i.name == "bolt_2"]] = force
    members = tuple(replace(Member.whole(body), name=name) for name in ("a", "b"))
    speeds = (np.zeros(6), start * np.eye(6)[0])
    return Assembly(members, joints(body, kinds, gap), (load, 0 * load), ramp, speeds)


def ramp(time: float) -> float:
    return 0.5 * (1 - np.cos(np.pi * min(time / 0.1e-3, 1.0)))


@cache
def reduced(method: str, count: int, residual: bool = False) -> Member:
    body = tiny()
    return Member.reduced(oscillators(body, METHODS[method](body, Size(count)), 0.0), residual)


def with_both(assembly: Assembly, member: Member) -> Assembly:
    return assembly.with_members(replace(member, name="a"), replace(member, name="b"))


def apart(one: Motion, other: Motion) -> float:
    """rms of the difference of all displacements of interfaces over their rms, rotations on an arm of 40 mm."""
    both = [np.hstack([m.interfaces[name] for name in ("a", "b")]) for m in (one, other)]
    arm = np.where(np.arange(both[0].shape[1]) % 6 < 3, 1.0, 0.04)
    return float(np.linalg.norm((both[0] - both[1]) * arm) / np.linalg.norm(both[0] * arm))


def test_reduced_with_all_modes_is_unreduced() -> None:
    """Springs, impact through a gap and loads; every elastic mode is there, so that only the method is another."""
    scene = pushed("sc", start=SPEED, gap=2e-6)
    whole = integrate(scene, WINDOW)
    same = integrate(with_both(scene, reduced("modal", elastic(tiny()).elastic)), WINDOW)
    assert (whole.tension[:, 3] < 0).any() and (whole.tension[-1, 3] == 0 or (whole.tension[:, 3] == 0).any())
    print(f"{apart(whole, same):.1e}")
    assert apart(whole, same) < 1e-8
    assert np.allclose(same.tension, whole.tension, atol=1e-7 * np.abs(whole.tension).max())


@lru_cache(maxsize=1)
def on_ground() -> tuple[Assembly, Motion]:
    scene = pushed("gs")
    return scene, integrate(scene, WINDOW)


def error(method: str, count: int, residual: bool = False) -> float:
    scene, whole = on_ground()
    return apart(whole, integrate(with_both(scene, reduced(method, count, residual)), WINDOW))


def test_methods_are_ordered_as_in_the_paper() -> None:
    """Krylov and Rubin follow the finite elements, modal truncation does not; the static residual makes up for it."""
    found = {name: error(name, 54) for name in ("modal", "craig_bampton", "rubin", "krylov")}
    found["with residual"] = error("modal", 54, residual=True)
    print({name: f"{value:.1e}" for name, value in found.items()})
    assert max(found["krylov"], found["rubin"]) < 0.5 * found["craig_bampton"] < 0.02 * found["modal"]
    assert found["with residual"] < 0.01 * found["modal"]


def test_the_scheme_is_of_second_order_and_keeps_energy_at_alpha_0() -> None:
    scene = with_both(pushed("gs"), reduced("modal", 24))

    def last(steps: int, alpha: float) -> np.ndarray:
        run = integrate(scene, Scheme(0.1e-3 / steps, 0.1e-3, alpha))
        return np.concatenate([run.interfaces["a"][-1, :3], run.interfaces["b"][-1, :3]])

    for alpha in (-0.05, -0.3):
        coarse, middle, fine = (last(steps, alpha) for steps in (100, 200, 400))
        order = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
        print(f"alpha {alpha}: {order:.2f}")
        assert 1.9 < order < 2.1
    free = integrate(pushed("s", start=SPEED, force=0.0), Scheme(1e-6, 0.1e-3, alpha=0.0))
    assert free.energy[0] > 0 and np.abs(free.energy / free.energy[0] - 1).max() < 1e-9
    damped = integrate(pushed("s", start=SPEED, force=0.0), Scheme(1e-6, 0.1e-3, alpha=-0.3))
    assert damped.energy[-1] < (1 - 1e-5) * free.energy[0]
