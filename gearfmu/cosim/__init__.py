"""Coupling: units, masters, drivetrain parts; `run(scene, …)` runs a whole scene (scene_run.py).

`run` is imported when it is asked for: units and masters need neither bodies nor FMUs.
"""

from __future__ import annotations

from typing import Any

__all__ = ["run"]


def __getattr__(name: str) -> Any:
    if name == "run":
        from gearfmu.cosim.scene_run import run

        return run
    raise AttributeError(f"gearfmu.cosim has no {name!r}")
