"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gearfmu.errors import OutputError

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
