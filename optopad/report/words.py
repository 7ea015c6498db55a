"""What all pages have in common: asset files, the script, safe HTML, and the verdict in words.

Script: the security policy of a page allows this script and no other. Each part of the script looks for its own
elements and does nothing if they are missing. Its data are stored in the page as JSON, which a browser does not
execute; closing tags in the data are escaped.

Safe HTML: `element` escapes every child that is not `Html` already, so the content of a design file remains text.

Verdict in words: the verdict, the figures next to it, its bounds, and the units that keep it.

The words follow the definitions of the verdict: a deadband is an interval of depth over which a signal changes by less
than a given number of standard deviations of one reading.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from optopad.design.spec import SensorDesign
from optopad.screen.answer import counted
from optopad.screen.figures import figures_of
from optopad.screen.verdict_sentences import no_fix_words, sentences_of, signed, spans
from optopad.sims.bounds.observability import BoundFigure, PadBounds
from optopad.sims.score.result import ContinuityScore, JudgedPair, Verdict
from optopad.sims.verdict.builds import BuildStudy
from optopad.sims.verdict.depth_curve import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD

PARTS = ("theme.js", "plan.js", "pad.js", "solid.js", "rays_view.js", "pairs_view.js", "maps_view.js")


def asset(name: str) -> str:
    """The text of a file in `optopad/report/assets`."""
    return (files("optopad.report.assets") / name).read_text(encoding="utf-8")


def still_page(
    what: str, name: str, digest: str, titles: Mapping[str, str], verdict: Html, sections: Iterable[Html]
) -> str:
    """A whole page as HTML text; `titles` maps the anchor of each section to its title."""
    links = bullets([element("a", title, href=f"#{anchor}") for anchor, title in titles.items()])
    return Template(asset("still_page.html")).substitute(
        title=escape(f"{name}: {what}"),
        style=asset("page.css"),
        kind=f"{what} report",
        name=escape(name),
        digest=escape(digest[:8]),
        navigation=element("nav", links, aria_label="Parts of this page"),
        verdict=verdict,
        sections=joined(sections, "\n"),
    )


def script_text() -> str:
    """All parts of the script, one after the other."""
    return "\n".join(map(asset, PARTS))


def script_policy() -> str:
    """The part of the page's security policy that allows the script, identified by its hash."""
    digest = base64.b64encode(hashlib.sha256(script_text().encode()).digest()).decode("ascii")
    return f"; script-src 'sha256-{digest}'"


def script_element() -> Html:
    """The HTML element with the script, for the end of the page."""
    return element("script", Html(script_text()))


def data_element(identifier: str, data: Any) -> Html:
    """An HTML element with data for the script.

    Parameters
    ----------
    data : data that JSON can represent; NaN and infinity are not allowed
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return element("script", Html(text.replace("<", "\\u003c")), type="application/json", id=identifier)


VOID = frozenset({"img", "br", "input"})


class Html(str):
    """Text that is HTML markup already and must not be escaped."""

    __slots__ = ()


def element(tag: str, *children: str, **attributes: str | None) -> Html:
    """One HTML element; plain text among its children is escaped.

    Parameters
    ----------
    attributes : values of the element's attributes; an attribute with the value None is left out; ``class_`` sets
        class, and ``aria_label`` sets aria-label
    """
    inside = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in VOID:
        return Html(f"<{tag}{inside}>")
    return Html(f"<{tag}{inside}>{joined(children)}</{tag}>")


def joined(parts: Iterable[str], between: str = "") -> Html:
    """Concatenated markup and text; text is escaped."""
    return Html(escape(between).join(part if isinstance(part, Html) else escape(part) for part in parts))


def bullets(items: Iterable[str], class_: str | None = None) -> Html:
    """An unordered list."""
    return element("ul", *(element("li", item) for item in items), class_=class_)


def radios(name: str, labels: Iterable[str]) -> list[Html]:
    """One radio button per label, whose value is the label's number; the first is selected."""
    return [
        element(
            "label",
            element("input", type="radio", name=name, value=str(number), checked="" if number == 0 else None),
            f" {label}",
        )
        for number, label in enumerate(labels)
    ]


def table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    label: str,
    numeric: Sequence[int] = (),
    class_: str | None = None,
) -> Html:
    """An HTML table that scrolls sideways on a narrow page; the first cell of each table row is its heading.

    Parameters
    ----------
    label : text for a screen reader, and the name of the scrolling region
    numeric : columns that are aligned to the right and not wrapped
    """
    looks = ["number" if column in numeric else None for column in range(len(heads))]
    head = element(
        "tr",
        *(element("th", text, scope="col", class_=look) for text, look in zip(heads, looks, strict=True)),
    )
    body = [
        element(
            "tr",
            element("th", row[0], scope="row"),
            *(element("td", cell, class_=look) for cell, look in zip(row[1:], looks[1:], strict=True)),
        )
        for row in rows
    ]
    grid = element("table", element("thead", head), element("tbody", *body), class_=class_)
    return element("div", grid, class_="scroll", tabindex="0", role="region", aria_label=label)


