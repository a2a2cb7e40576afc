"""Golden runs: a refactoring of the kernel must not change one bit of them, and where a change is meant, eight numbers
beside each hash show how far it went.

Every integrator, kind of stage, effect and calculation once (golden_stages.py), in single and double build:

    PYTHONPATH=. python tests/kernel/golden.py            what moved, by how much
    PYTHONPATH=. python tests/kernel/golden.py --write    stores what this kernel gives, in a commit that says why

Small models of every kind of stage are the shipped ones with few modes, width functions and lengths of roll, rounded,
and stored, so that a digest depends on the kernel alone. --write-models makes them anew from the shipped bodies; all
digests of these models change with that.
"""

from __future__ import annotations

import argparse
import copy
import json
import lzma
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from golden_stages import MODELS, cases
from probes import build

from gearfmu.body import load_bodies
from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.stage import load_stage

FILE = Path(__file__).parents[1] / "reference" / "golden_runs.json"
REALS = ("float", "double")
MADE_OF = {  # name → stage, modes of a body (a set needs more: distant teeth), width functions, friction possible
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

Results = dict[str, dict[str, Any]]  # run → "bits" and its numbers


def results(library: Path | None = None, part: str = "") -> Results:
    """Of the runs with this build of the kernel; part: of their names."""
    return {name: answer(library).result for name, answer in cases() if part in name}


def stored(real: str = "float", part: str = "") -> Results:
    """What the file says of a build ("float", "double")."""
    known = json.loads(FILE.read_text(encoding="utf-8"))[real]
    return {name: run for name, run in known.items() if part in name}


def moved(known: Results, found: Results) -> list[str]:
    """A line for every run with other bits: the numbers that differ in six digits, before and after."""
    lines = []
    for name in sorted(known.keys() | found.keys()):
        old, new = known.get(name, {}), found.get(name, {})
        if old != new:
            numbers = [key for key in old.keys() | new.keys() if key != "bits" and old.get(key) != new.get(key)]
            said = [f"{key} {old.get(key, '-')} → {new.get(key, '-')}" for key in sorted(numbers)]
            lines.append(f"{name}: {', '.join(said) or 'beyond six digits'}")
    return lines


# ---- stored models ---------------------------------------------------------------------------------------------------
def make(name: str) -> bytes:
    """Blob of a model, from the shipped bodies."""
    stage, modes, functions, friction = MADE_OF[name]
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
    MODELS.mkdir(exist_ok=True)
    for name in MADE_OF:
        blob = make(name)
        packed = lzma.compress(blob, preset=9 | lzma.PRESET_EXTREME)
        (MODELS / f"{name}.gkb.xz").write_bytes(packed)
        print(f"{name}: {len(blob) / 1e6:.2f} MB, stored {len(packed) / 1e6:.2f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description="Golden runs of the kernel.")
    parser.add_argument("--write", action="store_true", help="store what this kernel gives")
    parser.add_argument("--library", type=Path, help="compare this build of the kernel")
    parser.add_argument("--only", default="", help="a part of the names of runs to compare")
    parser.add_argument("--real", choices=REALS, default="float", help="its type of modal rows and states")
    parser.add_argument("--write-models", action="store_true", help="make and store the small models, nothing else")
    chosen = parser.parse_args()
    if chosen.write_models:
        return write_models()
    found = {}
    for real in [chosen.real] if chosen.library else REALS:
        with tempfile.TemporaryDirectory() as folder:
            found[real] = results(chosen.library or build(Path(folder), real=real), chosen.only)
    if chosen.write and not chosen.library and not chosen.only:
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return
    other = [f"{real} {line}" for real in found for line in moved(stored(real, chosen.only), found[real])]
    print(f"{sum(map(len, found.values()))} runs, {len(other)} moved", *other, sep="\n  ")
    sys.exit(min(len(other), 99))


if __name__ == "__main__":
    main()
