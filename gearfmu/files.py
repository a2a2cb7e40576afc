"""Files of ours: written whole or not at all. HDF5 files are named by format and version, and sealed with a SHA-256 of
their bytes.

The seal lies in the user block, 512 bytes before the HDF5 part that HDF5 leaves to its users, and is checked before the
HDF5 library reads anything. Its own checksums cover no more than the data of a chunk: from a damaged index chunks
vanish, and read as zeros; damaged heaps can keep the library busy for ever.

What a file of a body holds is said once, at the fields of the classes that hold it (`stored`): shape, unit, meaning."""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from gearfmu.errors import GearfmuError, OutputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # disk, quota and limit of a process


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path` and rename it to `path` when the block succeeds.

    A block that fails, and a process that is killed, leave the old file as it was. Missing folders are made. The
    temporary name keeps the suffix, for writers that choose the format by it. OutputError where nothing can be written
    there, or the disk is full.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"{target}: cannot be written, it is a folder: name a file")
    temporary = target.with_name(f".{target.stem}-{os.getpid()}-{secrets.token_hex(4)}{target.suffix}")
    _try(target, temporary)
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        if error.errno not in FULL:
            raise
        remedy = "make room, or choose another folder; what was there is as it was"
        raise OutputError(f"{target}: cannot be written, {error.strerror or error}: {remedy}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _try(target: Path, temporary: Path) -> None:
    """Makes missing folders and an empty file, which it takes away again. OutputError, which names the file asked for,
    where that cannot be."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
        temporary.unlink()
    except OSError as error:
        remedy = "choose another folder, or make this one writable"
        raise OutputError(f"{target}: cannot be written, {error.strerror or error}: {remedy}") from error


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` to `path` as UTF-8, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


USER_BLOCK = 512  # bytes, the smallest that HDF5 allows
_MARK = b"gearfmu "
TABLE_BITS = 23  # of compliances; what this costs a model: docs/decisions/bodies.md
ROW_BITS = 21  # of rows in modes and of the coupling of modes
PICTURE_BITS = 7
ENTRY = "entry"
_DAMAGE = (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError)


@dataclass(frozen=True)
class Entry:
    """One array of a body and dataset of its file.

    shape: in symbols or numbers. kind: in memory, "f8" doubles, "f4" singles (pictures), "i8" integers. bits: 0, the
    file holds the numbers themselves; else whole multiples of a step, which the largest number has fewer than 2^bits
    of, and along the roll points (R) those of its cosine transform. each: a step for every index of the first axis
    instead of one for all. optional: None where it was not made. field: attribute path in `body.Body`.
    """

    shape: tuple[str | int, ...]
    unit: str
    meaning: str
    kind: str = "f8"
    bits: int = 0
    each: bool = False
    optional: bool = False
    field: str = ""

    @property
    def path(self) -> str:
        """Name of the dataset."""
        return self.field.replace(".", "/")


def stored(shape: tuple[str | int, ...], unit: str, meaning: str, kind: str = "f8", **how: Any) -> Any:
    """A field of a dataclass that is an `Entry`; an optional one is None unless it is given."""
    entry = Entry(shape, unit, meaning, kind, **how)
    return field(default=None, metadata={ENTRY: entry}) if entry.optional else field(metadata={ENTRY: entry})


def entries(kind: Any, path: str = "") -> Iterator[Entry]:
    """The stored fields of a dataclass, or of an object of it, that stands at `path` ("flank.") in a body."""
    for own in fields(kind):
        if ENTRY in own.metadata:
            yield replace(own.metadata[ENTRY], field=f"{path}{own.name}")


@dataclass(frozen=True)
class Format:
    """A kind of file: `name` and `version` as they stand in it, `noun` for people, the error and the remedy when it
    cannot be read. form: version of HDF5 whose form it has, by h5py's name, None: the oldest that will do. former:
    names and versions that are read as well."""

    name: str
    version: int
    noun: str
    error: type[GearfmuError]
    remedy: str
    form: str | None = None
    former: tuple[tuple[str, int], ...] = ()

    @property
    def names(self) -> set[str]:
        """Names of the formats that are read."""
        return {self.name, *dict(self.former)}


@contextmanager
def writing(path: str | os.PathLike[str], kind: Format) -> Iterator[h5py.File]:
    """An open file under a temporary name; sealed and renamed to `path` when the block succeeds."""
    with written_whole(path) as temporary:
        with h5py.File(temporary, "w", libver=kind.form, userblock_size=USER_BLOCK) as file:
            file.attrs["format"] = kind.name
            file.attrs["format_version"] = kind.version
            yield file
        seal(temporary)


@contextmanager
def reading(path: str | os.PathLike[str], kind: Format) -> Iterator[h5py.File]:
    """The open file, its seal, format and version checked.

    Raises kind.error, with the file's name and the remedy, when it is missing, damaged, or of another kind or version,
    and for whatever goes wrong in the block because of what the file holds.
    """
    source = Path(path)
    try:
        _check_seal(source, kind.noun)
        with h5py.File(source, "r") as file:
            _check_format(file, kind)
            yield file
    except GearfmuError as error:
        raise kind.error(f"{source}: {error}; {kind.remedy}") from None
    except _DAMAGE as error:
        raise kind.error(f"{source}: no sound {kind.noun} file ({error}); {kind.remedy}") from error


def format_of(path: str | os.PathLike[str]) -> tuple[str, int]:
    """Name and version of the format of one of our HDF5 files. GearfmuError for a file that is none, or damaged."""
    try:
        _check_seal(Path(path), "gearfmu HDF5")
    except GearfmuError as error:
        raise GearfmuError(f"{path}: {error}") from None
    with h5py.File(path, "r") as file:
        return str(file.attrs["format"]), int(file.attrs["format_version"])


def seal(path: str | os.PathLike[str]) -> None:
    """Write the SHA-256 of a file's HDF5 part into its user block."""
    with open(path, "r+b") as file:
        file.seek(USER_BLOCK)
        text = _MARK + _hash_of_rest(file)
        file.seek(0)
        file.write(text.ljust(USER_BLOCK, b"\n"))


def _check_seal(path: Path, noun: str) -> None:
    if not path.is_file():
        raise GearfmuError(f"no such {noun} file")
    with path.open("rb") as file:
        head = file.read(USER_BLOCK)
        if not head.startswith(_MARK):
            raise GearfmuError(f"no {noun} file, or one of an earlier gearfmu")
        if head != (_MARK + _hash_of_rest(file)).ljust(USER_BLOCK, b"\n"):
            raise GearfmuError("damaged, or changed by another program: its bytes do not match their SHA-256")


def _hash_of_rest(file: BinaryIO) -> bytes:
    digest = hashlib.sha256()
    while piece := file.read(1 << 20):
        digest.update(piece)
    return digest.hexdigest().encode()


def _check_format(file: h5py.File, kind: Format) -> None:
    name, known = file.attrs.get("format"), ((kind.name, kind.version), *kind.former)
    if name not in kind.names:
        raise kind.error(f"not a {kind.name.replace('-', ' ')}; 'gearfmu inspect' shows its kind")
    version, read = int(file.attrs["format_version"]), sorted({own for of, own in known if of == name})
    if version not in read:
        raise kind.error(f"{kind.noun} format {version}, this gearfmu reads {' and '.join(map(str, read))}")
