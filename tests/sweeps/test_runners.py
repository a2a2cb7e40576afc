"""Workers of this machine: results of all arguments, whoever dies on the way."""

from __future__ import annotations

from pathlib import Path

from gearfmu.sweeps.runners import TRIES, Lost, on_this_machine


def test_a_worker_that_dies_is_replaced_and_only_its_argument_is_tried_again(tmp_path: Path) -> None:
    """The second argument ends its worker the first time and is computed the second time; the third always ends it."""
    mark = tmp_path / "been_here"
    once = f"__import__('pathlib').Path({str(mark)!r})"
    arguments = [
        "20 + 22",
        f"1 if {once}.exists() else ({once}.touch(), __import__('os')._exit(9))",
        "__import__('os')._exit(7)",
        "print('noise on standard output') or 3",
    ]
    found = dict(on_this_machine(2)(eval, arguments))
    lost = found.pop(2)
    assert found == {0: 42, 1: 1, 3: 3} and mark.exists()
    assert isinstance(lost, Lost) and f"{TRIES} worker processes" in lost.message and "code 7" in lost.message


def test_workers_end_with_a_sweep_that_is_broken_off() -> None:
    results = on_this_machine(2)(eval, ["__import__('os').getpid()", *["__import__('time').sleep(60)"] * 3])
    _, pid = next(results)
    results.close()
    assert not Path(f"/proc/{pid}").exists()
