"""Events that any kind of stage meets, written once: torque step, reversal, overload, jam, rattle, run-up, stepping.
Each takes the bench it runs on and numbers of that kind of stage (scenes.py)."""

from __future__ import annotations

import math
import mmap
import time as clock
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from evidence.stability.bench import Bench, steady
from evidence.stability.case import Case, Finding
from evidence.stability.checks import Expected, at_least, at_most, levels, lost, statistics
from evidence.stability.motion import Constant, Step, Turn, UpAndDown
from evidence.stability.record import Record, Run, run_times

Numbers = Mapping[str, float]
BINS = 60
ASTRAY = 2e-5  # s: communication step of runs that go astray
LOST = 0.05  # contact-loss share of a bin in which a resonance has jumped


def torque_step(bench: Bench, case: Case, speed: float, load: Step, duration: float, since: float) -> Finding:
    """A torque that comes within milliseconds. All meshes ring and stay whole; in the end they carry it."""
    made = bench.run(case, bench.turning(Constant(speed), (load,)), duration)
    return bench.finding(made, *bench.carries(made, load.after, since))


def reversal(
    bench: Bench,
    case: Case,
    speed: float,
    loads: tuple[Step, Step],
    judged: tuple[float, float],
    limit: float,
    coast: float = 0.0,
    effects: Numbers | None = None,
) -> Finding:
    """A torque that changes its sign within 5 ms, through every backlash, and back. Every mesh is struck and pressed on
    its other flanks; at the end, and where `coast` (s) is given before it turns back, the torque is carried. judged:
    duration and from when on, s."""
    made = bench.run(case, bench.turning(Constant(speed), loads), judged[0], effects)
    said, facts = bench.carries(made, loads[1].after, judged[1], limit)
    if coast:
        complaints, found = bench.carries(made, loads[0].after, coast, limit, loads[1].start)
        said, facts = said + complaints, facts | {f"reversed_{name}": value for name, value in found.items()}
    for mesh in bench.watched.meshes:
        said += at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], 2)
        contact = made[f"{mesh}.contact"]
        said += at_least(f"share of contact on the other flanks of {mesh}", np.mean(contact == -contact[0]), 0.2)
    return bench.finding(made, said, facts)


def mid_backlash(
    bench: Bench, case: Case, speed: float, load: Step, judged: tuple[float, float], free: bool
) -> Finding:
    """No load at first, teeth in the middle of the spaces; then the nominal torque within milliseconds, which the
    meshes carry in the end. free: no contact at all before."""
    made = bench.run(case, bench.turning(Constant(speed), (load,)), judged[0])
    before = made.time < load.start
    touched = max(float(np.mean(made[f"{mesh}.contact"][before] != 0)) for mesh in bench.watched.meshes)
    said, facts = bench.carries(made, load.after, judged[1])
    said += at_most("share of contact before the load", touched, 0.0) if free else []
    return bench.finding(made, said, facts | {"contact_before": touched})


def overload(
    bench: Bench, case: Case, speed: float, load: Step, judged: tuple[float, float], energy: float = 0.0
) -> Finding:
    """From the nominal torque to ten times the largest. The local law goes on along its tangent there; the meshes carry
    the torque to 3 %: shafts are wound by the compliance at the nominal torque, and a mesh is stiffer here."""
    made = bench.run(case, bench.turning(Constant(speed), (load,)), judged[0])
    return bench.finding(made, *bench.carries(made, load.after, judged[1], 0.03), energy=energy)


def under_load(bench: Bench, case: Case, speed: float, torque: float, effects: Numbers | None = None) -> Finding:
    """A constant torque at constant speed: the meshes carry it."""
    made = bench.loaded(case, Constant(speed), torque, parameters=effects)
    return bench.finding(made, *bench.carries(made, torque, bench.settled[1]))


def jammed(
    bench: Bench, case: Case, speed: float, torque: float, duration: float, interference: float, energy: float = 0.0
) -> Finding:
    """Interference (m) instead of backlash in every mesh: both flanks in contact all the time."""
    several = len(bench.watched.meshes) > 1
    jam = {f"{mesh}.backlash" if several else "backlash": interference for mesh in bench.watched.meshes}
    made = bench.loaded(case, Constant(speed), torque, duration, parameters=jam)
    both = min(float(np.mean(made[f"{mesh}.contact"] == 2)) for mesh in bench.watched.meshes)
    said = at_least("smallest share of contact on both flanks", both, 0.99)
    return bench.finding(made, said, {"both_flanks": both}, energy, interference)


