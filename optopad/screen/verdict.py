"""The verdict in the terminal: at most thirteen lines of a hundred characters, or all figures with ``--details``."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from optopad.design.spec import SensorDesign
from optopad.screen.answer import COMMAND, FINDING_LINES, Answer, labelled
from optopad.screen.verdict_sentences import (
    at_mm,
    command_words,
    no_fix_words,
    sentences_of,
    unit_of,
    unresolved_share,
    verdict_words,
)
from optopad.sims.score.result import RESTS, UNDECIDED
from optopad.sims.verdict.depth_curve import NUMERICAL

if TYPE_CHECKING:
    from optopad.sims.bounds.detection_threshold import DetectionThreshold
    from optopad.sims.bounds.observability import BoundFigure, PadBounds
    from optopad.sims.score.result import ContinuityScore, JudgedPair
    from optopad.sims.verdict.builds import BuildStudy
    from optopad.sims.verdict.tolerance import Effect, FieldSteps


def answer_of(design: SensorDesign, score: ContinuityScore, size: str) -> Answer:
    """The texts of a verdict; `size` is the line on size, loads, parts and price from `summary_words`."""
    said, trial = sentences_of(design, score), score.trial
    has_learner = bool(said.resolution) and not score.is_facing_rows
    return Answer(
        design=f"{score.name} ({score.digest[:8]})",
        verdict=said.verdict,
        why=said.why,
        margin=said.margin,
        confidence=said.confidence,
        resolution=said.resolution,
        verdict_lines=2 if score.reason == "" else FINDING_LINES + 2,
        learner=_how_to_predict(design) if has_learner else "",
        has_learner=has_learner,
        warnings=tuple(_to_show(score)),
        tried=no_fix_words(trial),
        size=size,
        onward=_next(score, said.fix, is_built=False),
        onward_built=_next(score, said.fix, is_built=True),
        moves=()
        if trial is None or trial.found != "move"
        else tuple((one.path, one.to) for one in trial.moves),
        details=tuple(score_lines(score)),
    )


def _how_to_predict(design: SensorDesign) -> str:
    from optopad.sims.score.cost import about, quick_prediction_s

    seconds = quick_prediction_s(design)
    if seconds is None:
        return ""
    return f"not predicted yet: optopad predict {COMMAND} --quick   ({about(seconds)})"


def _to_show(score: ContinuityScore) -> list[str]:
    """Warnings that no other line reports, as short forms, in the score's order: the most serious first.

    The numerical error of single pairs is a warning of facing rows alone, because no other verdict contains it.
    """
    elsewhere = (RESTS, UNDECIDED) if score.is_facing_rows else (RESTS, UNDECIDED, NUMERICAL)
    return [clause(text) for text in score.warnings if not text.startswith(elsewhere)]


FIELD = re.compile(r"^[a-z_]+(?:\.[a-z0-9_-]+)+: |^layout: ")
"""Field that a warning is about, at its start."""
CLAUSE_END = re.compile(r" \((?!\d+(?:\.\d+)?, )|; ")
"""End of a warning's first clause: a parenthesis that is no location, or a semicolon."""


def clause(text: str) -> str:
    """The short form of a warning: without the field's path at its start, and without value, limit and remedy."""
    return CLAUSE_END.split(FIELD.sub("", text), maxsplit=1)[0]


def _next(score: ContinuityScore, fix: str, *, is_built: bool) -> str:
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return f"remove the reason that the verdict names, then optopad check {COMMAND}"
    if score.trial is not None and score.trial.found == "move":
        return f"optopad score {COMMAND}   ({command_words(score.trial)})"
    if fix:
        return f"optopad improve {COMMAND} --more-parts   ({fix})"
    if score.causes or (score.tolerance is not None and score.tolerance.flipping and not is_built):
        return f"optopad improve {COMMAND}   (up to four verified designs: minutes)"
    if is_built and score.tolerance is not None and score.tolerance.flipping:
        return f"optopad improve {COMMAND}, or measure the parameter, before you print cad/mold.stl"
    if is_built:
        return "open the report, print cad/mold.stl, follow fabrication/casting.md"
    return f"optopad run {COMMAND}   (mold, wiring, firmware, report: about a minute)"


LEAST_CHANGE_MM = 0.01
"""Smallest reported change of usable depth or deadband for a step of a parameter [mm]."""


def score_lines(score: ContinuityScore) -> list[str]:
    """All figures of a verdict as lines, the most important first."""
    lines = [
        labelled("design", f"{score.name} ({score.digest[:8]})"),
        labelled("verdict", verdict_words(score)),
    ]
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return [*lines, labelled("reason", score.reason)]
    lines += [_deadband_line(score), _pairs_line(score), _strength_line(score)]
    if score.is_facing_rows:
        lines += [_pair_line(pair) for pair in score.pairs]
    lines += bound_lines(score.bounds, is_facing=score.is_facing_rows) if score.bounds is not None else []
    lines += [_band_line(score)] if score.tolerance is not None else []
    lines += build_lines(score.builds) if score.builds is not None else []
    lines += step_lines(score.steps) if score.steps is not None else []
    return lines + [labelled("warning", text) for text in score.warnings]


