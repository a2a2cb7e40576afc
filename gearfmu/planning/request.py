"""Request to a plan: outputs of a scene, a band, and how wrong they may be there."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gearfmu.errors import GearfmuError, Problem, SpecError, near_or_all
from gearfmu.quantities import to_si
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel
from gearfmu.stage.run.te import set_error

WHERE = "plan"
HIGHEST = 0.45  # of the sampling rate: higher frequencies are folded and filtered
MEANS = ("fx", "fy", "fz", "mx", "my", "force")  # outputs that have a mean over the communication step beside them
_SHARE = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*(\S*)\s*$")


@dataclass(frozen=True)
class Output:
    """A signal that is judged: sum of factors times channels, `averaged` where these are means over the communication
    step. The transmission error of a planetary set is made of two angles, all else is one channel."""

    name: str
    channels: tuple[tuple[str, float], ...]
    averaged: bool = False


@dataclass(frozen=True)
class Request:
    """outputs; band (low, high), Hz; level: largest error of the level of every output in the band, dB; waveform:
    largest error of the waveform there, relative to its rms. One of the two is given."""

    outputs: tuple[Output, ...]
    band: tuple[float, float]
    level: float | None = None
    waveform: float | None = None

    @property
    def channels(self) -> list[str]:
        """Names of all channels that are needed."""
        return list(dict.fromkeys(name for output in self.outputs for name, _ in output.channels))

    @property
    def plain(self) -> dict[str, Any]:
        """For plan.toml: text with units."""
        found: dict[str, Any] = {"outputs": [o.name for o in self.outputs], "band": [f"{f:g} Hz" for f in self.band]}
        found |= {} if self.level is None else {"budget": f"{self.level:g} dB"}
        return found | ({} if self.waveform is None else {"waveform": f"{100 * self.waveform:g} %"})


def request(
    scene: SceneSpec,
    model: StageModel,
    outputs: Sequence[str],
    band: Sequence[str | float],
    budget: str | None = None,
    waveform: str | None = None,
) -> Request:
    """The Request in checked terms. outputs: `te`, or names of outputs of the stage (`bearing.pinion.fx`,
    `bearing.pinion` for all its directions); band: two frequencies; budget "1 dB"; waveform "5 %".

    SpecError with everything that is wrong: unknown names, a band beyond what the communication step samples, budgets
    of another unit.
    """
    problems: list[Problem] = []
    found = tuple(dict.fromkeys(_outputs(model, outputs, problems)))
    edges = _band(scene, band, problems)
    level = _share(budget, "dB", "--budget", "1 dB", problems)
    share = _share(waveform, "%", "--waveform", "5 %", problems)
    if budget is None and waveform is None:
        problems.append(Problem(WHERE, "--budget", "", 'nothing says how wrong the outputs may be: write "1 dB"'))
    if problems:
        raise SpecError(problems)
    return Request(found, edges, level, None if share is None else share / 100)


def _outputs(model: StageModel, names: Sequence[str], problems: list[Problem]) -> Iterator[Output]:
    known = {v.name for v in model.kernel_variables() if v.causality == "output" and v.type == "Real"}
    if not names:
        problems.append(Problem(WHERE, "--output", "", "nothing is to be judged: name outputs, such as te"))
    for name in names:
        own = list(_named(model, name, known))
        if not own:
            remedy = f"the stage has no such output; {near_or_all(name, _judged(known), 'it has', mark='')}"
            problems.append(Problem(WHERE, "--output", name, remedy))
        yield from own


def _judged(known: set[str]) -> list[str]:
    """Outputs that are judged most: transmission errors and forces of meshes, supports with all their directions."""
    supports = {".".join(name.split(".")[:2]) for name in known if name.startswith(("bearing.", "pin.", "seat."))}
    return ["te", *sorted(n for n in known if n.endswith((".te", ".force"))), *sorted(supports)]


def _named(model: StageModel, name: str, known: set[str]) -> Iterator[Output]:
    if name == "te" and model.stage.carriers:
        r_b, ratio = set_error(model.stage)
        yield Output("te", (("sun.gear.phi", r_b), ("carrier.gear.phi", -r_b * ratio)))
    elif name == "te":
        for mesh in model.stage.engagements:
            yield Output(f"{mesh.name}.te", ((f"{mesh.name}.te", 1.0),))
    elif name in known:
        mean = f"{name}_mean"
        averaged = mean in known and name.rpartition(".")[2] in MEANS
        yield Output(name, ((mean if averaged else name, 1.0),), averaged)
    else:
        for full in sorted(n for n in known if n.startswith(f"{name}.") and n.rpartition(".")[2] in MEANS):
            yield from _named(model, full, known)


def _band(scene: SceneSpec, band: Sequence[str | float], problems: list[Problem]) -> tuple[float, float]:
    edges = [_frequency(value, problems) for value in band]
    if len(edges) != 2:
        remedy = "overall levels hide audible bands behind the slow cycle of the torque: name a band, 200 Hz and 5 kHz"
        problems.append(Problem(WHERE, "--band", "", remedy))
        return 0.0, 0.0
    low, high = (float("nan") if f is None else f for f in edges)
    most = HIGHEST / scene.coupling.step
    if not 0 < low < high and None not in edges:
        problems.append(Problem(WHERE, "--band", f"{low:g} … {high:g} Hz", "needs 0 < low < high"))
    if high > most:
        remedy = (
            f"samples {1e6 * scene.coupling.step:g} µs apart show up to {most:.4g} Hz: choose a lower band, or a "
            f'shorter communication step, --step "{1e6 * HIGHEST / high:.3g} us"'
        )
        problems.append(Problem(WHERE, "--band", f"{high:g} Hz", remedy))
    return low, high


def _frequency(value: str | float, problems: list[Problem]) -> float | None:
    if not isinstance(value, str):
        return float(value)
    try:
        return to_si(value, "Hz")
    except GearfmuError as error:
        problems.append(Problem(WHERE, "--band", value, str(error)))
        return None


def _share(text: str | None, unit: str, field: str, example: str, problems: list[Problem]) -> float | None:
    """The number before `unit`."""
    if text is None:
        return None
    match = _SHARE.match(text)
    if match and match[2] == unit and float(match[1]) > 0:
        return float(match[1])
    other = {"dB": "the waveform's is --waveform", "%": "that of levels is --budget"}[unit]
    problems.append(Problem(WHERE, field, text, f'a positive number of {unit}, such as "{example}"; {other}'))
    return None


def request_of(scene: SceneSpec, model: StageModel, plain: Mapping[str, Any]) -> Request:
    """The inverse of `Request.plain`."""
    return request(scene, model, plain["outputs"], plain["band"], plain.get("budget"), plain.get("waveform"))
