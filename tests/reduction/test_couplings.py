"""Couplings at interfaces: rigid (RBE2) and averaging (RBE3) nodes against what they mean; carriers whose bolts are
alike: one bolt's part factorised for all gives the solutions of the whole body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from gearfmu.errors import MeshError
from gearfmu.fem import hex20
from gearfmu.fem.coupling import rigid_fields
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.stage import load_stage

SPEC = load_stage("planetary54")
SCALE = 0.34


def with_couplings(**kinds: str):
    return SPEC.by_file["carrier"].model_copy(update={"coupling": kinds})


@pytest.fixture(scope="module")
def carrier() -> FullOrder:
    return carrier_full_order(SPEC.by_file["carrier"], SCALE)


@pytest.fixture(scope="module")
def averaged() -> FullOrder:
    return carrier_full_order(with_couplings(bore="averaging", bolt1="averaging"), SCALE)


@pytest.fixture(scope="module")
def elements() -> Elements:
    mesh = carrier_sector(
        carrier_geometry(SPEC.bodies["carrier"]), SPEC.written.carrier.mesh.model_copy(update={"scale": SCALE})
    ).full()
    return Elements(
        mesh.nodes, mesh.elements, *hex20.assemble(mesh.nodes, mesh.elements, SPEC.written.carrier.material)
    )


def test_kinds_are_chosen_for_each_interface(averaged, elements):
    assert [i.kind for i in averaged.interfaces] == ["rigid", "averaging", "rigid", "rigid", "averaging"]
    slaves = elements.nodes.shape[0] * 3 - (averaged.size - 18)  # three rigid bolts have eliminated theirs
    assert slaves == 3 * 3 * len(_seat(elements, 0))


@pytest.mark.parametrize("name", ["carrier", "averaged"])
def test_rigid_motion_costs_nothing_and_every_node_follows_it(name, request):
    body = request.getfixturevalue(name)
    assert abs(body.stiffness @ body.rigid).max() < 1e-9 * abs(body.stiffness).max()
    for interface in body.interfaces:
        expected = np.vstack([rigid_fields(interface.point), np.eye(6)[3:]])
        assert interface.rows @ body.rigid == pytest.approx(expected, abs=1e-12)


def test_rigid_coupling_is_the_body_with_its_slaves_moved_by_hand(carrier, elements):
    """Bore held, bolt 0 moved by a unit motion of its master: reaction of the coupled body = that of the plain finite
    elements whose seat nodes are given that motion."""
    bolts = [_seat(elements, k) for k in range(4)]
    bore = np.flatnonzero(np.abs(np.hypot(elements.nodes[:, 0], elements.nodes[:, 1]) - 20e-3) < 1e-9)
    rows = sp.vstack([carrier.rows("bolt0"), carrier.rows("bolt1", "bolt2", "bolt3", "bore")]).tocsr()
    driven = rows.indices
    free = np.setdiff1d(np.arange(carrier.size), driven)
    k_fd = carrier.stiffness[free][:, driven[:6]].toarray()
    inner = spl.splu(sp.csc_matrix(carrier.stiffness[free][:, free]), "MMD_AT_PLUS_A").solve(-k_fd)
    mine = carrier.stiffness[driven[:6]][:, free] @ inner + carrier.stiffness[driven[:6]][:, driven[:6]].toarray()
    dofs = (3 * np.concatenate([*bolts, bore])[:, None] + np.arange(3)).ravel()
    motion = np.zeros((len(dofs), 6))
    motion[: 3 * len(bolts[0])] = rigid_fields(elements.nodes[bolts[0]] - [45e-3, 0, 0]).reshape(-1, 6)
    rest = np.setdiff1d(np.arange(3 * len(elements.nodes)), dofs)
    k = elements.stiffness
    moved = spl.splu(sp.csc_matrix(k[rest][:, rest]), "MMD_AT_PLUS_A").solve(-(k[rest][:, dofs] @ motion))
    theirs = motion.T @ (k[dofs][:, rest] @ moved + k[dofs][:, dofs] @ motion)
    assert mine == pytest.approx(theirs, rel=1e-8, abs=1e-9 * np.abs(theirs).max())


def test_two_rigid_couplings_cannot_share_a_node(elements):
    seat = _seat(elements, 0)
    both = [Coupling(name, "rigid", seat, np.zeros(3)) for name in ("first", "second")]
    with pytest.raises(MeshError, match="'first' and 'second'"):
        full_order("test", elements, both, (), 1.0)
    with pytest.raises(MeshError, match="has no nodes"):
        full_order("test", elements, [Coupling("empty", "rigid", seat[:0], np.zeros(3))], (), 1.0)


def _seat(elements: Elements, bolt: int) -> np.ndarray:
    axis = carrier_geometry(SPEC.bodies["carrier"]).bolt_axis(bolt)
    distance = np.hypot(elements.nodes[:, 0] - axis[0], elements.nodes[:, 1] - axis[1])
    return np.flatnonzero((np.abs(distance - 8e-3) < 1e-9) & (elements.nodes[:, 2] > -10e-3 - 1e-9))


# ---- bolts that are alike --------------------------------------------------------------------------------------------
COARSE = 0.2
SHIFTS = (-((2e4 * np.pi) ** 2), (2e4 * np.pi) ** 2)  # rad²/s², the second beyond the first elastic modes
SOFT = {name: "averaging" for name in ("bolt0", "bolt1", "bolt2", "bolt3", "bore")}


def alike(stage: str, coupling: dict[str, str]) -> FullOrder:
    own = load_stage(stage).by_file["carrier"]
    return carrier_full_order(own.model_copy(update={"coupling": coupling or own.coupling}), COARSE)


@pytest.fixture(params=[("planetary54", {}), ("helical_set", {}), ("planetary54", SOFT)], scope="module")
def body(request: pytest.FixtureRequest) -> FullOrder:
    return alike(*request.param)


def test_static_and_shifted_solutions_are_those_of_the_whole_body(body: FullOrder) -> None:
    """Free, and held at its bore."""
    loads, held = body.rows().T.toarray(), body.grounded()
    parts, whole = Elastic(body), Elastic(replace(body, parts=None))
    pairs = [(parts.flexibility(loads), whole.flexibility(loads))]
    pairs += [(parts.shifted(shift).solve(loads), whole.shifted(shift).solve(loads)) for shift in SHIFTS]
    pairs.append(tuple(Elastic(of).flexibility(held.rows().T.toarray()) for of in (held, replace(held, parts=None))))
    for own, other in pairs:
        assert np.abs(own - other).max() < 1e-9 * np.abs(other).max()


def test_bolts_that_are_coupled_differently_are_no_equal_parts() -> None:
    assert alike("planetary54", {"bolt1": "averaging"}).parts is None
