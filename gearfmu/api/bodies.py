"""A body of a stage and its reduction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

from typing_extensions import Unpack

from gearfmu.api.models import PathLike, loaded_stage
from gearfmu.api.settings import Quantity, checked
from gearfmu.body.whole import housing_order
from gearfmu.errors import Problem, SpecError
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import BAND, Size
from gearfmu.reduction.toothed import toothed_full_order
from gearfmu.reduction.transfer import LINES, Judgement, judged
from gearfmu.reduction.transfer import Judging as Lines
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.tables.housing import HousingBody

PAPER = ("modal", "craig_bampton", "rubin", "krylov")  # the methods of the paper
SIZE, DAMPING = 120, 0.01


class Judging(TypedDict, total=False):
    """size : vectors n of a method, rigid modes aside; 120. band : from, to, Hz; lines : over it, spaced
    logarithmically; 50 Hz to 10 kHz, 400. damping : ratio of both models; 0.01. free : the free body is reduced, as the
    kernel takes it, else with its ground held. scale : factor on the element counts of the stage."""

    size: int
    band: tuple[Quantity, Quantity]
    damping: float
    lines: int
    free: bool
    scale: float | None


def frf(stage: PathLike | Stage, body: str, methods: Sequence[str] = PAPER, **how: Unpack[Judging]) -> Judgement:
    """Relative error of the transfer matrix of a body (Frobenius norm, the paper's eq. 3), reduced by several methods
    and judged with its ground held.

    stage : path, name or numbers, as of `load`. body : name of a gear, ring or carrier of it.
    methods : those of a carrier's stage file; "krylov:240" has a size of its own.
    how : size, band, damping, lines, free and scale (`Judging`).

    gf.frf("planetary54", "carrier", ["rubin", "krylov:240"]).trials[0].error is (F,) over `.frequency`, Hz.

    Raises SpecError for a body, a method or a scale that cannot be; BodyError for a size that is none.
    """
    low, high = (checked("band", edge, "frequency") for edge in how.get("band", BAND))
    entries = [_entry(text, how.get("size", SIZE), (low, high)) for text in methods]
    spec = loaded_stage(stage)
    full = _full_order(spec, body, how.get("scale"))
    lines = Lines.over((low, high), how.get("lines", LINES), how.get("damping", DAMPING))
    return judged(full if how.get("free") else full.grounded(), entries, lines)


def _entry(text: str, size: int, band: tuple[float, float]) -> tuple[str, Size]:
    name, _, own = text.strip().partition(":")
    if name not in METHODS or (own and not own.isdigit()):
        remedy = f"is no method; there are {', '.join(METHODS)}, each with ':n' behind it for a size"
        raise SpecError([Problem("", "methods", name, remedy)])
    return name, Size(int(own or size), band)


def _full_order(spec: Stage, body: str, scale: float | None) -> FullOrder:
    """The finite elements of a body, gear, ring or carrier."""
    if (table := spec.by_file.get(body)) is None:
        remedy = f"no body '{body}'; the stage has {', '.join(spec.files)}"
        raise SpecError([Problem(str(spec.source), "body", body, remedy)])
    mine = isinstance(table, HousingBody) or table.imported is not None
    if mine and scale is not None:
        remedy = f"the finite elements of '{body}' are yours: coarsen your mesh, or leave the scale away"
        raise SpecError([Problem(str(spec.source), "scale", f"{scale:g}", remedy)])
    if isinstance(table, HousingBody):
        return housing_order(table).full
    if isinstance(table, CarrierBody):
        return carrier_full_order(table, 1.0 if scale is None else scale)
    return toothed_full_order(table, spec.mounts, scale)
