"""Room of the report: metrics, plots and the page of one run.

`write` is imported when it is asked for: metrics need no figures.
"""

from __future__ import annotations

from typing import Any

__all__ = ["write"]


def __getattr__(name: str) -> Any:
    if name == "write":
        from gearfmu.report.html import write

        return write
    raise AttributeError(f"gearfmu.report has no {name!r}")
