"""Numbers that the C sources and Python both state, where neither reads the other: they are equal here."""

from __future__ import annotations

import hashlib
import re

import pytest

from gearfmu.body import toothed
from gearfmu.kernel import binding, instance
from gearfmu.kernel.build import sources
from gearfmu.stage.assembly import assemble, blob, compact, meshes, teeth

COMMENT = re.compile(r"/\*.*?\*/", re.S)


def said(file: str, name: str) -> int:
    """The number that a C source gives to an enumerator or a macro."""
    text = COMMENT.sub("", next(p for p in sources() if p.name == file).read_text(encoding="utf-8"))
    found = re.findall(rf"\b{name}(?: =)? (\d+)\b", text)
    assert len(found) == 1, f"{file}: {name}"
    return int(found[0])


def shape(field: str) -> list[str]:
    """Dimensions of an array of the blob, as gk_fields.inc has them."""
    text = next(p for p in sources() if p.name == "gk_fields.inc").read_text(encoding="utf-8")
    found = re.search(rf"^GK_FIELD\(\w+, {field}, \w+, \"\??([^\"]*)\"", text, re.M)
    assert found is not None, field
    return found[1].split()


@pytest.mark.parametrize(
    ("file", "name", "number"),
    [
        ("gk.h", "GK_ABI", binding.ABI),
        ("gk.h", "GK_MESSAGE", binding.MESSAGE),
        ("gk_model.c", "MODEL_VERSION", assemble.MODEL_VERSION),
        ("gk_model.h", "LEADS", teeth.FLANK_WIDTHS),
        ("gk_model.h", "OFFSETS", len(teeth.OFFSETS)),
        ("gk_model.h", "OFFSETS", 2 * toothed._OFFSETS + 1),
        ("gk_setup.h", "FAR", compact.RANK),
        ("gk_vars.c", "INSTANCES", instance.INSTANCES),
        ("gk_data.h", "MAX_PAIRS", instance.PLACES),
        ("gk_ranges.h", "GK_HIGH_SLICES", instance.SLICES),
        ("gk_blob.c", "FORMAT", blob.FORMAT),
        ("gk_blob.c", "HEADER", blob.HEADER.size),
        ("gk_blob.c", "ENTRY", blob.ENTRY.size),
        ("gk_blob.c", "NAME", blob.LONGEST_NAME + 1),
        ("gk_blob.c", "ALIGNMENT", blob.ALIGNMENT),
        ("gk_blob.c", "HASHED_FROM", blob.HASHED_FROM),
        ("gk_blob.c", "MOST_SECTIONS", blob.MOST_SECTIONS),
    ],
)
def test_a_number_of_c_is_that_of_python(file: str, name: str, number: int) -> None:
    assert said(file, name) == number


def test_arrays_of_the_blob_are_as_long_as_the_kernel_reads_them() -> None:
    assert shape("lead")[-1] == str(said("gk_model.h", "LEADS"))
    assert shape("far_rows")[-1] == shape("far_ground")[1] == str(said("gk_setup.h", "FAR"))


def test_python_keeps_below_the_capacities() -> None:
    assert said("gk_model.h", "MAX_FUNCTIONS") >= teeth.MOST_FUNCTIONS
    assert said("gk_model.h", "MAX_FLANK_ROLLS") >= teeth.FLANK_ROLLS
    assert said("gk_model.h", "MAX_FLANK_PLACES") >= teeth.FLANK_WIDTHS


def test_laws_of_friction_are_in_one_order() -> None:
    text = next(p for p in sources() if p.name == "gk_setup.h").read_text(encoding="utf-8")
    laws = re.search(r"enum gk_friction_law \{([^}]*)\}", text)
    assert laws is not None
    assert tuple(law.strip().removeprefix("FRICTION_").lower() for law in laws[1].split(",")) == meshes.LAWS


def test_a_model_knows_the_table_of_variables() -> None:
    """Else a kernel with other value references would answer to the GUID of a description made before."""
    table = next(p for p in sources() if p.name == "gk_variables.inc").read_bytes().replace(b"\r\n", b"\n")
    assert hashlib.sha256(table).hexdigest().startswith(assemble.VARIABLES)
