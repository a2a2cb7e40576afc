"""A stage and its reduced bodies → the general model blob: every array of gearfmu/kernel/src/model/gk_fields.inc, by
name."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.blob import order_sections, origin, with_guid, write_blob
from gearfmu.stage.assembly.compact import far_sections, flank_tables, ground_tables, is_mirrored, smeared, smeared_tip
from gearfmu.stage.assembly.ground_part import PartFlank, turn_rates, whirl_rows
from gearfmu.stage.assembly.groups import SPIN, Group, Layout, RigidSupportError, families, mount, node_directions
from gearfmu.stage.assembly.housed import sensor_sections, widened
from gearfmu.stage.assembly.layout import stage_layout, stage_nodes, width_degrees
from gearfmu.stage.assembly.levels import FAST, RIGID, SHARED_BELOW, STANDARD
from gearfmu.stage.assembly.meshes import film_starts, friction_starts, nodal_sections, stage_sections, tooth_phases
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.assembly.observed import observed_number, observed_sections
from gearfmu.stage.assembly.rolling import Settled, Statics, Tangents, settle
from gearfmu.stage.assembly.teeth import ROLLS, deviation_sections, gear_section, mismatches, stored_points
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.stored import stored, stored_files
from gearfmu.stagefile.tables.connections import PortSpec

MODEL_VERSION = 5
VARIABLES = "e5b3cafe899b"  # of gk_variables.inc, which FMUs follow: the first digits of its SHA-256
_KEPT = 16  # stages whose bearings are remembered
_SETTLED: dict[str, Settled] = {}
PORT_KINDS = {"spring": 0, "torque": 1, "fixed": 2}
FIXED_K = 1e7  # N·m/rad: what a fixed port without a stiffness of its own is held by


def assemble(stage: Stage, bodies: Sequence[Body], rolls: int = ROLLS, observe: Sequence[str] = ()) -> StageModel:
    """The general model of a stage. bodies: reduced, in the order of `stage.files`; rolls: of the even grid along a
    flank; observe: names of gears whose rigid motion and modal amplitudes are outputs.

    SpecError where the stage does not say all that it needs to move; ModelError when a body does not belong to its
    gear, and for a name in `observe` that is no gear of the stage.
    """
    stage.require_motion()
    hashes = tuple(body.how.hash for body in bodies)
    made_of = {"made_of": _made_of(stage, bodies, rolls, observe)}
    found = general_sections(stage, bodies, rolls, observe, tangents_of(stage, bodies))
    sections = order_sections(with_guid(found | made_of))
    model = StageModel(stage, write_blob(sections), hashes)
    starts = friction_starts(stage) | film_starts(stage)
    return model.with_starts(starts) if starts else model


def _made_of(stage: Stage, bodies: Sequence[Body], rolls: int, observe: Sequence[str]) -> str:
    """Hash of all that a model and the variables of its FMU are made of but the kinds of its ports."""
    tables = stored(stage) | {"description": ""}
    for port in tables["ports"].values():
        port.pop("kind", None)
    hashes = {name: body.how.hash for name, body in stage.by_name(bodies).items()}
    return origin(MODEL_VERSION, VARIABLES, tables, stored_files(stage), hashes, rolls, list(observe))


def general_sections(
    stage: Stage,
    bodies: Sequence[Body],
    rolls: int = ROLLS,
    observe: Sequence[str] = (),
    tangents: Tangents = MappingProxyType({}),
) -> dict[str, Any]:
    """Every section of the blob of `assemble`, by name. tangents: of the rolling bearings."""
    bodies, carriers = _parted(stage, bodies)
    shapes = [gear_shape(gear) for gear in stage.gears]
    teeth = [body.toothed for body in bodies]
    problems = [p for entry in zip(stage.gears, shapes, teeth, strict=True) for p in mismatches(*entry)]
    if problems:
        raise ModelError("; ".join(problems) + ": make the bodies again with `gearfmu reduce`")
    flanks = [stored_points(body, s.s_form, s.s_tip, rolls) for body, s in zip(bodies, shapes, strict=True)]
    points = [points for points, _ in flanks]
    layout = stage_layout(stage, bodies, carriers, points, tangents)
    bare = stage_layout(stage.on_rigid_ground(), bodies, carriers, points, tangents) if stage.housings else None
    nodes = port_nodes(stage, carriers)
    groups = mount_sets(layout, bare)
    degrees = width_degrees(stage, bodies)
    sections = stage_sections(stage) | nodal_sections(stage) | _port_sections(stage, groups[0], nodes)
    sections |= {
        "counts": np.array(
            [MODEL_VERSION, stage.slices, len(stage.rotors), len(stage.gears), len(stage.engagements),
             len(stage.ports), len(layout.support_names()), degrees.size, rolls, len(groups)],
            np.int32,
        ),
        "support_names": "|".join(layout.support_names()),
        "displacement_names": "|".join(layout.displacement_names()),
        "degrees": degrees.astype(np.int32),
        "inertia": np.array([layout.inertia(r) for r in range(len(layout.rotors))]),
    }  # fmt: skip
    sections |= _carried_sections(layout)
    phases = tooth_phases(stage)
    for i, (gear, shape) in enumerate(zip(stage.gears, shapes, strict=True)):
        place = stage.place(gear.name, None)
        sections[f"gear{i}"] = gear_section(gear, shape, phases[gear.name], place)
        sections |= deviation_sections(i, gear, shape)
        if shape.beta_b != 0.0:
            sections[f"smeared{i}"] = smeared(gear, shape, degrees)
            sections[f"smeared_tip{i}"] = smeared_tip(gear, shape, degrees)
        sections |= _gear_sections(stage, i, bodies[i], groups, nodes, degrees) | {f"resample{i}": flanks[i][1]}
    for s, group in enumerate(groups):
        found = set_sections(s, group, nodes)
        sections |= widened(found, s, len(layout.support_names())) if stage.housings else found
    for housing in stage.housings:
        sections |= sensor_sections(carriers[housing.name].sensors, groups[0])
    lowest = 2 * math.pi * SHARED_BELOW * float(sections["limits"][0])
    for i, (gear, shape) in enumerate(zip(stage.gears, shapes, strict=True)):
        if sum(gear.name in mesh.gears for mesh in stage.engagements) > 1:
            sections |= far_sections(i, sections, shape, gear.face_width, len(groups), lowest)
    for name in observe:
        sections |= observed_sections(observed_number(stage, name), bodies, groups)
    return sections


def stage_group(stage: Stage, bodies: Sequence[Body]) -> Group:
    """The ground oscillators of a stage as supported; bodies as of `assemble`."""
    return mount(layout_of(stage, bodies))


def layout_of(stage: Stage, bodies: Sequence[Body]) -> Layout:
    """Its free bodies and what holds them."""
    tangents = tangents_of(stage, bodies)
    bodies, carriers = _parted(stage, bodies)
    return stage_layout(stage, bodies, carriers=carriers, tangents=tangents)


def tangents_of(stage: Stage, bodies: Sequence[Body]) -> Tangents:
    """(d, d) stiffness of every rolling bearing at the operating torque, by the name of its support; bodies as of
    `assemble`. ModelError: `settle`."""
    return settled(stage, bodies).tangents if stage.rolling else {}


def settled(stage: Stage, bodies: Sequence[Body], torque: float | None = None) -> Settled:
    """The rolling bearings of a stage under a torque on its input (N·m), that of the file when None; on rigid ground,
    so that a housing changes no bearing. ModelError where it has none, and as of `settle`."""
    if not stage.rolling:
        raise ModelError(
            f"{stage.name} has no rolling bearings: give some of its supports one (docs/howto-bearings.md)"
        )
    assert stage.operating is not None
    at = stage.operating.torque if torque is None else torque
    stage, bodies = stage.on_rigid_ground(), bodies[: len(bodies) - len(stage.housings)]
    key = f"{_made_of(stage, bodies, ROLLS, ())} {at!r}"
    if key not in _SETTLED:

        def statics_with(tangents: Tangents) -> Statics:
            found = order_sections(general_sections(stage, bodies, ROLLS, (), tangents))
            return Statics.of(found, write_blob(found))

        while len(_SETTLED) >= _KEPT:
            _SETTLED.pop(next(iter(_SETTLED)))
        _SETTLED[key] = settle(stage, at, statics_with)
    return _SETTLED[key]


def _parted(stage: Stage, bodies: Sequence[Body]) -> tuple[list[Body], dict[str, Body]]:
    """The bodies of the stage's gears in their order, and those of carriers and housing by name."""
    found = stage.by_name(bodies)
    others = [own.name for own in stage.carriers] + [own.name for own in stage.housings]
    return [found[gear.name] for gear in stage.gears], {name: found[name] for name in others}


