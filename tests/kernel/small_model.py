"""Small model blobs made without finite elements: a spur pair of FZG C size with a few invented modes,
and two coaxial bars.

Shapes and meaning of the sections are those of gearfmu/stage (model.py, tables.py) and gearfmu/kernel/src/model/gk_model.c.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from exact_bars import Bar

from gearfmu.stage.blob import write_blob

PAIR, FLAT = 0, 1
OFFSETS = np.arange(-3, 4)
DISTANCE, TEETH, SHIFT, MASS, INERTIA = 91.5e-3, (16, 24), (0.1817, 0.1715), (0.35, 0.95), (2.2e-4, 1.5e-3)
ALPHA = np.radians(20)
BASE = tuple(0.5 * 4.5e-3 * z * np.cos(ALPHA) for z in TEETH)
PSI = tuple((np.pi / 2 + 2 * x * np.tan(ALPHA)) / z + np.tan(ALPHA) - ALPHA for z, x in zip(TEETH, SHIFT, strict=True))
WORKING = np.arccos(sum(BASE) / DISTANCE)
LENGTH = DISTANCE * np.sin(WORKING)
PHASE = (0.0, np.pi - WORKING - PSI[1] + (LENGTH - BASE[0] * (PSI[0] + WORKING)) / BASE[1])  # drive flanks just touch
FORM, TIP = (3.0e-3, 9.0e-3), (23.3e-3, 30.2e-3)
ROLLS, DEGREES = 6, (0, 2)
SPRING, TORQUE, FIXED = 0.0, 1.0, 2.0
PORTS = {"spring": (SPRING, 0.0), "torque": (TORQUE, 0.0), "fixed": (FIXED, 0.0), "chain": (SPRING, 1.0)}


def pair_blob(ports: tuple[str, str] = ("chain", "spring"), seed: int = 0) -> bytes:
    """A spur pair of 16/24 teeth with 5 modes (two of them pairs) a gear, 3 slices, ports of the kinds named."""
    rng = np.random.default_rng(seed)
    sections: dict = {
        "model": np.array([1, PAIR, 3, _coast_shift()], np.int32),
        "name": "small_pair",
        "shafts": "pinion|wheel",
        "degrees": np.array(DEGREES, np.int32),
        "pair": np.array([DISTANCE, 1e-4, 2e4, 600.0, 628.0, 20e3, 60e3, 7.5e-6, 0.0]),
    }
    for g, port in enumerate(ports):
        sections[f"gear{g}"] = _gear(g)
        sections[f"port{g}"] = np.array([*PORTS[port], 2e4, 5.0, 0.05, 2e-3, 8e3, 0.5])
        sections |= _tables(g, rng)
    return write_blob(sections)


def bars_blob(bars: tuple[Bar, Bar], modes: tuple[int, int], gap: float, local: float = 1e-20) -> bytes:
    """Two coaxial bars `gap` apart, with the residual of the modes left out; `local`: 2 (1 − ν²)/(πE) of the contact
    strip of 1 m, 1/Pa (as good as rigid when left out)."""
    bodies = tuple(
        FlatBody(b.mass, b.frequencies(n), np.zeros(n), b.end_row(n)[None, 1:], np.array([[b.static_compliance()]]))
        for b, n in zip(bars, modes, strict=True)
    )
    return flat_blob(bodies, Block(gap=gap, local=local))


@dataclass(frozen=True)
class FlatBody:
    """mass kg · omega rad/s, zeta (n,) · rows (A, n): outward displacement of width function a per mode · static (A,
    A) m/N."""

    mass: float
    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    static: np.ndarray


@dataclass(frozen=True)
class Block:
    """Flat engagement 1 m wide: slices, degrees of the width functions, gap m, local 1/Pa,
    damping N·s/m per m of width."""

    slices: int = 1
    degrees: tuple[int, ...] = (0,)
    gap: float = 1e-9
    local: float = 1e-20
    damping: float = 0.0


def flat_blob(bodies: tuple[FlatBody, FlatBody], block: Block) -> bytes:
    """Two bodies that meet in a flat contact: gap = x_B − x_A − outward displacements, in every slice."""
    functions = len(block.degrees)
    sections: dict = {
        "model": np.array([1, FLAT, block.slices, 0], np.int32),
        "name": "bars",
        "shafts": "left|right",
        "degrees": np.array(block.degrees, np.int32),
        "pair": np.array([block.gap, 0.0, block.damping, 1.0, 1.0, 1e9, 1e9, 1e-3, 0.0]),
    }
    for g, body in enumerate(bodies):
        n = body.omega.size
        static = np.zeros((2, 2, 7, 4, 4, functions, functions))
        static[0, 0, 3] = body.static
        numbers = [1, 0.01, 0, 0.01, 0, 0, body.mass, body.mass, 1.0, block.local, 1e-3, 0, 0.01, 1e-4, 0.01, 0, 1e8, 0]
        sections |= {
            f"gear{g}": np.array(numbers, float),
            f"port{g}": np.array([TORQUE, 0, 1, 0, 1, 1, 1, 0], float),
            f"size{g}": np.array([n, 4, functions], np.int32),
            f"omega{g}": body.omega,
            f"zeta{g}": body.zeta,
            f"diameter{g}": np.zeros(n, np.int32),
            f"part{g}": np.zeros(n, np.int32),
            f"rows{g}": np.broadcast_to(body.rows, (2, 4, functions, n)),
            f"bore{g}": np.zeros((3, n)),
            f"c_ff{g}": static,
            f"c_fb{g}": np.zeros((2, 4, functions, 3)),
            f"c_bb{g}": np.zeros((3, 3)),
        }
    return write_blob(sections)


def _coast_shift() -> int:
    """The wheel's tooth whose coast flank is nearest to that of the pinion's tooth 0."""

    def gap(shift: int) -> float:
        turned = PHASE[1] + shift * 2 * np.pi / TEETH[1] - np.pi
        return abs(LENGTH - BASE[0] * (PSI[0] + WORKING) - BASE[1] * (PSI[1] + WORKING - turned))

    return min((-1, 0, 1), key=gap)


def _gear(g: int) -> np.ndarray:
    edge, inner = 2e-4, TIP[g] - 2e-4
    local = 2 * (1 - 0.3**2) / (np.pi * 206e9)
    return np.array(
        [
            TEETH[g],
            BASE[g],
            FORM[g],
            TIP[g],
            PSI[g],
            PHASE[g],
            MASS[g],
            INERTIA[g],
            14e-3,
            local,
            1e-3,
            15e-6 / (0.2 * TIP[g]) ** 2,
            0.8 * TIP[g],
            edge,
            np.hypot(BASE[g], inner),
            TIP[g] / BASE[g] - np.arctan2(inner, BASE[g]),
            3e8,
            600.0,
        ]
    )


def _tables(g: int, rng: np.random.Generator) -> dict:
    """Modes and a static compliance that holds them plus a positive residual."""
    omega = 2 * np.pi * np.array([9e3, 14e3, 14e3, 38e3, 38e3]) * (1.0, 0.8)[g]
    diameter, part = np.array([0, 2, 2, 3, 3], np.int32), np.array([0, 1, 2, 1, 2], np.int32)
    rows = 0.6 * rng.standard_normal((2, 1, 1, 5)) * np.ones((2, ROLLS, 2, 1)) / np.sqrt(MASS[g])
    rows *= np.linspace(0.7, 1.3, ROLLS)[None, :, None, None] * np.array([1.0, 0.2])[None, None, :, None]
    bore = 0.3 * rng.standard_normal((3, 5)) / np.sqrt(MASS[g])
    bore[2] /= BASE[g]
    turned = np.stack([_turn(rows, diameter, part, 2 * np.pi * o / TEETH[g]) for o in OFFSETS])
    static = np.einsum("fiak,ogjbk->fgoijab", rows / omega**2, turned)
    roll = np.linspace(0.7, 1.3, ROLLS)
    own = np.einsum("ij,ab->ijab", np.outer(roll, roll), np.diag([2e-9, 4e-10]))
    own += np.einsum("ij,ab->ijab", np.eye(ROLLS), 1e-10 * np.eye(2))
    for f in (0, 1):
        static[f, f, 3] += own
    return {
        f"size{g}": np.array([5, ROLLS, 2], np.int32),
        f"omega{g}": omega,
        f"zeta{g}": np.full(5, 0.01),
        f"diameter{g}": diameter,
        f"part{g}": part,
        f"rows{g}": rows,
        f"bore{g}": bore,
        f"c_ff{g}": static,
        f"c_fb{g}": np.einsum("fiak,ck->fiac", rows / omega**2, bore),
        f"c_bb{g}": np.einsum("ck,dk->cd", bore / omega**2, bore) + np.diag([3e-10, 3e-10, 3e-8]),
    }


def _turn(rows: np.ndarray, diameter: np.ndarray, part: np.ndarray, angle: float) -> np.ndarray:
    """Rows on the tooth at `angle`: a pair turns as (a cos νθ − b sin νθ, a sin νθ + b cos νθ)."""
    cosine, sine = np.cos(diameter * angle), np.sin(diameter * angle)
    out = rows * cosine
    first = np.flatnonzero(part == 1)
    out[..., first] -= rows[..., first + 1] * sine[first]
    out[..., first + 1] += rows[..., first] * sine[first]
    return out
