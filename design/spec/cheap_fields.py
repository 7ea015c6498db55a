"""Fields that cost little to change before a design is built: stepped by a score, varied by a search around it."""

from __future__ import annotations

from design.spec.sensor import SensorDesign

HEIGHTS = ("emitters.height_mm", "receivers.height_mm")
CLEAR = "cavity.clear_thickness_mm"
TARGET = "gain.target_counts"
ALONG = ("pitch_mm", "shift_mm")
"""Fields of a layout's pattern: where parts stand along their wall."""


def cheap_fields(design: SensorDesign) -> tuple[str, ...]:
    """Dotted paths of those that a design has: part heights, clear layer, counts aimed at by rule, pitch and shift."""
    by_rule = (TARGET,) if isinstance(design.gain.feedback_ohm, str) else ()
    along = (
        f"layout.{number}.{name}"
        for number, pattern in enumerate(design.layout)
        for name in ALONG
        if getattr(pattern, name, None) is not None
    )
    return *HEIGHTS, CLEAR, *by_rule, *along
