"""Form of the kernel's C sources: order of folders, lengths, parameters, headers. Violations of today are listed
(tests/c_sources.py writes the list); none may be added, and one that is mended is taken off."""

from __future__ import annotations

from pathlib import Path

import pytest
from c_sources import ORDER, RULES, SOURCES, Sources, alone, gone, new, stored

HEADERS = sorted(str(p.relative_to(SOURCES)) for p in SOURCES.rglob("*.h"))
LIST_ANEW = "mend it, or if it is meant: python tests/c_sources.py --write"


@pytest.fixture(scope="module")
def sources() -> Sources:
    return Sources.below()


def test_no_rule_is_broken_anew(sources: Sources) -> None:
    found = new(sources.broken(), stored())
    assert not found, f"{found}: {LIST_ANEW}"


def test_the_list_holds_nothing_that_is_mended(sources: Sources) -> None:
    assert not gone(sources.broken(), stored()), "take these off the list: python tests/c_sources.py --write"


def test_every_folder_has_a_place_in_the_order() -> None:
    assert {p.name for p in SOURCES.iterdir() if p.is_dir()} == set(ORDER)


@pytest.mark.parametrize("header", HEADERS)
def test_a_header_needs_none_before_it(header: str) -> None:
    assert not alone(SOURCES / header)


def test_functions_that_are_not_static_are_declared_in_a_header(sources: Sources) -> None:
    declared = {f.name for s in sources.files.values() if s.header for f in s.functions if f.body is None}
    inline = {f.name for s in sources.files.values() if s.header for f in s.functions if f.body is not None}
    assert not sources.defined.keys() - declared - inline - {n for n in sources.defined if n.startswith("fmi2")}
    assert not declared - sources.defined.keys()  # and each of those is defined


def test_what_the_parser_reads_of_the_kernel(sources: Sources) -> None:
    """A parser that finds nothing would let everything pass."""
    assert sources.defined["gk_step_once"] == "integrate/gk_step.c"
    assert sources.defined["gk_clamp"] == "base/gk_lanes.h"
    assert sum(f.body is not None for s in sources.files.values() for f in s.functions) > 800
    step = next(f for f in sources.files["run/gk_comm.c"].functions if f.name == "gk_step")
    assert step.parameters == 6 and "gk_outputs_end" in (step.body or "")


BROKEN = {  # rule → files that break it, and how it is told
    "includes": ({"base/a.c": '#include "model/m.h"\n', "model/m.h": ""}, "base/a.c includes model/m.h"),
    "calls": (
        {
            "setup/a.c": "static void up(void)\n{\n    gk_f(1);\n}\n",
            "run/f.c": "void gk_f(int x)\n{\n    (void)x;\n}\n",
        },
        "setup/a.c up uses gk_f of run/f.c",
    ),
    "lines": ({"base/a.c": "\n" * 401}, "base/a.c"),
    "parameters": (
        {"base/a.c": "int f(int a, int b, int c, int (*d)(int, int), int e, int g, int h)\n{\n    return 0;\n}\n"},
        "base/a.c f",
    ),
    "headers": (
        {
            "base/a.h": "void f(void);\nvoid g(void);\n",
            "base/f.c": "void f(void) {}\n",
            "base/g.c": "void g(void) {}\n",
        },
        "base/a.h",
    ),
    "names": (
        {
            "base/a.h": "typedef int a_t;\n",
            "base/b.h": '#include "base/a.h"\n',
            "base/c.h": '#include "base/b.h"\na_t x(void);\n',
        },
        "base/c.h uses base/a.h",
    ),
}


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_finds_what_breaks_it(rule: str, tmp_path: Path) -> None:
    files, told = BROKEN[rule]
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    found = Sources.below(tmp_path).broken()
    assert told in found[rule]
    nothing: dict[str, dict[str, int]] = {r: {} for r in RULES}
    assert any(told in line for line in new(found, nothing)) and gone(nothing, {**nothing, rule: {told: 1}})
