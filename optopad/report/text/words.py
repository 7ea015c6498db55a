"""The verdict in words, the figures next to it, its bounds, and the units that keep it.

The words follow the definitions of the verdict: a deadband is an interval of depth over which a signal
changes by less than so many standard deviations of one reading.
"""

from __future__ import annotations

import math

from design.spec import SensorDesign
from optopad.report.text.markup import Html, element, joined, table
from optopad.screen.answer import answer_of
from optopad.screen.numbers import counted, signed, spans
from sims.bounds.figures import Figure
from sims.bounds.observability import PadBounds
from sims.continuity.result import ContinuityScore, JudgedPair, Verdict
from sims.verdict.build_study import BuildStudy
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD

Tile = tuple[str, str, str]
MICROMETRES_BELOW_MM = 0.1
"""The headline gives smaller bounds in micrometres [mm]."""
MOST_NAMED = 3
"""Values named in the words; the plot and the table have all."""
SYMBOLS: dict[Verdict, str] = {
    "CONTIGUOUS": "\N{CHECK MARK}",
    "DEADBAND": "\N{SQUARE WITH UPPER RIGHT TO LOWER LEFT FILL}",
    "OUT_OF_MODEL_SCOPE": "?",
}
RULE = (
    f"A deadband is an interval of depth, at least {DEADBAND_MIN_LENGTH_MM:g} mm long, over which a signal changes by "
    f"less than {DEADBAND_THRESHOLD:g} noise units and after which it comes back; one noise unit is one standard "
    "deviation of a reading. A pad is judged by all readings of a frame together."
)


def ranked(score: ContinuityScore) -> list[JudgedPair]:
    """Judged pairs from worst to best: most deadband first, then least evenness."""
    return sorted(score.pairs, key=lambda pair: (-pair.score.deadband_total_mm, pair.score.evenness))


def governing(score: ContinuityScore) -> JudgedPair:
    """The pair that stands for the rest."""
    return next(pair for pair in score.pairs if pair.name == score.governing)


def clipping(pair: JudgedPair) -> str:
    """What to keep in mind about a pair that reads above full scale; empty for the others."""
    if not pair.score.is_clipped:
        return ""
    share = f"{pair.score.clipped_share:.0%} of the depth"
    return f"{pair.name} reads above full scale over {share} and is blind there"


def reading(pair: JudgedPair) -> str:
    """What the curves of one pair say."""
    gap, dead = pair.score.modes.gap_mm, pair.score.deadbands_mm
    if gap is None:
        apart = "Mode 2 does not begin within the depth"
    else:
        apart = f"The modes overlap by {-gap:.2f} mm" if gap < 0 else f"The modes are {gap:.2f} mm apart"
    blind = f" {clipping(pair)}." if clipping(pair) else ""
    return f"{apart}; {'deadband ' + spans(dead) + ' mm' if dead else 'no deadband'}.{blind}"


def rests_on(score: ContinuityScore) -> Html | None:
    """The warning in one line: how many values nobody measured, and which of them turn the verdict."""
    band = score.tolerance
    if band is None or not (band.rows or band.unbanded):
        return None
    low, high = band.deadband_range_mm
    turned = (
        f"its verdict is turned by {', '.join(band.flipping)}"
        if band.flipping
        else "no single one of them turns its verdict"
    )
    return element(
        "p",
        element(
            "strong",
            f"Rests on {counted(len(band.rows) + len(band.unbanded), 'value')} not measured on the build",
        ),
        f": over their bands the deadband of {band.judged} is {low:.2f} to {high:.2f} mm; {turned}.",
        " ",
        element("a", "See tolerance", href="#tolerance"),
        " and ",
        element("a", counted(len(score.warnings), "warning"), href="#warnings"),
        ".",
        class_="rests",
    )


def _error(score: ContinuityScore, figure: str, digits: int = 3) -> str:
    """What the light trace's error does to a figure; nothing where it was not worked out."""
    if score.figure_errors is None:
        return ""
    return f", ± {score.figure_errors[figure]:.{digits}f} by the light trace"


