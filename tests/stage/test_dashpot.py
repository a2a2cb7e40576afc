"""The path that a contact's dashpot is parallel to (docs/theory.md, 2.5), read from the kernel. The constant of
dashpots belongs to the modes that are stored: with half of them the path is longer, and `same_loss` says with which
constant the mesh loses the same. What a contact's dashpot takes: c b times the square of the rate of its own path,
which is the local law and a share of the tooth's residual."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from by_hand import Pair
from driven import begun, stepped
from small_model import BASE, LENGTH, PSI, ROLLS, WORKING, own_residual, pair_blob
from test_memory import of_few_modes

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import LinearModel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape

POSITIONS = 16  # of one pitch


def own_path(model: StageModel, torque: float) -> float:
    """Path of a contact's dashpot through both teeth and the local law, m/N: with it and the whole face width a tooth
    pair loses what its slices lose. Mean over the tooth pairs in contact at positions of one pitch, `torque` (N·m) on
    the pinion. SimulationError(no_equilibrium) where the pair finds none."""
    kernel = model.kernel(level=0.0, contact_damping=1.0)
    kernel.prepare()
    pitch, paths = 2 * math.pi / mesh_shape(model.stage, model.stage.engagements[0]).gears[1].z, []
    for part in np.arange(POSITIONS) / POSITIONS:
        kernel.transmission(-part * pitch, torque)
        paths += _paths(kernel.linearise())
    return float(np.mean(paths))


def _paths(linear: LinearModel) -> list[float]:
    """Of every tooth pair: root of the mean square, across the width, of what 1 N on it closes along the paths."""
    contact, found = linear.label[:, 0] >= 0, []
    for key in np.unique(linear.label[contact, :3], axis=0):
        own = np.flatnonzero((linear.label[:, :3] == key).all(axis=1))
        load = linear.force[own] / linear.force[own].sum()
        closes = linear.own[np.ix_(own, own)] @ load
        found.append(math.sqrt(linear.dashpot[own] @ closes**2 / linear.dashpot[own].sum()))
    return found


def same_loss(spec: Stage, bodies: Sequence[Body], others: Sequence[Body]) -> float:
    """Contact damping (N·s/m²) with which `others`, reductions of the same gears, lose what `bodies` lose with that of
    `spec`: the more modes are stored, the shorter is the path, and the loss goes with c times its square. Taken at half
    of the largest load."""
    own, other = (own_path(assemble(spec, some), 0.5 * spec.written.torque_max) for some in (bodies, others))
    return float(spec.written.contact.damping * (own / other) ** 2)


def by_hand(spec: Stage, bodies: list[Body], force: float) -> float:
    """Slope of the local law of one tooth pair that carries `force`, and 95 % of what both teeth yield beyond their
    stored modes under 1 N over the width, mean over the roll, m/N."""
    pair, gears = Pair(spec, bodies), spec.written.geometry.gears
    a, c, beta = pair.local_law(tuple(np.sqrt(gear.r**2 - gear.r_b**2) for gear in gears))
    law = (c - 0.5 * a * (1 + np.log(beta * force / pair.width))) / pair.width
    static = [body.flank.static[0, 0, 0].diagonal(axis1=0, axis2=1)[0, 0] for body in bodies]
    modes = [((body.flank.rows[0, :, 0] / (2 * np.pi * body.frequency)) ** 2).sum(axis=1) for body in bodies]
    return float(law + 0.95 * sum((s - m).mean() for s, m in zip(static, modes, strict=True)))


def test_the_same_bodies_take_the_same_constant(relief_spec: Stage, bodies: list[Body]) -> None:
    assert same_loss(relief_spec, bodies, bodies) == pytest.approx(relief_spec.written.contact.damping, rel=1e-14)


def test_the_path_is_the_local_law_and_most_of_the_teeths_residual(relief_spec: Stage, bodies: list[Body]) -> None:
    """By hand at the pitch point, load shared evenly by the slices of two tooth pairs: the mean over the path of
    contact is near it."""
    torque = 0.5 * relief_spec.written.torque_max
    have = own_path(assemble(relief_spec, bodies), torque)
    want = by_hand(relief_spec, bodies, 0.5 * torque / relief_spec.written.geometry.gears[0].r_b)
    assert have == pytest.approx(want, rel=0.1)


def test_a_longer_path_takes_a_smaller_constant(relief_spec: Stage, bodies: list[Body]) -> None:
    """Of few modes: c falls with the square of the path."""
    fewer, torque = [of_few_modes(body) for body in bodies], 0.5 * relief_spec.written.torque_max
    own, longer = (own_path(assemble(relief_spec, some), torque) for some in (bodies, fewer))
    assert longer > 1.2 * own
    share = same_loss(relief_spec, bodies, fewer) / relief_spec.written.contact.damping
    assert share == pytest.approx((own / longer) ** 2, rel=1e-12)


# ---- the loss of a contact -------------------------------------------------------------------------------------------
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
