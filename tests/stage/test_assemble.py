"""The model blob: equal inputs give equal bytes, and the tables hold what the bodies say."""

from __future__ import annotations

import numpy as np
import pytest
from dense import flank_rows, flank_supports
from flank_reader import full_tables

from gearfmu.body import load_bodies
from gearfmu.stage import assemble
from gearfmu.stage.assembly.assemble import general_sections, mount_sets
from gearfmu.stage.assembly.blob import SIZES, read_blob
from gearfmu.stage.assembly.compact import residual_sections
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stage.assembly.teeth import ROLLS, blend, resampling
from gearfmu.stagefile.stage import load_stage


def test_equal_inputs_give_equal_bytes(spec):
    hashes = {assemble.__wrapped__(spec, load_bodies(spec)).hash for _ in range(2)}  # tests/reuse.py would keep one
    assert len(hashes) == 1


@pytest.mark.parametrize("mirrored", [True, False])
def test_stored_tables_are_those_of_the_even_grid(mirrored: bool) -> None:
    """Points, halves and images spread over the grid by a reader of its own: helical gears, odd width functions."""
    stage = load_stage("helical_demo")
    bodies = load_bodies(stage)
    sections = general_sections(stage, bodies)
    layout = stage_layout(stage, bodies)
    group = mount_sets(layout)[1]
    for g in (0, 1):
        flank = layout.bodies[g].flank
        assert flank is not None and sections[f"size{g}"][SIZES.index("mirrored")] == 1
        if not mirrored:
            own = stage_layout(stage, bodies, points=[np.eye(body.flank.roll.size) for body in bodies])
            of_points = own.bodies[g].flank
            assert of_points is not None
            sections |= residual_sections(g, of_points.residual, sections["degrees"])
            sections[f"size{g}"][SIZES.index("mirrored")] = 0
        found, read = full_tables(sections, g, ROLLS, number=1), sections[f"ground_list{g}_1"]
        want = (flank.turning, flank_rows(group, g)[..., read], flank_supports(group, g), flank.residual)
        have = (found.rows, found.ground, found.supports, found.residual)
        errors = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(have, want, strict=True)]
        assert max(errors) < 1e-9


def test_bearings_are_damped_by_their_ratio_and_the_mass_of_the_body(spec):
    """c = 2 D √(k m)."""
    bodies = load_bodies(spec)
    sections = read_blob(assemble(spec, bodies).blob)
    assert sections["support_names"].split("|") == [f"bearing.{g.name}.f{d}" for g in spec.gears for d in "xy"]
    for index, body in enumerate(bodies):
        compliance, c = (sections[name].reshape(2, 2)[index] for name in ("support_compliance0", "damper0"))
        assert np.all(compliance == 1 / 3e8)
        assert c == pytest.approx(2 * 0.03 * np.sqrt(3e8 * body.total_mass), rel=1e-12)
    assert [body.total_mass for body in bodies] == pytest.approx([0.381, 0.885], rel=2e-3)


def test_resampling_is_exact_for_polynomials():
    roll = 0.5 + 0.5 * np.cos(np.pi * (np.arange(9)[::-1] + 0.5) / 9)
    weights = resampling(roll, 0.0, 1.0, 33)
    assert np.allclose(blend(weights, roll**8, 0), np.linspace(0, 1, 33) ** 8, atol=1e-13)
