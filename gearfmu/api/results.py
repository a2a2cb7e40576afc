"""Results for others: the FMU, the report, traces in other formats."""

from __future__ import annotations

import tempfile
import warnings
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from typing_extensions import Unpack

from gearfmu import fmu
from gearfmu.api.models import AnyStage, PathLike, loaded_stage, model_of
from gearfmu.api.settings import Quantity, Starts, checked
from gearfmu.body import Body, load_bodies
from gearfmu.errors import GearfmuError, Problem, SpecError
from gearfmu.fmu.opened import read_fmu
from gearfmu.fmu.package import Extras
from gearfmu.report.html import write
from gearfmu.report.run import Run
from gearfmu.stage import StageModel, Trace
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.exchange import convert as convert_trace
from gearfmu.stage.run.simulate import wound_starts, write_starts
from gearfmu.stage.run.steady import parameters
from gearfmu.stagefile.forms.general import Stage


def export(
    stage: AnyStage,
    path: PathLike | None = None,
    runtime: str = "native",
    platforms: Sequence[str] | None = None,
    extras: Extras | None = None,
    **starts: Unpack[Starts],
) -> Path:
    """Export a stage as an FMI 2.0 co-simulation FMU; returns its path.

    stage : a name or path, a `load`ed stage, or an `assemble`d model (for other kinds of port and observed gears).
    path : <stage>.fmu in the working folder when None.
    runtime : "native", which needs nothing where it is imported, or "python" for hosts that are Python.
    platforms : "host", "linux64", "win64", "darwin64"; all whose kernel is installed when None. The wheel has Linux's
        and Windows'; a checkout makes others with gearfmu[cross].
    extras : {"author": …, "copyright": …, "license": …} of the model; {"sources": True}: with the C sources;
        {"terminals": True}: with terminalsAndIcons.xml, which some importers refuse (docs/howto-fmu.md).
    starts : start values of parameters (docs/variables.md): level="fast", slices=10. torque and speed, of the input:
        <path>_windup.csv beside the FMU lists the inputs with which it starts under that torque.

    Raises FmuError and BuildError.
    """
    model, wound = with_windup(model_of(stage), starts.pop("torque", None), starts.pop("speed", None))
    model = model.with_starts(parameters(model, starts))
    target = Path(f"{model.name}.fmu") if path is None else Path(path)
    written = fmu.export(model, target, runtime, platforms, **(extras or {}))
    if wound:
        write_starts(windup_file(target), model, wound)
    return written


def with_windup(
    model: StageModel, torque: Quantity | None, speed: Quantity | None
) -> tuple[StageModel, dict[str, float]]:
    """The model with its initial speeds, and the inputs with which it starts under torque and speed of its input.
    Without a torque the model as it is. SpecError for a speed without a torque."""
    if torque is None:
        if speed is not None:
            raise SpecError([Problem("", "speed", str(speed), "give the torque of the start too")])
        return model, {}
    values = wound_starts(model, checked("torque", torque, "torque"), checked("speed", speed or 0.0, "speed"))
    known = model.kernel().variables
    own = {name: value for name, value in values.items() if known[name].causality == "parameter"}
    return model.with_starts(own), {name: value for name, value in values.items() if name not in own}


def windup_file(path: Path) -> Path:
    """Beside an FMU the table of inputs with which it starts under torque."""
    return path.with_name(f"{path.stem}_windup.csv")


def write_report(
    trace: Trace | PathLike,
    out: PathLike,
    stage: PathLike | Stage | None = None,
    home: PathLike | None = None,
    tell: Callable[[str], None] = warnings.warn,
) -> Path:
    """Write report.html of a trace into the folder `out`; returns its path.

    trace : a Trace, or the file of one.
    stage : of the run, for the deformed gears; the one that the trace names when None.
    home : folder of the run's other files (deformation.h5); `out` when None.
    tell : is called with a sentence where stage or bodies cannot be read and the report goes without them.
    """
    trace = trace if isinstance(trace, Trace) else Trace.load(trace)
    if not (stage or stage_of(trace.meta)):
        return write(trace, trace.meta, Path(out))
    try:
        spec, bodies = stage_and_bodies(trace.meta, stage)
        deformation = recorded_deformation(trace, Path(home or out))
        return write(trace, trace.meta, Path(out), spec, bodies, deformation)
    except GearfmuError as error:
        tell(f"the report goes without the deformed gears: {error}")
        return write(trace, trace.meta, Path(out))


