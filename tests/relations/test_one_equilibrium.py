"""R1 at rest: the stage has one equilibrium, whichever engagement is looked at."""

from __future__ import annotations

import numpy as np
import pytest
from kinds import KINDS

from gearfmu.errors import SimulationError
from gearfmu.stage.run.te import statics_of


@pytest.mark.parametrize("name", ["pair", "internal", "train", "set"])
def test_an_equilibrium_is_seen_at_every_engagement_without_another_search(name: str) -> None:
    """A search ends within 1e-11 m, a part in 1e6 of what flanks approach by."""
    kind = KINDS[name]
    kernel = statics_of(kind.model())
    for mesh in range(len(kind.stage.engagements)):
        sought = kernel.transmission(-0.01, kind.torque, mesh)
        assert kernel.transmission_at(mesh) == sought
        kernel.transmission(-0.01, kind.torque, 0)
        seen = kernel.transmission_at(mesh)
        assert (seen.te, seen.output_te) == pytest.approx((sought.te, sought.output_te), rel=1e-6)
        assert [*seen.forces] == [*sought.forces]
        forces = [np.array([*state.forces.values()]) for state in (seen, sought)]
        assert np.abs(forces[0] - forces[1]).max() < 1e-5 * forces[1].max()


def test_after_a_step_there_is_no_equilibrium_to_see() -> None:
    model = KINDS["pair"].model().driven_by_springs()
    kernel = model.kernel(level=1.0)
    kernel.initialize()
    kernel.step(0.0, 1e-5)
    with pytest.raises(SimulationError, match="not allowed now"):
        kernel.transmission_at(0)
