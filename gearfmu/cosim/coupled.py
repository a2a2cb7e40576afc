"""One coupled run: a master steps a stage and a drivetrain to the end of a scene, or to the last good time."""
from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from gearfmu.cosim.masters import Cut, Master, master
from gearfmu.cosim.recorder import Recorder
from gearfmu.errors import CouplingError, FmuError, SimulationError
from gearfmu.stage.trace import Trace

OK = "ok"
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Plan:
    """How a cut is stepped: master, communication step H in s, number of steps, what to record; progress is told the done fraction."""

    master: str
    step: float
    steps: int
    record: tuple[str, ...] = ("*",)
    progress: Progress | None = None


@dataclass(frozen=True)
class Result:
    """Trace up to the last good time, how the run ended, and its cost. work, throughput: J at the cut, on the drivetrain, signed sum and sum of magnitudes."""

    trace: Trace
    outcome: str
    message: str
    cpu_s: float
    work: float
    throughput: float
    order: int
    facts: dict[str, float] = field(default_factory=dict)

    @property
    def energy_residual(self) -> float | None:
        """Work that one side of the cut gave and the other did not get, over the exchanged work; None when the stage does not tell its work."""
        work = self.facts.get("energy.work")
        return None if work is None or not self.throughput else (self.work + work) / self.throughput


def run_coupled(cut: Cut, plan: Plan) -> Result:
    """Run to the end, or until a unit fails: then the outcome has a name and the trace ends at the last good communication point."""
    with_recorder = _Run(cut, plan)
    outcome, message, started = OK, "", clock.process_time()
    try:
        with_recorder.go()
    except SimulationError as error:
        outcome, message = error.outcome, str(error)
    except (FmuError, CouplingError) as error:
        if not with_recorder.recorder.count:
            raise
        outcome, message = "stopped", str(error)
    cpu = clock.process_time() - started
    return with_recorder.result(outcome, message, cpu)


class _Run:
    def __init__(self, cut: Cut, plan: Plan) -> None:
        self.cut, self.plan = cut, plan
        self.master: Master = master(plan.master, cut)
        self.recorder = Recorder(cut.stage, cut.drive, plan.record, plan.steps + 1)
        known = cut.stage.outputs()
        self._fact_names = [name for name in ("energy.work", "energy.residual", "solver.n_dyn", "solver.h", "solver.trouble", "solver.steps") if name in known]
        self._facts: Any = cut.stage.resolve(self._fact_names)

    def go(self) -> None:
        """Every communication step; time is n·H."""
        h, tell = self.plan.step, max(1, self.plan.steps // 200)
        self.master.begin(0.0)
        self.recorder.take(0.0)
        for n in range(self.plan.steps):
            self.master.step(n * h, h)
            self.recorder.take((n + 1) * h)
            if self.plan.progress and (n + 1) % tell == 0:
                self.plan.progress((n + 1) / self.plan.steps)

    def result(self, outcome: str, message: str, cpu: float) -> Result:
        """What came of it. After a failure the facts are those of the last good time too: a failed step leaves the stage there."""
        exchange = self.master.exchange
        facts = dict(zip(self._fact_names, map(float, self.cut.stage.get(self._facts)), strict=True))
        return Result(self.recorder.trace({}), outcome, message, cpu, exchange.work, exchange.throughput, self.master.order, facts)
