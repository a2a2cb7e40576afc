"""Names that a shared library exports, read from the file itself: ELF (Linux), PE (Windows) and Mach-O (macOS), 64
bit, little-endian.

Nothing is loaded, so that the binaries of other systems can be checked on Linux.
Sources: System V ABI (gABI), chapters 4 and 5; Microsoft PE Format; Apple, mach-o/loader.h."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from gearfmu.errors import FmuError

DYNSYM, SECTION_UNDEFINED = 11, 0
EXPORT_DIRECTORY = 0
MACH, MACH_UNIVERSAL = b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"
MACH_TRIES = {0x80000022: 40, 0x80000033: 8}  # load command with an export trie → place of its offset
MACH_LINKER = {"_mh_dylib_header", "__dso_handle"}  # zig's linker exports its own two from every library


def exported_symbols(path: str | Path) -> set[str]:
    """Names of the functions and objects that the library at `path` exports; FmuError for any other kind of file."""
    data = Path(path).read_bytes()
    try:
        if data[:6] == b"\x7fELF\x02\x01":
            return _elf_symbols(data)
        if data[:2] == b"MZ":
            return _pe_symbols(data)
        if data[:4] in (MACH, MACH_UNIVERSAL):
            return _mach_symbols(data)
    except (struct.error, IndexError, ValueError, StopIteration, RecursionError) as error:
        raise FmuError(f"{path}: damaged library: {error}") from error
    raise FmuError(f"{path}: no 64-bit ELF, PE or Mach-O library")


def _text(data: bytes, start: int) -> str:
    return data[start : data.index(b"\0", start)].decode("ascii", "replace")


def _elf_symbols(data: bytes) -> set[str]:
    table, entry_size, count = struct.unpack_from("<Q", data, 40)[0], *struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, table + k * entry_size) for k in range(count)]
    names = set()
    for _, kind, _, _, offset, size, link, _, _, step in sections:
        if kind != DYNSYM:
            continue
        strings = sections[link][4]
        for at in range(offset, offset + size, step):
            name, info, visibility, section, _, _ = struct.unpack_from("<IBBHQQ", data, at)
            if section != SECTION_UNDEFINED and info >> 4 in (1, 2) and visibility & 3 in (0, 3):
                names.add(_text(data, strings + name))
    return names


def _pe_symbols(data: bytes) -> set[str]:
    header = struct.unpack_from("<I", data, 60)[0]
    if data[header : header + 4] != b"PE\0\0":
        raise ValueError("no PE header")
    sections, optional = struct.unpack_from("<H", data, header + 6)[0], struct.unpack_from("<H", data, header + 20)[0]
    start = header + 24
    directory = struct.unpack_from("<I", data, start + (112 if data[start : start + 2] == b"\x0b\x02" else 96))[0]
    rows = [struct.unpack_from("<IIII", data, start + optional + 40 * k + 8) for k in range(sections)]

    def place(address: int) -> int:
        for size, virtual, raw_size, raw in rows:
            if virtual <= address < virtual + max(size, raw_size):
                return address - virtual + raw
        raise ValueError(f"address {address:#x} lies in no section")

    if directory == EXPORT_DIRECTORY:
        return set()
    exports = place(directory)
    count, names = struct.unpack_from("<I", data, exports + 24)[0], struct.unpack_from("<I", data, exports + 32)[0]
    return {_text(data, place(address)) for address in struct.unpack_from(f"<{count}I", data, place(names))}


def mach_slices(data: bytes) -> list[bytes]:
    """The single libraries in a Mach-O file, one for each processor; the file itself when it is no universal one.

    Source: Apple, mach-o/fat.h and loader.h."""
    if data[:4] != MACH_UNIVERSAL:
        return [data]
    count = struct.unpack_from(">I", data, 4)[0]
    entries = [struct.unpack_from(">IIIII", data, 8 + 20 * k) for k in range(count)]
    return [data[offset : offset + size] for _, _, offset, size, _ in entries]


def load_commands(data: bytes) -> list[tuple[int, bytes]]:
    """Kind and bytes of every load command of one 64-bit Mach-O library."""
    count, at, found = struct.unpack_from("<I", data, 16)[0], 32, []
    for _ in range(count):
        kind, size = struct.unpack_from("<II", data, at)
        found.append((kind, data[at : at + size]))
        at += size
    return found


def _mach_symbols(data: bytes) -> set[str]:
    """Names in the export tries, without the underscore that C names get; the same in every slice."""
    slices = []
    for library in mach_slices(data):
        offset = next(
            struct.unpack_from("<I", content, MACH_TRIES[kind])[0]
            for kind, content in load_commands(library)
            if kind in MACH_TRIES
        )
        names = {name.decode().removeprefix("_") for name in _leaves(library[offset:], 0, b"")}
        slices.append(names - MACH_LINKER)
    if any(names != slices[0] for names in slices):
        raise ValueError("its parts export different names")
    return slices[0]


def _leaves(trie: bytes, at: int, name: bytes) -> Iterator[bytes]:
    """Names below a node of an export trie: size of the own entry, number of children, their labels and places."""
    size, at = _leb128(trie, at)
    if size:
        yield name
    at += size
    children, at = trie[at], at + 1
    for _ in range(children):
        end = trie.index(b"\0", at)
        place, following = _leb128(trie, end + 1)
        yield from _leaves(trie, place, name + trie[at:end])
        at = following


def _leb128(data: bytes, at: int) -> tuple[int, int]:
    """An unsigned number of variable length, and where the next begins."""
    value, shift = 0, 0
    while True:
        byte, at = data[at], at + 1
        value |= (byte & 0x7F) << shift
        if not byte & 0x80:
            return value, at
        shift += 7