def facts(rows: Iterable[tuple[str, str]]) -> Html:
    """A table of names and values in two columns."""
    pairs = (joined([element("dt", name), element("dd", value)]) for name, value in rows)
    return element("dl", *(element("div", pair) for pair in pairs))


def section(identifier: str, title: str, *children: str, class_: str | None = None) -> Html:
    """A part of the page with a heading that can be linked to."""
    heading = f"{identifier}-title"
    return element(
        "section",
        element("h2", title, id=heading),
        *children,
        id=identifier,
        aria_labelledby=heading,
        class_=class_,
    )


Tile = tuple[str, str, str]
ORIGINS = {"open value": "unmeasured parameter"}
"""Names that the table uses for the origins of tolerances."""
MOST_NAMED = 3
"""Largest number of tolerances that the text names; the plot and the table have all of them."""
SYMBOLS: dict[Verdict, str] = {
    "CONTIGUOUS": "\N{CHECK MARK}",
    "DEADBAND": "\N{SQUARE WITH UPPER RIGHT TO LOWER LEFT FILL}",
    "OUT_OF_MODEL_SCOPE": "?",
}
RULE = (
    f"A deadband is an interval of depth, at least {DEADBAND_MIN_LENGTH_MM:g} mm long, over which a "
    f"signal changes by less than {DEADBAND_THRESHOLD:g} sigma and after which it comes back; one sigma "
    "is the standard deviation of a reading. A pad is judged by all readings of a frame together."
)


def ranked(score: ContinuityScore) -> list[JudgedPair]:
    """Judged pairs from worst to best: most deadband first, then least evenness."""
    return sorted(score.pairs, key=lambda pair: (-pair.score.deadband_total_mm, pair.score.evenness))


def governing(score: ContinuityScore) -> JudgedPair:
    """The governing pair: the one that represents all pairs."""
    return next(pair for pair in score.pairs if pair.name == score.governing)


def clipping(pair: JudgedPair) -> str:
    """A warning for a pair that reads above full scale; empty for other pairs."""
    if not pair.score.is_clipped:
        return ""
    share = f"{pair.score.clipped_share:.0%} of the depth"
    return f"{pair.name} reads above full scale over {share} and resolves nothing there"


def reading(pair: JudgedPair) -> str:
    """Sentence on one pair's curves: gap or overlap of the modes, deadbands, and clipping."""
    gap, dead = pair.score.modes.gap_mm, pair.score.deadbands_mm
    if gap is None:
        apart = "Mode 2 does not begin within the depth"
    else:
        apart = f"The modes overlap by {-gap:.2f} mm" if gap < 0 else f"The modes are {gap:.2f} mm apart"
    blind = f" {clipping(pair)}." if clipping(pair) else ""
    return f"{apart}; {'deadband ' + spans(dead) + ' mm' if dead else 'no deadband'}.{blind}"


def rests_on(score: ContinuityScore) -> Html | None:
    """A one-line warning: the number of unmeasured parameters, and those that change the verdict.

    None if there are no such parameters.
    """
    band = score.tolerance
    if band is None or not (band.rows or band.unbanded):
        return None
    low, high = band.deadband_range_mm
    found = f"a deadband of {low:.2f} to {high:.2f} mm" if round(high, 2) else "no deadband"
    dead = f"{band.judged} has {found}"
    turned = (
        f"the verdict is changed by {', '.join(band.flipping)}"
        if band.flipping
        else "no single one changes the verdict"
    )
    return element(
        "p",
        element(
            "strong",
            f"Depends on {counted(len(band.rows) + len(band.unbanded), 'unmeasured parameter')}",
        ),
        f": over their bands {dead}; {turned}.",
        " ",
        element("a", "See tolerance", href="#tolerance"),
        " and ",
        element("a", counted(len(score.warnings), "warning"), href="#warnings"),
        ".",
        class_="rests",
    )


NOTES = {
    "margin": "least change of a frame over 0.3 mm of depth; a deadband is below 3",
    "usable": "depth is resolved down to it",
    "deadband": "summed at the worst location, or of the facing pair of the verdict",
    "location": "Cramér-Rao bound from one frame, median over the pad",
    "depth": "Cramér-Rao bound from one frame, median over the pad",
    "contact": "load from which a press is detected at every location",
    "unresolved": "of the volume, where one frame does not resolve x, y and depth together",
    "pressable": "length and width of the workspace, and its share of the pad",
    "outside": "length and width in the mold",
    "height": "in the mold",
    "parts": "LEDs and photodiodes",
    "price": "of the rows of the bill whose price is known",
}
"""What the figures of a design are of, by their names in `optopad.screen.figures`."""


