"""Gear data in from REXS, the public exchange format for gear units (rexs.info): a file becomes a draft of a stage."""
