"""A verdict in the terminal: at most twelve lines of a hundred characters; in full behind ``--details``."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Any

from design.spec import SensorDesign
from optopad.prediction_cost import STEM, quick_prediction_s
from optopad.screen.answer import (
    answer_of,
    command_words,
    counted,
    set_options,
    unit_of,
    unresolved,
    verdict_words,
)

if TYPE_CHECKING:
    from design.fields.finding import Finding
    from sims.bounds.felt import FeltForce
    from sims.bounds.observability import Figure, PadBounds
    from sims.continuity.result import ContinuityScore, JudgedPair
    from sims.verdict.builds import BuildStudy
    from sims.verdict.tolerance import Effect, FieldSteps

WIDTH, LINES = 100, 12
LABEL = 12
"""Columns of the label in front of a line."""
FIRST = ("full scale", "do not settle", "cannot light", "too much current", "stay tacky")
"""Words of warnings that come first: a pad that is built as it is would not work."""
FINDING_LINES = 4
"""Lines of a finding at most."""


def verdict_screen(
    design: SensorDesign,
    score: ContinuityScore,
    closing: Sequence[str],
    *,
    command: str = "",
    is_built: bool = False,
    learner: str = "",
) -> list[str]:
    """The verdict, why, how sure, the resolution, what a learner reaches, what to heed, and the next command.

    Parameters
    ----------
    closing : finished lines for the end, such as where the files are
    command : the design and its changes as given on the command line, for the next command; empty names none
    is_built : whether the bundle with mold and report is there
    learner : what `optopad.screen.verdict` says, beside the bound of a pad where there is room; empty says nothing
    """
    said = answer_of(design, score)
    head = [
        *row("design", f"{score.name}  {score.digest[:8]}"),
        *row("verdict", said.verdict, 2 if score.causes or score.reason == "" else 4),
        *row("why" if score.causes else "weakest", said.why, 2),
        *row("sure", said.sure, 2),
        *row("resolution", said.worth, 2),
    ]
    onward = _next(score, command, said.fix, is_built=is_built) if command else ""
    foot = [*row("next", onward, 2), *closing]
    beside = row("learner", learner, 2) if said.worth and not score.is_facing_rows else []
    if len(head) + len(beside) + len(foot) < LINES:  # one is left for what to heed
        head += beside
    room = max(LINES - len(head) - len(foot), 1)
    return [*head, *_heeded(_to_heed(score), room), *foot]


def findings_screen(name: str, findings: Sequence[Finding], *, command: str) -> list[str]:
    """Findings of the rules, errors first and notes last, as many whole ones as there is room for; the next command.

    command : verb and design, as `score pad.toml`
    """
    errors = [one for one in findings if one.severity == "error"]
    notes = [one for one in findings if one.severity == "note"]
    warnings = [one for one in findings if one.severity == "warning"]
    ordered = [*errors, *warnings, *notes]
    total = f"{counted(len(errors), 'error')}, {counted(len(warnings), 'warning')}"
    foot = [] if errors else row("next", f"optopad {command}")
    room = LINES - len(foot) - 2
    lines: list[str] = []
    shown = 0
    for one in ordered:
        told = row(one.severity, str(one), FINDING_LINES)
        if lines and len(lines) + len(told) > room:
            break
        lines, shown = [*lines, *told], shown + 1
    if shown < len(ordered):
        lines += row("", f"and {len(ordered) - shown} more; all of them with --details")
    return [*row("design", f"{name}: {total}"), *lines, *foot]


def row(label: str, text: str, most: int = 1) -> list[str]:
    """A sentence behind its label, on as many lines as it may take; nothing for an empty one."""
    if not text:
        return []
    room = WIDTH - LABEL
    parts = wrap(text, room, break_long_words=False, break_on_hyphens=False)
    if len(parts) > most:
        last = " ".join(parts[most - 1 :])
        parts = [*parts[: most - 1], shorten(last, room, placeholder=" …")]
    return [f"{label if number == 0 else '':<{LABEL}}{part}" for number, part in enumerate(parts)]


def _to_heed(score: ContinuityScore) -> list[str]:
    """Warnings that no other line tells, the worst first, then the rest as they come.

    The trace's error is told where it leaves the verdict open; else it concerns the figures of single pairs alone.
    """
    told = ("rests on values not measured", "the verdict is open", "light trace: standard error")
    left = [text for text in score.warnings if not text.startswith(told)]
    return sorted(left, key=lambda text: not any(words in text for words in FIRST))


def _heeded(texts: Sequence[str], room: int) -> list[str]:
    """One line each; what has no room is counted."""
    shown = list(texts) if len(texts) <= room else list(texts[: max(room - 1, 0)])
    lines = [line for text in shown for line in row("heed", _clause(text))]
    left = len(texts) - len(shown)
    if left:
        lines += row("heed", f"{counted(left, 'more warning' if shown else 'warning')}; see --details")
    return lines


def _clause(text: str) -> str:
    """A warning, or as many whole clauses of it as a line holds."""
    room = WIDTH - LABEL
    if len(text) <= room:
        return text
    ends = [text.rfind(mark, 0, room - 2) for mark in (" (", "; ", ", ")]
    return f"{text[: max(ends)].rstrip(';,')} \N{HORIZONTAL ELLIPSIS}" if max(ends) > 0 else text


def _next(score: ContinuityScore, command: str, fix: str, *, is_built: bool) -> str:
    """The exact next command, and what it does."""
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return f"change what the reason names, then optopad check {command}"
    if score.trial is not None and score.trial.found == "move":
        return f"optopad score {command} {set_options(score.trial)}   ({command_words(score.trial)})"
    if fix:
        return f"optopad improve {command} --more-parts   ({fix})"
    if score.causes:
        return f"optopad improve {command}   (up to three changes that mend it, verified: minutes)"
    if score.tolerance is not None and score.tolerance.flipping and not is_built:
        return f"optopad improve {command}   (up to three changes that better it, verified: minutes)"
    if is_built:
        return "open the report, print cad/mold.stl, and follow fabrication/casting.md"
    return f"optopad run {command}   (mold, wiring, firmware, report: about a minute)"


def as_typed(design: str, changes: Sequence[str] | None) -> str:
    """A design and its changes as they were given, for a command to be typed."""
    return " ".join([shlex.quote(design), *(f"--set {shlex.quote(one)}" for one in changes or ())])


LEAST_CHANGE_MM = 0.01
"""Changes of a depth from which on they are told."""


def score_lines(score: ContinuityScore) -> list[str]:
    """The verdict and all that goes with it, the most important first."""
    lines = [f"design    {score.name}  {score.digest[:8]}", f"verdict   {verdict_words(score)}"]
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return [*lines, f"reason    {score.reason}"]
    lines += [_deadband_line(score), _pairs_line(score), _strength_line(score)]
    if score.is_facing_rows:
        lines += [_pair_line(pair) for pair in score.pairs]
    lines += bound_lines(score.bounds, is_facing=score.is_facing_rows) if score.bounds is not None else []
    lines += [_band_line(score)] if score.tolerance is not None else []
    lines += build_lines(score.builds) if score.builds is not None else []
    lines += step_lines(score.steps) if score.steps is not None else []
    return lines + [f"warning   {text}" for text in score.warnings]


def finding_line(finding: dict[str, Any]) -> str:
    """A check of the mold that did not hold, with its note: the place, or what to do."""
    unit = f" {finding['unit']}" if finding["unit"] else ""
    held = f"{finding['value']:g}{unit} (limit {finding['limit']:g}{unit})"
    return f"{finding['state']:<9} {finding['name']}: {held}" + (
        f"; {finding['note']}" if finding["note"] else ""
    )


def checks_line(checks: dict[str, Any]) -> str:
    """The mold's checks in a line."""
    return f"mold      {checks_words(checks)}"


