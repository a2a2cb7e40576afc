"""Every example runs as it stands, and one number of it is right."""

from __future__ import annotations

import re
import runpy
import wave
from pathlib import Path

import numpy as np
import pytest
from verbs import call, example

from gearfmu.body import load_bodies
from gearfmu.stage.run.trace import Channel, Trace
from gearfmu.stagefile.stage import load_stage

ROOT = Path(__file__).resolve().parents[1]
BASE_RADIUS = 0.5 * 4.5e-3 * 16 * 0.9396926207859084  # m, pinion of fzg_c


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"(?<![\w.])-?\d+\.?\d*(?![\w.])", text)]


@pytest.mark.parametrize("arguments", [("drive_with_fmpy.py",), ("stage_in_ssp.py", ".")], ids=["fmpy", "ssp"])
def test_a_pair_at_rest(arguments: tuple[str, ...], tmp_path: Path) -> None:
    """Mesh force is torque over base radius, and the held wheel carries 24/16 of the torque."""
    te, force, torque = numbers(example(*arguments, cwd=tmp_path).splitlines()[-1])
    assert force == pytest.approx(302 / BASE_RADIUS, rel=5e-3)
    assert abs(torque) == pytest.approx(302 * 24 / 16, rel=5e-3)
    assert 50 < te < 200


def test_loaded_te(tmp_path: Path) -> None:
    """Tip relief of 15 µm removes material: more mean transmission error at the same load."""
    plain, relieved = example("loaded_te.py", tmp_path, cwd=tmp_path).splitlines()
    assert "fzg_c:" in plain and "fzg_c_relief:" in relieved
    mean = [float(re.search(r"mean ([\d.]+)", line)[1]) for line in (plain, relieved)]
    assert mean[0] < mean[1] < mean[0] + 15
    assert all(
        (tmp_path / f"harris_{name}.png").read_bytes().startswith(b"\x89PNG") for name in ("fzg_c", "fzg_c_relief")
    )


def test_fmu_with_fmpy(tmp_path: Path) -> None:
    """The clutch locks, and the load then turns with the engine, over the ratio of the teeth, the other way round."""
    lock, speed = numbers(example("fmu_with_fmpy.py", tmp_path, cwd=tmp_path).splitlines()[-1])
    assert 20 < lock < 200 and speed == pytest.approx(-100 * 16 / 24, rel=0.05)
    assert (tmp_path / "clutch.png").stat().st_size > 10_000


def test_standalone_run_up(tmp_path: Path) -> None:
    """On average the mesh carries the torque all the way up; inertia of the gears takes less than a percent of it."""
    force, swing, rpm = numbers(example("standalone_run_up.py", tmp_path, cwd=tmp_path).splitlines()[-1])
    assert force == pytest.approx(150 / BASE_RADIUS, rel=2e-2)
    assert 100 < swing < force and 300 < rpm < 6000
    assert (tmp_path / "run_up.png").stat().st_size > 10_000


@pytest.mark.full
def test_own_stage(tmp_path: Path) -> None:
    """One tooth more at the wheel: more contact ratio, nearly the same transmission error."""
    before, after = example("own_stage.py", tmp_path, cwd=tmp_path).splitlines()[-2:]
    ratio, mean = (
        [float(re.search(pattern, line)[1]) for line in (before, after)]
        for pattern in (r"ratio ([\d.]+)", r"mean ([\d.]+)")
    )
    assert 0 < ratio[1] - ratio[0] < 0.02 and mean[1] == pytest.approx(mean[0], rel=0.05)


def test_read_a_trace(tmp_path: Path) -> None:
    """Mesh orders of a pair at 2000 rpm are multiples of 16 · 2000/60 Hz."""
    order = "simulate fzg_c --torque 302~N*m --speed 2000~rpm --duration 0.05~s --set level=fast --out".split()
    assert call(*(word.replace("~", " ") for word in order), tmp_path)[0] == 0
    text = example("read_a_trace.py", tmp_path / "trace.h5", cwd=tmp_path)
    first = re.search(r"mesh order 1: +(-?[\d.]+) dB re 1 N at (\d+) Hz", text)
    assert first and float(first[2]) == pytest.approx(16 * 2000 / 60, abs=2)


