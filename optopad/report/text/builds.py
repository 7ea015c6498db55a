"""How many builds keep the verdict when everything is off at once: in words and as a figure of the headline."""

from __future__ import annotations

from optopad.report.text.markup import Html, element, table
from optopad.screen.numbers import counted
from sims.verdict.build_study import BuildStudy

Tile = tuple[str, str, str]
MOST_NAMED = 3
"""Values named in the words; the plot and the table have all."""


def builds_tile(study: BuildStudy | None) -> Tile | None:
    """Label, value and note for the headline; None where no builds were drawn."""
    if study is None:
        return None
    low, high = study.kept_interval
    return (
        "Builds that keep the verdict",
        f"{study.kept_share:.0%}",
        f"{study.kept} of {study.builds} drawn with everything off at once; 95 %: {low:.0%} to {high:.0%}",
    )


def builds_words(study: BuildStudy) -> Html:
    """The share with its interval, what is in doubt, and what matters most."""
    low, high = study.kept_interval
    verdict = "a deadband" if study.as_designed.deadband_mm else "no deadband"
    found = study.rank_correlations()
    clear = [number for number in study.ranking if found[number][1] > 0.0 or found[number][2] < 0.0]
    named = ", ".join(study.tolerances[number].path for number in clear[:MOST_NAMED])
    parts = [
        f"Of {counted(study.builds, 'build')} drawn with everything off at once, {study.kept} keep the verdict, "
        f"{verdict}: {study.kept_share:.0%} (95 % interval of the count: {low:.0%} to {high:.0%}).",
        f"What matters most: {named}." if named else "No single value stands out.",
    ]
    if study.doubtful:
        parts.append(f"{counted(study.doubtful, 'build')} in doubt by the light trace's own error.")
    if study.unjudged:
        reasons = "; ".join(f"{reason}: {count}" for reason, count in study.unjudged.items())
        parts.append(f"Not judged: {reasons}.")
    return element("p", " ".join(parts))


def builds_table(study: BuildStudy) -> Html:
    """Every value that was varied, the one that matters most first."""
    found = study.rank_correlations()
    rows = []
    for number in study.ranking:
        one, (rank, low, high) = study.tolerances[number], found[number]
        band = f"{one.low:.4g} to {one.high:.4g} {one.unit}"
        rows.append(
            (one.path, band, one.distribution, one.origin, f"{rank:+.2f} ({low:+.2f} to {high:+.2f})")
        )
    heads = ("value", "band", "drawn", "why", "rank correlation (95 %)")
    return element(
        "details",
        element("summary", f"{counted(len(rows), 'value')} varied"),
        table(heads, rows, label="Values varied over the builds", numeric=(4,), class_="wide"),
        class_="sheet",
        open="",
    )
