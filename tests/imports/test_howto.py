"""Deck and section of docs/howto-import.md; its chain runs in tests/test_own_stage.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from verbs import call

ROOT = Path(__file__).resolve().parents[2]
DECK = ROOT / "examples" / "imported_pinion" / "pinion.inp"


def test_the_deck_of_the_page_is_the_one_that_mesh_writes(tmp_path: Path) -> None:
    command = re.search(r"`gearfmu (mesh fzg_c .*?)`", (ROOT / "docs" / "howto-import.md").read_text(encoding="utf-8"))[
        1
    ]
    assert call(*command.split(), "--out", tmp_path)[0] == 0
    assert (tmp_path / "pinion.inp").read_text(encoding="utf-8") == DECK.read_text(encoding="utf-8")


def test_import_prints_the_section(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = call("import", DECK, "fzg_c", "pinion", "--length", "1 mm", "--bore", "BORE")
    assert code == 0 and '[gears.pinion.import]\nfile = "pinion.inp"\nlength = "1 mm"\nbore = "BORE"' in out
    assert re.search(r"base_radius_m +0\.0338289", out) and re.search(r"method +cyclic", out)
    assert not list(tmp_path.iterdir())
