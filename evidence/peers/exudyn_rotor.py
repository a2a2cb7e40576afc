"""A spinning elastic gear against Exudyn's floating frame of reference (Gerstmayr, Multibody Syst. Dyn. 2023).

    python -m evidence.peers.exudyn_rotor [SPEED …]          (rad/s; needs `pip install exudyn`)

The pinion of fzg_c on a coarse mesh, free in space but for springs at the two ends of its bore, spins, is kicked, and
whirls for 1 ms. Exudyn gets the whole finite-element mesh, its M and K, and the gear's lowest modes on it as the shapes
of an ObjectFFRFreducedOrder: Coriolis, centrifugal and Euler terms are its own, quadratic in the deformation. Here the
same modes are those of one sector, their coupling, load and gyroscopic moment as a stage takes them (gearfmu/stage/
spinning.py), patterns of ν ≤ 1 in axes that do not turn, the others in the gear's own; the linear system is solved
exactly, which is what the kernel does to 4e-6 in steps of 2 µs (tests/kernel/test_gyroscopic.py).

Prints and writes exudyn_rotor.csv: speed, step of Exudyn (0: extrapolated from its two finest runs), differences
(largest over largest) of the bore's motion, of the modes of ν ≥ 2, and of the mean growth of the fan mode of ν = 0;
`without`: the same of our system without its gyroscopic forces. Of the middle speed what Exudyn converges to is stored
for tests, every 20 µs, in tests/reference/exudyn_rotor.json.
"""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.body.body import Node
from gearfmu.fem import hex20
from gearfmu.femesh.sector import gear_sector
from gearfmu.modes.cyclic import unfolded
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stage.assembly.ground_part import GroundPart, body_spinning, turn_rates, whirl_rows
from gearfmu.stage.assembly.groups import Layout, Support, mount
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

COARSE = MeshSpec(flank=2, thickness=1, root=2, rim=1, width=2)
MODES, SPEEDS, STEPS = 18, (300.0, 600.0, 1200.0), (1e-6, 5e-7, 2.5e-7)
TIME, EVERY = 1e-3, 2e-6
RADIAL, AXIAL = 2e8, 1e8  # N/m at each end of the bore
KICK, TILT, SHAKE = 0.05, 2.0, 0.01  # m/s, rad/s, m/s·√kg
REFERENCE = Path(__file__).resolve().parents[2] / "tests" / "reference" / "exudyn_rotor.json"
TABLE = Path(__file__).with_suffix(".csv")


@dataclass(frozen=True)
class Rotor:
    """The gear from its sector: body and modes; shapes (n, N, 3) of the whole mesh, ends: nodes of the bore's edges."""

    body: SectorBody
    modes: SimpleNamespace
    shapes: np.ndarray
    ends: tuple[np.ndarray, np.ndarray]

    @cached_property
    def turning(self) -> np.ndarray:
        """Modes of ν ≥ 2."""
        return np.flatnonzero(self.modes.nodal_diameter > 1)

    @cached_property
    def low(self) -> np.ndarray:
        """Modes of ν ≤ 1."""
        return np.flatnonzero(self.modes.nodal_diameter <= 1)

    @cached_property
    def axes(self) -> np.ndarray:
        """(n, n) turns the axes of every pair of modes so that impulses at the nodes drive its first alone. What is
        seen in them does not depend on the signs and phases that modes come with."""
        impulse = np.random.default_rng(2).standard_normal(self.shapes[0].shape)
        speeds, axes = np.einsum("knd,nd->k", self.shapes, impulse), np.zeros(2 * (len(self.shapes),))
        for k, part in enumerate(self.modes.part):
            if part == 0:
                axes[k, k] = np.sign(speeds[k])
            elif part == 1:
                a, b = speeds[k : k + 2] / np.hypot(*speeds[k : k + 2])
                axes[k : k + 2, k : k + 2] = [[a, -b], [b, a]]
        return axes

    def kick(self) -> np.ndarray:
        """(n,) speeds of the modes at the start, which fall with the frequency."""
        falling = self.modes.frequency[0] / self.modes.frequency
        return SHAKE * self.axes @ np.where(self.modes.part == 2, 0.0, falling)

    def seen(self, modes: np.ndarray) -> np.ndarray:
        """Modes (T, m) of ν ≥ 2 in `axes`, m·√kg."""
        return modes @ self.axes[np.ix_(self.turning, self.turning)]