def headline(design: SensorDesign, score: ContinuityScore) -> Html:
    """The figures that one chooses a design by, as on the screens of `compare` and `sweep`."""
    if score.strength is None:
        return Html("")
    cells = [cell for cell in figures_of(design, score).cells if cell.name in NOTES and cell.text != "-"]
    tiles = [
        (cell.name.capitalize(), cell.words.removeprefix(cell.name).strip(), NOTES[cell.name])
        for cell in cells
    ]
    units = builds_tile(score.builds)
    return element("dl", *(_tile(*tile) for tile in [*tiles, *([units] if units else [])]), class_="tiles")


def pair_words(score: ContinuityScore) -> Html:
    """A paragraph with the figures of single pairs: of the governing facing pair, or medians over the judged pairs."""
    if score.strength is None or score.continuity is None or score.evenness is None:
        return Html("")
    of = governing(score).name if score.is_facing_rows else f"Median of {len(score.pairs)} judged pairs"
    worst = f", {score.worst_pair} the longest, {score.worst_pair_mm:.2f} mm" if score.worst_pair_mm else ""
    gap, least = score.mode_gap_mm, governing(score).score.modes.gap_at_least_mm
    modes = "mode 2 does not begin within the depth" if gap is None else f"mode gap {signed(gap)} mm"
    bound = f" (gap at least {least:.2f} mm for {governing(score).name})" if gap is None and least else ""
    dead = f"{score.pairs_with_deadband} of {len(score.pairs)} have a deadband{worst}"
    return element(
        "p",
        f"{of}: baseline {score.strength['untouched_counts']:.0f} counts, swing {score.strength['swing']:.0%}, "
        f"{score.strength['resolvable_steps']:.0f} resolvable steps, {modes}{bound}, continuity "
        f"{score.continuity:.2f}, evenness {score.evenness:.2f}. Each pair alone, pressed at the middle of its own "
        f"path: {dead}.",
    )


def _tile(label: str, value: str, note: str) -> Html:
    return element(
        "div",
        element("dt", label),
        element("dd", element("span", value, class_="value"), element("span", note, class_="note")),
    )


def banner(design: SensorDesign, score: ContinuityScore) -> Html:
    """The verdict as a box: word, symbol, the sentences that the terminal shows, and the rule behind the verdict."""
    said = sentences_of(design, score)
    word = element(
        "p",
        element("span", SYMBOLS[score.verdict], class_="symbol", aria_hidden="true"),
        element("strong", score.verdict.replace("_", " ")),
        class_="word",
    )
    after = said.verdict.removeprefix(score.verdict).lstrip(":, ")
    lines = [element("p", _sentence(after), class_="meaning")]
    margin, resolution = (
        f"{label}: {text}" if text else ""
        for label, text in (("margin", said.margin), ("resolution", said.resolution))
    )
    shown = (said.why, no_fix_words(score.trial), said.fix, margin, said.confidence, resolution)
    lines += [element("p", _sentence(text)) for text in shown if text]
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
    """The text as a sentence: with a full stop, and with a capital unless it begins with a field's path."""
    is_path = "." in text.split(" ", 1)[0]
    return f"{text if is_path else text[:1].upper() + text[1:]}."


def bounds_words(score: ContinuityScore) -> list[Html]:
    """A paragraph that summarises the bounds."""
    bounds = score.bounds
    if bounds is None:
        return []
    parts = (
        [_depth_alone_words(bounds)] if score.is_facing_rows else [_pad_words(bounds), _volume_words(bounds)]
    )
    if bounds.detection is not None:
        parts.append(_detection_words(bounds))
    return [element("p", " ".join(parts))]


def _pad_words(bounds: PadBounds) -> str:
    worst = bounds.worst
    at = f"x {worst.x_mm:g}, y {worst.y_mm:g} mm, {worst.depth_mm:g} mm deep"
    end = (
        f"At {at} it is not resolved."
        if math.isinf(worst.location_mm)
        else f"The worst location bound is {_mm(worst.location_mm)}, at {at}."
    )
    if math.isinf(bounds.median_location_mm.value):
        return f"One frame of readings does not resolve location and depth together in over half of the volume. {end}"
    return (
        f"One frame of readings resolves the location of a press to {_span(bounds.median_location_mm)} and its depth "
        f"to {_span(bounds.median_depth_mm)} at best (standard deviations, median over the pad). {end}"
    )


