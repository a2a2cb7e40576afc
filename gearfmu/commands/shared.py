"""Shared by several verbs: quantities with units as options, progress bars, printing of name–value lists."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

LEVELS = ("rigid", "fast", "standard", "full", "paper", "explicit")
Progress = Callable[..., None]
_EVERY = 9.0  # s between lines of progress where there is no terminal
PATH = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


class Quantity(click.ParamType):
    """An option such as "302 N*m": a number with a unit of the given kind, handed on in SI. name: its range
    (`gearfmu.quantities`)."""

    def __init__(self, name: str) -> None:
        from gearfmu.quantities import range_of, usual_unit

        self.range = range_of(name)
        self.unit = self.range.unit
        self.name = f'"<number> {usual_unit(self.unit)}"'

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """As the option takes it: click would write the unit in capitals."""
        return self.name

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """SI value of the text; a usage error when number or unit are missing or of another kind, SpecError where it
        is out of range."""
        if isinstance(value, float):
            return value
        from gearfmu.errors import Problem, SpecError, UnitError
        from gearfmu.quantities import to_si

        try:
            number = to_si(value, self.unit)
        except UnitError as error:
            self.fail(str(error), param, ctx)
        if refusal := self.range.refusal(number):
            field = "" if param is None else param.opts[0].lstrip("-")
            raise SpecError([Problem("", field, str(value), refusal)])
        return number


def quantity(option: str, help: str, name: str = "", **how: Any) -> Callable[[Any], Any]:
    """An option that takes a Quantity. name: its range, that of the option's name when not given."""
    return click.option(option, type=Quantity(name or option.removeprefix("--")), help=help, **how)


def level_option(command: Callable[..., object]) -> Callable[..., object]:
    """--level, which means the same on every verb that computes."""
    return click.option("--level", type=click.Choice(LEVELS), help="Fidelity level, standard when not given.")(command)


def stage_names(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """Shipped stages that begin so, for the completion of shells; files where there is none."""
    from gearfmu.stagefile.reading.files import shipped_stages

    return _completed(shipped_stages(), begun)


def scene_names(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """As `stage_names` for scenes."""
    from gearfmu.scenefile.scene import shipped_scenes

    return _completed(shipped_scenes(), begun)


def _completed(names: Iterable[str], begun: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(begun)] or [CompletionItem(begun, type="file")]


@contextmanager
def progress_bar(title: str, named: Callable[[str], str] | None = None) -> Iterator[Progress]:
    """A progress bar on standard error when that is a terminal, else lines (`Told`).

    Yields `report(fraction, text="")` with fraction 0 … 1: long functions take it as `progress`.
    """
    if not sys.stderr.isatty():
        with Told(title, named) as told:
            yield told
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    with Bar(
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=console, transient=True
    ) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda fraction, text="": bar.update(task, completed=fraction, description=f"{title} {text}".strip())


class Told:
    """Lines of progress on standard error: one every `_EVERY` seconds with the present task, its share done and
    for how long nothing new was heard; and one for every new `named(text)`, where that is given."""

    def __init__(self, title: str, named: Callable[[str], str] | None = None) -> None:
        self.title, self._named = title, named
        self._seen, self._doing = set[str](), ""
        self._last = self._heard = time.monotonic()
        self._end, self._lock = threading.Event(), threading.Lock()

    def __enter__(self) -> Told:
        threading.Thread(target=self._beat, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()

    def __call__(self, fraction: float | None, text: str = "") -> None:
        """The present task, and the share of it that is done; None where that is not known."""
        text, share = text.removeprefix(f"{self.title} "), "" if fraction is None else f"{100 * fraction:.0f} %"
        self._doing, self._heard = ", ".join(part for part in (text, share) if part), time.monotonic()
        if self._named and (part := self._named(text)) not in self._seen:
            self._seen.add(part)
            click.echo(f"{self.title} {part} …", err=True)
        else:
            self._tell_if_due()

    def _beat(self) -> None:
        """Reports also while no news arrives."""
        while not self._end.wait(0.1 * _EVERY):
            self._tell_if_due()

    def _tell_if_due(self) -> None:
        with self._lock:
            now = time.monotonic()
            if now - self._last < _EVERY:
                return
            self._last, silent = now, now - self._heard
            since = f", for {silent:.0f} s" if silent > 0.5 * _EVERY else ""
            click.echo(f"{self.title} {self._doing or 'at work'}{since}", err=True)


def echo_pairs(pairs: Mapping[str, object], indent: str = "") -> None:
    """Print a nested name–value mapping, aligned; numbers with six digits."""
    width = max((len(str(key)) for key in pairs), default=0)
    for key, value in pairs.items():
        if isinstance(value, (list, tuple)) and value and isinstance(value[0], Mapping):
            value = {str(item.get("name", number)): item for number, item in enumerate(value)}
        if isinstance(value, Mapping):
            click.echo(f"{indent}{key}")
            echo_pairs(value, indent + "  ")
        else:
            click.echo(f"{indent}{key:<{width}}  {_shown(value)}")


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_shown(item) for item in value)
    return str(value)
