"""What a contact's dashpot takes: c b times the square of the rate of its own path, which is the local law and a share
of the tooth's residual (theory, 2.5)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun, stepped
from small_model import BASE, LENGTH, PSI, ROLLS, WORKING, own_residual, pair_blob

from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import read_blob, write_blob

STEP, FREQUENCY, CYCLES = 1e-5, 200.0, 3  # s, Hz: far below the lowest resonance
DAMPING, RESIDUAL = 2e4, 4e-9  # N·s/m² over the face width; m/N of one tooth beyond its modes
WIDTH, STRIP, YIELD, TORQUE_MAX = 14e-3, 1e-3, 2 * (1 - 0.3**2) / (math.pi * 206e9), 600.0
QUIET = {"level": 0, "slices": 1} | {
    f"effect.{name}": 0.0 for name in ("hertz", "bearings", "modal_damping", "tip_contact")
}


@pytest.fixture(scope="module")
def blob() -> bytes:
    """The small pair, its wheel held by a stiff port without loss; the residual of a flank is the same all over."""
    sections, places = dict(read_blob(pair_blob(("torque", "fixed")))), 2 * ROLLS
    change = -own_residual().transpose(0, 2, 1, 3)
    change[:, 0, :, 0] += RESIDUAL
    sections["ports"] = np.array(sections["ports"], float).reshape(2, -1)
    sections["ports"][1, :2] = 1e9, 0.0  # k, c
    for g in (0, 1):
        own = sections[f"residual_own{g}"].reshape(2, -1)
        sections[f"residual_own{g}"] = own + change.reshape(places, places)[np.tril_indices(places)].astype(np.float32)
    return write_blob(sections)


def secant(roll: float) -> float:
    """Linear local law of both bodies at torque_max, m/N."""
    load, beta = TORQUE_MAX / BASE[0] / WIDTH, 4 * YIELD / (1 / roll + 1 / (LENGTH - roll))
    return 2 * YIELD * (math.log(4 * STRIP) - 1 - 0.5 * math.log(beta * load)) / WIDTH


@pytest.mark.parametrize("backlash, share", [(1e-4, 0.95), (-4e-5, 0.75)])
def test_loss_is_that_of_the_contacts_own_path(blob: bytes, backlash: float, share: float) -> None:
    """Torque that swings slowly on one tooth pair, and on a tooth that is jammed: 95 % of the residual belongs to a
    contact whose tooth touches with one flank, 75 % where the other flank touches too."""
    kernel = Kernel(blob, {**QUIET, "backlash": backlash, "contact_damping": DAMPING})
    begun(kernel, {"pinion.tau": 30.0})

    def swing(i: int) -> None:
        kernel.set("pinion.tau", 30.0 + 10.0 * (1 - math.cos(2 * math.pi * FREQUENCY * (i + 0.5) * STEP)))

    names, count = ("mesh.force_drive", "mesh.force_coast", "mesh.pairs"), round(CYCLES / FREQUENCY / STEP)
    *forces, pairs = stepped(kernel, count, STEP, *names, before=swing).T
    lost, rates = kernel.get("energy.dissipated"), np.diff(forces) / STEP
    path = 2 * share * RESIDUAL + secant(BASE[0] * (PSI[0] + WORKING))
    by_hand = DAMPING * WIDTH * path**2 * (rates**2).sum() * STEP
    assert np.all(pairs == (1.0 if backlash > 0 else 2.0))
    assert lost == pytest.approx(by_hand, rel=3e-3)
