"""A verdict in full, for ``--details``: deadbands, pairs, strength, bounds, what it rests on; the mold's checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from optopad.screen.answer import unit_of, verdict_words
from optopad.screen.bound_lines import bound_lines
from optopad.screen.numbers import counted

if TYPE_CHECKING:
    from sims.continuity.result import ContinuityScore, JudgedPair
    from sims.verdict.build_study import BuildStudy
    from sims.verdict.field_effects import Effect, FieldSteps

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
