"""What the pad can tell at best, in a few lines for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from optopad.screen.answer import unresolved

if TYPE_CHECKING:
    from sims.bounds.felt import FeltForce
    from sims.bounds.figures import Figure
    from sims.bounds.observability import PadBounds


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
