"""Plans that were made before, by what decides them: model, scene, outputs, budget, kernel."""

from __future__ import annotations

import os
from pathlib import Path

from gearfmu.errors import SpecError
from gearfmu.planning.book import Plan

FOLDER = "GEARFMU_CACHE"  # environment variable


def folder() -> Path:
    """Where plans are kept: $GEARFMU_CACHE/plans, or the user's cache folder."""
    home = os.environ.get(FOLDER) or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gearfmu"
    return Path(home) / "plans"


def find(identity: str) -> Plan | None:
    """The plan of this identity, None where there is none that can be read."""
    try:
        return Plan.load(_path(identity))
    except SpecError:
        return None


def keep(plan: Plan) -> Plan:
    """The plan, also in the cache; a folder that cannot be written keeps nothing."""
    try:
        plan.save(_path(plan.identity))
    except OSError:
        pass
    return plan


def _path(identity: str) -> Path:
    return folder() / f"{identity[:32]}.toml"