def _carried_sections(layout: Layout) -> dict[str, Any]:
    """Bodies in turning axes and their places; nothing where there are none."""
    bodies = layout.in_turning_axes
    if not bodies:
        return {}
    roots = [math.sqrt(layout.bodies[body].mass[0, 0]) for body, *_ in bodies]
    turn = [
        2 * layout.frame_of(support.first[0]) + (direction in (1, 4))
        if support.second is None and direction in (0, 1, 3, 4)
        else -1
        for support in layout.supports
        for direction in support.directions
    ]
    return {
        "support_turn": np.array([max(entry, -1) for entry in turn], np.int32),
        "carried": np.array([frame for _, frame, *_ in bodies], np.int32),
        "carried_place": np.array([[m * x, m * y] for m, (*_, x, y) in zip(roots, bodies, strict=True)]),
    }


def mount_sets(layout: Layout, bare: Layout | None = None) -> list[Group]:
    """The group as supported, and with the supports on the ground infinitely stiff, where the bodies yield there. bare:
    the layout without its housing; the supports that are held are its own then, and it is the third set."""
    standing = layout if bare is None else bare
    held = replace(standing, supports=[support.hold() for support in standing.supports])
    groups = [mount(layout)]
    try:
        groups.append(mount(held))
    except RigidSupportError:
        groups += [] if bare is None else [mount(bare)]
    return groups + ([] if bare is None else [mount(bare)])