@dataclass(frozen=True)
class Page:
    """A report that was written, at `path`."""

    path: Path

    def open(self) -> None:
        """Open it in the browser."""
        webbrowser.open(self.path.resolve().as_uri())

    def _repr_html_(self) -> str:
        """The whole page inside a notebook, which need not reach the file."""
        text = escape(self.path.read_text(encoding="utf-8"), quote=True)
        return f'<iframe srcdoc="{text}" style="width:100%;height:80vh;border:0"></iframe>'


def shown(trace: Trace, folder: PathLike | None = None) -> Page:
    """The report of a trace as a notebook shows it; `Trace.show`."""
    return Page(write_report(trace, folder if folder is not None else tempfile.mkdtemp(prefix="gearfmu-")))


def compare(traces: Mapping[str, Trace | PathLike] | Sequence[Trace | PathLike], path: PathLike) -> Path:
    """Write one page that compares two or more traces with the first of them: results, transmission error, spectra,
    octave bands, mesh orders; returns its path.

    traces : Trace objects, files of traces or folders that hold trace.h5; by the name each is to have on the page, else
        by that of its stage, scene or folder.

    Raises GearfmuError for fewer than two.
    """
    from gearfmu.report.compare import write_comparison

    named = list(traces.items()) if isinstance(traces, Mapping) else [("", trace) for trace in traces]
    if len(named) < 2:
        raise GearfmuError("a comparison needs two traces or more")
    runs = [_run(trace) for _, trace in named]
    given = [name for name, _ in named]
    labels = given if all(given) else _labels(runs, [trace for _, trace in named])
    return write_comparison(dict(zip(labels, runs, strict=True)), Path(path))


def _run(source: Trace | PathLike) -> Run:
    """A trace with its stage and bodies where they can be read."""
    trace = loaded_trace(source)
    try:
        return Run(trace, trace.meta, *stage_and_bodies(trace.meta))
    except GearfmuError:
        return Run(trace, trace.meta)


def loaded_trace(source: Trace | PathLike) -> Trace:
    """The Trace, or the one in a file or folder."""
    return source if isinstance(source, Trace) else Trace.load(trace_file(source))


def trace_file(path: PathLike) -> Path:
    """The file of a trace, or trace.h5 in a folder."""
    return Path(path) / "trace.h5" if Path(path).is_dir() else Path(path)


def _labels(runs: Sequence[Run], sources: Sequence[Trace | PathLike]) -> list[str]:
    """Names that distinguish the runs: stage, else scene, else folder or file, else a number."""
    files = [str(n + 1) if isinstance(s, Trace) else _short(s) for n, s in enumerate(sources)]
    choices = ([run.stage_name for run in runs], [run.title for run in runs], files)
    return next((found for found in choices if len(set(found)) == len(found)), [str(n + 1) for n in range(len(runs))])


def _short(path: PathLike) -> str:
    file = trace_file(path)
    return file.parent.name if file.name == "trace.h5" else file.stem


def stage_of(meta: Mapping[str, Any]) -> str | None:
    """STAGE of a run by its trace's meta: its file where that is still there, else its name; None where neither is
    told."""
    path = meta.get("stage_path")
    return path if path and Path(path).is_file() else meta.get("stage")


def stage_and_bodies(meta: Mapping[str, Any], stage: PathLike | Stage | None = None) -> tuple[Stage, Sequence[Body]]:
    """The stage of a run and its reduced bodies. meta : of the run's trace or deformation. stage : of the run where it
    is known; else that of the FMU that was run, with the bodies beside the stage file that `stage_of` names.
    GearfmuError where there is none such, or where the FMU is another by now."""
    named = stage or stage_of(meta) or ""
    own = loaded_stage(named)
    path = meta.get("fmu_path")
    if stage or not path:
        return own, load_bodies(own)
    opened = read_fmu(path)
    if opened.model.hash != (meta.get("model") or meta["hashes"]["model"]):
        raise GearfmuError(f"{path} was exported again since the run: run again, or name the stage")
    return opened.with_bodies(own)


def recorded_deformation(trace: Trace, home: Path) -> Deformation | None:
    """The Deformation of the run of `trace` in the folder `home`; None where the run recorded none."""
    name = trace.meta.get("deformation")
    return Deformation.load(home / name) if name else None


def convert(trace: Trace | PathLike, path: PathLike, channels: Sequence[str] | None = None) -> Path:
    """Write a trace, or the trace in a file, in the format of the suffix of `path`; returns the path.

    .csv, .mat (MATLAB 5), .parquet, .uff or .unv (Universal File Format, data sets 58), .mf4 (ASAM MDF 4);
    Parquet and UFF need gearfmu[data], MDF gearfmu[mdf].
    channels : names of those to write, all when None.

    Raises GearfmuError for another suffix, TraceError for a channel that there is not.
    """
    return convert_trace(trace if isinstance(trace, Trace) else Trace.load(trace), path, channels)
