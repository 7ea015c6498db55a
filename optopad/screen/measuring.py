"""With which tool a value is measured finely enough.

Tools by kind of quantity, coarsest first, with what each resolves. A calliper reads 0.01 or 0.02 mm and is 0.05 mm off
on small or soft bodies; a measuring microscope is good to 0.01 mm. What a calibration resolves is the error of fitted
values over ten simulated builds of thirty presses (docs/validation/calibration.md), rounded up: on a build it may be
more. The other tools are usual ones of an optics bench, by order of magnitude.
"""

from __future__ import annotations

from dataclasses import dataclass

PRESSES = 30
"""Presses of the calibrations that `CALIBRATED` is from."""
CALIBRATED = {
    "height_mm": 0.015,
    "clear_thickness_mm": 0.015,
    "active_width_mm": 0.025,
    "active_height_mm": 0.025,
    "half_angle_deg": 0.02,
    "refractive_index": 0.008,
    "absorption_db_per_cm": 0.002,
    "reflectance": 0.0015,
}
"""What a calibration resolves, by the end of a field's path [unit of the field]."""


@dataclass(frozen=True, kw_only=True)
class _Tool:
    """A tool by name, and what it resolves [unit of the field]."""

    name: str
    resolves: float


_CALLIPER = _Tool(name="a calliper", resolves=0.05)
_MICROSCOPE = _Tool(name="a measuring microscope", resolves=0.01)
TOOLS: dict[str, tuple[_Tool, ...]] = {
    "active_width_mm": (_MICROSCOPE,),
    "active_height_mm": (_MICROSCOPE,),
    "_mm": (_CALLIPER, _MICROSCOPE),
    "half_angle_deg": (_Tool(name="a photodiode turned around the LED", resolves=1.0),),
    "_deg": (_Tool(name="a protractor", resolves=1.0),),
    "refractive_index": (_Tool(name="an Abbe refractometer", resolves=0.0005),),
    "absorption_db_per_cm": (
        _Tool(name="a lamp and a photodiode through two lengths of silicone", resolves=0.1),
    ),
    "reflectance": (_Tool(name="a lamp and a photodiode against a white standard", resolves=0.01),),
    "_ohm": (_Tool(name="a multimeter", resolves=1.0),),
}
"""By the end of a field's path, the coarsest first; the first end that fits counts."""


def tool_words(path: str, within: float) -> str:
    """How to measure a field to within that, with a colon before it; empty for a kind of quantity without tools here.

    Parameters
    ----------
    path : dotted path of the field
    within : how finely it must be known [unit of the field]
    """
    tools = next((found for end, found in TOOLS.items() if path.endswith(end)), ())
    reach = next((value for end, value in CALIBRATED.items() if path.endswith(end)), None)
    if not tools:
        return ""
    fine = next((one for one in tools if one.resolves <= within), None)
    by = [] if fine is None else [f"by {fine.name}"]
    if reach is not None and reach <= within and fine is not tools[0]:
        by.append(f"by optopad calibrate with {PRESSES} presses")
    if not by:
        return f": finer than {tools[-1].name} resolves; a design with more margin is the way out"
    coarse = f"not by {tools[0].name}; " if fine is not tools[0] else ""
    return f": {coarse}{' or '.join(by)}"
