"""Structured hexahedral meshes of gear sectors."""
