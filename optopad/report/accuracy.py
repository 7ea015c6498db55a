"""The page on accuracy, in one file: errors of touch, location and depth by model, bounds, and published figures."""

from __future__ import annotations

from collections.abc import Mapping

from optopad.report.sections.drawings import Drawing, figure_of
from optopad.report.words import Html, bullets, element, section, still_page, table
from optopad.screen.prediction import ModelAccuracy, PredictedAccuracy, bound_text
from optopad.sims.learning.tables import WITHIN_MM, ErrorRow, Spread

TITLES = {
    "touch": "Touch",
    "errors": "Location and depth",
    "arrows": "Arrows",
    "depths": "Single locations",
    "notes": "Notes",
}
BOUND_WORDS = (
    "Least standard deviation of an unbiased estimate from one frame, with the tip where the stage "
    "reports it; open: hidden by the numerical error of the light model. For an efficient normal "
    "estimate the median error is 0.83 of the location bound and 0.67 of the depth bound: compare root "
    "mean squares with the bound, or medians with these shares."
)
HALF_MM = f"{WITHIN_MM:g} mm"


def accuracy_page(found: PredictedAccuracy, drawings: Mapping[str, Drawing]) -> str:
    """The page on accuracy as HTML text.

    Parameters
    ----------
    drawings : SVG text by name; the names are touch, errors, arrows-<learner>, depths-<learner>
    """
    sections = [
        _touch_section(found, drawings),
        _error_section(found, drawings),
        _pictures("arrows", "Estimated location of each press", found, drawings),
        _pictures("depths", "Depth at single locations", found, drawings),
        section("notes", "Notes", bullets(found.notes)),
    ]
    return still_page("accuracy", found.name, found.digest or "", TITLES, _banner(found), sections)


def _banner(found: PredictedAccuracy) -> Html:
    learner, best = min(found.pooled().items(), key=lambda item: _mean_location(item[1].errors))
    told = [row for row in best.errors if row.location is not None and row.depth is not None]
    words = "; ".join(
        f"{row.depth_mm:g} mm deep: location {row.location.median:.2f} mm, depth {row.depth.median:.2f} mm"
        for row in told
        if row.location is not None and row.depth is not None
    )
    findings = found.findings()
    return element(
        "div",
        element("h2", "Expected accuracy", class_="word"),
        element("p", f"Median errors of {learner}, the best model here: {words or 'no touched samples'}."),
        *([element("p", "Touch is not decided well:"), bullets(findings)] if findings else []),
        class_="verdict deadband" if findings else "verdict contiguous",
    )


def _mean_location(rows: tuple[ErrorRow, ...]) -> float:
    known = [row.location.median for row in rows if row.location is not None and row.depth_mm >= 1.0]
    return sum(known) / len(known) if known else float("inf")


def _touch_section(found: PredictedAccuracy, drawings: Mapping[str, Drawing]) -> Html:
    names = [one.title for one in found.found]
    rows = []
    for number, row in enumerate(found.found[0].touch):
        cells = [_share(one, number) for one in found.found]
        if found.published is not None:
            for side in (True, False):
                share = found.published.right(row.depth_mm, is_ambient=side)
                cells.append("" if share is None else f"{share:.2f}")
        rows.append((f"{row.depth_mm:g}", *cells))
    heads = ["depth [mm]", *names]
    if found.published is not None:
        heads += ["published, ambient", "published, dark"]
    return section(
        "touch",
        "Correct touches",
        element(
            "p",
            "Share of samples at a depth that are classified correctly: untouched below 0 mm, touched from 0 mm on.",
        ),
        figure_of(drawings["touch"], "Bars: standard error, from locations and sessions."),
        table(heads, rows, label="Correct touches", numeric=range(1, len(heads)), class_="wide"),
        *([element("p", found.published.source, class_="note")] if found.published is not None else []),
    )


def _share(one: ModelAccuracy, number: int) -> str:
    row = one.touch[number]
    if row.right is None:
        return ""
    return f"{row.right:.2f}" + ("" if row.right_error is None else f" ± {row.right_error:.2f}")


def _error_section(found: PredictedAccuracy, drawings: Mapping[str, Drawing]) -> Html:
    heads = (
        "depth [mm]", "location: median", "mean", "sd", "95 %", "depth: median", "mean", "sd", f"within {HALF_MM}",
        "found", "found, location: median", "found, depth: median",
    )  # fmt: skip
    tables = []
    for one in found.found:
        rows = [_error_cells(row) for row in one.errors if row.samples]
        tables += [
            element("h3", one.title),
            table(heads, rows, label=f"Errors of {one.title}", numeric=range(1, len(heads)), class_="wide"),
        ]
    bound = [
        (f"{depth:g}", bound_text(location), bound_text(of_depth))
        for depth, (location, of_depth) in found.bound_mm.items()
    ]
    if bound:
        tables += [
            element("h3", "Cramér-Rao bound under the same chain"),
            element("p", BOUND_WORDS, class_="note"),
            table(("depth [mm]", "location [mm]", "depth [mm]"), bound, label="Bound", numeric=(1, 2)),
        ]
    return section(
        "errors",
        "Error of location and depth",
        element(
            "p",
            "Errors [mm] of all touched samples, then of those that the model detects. Bars in the "
            "figure end at the 95th percentile.",
        ),
        figure_of(drawings["errors"], "Median; bars end at the 95th percentile."),
        *tables,
    )


def _error_cells(row: ErrorRow) -> tuple[str, ...]:
    return (
        f"{row.depth_mm:g}",
        *_four(row.location),
        *_four(row.depth)[:3],
        f"{row.within:.0%}",
        f"{row.found:.0%}",
        "" if row.found_location is None else f"{row.found_location.median:.3f}",
        "" if row.found_depth is None else f"{row.found_depth.median:.3f}",
    )


def _four(one: Spread | None) -> tuple[str, str, str, str]:
    if one is None:
        return "", "", "", ""
    return (
        f"{one.median:.3f} ± {one.median_error:.3f}",
        f"{one.mean:.3f}",
        f"{one.deviation:.3f}",
        f"{one.p95:.3f}",
    )


def _pictures(kind: str, title: str, found: PredictedAccuracy, drawings: Mapping[str, Drawing]) -> Html:
    shown = [figure_of(drawings[f"{kind}-{learner}"], learner) for learner in found.learners]
    return section(kind, title, *shown)