def _port_sections(stage: Stage, group: Group, nodes: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """Kinds, numbers and static compliances of the ports, in the order of the stage."""
    rotors, ports = list(stage.rotors), list(stage.ports.values())
    kinds = [[rotors.index(stage.rotor_of(own.body)), PORT_KINDS[own.kind], own.chain is not None] for own in ports]
    plays = np.array([port.play for port in ports])
    return port_compliances(group, nodes) | {
        **({"port_play": plays} if plays.any() else {}),
        "port_kinds": np.array(kinds, np.int32).reshape(-1, 3),
        "ports": np.array([_port_numbers(port) for port in ports], float).reshape(-1, 6),
    }


def _port_numbers(port: PortSpec) -> list[float]:
    """Stiffness and damping of the port spring, then of its chain inertias, stiffness and damping."""
    chain, k = port.chain, port.k if port.k is not None else FIXED_K if port.kind == "fixed" else 1.0
    of_chain = [chain.inertia, chain.disc_inertia, chain.shaft_k, chain.shaft_c] if chain else [1.0, 1.0, 1.0, 0.0]
    return [k, port.c or 0.0, *of_chain]


def port_compliances(group: Group, nodes: Sequence[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Static compliance of the ports' bore angles among each other and to the supports."""
    residual = np.zeros((len(nodes), len(nodes)))
    for i, (body, node) in enumerate(nodes):
        for j, (other, there) in enumerate(nodes):
            if body == other:
                residual[i, j] = group.layout.bodies[body].residual[6 * node + SPIN, 6 * there + SPIN]
    return {
        "port_residual": residual,
        "port_support": np.array([group.node_supports(*node, SPIN) for node in nodes]).reshape(
            len(nodes), len(group.support_rows)
        ),
    }


def _gear_sections(
    stage: Stage, index: int, body: Body, groups: Sequence[Group], nodes: Sequence[tuple[int, int]], degrees: np.ndarray
) -> dict[str, Any]:
    """Sections of gear `index`, of its scope and in every set of ground oscillators."""
    flank = groups[0].layout.bodies[index].flank
    assert flank is not None
    name, chosen = stage.gears[index].name, flank.chosen
    meshes = sum(name in mesh.gears for mesh in stage.engagements)
    tables = flank_sections(index, groups, nodes, degrees)
    rates = turn_rates(body, chosen)
    turning = {} if rates is None else {f"turn_rate{index}": rates}
    rotor, reads = list(stage.rotors).index(stage.rotor_of(name)), tables[f"ground_list{index}_0"].size
    size = [rotor, body.toothed.teeth, chosen.size, reads, meshes > 1, *flank_sizes(flank, degrees)]
    return tables | turning | mode_sections(index, body, flank) | {f"size{index}": np.array(size, np.int32)}


def mode_sections(index: int, body: Body, flank: PartFlank) -> dict[str, np.ndarray]:
    """What the kernel knows of the modes that turn with gear `index`, but for their rows."""
    chosen = flank.chosen
    return {
        f"omega{index}": 2 * np.pi * body.frequency[chosen],
        f"zeta{index}": body.damping_ratio[chosen],
        f"diameter{index}": body.toothed.diameter[chosen].astype(np.int32),
        f"member{index}": body.toothed.part[chosen].astype(np.int32),
        f"level_modes{index}": np.searchsorted(flank.level, (RIGID, FAST, STANDARD), "right").astype(np.int32),
    }


def flank_sizes(flank: PartFlank, degrees: np.ndarray) -> tuple[int, int, bool]:
    """The last of "size": points that are stored, ground modes, whether flank 1 is the image of flank 0."""
    return flank.residual.shape[3], flank.low.size, is_mirrored(flank, degrees)


def flank_sections(
    index: int, groups: Sequence[Group], nodes: Sequence[tuple[int, int]], degrees: np.ndarray
) -> dict[str, np.ndarray]:
    """What the flanks of gear `index` read: of its gear group and in every set of ground oscillators. nodes: (body,
    node) of every port."""
    layout = groups[0].layout
    flank = layout.bodies[index].flank
    assert flank is not None
    port = np.zeros((*flank.node.shape[1:4], len(nodes)))
    port[..., [p for p, (own, _) in enumerate(nodes) if own == index]] = flank.node[0][..., SPIN, None]
    reads = [np.flatnonzero(group.owner == families(group.layout)[index]) for group in groups]
    found = flank_tables(index, flank, degrees) | {
        f"node_support{index}": node_directions(layout, index).T,
        f"port_residual{index}": port,
    }
    for s, (group, read) in enumerate(zip(groups, reads, strict=True)):
        found |= ground_tables(index, s, group, read)
    return found


def set_sections(number: int, group: Group, nodes: Sequence[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Sections of one set of ground oscillators. nodes: (body, node) of every port."""
    carried = {f"carried_rows{number}": group.carried_rows()} if group.layout.in_turning_axes else {}
    own = np.diag(group.support_compliance)
    coupling = group.support_compliance - np.diag(own)
    coupled = {f"support_coupling{number}": coupling} if coupling.any() else {}
    rotors, whirls = whirl_rows(group)
    whirling = {"whirl": rotors.astype(np.int32), f"whirl_rows{number}": whirls} if rotors.size else {}
    return (
        carried
        | whirling
        | coupled
        | {
            f"omega_ground{number}": group.omega,
            f"zeta_ground{number}": group.zeta,
            f"rigid_share{number}": group.rigid_share,
            f"damper_rows{number}": group.damper_rows,
            f"damper{number}": group.damper,
            f"support_rows{number}": group.support_rows,
            f"support_compliance{number}": own,
            f"kappa{number}": group.kappa,
            f"port_rows{number}": np.array([group.node_rows(*node, SPIN) for node in nodes]).reshape(
                len(nodes), group.omega.size
            ),
        }
    )


def port_nodes(stage: Stage, carriers: Mapping[str, Body] = MappingProxyType({})) -> list[tuple[int, int]]:
    """(body, node) of every port, in the order of the stage. carriers: reduced, by name."""
    nodes = stage_nodes(stage, carriers)
    return [nodes.find(stage, port.body, port.at, port.node) for port in stage.ports.values()]
