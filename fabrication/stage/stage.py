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
from fabrication.driver_file import WorkspaceLimits

Position = tuple[float, float, float]
"""x, y, depth [mm]."""

HIGHEST_MM = 60.0
"""Nothing asks for a tip further above the pad; a slip of a unit does."""

LIMIT_SLACK_MM = 1e-6


@dataclass(frozen=True, kw_only=True)
class StageLimits:
    """Where the tip may go: the design's press centres and depth; above the pad up to 60 mm [mm].

    Attributes
    ----------
    is_disc : whether the press centres are those of the disc that touches the sides
    """

    x0_mm: float
    x1_mm: float
    y0_mm: float
    y1_mm: float
    deepest_mm: float
    is_disc: bool = False

    def require(self, x_mm: float, y_mm: float, depth_mm: float) -> None:
        """Refuse a position outside.

        Raises
        ------
        InputError : which coordinate, its limits.
        """
        spans = (
            ("x", x_mm, self.x0_mm, self.x1_mm),
            ("y", y_mm, self.y0_mm, self.y1_mm),
            ("depth", depth_mm, -HIGHEST_MM, self.deepest_mm),
        )
        for name, value, low, high in spans:
            if not (math.isfinite(value) and low - LIMIT_SLACK_MM <= value <= high + LIMIT_SLACK_MM):
                raise InputError(
                    f"stage: {name} {value:g} mm is outside of {low:g} to {high:g} mm; nothing moves"
                )
        middle, radius = (
            ((self.x0_mm + self.x1_mm) / 2, (self.y0_mm + self.y1_mm) / 2),
            (self.x1_mm - self.x0_mm) / 2,
        )
        if self.is_disc and math.dist((x_mm, y_mm), middle) > radius + LIMIT_SLACK_MM:
            raise InputError(
                f"stage: x {x_mm:g}, y {y_mm:g} mm is not within {radius:g} mm of x {middle[0]:g}, y {middle[1]:g} mm; "
                "nothing moves"
            )


def limits_of(workspace: WorkspaceLimits) -> StageLimits:
    """Limits of a design, from its driver configuration."""
    return StageLimits(
        x0_mm=workspace.x0_mm,
        x1_mm=workspace.x1_mm,
        y0_mm=workspace.y0_mm,
        y1_mm=workspace.y1_mm,
        deepest_mm=workspace.max_depth_mm,
        is_disc=workspace.is_disc,
    )


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
