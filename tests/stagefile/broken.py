"""Stage, scene and body files with a fault each, and the messages that they were refused with.

`PYTHONPATH=.:tests/stagefile python tests/stagefile/broken.py` writes the messages anew into broken.json: for
a message that was changed on purpose.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py

from gearfmu.body import load_bodies
from gearfmu.cosim.scene_run import in_drivetrain
from gearfmu.errors import GearfmuError
from gearfmu.files import seal
from gearfmu.scenefile.scene import load_scene
from gearfmu.scenes import __file__ as scenes
from gearfmu.stage import assemble
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

STORED = Path(__file__).with_suffix(".json")
Change = tuple[str, str]  # what stands there, what is written instead

# Changes of one stage file, separated by ";;"; "=>" between what stands there and what is written instead.
STAGES = {
    "fzg_c": r"""
kind = "external_pair" => kind = "bevel_pair"
kind = "external_pair" => kind = 3
name = "fzg_c" => name = "fzg c"
name = "fzg_c" => source = "here"\nname = "fzg_c"
torque_max = "600 N*m" => torque_max = "600 Nm m"
torque_max = "600 N*m" => torque_max = 600
torque_max = "600 N*m" => torque_max = "9000 N*m"
speed_max = "6000 rpm" => speed_mx = "6000 rpm"
center_distance = "91.5 mm" => center_distance = "70 mm"
center_distance = "91.5 mm" => center_distance = "96 mm"
center_distance = "91.5 mm" => center_distance = "91.5 mm"\nhelix_angle = "50 deg"
center_distance = "91.5 mm" => center_distance = "91.5 mm"\nhelix_angle = "15 deg"
backlash = "0.10 mm" => backlash = "-0.10 mm"
teeth = 16 => teeth = 16.5
teeth = 16 => teeth = 4
profile_shift = 0.1817 => profile_shift = -0.9
tip_diameter = "82.46 mm" => tip_diameter = "95 mm"
tip_diameter = "82.46 mm" => tip_diameter = "66 mm"
bore_diameter = "30 mm" => bore_diameter = "58 mm"
fillet_radius = 0.38 => fillet_radius = 0.9
strip_half_width = "0.55 mm" => strip_half_width = "0.1 mm"
stiffness = "3e8 N/m" => stiffness = "soft"
[gears.pinion.rack] => [gears.pinion.tip_relief]\namount = "20 um"\nstart_roll = "90 mm"\n[gears.pinion.rack]
[gears.pinion.rack] => [gears.pinion.tip_relief]\namount = "900 um"\nstart_roll = "9 mm"\n[gears.pinion.rack]
[gears.pinion.rack] => [gears.pinion.index_deviation]\n16 = "3 um"\n[gears.pinion.rack]
[gears.pinion.rack] => [gears.pinion.import]\nfile = "none.inp"\n[gears.pinion.rack]
[gears.wheel] => [gears.third]
[gears.wheel.material] => [gears.wheel.materials]
slices = 5 => slices = 0
[ports.wheel] => [ports.wheels]
fast_cut = "80 kHz" => fast_cut = "130 kHz"
teeth = 16 => topography = "none.csv"\nteeth = 16
teeth = 16 => #
teeth = 16 => teeth = "16"
tip_diameter = "82.46 mm" => tip_diametre = "82.46 mm"
name = "fzg_c" => zzz = 1\nname = "fzg_c"
face_width = "14 mm" => face_width = "14 kg"
profile_shift = 0.1715 => profile_shift = "0.17"
poisson_ratio = 0.3 => poisson_ratio = 0.5
slices = 5 => slices = 5\nlaw = "nodal"
k = "40e3 N*m/rad" => #
kind = "spring" => kind = "torque"\nchain = { inertia = "1 kg*m^2" }
center_distance = "91.5 mm" => center_distance = "91.5 mm"\nmisalignment = { in_plane = "10 um" }
center_distance = "91.5 mm" => center_distance = "91 mm"
center_distance = "91.5 mm" => center_distance = "92.3 mm"
profile_shift = 0.1817 => profile_shift = -0.3
tip_diameter = "82.46 mm" => tip_diameter = "84 mm"
tip_diameter = "82.46 mm" => tip_diameter = "60 mm"
tip_diameter = "82.46 mm" => tip_diameter = "92 mm" ;; addendum = 1.0 => addendum = 3.0
tip_diameter = "82.46 mm" => tip_diameter = "76 mm" ;; tip_diameter = "118.36 mm" => tip_diameter = "110 mm"
tip_diameter = "118.36 mm" => tip_diameter = "122 mm" ;; # assumed\naddendum = 1.0 => # assumed\naddendum = 2.0
tip_edge_radius = "0.2 mm" => tip_edge_radius = "2.8 mm"
strip_half_width = "0.55 mm" => strip_half_width = "9 mm"
[gears.pinion.rack] => [gears.pinion.index_deviation]\n3 = "1 mm"\n2 = "10 um"\n[gears.pinion.rack]
[gears.wheel.rack] => [gears.wheel.index_deviation]\n-1 = "5 um"\ntwo = "5 um"\n3 = 5e-6\n[gears.wheel.rack]
teeth = 16 => pitch_deviation = ["1 um", "2 um"]\nteeth = 16
[gears.pinion.rack] => [gears.pinion.profile]\ncrowning = "1 mm"\n[gears.pinion.rack]
[gears.pinion.rack] => [gears.pinion.eccentricity]\namount = "2 mm"\n[gears.pinion.rack]
[gears.pinion.rack] => [gears.pinion.deviations]\nclass = 12\n[gears.pinion.rack]
[gears.wheel.rack] => [gears.wheel.lead.end_relief]\namount = "5 um"\nlength = "8 mm"\n[gears.wheel.rack]
[gears.wheel.rack] => [gears.wheel.root_relief]\namount = "10 um"\nstart_roll = "1 mm"\n[gears.wheel.rack]
[gears.wheel.rack] => [gears.wheel.tip_relief]\namount = "9 um"\nkind = "cubic"\n[gears.wheel.rack]
torque_max => torque_maximum ;; "30 mm" => "60 mm" ;; 0.1715 => -0.9 ;; kind = "spring" => kind = "belt" ;; 210e3 => 5
"600 N*m" => 600 ;; speed_max => speed_maximum ;; "30 mm" => "60 mm" ;; "3e8 N/m" => "3e8 N/m"\naxial = "1e8 N/m"
teeth = 16 => teeth = 15.5 ;; distance = "91.5 mm" => distance = "70 mm" ;; [ports.wheel] => [ports.wheels]
""",
    "planetary54": r"""
