"""One static contact solution: which gears, how meshed, how held; from the numbers of a stage to secant stiffness."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evidence.peers.calculix.ccx import run_deck, torques
from evidence.peers.calculix.deck import Placed, Problem, write_deck
from evidence.peers.calculix.section import Fineness, gear_plane, tip_edge_centre
from evidence.peers.calculix.solid import extruded
from gearfmu.geometry import PairGeometry


@dataclass(frozen=True)
class Case:
    """Half the width, with symmetry at mid width and a free end face. bores: "clamped" or "averaged"."""

    name: str
    bores: str = "clamped"
    fine: Fineness = field(default_factory=Fineness)
    penalty: float = 3e16
    element: str = "C3D20R"
    increments: int = 1


@dataclass(frozen=True)
class Load:
    """A position of the pair and what is done there. turn: pinion's angle (rad) from where tooth 0 lies on +x; te: (m)
    displacement of the pinion along the line of action, r_b1·angle; margin: (m) how far beyond the ends of the path of
    contact teeth may touch with their tip edges."""

    turn: float
    te: float
    margin: float = 0.0


@dataclass(frozen=True)
class Solution:
    """line_load: (loads, 2) N/m, torque over base radius and width of pinion and wheel (equal for contact on the line
    of action). te: (loads,) m. nodes, elements: counts. seconds: wall time of ccx."""

    te: np.ndarray
    line_load: np.ndarray
    nodes: int
    elements: int
    seconds: float


def touching(pair: PairGeometry, turn: float, margin: float) -> dict[tuple[int, int], tuple[float, float]]:
    """Rolls (m) on pinion and wheel where teeth touch, by (pinion tooth, wheel tooth), of the pairs whose contact
    point lies on the path of contact or `margin` (m) beyond its ends, where a tip edge touches off the line of action.
    """
    first = pair.gears[0].r_b * (turn + pair.gears[0].psi_b + pair.alpha_wt)
    low, high = pair.path["A"] - margin, pair.path["E"] + margin
    count = range(math.ceil((low - first) / pair.base_pitch), math.floor((high - first) / pair.base_pitch) + 1)
    result = {}
    for k in count:
        rolls = [first + k * pair.base_pitch, pair.length - first - k * pair.base_pitch]
        for tip in (0, 1):
            if rolls[tip] > pair.gears[tip].s_tip:
                rolls = _at_tip_edge(pair, tip, rolls[tip])
        result[k, -k] = (rolls[0], rolls[1])
    return result


def _at_tip_edge(pair: PairGeometry, tip: int, roll: float) -> list[float]:
    """Rolls where the edge of gear `tip` is nearest to the other's flank when its involute would touch at `roll`
    (docs/theory.md eq. 6)."""
    gear, other = pair.gears[tip], pair.gears[1 - tip]
    along = roll / gear.r_b - gear.psi_b - pair.alpha_wt  # the tooth's angle from the line of centres
    centre = tip_edge_centre(gear) @ np.array([[math.cos(along), math.sin(along)], [-math.sin(along), math.cos(along)]])
    distance = centre - [pair.a, 0.0]
    touched = math.sqrt(distance @ distance - other.r_b**2) - gear.tip_edge
    return [gear.s_tip, touched] if tip == 0 else [touched, gear.s_tip]


def problem_of(case: Case, pair: PairGeometry, face_width: float, load: Load) -> Problem:
    """The contact problem of a case; every pair of teeth near the path of contact may touch."""
    gears = pair.gears
    pairs = touching(pair, load.turn, load.margin)
    contacts = [{teeth[k]: rolls[k] for teeth, rolls in pairs.items()} for k in (0, 1)]
    sections = [
        gear_plane(gear, rolls, range(-(gear.z // 2), gear.z - gear.z // 2), case.fine)
        for gear, rolls in zip(gears, contacts, strict=True)
    ]
    solids = [extruded(section, np.array([0.0, 0.5 * face_width])) for section in sections]
    phase = pair.wheel_phase - load.turn * gears[0].r_b / gears[1].r_b
    return Problem(
        gears=(
            Placed("P", solids[0], np.zeros(2), load.turn, case.bores, load.te / gears[0].r_b),
            Placed("W", solids[1], np.array([pair.a, 0.0]), phase, case.bores, 0.0),
        ),
        pairs=list(pairs),
        penalty=case.penalty,
        element=case.element,
        increments=case.increments,
    )


def prepared(
    case: Case, pair: PairGeometry, face_width: float, load: Load, folder: Path, number: int = 0
) -> tuple[Path, Problem]:
    """The deck of a load, written into the folder, and its problem."""
    folder.mkdir(parents=True, exist_ok=True)
    problem, deck = problem_of(case, pair, face_width, load), folder / f"load_{number}.inp"
    write_deck(problem, deck)
    return deck, problem


def digest(deck: Path) -> str:
    """First half of the deck's SHA-256: what was solved with the same deck need not be solved again."""
    return hashlib.sha256(deck.read_bytes()).hexdigest()[:32]


def solve(case: Case, pair: PairGeometry, face_width: float, loads: Sequence[Load], folder: Path) -> Solution:
    """Write a deck a load, run ccx, read the bores' torques. RuntimeError when ccx gives up."""
    base, half = np.array([gear.r_b for gear in pair.gears]), 0.5 * face_width
    line_load, seconds = [], 0.0
    for number, load in enumerate(loads):
        deck, problem = prepared(case, pair, face_width, load, folder, number)
        seconds += run_deck(deck)
        line_load.append(torques(problem, deck.with_suffix(".dat")) / base / half)
    return Solution(
        te=np.array([load.te for load in loads]),
        line_load=np.array(line_load),
        nodes=sum(len(gear.solid.nodes) for gear in problem.gears),
        elements=sum(len(gear.solid.elements) for gear in problem.gears),
        seconds=seconds,
    )
