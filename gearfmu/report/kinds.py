"""Kinds of signals whose spectra are shown, forces and accelerations of sensors, and their levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.report.metrics import level, sample_step
from gearfmu.report.signals import bearings, meshes, noise_floor
from gearfmu.stage.run.trace import Trace

SENSOR = "sensor."


@dataclass(frozen=True)
class Kind:
    """Of signals: prefix of the names of their figures, title of their spectra, unit, reference of levels."""

    prefix: str
    spectra: str
    unit: str = "N"
    reference: float = 1.0

    @property
    def label(self) -> str:
        """Of a level: "dB re 1 N", "dB re 1 µm/s²"."""
        number = f"{self.reference:g} " if self.reference >= 1e-3 else f"{1e6 * self.reference:g} µ"
        return f"dB re {number}{self.unit.replace('s2', 's²')}"

    def level(self, amplitude: np.ndarray) -> np.ndarray:
        """Level in dB."""
        return level(amplitude, self.reference)


FORCES = Kind("", "Spectra of the forces")
ACCELERATIONS = Kind("housing_", "Spectra of the accelerations of the housing", "m/s2", 1e-6)  # ISO 1683


def force_channels(trace: Trace) -> list[str]:
    """The channels whose sound matters: bearing forces, then mesh forces. Where the mean over the communication step
    was recorded ("…_mean") it replaces the sample at its end: averaging weakens folded parts. Forces that
    cancel are left out (`noise_floor`)."""
    names = [f"bearing.{name}.{direction}" for name in bearings(trace) for direction in ("fx", "fy")]
    names += [f"{mesh}.force" for mesh in meshes(trace)]
    best = [next((n for n in (f"{name}_mean", name) if n in trace), None) for name in names]
    floor = noise_floor(trace)
    return [name for name in best if name is not None and np.abs(trace[name]).max() >= floor]


def averaging(trace: Trace, name: str) -> float:
    """Time (s) over which a sample of the channel is a mean: the communication step of "…_mean" and sensors, else 0."""
    return sample_step(trace.time) if name.endswith("_mean") or name.startswith(SENSOR) else 0.0


def sensors(trace: Trace) -> list[str]:
    """Channels of the sensors of a housing that moves, in the trace's order."""
    return [name for name in trace.channels if name.startswith(SENSOR) and np.any(trace[name])]


def loudest_sensors(trace: Trace) -> list[str]:
    """Of every sensor the direction that moves most."""
    return [max(own, key=lambda name: float(np.std(trace[name]))) for own in by_part(sensors(trace))]


def by_part(names: Sequence[str]) -> list[list[str]]:
    """The channels of one bearing, or of the mesh, share a panel."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(name.rsplit(".", 1)[0], []).append(name)
    return list(groups.values())
