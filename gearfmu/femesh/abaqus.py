"""Nodes, elements and node sets of an Abaqus or CalculiX deck.

A reader of our own, because meshio 5.3 ends the process at lower-case element types, keeps only the last of several
*NODE blocks, returns sets that name other sets empty, ignores where an *INSTANCE is placed, and drops the node numbers
that the matrices of CalculiX are sorted by. Everything that is no mesh (materials, steps, contact) is skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem.bulk_data import mesh_text
from gearfmu.femesh.mesh import LabelledMesh

SOLIDS = {"C3D8": ("hexahedron", 8), "C3D20": ("hexahedron20", 20), "C3D10": ("tetra10", 10)}
# Solids that are recognised, so that they can be refused by name.
OTHER_SOLIDS = {"C3D4": ("tetra", 4), "C3D6": ("wedge", 6), "C3D15": ("wedge15", 15), "C3D27": ("hexahedron27", 27)}
_SUFFIXES = ("", "R", "I", "H", "RH", "IH", "M", "MH", "RI", "RS", "HS")


@dataclass
class _Deck:
    """The mesh of a deck so far, in the numbers of the file.

    nodes : label → coordinates. cells : kind → element label → node labels. sets : name in capitals → node labels, "*"
    before that of a set of elements. instances : how many there were.
    """

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    cells: dict[str, dict[int, list[int]]] = field(default_factory=dict)
    sets: dict[str, list[int]] = field(default_factory=dict)
    instances: int = 0


@dataclass(frozen=True)
class _Block:
    """One keyword line with its parameters and data lines. place: "file:line"."""

    keyword: str
    parameters: dict[str, str]
    rows: list[list[str]]
    place: str


def read_deck(path: Path) -> LabelledMesh:
    """The mesh of a deck. MeshError, with file and line, for what would be read wrongly: a second or moved instance,
    nodes in another system of coordinates, unknown solid elements, a set or file that is not there."""
    deck = _Deck()
    readers = {"NODE": _nodes, "ELEMENT": _elements, "NSET": _node_set, "INSTANCE": _instance, "SYSTEM": _system}
    for block in _blocks(path):
        if block.keyword in readers:
            try:
                readers[block.keyword](deck, block)
            except (ValueError, IndexError) as error:
                raise MeshError(
                    f"{block.place}: *{block.keyword} cannot be read ({error}): correct this line"
                ) from None
    labels = np.array(sorted(deck.nodes), dtype=int)
    return LabelledMesh(
        labels,
        np.array([deck.nodes[label] for label in labels]).reshape(-1, 3),
        {kind: np.array(list(block.values())) for kind, block in deck.cells.items()},
        {name: np.array(own, dtype=int) for name, own in deck.sets.items() if not name.startswith("*")},
    )


def _blocks(path: Path, depth: int = 0) -> Iterator[_Block]:
    """The keyword blocks of a deck, those of its *INCLUDE files in their place."""
    for block in _grouped(path, mesh_text(path)):
        if block.keyword == "INCLUDE":
            if depth > 8:
                raise MeshError(f"{block.place}: files include each other more than eight deep: put them into one")
            yield from _blocks(path.parent / block.parameters.get("INPUT", ""), depth + 1)
        else:
            yield block


def _grouped(path: Path, text: str) -> Iterator[_Block]:
    block: _Block | None = None
    pending = ""
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or pending:
            line, pending = pending + line, ""
            if line.endswith(","):
                pending = line
                continue
            if block is not None:
                yield block
            block = _keyword(line, f"{path}:{number}")
        elif block is not None:
            block.rows.append([item.strip() for item in line.split(",")])
    if block is not None:
        yield block


def _keyword(line: str, place: str) -> _Block:
    head, *words = [word.strip() for word in line[1:].split(",")]
    pairs = [word.partition("=") for word in words]
    return _Block(
        " ".join(head.upper().split()), {k.strip().upper(): v.strip().strip('"') for k, _, v in pairs}, [], place
    )


def _nodes(deck: _Deck, block: _Block) -> None:
    if block.parameters.get("SYSTEM", "R").upper() != "R":
        raise MeshError(f"{block.place}: nodes in cylindrical or spherical coordinates: write them in x, y, z")
    labels = []
    for row in block.rows:
        label, *point = (item for item in row if item)
        x, y, z = ([float(value.replace("D", "E").replace("d", "e")) for value in point] + [0.0, 0.0, 0.0])[:3]
        deck.nodes[int(label)] = (x, y, z)
        labels.append(int(label))
    if "NSET" in block.parameters:
        deck.sets.setdefault(block.parameters["NSET"].upper(), []).extend(labels)


def _elements(deck: _Deck, block: _Block) -> None:
    given = block.parameters.get("TYPE", "").upper()
    known = {name + suffix: kind for name, kind in (SOLIDS | OTHER_SOLIDS).items() for suffix in _SUFFIXES}
    if given not in known:
        if given.startswith(("C3D", "SC8", "CSS8")):
            raise MeshError(
                f"{block.place}: solid elements of type {given} are not known here: use {', '.join(SOLIDS)}"
            )
        return
    kind, count = known[given]
    numbers = [int(item) for row in block.rows for item in row if item]
    if len(numbers) % (count + 1):
        raise MeshError(f"{block.place}: {given} needs {count} nodes an element; the block ends within an element")
    cells = deck.cells.setdefault(kind, {})
    table = np.array(numbers).reshape(-1, count + 1)
    cells.update(zip(table[:, 0].tolist(), table[:, 1:].tolist(), strict=True))
    if "ELSET" in block.parameters:
        deck.sets.setdefault(f"*{block.parameters['ELSET'].upper()}", []).extend(np.unique(table[:, 1:]).tolist())


def _node_set(deck: _Deck, block: _Block) -> None:
    name = block.parameters.get("NSET", "").upper()
    found = deck.sets.setdefault(name, [])
    if "ELSET" in block.parameters:
        found.extend(_named_set(deck, f"*{block.parameters['ELSET'].upper()}", name, block.place))
    for row in block.rows:
        items = [item for item in row if item]
        if "GENERATE" in block.parameters:
            first, last, step = ([int(item) for item in items] + [1])[:3]
            found.extend(range(first, last + 1, step))
            continue
        for item in items:
            plain = item.rpartition(".")[2].strip('"')
            found.extend([int(plain)] if plain.isdigit() else _named_set(deck, plain.upper(), name, block.place))


def _named_set(deck: _Deck, wanted: str, name: str, place: str) -> list[int]:
    if wanted not in deck.sets:
        raise MeshError(
            f"{place}: the node set {name} is made of the set {wanted.lstrip('*')}, which is not defined above it"
        )
    return list(deck.sets[wanted])


def _instance(deck: _Deck, block: _Block) -> None:
    deck.instances += 1
    if deck.instances > 1:
        raise MeshError(f"{block.place}: a second *INSTANCE: write the body as one mesh (flat deck, without instances)")
    if any(float(item) != 0.0 for row in block.rows[:1] for item in row if item) or len(block.rows) > 1:
        raise MeshError(
            f"{block.place}: this *INSTANCE is moved or turned, which is not applied here: write the deck flat, or "
            "place the part itself"
        )


def _system(deck: _Deck, block: _Block) -> None:
    if block.rows:
        raise MeshError(f"{block.place}: *SYSTEM moves the nodes that follow: write them in global x, y, z")
