"""Vibration modes: of one body with their shapes, and of the linearised stage."""

from __future__ import annotations

from gearfmu.modes.shapes import BodyModes, Mode

__all__ = ["BodyModes", "Mode"]
