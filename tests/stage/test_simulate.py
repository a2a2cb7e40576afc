"""Standalone runs of the shipped pair: mean values, agreement of the integrators, what a run records; along a torque
and a speed over time."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.errors import SpecError
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, Trace, loaded_te, simulate
from gearfmu.stage.run.steady import Line, Profiled, winding_torques
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec
from gearfmu.stagefile.tables.profile import Profile, read_profile

LOAD, SPEED = 302.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
H = 60e-6  # s, communication step: 8, 16, 32 … internal steps of 7.5, 3.75, 1.875 … µs
SETTLED = 0.02
DG4, EM, RK45 = range(3)
RIGID, FAST = 0, 1


def run(model: StageModel, duration: float, **parameters: float) -> Trace:
    return simulate(model, Steady(model, SPEED, LOAD), duration, H, {"level": FAST, **parameters})


def error(trace: Trace, reference: Trace, channel: str) -> float:
    """rms of the difference over the rms of the alternating part, second half of the run."""
    half = trace.time.size // 2
    wanted = reference[channel][half:]
    return float(np.sqrt(np.mean((trace[channel][half:] - wanted) ** 2)) / wanted.std())


@pytest.fixture(scope="module")
def steady(relieved: StageModel) -> Trace:
    return run(relieved, 0.08)


def test_mean_values_are_those_of_the_load(steady: Trace, relieved: StageModel, pair: PairGeometry) -> None:
    """Over whole mesh periods the mesh carries the torque, and te is on average the quasi-static one."""
    assert (
        steady.meta["outcome"] == "completed"
        and steady["solver.retried_steps"][-1] == 0
        and steady["solver.status"][-1] == 0
    )
    samples = steady.time > SETTLED
    force = pair.gears[0].r_b * steady["mesh.force_mean"][samples].mean()
    te, static = steady["mesh.te"][samples].mean(), loaded_te(relieved, [LOAD], 64).te.mean()
    assert force == pytest.approx(LOAD, rel=5e-3) and te == pytest.approx(static, rel=5e-3)
    assert steady["wheel.tau_mean"][samples].mean() == pytest.approx(-LOAD * 24 / 16, rel=5e-3)


def test_te_is_what_its_name_says(steady: Trace, pair: PairGeometry) -> None:
    """mesh.te = r_b1 φ_1 + r_b2 φ_2 of the bore nodes."""
    angles = (steady["pinion.gear.phi"], steady["wheel.gear.phi"])
    expected = sum(shape.r_b * phi for shape, phi in zip(pair.gears, angles, strict=True))
    assert np.abs(steady["mesh.te"] - expected).max() < 1e-9 * np.abs(angles[0]).max()


def test_integrators_agree_at_small_steps(relieved: StageModel) -> None:
    """Against a step of 0.47 µs. Order: tests/study/test_order.py."""
    fine = run(relieved, 0.03, h=H / 128)
    for scheme in (DG4, EM, RK45):
        trace = run(relieved, 0.03, integrator=scheme, h=H / 64)
        te, force = error(trace, fine, "mesh.te"), error(trace, fine, "mesh.force")
        # rk45 reads the closing speed from the coordinates, the steps from the path's deflection: they differ by what
        # the rows' own motion along the flank adds (decisions.md)
        assert te < 5e-3 and force < (5e-2 if scheme == RK45 else 2e-2)


def test_rk45_without_contact_dashpots_is_the_same_model(relieved: StageModel) -> None:
    off = {"effect.contact_damping": 0.0}
    step, paper_way = (run(relieved, 0.01, integrator=scheme, h=H / 64, **off) for scheme in (DG4, RK45))
    assert error(paper_way, step, "mesh.te") < 1e-3


def test_the_kernel_writes_the_samples_itself(relieved: StageModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reads of single channels, 47 a sample, took eight times the kernel's own time."""
    calls = {"get": 0, "record": 0, "step": 0}
    for name in calls:
        own = getattr(Kernel, name)

        def counted(*given: Any, name: str = name, own: Any = own) -> Any:
            calls[name] += 1
            return own(*given)

        monkeypatch.setattr(Kernel, name, counted)
    told: list[float] = []
    trace = simulate(relieved, Steady(relieved, SPEED, LOAD), 4000 * 20e-6, 20e-6, {"level": 0.0}, told.append)
    assert trace.time.size == 4001 and calls["record"] <= 200 and calls["get"] < 50 and calls["step"] == 0
    assert told == sorted(told) and told[0] == 0.0 and len(told) == calls["record"]


