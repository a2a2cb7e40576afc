"""Summary of a coupled run: plain JSON, SI. It is the trace's meta and summary.json."""

from __future__ import annotations

import datetime
import hashlib
import platform
from importlib.metadata import version
from typing import Any

from gearfmu.cosim.accuracy import ChannelError
from gearfmu.cosim.coupled import Result
from gearfmu.cosim.kernel_unit import Source
from gearfmu.kernel.binding import status_words
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage.assembly.model import integrator_of
from gearfmu.stagefile.forms.turning import meshings

TORQUES = (
    "{}.shaft.tau",
    "{}.tau",
    "{}.w",
)  # whose coupling error is the run's: the torque of the input shaft, in a chain or in the port; or its speed
COUNTS = {"n_dyn": "solver.n_dyn", "internal_steps": "solver.steps", "retried_steps": "solver.retried_steps"}


def summary(scene: SceneSpec, source: Source, result: Result, errors: dict[str, ChannelError] | None) -> dict[str, Any]:
    """Subject of a run, its outcome, price and origin.

    errors : coupling error by channel, None when the run was not verified.
    """
    return _what(scene, source) | _price(result) | _accuracy(source, result, errors) | _origin(scene, source)


def _what(scene: SceneSpec, source: Source) -> dict[str, Any]:
    clutch = any(port.chain is not None for port in source.model.stage.ports.values())
    return {
        "scene": scene.name,
        "description": scene.description,
        "stage": scene.stage.name,
        "level": scene.stage.level,
        "integrator": integrator_of(scene.stage.level, scene.stage.integrator, clutch),
        "contact": scene.stage.contact,
        "slices": scene.stage.slices,
        "effects_off": list(scene.stage.effects.off),
        "H": scene.coupling.step,
        "master": scene.coupling.master,
        "settle": scene.settle,
        "unit": "kernel" if source.fmu_path is None else "fmu",
        "chain_in_fmu": scene.chain_in_fmu,
        "meshes": {mesh: known.plain for mesh, known in meshings(source.model.stage).items()},
    }


def _price(result: Result) -> dict[str, Any]:
    end = float(result.trace.time[-1])
    counts = {key: int(result.facts[name]) for key, name in COUNTS.items() if name in result.facts}
    return counts | {
        "outcome": result.outcome,
        "message": result.message,
        "warnings": status_words(int(result.facts.get("solver.status", 0))),
        "simulated_s": end,
        "cpu_s": result.cpu_s,
        "realtime_factor": result.cpu_s / end if end else None,
        "stage_cpu_s": result.stage_cpu_s,
        "stage_realtime_factor": result.stage_cpu_s / end if end else None,
        "h": result.facts.get("solver.h"),
    }


def _accuracy(source: Source, result: Result, errors: dict[str, ChannelError] | None) -> dict[str, Any]:
    port, errors = source.model.shafts.input, errors or {}
    torque = next((name for name in (text.format(port) for text in TORQUES) if name in errors), None)
    return {
        "coupling_error": errors[torque].relative if torque else None,
        "coupling_error_rms_Nm": errors[torque].rms if torque and torque.endswith(".tau") else None,
        "coupling_error_of": torque,
        "coupling_errors": {name: error.relative for name, error in errors.items()},
        "energy_residual": result.energy_residual,
        "exchanged_work_J": result.throughput,
    }


def _origin(scene: SceneSpec, source: Source) -> dict[str, Any]:
    hashes = {f"body {name}": text for name, text in source.model.bodies.items()}
    hashes |= {"scene": scene.hash, "model": source.model.hash}
    if source.fmu_path is not None:
        hashes["fmu"] = hashlib.sha256(source.fmu_path.read_bytes()).hexdigest()
    versions = {name: version(name) for name in ("gearfmu", "numpy", "scipy", "fmpy")}
    finished = datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")
    return {"hashes": hashes, "versions": {"python": platform.python_version(), **versions}, "finished": finished}
