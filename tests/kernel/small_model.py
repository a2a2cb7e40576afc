"""Small model blobs made without finite elements: a spur pair of FZG C size with a few invented modes, and two coaxial
bars.

The sections are those of gearfmu/kernel/src/model/gk_fields.inc; the pair's ground oscillators come from its invented
free bodies by gearfmu.stage.assembly.groups, as those of every stage.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from exact_bars import Bar
from flat import FlatBody, FlatContact, flat_blob
from handmade import mass_matrix, toothed

from gearfmu.body import Body
from gearfmu.stage.assembly.assemble import (
    MODEL_VERSION,
    flank_sections,
    flank_sizes,
    mode_sections,
    port_compliances,
    set_sections,
)
from gearfmu.stage.assembly.blob import gear_numbers, order_sections, read_blob, write_blob
from gearfmu.stage.assembly.ground_part import GroundPart, Reading, ground_part
from gearfmu.stage.assembly.groups import Group, Layout, Support, mount
from gearfmu.stagefile.tables.connections import LevelSpec

NAMES = ("pinion", "wheel")
DISTANCE, TEETH, SHIFT, MASS, INERTIA = 91.5e-3, (16, 24), (0.1817, 0.1715), (0.35, 0.95), (2.2e-4, 1.5e-3)
ALPHA = np.radians(20)
BASE = tuple(0.5 * 4.5e-3 * z * np.cos(ALPHA) for z in TEETH)
PSI = tuple((np.pi / 2 + 2 * x * np.tan(ALPHA)) / z + np.tan(ALPHA) - ALPHA for z, x in zip(TEETH, SHIFT, strict=True))
WORKING = np.arccos(sum(BASE) / DISTANCE)
LENGTH = DISTANCE * np.sin(WORKING)
PHASE = (0.0, np.pi - WORKING - PSI[1] + (LENGTH - BASE[0] * (PSI[0] + WORKING)) / BASE[1])  # drive flanks just touch
FORM, TIP = (3.0e-3, 9.0e-3), (23.3e-3, 30.2e-3)
ROLLS, DEGREES = 6, (0, 2)
CUTS = (20e3, 60e3)  # Hz
BEARING_K, BEARING_C = 3e8, 600.0
EXTERNAL, SPRING, TORQUE, FIXED = 1, 0, 1, 2
PORTS = {"spring": (SPRING, 0), "torque": (TORQUE, 0), "fixed": (FIXED, 0), "chain": (SPRING, 1)}  # kind, chain
NODES = ((0, 0), (1, 0))  # body and node of the ports: the bores
FREQUENCY = np.array([9e3, 11e3, 11e3, 14e3, 14e3, 38e3, 38e3])  # Hz
DIAMETER, MEMBER = np.array([0, 1, 1, 2, 2, 3, 3]), np.array([0, 1, 2, 1, 2, 1, 2])


def pair_blob(ports: tuple[str, str] = ("chain", "spring"), seed: int = 0) -> bytes:
    """A spur pair of 16/24 teeth with 7 modes (three pairs) a gear: one of nodal diameter 0 and a pair of 1, which go
    into the ground oscillators with the bearings, two pairs that turn with the gear; 3 slices, ports of the kinds
    named."""
    rng = np.random.default_rng(seed)
    bodies = [_body(g, rng) for g in (0, 1)]
    every, cuts = np.arange(len(FREQUENCY)), LevelSpec(fast_cut=CUTS[0], standard_cut=CUTS[1])
    reading = Reading(every, np.arange(2), np.eye(ROLLS), cuts)
    groups = _groups([ground_part(body, reading) for body in bodies])
    layout, last = groups[0].layout, (2e4, 5.0, 0.05, 2e-3, 8e3, 0.5)
    sections = {
        "counts": np.array([MODEL_VERSION, 3, 2, 2, 1, 2, 4, len(DEGREES), ROLLS, len(groups)], np.int32),
        "name": "small_pair",
        "rotor_names": "|".join(NAMES),
        "engagement_names": "mesh",
        "support_names": "|".join(layout.support_names()),
        "displacement_names": "|".join(layout.displacement_names()),
        "limits": np.array([*CUTS, 7.5e-6, 2 * np.pi / (628.0 * TEETH[0])]),
        "degrees": np.array(DEGREES, np.int32),
        "inertia": np.array(INERTIA),
        "engaged": np.array([[0, 1, EXTERNAL, _coast_shift()]], np.int32),
        "engagement": np.array([[0.0, 0.0, DISTANCE, 0.0, 1e-4, 0.0, 2e4, 600.0 / BASE[0], 0.0, 0.0]]),
        "port_kinds": np.array([[g, *PORTS[port]] for g, port in enumerate(ports)], np.int32),
        "ports": np.array([last, last]),
    } | port_compliances(groups[0], NODES)
    for g in (0, 1):
        sections |= {f"gear{g}": _gear(g)} | _modes(g, bodies[g], groups)
    for s, group in enumerate(groups):
        sections |= set_sections(s, group, NODES)
    return write_blob(order_sections(sections))


def bars_blob(bars: tuple[Bar, Bar], modes: tuple[int, int], gap: float) -> bytes:
    """Two coaxial bars `gap` apart, with the residual of the modes left out; 2 (1 − ν²)/(πE) of the contact of 1 m
    is as good as rigid."""
    bodies = [
        FlatBody(b.mass, b.frequencies(n), np.zeros(n), b.end_row(n)[None, 1:], np.array([[b.residual(n)]]))
        for b, n in zip(bars, modes, strict=True)
    ]
    return flat_blob("bars", bodies, FlatContact(gap=gap, local=1e-20))


def with_nodes(blob: bytes, share: float = 0.5, nodes: tuple[int, int] = (9, 5), penalty: float = 2e9) -> bytes:
    """The blob of a pair with flank nodes along and across, for nodal contact of a penalty (N/m³); share: of it that
    gear A's nodes have."""
    sections = dict(read_blob(blob)) | {"nodal": np.array([penalty, share])}
    return write_blob(sections | {f"nodes{g}": np.array(nodes, np.int32) for g in (0, 1)})