def checks_words(checks: dict[str, Any]) -> str:
    """Whether the mold can be printed, and which checks did not hold."""
    found = {
        state: [one["name"] for one in checks.get("findings", []) if one.get("state") == state]
        for state in ("error", "warning")
    }
    told = [f"{counted(len(names), state)} ({', '.join(names)})" for state, names in found.items() if names]
    state = "printable" if checks.get("ok") else "NOT printable"
    return f"{state}; {', '.join(told) or 'no findings'}; see cad/checks.json"


def _deadband_line(score: ContinuityScore) -> str:
    where = f"governing pair {score.governing}" if score.is_facing_rows else "pad"
    if not score.deadbands_mm:
        return f"deadband  none in the {where}"
    spans = ", ".join(f"{start:.2f} to {end:.2f} mm" for start, end in score.deadbands_mm)
    place = ""
    if not score.is_facing_rows and score.pad_map is not None:
        worst = score.pad_map.worst
        place = (
            f" at x {worst.x_mm:g}, y {worst.y_mm:g} mm ({score.pad_map.dead_share:.0%} of places have one)"
        )
    return f"deadband  {score.deadband_total_mm:.2f} mm: {spans}{place}"


def _pairs_line(score: ContinuityScore) -> str:
    worst = f"; worst {score.worst_pair} with {score.worst_pair_mm:.2f} mm" if score.worst_pair_mm else ""
    return f"pairs     {score.pairs_with_deadband} of {len(score.pairs)} judged have one of their own{worst}"


