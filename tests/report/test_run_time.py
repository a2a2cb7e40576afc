"""A run ends with the time that its parts took."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.commands.runs import finish
from gearfmu.stage.run.trace import Channel, Trace


def test_a_run_says_where_its_time_went(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    meta = {"scene": "a", "outcome": "ok", "simulated_s": 0.1, "cpu_s": 2.0, "realtime_factor": 20.0}
    trace = Trace(np.arange(3.0), {"x.w": Channel(np.ones(3), "rad/s")}, meta)
    assert finish(trace, tmp_path, None, prepared=1.5) == 0
    assert "CPU time: model, FMU and start 1.5 s, simulation 2 s, report " in capsys.readouterr().out
