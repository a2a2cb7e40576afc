"""The macOS library, cross-compiled: form and names are checked, since no Mac is at hand to load it."""

from __future__ import annotations

import struct
import zipfile

import pytest

from evidence.fmu_probes.symbols import exported_symbols, load_commands, mach_slices
from gearfmu.fmu import export
from gearfmu.kernel import library_path
from gearfmu.kernel.build import build_library

INTEL, APPLE = 0x01000007, 0x0100000C  # CPU types of Apple's mach/machine.h
DYNAMIC_LIBRARY = 6
ID, LOAD, SIGNATURE, BUILD_VERSION = 0x0D, 0x0C, 0x1D, 0x32  # load commands of mach-o/loader.h


def name_in(command: bytes) -> str:
    """The library that a command names: an offset to text that ends in a zero."""
    return command[struct.unpack_from("<I", command, 8)[0] :].split(b"\0")[0].decode()


@pytest.mark.full
@pytest.mark.needs("ziglang")
def test_one_file_serves_both_processors_needs_only_the_system_and_has_the_names_of_linux(model, tmp_path, monkeypatch):
    darwin = build_library("darwin64", out=tmp_path / "kernel.dylib")
    data = darwin.read_bytes()
    count = struct.unpack_from(">I", data, 4)[0]
    entries = [struct.unpack_from(">IIIII", data, 8 + 20 * k) for k in range(count)]
    assert [entry[0] for entry in entries] == [INTEL, APPLE]
    assert all(offset % (1 << align) == 0 and align == 14 for _, _, offset, _, align in entries)
    for entry, library in zip(entries, mach_slices(data), strict=True):
        magic, processor, _, kind = struct.unpack_from("<IIII", library)
        assert (magic, processor, kind) == (0xFEEDFACF, entry[0], DYNAMIC_LIBRARY) and len(library) == entry[3]
        commands = load_commands(library)
        assert {name_in(c) for kind, c in commands if kind == LOAD} <= {"/usr/lib/libSystem.B.dylib"}
        assert [name_in(c) for kind, c in commands if kind == ID] == ["@rpath/gearfmu_kernel.dylib"]
        (version,) = [c for kind, c in commands if kind == BUILD_VERSION]
        assert struct.unpack_from("<II", version, 8) == (1, 11 << 16), "macOS 11.0"
        signed = any(kind == SIGNATURE for kind, _ in commands)
        assert signed or processor == INTEL, "Apple processors load signed code only"
    assert exported_symbols(darwin) == exported_symbols(library_path())
    found = {"darwin64": darwin, "host": library_path()}
    monkeypatch.setattr("gearfmu.fmu.package.library_path", found.__getitem__)
    with zipfile.ZipFile(export(model, tmp_path / "both.fmu", platforms=("host", "darwin64"))) as archive:
        (member,) = [name for name in archive.namelist() if name.startswith("binaries/darwin64/")]
        assert member.endswith(".dylib") and archive.read(member) == darwin.read_bytes()