def _strength_line(score: ContinuityScore) -> str:
    strength = score.strength or {}
    return (
        f"strength  {strength['untouched_counts']:.0f} counts untouched ({strength['untouched_flux']:.2e} of the "
        f"emitted power), swing {strength['swing']:.0%}, {strength['resolvable_steps']:.0f} resolvable steps; "
        f"continuity {score.continuity:.2f}, evenness {score.evenness:.2f}"
    )


def _pair_line(pair: JudgedPair) -> str:
    modes, score = pair.score.modes, pair.score
    onset, end = modes.mode2_mm
    gap = "open" if modes.gap_mm is None else f"{modes.gap_mm:+.2f} mm"
    dead = ", ".join(f"{a:.2f}-{b:.2f}" for a, b in score.deadbands_mm) or "none"
    return (
        f"{pair.name:<9} mode 1 {modes.mode1_mm[0]:.2f}-{modes.mode1_mm[1]:.2f} mm, mode 2 "
        f"{'never' if onset is None else f'{onset:.2f}'}-{'open' if end is None else f'{end:.2f}'} mm, gap {gap}, "
        f"deadband {dead}"
    )


def build_lines(study: BuildStudy) -> list[str]:
    """The share of builds that keep the verdict, and what matters most."""
    low, high = study.kept_interval
    doubt = f"; {study.doubtful} of all in doubt by the light trace's error" if study.doubtful else ""
    missing = f"; not judged: {sum(study.unjudged.values())}" if study.unjudged else ""
    verdict = "DEADBAND" if study.as_designed.deadband_mm else "CONTIGUOUS"
    correlations = study.rank_correlations()
    strongest = ", ".join(
        f"{study.tolerances[number].path} ({correlations[number][0]:+.2f})" for number in study.ranking[:4]
    )
    return [
        f"builds    {study.kept} of {study.builds} stay {verdict}: {study.kept_share:.0%} "
        f"(95 %: {low:.0%} to {high:.0%}){doubt}{missing}, judged by {study.judged}",
        f"matters   {strongest} (rank correlation)",
    ]


def step_lines(steps: FieldSteps) -> list[str]:
    """What a step of each field changes, the field whose step gains most first."""
    order = list(steps.better_sides())
    rows = sorted(steps.rows, key=lambda row: order.index(row.path) if row.path in order else len(order))
    lines = []
    for row in rows:
        told = []
        for sign, effect in (("-", row.lower), ("+", row.higher)):
            step = f"{sign}{row.step:g}{unit_of(row.path)}"
            told.append(f"{step} {'refused' if effect is None else _changed(steps.as_designed, effect)}")
        lines.append(f"matters   {row.path}: {'; '.join(told)}")
    return [*lines, f"          judged by {steps.judged}"]


def _changed(design: Effect, stepped: Effect) -> str:
    """What differs between two builds' figures."""
    found = [f"margin {stepped.margin - design.margin:+.1f} noise units"]
    for name, words in (("usable_mm", "usable"), ("deadband_mm", "deadband")):
        change = getattr(stepped, name) - getattr(design, name)
        if abs(change) >= LEAST_CHANGE_MM:
            found.append(f"{words} {change:+.2f} mm")
    for name, words in (("location_mm", "place"), ("depth_mm", "depth")):
        before, after = getattr(design, name), getattr(stepped, name)
        if before is not None and after is not None and before > 0.0:
            found.append(f"{words} bound {after / before - 1.0:+.0%}")
    return ", ".join(found)


def _band_line(score: ContinuityScore) -> str:
    band = score.tolerance
    assert band is not None
    low, high = band.deadband_range_mm
    turned = f"; turned by {', '.join(band.flipping)}" if band.flipping else "; no single value turns it"
    return f"tolerance deadband of {band.judged}: {low:.2f} to {high:.2f} mm over the bands of open values{turned}"


def bound_lines(bounds: PadBounds, *, is_facing: bool) -> list[str]:
    """Median bounds, coverage and dead volume, lightest press, and the part that is missed most.

    Facing rows are pressed at known places: their line is that of the depth alone.
    """
    lines = [_depth_alone_line(bounds)] if is_facing else [_median_line(bounds), _volume_line(bounds)]
    lines += [] if bounds.felt is None else [_felt_line(bounds.felt)]
    return lines if is_facing or bounds.worst_loss is None else [*lines, _loss_line(bounds)]


