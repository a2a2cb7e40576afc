"""Whether a stored body is the one that a stage asks for now."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gearfmu.body.layout import ALGORITHM_VERSION
from gearfmu.errors import BodyError


def refuse_stale(path: Path, body: Any, wanted_hash: str, source: Any) -> None:
    """BodyError when the body of this file (ReducedBody or InterfaceBody) has another fingerprint than the stage file
    `source` asks for: it says whether the program or the numbers are others."""
    if body.input_hash == wanted_hash:
        return
    if body.algorithm_version != ALGORITHM_VERSION:
        why = f"made by version {body.algorithm_version} of the reduction, this program has version {ALGORITHM_VERSION}"
    else:
        why = f"made from other numbers than {source} asks for now"
    raise BodyError(f"{path}: stale: {why}; make it again with 'gearfmu reduce STAGE'")
