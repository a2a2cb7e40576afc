"""What far teeth leave out under friction: errors of planetary54 at lower levels with and without it, printed.

    python evidence/far_friction.py

Far teeth carry loads along the path of contact from one engagement to the next, those along the profile they do not
(docs/theory.md, 3.14). Scene planetary_paper, 3 to 6 ms, five slices, 1.25 µs, against level full at 0.625 µs with the
same friction. A minute and a half.
"""

from __future__ import annotations

from gearfmu.body import load_bodies
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.spec.tables.ports import FrictionSpec
from gearfmu.stage import assemble
from gearfmu.study.bench import Point, measure
from gearfmu.study.norm import errors

FRICTIONS = (0.0, 0.05, 0.1)
REFERENCE, LEVELS, H = Point("full", "dg4", 0.625e-6, 5), ("standard", "fast"), 1.25e-6


def main() -> None:
    """Measure and print a line a level and coefficient."""
    scene = load_scene("planetary_paper").model_copy(update={"settle": 3e-3, "duration": 6e-3})
    spec = load_stage("planetary54")
    bodies = load_bodies(spec)
    print("coefficient,level,te_error,force_error")
    for coefficient in FRICTIONS:
        friction = FrictionSpec(coefficient=coefficient) if coefficient else None
        contact = spec.contact.model_copy(update={"friction": friction})
        model = assemble(spec.model_copy(update={"contact": contact}), bodies)
        wanted = measure(scene, model, REFERENCE).signals
        for level in LEVELS:
            found = errors(measure(scene, model, Point(level, "dg4", H, 5)).signals, wanted)
            print(f"{coefficient:g},{level},{found.te:.4f},{found.force:.4f}", flush=True)


if __name__ == "__main__":
    main()
