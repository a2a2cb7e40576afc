"""Radiation matrix R(f) of a body's coordinates: sound power W = ½ q̇ᴴ R q̇ of the velocities q̇ (peak amplitudes)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearfmu.sound.boundary import Surface, memory_needed, surface_of
from gearfmu.sound.levels import BANDS, midbands
from gearfmu.sound.skin import Skin, SoundError, refined

PANELS = 6  # patches a wavelength at least
COUNT = 1500  # patches
SPEED = 343.2  # m/s, of sound in air of 20 °C and 101.325 kPa
IMPEDANCE = 1.204 * SPEED  # ρc of it, N·s/m³
MEMORY = 4e9  # bytes that boundary elements may take


@dataclass(frozen=True)
class Radiation:
    """frequency (L,) Hz, ascending; resistance (L, N, N) N·s/m, symmetric, not negative; gram (N, N) m²: integral of
    products of normal displacements over the skin, so ρc · gram is the resistance of equivalent radiated power (ERP);
    impedance ρc; reach Hz: lines above it are ERP; balance (L,) dB: power that leaves the skin over that of the far
    field, mean over coordinates: how well the mesh solves the line, 0 above the reach; patches: asked for."""

    frequency: np.ndarray
    resistance: np.ndarray
    gram: np.ndarray
    impedance: float
    reach: float
    balance: np.ndarray
    patches: int = COUNT

    def of(self, count: int) -> Radiation:
        """That of the first `count` coordinates alone."""
        own = self.resistance[:, :count, :count], self.gram[:count, :count]
        return replace(self, resistance=own[0], gram=own[1])


def radiation(skin: Skin, lines: np.ndarray | None = None, count: int = COUNT) -> Radiation:
    """R of a skin's coordinates by boundary elements at the frequencies `lines` (Hz), third octaves from 63 Hz to 8 kHz
    when None. Above six patches a wavelength R = ρc ∫ φ_n φ_nᵀ dS, its limit for short waves.

    count : patches at most: coarse triangles are halved and fine ones joined until there are about so many.
    Raises SoundError, before anything is allocated, when it would take more than MEMORY.
    """
    lines = midbands(*BANDS) if lines is None else np.asarray(lines, dtype=float)
    need = memory_needed(count, skin.shapes.shape[2])
    if need > MEMORY:
        raise SoundError(f"{count} patches take {need / 1e9:.2f} GB, more than {MEMORY / 1e9:.2f}: take fewer patches")
    edge = np.sqrt(np.linalg.norm(skin.normals, axis=1).sum() / count)
    surface = surface_of(refined(skin, 2 * edge), count)
    gram, reach = skin.gram, SPEED / (PANELS * surface.edge)
    found, balance = [], []
    for line in lines:
        own, decibel = (gram, 0.0) if line > reach else _at(surface, 2 * np.pi * line / SPEED, gram)
        found.append(IMPEDANCE * own)
        balance.append(decibel)
    resistance = np.array(found, dtype=np.float32)
    return Radiation(lines, resistance, gram, IMPEDANCE, reach, np.array(balance), count)


def _at(surface: Surface, k: float, gram: np.ndarray) -> tuple[np.ndarray, float]:
    """R/ρc at one wave number and the balance, dB."""
    pressure = surface.pressure(k)
    far, scale = surface.resistance(k, pressure), np.maximum(np.diag(gram), 1e-300)
    ratio = (np.diag(surface.near(pressure)) / scale).sum() / (np.diag(far) / scale).sum()
    return far, float(10 * np.log10(ratio)) if ratio > 0 else float("inf")
