"""The top of a pad under a press, in space and where a vertical plane cuts it.

A press goes along the normal of the untouched top. In its frame (`design.shape.top`) the top is the crown
less its fall, and the height of the press over it, a curve around the axis; where the curve runs back beside the
shank its lowest height is taken, as in `sims.contact.pad_surface`. The tip is its outline turned about the axis.
A vertical plane does not hold the axis, so that its cut is found as the line along which a point is neither in nor out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from design.arrays import FloatArray
from design.shape.plan import Plan, plan_of
from design.shape.top import Top
from design.spec import SensorDesign
from sims.contact.pad_surface import curve_height_mm
from sims.contact.tip import tip_points_mm
from sims.press.indentation import Indentation

Place = tuple[float, float]

CUT_POINTS = 500
"""Places along and up a cut that its line is found from."""
TIP_POINTS, TIP_LENGTH = 400, 6.0
"""Points of the tip's outline and its length [tip radii]."""


@dataclass(frozen=True, kw_only=True)
class PressFrame:
    """Where a press goes in, and along what.

    Attributes
    ----------
    origin_mm : (3,) on the untouched top [mm]
    axes : (3, 3) a row each, the third along the press, upward [-]
    top : untouched, as it is seen from the frame
    """

    origin_mm: FloatArray
    axes: FloatArray
    top: Top

    def places_mm(self, across_mm: FloatArray, aside_mm: FloatArray, over_mm: FloatArray) -> FloatArray:
        """(..., 3) places in the cavity frame, of (...,) first and second axis and height along the third [mm]."""
        return np.asarray(self.origin_mm + np.stack([across_mm, aside_mm, over_mm], axis=-1) @ self.axes)

    def seen_from_it(self, places_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The way back from `places_mm`."""
        along = (places_mm - self.origin_mm) @ self.axes.T
        return along[..., 0], along[..., 1], along[..., 2]

    def fall_mm(self, across_mm: FloatArray, aside_mm: FloatArray) -> FloatArray:
        """(...,) how far the untouched top lies below the frame's plane [mm]."""
        fall = self.top.sag_mm(across_mm, aside_mm)
        return np.asarray(np.where(np.isnan(fall), self.top.radius_mm, fall))

    def top_mm(self, press: Indentation | None, across_mm: FloatArray, aside_mm: FloatArray) -> FloatArray:
        """(...,) height of the pressed top along the third axis [mm]; None: untouched."""
        fall = self.fall_mm(across_mm, aside_mm)
        return -fall if press is None else curve_height_mm(press, np.hypot(across_mm, aside_mm)) - fall


def press_frame(design: SensorDesign, at_mm: Place) -> PressFrame:
    """The frame of a press at a place; upright on a flat top."""
    top = plan_of(design).top
    origin, axes = top.press_frame(*at_mm)
    return PressFrame(origin_mm=origin, axes=axes, top=top.in_frame)


@dataclass(frozen=True, kw_only=True)
class CutPlane:
    """A vertical plane through a pad.

    Attributes
    ----------
    start_mm : (x, y) where its distances begin [mm]
    direction : (x, y) unit vector along it [-]
    reach_mm : least and greatest distance that is drawn [mm]
    ceiling_mm : height up to which is drawn [mm]
    """

    start_mm: Place
    direction: Place
    reach_mm: tuple[float, float]
    ceiling_mm: float

    def places_mm(self, along_mm: FloatArray, height_mm: FloatArray) -> FloatArray:
        """(..., 3) places of the plane [mm]."""
        (x, y), (dx, dy) = self.start_mm, self.direction
        return np.stack([x + along_mm * dx, y + along_mm * dy, height_mm], axis=-1)

    def untouched_mm(self, plan: Plan) -> FloatArray:
        """(n, 2) distance and height of the untouched top [mm]."""
        along = np.linspace(*self.reach_mm, CUT_POINTS)
        places = self.places_mm(along, np.zeros_like(along))
        return np.column_stack([along, [plan.top_mm(float(x), float(y)) for x, y, _ in places]])

    def line_mm(self, beyond_mm: Callable[[FloatArray], FloatArray], through_mm: FloatArray) -> FloatArray:
        """(n, 2) distance and height of the longest line along which a field of places is zero; empty without one.

        Parameters
        ----------
        through_mm : (3,) a place next to which the line is found exactly, as the foot of a press's axis [mm]
        """
        foot = (through_mm[:2] - np.array(self.start_mm)) @ np.array(self.direction)
        along = np.union1d(np.linspace(*self.reach_mm, CUT_POINTS), np.clip(foot, *self.reach_mm))
        height = np.linspace(0.0, self.ceiling_mm, CUT_POINTS)
        field = beyond_mm(self.places_mm(*np.meshgrid(along, height)))
        if not field.min() < 0.0 < field.max():
            return np.empty((0, 2))
        (lines,) = Figure().add_subplot().contour(along, height, field, levels=[0.0]).allsegs
        longest = np.asarray(max(lines, key=lambda line: float(np.ptp(line[:, 0]))))
        return longest if longest[0, 0] <= longest[-1, 0] else longest[::-1]


def cut_top_mm(frame: PressFrame, press: Indentation, plane: CutPlane) -> FloatArray:
    """(n, 2) distance and height where a vertical plane cuts the pressed top [mm]."""

    def beyond(places: FloatArray) -> FloatArray:
        across, aside, over = frame.seen_from_it(places)
        return np.asarray(over - frame.top_mm(press, across, aside))

    return plane.line_mm(beyond, frame.origin_mm)


def seen_tip_mm(design: SensorDesign, frame: PressFrame, depth_mm: float, plane: CutPlane) -> FloatArray:
    """(n, 2) distance and height of the tip's outline through its axis, as seen square to a vertical plane [mm]."""
    radius, tall = tip_points_mm(design.indenter, TIP_LENGTH, TIP_POINTS).T
    (right, up), upward = plane.direction, frame.axes[2]
    sideways = np.cross(np.array([-up, right, 0.0]), upward)
    sideways /= np.linalg.norm(sideways)
    across = np.concatenate([-radius[::-1], radius])
    over = np.concatenate([tall[::-1], tall]) - depth_mm
    places = frame.origin_mm + across[:, None] * sideways + over[:, None] * upward
    along = (places[:, :2] - np.array(plane.start_mm)) @ np.array(plane.direction)
    return np.column_stack([along, places[:, 2]])


def cut_tip_mm(design: SensorDesign, frame: PressFrame, depth_mm: float, plane: CutPlane) -> FloatArray:
    """(n, 2) distance and height where a vertical plane cuts the tip [mm]; empty where it misses it."""
    radius, tall = tip_points_mm(design.indenter, TIP_LENGTH, TIP_POINTS).T

    def beyond(places: FloatArray) -> FloatArray:
        across, aside, over = frame.seen_from_it(places)
        high = over + depth_mm
        half = np.interp(high, tall, radius)
        return np.asarray(np.hypot(across, aside) - np.where(high < 0.0, high, half))

    return plane.line_mm(beyond, frame.origin_mm)
