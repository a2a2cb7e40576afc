"""Observed orders: of constant stiffness against the exact motion, of a turning mesh; the exact motion against another
solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from evidence.study import order
from evidence.study.flat import FlatPair, contact_frequencies, contact_rows, exact_force
from gearfmu.scenefile.scene import load_scene
from gearfmu.study.ladder import window

CLOSED = ("dg4", "em")


def test_exact_motion_is_that_of_a_numerical_solution() -> None:
    pair = FlatPair()
    rows, compliance, omega = contact_rows(pair)
    springs, n = np.linalg.pinv(compliance), omega.size
    stiffness = np.diag(omega**2) + rows.T @ springs @ rows
    start = np.zeros(2 * n)
    start[n] = pair.speed * np.sqrt(pair.left.mass)
    time = np.linspace(0, order.END, 20)
    tight = {"rtol": 1e-11, "atol": 1e-16}
    solved = solve_ivp(lambda t, y: [*y[n:], *(-stiffness @ y[:n])], (0, order.END), start, "DOP853", time, **tight)
    wanted = -(springs @ rows @ solved.y[:n]).sum(axis=0)
    np.testing.assert_allclose(exact_force(pair, time), wanted, atol=1e-8 * wanted.max())
    assert contact_frequencies(pair).max() * order.END / min(order.COUNTS) < 1.2, "a mode would be trapezoidal"


def test_constant_stiffness_is_of_fourth_order_and_an_impact_of_second() -> None:
    rows = order.constant_stiffness()
    for case in (order.CONSTANT, order.IMPACT):
        for name in CLOSED:
            line = [row for row in rows if (row.case, row.integrator) == (case, name)]
            assert line[-1].order == pytest.approx(line[-1].expected, abs=0.25), f"{case}, {name}: {line}"
    errors = {row.integrator: row.error for row in rows if row.case == order.CONSTANT}  # the smallest step stays
    assert errors["dg4"] < 1e-7 < errors["em"]
    assert max(row.error for row in rows if row.integrator == "rk45") < 5e-6  # its tolerance, at every h


def test_a_turning_mesh_is_of_second_order() -> None:
    """em without dashpots is far from its limit at these steps (12 % at 2.5 µs). rk45 takes the contact dashpots up to
    first order in c, 0.7 % here; without dashpots it comes to the same motion."""
    short = window(load_scene("pair_loaded"), quick=True).model_copy(update={"duration": 0.02})
    rows = order.gear_mesh(short, ("rigid",), (5e-6, 1.25e-6))
    found = {(row.case, row.integrator): row for row in rows}
    damped, free = f"{order.MESH}, rigid", f"{order.MESH}, rigid, no dashpots"
    for case, name in ((damped, "dg4"), (damped, "em"), (free, "dg4")):
        assert found[case, name].order > 1.6, f"{case}, {name}: {found[case, name]}"
    for case, most in ((damped, 1e-2), (free, 1e-3)):
        assert max(row.error for row in rows if (row.case, row.integrator) == (case, "rk45")) < most, case
