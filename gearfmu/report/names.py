"""Plain names beside the names of channels: "Transmission error" for mesh.te."""

from __future__ import annotations

import re

MESH = {
    "force": "Mesh force",
    "force_mean": "Mesh force, mean over the step",
    "force_max": "Mesh force, largest in the step",
    "force_drive": "Force on the flanks of positive mesh force",
    "force_coast": "Force on the flanks of negative mesh force",
    "te": "Transmission error",
    "contact": "Flanks in contact",
    "pairs": "Tooth pairs in contact",
    "impacts": "Impacts so far",
    "open_time": "Time without contact",
}
ENDS = {
    "gear.w": "Speed of the {}",
    "gear.phi": "Angle of the {}",
    "w": "Speed, {}",
    "phi": "Angle, {}",
    "tau": "Torque, {}",
    "tau_mean": "Torque, mean over the step, {}",
    "clutch.tau": "Clutch torque, {}",
    "clutch.capacity": "Clutch capacity, {}",
    "clutch.slip": "Clutch slip, {}",
    "clutch.locked": "Clutch locked, {}",
    "slip": "Slip, {}",
    "capacity": "Capacity, {}",
    "shaft.tau": "Shaft torque, {}",
    "inertia.w": "Speed of the inertia, {}",
    "disc.w": "Speed of the clutch disc, {}",
    "work": "Work, {}",
}
WHOLE = {
    "energy.stored": "Stored energy",
    "energy.work": "Work of the ports",
    "energy.dissipated": "Dissipated energy",
    "energy.residual": "Error of the energy balance",
}
DIRECTIONS = {"f": "force", "m": "moment"}


def mesh_words(mesh: str) -> str:
    """ "sun – planet 1" of sun_planet1; other names as they are."""
    return re.sub(r"^([a-z]+)_planet(\d+)$", r"\1 – planet \2", mesh)


def minus(text: str) -> str:
    """A number with the sign that print has for minus."""
    return text.replace("-", "−")


def plain(channel: str) -> str:
    """The plain name of a channel; "" for what is none that we know."""
    return re.sub(r"(?:the )?\bplanet(\d+)", r"planet \1", _plain(channel))


def _plain(channel: str) -> str:
    if channel in WHOLE:
        return WHOLE[channel]
    found = re.fullmatch(r"(bearing|pin)\.([^.]+)\.([fm])([xyz])(_mean)?", channel)
    if found:
        kind, part, what, axis, mean = found.groups()
        return f"{kind.capitalize()} {DIRECTIONS[what]} {axis}, {part}{', mean over the step' if mean else ''}"
    if found := re.fullmatch(r"(sensor|mount)\.([^.]+)\.([af])([xyz])(_mean)?", channel):
        kind, part, what, axis, mean = found.groups()
        word = {"a": "Acceleration", "f": "Force"}[what]
        return f"{word} {axis}, {kind} {part}{', mean over the step' if mean else ''}"
    first, _, last = channel.partition(".")
    if last in MESH:
        return MESH[last] if first == "mesh" else f"{MESH[last]}, {mesh_words(first)}"
    if last.startswith("slice_"):
        return f"Force of slice {last.removeprefix('slice_')}" + ("" if first == "mesh" else f", {mesh_words(first)}")
    for end, words in ENDS.items():
        if channel.endswith(f".{end}"):
            return words.format(channel.removesuffix(f".{end}").removeprefix("drive.").replace(".", " "))
    return ""


def shown(name: str) -> str:
    """Plain name and channel name in one line; words that are no channel as they are."""
    words = plain(name)
    return f"{words} ({name})" if words else name
