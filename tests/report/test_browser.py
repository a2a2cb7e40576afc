"""Pages as Chromium shows them: drawn, without errors, at 420 px too; what is shown is what was computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gearfmu as gf
from evidence.pictures.browser import Browser
from gearfmu.body import load_bodies
from gearfmu.femesh.mesh import rotated
from gearfmu.report import html as report
from gearfmu.report.moving import _unit_loads, moving_view
from gearfmu.stage.assembly.observed import gear_bodies
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.stage import load_stage
from gearfmu.sweeps.page import write_page

pytestmark = [pytest.mark.full, pytest.mark.needs("chromium")]


@pytest.fixture(scope="module")
def trace() -> Trace:
    return gf.simulate("fzg_c/stage_relief", "302 N*m", "2000 rpm", duration="0.06 s", level="fast")


@pytest.fixture(scope="module")
def page(trace: Trace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    trace.meta["stage"] = "fzg_c/stage_relief"
    return gf.write_report(trace, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def opened(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(page)
        browser.draw_all()
        yield browser


def test_every_figure_is_drawn_without_an_error(opened: Browser) -> None:
    places = opened.value("document.querySelectorAll('.plot').length")
    assert places > 15 and opened.value("gearfmuPage.drawn") == places
    assert opened.value("document.querySelectorAll('.plot .main-svg').length") >= places
    assert opened.errors == [] and opened.value("gearfmuPage.errors") == []


@pytest.mark.parametrize("width", [420, 1280])
def test_nothing_hangs_over_the_edge(page: Path, tmp_path: Path, width: int) -> None:
    with Browser(tmp_path, width, 900) as browser:
        browser.open(page)
        browser.draw_all()
        assert browser.value("document.documentElement.scrollWidth") <= width
        wide = "[...document.querySelectorAll('section')].filter(s => s.getBoundingClientRect().right > innerWidth)"
        assert browser.value(f"{wide}.length") == 0 and browser.errors == []


def of_set(trace: Trace, folder: Path) -> Path:
    own = gf.simulate("planetary54", "600 N*m", "85 rad/s", duration="10 ms", level="fast")
    return report.write(own, own.meta, folder)


def of_sweep(trace: Trace, folder: Path) -> Path:
    write_page(gf.sweep("fzg_c", {"torque": [50.0, 100.0], "positions": [4, 8]}, folder, on=1), "fzg_c", folder)
    return folder / "sweep.html"


def of_comparison(trace: Trace, folder: Path) -> Path:
    return gf.compare({"a": trace, "b": trace}, folder / "page.html")


@pytest.mark.parametrize("page_of", [of_set, of_sweep, of_comparison])
def test_other_pages_are_drawn_and_fit_a_telephone(
    page_of: Callable[[Trace, Path], Path], trace: Trace, tmp_path: Path
) -> None:
    with Browser(tmp_path / "profile", 420, 900) as browser:
        browser.open(page_of(trace, tmp_path))
        browser.draw_all()
        assert browser.value("document.documentElement.scrollWidth") <= 420 and browser.errors == []
        assert browser.value("gearfmuPage.drawn") == browser.value("document.querySelectorAll('.plot').length") > 0


def test_a_zoomed_curve_shows_the_samples_and_the_other_figures_follow(opened: Browser, trace: Trace) -> None:
    opened.value("Plotly.relayout(document.getElementById('mesh.0'), {'xaxis.range': [0.03, 0.032]}).then(() => 1)")
    opened.value("new Promise(done => setTimeout(done, 300)).then(() => 1)")
    x, y = opened.value("(d => [Array.from(d.x), Array.from(d.y)])(document.getElementById('mesh.0').data[0])")
    part = trace.window(0.03, 0.032)
    shown = np.interp(part.time, x, y)
    assert np.abs(shown - 1e-3 * part["mesh.force"]).max() < 1e-4 * np.ptp(1e-3 * trace["mesh.force"])
    assert opened.value("document.getElementById('bearing.1').layout.xaxis.range") == pytest.approx([0.03, 0.032])
    assert opened.value("document.getElementById('spectrum.0').layout.xaxis.range[0]") == 0


def displaced(body: Any, loads: list[tuple[int, float, float]]) -> np.ndarray:
    """(P, 3) m under forces (N) at rolls (m) of teeth: unit loads between stored rolls, turned from tooth 0."""
    rolls, unit = _unit_loads(body.picture)
    total = np.zeros(unit.shape[2:])
    for tooth, roll, force in loads:
        place = np.interp(roll, rolls, np.arange(rolls.size))
        low = min(int(place), rolls.size - 2)
        own = unit[0 if force > 0 else 1, low : low + 2]
        field = (own[0] + (place - low) * (own[1] - own[0])).reshape(body.flank.teeth, -1, 3)
        turn = rotated(np.roll(field, tooth, axis=0).reshape(-1, 3), 2 * np.pi * tooth / body.flank.teeth)
        total -= abs(force) * turn
    return total


def test_the_turning_view_moves_by_the_displacement_under_its_loads(opened: Browser, trace: Trace) -> None:
    """The script's sum of unit loads is the one that Python makes, within the steps in which they are stored."""
    spec = load_stage("fzg_c/stage_relief")
    stage, bodies = spec, gear_bodies(spec, load_bodies(spec))
    start, end = opened.value("gearfmuPage.stage.run(false), gearfmuPage.stage.state.at = 40, gearfmuPage.stage.span")
    view = moving_view(trace, stage, bodies, (start, end))
    assert view is not None
    apart = []
    for body in view.bodies:
        tooth, roll, force = (values[40] for values in body.contacts["mesh"])
        loads = [(int(k), float(s), float(f)) for k, s, f in zip(tooth, roll, force, strict=True) if f]
        wanted = displaced(bodies[body.name], loads)
        found = np.array(opened.value(f"gearfmuPage.stage.displaced('{body.name}')")).reshape(-1, 3)
        apart.append(float(np.abs(found - wanted).max() / np.abs(wanted).max()))
    print(f"largest error over the largest displacement: {apart}")
    assert max(apart) < 0.02


def test_the_turning_view_is_shown_with_its_time_and_scale_once_it_is_drawn(opened: Browser) -> None:
    assert opened.value("document.querySelector('#stage').classList.contains('drawn')")
    assert opened.value("getComputedStyle(document.querySelector('#stage .wait')).visibility") == "hidden"
    assert "µm" in opened.value("document.querySelector('.legend').textContent")
    time = opened.value("document.querySelector('#stage output').textContent")
    assert time.removesuffix(" ms").replace(".", "").isdigit(), time


def test_it_turns(opened: Browser) -> None:
    opened.value("gearfmuPage.stage.state.at = 0, gearfmuPage.stage.run(true), 1")
    seen = "gearfmuPage.stage.state.at > 1 || performance.now() > end"
    look = f"const end = performance.now() + 20000, look = () => {seen} ? done() : setTimeout(look, 50)"
    opened.value(f"new Promise(done => {{ {look}; look(); }}).then(() => 1)")
    assert opened.value("gearfmuPage.stage.state.at") > 1
    opened.value("gearfmuPage.stage.run(false), 1")
