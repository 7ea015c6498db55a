"""Presses at every depth: in mm and N (`SolvedPress`), and at one location of a rectangular pad (`PlacedPress`).

The library holds presses into a round pad. `PlacedPress` corrects them for the walls of a rectangular pad.

Model
-----
Compared with the round pad, the rectangular pad's walls lift the top by a small and smooth amount D(x, y)
(`optopad.sims.contact.walls`). Near the tip D is nearly constant, D₀, so the tip meets a top that is D₀ higher. The
press is then that of the round pad at the depth d' = d + D₀(d'), lifted by D₀. Force and contact are those at d'. The
top is

    S(x, y) = w h(r) + (1 - w) G(r) + D(x, y)

Here r is the distance from the press axis, h the round pad's top at d', and G the top of a linear elastic round pad
under loads that replace the press. The weight w falls from 1 at r = `NEAR` to 0 at `FAR`. So S is the solved press near
the tip, the linear layer farther out, and zero at the walls. If d' exceeds the deepest solved depth, the free surface
continues to sink at the rate of the last `STEP`.

Left out: the tilt of the contact by D (inside it, D - D₀ is 50 µm at most on the published pad). Presses with walls
nearer than `NEAREST_WALL`, or walls that change the depth by more than `LARGEST_CHANGE`, are refused. Lengths are in
tip radii, forces in E R².
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.fields.quantity import Quantity
from optopad.design.rules.shape import NEAREST_WALL
from optopad.sims.contact.library.smooth_press import (
    SmoothPress,
    TopCurve,
    above_crown,
    outward,
    run_out,
    runs_back,
)
from optopad.sims.contact.library.stored_press import UnitPress
from optopad.sims.contact.scope import half_width_of
from optopad.sims.contact.tip import HEMISPHERE
from optopad.sims.contact.walls import Size, Surroundings, surroundings
from optopad.sims.press import Indentation

NEAR, FAR = 2.0, 3.5
LARGEST_CHANGE = 0.25
"""Largest accepted change of the depth by walls, over the depth [-]. At 0.14, the change has an error of 5 %."""
STEP = 0.03
ROUNDS, SETTLED = 30, 1e-10
SIDES = ("west", "east", "south", "north")


@dataclass(frozen=True, kw_only=True)
class PlacedPress:
    """Presses at one location of a rectangular pad, at every depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    smooth : the presses into the round pad of the same area
    size, at : length and width of the pad, and (x, y) of the press axis from its corner

    Raises
    ------
    InputError : the location is not finite
    ModelScopeError : the location is too near a wall
    """

    smooth: SmoothPress
    size: Size
    at: tuple[float, float]

    def __post_init__(self) -> None:
        """Refuse locations that are not finite, or are too near a wall for the wall model."""
        (x, y), (length, width) = self.at, self.size
        for side, distance in zip(SIDES, (x, length - x, y, width - y), strict=True):
            if not math.isfinite(distance):
                raise InputError(f"at_mm: {side} = {distance} must be a finite number")
            if distance < NEAREST_WALL - 1e-9:
                raise ModelScopeError(
                    f"at_mm: the {side} wall is {distance:.2f} tip radii from the press axis; the contact model covers "
                    f"{NEAREST_WALL:g} and more; press farther from it, raise operating.workspace_margin_mm, or use "
                    "a smaller tip"
                )

    @cached_property
    def _walls(self) -> Surroundings:
        return surroundings(self.smooth.layer_depth, self.smooth.wall_radius, self.size, self.at)

    def round_depth(self, depth: float) -> float:
        """Depth in the round pad with the same force and contact as at a depth here (d' in the module's model).

        Raises
        ------
        ModelScopeError : the walls change the depth by more than `LARGEST_CHANGE`
        """
        found = depth
        if depth <= 0.0:
            return 0.0
        for _ in range(ROUNDS):
            before, found = found, depth + float(self.smooth.far.amplitudes(found) @ self._walls.on_axis)
            if abs(found - before) < SETTLED:
                break
            if not abs(found - depth) <= LARGEST_CHANGE * depth:
                length, width = self.size
                raise ModelScopeError(
                    f"cavity: walls of a pad of {length:.2f} x {width:.2f} tip radii change the press at "
                    f"({self.at[0]:.2f}, {self.at[1]:.2f}) by more than {LARGEST_CHANGE:.0%}; use a larger pad or a "
                    "smaller tip"
                )
        return found

    def force_at(self, depth: float) -> float:
        """Force at a depth [E R²]."""
        inner, deepest = self.round_depth(depth), self.smooth.deepest
        if inner <= deepest:
            return self.smooth.force_at(inner)
        last, before = self.smooth.force_at(deepest), self.smooth.force_at(deepest - STEP)
        return last + (inner - deepest) * (last - before) / STEP

    def curve_at(self, depth: float) -> TopCurve:
        """The round pad's top at the equivalent depth, as far as its wall; near the tip it is lifted by D₀."""
        if depth <= 0.0:
            return self.smooth.curve_at(0.0)
        inner = self.round_depth(depth)
        curve = _solved(self.smooth, inner)
        kept, slope = _fading(curve.radius)
        return _raised(curve, (inner - depth) * kept, (inner - depth) * slope)

    def near_at(self, depth: float) -> TopCurve:
        """The part of the top that is symmetric about the press axis: w (h + D₀) in the module's model.

        It ends at height 0 at radius `FAR`, and overhangs are removed. `beside` gives the rest of the top.
        """
        if depth <= 0.0:
            return self.smooth.curve_at(0.0)
        inner = self.round_depth(depth)
        solved = _solved(self.smooth, inner)
        curve = replace(solved, height=solved.height + (inner - depth))
        kept, slope = _fading(curve.radius)
        faded = _raised(curve, curve.height * (kept - 1.0), curve.height * slope, kept)
        kept_points = ~runs_back(curve) & (curve.radius < FAR)
        return replace(
            faded,
            radius=np.append(faded.radius[kept_points], FAR),
            height=np.append(faded.height[kept_points], 0.0),
            inclination=np.append(faded.inclination[kept_points], 0.0),
        )

    def beside(self, depth: float, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height (nx, ny) of the top minus the part `near_at`, at x (nx,) and y (ny,) from the pad's corner."""
        if depth <= 0.0:
            return np.zeros((len(x), len(y)))
        inner = self.round_depth(depth)
        loads = self.smooth.far.amplitudes(inner)
        radius = np.hypot(x[:, None] - self.at[0], y[None, :] - self.at[1])
        kept, _ = _fading(radius)
        linear = sum(
            size * one.top_at(radius) for size, one in zip(loads, self._walls.round_pad, strict=True)
        )
        change = self._walls.change(loads, x, y)
        return np.asarray(change + (1.0 - kept) * linear - kept * (inner - depth), dtype=np.float64)


def _fading(radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weight w of the solved press at radii, and its slope dw/dr. It is 1 up to `NEAR`, and 0 from `FAR` on."""
    t = np.clip((radius - NEAR) / (FAR - NEAR), 0.0, 1.0)
    return 1.0 - t**3 * (10.0 - 15.0 * t + 6.0 * t * t), -30.0 * (t * (1.0 - t)) ** 2 / (FAR - NEAR)


def _raised(
    curve: TopCurve, height: FloatArray, slope: FloatArray, scale: FloatArray | float = 1.0
) -> TopCurve:
    """Add heights to a curve; multiply the slopes of its tangents by `scale`, and then add `slope`."""
    changed = (slope != 0.0) | (np.broadcast_to(scale, slope.shape) != 1.0)
    steeper = np.arctan(np.tan(curve.inclination) * scale + slope)
    return replace(
        curve, height=curve.height + height, inclination=np.where(changed, steeper, curve.inclination)
    )


def _solved(smooth: SmoothPress, depth: float) -> TopCurve:
    """The round pad's top at a depth; beyond the deepest solved press, the free surface sinks on at its last rate."""
    further = depth - smooth.deepest
    if further <= 0.0:
        return smooth.curve_at(depth)
    last, before = smooth.curve_at(smooth.deepest), smooth.curve_at(smooth.deepest - STEP)
    free = np.linspace(last.contact_radius + 0.3, smooth.wall_radius, 40)
    tops = [PchipInterpolator(*outward(one))(free) for one in (last, before)]
    sinking = PchipInterpolator(
        np.append([0.0, last.contact_radius], free), np.append([-1.0, -1.0], (tops[0] - tops[1]) / STEP)
    )
    return _raised(last, further * sinking(last.radius), further * sinking(last.radius, 1))


LEAST_RUN_OUT = 0.02
"""Relative difference of the nearest and the farthest wall's distance up to which the curve is not faded out [-]."""


@dataclass(frozen=True, kw_only=True)
class SolvedPress:
    """A press of one tip into one layer, in mm and N, at every depth up to the deepest solved one.

    Attributes
    ----------
    smooth : the presses into the round pad, in tip radii and E R²
    tip_radius_mm : radius of the tip [mm]
    modulus : Young's modulus of the layer [MPa]; it scales the force only
    placed : the presses corrected for the walls of a rectangular pad at a location; if None, `smooth` is not corrected
    walls_mm : distances of the nearest and the farthest wall from the press axis in a pad with round walls [mm]; None
        if all walls are straight
    unit : the solver's states if the press was solved live; None if it is from the library
    notes : notes for the user about this solution
    """

    smooth: SmoothPress
    tip_radius_mm: float
    modulus: Quantity
    placed: PlacedPress | None = None
    walls_mm: tuple[float, float] | None = None
    unit: UnitPress | None = None
    notes: tuple[str, ...] = ()

    @property
    def deepest_mm(self) -> float:
        """Deepest solved press [mm]."""
        return self.smooth.deepest * self.tip_radius_mm

    @property
    def mesh_mm(self) -> float:
        """Node spacing under the tip [mm]."""
        return self.smooth.mesh_size * self.tip_radius_mm

    def scaled_depth(self, depth_mm: float) -> float:
        """Convert a depth from mm to tip radii.

        Raises
        ------
        ModelScopeError : the depth exceeds the deepest solved one
        """
        depth = depth_mm / self.tip_radius_mm
        if not depth <= self.smooth.deepest * (1.0 + 1e-9):
            raise ModelScopeError(
                f"depth_mm: {depth_mm:g} is beyond the solved {self.deepest_mm:g} mm; "
                "raise operating.max_depth_mm or press less deep"
            )
        return min(depth, self.smooth.deepest)

    def round_depth(self, depth_mm: float) -> float:
        """Depth in the round pad [tip radii] with the same force as at a depth [mm] here; errors are those of `at`."""
        depth = self.scaled_depth(depth_mm)
        return depth if self.placed is None else self.placed.round_depth(depth)

    def force_n(self, depth_mm: float) -> float:
        """Force [N] at a depth [mm]; errors are those of `at`."""
        depth, unit_n = self.scaled_depth(depth_mm), self.modulus.value * self.tip_radius_mm**2
        return unit_n * (self.placed or self.smooth).force_at(depth)

    def at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm], its surface continued to the farthest walls; 0 or less means no contact.

        Heights are above the undeformed top, along its normal. So on a crowned pad, the curve is not spherical even
        inside the contact.

        Raises
        ------
        ModelScopeError : the depth exceeds the deepest solved one, or the walls change the press too much
        """
        curve = above_crown(
            (self.placed or self.smooth).curve_at(self.scaled_depth(depth_mm)), self.smooth.crown
        )
        if self.walls_mm is None:
            return self._indentation(run_out(curve, half_width_of(self.smooth.wall_radius)), depth_mm)
        nearest, farthest = (wall / self.tip_radius_mm for wall in self.walls_mm)
        if self.smooth.wall_radius < 0.5 * (nearest + farthest) - 1e-9:  # the pad has no wall there
            nearest = min(nearest, half_width_of(self.smooth.wall_radius))
        if farthest - nearest > LEAST_RUN_OUT * nearest:
            curve = run_out(curve, nearest, farthest - nearest)
        return self._indentation(curve, depth_mm)

    def near_at(self, depth_mm: float) -> Indentation:
        """The part of the press at a depth [mm] that is symmetric about its axis (`PlacedPress.near_at`).

        Raises
        ------
        ModelScopeError : the depth exceeds the deepest solved one, or the walls change the press too much
        """
        if self.placed is None:
            return self.at(depth_mm)
        return self._indentation(self.placed.near_at(self.scaled_depth(depth_mm)), depth_mm)

    def round_pad_at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm] in the round pad of the same area, with its force; errors are those of `at`."""
        plain = replace(self, placed=None)
        curve = self.smooth.curve_at(self.scaled_depth(depth_mm))
        return plain._indentation(above_crown(curve, self.smooth.crown), depth_mm)

    def _indentation(self, curve: TopCurve, depth_mm: float) -> Indentation:
        """Convert a curve from tip radii to mm, and add the force at this depth."""
        return Indentation(
            depth_mm=depth_mm,
            tip_radius_mm=self.tip_radius_mm,
            radius_mm=curve.radius * self.tip_radius_mm,
            height_mm=curve.height * self.tip_radius_mm,
            inclination_deg=np.degrees(curve.inclination),
            contact_radius_mm=curve.contact_radius * self.tip_radius_mm,
            force_n=self.force_n(depth_mm),
            is_hemisphere=self.smooth.tip == HEMISPHERE and self.smooth.crown == 0.0,
        )
