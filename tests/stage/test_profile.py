"""Runs of a stage alone along a torque and a speed over time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.errors import SpecError
from gearfmu.stage.run.simulate import Steady
from gearfmu.stage.run.steady import Line, Profiled, winding_torques
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.tables.connections import PortSpec
from gearfmu.stagefile.tables.profile import Profile, read_profile

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