def headline(score: ContinuityScore) -> Html:
    """The figures: worst deadband, share of pairs, mode gap, continuity, evenness, strength."""
    if score.strength is None or score.continuity is None or score.evenness is None:
        return Html("")
    of = governing(score).name if score.is_facing_rows else f"median of {len(score.pairs)} judged pairs"
    steps = score.strength["resolvable_steps"]
    tiles = (
        _deadband_tile(score),
        _pairs_tile(score),
        _gap_tile(score, of),
        (
            "Continuity",
            f"{score.continuity:.2f}",
            f"share of the depth outside deadbands{_error(score, 'continuity')}; {of}",
        ),
        (
            "Evenness",
            f"{score.evenness:.2f}",
            f"smallest over mean change in a 0.5 mm window{_error(score, 'evenness')}; {of}",
        ),
        (
            "Strength",
            f"{score.strength['untouched_counts']:.0f} counts",
            f"untouched, {score.strength['untouched_flux']:.2e} of the emitted power; swing "
            f"{score.strength['swing']:.0%}, {steps:.0f} resolvable steps{_error(score, 'resolvable_steps', 1)}; {of}",
        ),
    )
    more = [tile for tile in (bounds_tile(score), builds_tile(score.builds)) if tile is not None]
    return element("dl", *(_tile(*tile) for tile in (*tiles, *more)), class_="tiles")


def _tile(label: str, value: str, note: str) -> Html:
    return element(
        "div",
        element("dt", label),
        element("dd", element("span", value, class_="value"), element("span", note, class_="note")),
    )


def _deadband_tile(score: ContinuityScore) -> Tile:
    value = f"{score.deadband_total_mm:.2f} mm" if score.deadbands_mm else "none"
    if score.is_facing_rows:
        where = f"{governing(score).name}: {spans(score.deadbands_mm, 'no interval')}"
        return "Deadband of the middle facing pair", value, where + (" mm" if score.deadbands_mm else "")
    if not score.deadbands_mm or score.pad_map is None:
        return "Worst deadband of the pad", value, "at any place pressed, all readings of a frame together"
    worst = score.pad_map.worst
    return (
        "Worst deadband of the pad",
        value,
        f"at x = {worst.x_mm:g}, y = {worst.y_mm:g} mm, all pairs together",
    )


def _pairs_tile(score: ContinuityScore) -> Tile:
    value = f"{score.pairs_with_deadband} of {len(score.pairs)}"
    note = "none has one"
    if score.worst_pair_mm:
        note = f"worst {score.worst_pair} with {score.worst_pair_mm:.2f} mm"
    if score.clipped:
        note += f"; {len(score.clipped)} read above full scale"
    return "Pairs with a deadband of their own", value, f"{note}; each pressed at its own mid-span"


def _gap_tile(score: ContinuityScore, of: str) -> Tile:
    gap = score.mode_gap_mm
    if gap is not None:
        return (
            "Mode gap",
            f"{signed(gap)} mm",
            f"{'the modes overlap' if gap < 0 else 'from mode 1 to mode 2'}; {of}",
        )
    least = governing(score).score.modes.gap_at_least_mm
    bound = f", at least {least:.2f} mm for {governing(score).name}" if least is not None else ""
    return "Mode gap", "open", f"mode 2 does not begin within the depth{bound}; {of}"


def banner(design: SensorDesign, score: ContinuityScore) -> Html:
    """The verdict as a box: word, symbol, the answer in the screen's sentences, and the rule behind it."""
    said = answer_of(design, score)
    word = element(
        "p",
        element("span", SYMBOLS[score.verdict], class_="symbol", aria_hidden="true"),
        element("strong", score.verdict.replace("_", " ")),
        class_="word",
    )
    after = said.verdict.removeprefix(score.verdict).lstrip(":, ")
    lines = [element("p", _sentence(after), class_="meaning")]
    why = said.why if score.causes or not said.why else f"weakest at {said.why}"
    worth = f"resolution: {said.worth}" if said.worth else ""
    lines += [element("p", _sentence(text)) for text in (why, said.fix, said.sure, worth) if text]
    if score.verdict != "OUT_OF_MODEL_SCOPE":
        lines.append(element("p", RULE, class_="note"))
    rests = rests_on(score)
    return element(
        "div",
        joined([word, *lines]),
        *([rests] if rests else []),
        class_=f"verdict {score.verdict.lower()}",
        role="status",
    )


def _sentence(text: str) -> str:
    """With a capital, unless it begins with the path of a field, and a full stop."""
    is_path = "." in text.split(" ", 1)[0]
    return f"{text if is_path else text[:1].upper() + text[1:]}."


def bounds_tile(score: ContinuityScore) -> Tile | None:
    """Label, value and note for the headline; None where nothing was bounded."""
    bounds = score.bounds
    if bounds is None:
        return None
    if score.is_facing_rows:
        depth = bounds.median_depth_alone_mm
        return (
            "Resolution of depth, at best",
            _mm(depth.value),
            "standard deviation, median over the pad, one frame of all readings, place known",
        )
    place, depth = bounds.median_location_mm, bounds.median_depth_mm
    if math.isinf(place.value):
        return (
            "Resolution, at best",
            "blind",
            "over half of the pad's volume place or depth cannot be told at all",
        )
    return (
        "Resolution of place, and of depth, at best",
        _both(place.value, depth.value),
        f"standard deviation, median over the pad, one frame of all readings; {bounds.dead_share.percent()} of the "
        "volume dead",
    )


