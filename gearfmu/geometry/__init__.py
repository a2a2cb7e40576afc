"""Involute flank, trochoid root, pair geometry: pure functions of numbers (ISO 21771)."""

from __future__ import annotations

from gearfmu.geometry.gear import GearGeometry
from gearfmu.geometry.mesh import PairGeometry

__all__ = ["GearGeometry", "PairGeometry"]