planets = 4 => planets = 5
planets = 4 => planets = 6
planets = 4 => planets = 4\npositions = [0, 18, 36]
planets = 4 => planets = 4\nhelix_angle = "36 deg"
# pin_errors = { 0 = => pin_errors = { 4 =
center_distance = "45 mm" => center_distance = "30 mm"
center_distance = "45 mm" => center_distance = "44.6 mm"
load_sharing = 1.35 => load_sharing = 0.5
"131 mm" => "130 mm"
"131 mm" => "124 mm"
"160 mm" => "143 mm"
fillet_radius = 0.3  => fillet_radius = 0.5 
points = 6  => points = 55 
bolt_diameter = "16 mm" => bolt_diameter = "22 mm"
bolt3 = "rigid" => bolt4 = "rigid"
method = "krylov" => method = "lanczos"
bore_diameter = "40 mm" => bore_diameter = "80 mm"
start_roll = "9.1 mm" => start_roll = "29.1 mm"
torque_max = "600 N*m" => torque_max = "60000 N*m"
[sun.bearing] => [sun.bearings]
speed_max = "300 rad/s" => # none
[ring.mounts] => [ring.other]
[carrier.bearing] => [carrier.other]
[ports.sun] => [ports.moon]
axial = "1e8 N/m" => # none ;; [ports.sun] => [ports.ring] ;; speed_max = "300 rad/s" => # none
teeth = 18  => topography = "none.csv"\nteeth = 18 
"131 mm" => "138 mm"
dedendum = 1.25               # => dedendum = 1.02 #
planets = 4 => planets = 4\npositions = [0, 18, 54, 36]
planets = 4 => planets = 4\npositions = [0, 18, 36, 72]
planets = 4 => planets = 4\npositions = [0, 10, 36, 54]
planets = 4 => planet = 4
outer_diameter = "120 mm" => outer_diameter = "100 mm"
bolt3 = "rigid" => #
bolt3 = "rigid" => bolt3 = "stiff"
strip_half_width = "0.45 mm" => strip_half_width = "0.2 mm"
bore_diameter = "18 mm" => bore_diameter = "38 mm"
"131 mm" => "130 mm" ;; planets = 4 => planets = 5 ;; points = 6 => points = 60 ;; "16 mm" => "24 mm"
planets = 4 => planets = 5 ;; "16 mm" => "24 mm" ;; torque_max => torque_maximum ;; "50 mm" => 0.06
[planet.rack] => [planet.import]\nfile = "none.inp"\n[planet.rack]
""",
    "two_stage": r"""
