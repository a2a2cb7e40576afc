"""Masses and torques on the ports of a stage: one object `Drive`, whichever table of a scene describes it. Drives of a
passenger car and of a test rig are networks round the stage, and the stage's ports that belong to them.

Pinion and wheel are the stage's input and output, whatever is between them. Angles and speeds behind the output are
those of the output shaft: of a single pair, negative while the pinion turns positively."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.signals import Ramp
from gearfmu.scenefile.drivetrain import PassengerCar, ShaftLoad, TestRig
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.forms.turning import Shafts
from gearfmu.stagefile.tables.connections import ChainSpec, PortSpec

Loads = Mapping[str, ShaftLoad]
Rest = Callable[[Mapping[str, float]], Mapping[str, float]]  # torques (N·m) on ports → bores (rad) at rest


def frequencies_of(loads: Loads) -> tuple[float, ...]:
    """Hz, of the alternating torques among `loads`."""
    return tuple(load.alternating.frequency for load in loads.values() if load.alternating is not None)


@dataclass(frozen=True)
class Drive:
    """Masses, or torques, on the ports of a stage.

    ports : kind, stiffness and damping that the stage's ports need for it; the cut runs through compliant elements,
    which belong to the stage. partner : the torques by port, or a function that makes the network of masses, with
    torque ports of these names; it is given the function that finds the stage's angles at rest. start : start values
    of the stage's parameters, SI; SpecError where they cannot be found. signals : inputs of the stage that are known
    beforehand. silent : patterns of stage outputs without meaning. watched : names of clutches outside the stage, which
    split a run into parts. frequencies : Hz, of alternating torques. with_shafts : the scene with the stiffness and
    damping of other ports, where its start follows from them; None where it does not.
    """

    ports: Mapping[str, PortSpec]
    partner: Callable[[Rest], Network] | Loads
    start: Callable[[], dict[str, float]] = dict
    signals: tuple[tuple[str, Ramp], ...] = ()
    silent: tuple[str, ...] = ()
    watched: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()
    with_shafts: Callable[[Mapping[str, PortSpec]], SceneSpec] | None = None


ROLLING_SPEED = 0.1  # m/s over which rolling resistance builds up: no force at standstill
SLOWEST_TYRE = 1.0  # m/s: speed below which the tyre's damper no longer stiffens
JOINED = 1e6  # N·m: capacity that keeps the clutch of the wheel's chain closed, so that both its inertias are one


def car_drive(scene: SceneSpec, car: PassengerCar, shafts: Shafts) -> Drive:
    """A passenger car round a stage: engine, clutch and vehicle; with `chain_in_fmu` the clutch is in the stage.

    Behind an open clutch the gears turn with the vehicle, not with the engine. The wheel's chain is a clutch that stays
    closed, whose outputs say nothing."""
    if not car.chain_in_fmu:
        ports = {
            shafts.input: PortSpec(kind="spring", k=car.input_shaft_stiffness, c=car.input_shaft_damping),
            shafts.output: PortSpec(kind="spring", k=car.output_shaft_stiffness, c=car.output_shaft_damping),
        }
        return Drive(ports, lambda rest: _car(scene, car, shafts), watched=("*",))
    assert scene.clutch is not None, "a scene of a car has a clutch"
    start = {
        f"{shafts.input}.disc.w_start": scene.start.pinion_speed,
        f"{shafts.output}.disc.w_start": _wheel_speed(scene, shafts),
        f"{shafts.output}.clutch.capacity": JOINED,
    }
    return Drive(
        {shafts.input: _clutch_chain(car), shafts.output: _final_drive_chain(car)},
        lambda rest: _car(scene, car, shafts),
        start.copy,
        signals=((f"{shafts.input}.clutch.capacity", Ramp(scene.clutch.capacity)),),
        silent=(f"{shafts.output}.clutch.*", f"{shafts.output}.disc.*"),
    )


def rig_drive(scene: SceneSpec, rig: TestRig, shafts: Shafts) -> Drive:
    """A test rig round a stage: a drive with its controller, and a brake that holds its speed."""
    ports = {
        shafts.input: PortSpec(kind="spring", k=rig.pinion_shaft_stiffness, c=rig.pinion_shaft_damping),
        shafts.output: PortSpec(kind="spring", k=rig.wheel_shaft_stiffness, c=rig.wheel_shaft_damping),
    }

    def with_shafts(own: Mapping[str, PortSpec]) -> SceneSpec:
        ends = {"pinion_shaft": own[shafts.input], "wheel_shaft": own[shafts.output]}
        numbers = {f"{end}_stiffness": port.k for end, port in ends.items()}
        numbers |= {f"{end}_damping": port.c for end, port in ends.items()}
        return scene.model_copy(update={"test_rig": rig.model_copy(update=numbers)})

    return Drive(ports, lambda rest: _rig(scene, rig, shafts), with_shafts=with_shafts)


def _clutch_chain(car: PassengerCar) -> PortSpec:
    """Engine ─ [dual-mass flywheel ─ secondary mass ─ clutch ─ disc ─ input shaft] ─ pinion."""
    chain = ChainSpec(
        inertia=car.secondary_inertia,
        disc_inertia=car.disc_inertia,
        shaft_k=car.input_shaft_stiffness,
        shaft_c=car.input_shaft_damping,
    )
    return PortSpec(kind="spring", k=car.dmf_stiffness, c=car.dmf_damping, chain=chain)


def _final_drive_chain(car: PassengerCar) -> PortSpec:
    """Road wheels ─ [half shafts ─ final drive ─ output shaft] ─ wheel gear. The final drive is both inertias of a
    chain whose clutch stays closed: outside, on the stiff output shaft, it would let a communication step of 1 ms
    blow up."""
    chain = ChainSpec(
        inertia=0.5 * car.final_drive_inertia,
        disc_inertia=0.5 * car.final_drive_inertia,
        shaft_k=car.output_shaft_stiffness,
        shaft_c=car.output_shaft_damping,
    )
    half_shafts = _half_shafts(car)
    return PortSpec(kind="spring", k=half_shafts.k, c=half_shafts.c, chain=chain)


def engine_torque(car: PassengerCar) -> Callable[[float, float, float], float]:
    """Torque of a four-stroke four-cylinder engine, N·m, over the crank angle: mean and orders 2, 4, 6 (cosines, all
    at their maximum at angle zero)."""
    mean, second, fourth, sixth, cos = car.engine_torque, car.order_2, car.order_4, car.order_6, math.cos

    def torque(time: float, phi: float, w: float) -> float:
        c = cos(2.0 * phi)
        return mean + second * c + fourth * (2.0 * c * c - 1.0) + sixth * c * (4.0 * c * c - 3.0)

    return torque


def road_load(car: PassengerCar) -> Callable[[float, float, float], float]:
    """Torque of air and rolling resistance on the vehicle's inertia, N·m, referred to the output shaft, against its
    motion."""
    lever = car.road_wheel_radius / car.final_drive_ratio
    rolling, air = car.rolling_resistance * car.vehicle_mass * car.gravity, 0.5 * car.air_density * car.drag_area

    def torque(time: float, phi: float, w: float) -> float:
        v = w * lever
        return -lever * (rolling * math.tanh(v / ROLLING_SPEED) + air * v * abs(v))

    return torque


def _car(scene: SceneSpec, car: PassengerCar, shafts: Shafts) -> Network:
    engine_w = scene.start.pinion_speed + scene.start.slip
    engine = Inertia("engine", car.crank_inertia + car.dmf_primary_inertia, w=engine_w)
    nodes, tyres = _vehicle(scene, car, shafts)
    sources = (Source("combustion", "engine", engine_torque(car)), Source("road", "vehicle", road_load(car)))
    if car.chain_in_fmu:
        ports = {shafts.input: "engine", shafts.output: "wheels"}
        return Network((engine, *nodes), (tyres,), (), sources, torque_ports=ports)
    assert scene.clutch is not None, "a scene of a car has a clutch"
    secondary, disc, final_drive = (
        Inertia("secondary", car.secondary_inertia, w=engine_w),
        Inertia("disc", car.disc_inertia, w=scene.start.pinion_speed),
        Inertia("final_drive", car.final_drive_inertia, w=_wheel_speed(scene, shafts)),
    )
    flywheel = Spring("dmf", {"engine": 1.0, "secondary": -1.0}, car.dmf_stiffness, car.dmf_damping)
    return Network(
        (engine, secondary, disc, final_drive, *nodes),
        (flywheel, _half_shafts(car), tyres),
        (Clutch("clutch", "secondary", "disc", Ramp(scene.clutch.capacity), scene.clutch.peak),),
        sources,
        torque_ports={shafts.input: "disc", shafts.output: "final_drive"},
    )


def _half_shafts(car: PassengerCar) -> Spring:
    k, c = car.half_shaft_stiffness * _referred(car), car.half_shaft_damping * _referred(car)
    return Spring("half_shafts", {"final_drive": 1.0, "wheels": -1.0}, k, c)


def _referred(car: PassengerCar) -> float:
    """What stiffnesses, dampings and inertias at the road wheels are worth at the output shaft."""
    return 1.0 / car.final_drive_ratio**2


def _wheel_speed(scene: SceneSpec, shafts: Shafts) -> float:
    return scene.start.pinion_speed / shafts.ratio


def _vehicle(scene: SceneSpec, car: PassengerCar, shafts: Shafts) -> tuple[tuple[Inertia, ...], Spring]:
    """Driven wheels – tyres – vehicle with the other two wheels, all referred to the output shaft."""
    w, referred = _wheel_speed(scene, shafts), _referred(car)
    speed = max(abs(w) * car.road_wheel_radius / car.final_drive_ratio, SLOWEST_TYRE)
    tyre = car.tyre_slip_stiffness * car.road_wheel_radius**2 / speed * referred
    body = (car.vehicle_mass * car.road_wheel_radius**2 + 2.0 * car.road_wheel_inertia) * referred
    nodes = (Inertia("wheels", 2.0 * car.road_wheel_inertia * referred, w=w), Inertia("vehicle", body, w=w))
    return nodes, Spring("tyres", {"wheels": 1.0, "vehicle": -1.0}, 0.0, tyre)


def _rig(scene: SceneSpec, rig: TestRig, shafts: Shafts) -> Network:
    """Drive with its controller on the pinion's shaft; the wheel's shaft ends at constant speed. The shafts start
    twisted by the mean torque."""
    w = scene.start.pinion_speed
    twist = rig.torque / rig.pinion_shaft_stiffness + rig.torque * shafts.ratio**2 / rig.wheel_shaft_stiffness
    nodes = (Inertia("drive", rig.drive_inertia, phi=twist, w=w), Driven("brake", w=w / shafts.ratio))
    mean = rig.torque + rig.speed_droop * w
    droop = Spring("droop", {"drive": 1.0}, 0.0, rig.speed_droop)
    source = Source("motor", "drive", lambda time, phi, w: mean)
    return Network(nodes, (droop,), (), (source,), torque_ports={shafts.input: "drive", shafts.output: "brake"})
