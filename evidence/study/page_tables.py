"""Tables of docs/study.md from study.csv, sets.csv and the counted instructions, default step first; that of
docs/coupling.md."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from evidence.tables import read_rows

LEVELS = ("fast", "standard", "full", "rigid", "paper")
DEFAULT, SET_DEFAULT = 20e-6 / 3, 10e-6  # s: of a pair and of a set, in communication steps of 20 µs
SHOWN = {"rigid": (DEFAULT,), "fast": (DEFAULT, 10e-6, 5e-6, 1.25e-6), "standard": (DEFAULT,)}
PAIR_STEPS = SHOWN | {"full": (DEFAULT, 1.25e-6)}
SET_STEPS = {
    "rigid": (SET_DEFAULT, 5e-6),
    "fast": (SET_DEFAULT, DEFAULT, 5e-6, 1.25e-6),
    "standard": (SET_DEFAULT, DEFAULT, 5e-6, 2.5e-6),
    "full": (SET_DEFAULT, DEFAULT, 5e-6, 2.5e-6),
}
HEAD = "| level | modes | h, µs | transmission error | {} | {} | thousand instructions a step | time | ratio |"
Row = dict[str, str]


def pairs(folder: Path) -> str:
    """The loaded pair: levels and steps of PAIR_STEPS, then explicit integrators at the mean of their own steps."""
    rows = [r for r in read_rows(folder / "study" / "study.csv") if r["scene"] == "pair_loaded" and r["slices"] == "5"]
    counted = instructions(folder, "fzg_c/stage_relief")
    own = [row for level in LEVELS for row in at(rows, level, PAIR_STEPS.get(level, ()), "dg4")]
    own += [row for row in rows if row["integrator"] == "rk45"]
    return table(own, DEFAULT, counted, ("force_error", "bearing_error"), HEAD.format("mesh force", "bearing force"))


def sets(folder: Path) -> str:
    """The planetary set of four planets at 85 rad/s."""
    wanted = {"planets": "4", "speed": "85", "slices": "5", "off": "", "against": "full, 0.4 µs"}
    rows = [row for row in read_rows(folder / "study" / "sets.csv") if wanted.items() <= row.items()]
    own = [row for level in LEVELS for row in at(rows, level, SET_STEPS.get(level, ()))]
    counted = instructions(folder, "planetary54")
    return table(own, SET_DEFAULT, counted, ("force_error", "pin_error"), HEAD.format("mesh forces", "pins"))


def instructions(folder: Path, stage: str) -> dict[tuple[str, int], float]:
    """(Level, step in ns) → instructions a step."""
    rows = [row for row in read_rows(folder / "price" / "steps.csv") if row["stage"] == stage]
    return {(row["level"], nanoseconds(row["h_s"])): float(row["instructions_per_step"]) for row in rows}


def nanoseconds(step: str | float) -> int:
    """A step (s) as a number that compares."""
    return round(1e9 * float(step))


def at(rows: list[Row], level: str, steps: tuple[float, ...], integrator: str | None = None) -> list[Row]:
    """The rows of a level at these steps (s), in their order."""
    own = [row for row in rows if row["level"] == level and row.get("integrator") == integrator]
    return [row for h in steps for row in own if nanoseconds(row["h_s"]) == nanoseconds(h)]


def table(
    rows: list[Row], default: float, counted: dict[tuple[str, int], float], errors: tuple[str, str], head: str
) -> str:
    """The rows as Markdown; errors in per cent with two digits."""
    lines = [head, "|" + "---|" * (head.count("|") - 1)]
    for row in rows:
        level = row["level"] if row.get("integrator") != "rk45" else f"{row['level']}`, `rk45"
        step = nanoseconds(row["h_s"])
        shown = f"{step / 1e3:.3g}" + " (default)" * (step == nanoseconds(default))
        count = counted.get((row["level"], step)) if row.get("integrator") != "rk45" else None
        cells = [f"`{level}`", row["n_dyn"], shown]
        cells += [number(100 * float(row[name])) for name in ("te_error", *errors)]
        cells += [f"{count / 1e3:.3g}" if count and count < 1e6 else f"{count / 1e3:.0f}" if count else "–"]
        cells += [number(float(row[name])) for name in ("realtime_factor", "cpu_ratio")]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def number(value: float) -> str:
    """Two digits."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def couplings(folder: Path) -> str:
    """Errors at 100 µs and 1 ms, a line for every master and what is connected."""
    lines = [
        "| clutch | master | torque held | not connected | 100 µs: std | AC | 1 ms: std | AC |",
        "|---|---|---|---|---|---|---|---|",
    ]
    found: dict[tuple[str, ...], dict[str, Row]] = {}
    for row in read_rows(folder / "accuracy" / "coupling.csv"):
        if row["level"] == "fast":
            line = tuple(row[key] for key in ("clutch", "master", "held", "unconnected"))
            found.setdefault(line, {})[row["H_s"]] = row
    for (clutch, *line), by_step in found.items():
        cells = [clutch, *(f"`{part}`" if part else "" for part in line)]
        cells += [percent(by_step[h], f"error_over_{of}") for h in ("0.0001", "0.001") for of in ("std", "ac")]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def percent(row: Row, key: str) -> str:
    """An error in %, or how the run ended."""
    return f"{number(100 * float(row[key]))} %" if row["outcome"] == "ok" else "stopped"


TABLES: dict[str, Callable[[Path], str]] = {"pairs": pairs, "sets": sets, "coupling": couplings}
