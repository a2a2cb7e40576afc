"""What every scene must pass, and the pieces scenes build their own checks from. A complaint is one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from evidence.stability.case import COMPLETED, Finding
from evidence.stability.record import Record
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape

ENERGY = 1e-4  # of the energy through the ports and the largest stored one: the balance of a loaded damped run
SOFTEST = 1.2e8  # N/m: one tooth pair in the corner of its path; 12.5 N/(mm µm) × 14 mm = 1.75e8 at the pitch point
BANDS = ((200.0, 1000.0), (1000.0, 4000.0))  # Hz
CLEARANCE = 7.5e-6  # m: twice what relief of 15 µm takes off both teeth where two pairs share, a quarter of it


def judged(
    record: Record,
    penetration: float,
    complaints: Iterable[str],
    facts: Mapping[str, float],
    energy: float = ENERGY,
) -> Finding:
    """The finding of a recorded run of any stage: finite everywhere, energy balance closed, no step unsolved, and
    the scene's own complaints. penetration: m."""
    found = lost(record)
    found |= {"retried_steps": float(record["solver.retried_steps"][-1]), "status": float(record["solver.status"][-1])}
    said = [*common(record, energy), *at_most("number of steps left unsolved", found["retried_steps"], 0.0)]
    said += complaints
    outcome = record.outcome
    if outcome != COMPLETED:
        outcome = f"{outcome}@{record.time[-1]:.6g}"
    elif said:
        outcome = "failed"
    return Finding(
        outcome,
        record.h,
        record.energy_residual,
        penetration,
        record.realtime_factor,
        tuple(said),
        found | dict(facts),
    )


def common(record: Record, energy: float) -> list[str]:
    """Finite everywhere, energy balance closed."""
    said = [f"{name} is not finite" for name, values in record.values.items() if not np.all(np.isfinite(values))]
    if not record.energy_residual <= energy:
        said.append(f"energy balance leaves {record.energy_residual:.2g} of the exchanged energy (limit {energy:g})")
    return said


def deep(record: Record, depth: np.ndarray, pressed: np.ndarray, flanks: str = "flanks") -> list[str]:
    """Flanks at no sample deeper in each other, depth (n,) m, than the largest force of its communication step
    presses them, pressed (n,) m."""
    worst = int(np.argmax(depth - pressed))
    if depth[worst] <= pressed[worst]:
        return []
    limit = f"its force presses {1e6 * pressed[worst]:.1f} µm at most"
    return [f"{flanks} overlap by {1e6 * depth[worst]:.1f} µm at {record.time[worst]:.6g} s, where {limit}"]


def beyond_touch(te: np.ndarray, play: float) -> np.ndarray:
    """(n,) m: by how much gear A has turned beyond the touch of drive or coast flanks. play: of `play_of`."""
    return np.maximum(te, -te - play)


def play_of(stage: Stage, mesh: str) -> float:
    """Backlash of an engagement along its line of action, m."""
    engagement = next(one for one in stage.engagements if one.name == mesh)
    return float(engagement.backlash * np.cos(mesh_shape(stage, engagement).alpha_wt))


def locking(record: Record, port: str) -> tuple[np.ndarray, dict[str, float]]:
    """Whether a port's clutch is locked (n,), and from when on, s; NaN where it never is."""
    locked = record[f"{port}.clutch.locked"] > 0.5
    return locked, {"locked_at_s": float(record.time[np.argmax(locked)]) if locked.any() else float("nan")}


def lost(record: Record) -> dict[str, float]:
    """Contact-loss share and impacts per second, of a train by engagement."""
    found: dict[str, float] = {}
    for mesh in (name.removesuffix(".open_time") for name in record.values if name.endswith(".open_time")):
        if record.time.size > 1:
            prefix = "" if mesh == "mesh" else f"{mesh}."
            found[f"{prefix}open_share"] = record.open_share(mesh)
            found[f"{prefix}impact_rate"] = record.impact_rate(mesh)
    return found


def near(what: str, value: float, wanted: float, relative: float) -> list[str]:
    """A complaint when value is off by more than the relative limit."""
    off = abs(value / wanted - 1.0)
    return [] if off <= relative else [f"{what} is {value:.5g} instead of {wanted:.5g} (limit {relative:.2%})"]


def at_least(what: str, value: float, least: float) -> list[str]:
    """A complaint when value is smaller."""
    return [] if value >= least else [f"{what} is {value:.4g}, at least {least:.4g} must be seen"]


def at_most(what: str, value: float, most: float) -> list[str]:
    """A complaint when value is larger."""
    return [] if value <= most else [f"{what} is {value:.4g}, more than {most:.4g}"]


def levels(record: Record) -> dict[str, float]:
    """Level of the mean mesh force in BANDS, dB re 1 N rms, Hann window; equal communication steps."""
    force = record["mesh.force_mean"][1:]
    step = float(np.mean(np.diff(record.time)))
    window = np.hanning(force.size + 1)[:-1]
    power = 2.0 * np.abs(np.fft.rfft((force - force.mean()) * window)) ** 2 / (window**2).sum() / force.size
    line = np.fft.rfftfreq(force.size, step)
    found = {}
    for low, high in BANDS:
        share = power[(line >= low) & (line < high)].sum()
        found[f"level_{low:g}_{high:g}_Hz_dB"] = float(10.0 * np.log10(max(share, 1e-12)))
    return found


@dataclass(frozen=True)
class Expected:
    """A statistic of a chaotic scene: value of the finest run, and how far another may lie from it."""

    value: float
    limit: float


def statistics(facts: Mapping[str, float], expected: Mapping[str, Expected]) -> list[str]:
    """Complaints about statistics that are not those of the scene."""
    return [
        f"{name} is {facts[name]:.4g} instead of {wanted.value:.4g} ± {wanted.limit:.2g}"
        for name, wanted in expected.items()
        if not abs(facts[name] - wanted.value) <= wanted.limit
    ]
