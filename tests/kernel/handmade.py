"""Bodies whose numbers a test invents."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfmu.body.body import Body, Flank, How, Node
from gearfmu.reduction.full_order import COMPONENTS


def on_axis(*places: float) -> tuple[Node, ...]:
    """Nodes along the axis, m."""
    return tuple(Node(f"node{k}", "rigid", COMPONENTS, np.array([0.0, 0.0, z])) for k, z in enumerate(places))


def mass_matrix(mass: float, inertia: np.ndarray) -> np.ndarray:
    """(6, 6) about the centre of mass."""
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = mass * np.eye(3), inertia
    return matrix


def toothed(name: str, flank: dict[str, Any], mass: np.ndarray, input_hash: str = "0" * 64, **of_body: Any) -> Body:
    """A gear with one node on its axis. flank: fields of a Flank, numbers of the tooth left out where nothing asks for
    them; of_body: frequency, damping_ratio, rows, static."""
    modes, rolls = len(of_body["frequency"]), flank["rows"].shape[1]
    roll = flank.pop("roll", np.linspace(0.01, 0.02, rolls))
    known = {
        "internal": False, "r_b": 1.0, "psi_b": 0.1, "beta_b": 0.0, "face_width": 1.0, "strip_half_width": 1e-3,
        "parity": np.ones(modes, int), "roll": roll, "roll_range": np.array([0.9 * roll[0], 1.1 * roll[-1]]),
    }  # fmt: skip
    how = How(input_hash, "invented")
    return Body(name=name, how=how, mass=mass, nodes=on_axis(0.0), flank=Flank(**(known | flank)), **of_body)
