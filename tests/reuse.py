"""What many tests of one process would make again: bodies read, models assembled and opened, kernels prepared.

Each is a function of its arguments alone, so `share()` keeps its results by them; a test that changes an input gets a
result of its own. Kept arrays cannot be written to.
"""

from __future__ import annotations

import ctypes
import mmap
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
PREPARED = 2e9  # bytes of the pages that kept kernels have touched; a planetary set at level fast takes .1e9
MAPPED = 10e9  # bytes of kept memory, touched or not: a fork has to find room for all of it
LIMITS = (("size", PREPARED), ("mapped", MAPPED))
PAGE = mmap.PAGESIZE
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
    """Memory of a prepared kernel; `head`: what its work holds then, by address, zero elsewhere; size: of the pages
    that both have touched, bytes; mapped: of all of it."""

    setup: tuple[ctypes.Array, int]
    work: tuple[ctypes.Array, int]
    head: list[tuple[int, bytes]]
    size: int
    mapped: int
    warning: str
    model: object  # kept open

    @classmethod
    def of(cls, kernel: instance.Kernel) -> Prepared:
        setup, work = (kernel._setup_keep, kernel._setup), (kernel._work_keep, kernel._work)
        head = [(start, ctypes.string_at(start, length)) for start, length in _touched(work[0])]
        size = sum(length for _, length in _touched(setup[0])) + sum(len(own) for _, own in head)
        return cls(setup, work, head, size, len(setup[0]) + len(work[0]), kernel.warning, kernel._opened)

    def put_back(self) -> None:
        for start, length in _touched(self.work[0]):
            ctypes.memset(start, 0, length)
        for start, own in self.head:
            ctypes.memmove(start, own, len(own))


def _prepared_once(prepare: Callable[[instance.Kernel], None]) -> Callable[[instance.Kernel], None]:
    """gk_prepare reads the model and its parameters and fills setup and work. A kernel that is prepared as a former
    one, which is no more, takes over its memory: setup is constant since, work is put back."""
    free: OrderedDict[tuple[object, ...], list[Prepared]] = OrderedDict()

    def give_back(key: tuple[object, ...], memory: Prepared) -> None:
        free.setdefault(key, []).append(memory)
        free.move_to_end(key)
        while any(sum(getattr(one, what) for ones in free.values() for one in ones) > most for what, most in LIMITS):
            free.popitem(last=False)

    @wraps(prepare)
    def found(kernel: instance.Kernel) -> None:
        if former := kernel.__dict__.pop("_gives_back", None):  # prepared once more
            former()
            kernel._setup_keep, kernel._setup = instance.aligned(len(kernel._setup_keep))
            kernel._work_keep, kernel._work = instance.aligned(len(kernel._work_keep))
            return prepare(kernel)
        key = (id(kernel._opened), _parameters(kernel))
        if ones := free.get(key):
            memory = ones.pop()
            memory.put_back()
        else:
            prepare(kernel)
            memory = Prepared.of(kernel)
        (kernel._setup_keep, kernel._setup), (kernel._work_keep, kernel._work) = memory.setup, memory.work
        kernel.warning = memory.warning
        kernel._gives_back = weakref.finalize(kernel, give_back, key, memory)
        kernel._gives_back.atexit = False

    return found


def _parameters(kernel: instance.Kernel) -> bytes:
    """The values of all its parameters but speeds at the start, which gk_prepare does not read."""
    known = (name for name, own in kernel.variables.items() if own.causality == "parameter")
    references = kernel.references(name for name in known if not name.endswith(".w_start"))
    values = (ctypes.c_double * len(references))()
    kernel.get_many(references, values)
    return bytes(values)


def _touched(memory: ctypes.Array) -> list[tuple[int, int]]:
    """Address and length of all runs of pages that were read or written; zero elsewhere. Linux tells; all of the memory
    where the system does not."""
    start, end = ctypes.addressof(memory), ctypes.addressof(memory) + len(memory)
    first, last = start // PAGE, -(-end // PAGE)
    try:
        with open("/proc/self/pagemap", "rb") as pages:
            pages.seek(8 * first)
            there = np.frombuffer(pages.read(8 * (last - first)), np.uint64) >> 62  # in memory or swapped out
    except OSError:
        return [(start, len(memory))]
    edges = PAGE * (first + np.flatnonzero(np.diff((there > 0).astype(np.int8), prepend=0, append=0)).reshape(-1, 2))
    return [(begin, past - begin) for begin, past in np.clip(edges, start, end).tolist()]


def keep(kernel: instance.Kernel) -> None:
    """For a test that writes to a setup: nobody takes this one over."""
    if gives_back := kernel.__dict__.pop("_gives_back", None):
        gives_back.detach()
