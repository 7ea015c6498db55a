"""Plots of a press: surface under the tip, load, contact radius, pressure, and the load during a protocol.

The module also computes the top of a pad under a press, in space and in a vertical cross-section.

A press moves along the normal of the untouched top, which is the third axis of its coordinate system
(`optopad.design.shape.top`). There, the height of the pressed top is a curve rotated about the axis, minus the drop of
the crown below the tangent plane. Where the curve overhangs near the shank, its lowest height is used, as in
`optopad.sims.contact.pad_surface`. The tip is its outline rotated about the axis. On a crown, a vertical plane need not
contain the axis, so a cross-section is found as the line along which a function of position is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from optopad.design.arrays import FloatArray
from optopad.design.fields.quantity import Quantity
from optopad.design.shape.cavity import Plan, plan_of
from optopad.design.shape.top import Top
from optopad.design.spec import SensorDesign
from optopad.sims.contact.force_curve import ForceCurve
from optopad.sims.contact.load_protocol import LoadHistory
from optopad.sims.contact.pad_surface import curve_height_mm
from optopad.sims.contact.pressure import ContactPressure
from optopad.sims.contact.tip import tip_points_mm
from optopad.sims.plots.style import (
    BLUE,
    GREEN,
    GREY,
    GRID,
    INK,
    MUTED,
    PALE_BLUE,
    VERMILLION,
    axes_or_new,
)
from optopad.sims.press import Indentation

Place = tuple[float, float]

CUT_POINTS = 500
"""Number of points in each direction of the grid on which the line of a cross-section is found."""
TIP_POINTS, TIP_LENGTH = 400, 6.0
"""Number of points on the tip's outline, and the outline's length [tip radii]."""


@dataclass(frozen=True, kw_only=True)
class PressFrame:
    """Coordinate system of a press: its third axis is the axis of the press.

    Attributes
    ----------
    origin_mm : (3,) origin on the untouched top, in cavity coordinates [mm]
    axes : (3, 3) unit vectors of the three axes, in this order; the third runs along the press and points upward [-]
    top : the untouched top in this coordinate system
    """

    origin_mm: FloatArray
    axes: FloatArray
    top: Top

    def places_mm(self, across_mm: FloatArray, aside_mm: FloatArray, over_mm: FloatArray) -> FloatArray:
        """Convert coordinates (...) along the three axes of the press to points (..., 3) in cavity coordinates [mm]."""
        return np.asarray(self.origin_mm + np.stack([across_mm, aside_mm, over_mm], axis=-1) @ self.axes)

    def seen_from_it(self, places_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Convert points (..., 3) in cavity coordinates to coordinates (...) along the three axes of the press [mm]."""
        along = (places_mm - self.origin_mm) @ self.axes.T
        return along[..., 0], along[..., 1], along[..., 2]

    def fall_mm(self, across_mm: FloatArray, aside_mm: FloatArray) -> FloatArray:
        """(...) distance of the untouched top below its tangent plane at the origin [mm]."""
        fall = self.top.sag_mm(across_mm, aside_mm)
        return np.asarray(np.where(np.isnan(fall), self.top.radius_mm, fall))

    def top_mm(self, press: Indentation | None, across_mm: FloatArray, aside_mm: FloatArray) -> FloatArray:
        """(...) height of the pressed top along the third axis [mm]; if `press` is None, that of the untouched top."""
        fall = self.fall_mm(across_mm, aside_mm)
        return -fall if press is None else curve_height_mm(press, np.hypot(across_mm, aside_mm)) - fall


def press_frame(design: SensorDesign, at_mm: Place) -> PressFrame:
    """The coordinate system of a press at a location; on a flat top, the axis of the press is vertical."""
    top = plan_of(design).top
    origin, axes = top.press_frame(*at_mm)
    return PressFrame(origin_mm=origin, axes=axes, top=top.in_frame)


