"""The report of one run: report.html, the data of every plot as CSV, summary.json."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from gearfmu.body import Body
from gearfmu.files import write_text
from gearfmu.report import heading, page, sections
from gearfmu.report.chart import Plot
from gearfmu.report.choice import chosen_plots, turning
from gearfmu.report.plan import plan_sections
from gearfmu.report.results import energy_balance, strict
from gearfmu.report.run import Run
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.trace import Trace, write_columns
from gearfmu.stagefile.forms.general import Stage


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
    chapters, missing = chosen_plots(run)
    for plot in (plot for own in chapters.values() for plot in own):
        write_columns(folder / "data" / f"{plot.name}.csv", plot.columns)
    write_text(folder / "summary.json", json.dumps(strict({**summary, "results": results}), indent=2) + "\n")
    write_text(folder / "report.html", _document(run, chapters, missing))
    return folder / "report.html"


def _document(run: Run, chapters: Mapping[str, Sequence[Plot]], missing: Sequence[str]) -> str:
    summary, title = run.summary, ", ".join([run.stage_name, *heading.operating_point(run)])
    about = [run.title, *(str(summary[key]) for key in ("description", "started") if summary.get(key))]
    figures = {chapter: [page.figure(plot) for plot in own] for chapter, own in chapters.items()}
    octaves, view, warned = sections.octaves(run), turning(run), sections.warned(run.trace)
    body = [
        page.head(title, str(summary.get("outcome", "outcome not given")), " · ".join(about)),
        page.tiles(sections.tiles(run)),
        page.facts(sections.facts(summary)),
        *[page.warning(f"{text[:1].upper()}{text[1:]}.") for text in summary.get("warnings") or ()],
        page.contents(_links(chapters)),
        *([page.section("Not shown", *[page.note(reason) for reason in missing])] if missing else []),
        *(warned if chapters["speed"] else []),
        *figures["speed"],
        *([page.stage_view("The deformed stage, turning", view.caption, view.most)] if view is not None else []),
        *(sections.planets(run) or [page.section("Results", sections.results(run), name="results")]),
        *plan_sections(run.trace.meta.get("plan")),
        *figures["time"],
        *([] if chapters["speed"] else warned),
        *([page.section("Octave bands", octaves, name="octaves")] if octaves else []),
        *figures["frequency"],
        *figures["housing"],
        page.section("Accuracy and cost", *sections.accuracy(run), name="accuracy"),
        page.details(
            "Where it comes from", page.pairs_table(sections.provenance(summary)), sections.channels(run.trace)
        ),
    ]
    made = [plot for own in chapters.values() for plot in own]
    return page.page(f"{run.title} – {run.stage_name}", body, made, view)


def _links(chapters: Mapping[str, Sequence[Plot]]) -> dict[str, str]:
    """Links to the first of the parts of the page that there are."""
    found = {plot.name: "Run-up" for plot in chapters["speed"][:1]} | {"results": "Results"}
    for start, words in (
        ("deformed", "Deformation"), ("torque", "Torques and speeds"), ("mesh_cycle", "Mesh cycle"),
        ("contact", "Contact pattern"), ("bearing", "Bearing forces"),
    ):  # fmt: skip
        first = next((plot.name for plot in chapters["time"] if plot.name.startswith(start)), None)
        found |= {first: words} if first is not None else {}
    found |= {plot.name: "Spectra and orders" for plot in chapters["frequency"][:1]}
    found |= {plot.name: "Housing and sound" for plot in chapters["housing"][:1]}
    return found | {"accuracy": "Accuracy and cost"}
