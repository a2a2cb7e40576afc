"""Play of port springs, on every kind of stage: a loaded run carries the torque that was asked for, as without play; a
reversal of the torque goes through it without an unsolved step and hits harder."""

from __future__ import annotations

import numpy as np
import pytest
from kinds import KINDS, Kind, assembled, bodies_of, some

from gearfmu.stage import StageModel, Trace
from gearfmu.stage.run.simulate import simulate
from gearfmu.stage.run.steady import Line, Profiled
from gearfmu.stagefile.forms.expand import with_ports

PLAY = 2e-3  # rad, of every port
QUICK = {"pair", "helical"}
FAST = {"level": 1.0}


def pair_of(kind: Kind) -> tuple[StageModel, StageModel]:
    """The stage driven by springs, without and with play."""
    plain = kind.model().driven_by_springs()
    ports = {name: port.model_copy(update={"play": PLAY}) for name, port in plain.stage.ports.items()}
    return plain, assembled(with_ports(plain.stage, ports), bodies_of(kind.file))


def reversed_in(model: StageModel, kind: Kind) -> Trace:
    """Half of the torque turns its sign within 2 ms."""
    half = 0.5 * kind.torque
    torque = Line(np.array([0.0, 1e-3, 3e-3, 4e-3]), np.array([half, half, -half, -half]))
    speed = Line(np.array([0.0, 1.0]), np.full(2, kind.speed))
    return simulate(model, Profiled(model, torque, speed), 4e-3, kind.step, FAST)


@pytest.mark.parametrize("kind", some(QUICK, KINDS.keys() - QUICK))
def test_a_loaded_run_carries_its_torque_through_play(kind: Kind) -> None:
    plain, free = (kind.run(model) for model in pair_of(kind))
    port = f"{pair_of(kind)[0].shafts.input}.tau_mean"
    settled = plain.time > 0.5 * kind.duration
    assert free[port][settled].mean() == pytest.approx(plain[port][settled].mean(), rel=2e-3)
    assert free["solver.status"][-1] == 0


@pytest.mark.parametrize("kind", some(QUICK, KINDS.keys() - QUICK))
def test_a_reversal_goes_through_play_and_hits_harder(kind: Kind) -> None:
    plain, free = (reversed_in(model, kind) for model in pair_of(kind))
    assert free["solver.status"][-1] == 0 and free["solver.retried_steps"][-1] == 0
    assert free["energy.stored"].max() > plain["energy.stored"].max()
    assert np.abs(free["energy.residual"]).max() < 5e-4 * free["energy.stored"].max()