@dataclass(frozen=True, kw_only=True)
class CutPlane:
    """A vertical plane that cuts through a pad; its coordinates are a horizontal distance and a height.

    Attributes
    ----------
    start_mm : (x, y) where the horizontal distance is 0 [mm]
    direction : (x, y) horizontal unit vector along the plane [-]
    reach_mm : smallest and largest distance that is drawn [mm]
    ceiling_mm : height up to which the plane is drawn [mm]
    """

    start_mm: Place
    direction: Place
    reach_mm: tuple[float, float]
    ceiling_mm: float

    def places_mm(self, along_mm: FloatArray, height_mm: FloatArray) -> FloatArray:
        """Convert distances and heights (...) in the plane to points (..., 3) in cavity coordinates [mm]."""
        (x, y), (dx, dy) = self.start_mm, self.direction
        return np.stack([x + along_mm * dx, y + along_mm * dy, height_mm], axis=-1)

    def untouched_mm(self, plan: Plan) -> FloatArray:
        """Distance and height (n, 2) of points on the untouched top in the plane [mm]."""
        along = np.linspace(*self.reach_mm, CUT_POINTS)
        places = self.places_mm(along, np.zeros_like(along))
        return np.column_stack([along, [plan.top_mm(float(x), float(y)) for x, y, _ in places]])

    def line_mm(self, beyond_mm: Callable[[FloatArray], FloatArray], through_mm: FloatArray) -> FloatArray:
        """Distance and height (n, 2) of the longest line in the plane along which a function of position is zero [mm].

        It is empty, with shape (0, 2), if there is no such line.

        Parameters
        ----------
        beyond_mm : the function, from points (..., 3) in cavity coordinates [mm] to values (...)
        through_mm : (3,) point near which the line is found exactly, such as the foot of a press's axis [mm]
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
    """Distance and height (n, 2) of points on the pressed top where a vertical plane cuts it [mm]."""

    def beyond(places: FloatArray) -> FloatArray:
        across, aside, over = frame.seen_from_it(places)
        return np.asarray(over - frame.top_mm(press, across, aside))

    return plane.line_mm(beyond, frame.origin_mm)


def seen_tip_mm(design: SensorDesign, frame: PressFrame, depth_mm: float, plane: CutPlane) -> FloatArray:
    """Distance and height (n, 2) of points on the tip's outline, projected onto a vertical plane [mm]."""
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
    """Distance and height (n, 2) of the line along which a vertical plane cuts the tip [mm]; empty if there is none."""
    radius, tall = tip_points_mm(design.indenter, TIP_LENGTH, TIP_POINTS).T

    def beyond(places: FloatArray) -> FloatArray:
        across, aside, over = frame.seen_from_it(places)
        high = over + depth_mm
        half = np.interp(high, tall, radius)
        return np.asarray(np.hypot(across, aside) - np.where(high < 0.0, high, half))

    return plane.line_mm(beyond, frame.origin_mm)


HEIGHT_IN = 3.2
PROFILE_HEIGHT_IN = 3.0
SHOWN_RADII = 3.0
"""Half the width of a profile plot [tip radii]."""
POINT: dict[str, Any] = {
    "color": VERMILLION,
    "marker": "D",
    "markersize": 6,
    "markeredgecolor": INK,
    "linestyle": "none",
}
DEPTH_LABEL = "depth of the press [mm]"


