"""What many tests of one process would make again: bodies read, models assembled and opened, kernels prepared.

Each is a function of its arguments alone, so `share()` keeps its results by them; a test that changes an input gets a
result of its own. Kept arrays cannot be written to.
"""

from __future__ import annotations

import ctypes
import sys
import weakref
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache, wraps
from pathlib import Path

import numpy as np

import gearfmu.body.bodies as bodies
import gearfmu.stage.assembly.assemble as assembly
from gearfmu.kernel import instance

SHIPPED = Path(__file__).resolve().parents[1] / "reduced_models"
PREPARED = 6e9  # bytes of the largest setups of the kernels that are kept; a tenth of them is used
MODELS = 24  # opened models, and assembled ones of the same bodies


def share() -> None:
    """Keep results for the life of this process."""
    bodies.load_body = _read_once(bodies.load_body)
    everywhere(assembly.assemble, _assembled_once(assembly.assemble))
    instance._opened = lru_cache(MODELS)(instance._opened.__wrapped__)
    instance.Kernel.prepare = _prepared_once(instance.Kernel.prepare)


def everywhere(old: Callable[..., object], new: Callable[..., object]) -> None:
    """Put `new` in the place of `old` in all modules that have imported it by its name."""
    for module in list(sys.modules.values()):
        if getattr(module, old.__name__, None) is old:
            setattr(module, old.__name__, new)


def _read_once(load: Callable[[Path], object]) -> Callable[[Path], object]:
    @lru_cache
    def known(path: Path, _time: int, _size: int) -> object:
        return _frozen(load(path))

    @wraps(load)
    def read(path: Path) -> object:
        path = Path(path).resolve()
        if SHIPPED not in path.parents or not path.is_file():
            return load(path)
        return known(path, path.stat().st_mtime_ns, path.stat().st_size)

    return read


def _frozen(value: object) -> object:
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif is_dataclass(value):
        for field in fields(value):
            _frozen(getattr(value, field.name))
    return value


def _assembled_once(assemble: Callable[..., object]) -> Callable[..., object]:
    kept: OrderedDict[tuple[object, ...], list[tuple[object, object, object]]] = OrderedDict()

    @wraps(assemble)
    def found(spec: object, of: Sequence[object], rolls: int = assembly.ROLLS, observe: Sequence[str] = ()) -> object:
        key = (type(spec), rolls, tuple(observe), *map(id, of))
        for known, _, model in kept.get(key, ()):
            if known == spec:
                kept.move_to_end(key)
                return model
        model = assemble(spec, of, rolls, observe)
        kept.setdefault(key, []).append((spec, tuple(of), model))  # with the bodies: their ids stay theirs
        del kept[key][:-MODELS]
        if len(kept) > MODELS:
            kept.popitem(last=False)
        return model

    return found


@dataclass(frozen=True)
class Prepared:
    """Memory of a prepared kernel, with its work as prepared, but for the zeros behind `head`."""

    setup: tuple[ctypes.Array, int]
    work: tuple[ctypes.Array, int]
    head: bytes
    size: int
    warning: str
    model: object  # kept open


def _prepared_once(prepare: Callable[[instance.Kernel], None]) -> Callable[[instance.Kernel], None]:
    """gk_prepare reads the model and its parameters and fills setup and work. A kernel that is prepared as a former
    one, which is no more, takes over its memory: setup is constant since, the head of work is put back."""
    free: OrderedDict[tuple[object, ...], list[Prepared]] = OrderedDict()
    value = instance.Kernel.get  # of the product, whatever a test puts in its place

    def give_back(key: tuple[object, ...], memory: Prepared) -> None:
        free.setdefault(key, []).append(memory)
        free.move_to_end(key)
        while sum(len(one.setup[0]) for ones in free.values() for one in ones) > PREPARED:
            free.popitem(last=False)

    @wraps(prepare)
    def found(kernel: instance.Kernel) -> None:
        if former := kernel.__dict__.pop("_gives_back", None):  # prepared once more
            former()
            kernel._setup_keep, kernel._setup = instance.aligned(len(kernel._setup_keep))
            kernel._work_keep, kernel._work = instance.aligned(len(kernel._work_keep))
            return prepare(kernel)
        key = (id(kernel._opened), *(value(kernel, name) for name in _parameters(kernel)))
        if ones := free.get(key):
            memory = ones.pop()
            ctypes.memmove(memory.work[1], memory.head, len(memory.head))
            ctypes.memset(memory.work[1] + len(memory.head), 0, memory.size - len(memory.head))
        else:
            prepare(kernel)
            size = len(kernel._work_keep) - (kernel._work - ctypes.addressof(kernel._work_keep))
            used = _used(kernel._work, size)
            setup, work = (kernel._setup_keep, kernel._setup), (kernel._work_keep, kernel._work)
            memory = Prepared(setup, work, ctypes.string_at(kernel._work, used), size, kernel.warning, kernel._opened)
        (kernel._setup_keep, kernel._setup), (kernel._work_keep, kernel._work) = memory.setup, memory.work
        kernel.warning = memory.warning
        kernel._gives_back = weakref.finalize(kernel, give_back, key, memory)
        kernel._gives_back.atexit = False

    return found


def _used(start: int, size: int) -> int:
    """Bytes up to the last one that is not zero, in whole pages."""
    page = 1 << 16
    for end in range(-(-size // page) * page, 0, -page):
        words = (ctypes.c_uint64 * (min(page, size - end + page) // 8)).from_address(start + end - page)
        if np.frombuffer(words, np.uint64).any():
            return min(end, size)
    return 0


def keep(kernel: instance.Kernel) -> None:
    """For a test that writes to a setup: nobody takes this one over."""
    if gives_back := kernel.__dict__.pop("_gives_back", None):
        gives_back.detach()


def _parameters(kernel: instance.Kernel) -> list[str]:
    return [name for name, variable in kernel.variables.items() if variable.causality == "parameter"]