def test_inputs_of_ones_own_are_asked_at_every_step(relieved: StageModel) -> None:
    """A function of time that names fewer inputs later leaves them as they were: the same bits as rows of all."""
    steady, first = Steady(relieved, SPEED, LOAD), {"pinion.w", "wheel.w"}

    def own(time: float) -> dict[str, float]:
        return {name: value for name, value in steady(time).items() if time == 0.0 or name not in first}

    one, other = (simulate(relieved, inputs, 40 * H, H, {"level": FAST}) for inputs in (own, steady))
    assert all(np.array_equal(one[name], other[name]) for name in one.channels)


@pytest.mark.parametrize("level, drift", [(RIGID, 2e-7), (FAST, 2e-5)])
def test_standstill_under_load_stays_at_rest(relieved: StageModel, level: int, drift: float) -> None:
    """The static start is the equilibrium of the step; rows and modal states of single precision hold it to their
    rounding."""
    trace = simulate(relieved, Steady(relieved, 0.0, LOAD), 0.01, H, {"level": level})
    for channel in ("mesh.force", "mesh.te", "bearing.pinion.fy", "bearing.wheel.fy", "pinion.tau", "wheel.tau"):
        values = trace[channel]
        assert np.ptp(values) < drift * np.abs(values).max(), channel
    assert trace["mesh.force"][0] > 8000 and trace["solver.retried_steps"][-1] == 0


def test_a_run_that_stops_keeps_its_samples(relieved: StageModel, tmp_path: Path) -> None:
    """From 3 ms on the pinion's shaft end is turned by 100 rad per step: a named outcome, and the good part of the
    run."""
    calm = Steady(relieved, SPEED, LOAD)

    def inputs(time: float) -> dict[str, float]:
        values = dict(calm(time))
        return values if time < 3e-3 else values | {"pinion.phi": 100.0 * time / H}

    trace = simulate(relieved, inputs, 0.01, H, {"level": FAST})
    assert trace.meta["outcome"] in {"penetration", "diverged", "energy"}
    assert 3e-3 <= trace.meta["simulated_s"] == trace.time[-1] < 0.01
    assert all(np.all(np.isfinite(trace[name])) for name in trace.channels)
    trace.save(tmp_path / "trace.h5")
    assert Trace.load(tmp_path / "trace.h5").meta["outcome"] == trace.meta["outcome"]


def test_meta_of_a_run_needs_nobody_to_complete_it(steady: Trace, relieved: StageModel) -> None:
    """The residual is relative, orders and stage can be found again: the report of a trace made in Python."""
    work, stored = abs(steady["energy.work"]).max(), steady["energy.stored"].max()
    assert steady.meta["energy_residual"] == steady["energy.residual"][-1] / (work + stored)
    assert abs(steady.meta["energy_residual"]) < 1e-2 and steady.meta["H"] == H
    assert [gear for gear, *_ in steady.meta["meshes"].values()] == ["pinion"]
    assert load_stage(steady.meta["stage"]) == load_stage(steady.meta["stage_path"]) == relieved.stage


# ---- along a torque and a speed over time ----------------------------------------------------------------------------
RPM = np.pi / 30


@pytest.fixture(scope="module")
def model():
    return gf.assemble("fzg_c")


def written(folder: Path, text: str) -> Path:
    (folder / "profile.csv").write_text(text, encoding="utf-8")
    return folder / "profile.csv"


