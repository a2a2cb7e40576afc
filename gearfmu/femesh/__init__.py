"""Structured hexahedral meshes of gear sectors."""

from __future__ import annotations

from gearfmu.femesh.mesh import FeMesh, FlankGrid
from gearfmu.femesh.quality import mesh_report, scaled_jacobian, volume, write_vtu
from gearfmu.femesh.ring import ring_sector, sector_mesh
from gearfmu.femesh.sector import gear_sector

__all__ = [
    "FeMesh",
    "FlankGrid",
    "gear_sector",
    "mesh_report",
    "ring_sector",
    "scaled_jacobian",
    "sector_mesh",
    "volume",
    "write_vtu",
]