def bounds_words(score: ContinuityScore) -> list[Html]:
    """The summary of the bounds in a paragraph."""
    bounds = score.bounds
    if bounds is None:
        return []
    parts = (
        [_depth_alone_words(bounds)] if score.is_facing_rows else [_pad_words(bounds), _volume_words(bounds)]
    )
    if bounds.felt is not None:
        parts.append(_felt_words(bounds))
    return [element("p", " ".join(parts))]


def _pad_words(bounds: PadBounds) -> str:
    worst = bounds.worst
    at = f"x {worst.x_mm:g}, y {worst.y_mm:g} mm, {worst.depth_mm:g} mm deep"
    end = (
        f"At {at}, the pad is blind."
        if math.isinf(worst.location_mm)
        else f"The worst place is known to {_mm(worst.location_mm)}, at {at}."
    )
    return (
        f"At best, one frame of readings tells the place of a press to {_span(bounds.median_location_mm)} and its "
        f"depth to {_span(bounds.median_depth_mm)}, standard deviations, median over the pad. {end}"
    )


def _depth_alone_words(bounds: PadBounds) -> str:
    return (
        "At best, one frame of readings tells the depth of a press at a known place to "
        f"{_span(bounds.median_depth_alone_mm)}, standard deviation, median over the pad."
    )


def _volume_words(bounds: PadBounds) -> str:
    limits = bounds.limits
    return (
        f"Covered, to {limits.covered_location_mm:g} mm in place and {limits.covered_depth_mm:g} mm in depth: "
        f"{bounds.coverage.percent()} of the volume. Dead, worse than {limits.dead_location_mm:g} mm in place or "
        f"{limits.dead_depth_mm:g} mm in depth: {bounds.dead_share.percent()}."
    )


def _felt_words(bounds: PadBounds) -> str:
    felt = bounds.felt
    assert felt is not None
    row, column = felt.worst
    at, force = f"x {felt.x_mm[column]:g}, y {felt.y_mm[row]:g} mm", float(felt.force_n[row, column])
    if math.isinf(force):
        return f"At {at} no press within the range of use is felt."
    low, high = float(felt.low_n[row, column]), float(felt.high_n[row, column])
    return f"Felt everywhere: from {force:.3g} N ({low:.3g} to {high:.3g} N over the modulus's band), heaviest at {at}."


def losses_table(score: ContinuityScore) -> Html:
    """The pad without each part in turn; nothing where that was not asked."""
    bounds = score.bounds
    if bounds is None or not bounds.losses or score.is_facing_rows:
        return Html("")
    worst = bounds.worst_loss
    assert worst is not None
    whole = (
        "none",
        bounds.coverage.percent(),
        _span(bounds.median_location_mm),
        _span(bounds.median_depth_mm),
        f"{bounds.blind_share:.0%}",
    )
    rows = [
        (
            loss.part,
            loss.coverage.percent(),
            _span(loss.median_location_mm),
            _span(loss.median_depth_mm),
            f"{loss.blind_share:.0%}",
        )
        for loss in bounds.losses
    ]
    heads = ("without", "covered", "place, median", "depth, median", "blind")
    words = f"When a part dies: {worst.part} is missed most, {worst.coverage.percent()} of the volume stays covered"
    return element(
        "details",
        element("summary", words),
        table(heads, [whole, *rows], label="What the loss of a part costs", numeric=(1, 2, 3, 4)),
        class_="sheet",
        open="",
    )


def _both(place_mm: float, depth_mm: float) -> str:
    if max(place_mm, depth_mm) < MICROMETRES_BELOW_MM:
        return f"{1000 * place_mm:.2g}, {1000 * depth_mm:.2g} \N{MICRO SIGN}m"
    return f"{_number(place_mm)}, {_number(depth_mm)} mm"


def _span(figure: Figure) -> str:
    if math.isinf(figure.value):
        return "blind"
    high = "open" if math.isinf(figure.high) else _number(figure.high)
    return f"{_number(figure.value)} mm ({_number(figure.low)} to {high})"


def _number(value: float) -> str:
    return f"{value:#.2g}" if value < 0.1 else f"{value:.2f}"


def _mm(value: float) -> str:
    return "blind" if math.isinf(value) else f"{_number(value)} mm"


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