gears = ["pinion1", "wheel1"] => gears = ["pinion1", "whel1"]
gears = ["pinion2", "wheel2"] => gears = ["pinion2", "wheel1"]
at = "170 mm" => at = "190 mm"
torsion = "rigid" => #
pinion2 = "90 mm",  => 
pinion2 = "90 mm",  => pinion2 = "80 mm", 
axis = ["103 mm", "0 mm"] => axis = ["98 mm", "0 mm"]
axis = ["103 mm", "0 mm"] => axis = ["60 mm", "0 mm"]
torque_max = "300 N*m" => torque_max = "3000 N*m"
name = "input_left" => name = "input_right"
normal_module = "3.0 mm" => normal_module = "2.75 mm"
helix_angle = "-20 deg" => helix_angle = "20 deg"
to = "input_shaft" => to = "output_shaft"
kind = "gear" => kind = "gera"
kind = "shaft" => kind = "carrier"
bore_diameter = "12 mm" => bore_diameter = "35 mm"
[bodies.pinion1.material] => [bodies.pinion1.bearing]\nstiffness = "1e8 N/m"\n\n[bodies.pinion1.material]
[ports.input] => [ports.input]\nnode = 3
axis = ["0 mm", "0 mm"] => axis = ["0 mm", "0 mm"]\ncarried_by = "output"
radial = "2.5e8 N/m"\naxial = "2e8 N/m"\ntilt = "1e4 N*m/rad" => #
start_roll = "outer_single_contact" => start_roll = "outer"
teeth = 25 => topography = "none.csv"\nteeth = 25
body = "output_shaft"\nat = "170 mm" => body = "output_shaft"
radial = "2.5e8 N/m" => radial = "2.5e8 N*m"
"30 mm", bore_diameter = "0 mm" } => "30 mm", bore = "0 mm" }
modal_damping = 0.005 => modal_dampin = 0.005
teeth = 25 => teeth = 4
"wheel1"] => "wheel9"] ;; body = "output_shaft"\nat = "170 mm" => body = "shaft" ;; slices = => slicess =
"wheel1"] => "wheel9"] ;; body = "output_shaft"\nat = "170 mm" => body = "output_shaft"\nat = "970 mm"
[bodies.wheel2.material] => [bodies.wheel2.import]\nfile = "none.inp"\n[bodies.wheel2.material]
""",
    "two_stage/stage_bearings": r"""
bearing = "6306" => bearing = "6307x"
bearing = "6306" => bearing = "6306"\nradial = "1e8 N/m"
bearing = "6306" => bearing = "6306"\ncarries = "+z"
bearing = "6306" => axial = "1e8 N/m"\nspan = "2 mm"
[operating]\ntorque = "100 N*m" => #
outside = "72 mm" => outside = "72 mm"\ncontact_angle = "9°"
outside = "72 mm" => outside = "72 mm"\npreload = "300 N"
outside = "72 mm" => outside = "28 mm"
outside = "72 mm" => outside = "72 mm"\nballs = 14
outside = "72 mm" => outside = "72 mm"\nball_diameter = "25 mm"
outside = "72 mm" => outside = "72 mm"\nclearence = "1 um"
clearance = "10 um" => clearance = "10 mm"
kind = "ball" => kind = "bal"
width = "16 mm" => width = "16 mm"\npreload = "9 N"
width = "16 mm" => #
""",
    "helical_demo/stage_bearings": r"""
rolling = "7305" => rolling = "7306"
rolling = "7305" => rolling = "7305"\nspann = "1 mm"
span = "70 mm" => #
contact_angle = "30 deg" => contact_angle = "70 deg"
""",
    "two_stage/stage_housed": r"""