def _coast_shift() -> int:
    """The wheel's tooth whose coast flank is nearest to that of the pinion's tooth 0."""

    def gap(shift: int) -> float:
        turned = PHASE[1] + shift * 2 * np.pi / TEETH[1] - np.pi
        return abs(LENGTH - BASE[0] * (PSI[0] + WORKING) - BASE[1] * (PSI[1] + WORKING - turned))

    return min((-1, 0, 1), key=gap)


def _gear(g: int) -> np.ndarray:
    edge, inner = 2e-4, TIP[g] - 2e-4
    return gear_numbers(
        {
            "r_b": BASE[g],
            "s_form": FORM[g],
            "s_tip": TIP[g],
            "psi_b": PSI[g],
            "phase": PHASE[g],
            "face_width": 14e-3,
            "local": 2 * (1 - 0.3**2) / (np.pi * 206e9),
            "strip_half_width": 1e-3,
            "relief": 15e-6 / (0.2 * TIP[g]) ** 2,
            "relief_start": 0.8 * TIP[g],
            "tip_edge": edge,
            "corner_radius": np.hypot(BASE[g], inner),
            "corner_angle": TIP[g] / BASE[g] - np.arctan2(inner, BASE[g]),
            "z_mid": 0.0,
            "helix": 0.0,
        }
    )


