"""What accuracy costs: error against time of the fidelity levels, observed orders, limits of the step."""

from __future__ import annotations

from gearfmu.study.run import Defaults, Job, Study, default_rows, study
from gearfmu.study.table import ReferenceRow, Row, TransientRow

__all__ = ["Defaults", "Job", "ReferenceRow", "Row", "Study", "TransientRow", "default_rows", "study"]
