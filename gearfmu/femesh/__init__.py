"""Meshes: structured hexahedral ones of gears and carriers, and those made elsewhere."""
