"""Values of a key as text: "100, 200 N*m", "1000:6000:11 rpm", "fast, full"."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from gearfmu.sweeps.plan import SweepError

_RANGE = re.compile(r"\s*([^:\s]+)\s*:\s*([^:\s]+)\s*:\s*(\d+)\s*(\S.*?)?\s*$")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")


def key_and_values(text: str) -> tuple[str, list[Any]]:
    """("torque", ["100 N*m", "200 N*m"]) from "torque=100, 200 N*m": a list, whose last unit holds for numbers without
    one, or start:end:count, both ends included. SweepError for anything else."""
    key, sign, rest = text.partition("=")
    if not sign or not key.strip() or not rest.strip():
        raise SweepError(f'\'{text}\' is not KEY=VALUES: write torque="100, 200 N*m" or speed="1000:6000:11 rpm"')
    found = _RANGE.match(rest)
    return key.strip(), _range(found, text) if found else _list(rest)


def _range(found: re.Match[str], text: str) -> list[Any]:
    start, end, count, unit = found.groups()
    try:
        values = np.linspace(float(start), float(end), int(count)).tolist()
    except ValueError:
        raise SweepError(f"'{text}': a range is start:end:count, numbers with one unit behind them") from None
    return [f"{value:.15g} {unit}" if unit else value for value in values]


def _list(text: str) -> list[Any]:
    items = [item.strip() for item in text.split(",") if item.strip()]
    last = _NUMBER.match(items[-1])
    unit = last[2] if last else ""
    return [_item(item, unit) for item in items]


def _item(text: str, unit: str) -> Any:
    match = _NUMBER.match(text)
    if not match:
        return {"true": True, "false": False}.get(text, text)
    number, own = match[1], match[2] or unit
    if own:
        return f"{number} {own}"
    return int(number) if re.fullmatch(r"[+-]?\d+", number) else float(number)
