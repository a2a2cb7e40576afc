"""Sound of a body with a skin: its radiation matrix, made by the reduction, in NAME.sound.h5 beside the body's file.

It is no part of the body's file: the number of boundary elements is a choice of who listens. Another choice changes
neither the hash of the body nor those of models and FMUs that are made of it.
"""

from __future__ import annotations

from pathlib import Path

from gearfmu.body.body import Body
from gearfmu.sound import Radiation, Skin, SoundError, radiation, skin_of
from gearfmu.sound.store import load_radiation, save_radiation

PATCHES = 1000  # boundary elements of the reduction


def sound_path(path: Path) -> Path:
    """Where the radiation matrix of the body stored at `path` lies."""
    return path.with_suffix(".sound.h5")


def body_skin(body: Body) -> Skin:
    """The skin of a body with the shapes of all its coordinates. SoundError where it has none, or one with holes."""
    if body.skin is None:
        raise SoundError(f"{body.name} has no skin: superelements and matrices without a mesh have none")
    return skin_of(body.skin.points, body.skin.faces, body.skin.skin_modes)


def make_radiation(body: Body, path: Path | None, patches: int | None = None) -> Radiation:
    """The radiation matrix of a body, also written to `path`, so that `kept_radiation` finds it."""
    found = radiation(body_skin(body), count=patches or PATCHES)
    if path is not None:
        save_radiation(found, path, body.how.hash)
    return found


def kept_radiation(body: Body, path: Path, patches: int | None = None) -> Radiation | None:
    """The matrix of a file that is of this body, and of so many patches if given; None where there is none."""
    if not path.exists():
        return None
    found, made_of = load_radiation(path)
    return found if made_of == body.how.hash and patches in (None, found.patches) else None
