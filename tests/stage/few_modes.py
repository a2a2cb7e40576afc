"""A gear's body with its lowest modes alone."""

from __future__ import annotations

from dataclasses import replace

from gearfmu.body import Body


def with_modes(body: Body, n: int) -> Body:
    """The body with its first n modes, without rows along the profile, spin and picture; statics stay whole."""
    flank = replace(
        body.flank,
        **{name: getattr(body.flank, name)[:n] for name in ("diameter", "part", "parity")},
        rows=body.flank.rows[..., :n].copy(),
        tangent=None,
    )
    own = {name: getattr(body, name)[:n] for name in ("frequency", "damping_ratio")}
    return replace(body, **own, rows=body.rows[:, :n].copy(), flank=flank, spin=None, picture=None)
