"""What flanks of a body read of a ground group, as whole tables: the model stores their factors."""

from __future__ import annotations

import numpy as np

from gearfmu.stage.assembly.groups import Group, node_directions
from gearfmu.stage.assembly.teeth import products


def flank_rows(group: Group, body: int) -> np.ndarray:
    """(3, 2, P, A, n): e, as c₀, c_c, c_s."""
    flank, freedoms = group.layout.bodies[body].flank, group.layout.freedoms(body)
    elastic = group.shapes[group.at[body]][len(freedoms) :]
    by_supports = products(flank_supports(group, body) @ group.kappa, group.support_rows.T)
    return products(flank.patterns, elastic.T) - by_supports


def flank_supports(group: Group, body: int) -> np.ndarray:
    """(3, 2, P, A, s): C_fs."""
    return products(group.layout.bodies[body].flank.node, node_directions(group.layout, body))
