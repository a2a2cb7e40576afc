"""A ring with many tiny teeth vibrates as a smooth ring of the same volume."""

from __future__ import annotations

import math

import numpy as np
import pytest
from blocks import STEEL
from blocks import ring_sector as smooth_sector
from sections import section

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.stagefile.tables.bodies import MeshSpec

WIDTH, RIM = 8e-3, 40e-3


def toothed(z: int, module: float) -> InternalGearGeometry:
    r = module * z / 2
    return InternalGearGeometry(
        z, module, math.radians(20), 0.0, r - 0.8 * module, 0.04 * module, r + 1.25 * module, RIM, 0.25 * module
    )


def bending(mesh, nodal_diameter: int) -> np.ndarray:
    """Two lowest frequencies (Hz) of one nodal diameter, in the plane (parity +1)."""
    stiffness, mass = hex20.assemble(mesh.nodes, mesh.elements, STEEL)
    sector = Sector(mesh.nodes, mesh.elements, stiffness, mass, mesh.teeth, mesh.cut_minus, mesh.cut_plus)
    return np.sqrt(lowest_modes(sector_spaces(sector)[0].harmonic(nodal_diameter), 2)[0]) / (2 * np.pi)


def difference(z: int, module: float, nodal_diameter: int) -> np.ndarray:
    """Relative differences (2,) to the smooth ring of the same volume and outer radius."""
    shape = toothed(z, module)
    inner = math.sqrt(RIM**2 - z * section(shape)[0] / math.pi)
    mesh = gear_sector(shape, WIDTH, MeshSpec(flank=3, thickness=1, root=2, rim=3, width=2))
    smooth = smooth_sector((4, 2, 2), inner, RIM, WIDTH, 30)
    return bending(mesh, nodal_diameter) / bending(smooth, nodal_diameter) - 1


@pytest.mark.parametrize("nodal_diameter", [2, 3, 4])
def test_tiny_teeth_leave_a_smooth_ring(nodal_diameter):
    """Half the tooth height, half the difference: it vanishes with the teeth."""
    coarse, fine = difference(120, 0.5e-3, nodal_diameter), difference(240, 0.25e-3, nodal_diameter)
    assert np.all(np.abs(fine) < 0.05)
    assert np.abs(2 * fine - coarse).max() < 0.1 * np.abs(coarse).max()
