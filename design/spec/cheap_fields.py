"""Fields that are cheap to change before manufacture; score and search vary them to find better designs."""

from __future__ import annotations

from optopad.design.spec.sensor import SensorDesign

HEIGHTS = ("emitters.height_mm", "receivers.height_mm")
CLEAR = "cavity.clear_thickness_mm"
TARGET = "gain.target_counts"
ALONG = ("pitch_mm", "shift_mm")
"""Fields of a layout pattern that set the positions of parts along their wall."""


def cheap_fields(design: SensorDesign) -> tuple[str, ...]:
    """Dotted paths of the cheap fields of a design.

    These are part heights, the clear layer's thickness, the gain's target, and the pitch and shift of layout patterns.
    """
    by_rule = (TARGET,) if isinstance(design.gain.feedback_ohm, str) else ()
    along = (
        f"layout.{number}.{name}"
        for number, pattern in enumerate(design.layout)
        for name in ALONG
        if getattr(pattern, name, None) is not None
    )
    return *HEIGHTS, CLEAR, *by_rule, *along