def plot_profile(
    press: Indentation,
    tip_mm: tuple[FloatArray, FloatArray],
    ax: Axes | None = None,
    *,
    crown_radius_mm: float | None = None,
) -> Axes:
    """Cross-section of tip and pad: height [mm] against distance from the axis [mm], at equal scales.

    Parameters
    ----------
    press : the deformed surface
    tip_mm : radii of points on the tip's outline from the apex to the shank, and their heights above the apex [mm]
    crown_radius_mm : radius of the sphere with the mean curvature of a crowned top [mm]; None for a flat top
    """
    untouched = np.zeros_like(press.radius_mm)
    if crown_radius_mm is not None:
        untouched = -(press.radius_mm**2) / (
            crown_radius_mm + np.sqrt(crown_radius_mm**2 - press.radius_mm**2)
        )
    ax = axes_or_new(ax, PROFILE_HEIGHT_IN)
    half_width = SHOWN_RADII * press.tip_radius_mm
    radius, height = _mirrored(press.radius_mm, press.height_mm + untouched)
    tip_radius, tip_height = _mirrored(tip_mm[0], tip_mm[1] - press.depth_mm)
    floor, ceiling = -press.depth_mm - 0.5 * press.tip_radius_mm, 0.7 * press.tip_radius_mm
    # a polygon, because the surface may run back near the shank
    ax.fill(
        np.append(radius, radius[[-1, 0]]), np.append(height, [floor, floor]), color=PALE_BLUE, linewidth=0
    )
    ax.fill(tip_radius, tip_height, facecolor="white", edgecolor=GREY, hatch="////", linewidth=0)
    ax.plot(tip_radius, tip_height, color=MUTED, linewidth=1.2)
    ax.plot(
        radius,
        height,
        color=BLUE,
        linewidth=2,
        label=f"surface at {press.depth_mm:g} mm, {press.force_n:.3g} N",
    )
    look: dict[str, Any] = {"color": MUTED, "linewidth": 1.0, "linestyle": (0, (4, 3))}
    if crown_radius_mm is None:
        ax.axhline(0.0, label="undisturbed surface", **look)
    else:
        ax.plot(*_mirrored(press.radius_mm, untouched), label="undisturbed surface", **look)
    _mark_contact_edge(ax, press, untouched)
    for height_mm, name in ((0.4 * press.tip_radius_mm, "tip"), (0.5 * (floor - press.depth_mm), "pad")):
        box = {"facecolor": "white" if name == "tip" else "none", "edgecolor": "none", "pad": 2.0}
        ax.text(0.0, height_mm, name, ha="center", va="center", color=INK, bbox=box)
    ax.set_xlim(-half_width, half_width)
    ax.set_ylim(floor, ceiling)
    ax.set_aspect("equal")
    ax.set_xlabel("distance from the axis of the press [mm]")
    ax.set_ylabel("height [mm]")
    ax.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), ncols=2)
    return ax