def _depth_alone_words(bounds: PadBounds) -> str:
    return (
        "One frame of readings resolves the depth of a press at a known location to "
        f"{_span(bounds.median_depth_alone_mm)} at best (standard deviation, median over the pad)."
    )


def _volume_words(bounds: PadBounds) -> str:
    limits = bounds.limits
    return (
        f"Covered, to {limits.covered_location_mm:g} mm in location and {limits.covered_depth_mm:g} mm in "
        f"depth: {bounds.coverage.percent()} of the volume. Dead, worse than {limits.dead_location_mm:g} "
        f"mm in location or {limits.dead_depth_mm:g} mm in depth: {bounds.dead_share.percent()}."
    )


def _detection_words(bounds: PadBounds) -> str:
    detection = bounds.detection
    assert detection is not None
    row, column = detection.worst
    at, force = (
        f"x {detection.x_mm[column]:g}, y {detection.y_mm[row]:g} mm",
        float(detection.force_n[row, column]),
    )
    if math.isinf(force):
        return f"At {at} no press within the range of use is detected."
    low, high = float(detection.low_n[row, column]), float(detection.high_n[row, column])
    return (
        f"Contact is detected at every location from {force:.3g} N ({low:.3g} to {high:.3g} N over the "
        f"modulus's band), highest at {at}."
    )


def losses_table(score: ContinuityScore) -> Html:
    """Table of the pad's bounds if one part is missing, for each part in turn; empty if they were not computed."""
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
    heads = ("without", "covered", "location, median", "depth, median", "not resolved")
    words = (
        f"Loss of one part: {worst.part} costs most, {worst.coverage.percent()} of the volume stays covered"
    )
    return element(
        "details",
        element("summary", words),
        table(heads, [whole, *rows], label="What the loss of a part costs", numeric=(1, 2, 3, 4)),
        class_="sheet",
        open="",
    )


def _span(figure: BoundFigure) -> str:
    if math.isinf(figure.value):
        return "not resolved"
    high = "open" if math.isinf(figure.high) else _number(figure.high)
    return f"{_number(figure.value)} mm ({_number(figure.low)} to {high})"


def _number(value: float) -> str:
    return f"{value:#.2g}" if value < 0.1 else f"{value:.2f}"


def _mm(value: float) -> str:
    return "not resolved" if math.isinf(value) else f"{_number(value)} mm"


def builds_tile(study: BuildStudy | None) -> Tile | None:
    """Label, value and note of the simulated units for the headline; None if `study` is None."""
    if study is None:
        return None
    low, high = study.kept_interval
    return (
        "Manufactured units that keep the verdict",
        f"{study.kept_share:.0%}",
        f"{study.kept} of {study.builds} in a Monte Carlo over all tolerances; 95 %: {low:.0%} to {high:.0%}",
    )


def builds_words(study: BuildStudy) -> Html:
    """Text with the share of units that keep the verdict (and its interval), undecided units, and main tolerances."""
    low, high = study.kept_interval
    verdict = "a deadband" if study.as_designed.deadband_mm else "no deadband"
    found = study.rank_correlations()
    clear = [number for number in study.ranking if found[number][1] > 0.0 or found[number][2] < 0.0]
    named = ", ".join(study.tolerances[number].path for number in clear[:MOST_NAMED])
    parts = [
        f"Of {counted(study.builds, 'manufactured unit')} in a Monte Carlo over all tolerances, {study.kept} keep the "
        f"verdict, {verdict}: {study.kept_share:.0%} (95 % interval of the count: {low:.0%} to {high:.0%}).",
        f"Strongest effect: {named}." if named else "No single value has a significant effect.",
    ]
    if study.doubtful:
        parts.append(f"{counted(study.doubtful, 'unit')} undecided by numerical error.")
    if study.unjudged:
        reasons = "; ".join(f"{reason}: {count}" for reason, count in study.unjudged.items())
        parts.append(f"Not judged: {reasons}.")
    return element("p", " ".join(parts))


def builds_table(study: BuildStudy) -> Html:
    """Table of all tolerances that were varied, the one with the strongest effect first."""
    found = study.rank_correlations()
    rows = []
    for number in study.ranking:
        one, (rank, low, high) = study.tolerances[number], found[number]
        band = f"{one.low:.4g} to {one.high:.4g} {one.unit}"
        rows.append(
            (
                one.path,
                band,
                one.distribution,
                ORIGINS.get(one.origin, one.origin),
                f"{rank:+.2f} ({low:+.2f} to {high:+.2f})",
            )
        )
    heads = ("value", "band", "distribution", "origin", "rank correlation (95 %)")
    return element(
        "details",
        element("summary", f"{counted(len(rows), 'value')} varied"),
        table(heads, rows, label="Values varied over the manufactured units", numeric=(4,), class_="wide"),
        class_="sheet",
        open="",
    )
