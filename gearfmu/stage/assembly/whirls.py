"""Gyroscopic forces of a ground group: pairs of rows that turn into each other (docs/theory.md eq. 17l)."""

from __future__ import annotations

import numpy as np

from gearfmu.stage.assembly.groups import Group, Layout
from gearfmu.stage.assembly.spinning import rigid_spinning, skew_pairs


def whirl_rows(group: Group) -> tuple[np.ndarray, np.ndarray]:
    """Rotors (p,) and rows x, y (p, 2, n): those of the bodies' own rotors and of the axes that they stand in
    (`spinning`). Speeds change by −2Ω (y x·v − x y·v), Ω the rotor's speed."""
    layout, rotors, rows = group.layout, [], []
    for r, rotor in enumerate(layout.rotors):
        for body in rotor if r not in layout.stands else ():
            free, frame = layout.bodies[body], layout.frame_of(body)
            own = free.spinning or rigid_spinning(free.mass, free.omega.size)
            for turns, matrix in ((r, own.gyroscopic), (frame, own.coriolis)):
                if turns >= 0:
                    found = skew_pairs(matrix[np.ix_(*2 * [_unknowns(layout, body)])]) @ group.shapes[group.at[body]]
                    rotors += len(found) * [turns]
                    rows += list(found)
    return np.array(rotors, int), np.array(rows).reshape(-1, 2, group.omega.size)


def _unknowns(layout: Layout, body: int) -> np.ndarray:
    """Which of the rigid motions and patterns of a body are unknowns."""
    return np.array([*layout.freedoms(body), *range(6, 6 + layout.bodies[body].omega.size)], int)
