"""In a session: what models, results and traces show of themselves, plots, completion, types of keyword arguments."""

from __future__ import annotations

from typing import Any, get_args, get_type_hints

import matplotlib
import numpy as np
import pytest

import gearfmu as gf
from gearfmu.api.settings import Integrator, Level, RunSettings
from gearfmu.stage.assembly.shown import LINES, WIDTH
from gearfmu.stage.run.trace import TraceError

matplotlib.use("Agg")
SCREEN = 24  # lines of a terminal


@pytest.fixture(scope="module")
def trace() -> gf.Trace:
    return gf.simulate("fzg_c", 302, "2000 rpm", "2 ms", settle=1e-3, level="rigid")


def screens(thing: Any) -> tuple[str, str]:
    """Text and HTML; both fit one screen."""
    text, page = repr(thing), thing._repr_html_()
    lines = text.splitlines()
    assert len(lines) <= SCREEN and max(map(len, lines)) <= WIDTH
    assert len(page) < 8000 and page.count("<tr>") <= LINES + 1
    return text, page


@pytest.mark.parametrize("stage", ["fzg_c", "two_stage", "planetary54"])
def test_models_and_results_fit_one_screen(stage: str) -> None:
    model = gf.assemble(stage)
    text, page = screens(model)
    assert text.startswith(f"Stage {stage} (") and stage in page and "effect.(" in text and model.hash[:12] in text
    result = gf.te(model, [50.0, "100 N*m"], 2, level="rigid", slices=1)
    text, page = screens(result)
    assert "50.0 N·m" in text and f"mean {1e6 * result.te[1].mean():.3f} µm" in text and "100.0 N·m" in page
    axes = result.plot()
    assert np.allclose(axes[0].lines[1].get_ydata(), 1e6 * (result.te[1] - result.te[1].mean()))


def test_a_trace_shows_its_run_and_channels(trace: gf.Trace) -> None:
    text, page = screens(trace)
    assert text.startswith("Trace: fzg_c, constant speed and load, rigid, completed")
    assert "101, 0 s to 2 ms" in text and "bearing.pinion" in page
    assert text.index("  mesh ") < text.index("  bearing.pinion "), "meshes first"
    many = gf.Trace(trace.time, {f"part{k}.x": gf.Channel(trace.time) for k in range(40)})
    assert screens(many)[0].endswith("23 more")
    assert "mesh.force" in trace._ipython_key_completions_()


def test_a_trace_draws_the_part_and_the_channels_that_are_named(trace: gf.Trace) -> None:
    force, error = trace.plot()
    assert (force.get_ylabel(), error.get_ylabel()) == ("mesh.force in N", "mesh.te in m")
    assert np.array_equal(force.lines[0].get_ydata(), trace.window(1e-3)["mesh.force"])
    (axis,) = trace.plot("bearing.*.f?", "bearing.*.fx_mean", start=0.0)
    assert axis.get_ylabel() == "N" and len(axis.lines) == 6 and axis.lines[0].get_xdata()[0] == 0.0
    with pytest.raises(TraceError, match=r"no channel 'mesh.forc': did you mean 'mesh.force'\?"):
        trace.plot("mesh.forc")
    with pytest.raises(TraceError, match="no channel 'zz': it has: bearing.pinion.fx, "):
        trace["zz"]


@pytest.mark.parametrize(("place", "reason"), [("/proc/x.fmu", "No such file"), (".", "it is a folder")])
def test_a_place_that_cannot_be_written_is_named_itself(place: str, reason: str) -> None:
    with pytest.raises(gf.GearfmuError, match=f"^{place}: cannot be written, {reason}.*: .*(folder|file)") as refused:
        gf.export("fzg_c", place)
    assert isinstance(refused.value, OSError)


def test_typed_settings_are_the_kernels_parameters() -> None:
    """Names, types and items; single meshes and ports have parameters beside."""
    hints = get_type_hints(gf.Settings)
    known = {}
    for stage in ("fzg_c", "two_stage", "planetary54", "planetary54/stage_pin_error"):
        parameters = [v for v in gf.assemble(stage).kernel_variables() if v.causality == "parameter"]
        known |= {v.name: v for v in parameters if "." not in v.name or v.name.startswith("effect.")}
    assert set(hints) - {"effect.runout"} == set(known), "fields of gearfmu/api/settings.py"
    types = {"Real": float, "Integer": int, "Boolean": bool}
    for name, variable in known.items():
        items = get_args(hints[name])
        assert items == tuple(variable.items) if items else hints[name] is types[variable.type], name
    assert get_args(Level) == tuple(known["level"].items) and get_args(Integrator) == tuple(known["integrator"].items)
    assert set(get_type_hints(RunSettings)) == set(hints) | {"profile"}
