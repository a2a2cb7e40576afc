"""Verbs write to pipes of any code page: what an encoding lacks is written in ASCII, and nothing crashes."""

from __future__ import annotations

import io
import re
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest

from gearfmu import cli
from gearfmu.commands.console import plain
from gearfmu.stage.run.trace import Channel, Trace

ROOT = Path(__file__).resolve().parents[1]
PAIR = ROOT / "examples" / "rexs" / "fzg_c.rexs"
VERBS = {
    "inspect": ["inspect", "fzg_c"],
    "schema": ["schema", "stage"],
    "new": ["new", "made", "--rexs", str(PAIR)],
    "refused": ["new", "no", "--teeth", "17 9", "--module", "2 mm", "--width", "20 mm", "--center", "10 mm"],
    "bad stage": ["te", "bad.toml"],
    "effects": ["effects"],
    "trace": ["inspect", "trace.h5"],
    "report": ["report", "."],
    **{f"help of {verb}": [verb, "--help"] for verb in cli.VERBS},
}


def written(encoding: str, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> tuple[int, str]:
    """Exit code of a verb and what it writes to standard output and error of this encoding. Where click finds ASCII it
    writes UTF-8."""
    streams = [io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2)]
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", streams[0])
        patch.setattr(sys, "stderr", streams[1])
        code = cli.outcome(list(arguments))
    for stream in streams:
        stream.flush()
    raw = b"".join(stream.buffer.getvalue() for stream in streams)
    return code, raw.decode("utf-8" if encoding == "ascii" else encoding)


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_what_verbs_write(encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same text as in UTF-8 but for the signs that are spelled out. `effects` ended in an internal error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text('kind = "external_pair"\nname = "Ω → 2 µm"\n', encoding="utf-8")
    t = np.arange(2000) * 1e-4
    force = Channel(1000 + 100 * np.sin(2 * np.pi * 300 * t), "N", "Kraft → Ω·ν")
    Trace(t, {"mesh.force": force}, {"scene": "klein ≤ 5 ν", "outcome": "ok"}).save(tmp_path / "trace.h5")
    for name, arguments in VERBS.items():
        code, text = written(encoding, monkeypatch, *arguments)
        if name == "new":
            (tmp_path / "made" / "stage.toml").unlink()
        wanted, full = written("utf-8", monkeypatch, *arguments)
        assert code == wanted and "internal error" not in text, name
        assert text.count("?") == full.count("?"), name


def test_no_sign_of_the_product_is_lost() -> None:
    """Every character in the sources has an ASCII text: none would be written as a question mark."""
    files = [path for ending in ("py", "inc", "toml") for path in (ROOT / "gearfmu").rglob(f"*.{ending}")]
    signs = {sign for path in files for sign in re.findall(r"[^\x00-\x7f]", path.read_text(encoding="utf-8"))}
    assert len(signs) > 50
    assert not {f"{sign} {unicodedata.name(sign, '')}" for sign in signs if "?" in plain(sign)}
    assert "".join(sign if sign.isascii() else plain(sign) for sign in "2·ω₀ ≤ 5 µm → Δx²") == (
        "2*omega0 <= 5 um -> Deltax2"
    )