def _body(g: int, rng: np.random.Generator) -> Body:
    """Invented modes, and static compliances that hold them plus a positive residual."""
    omega = 2 * np.pi * FREQUENCY * (1.0, 0.8)[g]
    rows = 0.6 * rng.standard_normal((2, 1, 1, omega.size)) * np.ones((2, ROLLS, 2, 1)) / np.sqrt(MASS[g])
    rows *= np.linspace(0.7, 1.3, ROLLS)[None, :, None, None] * np.array([1.0, 0.2])[None, None, :, None]
    bore = _bore_rows(0.3 * rng.standard_normal(3) / np.sqrt(MASS[g]), BASE[g])
    angles = 2 * np.pi * np.arange(TEETH[g]) / TEETH[g]
    turned = np.stack([_turn(rows, DIAMETER, MEMBER, angle) for angle in angles])
    static = np.einsum("fiak,ogjbk->fgoijab", rows / omega**2, turned)
    for f in (0, 1):
        static[f, f, 0] += own_residual()
    roll = np.linspace(0.7, 1.3, ROLLS)
    between = 1e-11 * rng.standard_normal((2, 1, 1, 6)) / np.array([1, 1, 1, BASE[g], BASE[g], BASE[g]])
    between = between * roll[None, :, None, None] * np.array([1.0, 0.2])[None, None, :, None]
    flank = {
        "teeth": TEETH[g],
        "diameter": DIAMETER,
        "part": MEMBER,
        "rows": rows,
        "static": static,
        "node": np.einsum("fiak,ck->fiac", rows / omega**2, bore) + between,
    }
    return toothed(
        NAMES[g],
        flank,
        mass_matrix(MASS[g], np.diag([0.6, 0.6, 1.0]) * INERTIA[g]),
        frequency=omega / (2 * np.pi),
        damping_ratio=np.full(omega.size, 0.01),
        rows=bore,
        static=np.einsum("ck,dk->cd", bore / omega**2, bore) + np.diag([3e-10, 3e-10, 3e-10, 3e-8, 3e-8, 3e-8]),
    )


def _bore_rows(size: np.ndarray, r_b: float) -> np.ndarray:
    """(6, n): a mode of nodal diameter 0 turns the bore, a pair of 1 moves and tilts it as a vector in the plane."""
    rows = np.zeros((6, len(FREQUENCY)))
    rows[5, 0] = size[0] / r_b
    rows[[0, 1], [1, 2]] = size[1]
    rows[[3, 4], [1, 2]] = size[2] / r_b
    return rows


def _groups(bodies: list[GroundPart]) -> list[Group]:
    """As supported by the bearings, and with the bores held on their axes."""
    bearings = [
        Support(f"bearing.{name}", (g, 0), None, (0, 1), np.eye(2) / BEARING_K, np.full(2, BEARING_C))
        for g, name in enumerate(NAMES)
    ]
    layout = Layout(bodies, [(0,), (1,)], bearings, planar=True)
    return [mount(layout), mount(replace(layout, supports=[bearing.hold() for bearing in bearings]))]


def _modes(g: int, body: Body, groups: list[Group]) -> dict[str, np.ndarray]:
    degrees, flank = np.array(DEGREES), groups[0].layout.bodies[g].flank
    tables = flank_sections(g, groups, NODES, degrees)
    reads = tables[f"ground_list{g}_0"].size
    size = [g, TEETH[g], flank.chosen.size, reads, 0, *flank_sizes(flank, degrees)]
    of_modes = mode_sections(g, body, flank)
    return tables | of_modes | {f"size{g}": np.array(size, np.int32), f"resample{g}": np.eye(ROLLS)}


def own_residual() -> np.ndarray:
    """(ROLLS, ROLLS, A, A), m/N: what a tooth's flank gives way beyond the modes, by its own load."""
    roll = np.linspace(0.7, 1.3, ROLLS)
    own = np.einsum("ij,ab->ijab", np.outer(roll, roll), np.diag([2e-9, 4e-10]))
    return own + np.einsum("ij,ab->ijab", np.eye(ROLLS), 1e-10 * np.eye(2))


def _turn(rows: np.ndarray, diameter: np.ndarray, part: np.ndarray, angle: float) -> np.ndarray:
    """Rows on the tooth at `angle`: a pair turns as (a cos νθ − b sin νθ, a sin νθ + b cos νθ)."""
    cosine, sine = np.cos(diameter * angle), np.sin(diameter * angle)
    out = rows * cosine
    first = np.flatnonzero(part == 1)
    out[..., first] -= rows[..., first + 1] * sine[first]
    out[..., first + 1] += rows[..., first] * sine[first]
    return out