def test_a_run_is_heard_at_its_level(tmp_path: Path) -> None:
    """A tone of 40 N: 29.0 dB re 1 N, full scale 1 dB above its peak."""
    time = np.arange(25_000) * 2e-5
    tone = Channel(900 + 40 * np.sin(2 * np.pi * 950 * time), "N")
    Trace(time, {"bearing.pinion.fy": tone}, {}).save(tmp_path / "trace.h5")
    text = example("hear_a_run.py", tmp_path / "trace.h5", "bearing.pinion.fy", tmp_path / "s.wav", cwd=tmp_path)
    rms, full = (float(re.search(pattern, text)[1]) for pattern in (r"([\d.]+) dB", r"peak of ([\d.]+)"))
    assert rms == pytest.approx(20 * np.log10(40 / np.sqrt(2)), abs=0.35)  # ends, where the average reaches out
    assert full == pytest.approx(45, rel=0.15)
    with wave.open(str(tmp_path / "s.wav")) as file:
        assert (file.getframerate(), file.getnframes()) == (48_000, 24_000)


def test_a_pickup_on_the_ring_hears_the_planets_pass(tmp_path: Path) -> None:
    """A mode under a ramp, against the closed form: q' = (1 − e^(−ζωt) (cos ω_d t + ζω/ω_d sin ω_d t))/ω². Four planets
    in alternating phase at 54 orders of the carrier: 52 and 56 are heard, 54 is not (McFadden and Smith, Proc. IMechE
    199 (1985) 65)."""
    example("ring_pickup.py", recorded(tmp_path), cwd=tmp_path)
    pickup = runpy.run_path(str(ROOT / "examples" / "ring_pickup.py"), run_name="pickup")
    omega, zeta, t = 700.0, 0.02, 1e-4 * np.arange(2000)
    damped = omega * np.sqrt(1 - zeta**2)
    swing = np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    exact = (1 - swing) / omega**2
    found = pickup["modal_velocity"](t, 1e-4, omega, zeta)
    assert np.allclose(found, exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())
    turns, step = 20, 2e-5  # a whole number of turns of the carrier, at 20 turns a second
    angle = 2 * np.pi * 20 * step * np.arange(round(turns / 20 / step))
    forces = {f"p{k}": 1000.0 + 50.0 * (-1) ** k * np.cos(54.0 * angle) for k in range(4)}
    angles = {f"p{k}": angle + 0.5 * np.pi * k for k in range(4)}
    velocity = pickup["rim_velocity"](load_bodies(load_stage("planetary54"))[2], step, forces, angles)
    half = velocity[velocity.size // 2 :]
    order = np.abs(np.fft.rfft(half))[[10 * k for k in (52, 53, 54, 55, 56)]]
    assert min(order[0], order[4]) > 30 * order[1:4].max(), order


def recorded(folder: Path) -> Path:
    """A run of the set in a file, the forces of the ring alone."""
    time = np.arange(2000) * 2e-5
    channels = {f"ring_planet{k + 1}.force": Channel(1000 + 50 * np.sin(7e3 * time + k), "N") for k in range(4)}
    Trace(time, channels | {"carrier.gear.phi": Channel(85.0 * time, "rad")}, {}).save(folder / "trace.h5")
    return folder / "trace.h5"


def test_every_example_has_its_test() -> None:
    tested = set(re.findall(r'"(\w+\.py)"', Path(__file__).read_text(encoding="utf-8")))
    assert tested == {path.name for path in (ROOT / "examples").glob("*.py")}


def test_planetary_sharing(tmp_path: Path) -> None:
    """Planets in their places carry alike; one that is ahead carries more, the others alike less."""
    alike, apart = (numbers(line)[-4:] for line in example("planetary_sharing.py", cwd=tmp_path).splitlines())
    assert alike == pytest.approx([1.0] * 4, abs=5e-3)
    assert apart[0] > 1.05 and apart[1] == pytest.approx(apart[3], abs=5e-3) and apart[1] < 0.98
    assert apart[2] == pytest.approx(apart[1], abs=0.02)  # the ring is soft against an oval
