"""Our meshes as Abaqus/CalculiX decks."""

from __future__ import annotations

import os

import numpy as np

from gearfmu.femesh.mesh import FeMesh
from gearfmu.files import write_text

_MATERIAL = """*MATERIAL, NAME=STEEL
*ELASTIC
{youngs_modulus:.12g}, {poisson_ratio:.12g}
*DENSITY
{density:.12g}
*SOLID SECTION, ELSET=SOLID, MATERIAL=STEEL
"""
_STORE = """** CalculiX writes the stiffness and mass matrix of the free body to <job>.sti, .mas and .dof.
*STEP
*FREQUENCY, SOLVER=MATRIXSTORAGE
1
*END STEP
"""


def write_deck(mesh: FeMesh, path: str | os.PathLike[str], material: dict[str, float] | None = None) -> None:
    """Write nodes in mm, C3D20 elements (set SOLID) and the node sets, the cuts among them; whole or not at all.

    material : youngs_modulus (Pa), poisson_ratio, density (kg/m³); with it the deck holds the material in N, mm, t and
    a step that makes CalculiX store its matrices.
    """
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{label}, {x:.12g}, {y:.12g}, {z:.12g}" for label, (x, y, z) in enumerate(1e3 * mesh.nodes, start=1)]
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=SOLID")
    for label, nodes in enumerate((mesh.elements + 1).tolist(), start=1):
        words = [str(number) for number in (label, *nodes)]
        lines += [", ".join(words[:11]) + ",", ", ".join(words[11:])]
    cuts = {"cut_minus": mesh.cut_minus, "cut_plus": mesh.cut_plus}
    for name, members in (mesh.sets | {name: nodes for name, nodes in cuts.items() if len(nodes)}).items():
        lines.append(f"*NSET, NSET={name.upper()}")
        words = [str(number) for number in np.sort(members) + 1]
        lines += [", ".join(words[k : k + 12]) for k in range(0, len(words), 12)]
    text = "\n".join(lines) + "\n"
    if material is not None:
        in_mm = material | {
            "youngs_modulus": 1e-6 * material["youngs_modulus"],
            "density": 1e-12 * material["density"],
        }
        text += _MATERIAL.format(**in_mm) + _STORE
    write_text(path, text)