def test_a_ramp_in_a_file_is_the_run_up_to_an_end_speed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the command line, torque as option and as column; the same arithmetic but for rounding."""
    line = ["simulate", "fzg_c", "--settle", "1 ms", "--set", "level=rigid"]
    torque, ramp = ["--torque", "150 N*m"], ["--speed", "2000 rpm", "--end-speed", "2600 rpm", "--duration", "10 ms"]
    only = written(tmp_path, "time_[ms], speed_[rpm]  # of the pinion\n0, 2000\n\n10, 2600\n")
    both = tmp_path / "both.csv"
    both.write_text("speed [rad/s],torque [kN*m],time [s]\n" + f"{2000 * RPM!r},.15,0\n{2600 * RPM!r},.15,.01\n")
    traces = []
    for k, how in enumerate(([*torque, *ramp], [*torque, "--profile", only], ["--profile", both])):
        assert cli.outcome([*line, *map(str, how), "--out", str(tmp_path / str(k))]) == 0, capsys.readouterr().err
        traces.append(gf.Trace.load(tmp_path / str(k) / "trace.h5"))
    first, *others = traces
    assert first.meta["scene"] == "run-up under constant torque"
    for other in others:
        assert other.meta["scene"] == "torque and speed over time" and other.time.size == first.time.size == 501
        for name in ("mesh.force", "mesh.te", "pinion.tau", "bearing.wheel.fy", "wheel.gear.w"):
            scale = np.abs(first[name]).max()
            assert np.abs(other[name] - first[name]).max() < 1e-7 * scale, name
    assert abs(first["pinion.gear.w"][-1] / (2600 * RPM) - 1) < 0.01, "it did gather speed"


def test_speeds_are_the_slopes_of_the_angles(model) -> None:
    torque = Line(np.array([0.0, 0.1, 0.3]), np.array([50.0, 300.0, 120.0]))
    speed = Line(np.array([0.0, 0.2, 0.25]), np.array([100.0, 140.0, 90.0]))
    inputs, d = Profiled(model, torque, speed), 1e-5
    for time in (0.031, 0.152, 0.221, 0.281, 0.4):
        before, now, after = (inputs(time + side * d) for side in (-1, 0, 1))
        for port in ("pinion", "wheel"):
            slope = (after[f"{port}.phi"] - before[f"{port}.phi"]) / (2 * d)
            assert slope == pytest.approx(now[f"{port}.w"], rel=1e-8)
            assert (after[f"{port}.w"] - before[f"{port}.w"]) / (2 * d) == pytest.approx(now[f"{port}.a"], abs=1e-4)
    steady = Steady(model, 0.0, 300.0).winding
    assert inputs.winding.at(300.0)[0] == pytest.approx(steady, rel=1e-12), "exact at the points"
    between = replace(Steady(model, 0.0, 0.0), torque=213.0).winding
    assert inputs.winding.at(213.0)[0] == pytest.approx(between, rel=2e-3), "and near them between"


def test_lines_integrate_and_stay_outside() -> None:
    line = Line(np.array([0.0, 1.0, 3.0]), np.array([2.0, 4.0, 0.0]))
    assert line.at(0.5) == pytest.approx((3.0, 2.0, 1.25)) and line.at(2.0) == pytest.approx((2.0, -2.0, 6.0))
    assert line.at(1.0) == pytest.approx((4.0, -2.0, 3.0)) and line.at(5.0) == pytest.approx((0.0, 0.0, 7.0))
    assert line.at(-1.0) == pytest.approx((2.0, 0.0, -2.0))
    assert list(winding_torques(np.array([-10.0, 10.0]))) == [-10, -7.5, -5, -2.5, -0.2, 0.2, 2.5, 5, 7.5, 10]
    assert list(winding_torques(np.array([3.0, 3.0]))) == [3.0]


def test_everything_that_is_wrong_with_a_file_is_said_at_once(tmp_path: Path) -> None:
    text = "time_[s],torque_[N],speed,angle_[rad]\n0,1,2,3\n1,x,2\n"
    with pytest.raises(SpecError) as refused:
        read_profile(written(tmp_path, text))
    said = str(refused.value)
    for words in (
        "torque_[N]: ",
        "is a unit of another kind",
        "speed: the unit is missing",
        "line 3",
        "3 values",
    ):
        assert words in said.replace(" = ", ": "), (words, said)
    with pytest.raises(SpecError) as refused:
        read_profile(written(tmp_path, "time_[s],torque_[N*m]\n0,1\n1,abc\n2,nan\n"))
    assert len(refused.value.problems) == 2 and "line 3, torque" in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds no rows"),
        ("torque_[N*m]\n1\n2\n", "there is no time"),
        ("time_[s]\n0\n1\n", "neither torque nor speed"),
        ("time_[s],speed_[rpm],speed_[rad/s]\n0,1,1\n1,1,1\n", "speed is there twice"),
        ("time_[s],speed_[rpm]\n0,1\n", "at least two points"),
        ("time_[s],speed_[rpm]\n0,1\n2,1\n1,5\n", "sort the points"),
        ("time_[s],speed_[rpm]\n0,1\n2,1\n2,5\n", "two points at one time: for a step"),
        ("time_[s],torqe_[N*m]\n0,1\n2,1\n", "did you mean torque"),
        ("time_[s],speed_[rpm]\n0,0,1\n0,5,2\n", "with decimal commas, separate the columns by semicolons"),
        ("time_[s];speed_[rpm]\n0;1\n0,5;1.234,5\n", "expected a finite number"),
        ("\xff\xfe\x00", "not UTF-8"),
    ],
)
def test_files_that_are_no_profile(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(SpecError, match=words):
        read_profile(tmp_path / "x.csv")
    with pytest.raises(SpecError, match="cannot be read"):
        read_profile(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("time_[s],torque_[N*m],speed_[rpm]\n0,1.5,100\n0.25,-2,1e3\n", "utf-8-sig"),
        ("time_[s],torque_[N*m],speed_[rpm]\r\n0,1.5,100\r\n0.25,-2,1e3\r\n", "utf-8"),
        ("time_[s];torque_[N*m];speed_[rpm]\r\n0;1,5;100\r\n0,25;-2,0;1000,0\r\n", "utf-8-sig"),
        ("time_[s];torque_[N*m];speed_[rpm];;\n0;1.5;100;;\n;;;;\n0.25;-2;1000;;\n", "utf-8"),
        ("time_[s]\ttorque_[N*m]\tspeed_[rpm]\n0\t1,5\t100\n0,25\t-2\t1e3\n", "utf-8"),
        ('"time_[s]","torque_[N*m]","speed_[rpm]"\n"0","1,5","100"\n"0,25","-2","1e3"\n', "utf-8"),
        ("Time (s);Torque (N*m);Oil (degC);Speed (1/min)\n12,5;1,5;80,5;100\n12,75;-2;81;1000\n", "utf-8"),
        ("Time\tTorque\tSpeed\tRemark\ns\tNm\trpm\t\n12.5\t1.5\t100\tstart\n12.75\t-2\t1000\tend\n", "utf-8"),
        ("TIME [ms],SPEED [U/min],TORQUE [kN*m]\n0,100,0.0015\n250,1000,-0.002\n", "utf-8"),
    ],
    ids="mark,line ends,semicolons and commas,empty columns,tabs,quotes,running clock,units below,capitals".split(","),
)
def test_a_profile_reads_the_same_however_it_is_written(text: str, encoding: str, tmp_path: Path) -> None:
    """By an office or a measuring program. Semicolons with decimal commas and empty columns at the end were refused as
    incomplete rows."""
    (tmp_path / "x.csv").write_bytes(text.encode(encoding))
    found = read_profile(tmp_path / "x.csv")
    assert found.time.tolist() == [0.0, 0.25] and found.torque == pytest.approx([1.5, -2.0], rel=1e-15)
    assert found.speed == pytest.approx(np.array([100.0, 1000.0]) * RPM, rel=1e-15)


def test_what_is_missing_or_said_twice_is_refused(model, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    speed = Profile(np.array([0.0, 1.0]), speed=np.array([1.0, 2.0]))
    with pytest.raises(SpecError, match="needs a torque.*column in the profile"):
        gf.simulate(model, profile=speed)
    with pytest.raises(SpecError) as refused:
        gf.simulate(model, speed=("100 rpm", "200 rpm"), profile=speed)
    assert [problem.field for problem in refused.value.problems] == ["torque", "speed", "end_speed"]
    assert cli.outcome(["simulate", "fzg_c", "--speed", "10 rpm"]) == cli.USAGE_ERROR
    assert "--torque" in capsys.readouterr().err


def test_the_largest_torque_of_a_profile_is_held_against_the_limit(model) -> None:
    torque = Profile(np.array([0.0, 1e-3, 2e-3]), torque=np.array([100.0, -700.0, 100.0]))
    trace = gf.simulate(model, speed="1000 rpm", profile=torque, level="rigid")
    assert any("700 N·m on the pinion is beyond torque_max" in text for text in trace.meta["warnings"])


def test_a_set_on_torque_ports_is_driven_through_the_springs_of_its_file() -> None:
    """The same model as assembled with spring ports; torques in balance. A shaft without k and c is refused."""
    model = gf.assemble("planetary54")
    springs = gf.assemble("planetary54", ports={"carrier": "spring", "sun": "spring"})
    assert model.driven_by_springs().hash == springs.hash and springs.driven_by_springs() is springs
    trace = gf.simulate(model, 400.0, 50.0, "2 ms", settle="1 ms", level="rigid").window(1e-3)
    assert trace["sun.tau"].mean() == pytest.approx(100.0, rel=1e-3)
    assert trace["sun.gear.w"].mean() == pytest.approx(200.0, rel=1e-3)
    bare = replace(model, stage=with_ports(model.stage, {"sun": PortSpec(kind="torque")}))
    with pytest.raises(gf.GearfmuError, match=r"ports.sun = torque: write k and c of its shaft"):
        gf.simulate(bare, 400.0, 50.0, "1 ms")
