"""Chart of what reductions cost: every row is drawn where its numbers say."""

from __future__ import annotations

from pathlib import Path

from evidence.reduction.methods.charts import write_cost_chart


def test_a_line_a_method_and_a_tick_a_mesh(tmp_path: Path) -> None:
    by_mesh = [
        {"method": method, "dof": dof, "inputs": 24, "seconds": 1e-4 * dof * k, "memory_MB": 0.02 * dof}
        for k, method in enumerate(("modal", "krylov"), 1)
        for dof in (3390, 66846)
    ]
    by_inputs = [{**row, "inputs": 6 if row["dof"] < 1e4 else 24} for row in by_mesh]
    written = write_cost_chart(by_mesh, by_inputs, tmp_path / "cost", "Carrier")
    assert [p.name for p in written] == ["cost.svg", "cost.png"]
    text = written[0].read_text(encoding="utf-8")
    for shown in ("block Krylov", "modal truncation", "3390", "66846", "memory, MB", ">24<", "Carrier"):
        assert shown in text, shown
