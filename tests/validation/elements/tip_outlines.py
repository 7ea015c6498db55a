"""Rigid tips of the finite-element oracle: signed distance, outward normal and curvature; lengths in tip radii.

A tip is a solid of revolution. Its outline in the r-z half-plane runs from the apex (0, 0) outward and
upward, and consists of arcs (convex) and straight lines that meet with a common tangent, so the signed distance
is continuous with its gradient. The last line is the shank, which never ends.

        |        |            shank: line
        |        |
         \\     /             edge: arc
          `---'               apex: arc or line

The nearest piece gives the distance. Inside the tip this holds up to the medial axis, far more than any
penetration that the solver admits. Sharp edges and apexes are not offered: contact pressure there is unbounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray

SHANK_LENGTH = 1e3
"""Length of the shank [tip radii]; beyond any depth."""


@dataclass(frozen=True)
class Gap:
    """Signed distance of points to a tip.

    Attributes
    ----------
    distance : (...) positive outside
    normal : (2, ...) gradient of the distance: unit vector away from the tip
    curvature : (...) second derivative of the distance along the tangent
    """

    distance: FloatArray
    normal: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class Line:
    """A straight piece; the tip lies to the left of the way from start to end."""

    start: tuple[float, float]
    end: tuple[float, float]

    def gap(self, r: FloatArray, z: FloatArray) -> tuple[FloatArray, Gap]:
        """How far outside the piece a point's foot falls (0 on it), and the gap to the unbounded line."""
        direction = np.subtract(self.end, self.start)
        length = float(np.hypot(*direction))
        along, across = direction / length, np.array([direction[1], -direction[0]]) / length
        foot = (r - self.start[0]) * along[0] + (z - self.start[1]) * along[1]
        distance = (r - self.start[0]) * across[0] + (z - self.start[1]) * across[1]
        normal = np.stack([np.full_like(r, across[0]), np.full_like(r, across[1])])
        beyond = np.maximum(0.0, np.maximum(-foot, foot - length))
        return beyond, Gap(distance, normal, np.zeros_like(r))


@dataclass(frozen=True)
class Arc:
    """A convex arc; angles from straight down (0) to straight outward (π/2)."""

    center: tuple[float, float]
    radius: float
    first_angle: float
    last_angle: float

    def gap(self, r: FloatArray, z: FloatArray) -> tuple[FloatArray, Gap]:
        """How far outside the piece a point's foot falls (0 on it), and the gap to the whole circle."""
        out, up = r - self.center[0], z - self.center[1]
        reach = np.maximum(np.hypot(out, up), 1e-12)
        angle = np.arctan2(out, -up)
        beyond = np.maximum(0.0, np.maximum(self.first_angle - angle, angle - self.last_angle))
        return beyond * self.radius, Gap(
            reach - self.radius, np.stack([out / reach, up / reach]), 1.0 / reach
        )


@dataclass(frozen=True)
class Tip:
    """A tip whose apex touches the undisturbed surface at depth 0.

    Attributes
    ----------
    name : for records
    pieces : outline from the apex outward, apex at (0, 0)
    """

    name: str
    pieces: tuple[Line | Arc, ...]

    def gap(self, r: FloatArray, z: FloatArray, depth: float) -> Gap:
        """Gap of points when the tip is pressed to `depth`.

        Parameters
        ----------
        r, z : (...) points; z from the undisturbed surface
        """
        found = [piece.gap(r, z + depth) for piece in self.pieces]
        best = np.argmin([np.abs(gap.distance) + 1e3 * beyond for beyond, gap in found], axis=0)[None]

        def pick(values: list[FloatArray]) -> FloatArray:
            return np.take_along_axis(np.stack(values), best, axis=0)[0]

        return Gap(
            pick([gap.distance for _, gap in found]),
            np.stack([pick([gap.normal[axis] for _, gap in found]) for axis in (0, 1)]),
            pick([gap.curvature for _, gap in found]),
        )


def sphere_tip() -> Tip:
    """Hemisphere of radius 1 with a straight shank."""
    return Tip("sphere", (Arc((0.0, 1.0), 1.0, 0.0, 0.5 * np.pi), Line((1.0, 1.0), (1.0, SHANK_LENGTH))))


def flat_tip(edge_radius: float) -> Tip:
    """Flat punch of radius 1 whose edge is rounded."""
    flat = 1.0 - edge_radius
    return Tip(
        f"flat, edge {edge_radius:g}",
        (
            Line((-flat, 0.0), (flat, 0.0)),
            Arc((flat, edge_radius), edge_radius, 0.0, 0.5 * np.pi),
            Line((1.0, edge_radius), (1.0, SHANK_LENGTH)),
        ),
    )


def cone_tip(half_angle_deg: float, apex_radius: float, edge_radius: float) -> Tip:
    """Cone with a shank of radius 1; apex and edge are rounded.

    Parameters
    ----------
    half_angle_deg : between the axis and the flank [deg]
    apex_radius, edge_radius : of the rounding of apex and edge [tip radii]
    """
    slope = 0.5 * np.pi - np.radians(half_angle_deg)
    sine, cosine = np.sin(slope), np.cos(slope)
    start = (apex_radius * sine, apex_radius * (1.0 - cosine))
    end_r = 1.0 - edge_radius + edge_radius * sine
    end = (end_r, start[1] + (end_r - start[0]) * np.tan(slope))
    center = (1.0 - edge_radius, end[1] + edge_radius * cosine)
    return Tip(
        f"cone {half_angle_deg:g} deg, apex {apex_radius:g}, edge {edge_radius:g}",
        (
            Arc((0.0, apex_radius), apex_radius, 0.0, slope),
            Line(start, end),
            Arc(center, edge_radius, slope, 0.5 * np.pi),
            Line((1.0, center[1]), (1.0, SHANK_LENGTH)),
        ),
    )
