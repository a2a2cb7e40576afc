"""What each reduction method promises to match, on a free, a held and an elastically mounted body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_body import direct, mounted, small, tiny

from gearfmu.errors import BodyError
from gearfmu.reduction.elastic import Elastic, elastic
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import BAND, Size, expansion_points, input_loads
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer

BODIES = {"free": small, "held": lambda: HELD, "mounted": mounted}
HELD = small().grounded()
COUNT = 72
LINES = Judging.over(lines=40)


@pytest.fixture(scope="module", params=BODIES)
def body(request):
    return BODIES[request.param]()


@pytest.fixture(scope="module")
def full(body):
    return reference(body, LINES)


@pytest.fixture(scope="module", params=METHODS)
def basis(request, body):
    return METHODS[request.param](body, Size(COUNT))


def projected(body, vectors):
    return vectors.T @ (body.stiffness @ vectors)


def test_vectors_are_orthonormal_in_mass_and_free_of_rigid_motion(body, basis):
    space = elastic(body)
    assert 0 < basis.shape[1] <= COUNT
    assert np.abs(basis.T @ (body.mass @ basis) - np.eye(basis.shape[1])).max() < 1e-9
    assert np.abs(space.rigid.T @ (body.mass @ basis)).max(initial=0) < 1e-10


def test_six_rigid_modes_are_exact_for_every_method(basis, body):
    """[R V]: no energy in R, no coupling to V in K and M, mass and rows of R those of the full body."""
    model = oscillators(body, basis, 0.01)
    assert model.rigid_rows.shape[1] == body.rigid.shape[1] * (body is small())
    if not model.rigid_rows.shape[1]:
        return
    everything = np.hstack([elastic(body).rigid, basis])
    stiffness = everything.T @ (body.stiffness @ everything)
    values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    assert np.abs(values[:6]).max() < 1e-9 * values[6]
    assert np.allclose(model.rigid_mass, body.rigid.T @ (body.mass @ body.rigid), rtol=0, atol=1e-12)
    assert np.allclose(model.rigid_rows, body.rows() @ body.rigid, rtol=0, atol=1e-12)


def test_oscillators_answer_as_the_basis_does(basis, body):
    """Decoupled, with rigid motion and ground as the kernel sees them, against the projected matrices solved whole."""
    model = oscillators(body, basis, 0.01)
    everything = np.hstack([elastic(body).rigid, basis])
    rows = (body.scales()[:, None] * (body.rows() @ everything)).astype(complex)
    held = model.select(*body.ground)
    free = np.setdiff1d(np.arange(len(rows)), held)
    lines = Judging(np.array([300.0, 3000.0, 9000.0]))
    mine = transfer(model, lines, body.ground)
    for k, f in enumerate(lines.frequency):
        dynamic = projected(body, everything) * (1 + 0.02j) - (2 * np.pi * f) ** 2 * np.eye(everything.shape[1])
        zero = np.zeros((len(held),) * 2)
        system = np.block([[dynamic, rows[held].T], [rows[held], zero]])
        loads = np.vstack([rows[free].T, np.zeros((len(held), len(free)))])
        solved = np.linalg.solve(system, loads)[: everything.shape[1]]
        whole = rows[free] @ solved
        assert np.linalg.norm(mine[k] - whole) < 1e-10 * np.linalg.norm(whole) * (1 + 1e2 * (f < 1000))


@pytest.mark.parametrize("name", ["rubin", "krylov"])
def test_static_response_is_reproduced(name, body):
    model = oscillators(body, METHODS[name](body, Size(COUNT)), 0.01)
    scale = np.outer(model.scales, model.scales)
    assert np.linalg.norm(model.residual() * scale) < 1e-8 * np.linalg.norm(model.static * scale)


def test_craig_bampton_reproduces_loads_in_equilibrium(body):
    model = oscillators(body, METHODS["craig_bampton"](body, Size(40)), 0.01)
    rigid = elastic(body).rigid
    patterns = np.eye(body.rows().shape[0])
    resultant = rigid.T @ body.rows().T.toarray()
    if len(resultant):
        patterns = np.linalg.svd(resultant / np.abs(resultant).max(axis=1)[:, None])[2][len(resultant) :].T
    left = patterns.T @ model.residual() @ patterns
    assert np.abs(left).max() < 1e-8 * np.abs(patterns.T @ model.static @ patterns).max()


def test_krylov_matches_the_moments_it_names(body):
    """H and its derivatives in s at every point: 2p of them for p powers, the static ones too."""
    loads = input_loads(body)
    basis = METHODS["krylov"](body, Size(5 * loads.shape[1]))
    space = elastic(body)
    stiffness, mass = projected(body, basis), np.eye(basis.shape[1])
    small_loads = basis.T @ loads
    for point, power in zip(expansion_points(3, BAND), (2, 2, 1), strict=True):
        solver = space.shifted(point) if point else None
        shift = solver.shift if solver else 0.0
        whole, part = space.balance(loads), small_loads
        scale = None
        for derivative in range(2 * power):
            whole = solver.solve(whole) if solver else space.flexibility(whole)
            part = np.linalg.solve(stiffness - shift * mass, part)
            exact, mine = loads.T @ whole, small_loads.T @ part
            scale = np.linalg.norm(exact) if scale is None else scale
            assert np.linalg.norm(exact - mine) < 1e-6 * np.linalg.norm(exact), (point, derivative)
            whole, part = space.mass(whole), part


def test_order_of_the_methods_is_that_of_the_paper(body, full):
    errors = {
        name: relative_error(
            full.matrix, transfer(oscillators(body, METHODS[name](body, Size(COUNT)), 0.01), LINES, body.ground)
        ).max()
        for name in ("modal", "craig_bampton", "rubin", "krylov")
    }
    assert errors["krylov"] < 1e-2 * errors["rubin"] < 1e-4 * errors["craig_bampton"] < 1e-4 * errors["modal"]


@pytest.mark.parametrize("ground", [False, True])
@pytest.mark.parametrize("name", ["modal", "craig_bampton", "rubin"])
def test_a_full_basis_is_the_full_model(name, ground):
    """All free modes, and all fixed-interface modes with the constraint modes: nothing is left out."""
    body = tiny().grounded() if ground else tiny()
    model = oscillators(body, METHODS[name](body, Size(elastic(body).elastic)), 0.01)
    assert model.size == elastic(body).elastic or name == "rubin"  # what it deflates is shorter than 1e-10
    lines = Judging(np.array([200.0, 4e3, 40e3]))
    for h, f in zip(transfer(model, lines, body.ground), lines.frequency, strict=True):
        exact = direct(body, f, 0.01)
        assert np.linalg.norm(h - exact) < 1e-8 * np.linalg.norm(exact)


def test_expansion_points_are_chebyshev_points_of_the_second_kind():
    """Three in 0 … 100 Hz: 0, half and all of it in Ω; σ = Ω² = (2π·50)² and (2π·100)²."""
    assert expansion_points(3, (0.0, 100.0)) == pytest.approx([0.0, 98696.044, 394784.176], rel=1e-8)
    assert expansion_points(1, (0.0, 100.0)) == [0.0]


def test_a_shift_between_two_eigenvalues_stays_and_one_at_an_eigenvalue_moves():
    """The distance to the nearest eigenvalue does not cancel between neighbours on either side of the shift."""
    space = Elastic(small().grounded())
    squared = space.modes(8)[0]
    middle = 0.5 * (squared[2] + squared[3])
    assert space.shifted(middle).shift == middle
    assert space.shifted(middle).distance() == pytest.approx(squared[3] - middle, rel=0.05)
    moved = space.shifted(squared[5]).shift
    assert moved != squared[5] and abs(moved / squared[5] - 1) < 0.02
    assert space.shifted(1.001 * middle, near=np.array([1.001 * middle])).shift != 1.001 * middle


def test_bad_sizes_say_what_to_do():
    for wrong in ({"count": 0}, {"count": 3, "band": (5, 1)}):
        with pytest.raises(BodyError, match="size"):
            Size(**wrong)
    for name in ("krylov", "rubin", "craig_bampton"):
        with pytest.raises(BodyError, match="give at least that"):
            METHODS[name](small(), Size(5))


def test_dependent_inputs_are_deflated():
    """The same interface twice: half as many vectors, the same transfer matrix."""
    twice = replace(HELD, interfaces=(*HELD.interfaces, replace(HELD.interfaces[0], name="again")))
    once, both = (METHODS["krylov"](b, Size(3 * b.rows().shape[0])) for b in (HELD, twice))
    assert both.size == once.size
    rows = slice(0, HELD.rows().shape[0])
    mine = transfer(oscillators(twice, both, 0.01), LINES)[:, rows, rows]
    assert relative_error(transfer(oscillators(HELD, once, 0.01), LINES), mine).max() < 1e-9