def _median_line(bounds: PadBounds) -> str:
    worst = bounds.worst
    at = f"x {worst.x_mm:g}, y {worst.y_mm:g}, depth {worst.depth_mm:g} mm"
    end = f"blind at {at}" if math.isinf(worst.location_mm) else f"worst {_mm(worst.location_mm)} at {at}"
    return (
        f"bounds    one frame, median over the pad: place {_span(bounds.median_location_mm)}, "
        f"depth {_span(bounds.median_depth_mm)}; {end}"
    )


def _depth_alone_line(bounds: PadBounds) -> str:
    return f"bounds    one frame, place known, median: depth {_span(bounds.median_depth_alone_mm)}"


def _volume_line(bounds: PadBounds) -> str:
    limits = bounds.limits
    return (
        f"volume    {bounds.coverage.percent()} covered (place < {limits.covered_location_mm:g} mm, depth < "
        f"{limits.covered_depth_mm:g} mm); {bounds.dead_share.percent()} dead (place > {limits.dead_location_mm:g} mm "
        f"or depth > {limits.dead_depth_mm:g} mm){unresolved(bounds, is_facing=False)}"
    )


def _felt_line(felt: FeltForce) -> str:
    row, column = felt.worst
    at = f"x {felt.x_mm[column]:g}, y {felt.y_mm[row]:g} mm"
    force = float(felt.force_n[row, column])
    if math.isinf(force):
        return f"felt      no press within the range of use at {at}"
    band = f"{felt.low_n[row, column]:.3f} to {felt.high_n[row, column]:.3f} N by the modulus"
    latest = float(felt.force_error_high_n[row, column])
    end = "no press" if math.isinf(latest) else f"{latest:.3f} N"
    trace = f"{felt.force_error_low_n[row, column]:.3f} N to {end} by the trace"
    return f"felt      from {force:.3f} N everywhere ({band}; {trace}); the heaviest at {at}"


def _loss_line(bounds: PadBounds) -> str:
    loss = bounds.worst_loss
    assert loss is not None
    return (
        f"losses    without {loss.part}, the one missed most: place {_span(loss.median_location_mm)}, "
        f"depth {_span(loss.median_depth_mm)}, {loss.coverage.percent()} covered"
    )


def _span(figure: Figure) -> str:
    if math.isinf(figure.value):
        return "blind"
    return f"{_mm(figure.value)} ({figure.low:.4f} to {'open' if math.isinf(figure.high) else f'{figure.high:.4f}'})"


def _mm(value: float) -> str:
    return f"{value:.4f} mm"


LEAST_DEPTH_MM = 1.0
"""Depth from which on errors are told: a lighter press is detected, but hardly located [mm]."""


def learner_line(design: SensorDesign, bundle: Path, command: str) -> str:
    """One sentence for the screen; empty where there is neither a prediction nor a way to one.

    Parameters
    ----------
    bundle : the design's bundle, where `optopad predict` leaves its tables
    command : the design and its changes as given on the command line
    """
    document = _prediction(bundle / "sims" / f"{STEM}.json")
    if document is not None and document.get("digest") == design.digest and (said := _reached(document)):
        return said
    seconds = quick_prediction_s(design)
    if seconds is None:
        return ""
    return f"not predicted yet: optopad predict {command} --quick   ({_length(seconds)})"


def _prediction(file: Path) -> dict[str, Any] | None:
    """The tables of a prediction; None where there are none that can be read."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _reached(document: Mapping[str, Any]) -> str:
    """The best learner's median errors from `LEAST_DEPTH_MM` on, and its false alarms; empty where there are none."""
    try:
        every = document.get("learners", [document])  # earlier files have those of the first alone
        told = [(medians, one) for one in every if all(medians := _medians(one["errors"]))]
        if not told:
            return ""
        (location, depth), best = min(told, key=lambda one: sum(one[0][0]) / len(one[0][0]))
        alarms = best.get("false_alarms")
        false = "" if alarms is None else f"; {100.0 * alarms:.0f} % false alarms"
        return (
            f"location {_range(location, 2)}, depth {_range(depth, 2)} ({best['learner']}, simulated){false}"
        )
    except (KeyError, TypeError, ValueError):
        return ""


def _medians(rows: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    """Medians of the location's and of the depth's errors by depth, from `LEAST_DEPTH_MM` on [mm]."""
    deep = [row for row in rows if row["depth_mm"] >= LEAST_DEPTH_MM]
    location, depth = (
        [float(row[name]) for row in deep if row[name] is not None]
        for name in ("location_median_mm", "depth_median_mm")
    )
    return location, depth


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return f"{high} mm" if low == high else f"{low} to {high} mm"


def _length(seconds: float) -> str:
    cores = os.cpu_count() or 1
    length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{max(round(seconds, -1), 10):.0f} s"
    return f"about {length} on {cores} core{'s' if cores > 1 else ''}"
