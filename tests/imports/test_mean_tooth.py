"""The mean tooth of a whole gear: equal to the cyclic method for a cyclic body, and the exact mean for any other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import scipy.sparse as sp
from small_gear import GEAR, STEEL, coarse, flank
from turned_rows import on_tooth

from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows, rigid_modes
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface
from gearfmu.reduction.imported.flank import tooth_loads
from gearfmu.reduction.imported.mean_tooth import WholeGear, mean_frf, mean_modes, mean_statics

COUNT = 49


@lru_cache(maxsize=1)
def whole() -> WholeGear:
    mesh = coarse().mesh.full()
    elements = {"hexahedron20": mesh.elements}
    faces = solids.boundary(elements)
    rows = tuple(
        tooth_loads(mesh.nodes, faces, flank(), coarse().points, 2 * np.pi * k / GEAR.z) for k in range(GEAR.z)
    )
    bore = sp.csr_array(averaging_rows(mesh.nodes, faces.within(mesh.sets["bore"])))
    body = FullOrder(
        "gear", *solids.assemble(mesh.nodes, elements, STEEL), rigid_modes(mesh.nodes),
        (Interface("bore", bore, COMPONENTS, np.zeros(3), "averaging"),), ("bore",), GEAR.r,
        mesh.elements, np.repeat(np.arange(len(mesh.nodes)), 3),
    )  # fmt: skip
    return WholeGear(body, rows, coarse().points)


@lru_cache(maxsize=1)
def unequal() -> WholeGear:
    """The same with a lump of mass on one side of the rim: no two teeth are alike."""
    body = whole().body
    place = coarse().mesh.full().nodes
    lump = np.exp(-np.sum((place - [11e-3, 2e-3, 0]) ** 2, axis=1) / (3e-3) ** 2)
    mass = body.mass + sp.diags_array(np.repeat(3e-6 * lump, 3))
    values = {
        name: getattr(body, name)
        for name in ("name", "stiffness", "rigid", "interfaces", "ground", "length", "cells", "node_of_dof")
    }
    return WholeGear(FullOrder(mass=sp.csr_array(mass), **values), whole().flank_rows, whole().points)


def test_loads_on_any_surface_are_those_on_our_own() -> None:
    """Gauss points looked up on the surface against integration element by element, every tooth in its place."""
    own = coarse().load_matrix[: coarse().flank_count].toarray()
    mesh = coarse().mesh
    rows = tooth_loads(mesh.nodes, solids.boundary({"hexahedron20": mesh.elements}), flank(), coarse().points)
    assert np.abs(rows.toarray() - own).max() < 1e-9 * np.abs(own).max()
    force = np.array([row @ whole().body.rigid[:, :3] for row in whole().flank_rows])
    uniform = force[:, :: coarse().points.functions]
    assert np.allclose(np.linalg.norm(uniform[0], axis=1), np.linalg.norm(uniform[5], axis=1), rtol=1e-12, atol=0)


def test_a_cyclic_body_is_its_own_mean() -> None:
    space = Elastic(whole().body)
    modes, left = mean_modes(whole(), space, COUNT)
    statics, deviation = mean_statics(whole(), space, [0, 5])
    own, tables = elastic_modes(coarse(), COUNT), static_tables(coarse(), [0, 5])
    assert left < 1e-12 and deviation < 1e-9
    assert np.allclose(modes.frequency, own.frequency, rtol=1e-7)
    for name in ("nodal_diameter", "part", "parity"):
        assert np.array_equal(getattr(modes, name), getattr(own, name)), name
    for name in ("static_ff", "static_fb", "static_bb"):
        mine, theirs = getattr(statics, name), getattr(tables, name)
        assert np.abs(mine - theirs).max() < 1e-9 * np.abs(theirs).max(), name
    case = FrfCase(0.01, 150e3, GEAR.r)
    mine, theirs = mean_frf(whole(), space, modes, statics, case), frf_error(coarse(), own, tables, case)
    assert mine.max_error == pytest.approx(theirs.max_error, rel=1e-4)


def test_of_an_unequal_body_it_is_the_mean_of_the_transfer_matrices() -> None:
    """Modes + residual of the mean tooth against the mean over all turns of the whole body's, between its first
    frequencies, which the lump of mass has split."""
    gear, space = unequal(), Elastic(unequal().body)
    modes, left = mean_modes(gear, space, 80)
    statics, deviation = mean_statics(gear, space, [0])
    assert 1e-6 < left < 0.01 and 1e-4 < deviation < 0.1
    squared, shapes = space.modes(80)
    own = (2 * np.pi * modes.frequency) ** 2
    rows, size = np.stack([r @ shapes for r in gear.flank_rows]), len(modes.flank_rows)
    for frequency in (10e3, 35e3):
        s = (2 * np.pi * frequency) ** 2
        for offset in (0, 1, 5):
            static = statics.static_ff[:, :, offset].transpose(0, 2, 4, 1, 3, 5).reshape(size, size)
            exact = static + np.mean(
                [(rows[j] * (s / squared / (squared - s))) @ rows[(j + offset) % GEAR.z].T for j in range(GEAR.z)],
                axis=0,
            )
            ours = (
                static
                + (modes.flank_rows * (s / own / (own - s))) @ on_tooth(modes, modes.flank_rows, offset, GEAR.z).T
            )
            assert np.abs(ours - exact).max() < 5e-3 * np.abs(statics.static_ff[:, :, 0]).max()
