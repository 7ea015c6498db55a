"""An accuracy as files: JSON, a page, and its pictures as SVG and PNG."""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure

from design.io import write_text_atomically, written_together
from design.shape.outline import Outline
from optopad.report.accuracy import accuracy_page
from optopad.report.sections.drawings import Drawing
from optopad.results.accuracy import Accuracy
from optopad.work.plot_files import write_plot
from sims.evaluation.tables import ERROR_DEPTHS_MM
from sims.plots.accuracy import plot_arrows, plot_depths, plot_errors, plot_touch, shown_places_mm
from sims.plots.style import plain_style


def write_accuracy(found: Accuracy, workspace: Outline, folder: Path, stem: str) -> tuple[Path, ...]:
    """Write ``<stem>.json``, ``<stem>.html`` and the pictures ``<stem>-*`` into a folder; what was written.

    Parameters
    ----------
    workspace : where the presses are
    """
    names, drawings = [f"{stem}.html", f"{stem}.json"], {}
    with written_together(folder) as made, plain_style():
        for name, (figure, shows) in _figures(found, workspace).items():
            svg, png = write_plot(figure, made / f"{stem}-{name}")
            names += [svg.name, png.name]
            drawings[name] = Drawing(stem=svg.stem, shows=shows, svg=svg.read_text(encoding="utf-8"))
        write_text_atomically(made / names[0], accuracy_page(found, drawings))
        write_text_atomically(made / names[1], json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n")
    return tuple(folder / name for name in names)


def _figures(found: Accuracy, workspace: Outline) -> dict[str, tuple[Figure, str]]:
    pooled = found.pooled()
    first = pooled[found.learners[0]]
    sets = {one.test_set: one.touch for one in found.found if one.learner == first.learner}
    figures = {
        "touch": (plot_touch(sets, found.published), "Share of touch told rightly against depth"),
        "errors": (
            plot_errors({name: one.errors for name, one in pooled.items()}, found.bound_mm),
            "Median error of place and of depth against depth, by model",
        ),
    }
    for learner, one in pooled.items():
        shown = one.presses.only(one.presses.session_number == 0)
        figures[f"arrows-{learner}"] = (
            plot_arrows(shown, ERROR_DEPTHS_MM, workspace),
            f"Arrows from true to said place, {learner}, first test set",
        )
        figures[f"depths-{learner}"] = (
            plot_depths(shown, shown_places_mm(workspace)),
            f"Said against true depth at single places, {learner}, first test set",
        )
    return figures