def make_rotor() -> Rotor:
    """From the stage's numbers."""
    spec = load_stage("fzg_c")
    gear, shape = spec.gears[0], spec.written.geometry.gears[0]
    flank = ToothFlank(shape.r_b, shape.psi_b, shape.s_form, shape.s_tip, gear.face_width, gear.body.strip_half_width)
    mesh = gear_sector(shape, gear.face_width, COARSE)
    body = SectorBody(mesh, gear.material, flank, Points(flank.chebyshev_rolls(3), 1))
    modes = elastic_modes(body, MODES, sample=sp.eye_array(len(mesh.nodes), format="csr"))
    assert modes.surface is not None
    index = [mesh.sector_nodes(tooth) for tooth in range(mesh.teeth)]
    shapes = []
    for k in np.flatnonzero(modes.part != 2):
        shape = modes.surface[k] + 1j * modes.surface[k + 1] if modes.part[k] else modes.surface[k]
        shapes += list(unfolded(shape.ravel(), modes.nodal_diameter[k], index))
    full = mesh.full()
    bore, z = full.sets["bore"], full.nodes[full.sets["bore"], 2]
    ends = tuple(bore[np.abs(z - side * gear.face_width / 2) < 1e-9] for side in (-1, 1))
    return Rotor(body, modes, np.array(shapes), ends)


