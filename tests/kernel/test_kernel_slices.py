"""The kernel's step against the independent reference where slices are strongly coupled, open and close one by one,
with and without damping."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from by_hand import slice_weights
from driven import begun, stepped
from flat import FlatBody, FlatContact, flat_blob
from reference_dg4 import Problem, Reference, Scheme
from small_model import pair_blob

from gearfmu.kernel import Kernel

H, STEPS, SPEED = 5e-6, 600, 0.2
BLOCK = FlatContact(slices=6, degrees=(0, 2), gap=1.3e-6, local=2.8e-12)
SEED = 2
PATH_SHARE = 0.95  # of the residual, what a dashpot is parallel to (docs/theory.md, 2.5)
REFERENCE_LOAD = 100.0  # N over the width: LOAD of evidence.study.flat


def bodies(zeta: float) -> tuple[FlatBody, FlatBody]:
    """Two bodies with seven and nine modes that tilt and bend the slices."""
    rng, made = np.random.default_rng(SEED), []
    for mass, n in ((0.8, 7), (1.7, 9)):
        omega = 2 * np.pi * np.sort(rng.uniform(1e3, 40e3, n))
        rows = rng.uniform(-1, 1, (2, n)) * np.array([[1.0], [1.0]]) / np.sqrt(mass)
        made.append(FlatBody(mass, omega, np.full(n, zeta), rows, np.diag([1.5e-10, 4e-11])))
    return made[0], made[1]


def reference_problem(two: tuple[FlatBody, FlatBody], block: FlatContact) -> Problem:
    """The same contact with every slice's row written out, rigid motion first in each body."""
    t = slice_weights(block.slices, max(block.degrees) + 1)[:, block.degrees]
    rows, omega, zeta, compliance = [], [], [], np.zeros((block.slices, block.slices))
    for body, direction in zip(two, (-1, 1), strict=True):
        rows += [np.full((block.slices, 1), direction / np.sqrt(body.mass)), -t @ body.rows]
        omega += [[0.0], body.omega]
        zeta += [[0.0], body.zeta]
        compliance += t @ body.residual @ t.T
    share = block.local * block.slices
    half_width = np.sqrt(4 * share * REFERENCE_LOAD / block.slices)
    local = 2 * share * (np.log(4e-3 / half_width) - 1) * np.eye(block.slices)
    offset, dashpot = np.full(block.slices, block.gap), np.full(block.slices, block.damping / block.slices)
    return Problem(
        np.concatenate(omega),
        np.concatenate(zeta),
        np.hstack(rows),
        compliance + local,
        offset,
        dashpot=dashpot,
        path=PATH_SHARE * compliance + local,
    )


def kernel_run(
    two: tuple[FlatBody, FlatBody], block: FlatContact, integrator: int, library: Path | None = None
) -> np.ndarray:
    """(STEPS, 3): mesh force, stored energy and dissipated energy after every step."""
    parameters = {
        "left.w_start": SPEED,
        "h": H,
        "integrator": integrator,
        "level": 3,
        "slices": block.slices,
        "effect.hertz": 0,
    }
    kernel = Kernel(flat_blob("slices", two, block), parameters, library)
    kernel.initialize()
    record = stepped(kernel, STEPS, H, "mesh.force", "energy.stored", "energy.dissipated")
    assert kernel.get("solver.retried_steps") == 0
    return record


def reference_forces(problem: Problem, two: tuple[FlatBody, FlatBody], gamma: float = 1.0) -> np.ndarray:
    """(STEPS, 2): sum of forces and stored energy after every step."""
    reference = Reference(problem, Scheme(H, gamma))
    none, v = np.zeros(len(problem.omega)), np.zeros(len(problem.omega))
    v[0] = SPEED * np.sqrt(two[0].mass)
    state, record = reference.start(none, v, none), np.empty((STEPS, 2))
    for i in range(STEPS):
        state = reference.step(state, none)
        record[i] = state.sampled.sum(), reference.energy(state)
    assert reference.changes >= 2 and reference.failures == 0
    return record


@pytest.mark.parametrize(("integrator", "gamma"), [(0, 1.0), (1, 0.0)], ids=["dg4", "em"])
@pytest.mark.parametrize(("zeta", "damping"), [(0.0, 0.0), (0.01, 0.0), (0.0, 2e3), (0.01, 2e3), (0.01, 8e3)])
@pytest.mark.parametrize("slices", [1, 4, 5, pytest.param(6, marks=pytest.mark.full)])
def test_slices_step_by_step(
    double_library: Path, slices: int, integrator: int, gamma: float, zeta: float, damping: float
) -> None:
    two, block = bodies(zeta), replace(BLOCK, slices=slices, damping=damping)
    got = kernel_run(two, block, integrator, double_library)
    expected = reference_forces(reference_problem(two, block), two, gamma)
    close = 1e-9 if damping else 1e-11  # a contact that closes: its damper and α in turns; measured: 1.3e-10, 6e-15
    np.testing.assert_allclose(got[:, 0], expected[:, 0], rtol=0, atol=close * expected[:, 0].max())
    np.testing.assert_allclose(got[:, 1], expected[:, 1], rtol=close)
    loss = np.diff(got[:, 2])
    growth = {0.0: 1e-12, 2e3: 1e-4, 8e3: 2e-4}[damping]  # dashpots balance to second order; measured: 5.5e-5, 1.1e-4
    assert loss.min() >= -growth * got[0, 1]
    assert -loss[loss < 0].sum() <= 3e-3 * max(got[-1, 2], 1e-9 * got[0, 1])  # measured: 1.8e-3
    assert (got[-1, 2] > 0.01 * got[0, 1]) == (zeta > 0 or damping > 0)


def test_the_product_differs_by_single_precision_only() -> None:
    two, block = bodies(0.01), replace(BLOCK, slices=5, damping=2e3)
    got, expected = kernel_run(two, block, 0), reference_forces(reference_problem(two, block), two)
    np.testing.assert_allclose(got[:, 0], expected[:, 0], rtol=0, atol=1e-3 * expected[:, 0].max())


# ---- how well a step is solved ---------------------------------------------------------------------------------------
JUMP_STEP, EM = 7e-6, 1  # s
RIGID = {"level": 0, "slices": 1, "integrator": EM, "effect.elastic": 0, "effect.bearings": 0}


def after_a_jump(library: Path | None, torques: tuple[float, float], damping: float) -> np.ndarray:
    """Mesh force (N) and transmission error (m) of every step after a jump of the torque (N·m)."""
    kernel = Kernel(pair_blob(("torque", "fixed")), {**RIGID, "contact_damping": damping}, library)
    begun(kernel, {"pinion.tau": torques[0]}).set("pinion.tau", torques[1])
    return stepped(kernel, 6, JUMP_STEP, "mesh.force", "mesh.te")


@pytest.mark.parametrize("damping", [0.0, 2e4])
@pytest.mark.parametrize("torques", [(1.0, 100.0), (10.0, 300.0), (100.0, 300.0), (300.0, 10.0)])
def test_the_product_solves_its_steps_as_well_as_the_double_build(
    double_library: Path, torques: tuple[float, float], damping: float
) -> None:
    """Worst of the cases: 2.4e-8; with a tolerance of 1e-5 7e-7, of 1e-3 1e-4."""
    found, wanted = (after_a_jump(library, torques, damping) for library in (None, double_library))
    error = np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)
    assert error.max() < 1e-7
