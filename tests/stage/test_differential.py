"""A planetary set as a differential: sun, ring and carrier turn, each on a port of its own. Its spins have two motions,
and whichever ports decide them, the third shaft follows by Willis' equation."""

from __future__ import annotations

import pytest
from driven import begun

from gearfmu.stage import StageModel
from tests.relations.kinds import KINDS, assembled, bodies_of

RATIO = 54 / 18  # teeth of the ring over teeth of the sun
WOUND = 100.0 / 20e3  # rad: what the sun's spring is wound up
PLAY = 0.06e-3 / 22.5e-3  # rad at the sun: half the backlash of either mesh over its reference radius
PLACES = [(0.0, 0.0), (0.3, -0.2), (5.0, 3.0)]  # rad: carrier, ring


def differential(ports: tuple[str, str, str]) -> StageModel:
    """The paper's set, its ring free to turn, with spring ports in this order."""
    kind = KINDS["set"]
    stage = kind.stage
    springs = {name: port.model_copy(update={"kind": "spring"}) for name, port in stage.ports.items()}
    springs["ring"] = springs["sun"].model_copy(update={"body": "ring"})
    free = stage.model_copy(
        update={
            "rotors": stage.rotors | {"ring": stage.rotors["ring"].model_copy(update={"stands": False})},
            "supports": tuple(
                s.model_copy(update={"torsion": None} if s.name == "ring" else {}) for s in stage.supports
            ),
            "ports": {name: springs[name] for name in ports},
        }
    )
    return assembled(free, bodies_of(kind.file))


def at_rest(model: StageModel, carrier: float, ring: float) -> tuple[float, float, float, float]:
    """Angle of the sun less that of Willis (rad); torques of sun, ring and carrier (N·m), the sun's spring wound up."""
    sun = (1 + RATIO) * carrier - RATIO * ring
    kernel = begun(model.kernel(level=1.0), {"carrier.phi": carrier, "ring.phi": ring, "sun.phi": sun + WOUND})
    turned = {name: kernel.get(f"{name}.gear.phi") for name in ("sun", "ring", "carrier")}
    astray = turned["sun"] - (1 + RATIO) * turned["carrier"] + RATIO * turned["ring"]
    return (astray, *(kernel.get(f"{name}.tau") for name in ("sun", "ring", "carrier")))


@pytest.mark.parametrize(
    "ports", [("ring", "carrier", "sun"), ("carrier", "ring", "sun"), ("sun", "ring", "carrier")], ids="-".join
)
def test_whichever_ports_decide_the_third_shaft_follows_by_willis(ports: tuple[str, str, str]) -> None:
    model = differential(ports)
    for place in PLACES:
        astray, sun, ring, carrier = at_rest(model, *place)
        assert astray == pytest.approx(PLAY, rel=0.1)  # the rest is the yield of teeth and shafts
        assert sun < -1.0
        assert ring == pytest.approx(RATIO * sun, rel=1e-2)
        assert carrier == pytest.approx(-(1 + RATIO) * sun, rel=1e-2)
