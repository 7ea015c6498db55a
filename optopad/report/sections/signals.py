"""Sections on the signals: selected pairs, all judged pairs, sensitivity, tolerance."""

from __future__ import annotations

from markupsafe import Markup

from optopad.design.spec import SensorDesign
from optopad.report.scenes.pair_scene import pair_scene
from optopad.report.sections.drawings import Drawing, shown_causes, shown_pairs
from optopad.report.words import governing, part, ranked, reading
from optopad.screen.verdict_sentences import cause_sentence, fix_words, no_fix_words
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.builds import BuildStudy
from optopad.sims.verdict.depth_curve import TRACE_ERROR_LIMIT

Drawings = dict[str, Drawing]
MOST_NAMED = 3
"""Largest number of tolerances that the text names; the plot and the table have all of them."""


def causes_section(score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on causes of unresolved depth: cross-sections with the remaining light, and pairs under the tip."""
    causes = shown_causes(score)
    if not causes:
        return Markup()
    return part(
        "why",
        causes=causes,
        trial=score.trial,
        drawings=drawings,
        cause_sentence=cause_sentence,
        fix_words=fix_words,
        no_fix_words=no_fix_words,
    )


def signal_section(design: SensorDesign, score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on signals: one judged pair that the user selects, and drawings of the most important pairs."""
    numbers = {pair.name: number for number, pair in enumerate(score.pairs)}
    listed = score.pairs if score.is_facing_rows else ranked(score)
    return part(
        "signals",
        score=score,
        drawings=drawings,
        choices={numbers[pair.name]: pair for pair in listed},
        deepest_mm=float(score.pairs[0].curves.depth_mm[-1]),
        start_mm=governing(score).score.modes.mode1_mm[1],
        shown=shown_pairs(score),
        reading=reading,
        scene=pair_scene(design, score),
    )


def pairs_section(score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on all judged pairs, as a picture and as a table."""
    return part(
        "pairs",
        score=score,
        drawings=drawings,
        governing=governing(score),
        error_limit=TRACE_ERROR_LIMIT,
    )


def tolerance_section(score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on the confidence in the verdict, from the effect of tolerances."""
    band, study = score.tolerance, score.builds
    if band is None:
        return Markup()
    return part(
        "tolerance",
        band=band,
        is_facing_rows=score.is_facing_rows,
        drawings=drawings,
        study=study,
        **({} if study is None else _varied(study)),
    )


def _varied(study: BuildStudy) -> dict[str, object]:
    """The varied tolerances with their rank correlations, strongest first, and those with a significant effect."""
    ranks = study.rank_correlations()
    varied = [(study.tolerances[number], ranks[number]) for number in study.ranking]
    clear = [one.path for one, (_, low, high) in varied if low > 0.0 or high < 0.0]
    return {"varied": varied, "strongest": clear[:MOST_NAMED]}


def matters_section(score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on sensitivity: the effect of a small step of each parameter."""
    if score.steps is None or "field-steps" not in drawings:
        return Markup()
    return part("matters", steps=score.steps, drawing=drawings["field-steps"])
