"""Description of a press that contact and light models share: depths, the deformed surface, and numbered locations.

Signals are computed at a series of depths that are closely spaced near contact, where mode 1 can end within 0.3 mm.

A press is axisymmetric. Its deformed surface is stored as a curve (radius, height), which starts on the axis under the
tip and runs outward. Near the shank the curve may run back, so the radius need not increase. Heights are relative to
the undisturbed surface, negative in the dimple and positive in the pile-up. Inside the contact circle the surface is
the tip's: an exact sphere for a hemisphere, the curve itself for any other tip.

A stage reports the same location slightly differently each time; such locations are merged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from optopad.design.arrays import FloatArray, IntArray

NEAR_CONTACT_MM = (0.0, 0.02, 0.05, 0.1, 0.15)
"""First depths of the fine schedule [mm]; chosen in the study of depth steps."""

NEAR_CONTACT_COARSE_MM = (0.0, 0.1)
"""First depths of the coarse schedule [mm]."""

STEP_MM = 0.1
"""Step of the fine schedule [mm]."""

COARSE_STEP_MM = 0.2
"""Step of the coarse schedule [mm]: it moves mode boundaries by up to 0.04 mm, at half the cost."""


def depth_schedule_mm(max_depth_mm: float, step_mm: float = STEP_MM) -> FloatArray:
    """Increasing depths from 0 up to and including the deepest press.

    Parameters
    ----------
    max_depth_mm : deepest press [mm]
    step_mm : spacing of the depths from 0.2 mm on [mm]. If it is below `COARSE_STEP_MM`, the depths before that are
        closely spaced

    Returns
    -------
    (n,) depths [mm]
    """
    first = NEAR_CONTACT_MM if step_mm < COARSE_STEP_MM else NEAR_CONTACT_COARSE_MM
    near = [depth for depth in first if depth < max_depth_mm]
    regular = np.arange(0.2, max_depth_mm - 1e-9, step_mm)
    return np.unique(np.round(np.concatenate([near, regular, [max_depth_mm]]), 6))


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """The deformed surface under one press by a tip that is a body of revolution.

    Attributes
    ----------
    depth_mm : depth of the tip's apex below the undisturbed surface [mm]; 0 = untouched
    tip_radius_mm : radius of the tip and its shank [mm]
    radius_mm : (n,) distance from the press axis along the curve [mm]
    height_mm : (n,) height relative to the undisturbed surface [mm]
    contact_radius_mm : radius of the circle where the surface leaves the tip [mm]
    force_n : press force [N]
    is_hemisphere : whether the tip is a hemisphere of radius `tip_radius_mm`
    inclination_deg : (n,) angle of the curve's tangent to the radial direction at each point, continuous along the
        curve [deg]; None if only the points of the curve are known
    """

    depth_mm: float
    tip_radius_mm: float
    radius_mm: FloatArray
    height_mm: FloatArray
    contact_radius_mm: float
    force_n: float
    is_hemisphere: bool = True
    inclination_deg: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class GridTop:
    """The deformed top under objects of any form, as heights on a grid of equally spaced nodes.

    The nodes are in the press frame at `at_mm`: its origin is on the untouched top, and z is the top's normal there
    (`optopad.design.shape.top.Top.press_frame`). Beyond the grid the top is untouched.

    Attributes
    ----------
    at_mm : (x, y) of the frame's origin in cavity coordinates [mm]
    x_mm, y_mm : (nx,), (ny,) equally spaced coordinates of the nodes in the press frame, of equal spacing [mm]
    height_mm : (nx, ny) height above the untouched top, along the frame's z [mm]
    level : (nx, ny) above 0 where an object touches, below 0 where the top is free; linear between the nodes of a cell,
        it is 0 at the edge of the contact
    """

    at_mm: tuple[float, float]
    x_mm: FloatArray
    y_mm: FloatArray
    height_mm: FloatArray
    level: FloatArray


SAME_PLACE_MM = 0.15
"""Locations within this distance count as the same [mm]: seven times the default stage's positioning error. Locations
drawn at random are at least 1 mm apart."""


def place_numbers(at_mm: FloatArray, within_mm: float = SAME_PLACE_MM) -> IntArray:
    """Number the locations of samples; samples at the same location get the same number.

    Parameters
    ----------
    at_mm : (n, 2) reported x, y [mm]
    within_mm : locations count as the same if a chain of samples links them in steps of at most this length [mm]

    Returns
    -------
    (n,) number of each sample's location, from 0 without gaps
    """
    distinct, number = np.unique(at_mm, axis=0, return_inverse=True)
    linked = cKDTree(distinct).query_pairs(within_mm, output_type="ndarray")
    count = len(distinct)
    graph = coo_array((np.ones(len(linked)), (linked[:, 0], linked[:, 1])), shape=(count, count))
    _, cluster = connected_components(graph, directed=False)
    return np.asarray(cluster[np.asarray(number).reshape(-1)], dtype=np.int64)
