"""Trace: sampled signals of one run, the same type for the solver, the FMU and coupled runs, and its HDF5 file."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from importlib import import_module
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from gearfmu.errors import GearfmuError, near_or_all
from gearfmu.extras import required
from gearfmu.files import Format, reading, writing, written_whole
from gearfmu.quantities import quantity_text
from gearfmu.stage.assembly.shown import Card, Shown, grouped, plot_over

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class TraceError(GearfmuError):
    """A trace, or a file that should hold one, is not valid."""


OWN_PANELS = 4  # channels of a plot that have one each
FILE = Format("gearfmu-trace", 2, "trace", TraceError, "make it again with 'gearfmu run' or 'gearfmu simulate'")


@dataclass(frozen=True)
class Channel:
    """One sampled signal: `values (n,)` in `unit` ("" for none; units as in the FMU, e.g. "N.m", "rad/s")."""

    values: np.ndarray
    unit: str = ""
    description: str = ""


@dataclass(frozen=True, repr=False)
class Trace(Shown):
    """Signals over one time base.

    time : (n,) float64, s, strictly increasing.
    channels : name → Channel, each with (n,) finite values; integers and booleans keep their type.
    meta : facts of the run (scene, level, outcome, hashes, …); any JSON value.

    Raises TraceError, naming every bad channel, when lengths, order or numbers are not so.
    """

    time: np.ndarray
    channels: dict[str, Channel]
    meta: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", np.ascontiguousarray(self.time, dtype=np.float64))
        object.__setattr__(self, "channels", {name: _as_stored(c) for name, c in self.channels.items()})
        problems = _problems(self.time, self.channels)
        if problems:
            raise TraceError("this is not a trace: " + "; ".join(problems))

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of channel `name`; raises TraceError with the names there are."""
        if name not in self.channels:
            hint = near_or_all(str(name), sorted(self.channels), "it has:", "'", cutoff=0.6)
            raise TraceError(f"the trace has no channel '{name}': {hint}")
        return self.channels[name].values

    def _ipython_key_completions_(self) -> list[str]:
        """Names that IPython offers after trace["."""
        return list(self.channels)

    @property
    def card(self) -> Card:
        """How a session shows it."""
        run = [str(self.meta[key]) for key in ("stage", "scene", "level", "outcome") if self.meta.get(key)]
        span = f"{quantity_text(self.time[0], 's')} to {quantity_text(self.time[-1], 's')}"
        size = ("samples", f"{self.time.size}, {span}; {len(self.channels)} channels:")
        return Card("Trace: " + ", ".join(run), [size, *grouped(self.channels)])

    def plot(
        self, *names: str, start: float | None = None, end: float = np.inf, figure: Figure | None = None
    ) -> np.ndarray:
        """Draw channels over time with matplotlib, up to four in panels of their own, more by unit; returns the axes.

        names : of channels, or patterns as "bearing.*.fx"; force and transmission error of the meshes when none.
        start, end : of the part that is drawn, s; from the run's settling time when start is None. figure : of
        matplotlib, a new one when None. TraceError for a name that there is not."""
        chosen = self.matching(names or self._of_meshes)
        first = float(self.meta.get("settle") or 0.0) if start is None else start
        part = self if first >= self.time[-1] else self.window(first, end)
        panels: dict[str, dict[str, np.ndarray]] = {}
        for name in chosen:
            unit = self.channels[name].unit or "1"
            label = f"{name} in {unit}" if len(chosen) <= OWN_PANELS else unit
            panels.setdefault(label, {})[name] = part[name]
        return plot_over(("time in s", part.time), panels, figure)

    def show(self, folder: str | os.PathLike[str] | None = None) -> object:
        """The report of the run: as the last line of a notebook's cell it appears there, `show().open()` opens it in
        the browser. folder : of the report's files, which stay; a temporary one when None."""
        return import_module("gearfmu.api.results").shown(self, folder)  # reports are made of traces

    @property
    def _of_meshes(self) -> list[str]:
        meshes = [name.removesuffix("te") for name in self.channels if name.endswith(".te")]
        own = (f"{mesh}{channel}" for channel in ("force", "te") for mesh in meshes)
        return [name for name in own if name in self.channels] or ["*"]

    def matching(self, patterns: Iterable[str]) -> list[str]:
        """Names of the channels that these names and patterns ("bearing.*.fx") mean; TraceError where one means
        none."""
        found: dict[str, None] = {}
        for pattern in patterns:
            own = [name for name in self.channels if fnmatchcase(name, pattern)]
            found |= dict.fromkeys(own or self.chosen([pattern]))
        return list(found)

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def window(self, start: float, end: float = np.inf) -> Trace:
        """The samples with start ≤ time ≤ end (s), same meta."""
        keep = (self.time >= start) & (self.time <= end)
        channels = {name: Channel(c.values[keep], c.unit, c.description) for name, c in self.channels.items()}
        return Trace(self.time[keep], channels, self.meta)

    def to_numpy(self, names: Iterable[str] | None = None) -> np.ndarray:
        """Structured array (n,) with the fields "time" and `names` (all channels when None), as fmpy's results are."""
        columns = {"time": self.time} | {name: self[name] for name in self.chosen(names)}
        found = np.empty(self.time.size, [(name, values.dtype) for name, values in columns.items()])
        for name, values in columns.items():
            found[name] = values
        return found

    def to_xarray(self, names: Iterable[str] | None = None) -> xarray.Dataset:
        """xarray Dataset of the channels `names` (all when None) over "time", a view of the same numbers; units and
        descriptions are attributes `units` and `long_name`, meta is JSON in the attribute `meta` of the Dataset.

        MissingPackage where xarray is not installed (gearfmu[data])."""
        xr = required("xarray", "data")
        chosen = {name: self.channels[name] for name in self.chosen(names)}
        variables = {n: ("time", c.values, {"units": c.unit, "long_name": c.description}) for n, c in chosen.items()}
        return xr.Dataset(variables, {"time": ("time", self.time, {"units": "s"})}, {"meta": self.meta_text})

    @property
    def meta_text(self) -> str:
        """meta as JSON."""
        return json.dumps(self.meta, sort_keys=True, default=_plain)

    def chosen(self, names: Iterable[str] | None) -> list[str]:
        """Names of channels, all when None; TraceError for one that there is not."""
        found = list(self.channels) if names is None else list(names)
        for name in found:
            self[name]
        return found

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the HDF5 file (docs/file-formats.md) under a temporary name, then rename it to `path`."""
        with writing(path, FILE) as file:
            file.attrs["meta"] = self.meta_text
            _write(file, "time", Channel(self.time, "s", "time"))
            group = file.create_group("channels", track_order=True)
            for name, channel in self.channels.items():
                _write(group, name, channel)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Trace:
        """Read a file written by `save`; raises TraceError when it is missing, damaged or of another kind."""
        with reading(path, FILE) as file:
            channels = {
                name: Channel(dataset[()], str(dataset.attrs["unit"]), str(dataset.attrs["description"]))
                for name, dataset in file["channels"].items()
            }
            return Trace(file["time"][()], channels, json.loads(file.attrs["meta"]))

    def to_csv(self, path: str | os.PathLike[str], names: Iterable[str] | None = None) -> None:
        """Write time and the channels `names` (all when None) as CSV with one header row "name_[unit]"."""
        columns = {heading(name, self.channels[name].unit): self[name] for name in self.chosen(names)}
        write_columns(path, {"time_[s]": self.time} | columns)


def heading(name: str, unit: str) -> str:
    """Column heading of a quantity: "mesh.force_[N]", or the bare name without a unit."""
    return f"{name}_[{unit}]" if unit else name


def write_columns(path: str | os.PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write equally long 1-D arrays as CSV with the keys as header; numbers read back to the same double."""
    arrays = [np.asarray(values) for values in columns.values()]
    plain = [(a.astype(int) if a.dtype == bool else a).tolist() for a in arrays]
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*plain, strict=True))


