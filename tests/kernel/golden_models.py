"""Small models of every kind of stage for the golden digests: the shipped stages with few modes, width functions and
lengths of roll, rounded, and stored, so that a digest depends on the kernel alone.

    PYTHONPATH=. python tests/kernel/golden.py --write-models

makes them anew from the shipped bodies; all digests of these models change with that.
"""

from __future__ import annotations

import copy
import lzma
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body import load_bodies
from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.stage import load_stage

FOLDER = Path(__file__).parents[1] / "reference" / "golden_models"
MODELS = {  # name → stage, modes of a body (a set needs more: distant teeth), width functions, friction possible
    "helical_pair": ("helical_demo", 24, 3, True),
    "train": ("two_stage", 18, 3, False),
    "pin_errors": ("planetary54/stage_pin_error", 36, 1, True),
    "helical_set": ("helical_set", 36, 2, False),
}
ROLLS = 6
NODES = (9, 5)  # of a flank for nodal contact: along, across
FRICTION = ("along_rows", "along_low", "along_normal", "along_own", "along_across")
BITS = 16  # of the mantissa that tables keep
TABLE = 64  # elements: shorter arrays are not rounded


@cache
def golden_model(name: str) -> bytes:
    """Blob of a stored model."""
    return lzma.decompress((FOLDER / f"{name}.gkb.xz").read_bytes())


def make(name: str) -> bytes:
    """Blob of a model, from the shipped bodies."""
    stage, modes, functions, friction = MODELS[name]
    spec = load_stage(stage)
    bodies = [_small(body, modes, functions) for body in load_bodies(spec)]
    sections = dict(read_blob(assemble(spec, bodies, rolls=ROLLS).blob))
    sections |= {k: np.array(NODES, np.int32) for k in sections if k.startswith("nodes")}
    kept = {k: v for k, v in sections.items() if friction or not k.startswith(FRICTION)}
    return write_blob({k: _rounded(v) for k, v in kept.items()})


def _rounded(values: np.ndarray | str) -> np.ndarray | str:
    if isinstance(values, str) or values.dtype.kind != "f" or values.size < TABLE:
        return values
    fraction, exponent = np.frexp(values)
    return np.ldexp(np.round(np.ldexp(fraction, BITS)), exponent - BITS)


def _small(body: Any, modes: int, functions: int) -> Any:
    """The body with its first modes, pairs whole, and its first width functions; static compliance stays whole."""
    if body.flank is None:
        return _with(body, frequency=body.frequency[:modes], damping_ratio=body.damping_ratio[:modes],
                     rows=body.rows[:, :modes])  # fmt: skip
    n = _lowest(body, modes)
    a = functions
    flank = _with(
        body.flank,
        **{name: getattr(body.flank, name)[n] for name in ("diameter", "part", "parity")},
        rows=body.flank.rows[:, :, :a][..., n],
        static=body.flank.static[..., :a, :a],
        node=body.flank.node[:, :, :a],
    )
    small = _with(body, frequency=body.frequency[n], damping_ratio=body.damping_ratio[n], rows=body.rows[:, n],
                  flank=flank, picture=None)  # fmt: skip
    if body.sensors is not None:
        small = _with(small, sensors=_with(body.sensors, rows=body.sensors.rows[:, n]))
    if body.flank.tangent is not None:
        of = body.flank.tangent
        of = _with(of, rows=of.rows[:, :, :a][..., n], static_nt=of.static_nt[..., :a, :a],
                   static_tt=of.static_tt[..., :a, :a])  # fmt: skip
        small = _with(small, flank=_with(flank, tangent=of))
    if body.spin is not None:
        s = body.spin
        s = _with(s, coupling=s.coupling[np.ix_(n, n)], tilt=s.tilt[:, n], load=s.load[n], stiffening=s.stiffening[n],
                  growth=s.growth[:, :, :a])  # fmt: skip
        small = _with(small, spin=s)
    return small


def _lowest(body: Any, modes: int) -> np.ndarray:
    """Numbers of the lowest modes of nodal diameter 0, 1 and above, a third of `modes` each, pairs whole."""
    diameter = np.minimum(body.flank.diameter, 2)
    kept = np.concatenate([np.flatnonzero(diameter == d)[: modes // 3] for d in range(3)])
    second = kept[body.flank.part[kept] == 1] + 1
    return np.union1d(kept, second)


def _with(frozen: Any, **fields: Any) -> Any:
    """A copy with other fields, not checked: what evidence says of the whole body does not hold for it."""
    other = copy.copy(frozen)
    for name, value in fields.items():
        object.__setattr__(other, name, value)
    return other


def write_models() -> None:
    """Make and store all models, and print their sizes."""
    FOLDER.mkdir(exist_ok=True)
    for name in MODELS:
        blob = make(name)
        packed = lzma.compress(blob, preset=9 | lzma.PRESET_EXTREME)
        (FOLDER / f"{name}.gkb.xz").write_bytes(packed)
        print(f"{name}: {len(blob) / 1e6:.2f} MB, stored {len(packed) / 1e6:.2f} MB")
