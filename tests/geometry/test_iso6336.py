"""Mesh stiffness of ISO 6336-1 by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

import gearfmu as gf
from gearfmu.geometry.iso6336 import mesh_stiffness


def test_a_spur_pair_by_hand() -> None:
    """FZG type C, z 16/24, x 0.1817/0.1715: q' = 0.04723 + 0.15551/16 + 0.25791/24 − 0.00635·0.1817
    − 0.11654·0.1817/16 − 0.00193·0.1715 − 0.24188·0.1715/24 + 0.00529·0.1817² + 0.00182·0.1715² = 0.063387 mm µm/N."""
    pair = gf.load("fzg_c").written.geometry
    single = 0.8 / 0.063387 * (1 + 0.5 * (1.2 - 1.25))
    assert mesh_stiffness(pair) == pytest.approx(1e9 * single * (0.75 * pair.contact_ratio + 0.25), rel=1e-3)
    assert mesh_stiffness(pair, modulus=103e9) == pytest.approx(0.5 * mesh_stiffness(pair))
    assert mesh_stiffness(pair, dedendum=1.2) == pytest.approx(mesh_stiffness(pair) / 0.975)


def test_te_shows_it_beside_its_own() -> None:
    result = gf.te("fzg_c", 302.0, 4)
    assert result.iso_stiffness == pytest.approx(14e-3 * mesh_stiffness(gf.load("fzg_c").written.geometry))
    assert "c_gamma times face width 225.5 N/µm" in repr(result), "teeth stiffer than ISO's need no reason"
    softer = replace(result, mesh_stiffness=0.5 * result.mesh_stiffness)
    assert "averaging bores lose their shape" in " ".join(repr(softer).split())
