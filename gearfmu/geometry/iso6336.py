"""Mesh stiffness by ISO 6336-1:2019, method B, for comparison: teeth on solid discs whose bodies do not yield."""

from __future__ import annotations

import math

from gearfmu.geometry.mesh import PairGeometry, RingMesh

C_M = 0.8  # of measured over theoretical stiffness, solid discs
STEEL = 206e9  # Pa, of which the formula is


def mesh_stiffness(mesh: PairGeometry | RingMesh, dedendum: float = 1.25, modulus: float = STEEL) -> float:
    """c_γα (N/m per metre of face width) = c' (0.75 ε_α + 0.25), in the transverse plane along the line of action.

    c' = (C_M/q') C_R C_B cos β E/E_steel, C_R = 1 of solid discs, q' (mm µm/N) of spur teeth of virtual numbers z_n.
    A ring has 1/z_n2 = 0. dedendum: h_fP of the basic rack in modules; modulus: E of both gears, Pa. The formula is for
    100 N/mm of face width and more.
    """
    a, b = mesh.gears
    v_1, v_2 = 1 / a.z_virtual, 0.0 if isinstance(mesh, RingMesh) else 1 / b.z_virtual
    q = 0.04723 + 0.15551 * v_1 + 0.25791 * v_2
    q += -0.00635 * a.x - 0.11654 * a.x * v_1 - 0.00193 * b.x - 0.24188 * b.x * v_2
    q += 0.00529 * a.x**2 + 0.00182 * b.x**2
    rack = (1 + 0.5 * (1.2 - dedendum)) * (1 - 0.02 * (20 - math.degrees(a.alpha)))
    single = C_M / q * rack * math.cos(a.beta) * modulus / STEEL
    return 1e9 * single * (0.75 * mesh.contact_ratio + 0.25)