def _mirrored(radius: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mirror the right half of a cross-section, given from the axis outward; return the whole, from left to right."""
    return np.concatenate([-radius[::-1], radius]), np.concatenate([height[::-1], height])


def _mark_contact_edge(ax: Axes, press: Indentation, untouched: FloatArray) -> None:
    if press.contact_radius_mm <= 0.0:
        return
    edge = int(np.argmax(press.radius_mm >= press.contact_radius_mm - 1e-9))
    height_mm = press.height_mm[edge] + untouched[edge]
    ax.plot(
        [-press.contact_radius_mm, press.contact_radius_mm],
        [height_mm, height_mm],
        label=f"edge of the contact, at {press.contact_radius_mm:.2f} mm",
        **(POINT | {"marker": "o", "markersize": 5}),
    )


def plot_pressure(pressure: ContactPressure, ax: Axes | None = None) -> Axes:
    """Pressure between tip and pad [MPa] against distance from the axis [mm]."""
    ax = axes_or_new(ax, HEIGHT_IN)
    radius, height = _mirrored(pressure.radius_mm, pressure.pressure_mpa)
    ax.fill_between(radius, 0.0, height, color=PALE_BLUE, linewidth=0)
    ax.plot(radius, height, color=BLUE, linewidth=2, label=f"depth {pressure.depth_mm:g} mm")
    if not pressure.is_resolved:
        ax.set_title(
            "the contact is too small for the mesh: shape not resolved", fontsize=9, color=VERMILLION
        )
    ax.set_ylim(0.0, 1.2 * max(float(pressure.pressure_mpa.max()), 1e-6))
    ax.grid(color=GRID, linewidth=0.6)
    ax.set_xlabel("distance from the axis of the press [mm]")
    ax.set_ylabel("contact pressure [MPa]")
    ax.legend(loc="upper left")
    return ax


def plot_force(
    force: ForceCurve,
    modulus: Quantity,
    ax: Axes | None = None,
    *,
    measured: Sequence[tuple[float, float, str]] = (),
) -> Axes:
    """Load [N] against depth [mm], with the band due to the uncertainty of the modulus.

    Parameters
    ----------
    modulus : Young's modulus for which the loads are computed [MPa]
    measured : measurements for comparison, each as (depth [mm], force [N], label)
    """
    ax = axes_or_new(ax, HEIGHT_IN)
    if force.has_band:
        ax.fill_between(
            force.depth_mm,
            force.low_n,
            force.high_n,
            color=PALE_BLUE,
            linewidth=0,
            label=f"modulus {modulus.low:.3g} to {modulus.high:.3g} MPa",
        )
    ax.plot(force.depth_mm, force.force_n, color=BLUE, linewidth=2, label=f"modulus {modulus.value:.3g} MPa")
    for depth_mm, force_n, label in measured:
        ax.plot(depth_mm, force_n, label=label, **POINT)
    _frame(ax, force.depth_mm, "load [N]")
    ax.legend(loc="upper left")
    return ax


def plot_force_near(force: ForceCurve, modulus: Quantity, measured: tuple[float, float, str]) -> Axes:
    """Load [N] against depth [mm] around one measured point, from first contact to twice the point's depth."""
    ax = plot_force(force, modulus, measured=[measured])
    deepest = min(2.0 * measured[0], float(force.depth_mm[-1]))
    ax.set_xlim(0.0, deepest)
    ax.set_ylim(0.0, 1.05 * max(force.at(deepest)[2], measured[1]))
    return ax


def plot_contact_radius(force: ForceCurve, ax: Axes | None = None) -> Axes:
    """Radius of the contact circle [mm] against depth [mm]."""
    ax = axes_or_new(ax, HEIGHT_IN)
    ax.plot(force.depth_mm, force.contact_radius_mm, color=GREEN, linewidth=2)
    _frame(ax, force.depth_mm, "contact radius [mm]")
    return ax


def plot_load_protocol(history: LoadHistory, ax: Axes | None = None) -> Axes:
    """Load [N] against depth [mm] during a load protocol; points mark the load at the end of each pause."""
    ax = axes_or_new(ax, HEIGHT_IN)
    turn = history.turn
    inward = "pressing" if history.has_relaxation else "pressing and retracting: the same, elastic"
    ax.plot(history.depth_mm[: turn + 1], history.load_n[: turn + 1], color=BLUE, linewidth=1.6, label=inward)
    if history.has_relaxation:
        ax.plot(
            history.depth_mm[turn:],
            history.load_n[turn:],
            color=VERMILLION,
            linewidth=1.6,
            linestyle=(0, (5, 2)),
            label="retracting",
        )
    _mark_pauses(ax, history, history.depth_mm)
    _frame(ax, history.depth_mm[: turn + 1], "load [N]")
    ax.legend(loc="upper left")
    return ax


def plot_load_over_time(history: LoadHistory, ax: Axes | None = None) -> Axes:
    """Load [N] against time [s] during a load protocol, compared with the load of a purely elastic pad."""
    ax = axes_or_new(ax, HEIGHT_IN)
    ax.plot(history.time_s, history.load_n, color=BLUE, linewidth=1.6, label="load")
    if history.has_relaxation:
        ax.plot(
            history.time_s,
            history.elastic_n,
            color=MUTED,
            linewidth=1.0,
            linestyle=(0, (2, 1.5)),
            label="elastic press (fully relaxed)",
        )
    _mark_pauses(ax, history, history.time_s)
    ax.set_xlim(0.0, float(history.time_s[-1]))
    ax.set_ylim(0.0, 1.35 * float(history.load_n.max()))
    ax.grid(color=GRID, linewidth=0.6)
    ax.set_xlabel("time from first contact [s]")
    ax.set_ylabel("load [N]")
    ax.legend(loc="upper left", ncols=2)
    return ax


def _mark_pauses(ax: Axes, history: LoadHistory, across: FloatArray) -> None:
    look = POINT | {"marker": "o", "markersize": 4.5}
    ends = history.pause_ends
    ax.plot(across[ends], history.load_n[ends], label="end of a pause", clip_on=False, zorder=3, **look)


def _frame(ax: Axes, depth_mm: FloatArray, label: str) -> None:
    ax.set_xlim(0.0, float(depth_mm[-1]))
    ax.set_ylim(bottom=0.0)
    ax.grid(color=GRID, linewidth=0.6)
    ax.set_xlabel(DEPTH_LABEL)
    ax.set_ylabel(label)