node = "input_left" => node = "input_lef"
to = "housing"\nnode = "input_left" => to = "housing"
body = "housing"\nnode = "foot0" => body = "housing"\nnode = "input_left"
body = "housing"\nnode = "foot0" => body = "housing"\nnode = "foot0"\nat = "10 mm"
body = "housing"\nnode = "foot0" => body = "housing"\nnode = "foot0"\nto = "input_shaft"
seats = { => seats = { foot0 = "FOOT0",
top = "SENSOR_TOP" => a_name_that_is_too_long = "SENSOR_TOP"
file = "housing.inp" => file = "house.inp"
""",
}
SCENES = {
    "pair_loaded": r"""
duration = "0.15 s" => duration = "0.15 m"
settle = "0.05 s" => settle = "0.5 s"
level = "standard" => level = "best"
slices = 5 => slices = 50
name = "fzg_c/stage_relief" => name = "fzg"
master = "gs_mean" => master = "gauss"
step = "20 us" => step = "7 us"
pinion_speed = "2000 rpm" => slip = "20 rad/s"
torque = "302 N*m" => torqe = "302 N*m"
[test_rig] => [rig]
[test_rig] => [passenger_car]\n[test_rig]
[test_rig] => [deformation]\ngears = ["moon"]\n[test_rig]
[test_rig] => [deformation]\ngears = ["wheel"]\n[test_rig]
[test_rig] => [deformation]\ngears = ["wheel"]\ntimes = ["1 ms", "9 s"]\nevery = "1 us"\n[test_rig]
[test_rig] => [stage.effects]\nbearing = false\nhertz = 0\n[test_rig]
name = "pair_loaded" => name = "Pair Loaded"
duration = "0.15 s" => duration = "0.15"
master = "gs_mean" => mastr = "gs_mean"
step = "20 us" => step = "20 us"\nmicro_step = "50 us"
pinion_speed = "2000 rpm" => pinion_speed = 100
pinion_speed = "2000 rpm" => pinion_speed = "2000 rpm"\nslip = "1 rad/s"
""",
    "clutch_closure": r"""
capacity = [["0 s", "0 N*m"], ["50 ms", "250 N*m"]] => capacity = [["50 ms", "0 N*m"], ["0 s", "250 N*m"]]
slip = "52 rad/s" => wheel_speed = "52 rad/s"
capacity = [["0 s", "0 N*m"] => capacity = [["0 s", "-5 N*m"]
[clutch]\ncapacity = [["0 s", "0 N*m"], ["50 ms", "250 N*m"]] => #
[clutch] => [clutch]\npeak = 1.2
""",
    "planetary_paper": r"""
[shaft_loads.sun] => [shaft_loads.moon]
[shaft_loads.carrier] => [shaft_loads.planet]
name = "planetary54" => name = "fzg_c"
name = "planetary54" => name = "two_stage"
gears = ["ring"] => gears = []
times = ["33 ms", "66 ms", "0.1 s"] => times = ["33 ms", "0.2 s"]
constant = "600 N*m" => constants = "600 N*m"
constant = "600 N*m" => #
constant = "600 N*m" => constant = "5 N"\nalternating = { amplitude = "-1 N*m" }
constant = "600 N*m" => over_time = [["2 ms", "1 N*m"], ["1 ms", "1 N*m"]]
speed = "340 rad/s" => speed = "0 rad/s"
[shaft_loads.sun] => [test_rig]\ntorque = "1 N*m"\n[shaft_loads.sun]
""",
    "planetary_shift": r"""
on = "turbine" => on = "turbin"
["output", "vehicle"] => ["output", "output"]
["drum", "ground"] => ["drums", "ground"]
["35 ms", "0 N*m"] => ["25 ms", "0 N*m"]
drive = { on = "turbine" => drum = { on = "ground"
[drivetrain.torques] => [clutch]\ncapacity = [["0 s", "1 N*m"]]\n[test_rig]\ntorque = "1 N*m"\n[drivetrain.torques]
""",
    "train_runup": r"""
[drivetrain.ports.input] => [drivetrain.ports.entry]
on = "machine" => on = "engine"
name = "two_stage" => name = "fzg_c"
name = "two_stage" => name = "planetary54"
inertia = "0.5 kg*m^2" => inertia = "0 kg*m^2"
input_speed = "1800 rpm" => clutch_speed = "1800 rpm"
""",
}


def _read(change: str) -> list[Change]:
    pairs = [part.split(" => ") for part in change.split(" ;; ")]
    return [(old.replace("\\n", "\n"), new.replace("\\n", "\n")) for old, new in pairs]


def _changed(text: str, changes: list[Change]) -> str:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def _stage(name: str, changes: list[Change], folder: Path) -> None:
    path, shipped = folder / "stage.toml", find_stage(name)
    text = shipped.read_text(encoding="utf-8").replace('base = "', f'base = "{shipped.parent.as_posix()}/')
    for deck in shipped.parent.glob("*.inp"):
        (folder / deck.name).symlink_to(deck)
    path.write_text(_changed(text, changes), encoding="utf-8")
    stage = load_stage(path)
    assemble(stage, load_bodies(load_stage(name)))


def _scene(name: str, changes: list[Change], folder: Path) -> None:
    path = folder / "scene.toml"
    text = (Path(scenes).parent / f"{name}.toml").read_text(encoding="utf-8")
    path.write_text(_changed(text, changes), encoding="utf-8")
    scene = load_scene(path)
    in_drivetrain(scene, load_stage(scene.stage.name))


def _spoilt(file: str, spoil: Callable[[Path], None], name: str, folder: Path) -> None:
    """In the folder of a shipped stage: copies of its file and of one body, links to the other bodies."""
    for path in find_stage(name).parent.glob("*"):
        if path.name in (file, "stage.toml"):
            (folder / path.name).write_bytes(path.read_bytes())
        else:
            (folder / path.name).symlink_to(path)
    spoil(folder / file)
    load_bodies(load_stage(folder))


def _edited(edit: Callable[[h5py.File], None]) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        with h5py.File(path, "r+") as file:
            edit(file)
        seal(path)

    return spoil


def _first_dataset(file: h5py.File) -> str:
    names: list[str] = []
    file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return sorted(names)[0]


def _replaced(old: str, new: str) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        stage = path.parent / "stage.toml"
        stage.write_text(_changed(stage.read_text(encoding="utf-8"), [(old, new)]), encoding="utf-8")

    return spoil


SPOILT: dict[str, Callable[[Path], None]] = {
    "missing": Path.unlink,
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-4096]),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-1] + bytes([path.read_bytes()[-1] ^ 1])),
    "other format": _edited(lambda file: file.attrs.modify("format", "gearfmu-trace")),
    "other version": _edited(lambda file: file.attrs.modify("format_version", 9)),
    "lost dataset": _edited(lambda file: file.__delitem__(_first_dataset(file))),
    "other numbers": _replaced('density = "7850 kg/m^3"', 'density = "7800 kg/m^3"'),
}
BODIES = {"fzg_c": "pinion.h5", "planetary54": "carrier.h5", "two_stage": "wheel2.h5"}


def cases() -> dict[str, Callable[[Path], None]]:
    """What is done in an empty folder and refused, by its name."""
    found: dict[str, Callable[[Path], None]] = {}
    for read, texts in ((_stage, STAGES), (_scene, SCENES)):
        for name, text in texts.items():
            found |= {f"{name}: {line}": partial(read, name, _read(line)) for line in text.strip("\n").splitlines()}
    for name, file in BODIES.items():
        found |= {f"{name}/{file}: {how}": partial(_spoilt, file, spoil, name) for how, spoil in SPOILT.items()}
    return found


def message(case: Callable[[Path], None], folder: Path) -> list[str]:
    """The lines that it is refused with, the folder left away; none where it is not refused."""
    try:
        case(folder)
    except GearfmuError as error:
        said = f"{type(error).__name__}: {error}".replace(str(folder), "…")
        shipped = str(find_stage("fzg_c").parents[1])
        return re.sub(r"0x[0-9a-f]+", "0x…", said.replace(shipped, "shipped")).splitlines()
    return []


if __name__ == "__main__":
    stored = {}
    for case_name, todo in cases().items():
        with tempfile.TemporaryDirectory() as temporary:
            stored[case_name] = message(todo, Path(temporary))
    STORED.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