def finding_line(finding: dict[str, Any]) -> str:
    """Line about a failed check of the mold, with the location or the fix."""
    unit = f" {finding['unit']}" if finding["unit"] else ""
    held = f"{finding['value']:g}{unit} (limit {finding['limit']:g}{unit})"
    return f"{finding['state']:<9} {finding['name']}: {held}" + (
        f"; {finding['note']}" if finding["note"] else ""
    )


def _deadband_line(score: ContinuityScore) -> str:
    where = f"governing pair {score.governing}" if score.is_facing_rows else "pad"
    if not score.deadbands_mm:
        return labelled("deadband", f"none in the {where}")
    spans = ", ".join(f"{start:.2f} to {end:.2f} mm" for start, end in score.deadbands_mm)
    share = ""
    if not score.is_facing_rows and score.pad_map is not None:
        worst = score.pad_map.worst
        share = (
            f" at {at_mm(worst.x_mm, worst.y_mm)}; {score.pad_map.dead_share:.0%} of the locations have one"
        )
    return labelled("deadband", f"{score.deadband_total_mm:.2f} mm: {spans}{share}")


def _pairs_line(score: ContinuityScore) -> str:
    worst = (
        f"; {score.worst_pair} has the longest, {score.worst_pair_mm:.2f} mm" if score.worst_pair_mm else ""
    )
    count = f"{score.pairs_with_deadband} of {len(score.pairs)} judged pairs have a deadband{worst}"
    if score.is_facing_rows:
        return labelled("pairs", f"each judged alone: {count}")
    return labelled(
        "pairs", f"each alone, pressed at its mid-span: {count}; the pad is judged by all pairs together"
    )


def _strength_line(score: ContinuityScore) -> str:
    strength = score.strength or {}
    return labelled(
        "strength",
        f"baseline {strength['untouched_counts']:.0f} counts ({strength['untouched_flux']:.2e} of the emitted power), "
        f"swing {strength['swing']:.0%}, {strength['resolvable_steps']:.0f} resolvable steps; "
        f"continuity {score.continuity:.2f}, evenness {score.evenness:.2f}",
    )


def _pair_line(pair: JudgedPair) -> str:
    modes, score = pair.score.modes, pair.score
    onset, end = modes.mode2_mm
    gap = "open" if modes.gap_mm is None else f"{modes.gap_mm:+.2f} mm"
    dead = ", ".join(f"{a:.2f}-{b:.2f} mm" for a, b in score.deadbands_mm) or "none"
    mode2 = "never begins" if onset is None else f"{onset:.2f}-{'open' if end is None else f'{end:.2f} mm'}"
    return labelled(
        pair.name,
        f"mode 1 {modes.mode1_mm[0]:.2f}-{modes.mode1_mm[1]:.2f} mm, mode 2 {mode2}, gap {gap}, deadband {dead}",
    )


def build_lines(study: BuildStudy) -> list[str]:
    """Lines with the fraction of simulated units that keep the verdict, and the tolerances of strongest effect."""
    low, high = study.kept_interval
    doubt = f"; {study.doubtful} undecided by numerical error" if study.doubtful else ""
    missing = f"; {sum(study.unjudged.values())} not judged" if study.unjudged else ""
    verdict = "DEADBAND" if study.as_designed.deadband_mm else "CONTIGUOUS"
    correlations = study.rank_correlations()
    strongest = ", ".join(
        f"{study.tolerances[number].path} ({correlations[number][0]:+.2f})" for number in study.ranking[:4]
    )
    return [
        labelled(
            "tolerances",
            f"{study.kept} of {study.builds} manufactured units stay {verdict}: {study.kept_share:.0%} "
            f"(95 % interval {low:.0%} to {high:.0%}){doubt}{missing}; judged by {study.judged}",
        ),
        labelled("sensitivity", f"{strongest} (rank correlation with the margin)"),
    ]


def step_lines(steps: FieldSteps) -> list[str]:
    """Lines with the effect of a small step of each parameter; the step that improves the design most is first."""
    order = list(steps.better_sides())
    rows = sorted(steps.rows, key=lambda one: order.index(one.path) if one.path in order else len(order))
    lines = []
    for one in rows:
        effects = []
        for sign, effect in (("-", one.lower), ("+", one.higher)):
            step = f"{sign}{one.step:g}{unit_of(one.path)}"
            effects.append(f"{step} {'refused' if effect is None else _changed(steps.as_designed, effect)}")
        lines.append(labelled("sensitivity", f"{one.path}: {'; '.join(effects)}"))
    return [*lines, labelled("", f"judged by {steps.judged}")]