def rattle(
    bench: Bench,
    case: Case,
    turn: Turn,
    drag: float,
    times: tuple[float, float, float],
    limit: float,
    impacts: int = 0,
    expected: Mapping[str, Expected] | None = None,
    effects: Numbers | None = None,
) -> Finding:
    """A driver that swings, or only turns, and a drag on a loose output: teeth part and hammer. The impulse of the
    meshes is that of the drag, and shares of lost contact, impact rates and band levels repeat. times: step, duration
    and from when on, s."""
    step, duration, since = times
    loose, inputs = bench.dragged(turn, drag)
    made = loose.run(case, inputs, duration, effects, step)
    late = made.after(since)
    facts = {"impulse_over_drag": loose.impulse(made, drag, since), **open_shares(late)}
    facts |= {**lost(late), **levels(late)} if "mesh.force_mean" in made.values else {}
    said = at_most("impulse of the meshes off that of the drag", abs(facts["impulse_over_drag"] - 1.0), limit)
    for mesh in bench.watched.meshes:
        said += at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], impacts)
        said += at_least(f"share without contact of {mesh}", float(np.mean(late[f"{mesh}.contact"] == 0)), 0.05)
    return loose.finding(made, said + statistics(facts, expected or {}), facts)


def open_shares(record: Record) -> dict[str, float]:
    """Mean contact-loss share of the meshes of one central gear."""
    found: dict[str, list[float]] = {}
    for name in record.values:
        if name.endswith(".open_time"):
            mesh = name.removesuffix(".open_time")
            found.setdefault(mesh.partition("_")[0], []).append(record.open_share(mesh))
    return {f"{central}_open_share": float(np.mean(shares)) for central, shares in found.items()}


def standstill(
    bench: Bench,
    case: Case,
    duration: float,
    step: float,
    since: float = 0.0,
    limit: float = 1e-4,
    effects: Numbers | None = None,
) -> Finding:
    """The nominal torque at rest: forces and transmission errors may not creep once the start has died away."""
    made = bench.loaded(case, Constant(0.0), bench.nominal, duration, parameters=effects, step=step)
    late, said, facts = made.after(since), [], {}
    for mesh in bench.watched.meshes:
        for name in (f"{mesh}.force_mean", f"{mesh}.te"):
            values = late[name][1:]
            facts[f"creep_of_{name}"] = float(np.ptp(values) / abs(values[0]))
            said += at_most(f"change of {name}", facts[f"creep_of_{name}"], limit)
    return bench.finding(made, said, facts)


def for_long(bench: Bench, case: Case, speed: float, effects: Numbers) -> Finding:
    """The nominal torque for 10 s: mean force and its ripple of the last second are those of the second one to 1e-3 and
    1e-2."""
    made = bench.loaded(case, Constant(speed), bench.nominal, 10.0, parameters=effects)
    early, late = (made.between(a, a + 1.0)["mesh.force_mean"] for a in (1.0, 9.0))
    facts = {"mean": float(late.mean() / early.mean() - 1), "ripple": float(late.std() / early.std() - 1)}
    said = at_most("change of the mean force", abs(facts["mean"]), 1e-3)
    return bench.finding(made, said + at_most("growth of its ripple", facts["ripple"], 1e-2), facts)


def many_steps(
    bench: Bench, case: Case, speed: float, period: float, steps: int, per_period: int, limit: float
) -> Finding:
    """The nominal torque for very many internal steps: forces and transmission errors, over whole mesh periods
    (`period`, s, with so many samples), may not drift, memory not grow."""
    step, memory = period / per_period, list[float]()
    inner = bench.loaded(case, Constant(speed), bench.nominal, step, step=step).h
    periods = math.ceil(steps * inner / period)
    turning = bench.turning(Constant(speed), steady(bench.nominal))

    def watched(time: float) -> Mapping[str, float]:
        if time and (
            not memory or time > (periods - 1.5) * period
        ):  # from the second step on all is there that a run needs
            memory.append(_memory())
        return turning(time)

    made = bench.run(case, watched, periods * period, step=step)
    said, facts = bench.carries(made, bench.nominal, 0.5 * made.time[-1])
    facts |= {"internal_steps": float(made["solver.steps"][-1]), "memory_grown_MB": (memory[-1] - memory[0]) / 1e6}
    third = periods // 3 * per_period
    for mesh in bench.watched.meshes:
        for name in (f"{mesh}.force_mean", f"{mesh}.force_max", f"{mesh}.te"):
            values = made[name][1:]
            drift = float(abs(values[-third:].mean() / values[-2 * third : -third].mean() - 1.0))
            facts[f"drift_of_{name}"] = drift
            said += at_most(f"drift of {name}", drift, limit)
    return bench.finding(made, said + at_most("growth of memory (MB)", facts["memory_grown_MB"], 2.0), facts)


