"""Gmsh's mesh format 4.1 (its default), as text or binary: nodes, solid elements, physical groups.

Source: Gmsh reference manual, "MSH file format". meshio numbers the blocks of this format wrongly where an entity is
in no physical group, and fails where all entities are saved; format 2.2 it reads well.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.femesh.mesh import LabelledMesh

_TYPES = {
    1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8), 6: ("wedge", 6),
    7: ("pyramid", 5), 8: ("line3", 3), 9: ("triangle6", 6), 10: ("quad9", 9), 11: ("tetra10", 10),
    12: ("hexahedron27", 27), 13: ("wedge18", 18), 14: ("pyramid14", 14), 15: ("vertex", 1), 16: ("quad8", 8),
    17: ("hexahedron20", 20), 18: ("wedge15", 15), 19: ("pyramid13", 13),
}  # fmt: skip
_VTK_ORDER = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron20": [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
}
_REMEDY = "save the mesh again as 'MSH 4.1' or 'MSH 2.2'"


def is_format_4(path: Path) -> bool:
    """Whether the file says that it has format 4."""
    with path.open("rb") as file:
        return file.readline().strip() == b"$MeshFormat" and file.readline().startswith(b"4")


def read_gmsh(path: Path) -> LabelledMesh:
    """Nodes, solids and physical groups of a file of format 4.1. MeshError for another version, a file that ends early
    and elements of an order above two."""
    file, names, groups = _File(path), {}, {}
    nodes, labels = np.empty((0, 3)), np.empty(0, int)
    solids: dict[str, list[np.ndarray]] = {}
    sets: dict[str, list[np.ndarray]] = {}
    for section in file.sections():
        if section == "PhysicalNames":
            names = _names(file)
        elif section == "Entities":
            groups = _groups(file)
        elif section == "PartitionedEntities":
            raise MeshError(f"{path}: the mesh is partitioned: save it without partitions")
        elif section == "Nodes":
            nodes, labels = _nodes(file)
        elif section == "Elements":
            for place, kind, cells in _elements(file):
                if place[0] == 3:
                    solids.setdefault(kind, []).append(cells)
                for name in {names[group] for group in groups.get(place, ()) if group in names}:
                    sets.setdefault(name, []).append(cells.ravel())
    order = np.argsort(labels)
    joined = ({name: np.concatenate(blocks) for name, blocks in parts.items()} for parts in (solids, sets))
    return LabelledMesh(labels[order], nodes[order], *joined)


class _File:
    """The file, read from its beginning on: sections, and the numbers in them."""

    def __init__(self, path: Path) -> None:
        self.path, self._data, self._at = path, path.read_bytes(), 0
        self._words: list[bytes] | None = None
        self._line()
        version, binary, size = self._line().split()[:3]
        if version != b"4.1":
            raise MeshError(f"{path}: format {version.decode()} is not read: {_REMEDY}")
        self._binary = binary == b"1"
        order = "<" if self._data[self._at : self._at + 1] == b"\1" or not self._binary else ">"
        self._kinds = {"int": f"{order}i4", "size": f"{order}u{int(size)}", "real": f"{order}f8"}

    def sections(self) -> Iterator[str]:
        """Names of the sections behind the header; each is left when the next is asked for."""
        self._leave("MeshFormat")
        while self._at < len(self._data):
            line = self._line().strip()
            if line.startswith(b"$"):
                name = line[1:].decode(errors="replace")
                end = self._data.find(f"$End{name}".encode(), self._at)
                if end < 0:
                    raise self._ended(name)
                self._words = None if self._binary else self._data[self._at : end].split()[::-1]
                yield name
                self._leave(name)

    def lines(self, count: int) -> list[str]:
        """The next lines, text in either form."""
        return [self._line().decode(errors="replace").strip() for _ in range(count)]

    def numbers(self, kind: str, count: int) -> np.ndarray:
        """The next numbers: "int", "size" or "real"."""
        wanted = float if kind == "real" else np.int64
        if self._words is not None:
            if count > len(self._words):
                raise self._ended("section")
            taken = [self._words.pop() for _ in range(count)]
            return np.array(taken).astype(wanted) if taken else np.empty(0, wanted)
        own = np.dtype(self._kinds[kind])
        if self._at + count * own.itemsize > len(self._data):
            raise self._ended("section")
        found = np.frombuffer(self._data, own, count, self._at)
        self._at += count * own.itemsize
        return found.astype(wanted)

    def count(self) -> int:
        """The next number, which counts something."""
        return int(self.numbers("size", 1)[0])

    def _line(self) -> bytes:
        end = self._data.find(b"\n", self._at)
        line = self._data[self._at : end if end >= 0 else len(self._data)]
        self._at += len(line) + 1
        return line

    def _leave(self, name: str) -> None:
        mark = f"$End{name}".encode()
        end = self._data.find(mark, self._at)
        if end < 0:
            raise self._ended(name)
        self._at = end + len(mark)

    def _ended(self, what: str) -> MeshError:
        return MeshError(f"{self.path}: not a gmsh file that can be read (the {what} ends early): {_REMEDY}")


def _names(file: _File) -> dict[tuple[int, int], str]:
    """(dimension, tag) of a physical group → its name."""
    found = {}
    for line in file.lines(int(file.lines(1)[0])):
        dimension, tag, name = line.split(maxsplit=2)
        found[int(dimension), int(tag)] = name.strip('"')
    return found


def _groups(file: _File) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """(dimension, tag) of an entity → its physical groups. A negative tag is a group that sees it turned round."""
    found = {}
    for dimension, entities in enumerate(file.numbers("size", 4)):
        for _ in range(entities):
            tag = int(file.numbers("int", 1)[0])
            file.numbers("real", 3 if dimension == 0 else 6)
            found[dimension, tag] = [(dimension, abs(int(own))) for own in file.numbers("int", file.count())]
            if dimension:
                file.numbers("int", file.count())
    return found


def _nodes(file: _File) -> tuple[np.ndarray, np.ndarray]:
    blocks, *_ = file.numbers("size", 4)
    points, labels = [np.empty((0, 3))], [np.empty(0, np.int64)]
    for _ in range(blocks):
        dimension, _, parametric = file.numbers("int", 3)
        count = file.count()
        labels.append(file.numbers("size", count))
        width = 3 + (dimension if parametric else 0)
        points.append(file.numbers("real", width * count).reshape(count, width)[:, :3])
    return np.concatenate(points), np.concatenate(labels)


def _elements(file: _File) -> Iterator[tuple[tuple[int, int], str, np.ndarray]]:
    """Blocks: (dimension, tag) of the entity, type, node labels (E, k) in VTK order."""
    blocks, *_ = file.numbers("size", 4)
    for _ in range(blocks):
        dimension, tag, number = (int(value) for value in file.numbers("int", 3))
        if number not in _TYPES:
            raise MeshError(f"{file.path}: elements of Gmsh type {number} are not read: mesh with order 1 or 2")
        kind, size = _TYPES[number]
        count = file.count()
        cells = file.numbers("size", count * (1 + size)).reshape(count, 1 + size)[:, 1:]
        yield (dimension, tag), kind, cells[:, _VTK_ORDER.get(kind, range(size))]
