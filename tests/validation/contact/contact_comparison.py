"""Distance between a modelled press and the finite-element oracle's.

The oracle's top beyond its contact edge is taken at the two Gauss points of each quadratic edge, where its slope
is most accurate; each point stands for its share of arc length. From each point the nearest point of the modelled
curve (a cubic spline in arc length through the given points) is found:

* surface error: that distance, along the normal of the modelled curve;
* slope error: angle between the two tangents.

Root mean squares are means over the oracle's arc length from the contact edge to 3 tip radii from the axis, or to
the wall; slopes count from 0.1 tip radii beyond the edge (arc length) to 3 tip radii from the axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from optopad.design.arrays import FloatArray
from optopad.sims.press import Indentation
from tests.validation.contact.contact_reference import ReferenceState, contact_edge, sampled_curve

NEAR_RADIUS = 3.0
"""Radius to which surfaces are compared [tip radii]: 9 mm for a 3 mm tip."""
EDGE_DISTANCE = 0.1
"""Arc length from the contact edge beyond which slopes are compared [tip radii]: 0.3 mm for a 3 mm tip."""
GAUSS = 0.5 - 0.5 / np.sqrt(3.0)


@dataclass(frozen=True, kw_only=True)
class FreeSurface:
    """Points of the oracle's top beyond the contact edge; lengths in tip radii.

    Attributes
    ----------
    points, tangents : (n, 2) positions and unit tangents, outward
    share : (n,) arc length that each point stands for
    from_edge : (n,) arc length from the contact edge
    """

    points: FloatArray
    tangents: FloatArray
    share: FloatArray
    from_edge: FloatArray


@dataclass(frozen=True, kw_only=True)
class PressError:
    """One press against the oracle.

    Attributes
    ----------
    force_ratio : modelled over the oracle's force
    surface_rms_um, surface_largest_um : distance of the surfaces outside contact, to 3 tip radii from the axis
    wall_rms_um, wall_largest_um : the same to the wall
    slope_rms_deg : angle of the surfaces beyond 0.1 tip radii from the contact edge
    contact_radius_mm, oracle_radius_mm : radius of the contact circle
    """

    force_ratio: float
    surface_rms_um: float
    surface_largest_um: float
    wall_rms_um: float
    wall_largest_um: float
    slope_rms_deg: float
    contact_radius_mm: float
    oracle_radius_mm: float


def free_surface(state: ReferenceState) -> FreeSurface:
    """The oracle's top beyond its contact edge, at the Gauss points of its edges."""
    edges = np.stack([state.nodes[:-2:2], state.nodes[1:-1:2], state.nodes[2::2]], axis=1)
    s = np.array([GAUSS, 1.0 - GAUSS])
    shape = np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)
    slope = np.stack([4 * s - 3, 4 - 8 * s, 4 * s - 1], axis=1)
    points = np.matmul(shape, edges).reshape(-1, 2)
    tangents = np.matmul(slope, edges).reshape(-1, 2)
    speed = np.hypot(*tangents.T)
    start = np.array(state.contact_edge)
    after = np.flatnonzero((points - start) @ _tangent_at(points, tangents, start) > 0.0)
    nearest = int(np.argmin(np.hypot(*(points - start).T)))
    beyond = after[after >= max(nearest - 1, 0)]
    points, tangents, share = points[beyond], tangents[beyond] / speed[beyond, None], 0.5 * speed[beyond]
    steps = np.hypot(*np.diff(np.vstack([start, points]), axis=0).T)
    return FreeSurface(points=points, tangents=tangents, share=share, from_edge=np.cumsum(steps))


def _tangent_at(points: FloatArray, tangents: FloatArray, start: FloatArray) -> FloatArray:
    """Tangent at the point nearest to `start`."""
    return tangents[int(np.argmin(np.hypot(*(points - start).T)))]


def _nearest(curve: CubicSpline, length: float, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Feet of points on a curve and unit tangents there."""
    grid = np.linspace(0.0, length, 8001)
    samples = curve(grid)
    feet = np.array([grid[np.argmin(np.hypot(*(samples - point).T))] for point in points])
    for _ in range(3):
        offset, tangent = points - curve(feet), curve(feet, 1)
        feet = np.clip(feet + (offset * tangent).sum(axis=1) / (tangent**2).sum(axis=1), 0.0, length)
    tangent = curve(feet, 1)
    return curve(feet), tangent / np.hypot(*tangent.T)[:, None]


def _rms(values: FloatArray, share: FloatArray) -> float:
    return float(np.sqrt((share * values**2).sum() / share.sum()))


def curve_errors(
    surface: FreeSurface, radius: FloatArray, height: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance [tip radii] and angle [deg] of a modelled curve at the oracle's points.

    Parameters
    ----------
    surface : the oracle's
    radius, height : (m,) modelled curve from the axis outward [tip radii]
    """
    path = np.stack([radius, height], axis=1)
    path = path[np.concatenate([[True], np.hypot(*np.diff(path, axis=0).T) > 1e-9])]
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    feet, tangents = _nearest(CubicSpline(length, path), float(length[-1]), surface.points)
    cross = tangents[:, 0] * surface.tangents[:, 1] - tangents[:, 1] * surface.tangents[:, 0]
    return np.hypot(*(surface.points - feet).T), np.degrees(np.abs(np.arcsin(np.clip(cross, -1.0, 1.0))))


def press_error(press: Indentation, state: ReferenceState, youngs_modulus_mpa: float) -> PressError:
    """Compare a modelled press with the oracle's solution of the same layer and depth.

    Parameters
    ----------
    press : the modelled one
    state : the oracle's
    youngs_modulus_mpa : modulus of the modelled layer [MPa]
    """
    scale = press.tip_radius_mm
    surface = free_surface(state)
    distance, angle = curve_errors(surface, press.radius_mm / scale, press.height_mm / scale)
    near = surface.points[:, 0] <= NEAR_RADIUS
    sloped = near & (surface.from_edge >= EDGE_DISTANCE)
    to_um = 1e3 * scale
    return PressError(
        force_ratio=press.force_n / (state.force * youngs_modulus_mpa * scale**2),
        surface_rms_um=to_um * _rms(distance[near], surface.share[near]),
        surface_largest_um=to_um * float(distance[near].max()),
        wall_rms_um=to_um * _rms(distance, surface.share),
        wall_largest_um=to_um * float(distance.max()),
        slope_rms_deg=_rms(angle[sloped], surface.share[sloped]),
        contact_radius_mm=press.contact_radius_mm,
        oracle_radius_mm=scale * state.contact_radius,
    )


def oracle_error(state: ReferenceState, tip_radius_mm: float) -> PressError:
    """The oracle on elements of twice the size against itself, in the measures of `press_error`.

    With errors that fall at least with the square of the size, the finer solution is wrong by a third of it.
    """
    coarse = state.half
    radius, height = sampled_curve(coarse.nodes, 16)
    press = Indentation(
        depth_mm=state.depth * tip_radius_mm,
        tip_radius_mm=tip_radius_mm,
        radius_mm=radius * tip_radius_mm,
        height_mm=height * tip_radius_mm,
        contact_radius_mm=contact_edge(coarse.nodes, state.depth)[0] * tip_radius_mm,
        force_n=coarse.force * tip_radius_mm**2,
    )
    return press_error(press, state, 1.0)
