"""What a verdict says beside itself: how near it is to turning, and what it rests on."""

from __future__ import annotations

from sims.continuity.result import JudgedPair
from sims.verdict.pad_map import PadMap
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD, TRACE_ERROR_LIMIT
from sims.verdict.pair.trace_noise import trace_noise_warning
from sims.verdict.tolerance import ToleranceBand, ToleranceRow


def margin_caution(pad_map: PadMap) -> list[str]:
    """A pad so near to a deadband somewhere that the trace's own error leaves the verdict open."""
    if not pad_map.is_open:
        return []
    place = min((one for one in pad_map.places if one.depths.most.deadbands_mm), key=lambda one: one.margin)
    start, end = place.depths.margin_mm
    return [
        f"the verdict is open: at x {place.x_mm:g}, y {place.y_mm:g} mm frames from {start:.2f} to {end:.2f} mm of "
        f"depth differ by {place.margin:.1f} noise units, give or take {place.depths.margin_error:.1f} by the light "
        f"trace's own error, and {DEADBAND_THRESHOLD:g} are needed; run with --fine"
    ]


def band_caution(band: ToleranceBand | None) -> str | None:
    """One line: what the verdict rests on that nobody has measured, the strongest effect first."""
    if band is None or not (band.rows or band.unbanded):
        return None
    ranked = [f"{row.path} {row.values[0]:.3g}..{row.values[1]:.3g} ({_effect(row)})" for row in band.rows]
    others = [f"{path} (no band)" for path in band.unbanded] + [
        f"{text} (not tried)" for text in band.untried
    ]
    return (
        f"rests on values not measured on the build, tried on {band.judged} (deadband {band.deadband_mm:.2f} mm, "
        f"margin {band.margin:.0f} noise units): " + "; ".join(ranked + others)
    )


def _effect(row: ToleranceRow) -> str:
    dead, margin = row.deadband_mm, row.margin
    turns = ", turns the verdict" if row.flips else ""
    return f"{row.confidence}: {dead[0]:.2f}..{dead[1]:.2f} mm, {margin[0]:.0f}..{margin[1]:.0f}{turns}"


def noise_caution(judged: tuple[JudgedPair, ...]) -> str | None:
    """A line where the trace's jitter can pass for signal."""
    margins = [pair.score.noise_margin for pair in judged if pair.score.noise_margin is not None]
    if not margins or max(margins) <= TRACE_ERROR_LIMIT:
        return None
    return trace_noise_warning(max(margins))