def _memory() -> float:
    """Resident memory of this process, bytes; 0 where the system does not tell it as Linux does."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0
    return pages * float(mmap.PAGESIZE)


def random_communication_steps(
    bench: Bench, case: Case, speed: float, duration: float, longest: float, since: float, limit: float
) -> Finding:
    """The nominal torque with communication steps drawn between 1 µs and `longest` (s, log-uniform): torque and
    transmission errors are what equal steps give, the errors to a part `limit` of what alternates."""
    draws = np.random.default_rng(1).uniform(np.log(1e-6), np.log(longest), 5000 if longest > 5e-4 else 2000)
    times = np.concatenate([[0.0], np.cumsum(np.exp(draws))])
    inputs = bench.turning(Constant(speed), steady(bench.nominal))
    made, equal = bench.run(case, inputs, times[times <= duration]), bench.run(case, inputs, duration, step=2e-5)
    late, calm = made.after(since), equal.after(since)
    said, facts = bench.carries(made, bench.nominal, since)
    for name in (f"{bench.watched.meshes[k]}.te" for k in (0, -1)):
        off = late[name] - np.interp(late.time, equal.time, equal[name])
        facts[f"{name}_off"] = float(np.sqrt(np.mean(off**2)) / calm[name].std())
        said += at_most(f"{name} against equal steps, of its alternating part", facts[f"{name}_off"], limit)
    return bench.finding(made, said, facts)


def rollbacks(
    bench: Bench, case: Case, turn: Turn, drag: float, times: int, stray: Mapping[str, tuple[float, float]]
) -> Finding:
    """At every step the state is saved, the run goes astray for 1 to 3 steps under other inputs (`stray`: mean and
    scatter) and returns; the end is bit for bit that of the straight run."""
    loose, inputs = bench.dragged(turn, drag)
    straight, astray = (loose.kernel(case, loose.start(inputs)) for _ in range(2))
    calm = run_times(straight, inputs, np.arange(times + 1) * ASTRAY, loose.watched)
    going, started, random = Run(astray, times, loose.watched), clock.process_time(), np.random.default_rng(2)
    going.set(inputs(0.0))
    astray.initialize(0.0)
    going.take(0.0)
    for i in range(times):
        now, saved = i * ASTRAY, astray.save()
        for k in range(int(random.integers(1, 4))):
            going.set({name: mean + random.normal(0.0, scatter) for name, (mean, scatter) in stray.items()})
            astray.step(now + k * ASTRAY, ASTRAY)
        astray.restore(saved)
        going.set(inputs(now))
        astray.step(now, ASTRAY)
        going.take(now + ASTRAY)
    made = replace(going.record(calm.outcome, clock.process_time() - started), throughput=calm.throughput)
    same = astray.save() == straight.save() and all(np.array_equal(made[name], calm[name]) for name in made.values)
    said = [] if same else [f"the run with {times} rollbacks does not end in the state of the straight run"]
    return loose.finding(made, said, {"rollbacks": float(times)})


def run_up_and_down(
    bench: Bench,
    case: Case,
    motion: UpAndDown,
    torque: float,
    resonance: tuple[float, float],
    expected: Mapping[str, Expected],
) -> Finding:
    """Through the mesh resonances and back under so little torque that tip relief is far too much: contact is lost in
    resonances that soften, so the teeth begin to part at a higher speed on the way up than the one at which they stay
    together again on the way down. resonance: speeds about a mode, rad/s."""
    made, half = bench.loaded(case, motion, torque, 2 * motion.duration), motion.duration
    said, facts, bin_width = [], {}, (motion.high - motion.low) / BINS
    for name, part in (("up", made.between(0.0, half)), ("down", made.after(half))):
        edges = np.linspace(part.time[0], part.time[-1], BINS + 1)
        shares = np.diff(np.interp(edges, part.time, part["mesh.open_time"])) / np.diff(edges)
        shares = shares if name == "up" else shares[::-1]
        speed = motion.low + bin_width * (np.arange(BINS) + 0.5)
        seen = (shares > LOST) & (speed > resonance[0]) & (speed < resonance[1])
        facts[f"open_share_{name}"] = float(shares.mean())
        facts[f"jump_{name}_rad_s"] = float(speed[seen].min()) if seen.any() else float("nan")
        said += at_least(f"largest contact-loss share in a part of the run {name}", float(shares.max()), 4 * LOST)
    said += statistics(facts, expected)
    apart = facts["jump_up_rad_s"] - facts["jump_down_rad_s"]
    return bench.finding(made, said + at_least("distance of the jumps (rad/s)", apart, 2.0 * bin_width), facts)