def _changed(design: Effect, stepped: Effect) -> str:
    found = [f"margin {stepped.margin - design.margin:+.1f} sigma"]
    for name, words in (("usable_mm", "usable"), ("deadband_mm", "deadband")):
        change = getattr(stepped, name) - getattr(design, name)
        if abs(change) >= LEAST_CHANGE_MM:
            found.append(f"{words} {change:+.2f} mm")
    for name, words in (("location_mm", "location"), ("depth_mm", "depth")):
        before, after = getattr(design, name), getattr(stepped, name)
        if before is not None and after is not None and before > 0.0:
            found.append(f"{words} bound {after / before - 1.0:+.0%}")
    return ", ".join(found)


def _band_line(score: ContinuityScore) -> str:
    band = score.tolerance
    assert band is not None
    low, high = band.deadband_range_mm
    if band.flipping:
        does = "changes" if len(band.flipping) == 1 else "change"
        changing = f"{', '.join(band.flipping)} {does} the verdict"
    else:
        changing = "no single parameter changes the verdict"
    return labelled(
        "confidence",
        f"deadband of {band.judged}: {low:.2f} to {high:.2f} mm over the bands of unmeasured parameters; {changing}",
    )


def bound_lines(bounds: PadBounds, *, is_facing: bool) -> list[str]:
    """Lines with median Cramér-Rao bounds, resolved and unresolved volume, detection threshold, most important part.

    Facing rows are judged at known locations, so the bound of the depth at a known location is added.
    """
    lines = [_median_line(bounds), *([_depth_alone_line(bounds)] if is_facing else []), _volume_line(bounds)]
    lines += [] if bounds.detection is None else [_contact_line(bounds.detection)]
    return lines if bounds.worst_loss is None else [*lines, _loss_line(bounds)]


def _median_line(bounds: PadBounds) -> str:
    worst = bounds.worst
    at = f"{at_mm(worst.x_mm, worst.y_mm)}, {worst.depth_mm:g} mm deep"
    end = (
        f"not resolved at {at}"
        if math.isinf(worst.location_mm)
        else f"worst {_mm(worst.location_mm)} at {at}"
    )
    return labelled(
        "resolution",
        f"one frame, median over the pad: location {_span(bounds.median_location_mm)}, "
        f"depth {_span(bounds.median_depth_mm)}; {end}",
    )


def _depth_alone_line(bounds: PadBounds) -> str:
    depth = _span(bounds.median_depth_alone_mm)
    return labelled("", f"one frame at a known location, median: depth {depth}")


def _volume_line(bounds: PadBounds) -> str:
    limits, share = bounds.limits, unresolved_share(bounds)
    unresolved = f"; in {share} one frame does not resolve x, y and depth together" if share else ""
    return labelled(
        "volume",
        f"{bounds.coverage.percent()} covered (location < {limits.covered_location_mm:g} mm, depth < "
        f"{limits.covered_depth_mm:g} mm); {bounds.dead_share.percent()} dead (location > "
        f"{limits.dead_location_mm:g} mm or depth > {limits.dead_depth_mm:g} mm){unresolved}",
    )


def _contact_line(detection: DetectionThreshold) -> str:
    row, column = detection.worst
    at = at_mm(detection.x_mm[column], detection.y_mm[row])
    force = float(detection.force_n[row, column])
    if math.isinf(force):
        return labelled("contact", f"no press within the range of use is detected at {at}")
    band = f"{detection.low_n[row, column]:.3f} to {detection.high_n[row, column]:.3f} N by the modulus"
    latest = float(detection.force_error_high_n[row, column])
    end = "no detection" if math.isinf(latest) else f"{latest:.3f} N"
    trace = f"{detection.force_error_low_n[row, column]:.3f} N to {end} by numerical error"
    return labelled(
        "contact", f"detected from {force:.3f} N at every location ({band}; {trace}); latest at {at}"
    )


def _loss_line(bounds: PadBounds) -> str:
    loss = bounds.worst_loss
    assert loss is not None
    return labelled(
        "losses",
        f"without {loss.part}, whose loss costs most: location {_span(loss.median_location_mm)}, "
        f"depth {_span(loss.median_depth_mm)}, {loss.coverage.percent()} covered",
    )


def _span(figure: BoundFigure) -> str:
    if math.isinf(figure.value):
        return "not resolved"
    return f"{_mm(figure.value)} ({figure.low:.4f} to {'open' if math.isinf(figure.high) else f'{figure.high:.4f}'})"


def _mm(value: float) -> str:
    return f"{value:.4f} mm"
