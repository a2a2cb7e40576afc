"""Hard cases: scenes that break solvers, run at every level and at several steps, each with checks of its own."""

from __future__ import annotations

from gearfmu.stability.case import LEVELS, STEPS, Case, Finding
from gearfmu.stability.scenes import SCENES, what
from gearfmu.stability.suite import Row, Task, run_suite, table, tasks

__all__ = ["LEVELS", "SCENES", "STEPS", "Case", "Finding", "Row", "Task", "run_suite", "table", "tasks", "what"]
