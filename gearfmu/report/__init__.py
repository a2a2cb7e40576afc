"""Room of the report: metrics, plots and the page of one run."""

from __future__ import annotations

from gearfmu.report.html import write

__all__ = ["write"]
