"""Reduction methods, one file each; every one is `reduce(body: FullOrder, size: Size) -> Basis`."""

from __future__ import annotations
