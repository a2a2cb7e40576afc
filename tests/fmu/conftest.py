"""FMUs that all tests of this folder share, made once per session from a small stage, and a helper to unpack them."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_stage import small_model, unpack

from gearfmu.fmu import export
from gearfmu.stagefile.tables.connections import ChainSpec


@pytest.fixture(scope="session")
def model():
    """Pinion and wheel as spring ports, tip relief."""
    return small_model()


@pytest.fixture(scope="session")
def other_model():
    """Another stage: no relief, torque port on the wheel."""
    return small_model("fzg_c", wheel={"kind": "torque"})


@pytest.fixture(scope="session")
def chain_model():
    """A third: secondary mass, clutch and input shaft compiled into the pinion's port."""
    chain = ChainSpec(inertia=0.06, disc_inertia=0.006, shaft_k=2.39e4, shaft_c=0.5)
    return small_model(pinion={"chain": chain, "k": 573.0, "c": 1.0})


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    """Where the session's FMUs lie; the name holds a space and letters beyond ASCII on purpose."""
    return tmp_path_factory.mktemp("fmus with späce#")


@pytest.fixture(scope="session")
def native(model, folder) -> Path:
    return export(model, folder / "native.fmu")


@pytest.fixture(scope="session")
def python(model, folder) -> Path:
    return export(model, folder / "python.fmu", runtime="python")


@pytest.fixture(scope="session")
def other(other_model, folder) -> Path:
    return export(other_model, folder / "other.fmu")


@pytest.fixture(scope="session")
def unpacked_chain(chain_model, folder) -> str:
    return unpack(export(chain_model, folder / "chain.fmu"), folder / "chain")


@pytest.fixture(scope="session")
def unpacked(native, folder) -> str:
    """Folder of the unpacked native FMU."""
    return unpack(native, folder / "native")


@pytest.fixture(scope="session")
def unpacked_python(python, tmp_path_factory) -> str:
    """In a plain folder: pythonfmu's binary decodes no percent escape but %20."""
    return unpack(python, tmp_path_factory.mktemp("python"))


@pytest.fixture(scope="session")
def unpacked_other(other, folder) -> str:
    return unpack(other, folder / "other")
