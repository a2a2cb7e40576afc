"""Traces as files of other programs: CSV, MATLAB, Parquet, Universal File Format 58, MDF 4. The suffix says which."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.extras import required
from gearfmu.files import written_whole
from gearfmu.stage.run.trace import Trace

# Universal File Format, data set 58: codes of the specific data type, and of the direction at a node
UFF_KINDS = {"m": 8, "N": 9, "m/s": 11, "m/s2": 12}
UFF_DIRECTIONS = {"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6}
GENERAL, TIME, TIME_RESPONSE, REAL_DOUBLE = 1, 17, 1, 4
UFF_LINE = 80  # columns of a text line
MATLAB_NAME = 63  # longest name of a variable


def convert(trace: Trace, path: str | os.PathLike[str], channels: Sequence[str] | None = None) -> Path:
    """Write `channels` of a trace (all when None) in the format of the suffix and return the path; whole or not at all.

    .csv : header "name_[unit]". .mat : MATLAB 5, variables `time` and the channels with "_" for what MATLAB allows in
    no name, struct `unit`, cell `name` of the names as they are here. .parquet : one column each, unit and description
    in its metadata, meta in that of the table; needs gearfmu[data]. .uff, .unv : data sets 58, time responses in double
    precision (binary), one a channel, with a node a part of the model; needs gearfmu[data].
    .mf4 : ASAM MDF 4.10, one group, unit and description with each channel; needs gearfmu[mdf].
    GearfmuError for another suffix, TraceError for a channel that there is not.
    """
    target, names = Path(path), trace.chosen(channels)
    writer = WRITERS.get(target.suffix.lower())
    if writer is None:
        raise GearfmuError(f"{target}: no format of this suffix; there are {', '.join(WRITERS)}")
    with written_whole(target) as temporary:
        writer(trace, temporary, names)
    return target


def matlab_names(names: Sequence[str]) -> list[str]:
    """Names as MATLAB allows them, no two alike: letters, digits and "_", at most 63 of them."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)
        plain = (plain if plain[0].isalpha() else f"c_{plain}")[:MATLAB_NAME]
        number = 1
        while plain in (*found, "time", "name", "unit", "meta"):
            number += 1
            plain = f"{plain[: MATLAB_NAME - 4]}_{number}"
        found.append(plain)
    return found


def _matlab(trace: Trace, path: Path, names: Sequence[str]) -> None:
    from scipy.io import savemat

    plain = matlab_names(names)
    values = {own: trace[name] for own, name in zip(plain, names, strict=True)}
    units = {own: trace.channels[name].unit for own, name in zip(plain, names, strict=True)}
    labels = np.array(list(names), dtype=object)
    content = {"time": trace.time, "unit": units, "name": labels, "meta": trace.meta_text}
    savemat(path, content | values, long_field_names=True, oned_as="column", do_compression=True)


def _parquet(trace: Trace, path: Path, names: Sequence[str]) -> None:
    arrow, parquet = required("pyarrow", "data"), required("pyarrow.parquet", "data")
    fields = [arrow.field("time", arrow.float64(), metadata={"unit": "s"})]
    for name in names:
        channel = trace.channels[name]
        kind, about = arrow.from_numpy_dtype(channel.values.dtype), channel.description
        fields.append(arrow.field(name, kind, metadata={"unit": channel.unit, "description": about}))
    schema = arrow.schema(fields, metadata={"meta": trace.meta_text})
    parquet.write_table(arrow.Table.from_arrays([trace.time, *(trace[name] for name in names)], schema=schema), path)


def _uff(trace: Trace, path: Path, names: Sequence[str]) -> None:
    pyuff = required("pyuff", "data")
    file, parts = pyuff.UFF(str(path)), list(dict.fromkeys(name.rpartition(".")[0] for name in names))
    file.write_sets(pyuff.prepare_164(units_code=1, units_description="SI: newton, metre", temp_mode=1,
                                      length=1.0, force=1.0, temp=1.0, temp_offset=273.15))  # fmt: skip
    even = _even(trace.time)
    for name in names:
        part, _, quantity = name.rpartition(".")
        channel = trace.channels[name]
        file.write_sets(pyuff.prepare_58(
            binary=1, func_type=TIME_RESPONSE, ord_data_type=REAL_DOUBLE, abscissa_spacing=int(even), ver_num=0,
            id1=_line(name), id2=_line(channel.description), id3=_line(str(trace.meta.get("scene") or "NONE")),
            id4=_line(str(trace.meta.get("stage") or "NONE")), id5=_line(f"part {part}" if part else "NONE"),
            rsp_ent_name=_line(part, 10), rsp_node=1 + parts.index(part), rsp_dir=_direction(quantity),
            ref_ent_name="NONE", ref_node=0, ref_dir=0, load_case_id=0, z_axis_value=0.0,
            abscissa_spec_data_type=TIME, abscissa_axis_units_lab="s",
            ordinate_spec_data_type=UFF_KINDS.get(channel.unit, GENERAL),
            ordinate_axis_units_lab=_line(channel.unit, 20), orddenom_spec_data_type=0,
            data=channel.values.astype(np.float64), x=trace.time,
        ))  # fmt: skip


def _mdf(trace: Trace, path: Path, names: Sequence[str]) -> None:
    asammdf = required("asammdf", "mdf")
    signals = []
    for name in names:
        channel = trace.channels[name]
        values = channel.values.astype(np.uint8) if channel.values.dtype == bool else channel.values
        signals.append(asammdf.Signal(values, trace.time, channel.unit, name, comment=channel.description))
    with asammdf.MDF(version="4.10") as file:
        file.append(
            signals, acq_name=str(trace.meta.get("scene") or trace.meta.get("stage") or ""), common_timebase=True
        )
        file.save(path, overwrite=True)


def _even(time: np.ndarray) -> bool:
    """Whether start and step (to the 6 digits that the file has for them) say the time (n,) of every sample; else the
    file holds each."""
    if time.size < 2:
        return False
    start, step = (float(f"{value:.5e}") for value in (time[0], (time[-1] - time[0]) / (time.size - 1)))
    return bool(np.max(np.abs(start + step * np.arange(time.size) - time)) <= 1e-3 * step)


def _direction(quantity: str) -> int:
    """Code of "fx", "x", "rz", … ; 0 for what has none."""
    return UFF_DIRECTIONS.get(quantity.removeprefix("f").removesuffix("_mean"), 0)


def _line(text: str, columns: int = UFF_LINE) -> str:
    """A text field: ASCII, no longer than its columns, "NONE" when empty."""
    return text.encode("ascii", "replace").decode()[:columns] or "NONE"


WRITERS: dict[str, Callable[[Trace, Path, Sequence[str]], None]] = {
    ".csv": Trace.to_csv,
    ".mat": _matlab,
    ".mf4": _mdf,
    ".parquet": _parquet,
    ".uff": _uff,
    ".unv": _uff,
}