def our_motion(rotor: Rotor, speed: float, times: np.ndarray, known: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the bore in standing axes (T, 2, 2), m, and `Rotor.seen` (T, m): our linear system, exactly."""
    modes, places = rotor.modes, [float(rotor.body.mesh.full().nodes[end, 2].mean()) for end in rotor.ends]
    rows = np.zeros((2, 6, rotor.low.size))
    for i, end in enumerate(rotor.ends):
        rows[i, :3] = rotor.shapes[rotor.low][:, end].mean(axis=1).T
    inertia = rotor.body.inertia
    nodes = tuple(Node(f"end{i}", "averaging", COMPONENTS, np.array([0.0, 0.0, z])) for i, z in enumerate(places))
    teeth = SimpleNamespace(diameter=modes.nodal_diameter, part=modes.part)
    turning = SimpleNamespace(exact=None, spin=modes.spin, mass=inertia, frequency=modes.frequency, toothed=teeth)
    free = GroundPart(
        "rotor", inertia, 2 * np.pi * modes.frequency[rotor.low], np.zeros(rotor.low.size), nodes, rows,
        np.zeros((12, 12)), spinning=body_spinning(turning, rotor.low),
    )  # fmt: skip
    spring = np.diag([1 / RADIAL, 1 / RADIAL, 1 / AXIAL])
    springs = [Support(f"end{i}", (0, i), None, (0, 1, 2), spring, np.zeros(3)) for i in (0, 1)]
    group = mount(Layout([free], [(0,)], springs, planar=False))
    coupling = sum(
        (np.outer(y, x) - np.outer(x, y) for _, (x, y) in zip(*whirl_rows(group), strict=True)),
        np.zeros(2 * group.omega.shape),
    )
    raw = np.zeros(group.at[0].stop)  # x, y, z, rx, ry, patterns
    raw[0], raw[3], raw[5:] = KICK, TILT, rotor.kick()[rotor.low]
    mass = sl.block_diag(inertia[:5, :5], np.eye(rotor.low.size))
    start = group.shapes.T @ mass @ raw
    low = propagate(group.omega, known * coupling, speed, start, times)
    ends = np.stack([[group.node_rows(0, i, d) for d in (0, 1)] for i in (0, 1)])
    omega, turn = 2 * np.pi * modes.frequency[rotor.turning], np.zeros(2 * (rotor.turning.size,))
    first = np.flatnonzero(modes.part[rotor.turning] == 1)
    turn[first + 1, first] = turn_rates(turning, rotor.turning)[first]
    high = propagate(omega, known * (turn - turn.T), speed, rotor.kick()[rotor.turning], times)
    return np.einsum("edn,tn->ted", ends, low), rotor.seen(high)


def propagate(
    omega: np.ndarray, coupling: np.ndarray, speed: float, start: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Displacements (T, n) of q̈ + 2Ω G q̇ + ω² q = 0 with the speeds `start` at rest, at equal steps."""
    n = omega.size
    matrix = np.block([[np.zeros((n, n)), np.diag(omega)], [-np.diag(omega), -2 * speed * coupling]])
    step, state, found = sl.expm(matrix * (times[1] - times[0])), np.concatenate([np.zeros(n), start]), []
    for _ in times:
        found.append(state[:n] / omega)
        state = step @ state
    return np.array(found)


def exudyn_motion(rotor: Rotor, speed: float, h: float, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the bore (T, 2, 2) and all modes (T, n), from Exudyn at step h."""
    import exudyn as exu
    from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
    from exudyn.itemInterface import (
        CartesianSpringDamper,
        MarkerBodyPosition,
        MarkerSuperElementPosition,
        ObjectGround,
        SensorMarker,
        SensorNode,
    )

    full = rotor.body.mesh.full()
    stiffness, mass = hex20.assemble(full.nodes, full.elements, load_stage("fzg_c").gears[0].material)
    fem = FEMinterface()
    fem.nodes = {"Position": full.nodes}
    fem.elements = [{"Name": "gear", "Hex20": full.elements}]
    fem.massMatrix, fem.stiffnessMatrix = mass, stiffness
    fem.modeBasis = {"matrix": rotor.shapes.reshape(len(rotor.shapes), -1).T.copy(), "type": "NormalModes"}
    fem.eigenValues = (2 * np.pi * rotor.modes.frequency) ** 2
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    cms = ObjectFFRFreducedOrderInterface(fem)
    made = cms.AddObjectFFRFreducedOrder(mbs, initialVelocity=[KICK, 0, 0], initialAngularVelocity=[TILT, 0, speed])
    mbs.SetNodeParameter(made["nGenericODE2"], "initialCoordinates_t", list(rotor.kick()))
    ground, sensors = mbs.AddObject(ObjectGround()), []
    for end in rotor.ends:
        weights = np.full(len(end), 1 / len(end))
        marker = mbs.AddMarker(
            MarkerSuperElementPosition(
                bodyNumber=made["oFFRFreducedOrder"], meshNodeNumbers=end, weightingFactors=weights
            )
        )
        place = [0, 0, float(full.nodes[end, 2].mean())]
        fixed = mbs.AddMarker(MarkerBodyPosition(bodyNumber=ground, localPosition=place))
        mbs.AddObject(CartesianSpringDamper(markerNumbers=[fixed, marker], stiffness=[RADIAL, RADIAL, AXIAL]))
        watched = {"storeInternal": True, "outputVariableType": exu.OutputVariableType.Position}
        sensors.append(mbs.AddSensor(SensorMarker(markerNumber=marker, **watched)))
    watched = {"storeInternal": True, "outputVariableType": exu.OutputVariableType.Coordinates}
    modal = mbs.AddSensor(SensorNode(nodeNumber=made["nGenericODE2"], **watched))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(TIME / h), TIME
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = EVERY
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    settings.timeIntegration.newton.relativeTolerance, settings.timeIntegration.verboseMode = 1e-10, 0
    settings.timeIntegration.newton.absoluteTolerance = 1e-12
    mbs.SolveDynamic(settings)
    ends = np.stack([mbs.GetSensorStoredData(s)[: len(times), 1:3] for s in sensors], axis=1)
    return ends, mbs.GetSensorStoredData(modal)[: len(times), 1:]


def difference(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest over largest."""
    return float(np.abs(found - exact).max() / np.abs(exact).max())


Run = tuple[float, np.ndarray, np.ndarray]


def exudyn_runs(rotor: Rotor, speed: float, times: np.ndarray) -> list[Run]:
    """Step, ends and modes of Exudyn; the last (step 0) is what its two finest runs converge to."""
    runs: list[Run] = [(h, *exudyn_motion(rotor, speed, h, times)) for h in STEPS]
    coarse, fine = runs[-2:]
    return [*runs, (0.0, (4 * fine[1] - coarse[1]) / 3, (4 * fine[2] - coarse[2]) / 3)]


def compare(rotor: Rotor, speed: float, times: np.ndarray, runs: list[Run]) -> list[dict[str, float]]:
    """Lines of the table, one a run."""
    ours, without = (our_motion(rotor, speed, times, known) for known in (True, False))
    load, omega = rotor.modes.spin.load, 2 * np.pi * rotor.modes.frequency
    fan = int(np.argmax(np.abs(load / omega**2)))
    static = speed**2 * load[fan] / omega[fan] ** 2
    return [
        {
            "speed": speed,
            "step": h,
            "bore": difference(ends, ours[0]),
            "bore_without": difference(ends, without[0]),
            "modes": difference(rotor.seen(modes[:, rotor.turning]), ours[1]),
            "modes_without": difference(rotor.seen(modes[:, rotor.turning]), without[1]),
            "growth": fit_mean(modes[:, fan], omega[fan], times) / static - 1,
        }
        for h, ends, modes in runs
    ]


def fit_mean(values: np.ndarray, omega: float, times: np.ndarray) -> float:
    """Constant part beside a vibration of about ω."""
    columns = np.stack([np.ones_like(times), np.cos(omega * times), np.sin(omega * times)], axis=1)
    return float(np.linalg.lstsq(columns, values, rcond=None)[0][0])


def main(speeds: list[float]) -> None:
    """Print and write the table."""
    rotor = make_rotor()
    print("modes, Hz:", np.round(rotor.modes.frequency).astype(int), "ν:", rotor.modes.nodal_diameter)
    times, rows = EVERY * np.arange(round(TIME / EVERY) + 1), []
    for speed in speeds:
        runs = exudyn_runs(rotor, speed, times)
        rows += compare(rotor, speed, times, runs)
        if speed == SPEEDS[1]:
            ends, modes = (run[::10] for run in runs[-1][1:])
            stored = {"speed": speed, "times": times[::10], "ends": ends, "seen": rotor.seen(modes[:, rotor.turning])}
            text = {name: np.round(np.asarray(value), 16).tolist() for name, value in stored.items()}
            REFERENCE.write_text(json.dumps(text) + "\n", encoding="utf-8")
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0])
        for row in rows:
            print("  ".join(f"{name} {value:.3g}" for name, value in row.items()), flush=True)
            writer.writerow(f"{value:.4g}" for value in row.values())


if __name__ == "__main__":
    main([float(word) for word in sys.argv[1:]] or list(SPEEDS))
