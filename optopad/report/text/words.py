"""The verdict in words, and the figures beside it.

The words follow the definitions of the verdict: a deadband is an interval of depth over which a signal
changes by less than so many standard deviations of one reading.
"""

from __future__ import annotations

from design.spec import SensorDesign
from optopad.report.text.bounds import bounds_tile
from optopad.report.text.builds import builds_tile
from optopad.report.text.markup import Html, element, joined
from optopad.screen.answer import answer_of
from optopad.screen.numbers import counted, signed, spans
from sims.continuity.result import ContinuityScore, JudgedPair, Verdict
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD

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


def _deadband_tile(score: ContinuityScore) -> tuple[str, str, str]:
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


def _pairs_tile(score: ContinuityScore) -> tuple[str, str, str]:
    value = f"{score.pairs_with_deadband} of {len(score.pairs)}"
    note = "none has one"
    if score.worst_pair_mm:
        note = f"worst {score.worst_pair} with {score.worst_pair_mm:.2f} mm"
    if score.clipped:
        note += f"; {len(score.clipped)} read above full scale"
    return "Pairs with a deadband of their own", value, f"{note}; each pressed at its own mid-span"


def _gap_tile(score: ContinuityScore, of: str) -> tuple[str, str, str]:
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
