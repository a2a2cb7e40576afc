"""Radiated sound: skin of a body, boundary elements, radiation matrix, sound power, third octaves."""

from gearfmu.sound.boundary import memory_needed
from gearfmu.sound.levels import BANDS, a_weighting, bands_of, level, midbands, nominal, third_octaves
from gearfmu.sound.power import WIDTH, SoundPower, power_of, radiated, segments
from gearfmu.sound.radiation import Radiation, radiation
from gearfmu.sound.skin import Skin, SoundError, envelope, refined, skin_of

__all__ = [
    "BANDS",
    "WIDTH",
    "Radiation",
    "Skin",
    "SoundError",
    "SoundPower",
    "a_weighting",
    "bands_of",
    "envelope",
    "level",
    "memory_needed",
    "midbands",
    "nominal",
    "power_of",
    "radiated",
    "radiation",
    "refined",
    "segments",
    "skin_of",
    "third_octaves",
]