def _plain(value: object) -> Any:
    """Python's form of a numpy scalar or array, for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"meta holds {type(value).__name__}, which JSON cannot; convert it to numbers or text")


def _as_stored(channel: Channel) -> Channel:
    values = np.asarray(channel.values)
    if values.dtype != bool and not np.issubdtype(values.dtype, np.integer):
        values = values.astype(np.float64)
    return Channel(np.ascontiguousarray(values), channel.unit, channel.description)


def _problems(time: np.ndarray, channels: Mapping[str, Channel]) -> list[str]:
    if time.ndim != 1 or time.size == 0:
        return [f"time has shape {time.shape}, expected (n,) with n ≥ 1"]
    found = []
    if not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
        found.append("time is not strictly increasing and finite")
    for name, channel in channels.items():
        if not name or "/" in name or name == ".":
            found.append(f"channel name '{name}' is not usable (no '/' and not empty)")
        if channel.values.shape != time.shape:
            found.append(f"channel '{name}' has shape {channel.values.shape}, time {time.shape}")
        elif not np.all(np.isfinite(channel.values)):
            bad = int(np.argmin(np.isfinite(channel.values)))
            found.append(f"channel '{name}' is not finite at t = {time[bad]:.9g} s")
    return found


def _write(group: h5py.Group, name: str, channel: Channel) -> None:
    options = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if channel.values.size > 1 else {}
    dataset = group.create_dataset(name, data=channel.values, **options)
    dataset.attrs["unit"] = channel.unit
    dataset.attrs["description"] = channel.description
