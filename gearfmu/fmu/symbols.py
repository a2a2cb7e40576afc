"""Names that a shared library exports, read from the file itself: ELF (Linux) and PE (Windows), 64 bit, little-endian.

Nothing is loaded, so that a Windows binary can be checked on Linux.
Sources: System V ABI (gABI), chapters 4 and 5; Microsoft PE Format."""

from __future__ import annotations

import struct
from pathlib import Path

from gearfmu.errors import FmuError

DYNSYM, SECTION_UNDEFINED = 11, 0
EXPORT_DIRECTORY = 0


def exported_symbols(path: str | Path) -> set[str]:
    """Names of the functions and objects that the library at `path` exports; FmuError for any other kind of file."""
    data = Path(path).read_bytes()
    try:
        if data[:6] == b"\x7fELF\x02\x01":
            return _elf_symbols(data)
        if data[:2] == b"MZ":
            return _pe_symbols(data)
    except (struct.error, IndexError, ValueError) as error:
        raise FmuError(f"{path}: damaged library: {error}") from error
    raise FmuError(f"{path}: neither a 64-bit ELF nor a PE library")


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
