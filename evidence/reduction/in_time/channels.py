"""What is plotted and compared of a run: motion of carrier, planet and sun, and the force between their teeth."""

from __future__ import annotations

import numpy as np

from evidence.reduction.in_time.scenes import Scene
from evidence.reduction.in_time.transient import Motion

QUARTER = "tooth13"  # of 54
LATE = 0.2  # the last part of a run whose error stands apart


def channels(scene: Scene, motion: Motion) -> dict[str, np.ndarray]:
    """Name with unit → (T,). Speeds are central differences of displacements."""

    def read(name: str, interface: str, component: str) -> np.ndarray:
        return motion.interfaces[name][:, scene.solids[name].index(interface, component)]

    def speed(name: str, component: str) -> np.ndarray:
        return np.gradient(read(name, "bore", component), motion.time)

    if "ring" in scene.solids:
        force = -motion.tension[:, scene.kinds == "contact"].sum(axis=1)
        return {
            "mesh force, N": force,
            "planet speed, rad/s": speed("planet", "rz"),
            "pin deflection, µm": 1e6 * read("planet", "bore", "uy"),
            "tooth of the ring, µm": 1e6 * read("ring", "tooth0", "uy"),
            "ring a quarter away, µm": 1e6 * read("ring", QUARTER, "uy"),
        }
    bolt = read("carrier", "bolt0", "uy")
    found = {
        "bolt deflection, µm": 1e6 * (bolt - scene.radius * read("carrier", "bore", "rz")),
        "bolt tilt, mrad": 1e3 * read("carrier", "bolt0", "rx"),
        "pin elongation, µm": 1e6 * (read("planet", "bore", "uy") - bolt),
    }
    if "sun" not in scene.solids:
        return found | {"planet speed, m/s": speed("planet", "uy"), "carrier speed, rad/s": speed("carrier", "rz")}
    force = -motion.tension[:, scene.kinds == "contact"]
    return {
        "mesh force, N": force.sum(axis=1),
        "planet speed, rad/s": speed("planet", "rz"),
        "sun speed, rad/s": speed("sun", "rz"),
        **found,
    }


def errors(reference: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """rms of the difference, of the whole run and of its last part, over the rms of the whole reference."""
    off, last = other - reference, slice(-round(LATE * len(reference)), None)
    return _rms(off) / _rms(reference), _rms(off[last]) / _rms(reference)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
