"""Reduced bodies: what a gear or a carrier is to the kernel, their HDF5 files, and how they are made from a stage."""

from __future__ import annotations

from gearfmu.body.bodies import (
    body_hashes,
    body_needs,
    body_path,
    current_bodies,
    load_bodies,
    reduce_apart,
    reduce_bodies,
    reduce_body,
)
from gearfmu.body.body import Body
from gearfmu.body.inspect import inspect_file
from gearfmu.body.store import load_body

__all__ = [
    "Body",
    "body_hashes",
    "body_needs",
    "body_path",
    "current_bodies",
    "inspect_file",
    "load_bodies",
    "load_body",
    "reduce_apart",
    "reduce_bodies",
    "reduce_body",
]
