"""What the readings can tell at best, in words, as figures of the headline, and without each part in turn."""

from __future__ import annotations

import math

from optopad.report.text.markup import Html, element, table
from sims.bounds.figures import Figure
from sims.bounds.observability import PadBounds
from sims.continuity.result import ContinuityScore

Tile = tuple[str, str, str]
MICROMETRES_BELOW_MM = 0.1
"""The headline gives smaller bounds in micrometres [mm]."""


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
