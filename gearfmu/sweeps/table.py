"""The table of a sweep: one row a point, Parquet where pyarrow is installed, else CSV."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gearfmu.extras import has, required
from gearfmu.files import written_whole
from gearfmu.stage.run.trace import Trace, write_columns
from gearfmu.sweeps.plan import SweepError

if TYPE_CHECKING:
    import xarray

NO_NUMBERS = ("point", "outcome", "message", "trace")


@dataclass(frozen=True)
class SweepTable:
    """columns : name → (n,), one row a point: `point`; the keys of the points, SI, unit behind the name (torque_Nm,
    speed_rad_s); `outcome`, "ok" or the fault; `message`; `trace`, name of its file or ""; then the results, NaN
    where a point has none.
    axes : names of the columns that were swept. curves : of a transmission error, the same for all positions of all
    points. folder : of the files.
    """

    columns: Mapping[str, np.ndarray]
    axes: tuple[str, ...]
    folder: Path
    curves: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.columns["point"])

    def __getitem__(self, name: str) -> np.ndarray:
        """A column; SweepError with the names there are."""
        if name not in self.columns:
            raise SweepError(f"the table has no column '{name}'; it has: {', '.join(self.columns)}")
        return self.columns[name]

    @property
    def failures(self) -> list[str]:
        """A sentence for every point that has no results: its values, the fault."""
        bad = np.flatnonzero(self["outcome"] != "ok")
        return [f"{self.values(i)}: {self['outcome'][i]}: {self['message'][i]}" for i in bad.tolist()]

    def values(self, row: int) -> str:
        """Swept keys and values, as text: "torque_Nm = 100, speed_rad_s = 200"."""
        return ", ".join(f"{name} = {_shown(self[name][row])}" for name in self.axes)

    def trace(self, row: int) -> Trace:
        """The trace of a point; SweepError where none was kept."""
        name = str(self["trace"][row])
        if not name:
            raise SweepError(f"no trace of {self.values(row)}: sweep with traces")
        return Trace.load(self.folder / name)

    def to_xarray(self) -> xarray.Dataset:
        """Results over the swept keys, a dimension each; NaN where a point is missing. MissingPackage without xarray
        (gearfmu[data]); SweepError where points share their values."""
        xr = required("xarray", "data")
        ticks = {name: np.unique(self[name]) for name in self.axes}
        places = tuple(np.searchsorted(ticks[name], self[name]) for name in self.axes)
        if len(set(zip(*(p.tolist() for p in places), strict=True))) < len(self):
            raise SweepError("points share their values: there is no grid")
        grids = {}
        for name, values in self.columns.items():
            if name not in (*self.axes, *NO_NUMBERS) and values.dtype == float:
                grid = np.full([ticks[axis].size for axis in self.axes], np.nan)
                grid[places] = values
                grids[name] = (self.axes, grid)
        return xr.Dataset(grids, ticks)

    def save(self, path: Path) -> Path:
        """Write the table in the format of the suffix, .csv or .parquet; returns the path."""
        return write_table(path, self.columns)

    @property
    def files(self) -> list[Path]:
        """Files of table and curves in the folder."""
        suffix = ".parquet" if has("pyarrow") else ".csv"
        return [self.folder / f"{name}{suffix}" for name in (("sweep", "curves") if self.curves else ("sweep",))]

    def write(self) -> None:
        """Write these files."""
        for path, columns in zip(self.files, (self.columns, self.curves), strict=False):
            write_table(path, columns)


def write_table(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """Equally long columns as .csv or .parquet; whole or not at all."""
    if path.suffix == ".csv":
        write_columns(path, columns)
        return path
    arrow, parquet = required("pyarrow", "data"), required("pyarrow.parquet", "data")
    with written_whole(path) as temporary:
        parquet.write_table(arrow.table({name: arrow.array(v.tolist()) for name, v in columns.items()}), temporary)
    return path


def column(values: Sequence[object]) -> np.ndarray:
    """(n,) of one type: numbers, NaN where None; switches; else text."""
    if all(isinstance(value, bool) for value in values):
        return np.array(values, dtype=bool)
    if all(isinstance(value, (int, float)) or value is None for value in values):
        whole = all(isinstance(value, int) for value in values)
        return np.array([np.nan if value is None else value for value in values], dtype=int if whole else float)
    return np.array([str(value) for value in values], dtype=object)


def column_name(key: str, unit: str | None) -> str:
    """ "torque_Nm" of torque in N*m, "speed_rad_s"; the key alone without a unit."""
    plain = re.sub(r"[*^()]", "", (unit or "").replace("/", "_"))
    return f"{key}_{plain}" if plain else key


def _shown(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
