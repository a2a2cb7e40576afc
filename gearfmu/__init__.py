"""Elastic gear stages as FMUs.

    import gearfmu as gf

    stage = gf.load("fzg_c/stage_relief")                     # numbers of a stage, checked
    model = gf.assemble(stage)                                # its reduced bodies as a model
    error = gf.te(model, ["100 N*m", "302 N*m"])              # loaded transmission error
    trace = gf.simulate(model, "302 N*m", "2000 rpm", level="fast")
    print(1e6 * error.te.mean(axis=1), trace["mesh.force"].mean())
    gf.export(model, "fzg_c.fmu")                             # FMI 2.0, needs nothing where it is imported
    gf.write_report(trace, "out/steady")
    gf.run("pair_loaded", "out/loaded")                       # a scene: the stage in its drivetrain
    gf.sweep("fzg_c", {"torque": [100.0, 200.0, 300.0]}, "out/harris")

Numbers are SI; text carries its unit. `docs/howto-python.md` shows more, `gearfmu --help` the same on the command line.
Names listed here are imported on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearfmu.api.bodies import frf
    from gearfmu.api.models import assemble, load, load_scene, reduce
    from gearfmu.api.plans import plan, run_plan, sweep
    from gearfmu.api.results import compare, convert, export, write_report
    from gearfmu.api.runs import assemble_in_scene, drive, run, simulate, te, wound_up
    from gearfmu.api.settings import Settings
    from gearfmu.api.sound import house, sound_power, transfer_paths
    from gearfmu.api.stages import bearings, effects, efficiency, new
    from gearfmu.errors import GearfmuError
    from gearfmu.fmu.validate import validate
    from gearfmu.stage.assembly.model import StageModel
    from gearfmu.stage.run.te import TeResult
    from gearfmu.stage.run.trace import Channel, Trace
    from gearfmu.sweeps.table import SweepTable

    __version__: str

__all__ = [
    "Channel",
    "GearfmuError",
    "Settings",
    "StageModel",
    "SweepTable",
    "TeResult",
    "Trace",
    "assemble",
    "assemble_in_scene",
    "bearings",
    "compare",
    "convert",
    "drive",
    "effects",
    "efficiency",
    "export",
    "frf",
    "house",
    "load",
    "load_scene",
    "modes",
    "new",
    "plan",
    "reduce",
    "run",
    "run_plan",
    "simulate",
    "sound_power",
    "sweep",
    "te",
    "transfer_paths",
    "validate",
    "wound_up",
    "write_report",
]
_HOMES = {
    "api.bodies": ("frf",),
    "api.models": ("assemble", "load", "load_scene", "reduce"),
    "api.plans": ("plan", "run_plan", "sweep"),
    "api.results": ("compare", "convert", "export", "write_report"),
    "api.runs": ("assemble_in_scene", "drive", "run", "simulate", "te", "wound_up"),
    "api.settings": ("Settings",),
    "api.sound": ("house", "sound_power", "transfer_paths"),
    "api.stages": ("bearings", "effects", "efficiency", "new"),
    "errors": ("GearfmuError",),
    "fmu.validate": ("validate",),
    "stage.assembly.model": ("StageModel",),
    "stage.run.te": ("TeResult",),
    "stage.run.trace": ("Channel", "Trace"),
    "sweeps.table": ("SweepTable",),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("gearfmu")
    if name == "modes":  # the package, which can be called
        return import_module("gearfmu.modes")
    for home, names in _HOMES.items():
        if name in names:
            found = getattr(import_module(f"gearfmu.{home}"), name)
            globals()[name] = found
            return found
    raise AttributeError(f"module 'gearfmu' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
