"""What was published of a sensor's touch, to hold the simulated table against.

Its untouched rows bounded the assumed noise of the signal chain (`design.spec.noise`), so they are no blind test;
nothing is fitted to the others.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

from design.preset import preset
from design.spec import SensorDesign


@dataclass(frozen=True, kw_only=True)
class PublishedTouch:
    """A published table of touch.

    Attributes
    ----------
    source : where it stands
    depth_mm : of its rows [mm]
    ambient, dark : share told rightly in ambient light and in the dark [-]
    """

    source: str
    depth_mm: tuple[float, ...]
    ambient: tuple[float, ...]
    dark: tuple[float, ...]

    def right(self, depth_mm: float, *, is_ambient: bool) -> float | None:
        """Share told rightly at one depth [-]; None where the table has no such row."""
        rows = self.ambient if is_ambient else self.dark
        return next(
            (share for at, share in zip(self.depth_mm, rows, strict=True) if abs(at - depth_mm) < 1e-9), None
        )


def published_touch(design: SensorDesign) -> PublishedTouch | None:
    """The table of the sensor that a packaged design describes; None for all others, changed ones included."""
    text = (files("sims.evaluation") / "data" / "touch_success.toml").read_text(encoding="utf-8")
    found = tomllib.loads(text).get(design.name)
    if found is None or design.digest != preset(design.name).digest:
        return None
    return PublishedTouch(
        source=found["source"],
        depth_mm=tuple(found["depth_mm"]),
        ambient=tuple(found["ambient"]),
        dark=tuple(found["dark"]),
    )
