"""An impact of two gears through half their backlash: the product's kernel against the unreduced finite elements.

    python -m evidence.reduction.in_time.kernel

Planet and sun of planetary54 as a pair (pair/stage.toml) on their bearings, nothing damped, no tip relief, gaps linear
about the start (`effect.roll_motion` off), as in the finite elements. Bodies are reduced by the product, by cyclic
symmetry and 400 modes; the finite elements are all teeth of the same sector mesh. The kernel runs with nodal contact
(level paper, rk45: truncated modes, the same points and penalty as the finite elements have) and with line contact
(level full, dg4: all compliance, Hertz's law instead of the penalty). Prints peak force, impulse, time in
contact and its begin, and writes kernel.csv and curves_kernel.csv beside this file. Two minutes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evidence.energy.free import Rattle, free_pair, started
from evidence.reduction.in_time.channels import errors
from evidence.reduction.in_time.contact_points import contact_points
from evidence.reduction.in_time.scenes import GRID, Solid, gear, joint_rows, nominal_play, placed_gear, touching
from evidence.reduction.in_time.tables import write_columns, write_rows
from evidence.reduction.in_time.transient import Assembly, Joints, Member, Scheme, integrate
from gearfmu.body import reduce_bodies
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size
from gearfmu.reduction.oscillators import oscillators
from gearfmu.stage.assembly.meshes import mesh_penalty
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage

HERE = Path(__file__).parent
START = Rattle(position=0.1, speed=1.0)
PAPER, FULL, RK45, DG4, LINE = 4, 3, 2, 0, 1
SCHEME = Scheme(0.5e-6, 0.25e-3)
SAMPLE = 1e-6


def finite_elements(spec: Stage) -> tuple[dict[str, Solid], Assembly, np.ndarray]:
    """Both gears unreduced, in the place and with the speeds of START; sign of every joint in the force of the mesh:
    1 drive flanks, −1 coast flanks, 0 a bearing."""
    mesh = spec.written.geometry
    r_b = [shape.r_b for shape in mesh.gears]
    turn, back = 2 * np.pi * START.position, 0.5 * START.play / mesh.gears[0].r_b
    angles = (turn / mesh.gears[0].z - back, mesh.wheel_phase - turn / mesh.gears[1].z)
    centres = (np.zeros(2), np.array([mesh.a, 0.0]))
    placed = [placed_gear(g, s, c, a, 1.0) for g, s, c, a in zip(spec.gears, mesh.gears, centres, angles, strict=True)]
    points = contact_points(*placed, GRID, {1: 0.0, -1: START.play - nominal_play(mesh)})
    solids = {
        g.name: gear(g.name, place, g.material, rows)
        for g, place, rows in zip(spec.gears, placed, points.rows, strict=True)
    }
    entries = [(2 * k + i, name, solids[name].index("bore", ("ux", "uy")[i]), 1.0)
               for k, name in enumerate(solids) for i in (0, 1)]  # fmt: skip
    stiffness = np.repeat([g.bearing.stiffness for g in spec.written.gears], 2)
    bearings = Joints(joint_rows(solids, entries, 4), stiffness, np.zeros(4), np.zeros(4, bool))
    stage = spec
    penalty = mesh_penalty(stage, stage.engagements[0])
    joints, _ = touching(bearings, np.full(4, "bearing"), solids, points, penalty)
    side = np.concatenate([np.zeros(4), points.side])
    members = tuple(Member.whole(solid.full) for solid in solids.values())
    inertia = [m.rigid[:, 5] @ (m.mass @ m.rigid[:, 5]) / r**2 for m, r in zip(members, r_b, strict=True)]
    start = tuple(START.speed * inertia[1 - i] / sum(inertia) / r_b[i] * np.eye(6)[5] for i in (0, 1))
    nothing = tuple(np.zeros(m.rows.shape[0]) for m in members)
    return solids, Assembly(members, joints, nothing, lambda t: 0.0, start), side


def force_of(assembly: Assembly, side: np.ndarray) -> np.ndarray:
    """Force (N) of all contacts, drive minus coast flanks, every SAMPLE."""
    return -(integrate(assembly, SCHEME).tension @ side)[:: round(SAMPLE / SCHEME.step)]


def kernel_force(spec: Stage, bodies: list, parameters: dict[str, float]) -> np.ndarray:
    """The same of the kernel, between whose bores and axes nothing is damped."""
    off = {"effect.tip_relief": 0.0, "effect.tip_contact": 0.0}
    kernel = started(free_pair(spec, bodies), START, off | parameters)
    force = [kernel.get("mesh.force")]
    for step in range(round(SCHEME.end / SAMPLE)):
        kernel.step(step * SAMPLE, SAMPLE)
        force.append(kernel.get("mesh.force"))
    return np.array(force)


def runs() -> dict[str, np.ndarray]:
    """Force over time of every model; the first is the reference."""
    spec = load_stage(HERE / "pair" / "stage.toml")
    bodies = reduce_bodies(spec, Path("out/in_time/pair"))
    solids, whole, side = finite_elements(spec)
    found = {"finite elements": force_of(whole, side)}
    for name, residual in (("finite elements, 400 modes", False), ("finite elements, 400 modes + residual", True)):
        models = [oscillators(s.full, METHODS["modal"](s.full, Size(400)), 0.0) for s in solids.values()]
        found[name] = force_of(whole.with_members(*(Member.reduced(m, residual) for m in models)), side)
    found["kernel, level paper, nodal contact"] = kernel_force(spec, bodies, {"level": PAPER, "integrator": RK45})
    found["kernel, level paper, line contact"] = kernel_force(
        spec, bodies, {"level": PAPER, "integrator": RK45, "contact": LINE}
    )
    found["kernel, level full"] = kernel_force(spec, bodies, {"level": FULL, "integrator": DG4, "h": SAMPLE})
    return found


def main() -> None:
    found = runs()
    reference = next(iter(found.values()))
    rows = [{"model": name} | facts(reference, force) for name, force in found.items()]
    for row in rows:
        print("  ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()), flush=True)
    write_rows(HERE / "kernel.csv", rows)
    write_columns(HERE / "curves_kernel.csv", {"time_s": np.arange(len(reference)) * SAMPLE} | found)


def facts(reference: np.ndarray, force: np.ndarray) -> dict[str, float]:
    """Of a force over time: peak, impulse and time of the drive flanks, first contact, error."""
    return {
        "peak_N": float(force.max()),
        "impulse_mNs": float(1e3 * force[force > 0].sum() * SAMPLE),
        "closed_us": float(1e6 * SAMPLE * np.count_nonzero(force > 0)),
        "first_us": float(1e6 * SAMPLE * np.flatnonzero(force)[0]),
        "error": errors(reference, force)[0],
    }


if __name__ == "__main__":
    main()
