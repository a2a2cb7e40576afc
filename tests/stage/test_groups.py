"""The ground group of the pair: statics and frequencies against the same bodies put together another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flank_rows import flank_rows, flank_supports

from gearfmu.stage.assembly.ground_part import read_tables
from gearfmu.stage.assembly.groups import SPIN, mount
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.teeth import OFFSETS, blend, resampling

LOADS = [
    (0, 0, 5, 0),
    (0, 0, 30, 1),
    (1, 0, 40, 0),
    (-1, 0, 11, 2),
    (2, 1, 20, 0),
    (0, 1, 5, 0),
]  # tooth, flank, roll, function
ANISOTROPIC = np.array([[4.0e-9, 1.5e-9], [1.5e-9, 2.5e-9]])


@pytest.fixture(scope="module")
def layout(spec, bodies):
    return stage_layout(spec, bodies)


def with_compliance(layout, compliance):
    return replace(layout, supports=[replace(s, compliance=compliance) for s in layout.supports])


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def relative(difference, answer):
    """Largest difference, every entry in units of the answers at its two loads: flanks and bore angle differ by powers
    of ten."""
    scale = np.sqrt(np.abs(np.diag(answer)))
    return np.abs(difference / np.outer(scale, scale)).max()


def normal(shape, load, tooth_angle):
    """Outward normal (2,) of a loaded flank point of the tooth at `tooth_angle`, from the involute (docs/theory.md eq.
    4)."""
    _, flank, roll, _ = load
    sign = (1, -1)[flank]
    s = np.linspace(shape.s_form, shape.s_tip, 48)[roll]
    t = tooth_angle + sign * (shape.psi_b - s / shape.r_b)
    return sign * np.array([-np.sin(t), np.cos(t)])


class Direct:
    """A free body as it is stored, in its own axes, rotated by `angle`: loads on flanks, a moment on the bore, springs
    explicit.

    No group, no elimination: rigid translation and support force are unknowns of one system."""

    def __init__(self, body, shape, loads, angle, compliance):
        self.angle = angle
        degrees = np.arange(0, 5, 2)
        grid = resampling(body.flank.roll, shape.s_form, shape.s_tip)
        step = 2 * np.pi / body.flank.teeth
        static = blend(grid, blend(grid, body.flank.static[..., degrees, :][..., degrees], 3), 4)
        bore = blend(grid, body.flank.node[:, :, degrees], 1)
        n = len(loads)
        self.c = np.zeros((n + 3, n + 3))  # flanks, moment, bore x, y
        for i, (j, f, p, a) in enumerate(loads):
            for k, (m, g, q, b) in enumerate(loads):
                self.c[i, k] = static[f, g, (m - j) % static.shape[2], p, q, a, b]
            x, y, about = bore[f, p, a][[0, 1, SPIN]]
            self.c[i, n] = self.c[n, i] = about
            self.c[i, n + 1 :] = self.c[n + 1 :, i] = turn(j * step) @ [x, y]
        self.c[n:, n:] = body.static[np.ix_([SPIN, 0, 1], [SPIN, 0, 1])]
        normals = [normal(shape, load, load[0] * step) * (load[3] == 0) for load in loads]
        self.rigid = np.vstack([*normals, np.zeros((1, 2)), np.eye(2)])
        self.spring = turn(-angle) @ compliance @ turn(angle)

    def answer(self):
        """Displacement (n + 1, n + 1) of flanks and bore angle per unit load, and support force (2, n + 1) in ground
        axes."""
        c, n = self.c, len(self.c) - 2
        # unknowns: translation, force on the body at its bore
        system = np.block([[np.zeros((2, 2)), -np.eye(2)], [np.eye(2), c[n:, n:] + self.spring]])
        load = np.vstack([self.rigid[:n].T, -c[n:, :n]])
        found = np.linalg.solve(system, load)
        answer = self.rigid[:n] @ found[:2] + c[:n, :n] + c[:n, n:] @ found[2:]
        return answer, -turn(self.angle) @ found[2:]


class Grouped:
    """The same answer from the sections of a gear and a set."""

    def __init__(self, body, shape, group, index, loads, angle):
        step, flank = 2 * np.pi / body.flank.teeth, group.layout.bodies[index].flank
        rows, supports = flank_rows(group, index), flank_supports(group, index)
        node, n = flank.node[0], len(loads)
        self.w, c_s, c_p = [], [], []
        for j, f, p, a in loads:
            psi = angle + j * step
            e = read_tables(rows[:, f, p, a], psi)
            centre = normal(shape, (j, f, p, a), psi) * (a == 0) @ group.rigid(index)[:2]
            self.w.append(centre + e)
            c_s.append(read_tables(supports[:, f, p, a], psi))
            c_p.append(node[f, p, a, SPIN])
        self.w = np.array([*self.w, group.node_rows(index, 0, SPIN)])
        self.c_s = np.array([*c_s, group.node_supports(index, 0, SPIN)])
        self.group = group
        self.c = np.zeros((n + 1, n + 1))
        for i, (j, f, p, a) in enumerate(loads):
            for k, (m, g, q, b) in enumerate(loads):
                self.c[i, k] = flank.residual[f, g, OFFSETS.index(m - j), p, q, a, b]
        self.c[:n, n] = self.c[n, :n] = c_p
        self.c[n, n] = group.layout.bodies[index].residual[SPIN, SPIN]

    def answer(self):
        group, kappa = self.group, self.group.kappa
        q = self.w.T / group.omega[:, None] ** 2
        force = kappa @ (group.support_rows @ q + self.c_s.T)
        return self.c - self.c_s @ kappa @ self.c_s.T + self.w @ q, force


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize(
    "compliance", [np.eye(2) / 3e8, ANISOTROPIC, np.zeros((2, 2))], ids=["isotropic", "anisotropic", "held"]
)
def test_statics_are_those_of_free_body_and_springs(layout, bodies, pair, index, compliance):
    group = mount(with_compliance(layout, compliance))
    for angle in (0.0, 0.77, 3.9):
        want, want_force = Direct(bodies[index], pair.gears[index], LOADS, angle, compliance).answer()
        have, have_force = Grouped(bodies[index], pair.gears[index], group, index, LOADS, angle).answer()
        error = relative(have - want, want)
        force_error = np.abs(have_force[2 * index : 2 * index + 2] - want_force).max() / np.abs(want_force).max()
        print(f"statics: gear {index}, angle {angle}: displacement {error:.1e}, support force {force_error:.1e}")
        assert error < 1e-8 and force_error < 1e-8
        assert np.abs(np.delete(have_force, [2 * index, 2 * index + 1], axis=0)).max() < 1e-12
