"""The pair in loaded contact, linearised from the sections of the general model alone, has the frequencies of the pair
put together from its bodies.

One reader of every section: how rows, residuals, supports and ports of the blob belong together.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as sl
from flank_reader import full_tables
from pair_by_parts import Contact, couple, gear_at, slice_weights, tangents

from gearfmu.body import load_bodies
from gearfmu.stage.assembly.assemble import general_sections
from gearfmu.stage.assembly.ground_part import read_tables
from gearfmu.stage.assembly.teeth import OFFSETS
from gearfmu.stagefile.stage import load_stage

ROLLS = 48
PLACES = [((0, 0), (20, 30)), ((1, -1), (38, 9))]  # tooth numbers and grid rolls of both gears


class Side:
    """One gear at its contacts: rows in the spins, ground and turning oscillators, and residuals, as displacement
    outwards."""

    def __init__(self, sections, gear, number, contacts, weights, normal):
        s, self.gear = sections, gear
        z, phase = s[f"size{gear}"][1], s[f"gear{gear}"][4]
        step, ground = 2 * math.pi / z, s[f"ground_list{gear}_{number}"]
        self.omega = s[f"omega{gear}"]
        self.spin = np.full(len(contacts), s[f"gear{gear}"][0])
        self.ground = np.zeros((len(contacts), s[f"omega_ground{number}"].size))
        self.turning = np.zeros((len(contacts), self.omega.size))
        self.supports = np.zeros((len(contacts), len(s[f"kappa{number}"])))
        self.port = np.zeros((len(contacts), 2))
        self.residual = np.zeros((len(contacts), len(contacts)))
        tables = full_tables(s, gear, ROLLS, number)
        for i, (tooth, roll, slice_) in enumerate(contacts):
            psi, w = phase + tooth * step, weights[slice_]
            elastic = read_tables(tables.ground[:, 0, roll], psi)
            self.ground[i, ground] = normal @ s[f"centre{gear}_{number}"][:2] + w @ elastic
            self.turning[i] = turn(w @ tables.rows[0, roll], s, gear, tooth * step)
            self.supports[i] = w @ read_tables(tables.supports[:, 0, roll], psi)
            self.port[i] = w @ tables.port[0, roll]
            for k, (other, there, of) in enumerate(contacts):
                block = tables.residual[0, 0, OFFSETS.index(other - tooth), roll, there]
                self.residual[i, k] = w @ block @ weights[of]


def turn(row, sections, gear, angle):
    """Row (n,) of tooth 0 on the tooth at `angle` from it, in the frame of the gear (docs/theory.md eq. 3)."""
    member, theta = sections[f"member{gear}"], sections[f"diameter{gear}"] * angle
    first = np.flatnonzero(member == 1)
    turned = row * np.cos(theta)
    turned[first] -= row[first + 1] * np.sin(theta[first])
    turned[first + 1] += row[first] * np.sin(theta[first])
    return turned


def frequencies_from_sections(spec, sections, contacts, number):
    """Natural frequencies (Hz) with contacts closed, from the blob alone; the local law's flexibility `own` beside
    it."""
    s = sections
    weights = slice_weights(spec.written.contact.slices, s["degrees"])
    a = math.hypot(s["engagement"][0, 2] - s["engagement"][0, 0], s["engagement"][0, 3] - s["engagement"][0, 1])
    t = -math.acos((s["gear0"][0] + s["gear1"][0]) / a)
    normal = np.array([-math.sin(t), math.cos(t)])
    own = np.concatenate([tangents(spec, contacts), 1 / s["ports"][:, 0]])
    sides = []
    for gear, sign in ((0, 1), (1, -1)):
        grid = np.linspace(*s[f"gear{gear}"][1:3], ROLLS)
        places = [(c.teeth[gear], int(np.abs(grid - c.rolls[gear]).argmin()), c.slice) for c in contacts]
        sides.append(Side(s, gear, number, places, weights, sign * normal))
    kappa, n, ports = s[f"kappa{number}"], len(contacts), 2
    supports = np.vstack([sides[0].supports + sides[1].supports, s["port_support"]])
    residual = np.zeros((n + ports, n + ports))
    for side in sides:
        residual[:n, :n] += side.residual - (side.turning / side.omega**2) @ side.turning.T
        residual[:n, n:] += side.port
    residual[n:, :n], residual[n:, n:] = residual[:n, n:].T, s["port_residual"]
    residual -= supports @ kappa @ supports.T
    ground = np.vstack([sides[0].ground + sides[1].ground, s[f"port_rows{number}"]])
    turning = np.vstack(
        [np.hstack([side.turning for side in sides]), np.zeros((ports, sum(x.omega.size for x in sides)))]
    )
    spins = np.vstack([np.stack([side.spin for side in sides], axis=1), np.eye(2)])
    rows = np.hstack([spins, ground, turning])
    omega = np.concatenate([np.zeros(2), s[f"omega_ground{number}"], *[side.omega for side in sides]])
    mass = np.concatenate([s["inertia"], np.ones(omega.size - 2)])
    coupling = rows.T @ np.linalg.solve(np.diag(own) + residual, rows)
    squared = sl.eigh(np.diag(omega**2) + 0.5 * (coupling + coupling.T), np.diag(mass), eigvals_only=True)
    return np.sqrt(np.maximum(squared, 0)) / (2 * math.pi)


@pytest.mark.parametrize("held", [False, True])
def test_frequencies_in_loaded_contact_are_those_of_the_parts(held):
    spec = load_stage("fzg_c")
    bodies = load_bodies(spec)
    grids = [np.linspace(shape.s_form, shape.s_tip, ROLLS) for shape in spec.written.geometry.gears]
    contacts = [
        Contact(teeth, k, (grids[0][rolls[0]], grids[1][rolls[1]]), 1200.0) for teeth, rolls in PLACES for k in range(5)
    ]
    parts = couple(spec, [gear_at(spec, bodies, g, 0.0, contacts) for g in (0, 1)], contacts, held)
    want = np.sqrt(sl.eigh(parts.stiffness, np.diag(parts.mass), eigvals_only=True)) / (2 * math.pi)
    sections = general_sections(spec, bodies)
    have = frequencies_from_sections(spec, sections, contacts, int(held))
    error = np.abs(have / want - 1).max()
    print(
        f"linearised pair, held {held}: {want.size} frequencies from {want[0]:.0f} Hz, largest difference {error:.1e}"
    )
    assert have.size == want.size and error < 1e-8
