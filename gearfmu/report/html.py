"""The report of one run: report.html, the data of every plot as CSV, summary.json."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from gearfmu.body import Body
from gearfmu.files import write_text
from gearfmu.report import heading, housing, page, sections
from gearfmu.report.chart import Plot
from gearfmu.report.choice import chosen_plots, turning
from gearfmu.report.plan import plan_sections
from gearfmu.report.results import energy_balance, strict
from gearfmu.report.run import Run
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.trace import Trace, write_columns
from gearfmu.stagefile.forms.general import Stage

NVH = ("spectrum", "orders", "spectrogram")
RUN_UP = ("spectrogram_speed", "orders_map", "orders_speed")


def write(
    trace: Trace,
    summary: Mapping[str, object],
    out_dir: str | os.PathLike[str],
    spec: Stage | None = None,
    bodies: Sequence[Body] | None = None,
    deformation: Deformation | None = None,
) -> Path:
    """Write report.html, summary.json and data/<plot>.csv into `out_dir` and return the path of the page.

    trace : any subset of channels; figures of a missing channel are left out, with a remark where it matters.
    summary : fields of docs/file-formats.md; missing ones are shown as "not given".
    spec : the stage, for tooth numbers; bodies : its Body objects, for statics and the turning gears;
    deformation : of gears at chosen times, drawn where bodies are given too. Raises OSError when the folder cannot be
    written.
    """
    folder, run = Path(out_dir), Run(trace, summary, spec, bodies, deformation)
    results = run.results | energy_balance(trace)
    made, missing = chosen_plots(run)
    for plot in made:
        write_columns(folder / "data" / f"{plot.name}.csv", plot.columns)
    write_text(folder / "summary.json", json.dumps(strict({**summary, "results": results}), indent=2) + "\n")
    write_text(folder / "report.html", _document(run, made, missing))
    return folder / "report.html"


def _document(run: Run, made: Sequence[Plot], missing: Sequence[str]) -> str:
    summary, title = run.summary, ", ".join([run.stage_name, *heading.operating_point(run)])
    about = [run.title, *(str(summary[key]) for key in ("description", "started") if summary.get(key))]
    over_speed = [plot for plot in made if plot.name in RUN_UP]
    over_frequency = [plot for plot in made if plot.name.startswith(NVH) and plot.name not in RUN_UP]
    of_housing = [plot for plot in made if plot.name.startswith(housing.NAME)]
    others = [plot for plot in made if not plot.name.startswith((*NVH, housing.NAME))]
    octaves = sections.octaves(run)
    view = turning(run)
    body = [
        page.head(title, str(summary.get("outcome", "outcome not given")), " · ".join(about)),
        page.tiles(sections.tiles(run)),
        page.facts(sections.facts(summary)),
        *[page.warning(f"{text[:1].upper()}{text[1:]}.") for text in summary.get("warnings") or ()],
        page.contents(_links(over_speed, others, over_frequency, of_housing)),
        *([page.section("Not shown", *[page.note(reason) for reason in missing])] if missing else []),
        *(sections.warned(run.trace) if over_speed else []),
        *[page.figure(plot) for plot in over_speed],
        *([page.stage_view("The deformed stage, turning", view.caption, view.most)] if view is not None else []),
        *(sections.planets(run) or [page.section("Results", sections.results(run), name="results")]),
        *plan_sections(run.trace.meta.get("plan")),
        *[page.figure(plot) for plot in others],
        *([] if over_speed else sections.warned(run.trace)),
        *([page.section("Octave bands", octaves, name="octaves")] if octaves else []),
        *[page.figure(plot) for plot in over_frequency],
        *[page.figure(plot) for plot in of_housing],
        page.section("Accuracy and cost", *sections.accuracy(run), name="accuracy"),
        page.details(
            "Where it comes from", page.pairs_table(sections.provenance(summary)), sections.channels(run.trace)
        ),
    ]
    return page.page(f"{run.title} – {run.stage_name}", body, made, view)


def _links(
    over_speed: Sequence[Plot], others: Sequence[Plot], over_frequency: Sequence[Plot], of_housing: Sequence[Plot]
) -> dict[str, str]:
    """Links to the first of the parts of the page that there are."""
    found = {over_speed[0].name: "Run-up"} if over_speed else {}
    found |= {"results": "Results"}
    for start, words in (
        ("deformed", "Deformation"), ("torque", "Torques and speeds"), ("mesh_cycle", "Mesh cycle"),
        ("contact", "Contact pattern"), ("bearing", "Bearing forces"),
    ):  # fmt: skip
        first = next((plot.name for plot in others if plot.name.startswith(start)), None)
        found |= {first: words} if first is not None else {}
    if over_frequency:
        found[over_frequency[0].name] = "Spectra and orders"
    if of_housing:
        found[of_housing[0].name] = "Housing and sound"
    return found | {"accuracy": "Accuracy and cost"}
