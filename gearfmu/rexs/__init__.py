"""Gear data in from REXS, the public exchange format for gear units (rexs.info): a file becomes a draft of a stage."""

from gearfmu.rexs.stage import draft_from_rexs
from gearfmu.stagefile.proposals.draft import Draft

__all__ = ["Draft", "draft_from_rexs"]
