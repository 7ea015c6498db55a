"""What a stage must be able to do, and what it must not.

A stage holds the tip above the pad and moves it in the cavity frame: x, y from a corner of the cavity, depth positive
into the pad, 0 where the tip barely touches. `collection.Collector` drives anything that keeps to `Stage`;
`gcode_stage` has one for printers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from design.errors import InputError
from design.shape.outline import Outline
from fabrication.driver_file import WorkspaceLimits

Position = tuple[float, float, float]
"""x, y, depth [mm]."""

HIGHEST_MM = 60.0
"""Nothing asks for a tip further above the pad; a slip of a unit does."""

LIMIT_SLACK_MM = 1e-6


@dataclass(frozen=True, kw_only=True)
class StageLimits:
    """Where the tip may go: the design's press centres and depth; above the pad up to 60 mm.

    Attributes
    ----------
    area : press centres
    deepest_mm : deepest press
    """

    area: Outline
    deepest_mm: float

    def require(self, x_mm: float, y_mm: float, depth_mm: float) -> None:
        """Refuse a position outside.

        Raises
        ------
        InputError : which coordinate, its limits.
        """
        spans = (
            ("x", x_mm, self.area.x0_mm, self.area.x1_mm),
            ("y", y_mm, self.area.y0_mm, self.area.y1_mm),
            ("depth", depth_mm, -HIGHEST_MM, self.deepest_mm),
        )
        for name, value, low, high in spans:
            if not (math.isfinite(value) and low - LIMIT_SLACK_MM <= value <= high + LIMIT_SLACK_MM):
                raise InputError(
                    f"stage: {name} {value:g} mm is outside of {low:g} to {high:g} mm; nothing moves"
                )
        if not self.area.contains(x_mm, y_mm, LIMIT_SLACK_MM):
            raise InputError(f"stage: x {x_mm:g}, y {y_mm:g} mm is not {self.area.words}; nothing moves")


def limits_of(workspace: WorkspaceLimits) -> StageLimits:
    """Limits of a design, from its driver configuration."""
    return StageLimits(area=workspace.area, deepest_mm=workspace.max_depth_mm)


class Stage(Protocol):
    """A stage; a context manager that leaves with the tip lifted, whatever happened inside."""

    limits: StageLimits

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, err: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def move_to(self, x_mm: float, y_mm: float, depth_mm: float) -> Position:
        """Go there, never sideways while touching, and stand; returns where the stage says that it is [mm].

        Raises
        ------
        InputError : outside of the limits; nothing has moved.
        DeviceError : the stage does not answer, refuses, or is not where it should be.
        """
        ...

    def lift(self) -> None:
        """Go straight up to the travel height."""
        ...

    def position(self) -> Position:
        """Where the stage says that the tip is, x, y, depth [mm]."""
        ...

    def stop(self) -> None:
        """End the motion at once, then lift."""
        ...
