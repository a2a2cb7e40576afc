"""Reduced bodies: what a gear is to the kernel, their HDF5 files, and how they are made from a stage."""

from __future__ import annotations

from gearfmu.body.inspect import inspect_file
from gearfmu.body.reduce import body_path, load_stage_bodies, reduce_stage
from gearfmu.body.reduced import ReducedBody
from gearfmu.body.store import load_body

__all__ = ["ReducedBody", "body_path", "inspect_file", "load_body", "load_stage_bodies", "reduce_stage"]
