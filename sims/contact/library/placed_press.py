"""A press at one place of a rectangular pad: the round pad's press between other walls.

Model
-----
The walls change a press by D(x, y), a small and smooth lift of the top (`sims.contact.walls`). Beside the tip D is
nearly the same everywhere, D₀: so the tip meets a top that is D₀ higher, and the press is that of the round pad at the
depth d' = d + D₀(d'), lifted by D₀. Force and contact are those of d'. With h the round pad's top at d', G what the
press's loads raise in the round pad, and w falling from 1 at `NEAR` to 0 at `FAR`, the whole top is

    S(x, y) = w h(r) + (1 - w) G(r) + D(x, y):

the solved press near the tip, the linear layer beyond, zero at the walls. Beyond the deepest solved depth, by as much
as walls may add, the free surface goes on sinking as it did over the last `STEP`.

Left out: that D tilts the contact (inside it D - D₀ is 50 µm at most on the published pad); walls nearer than
`NEAREST_WALL`, or that change the depth by more than `LARGEST_CHANGE`. Lengths in tip radii, forces in E R².
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from design.arrays import FloatArray
from design.errors import InputError, ModelScopeError
from design.rules.contact_scope import NEAREST_WALL
from sims.contact.library.smooth_press import SmoothPress, outward, runs_back
from sims.contact.library.surface_curve import TopCurve
from sims.contact.walls.block_layer import Size
from sims.contact.walls.surroundings import Surroundings, surroundings

NEAR, FAR = 2.0, 3.5
LARGEST_CHANGE = 0.25
"""Largest change of the depth by walls over the depth [-]: with 0.14 of it a twentieth of the change is wrong."""
STEP = 0.03
ROUNDS, SETTLED = 30, 1e-10
SIDES = ("west", "east", "south", "north")


@dataclass(frozen=True, kw_only=True)
class PlacedPress:
    """Presses at one place.

    Attributes
    ----------
    smooth : in the round pad
    size, at : length and width of the pad; x, y of the axis from its corner

    Raises
    ------
    InputError, ModelScopeError : a place that is no number, or too near to a wall
    """

    smooth: SmoothPress
    size: Size
    at: tuple[float, float]

    def __post_init__(self) -> None:
        """Refuse places that the walls' model does not cover."""
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
        """Depth d' of the round pad's press that is this place's at a depth.

        Raises
        ------
        ModelScopeError : walls that change it by more than `LARGEST_CHANGE`
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
        """Force at a depth."""
        inner, deepest = self.round_depth(depth), self.smooth.deepest
        if inner <= deepest:
            return self.smooth.force_at(inner)
        last, before = self.smooth.force_at(deepest), self.smooth.force_at(deepest - STEP)
        return last + (inner - deepest) * (last - before) / STEP

    def curve_at(self, depth: float) -> TopCurve:
        """The solved press around the axis, lifted by D₀ near the tip, out to the round pad's wall."""
        if depth <= 0.0:
            return self.smooth.curve_at(0.0)
        inner = self.round_depth(depth)
        curve = _solved(self.smooth, inner)
        kept, slope = _fading(curve.radius)
        return _raised(curve, (inner - depth) * kept, (inner - depth) * slope)

    def near_at(self, depth: float) -> TopCurve:
        """w (h + D₀): what is a curve around the axis, to `FAR`, which never runs back; `beside` is the rest."""
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
        """(nx, ny) S - w (h + D₀) at x (nx,) and y (ny,) from the pad's corner: smooth everywhere."""
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
    """w and dw/dr at radii: 1 to `NEAR`, 0 from `FAR`, with two continuous derivatives between."""
    t = np.clip((radius - NEAR) / (FAR - NEAR), 0.0, 1.0)
    return 1.0 - t**3 * (10.0 - 15.0 * t + 6.0 * t * t), -30.0 * (t * (1.0 - t)) ** 2 / (FAR - NEAR)


def _raised(
    curve: TopCurve, height: FloatArray, slope: FloatArray, scale: FloatArray | float = 1.0
) -> TopCurve:
    """A curve with heights added; its slopes scaled, then added to, where anything is."""
    changed = (slope != 0.0) | (np.broadcast_to(scale, slope.shape) != 1.0)
    steeper = np.arctan(np.tan(curve.inclination) * scale + slope)
    return replace(
        curve, height=curve.height + height, inclination=np.where(changed, steeper, curve.inclination)
    )


def _solved(smooth: SmoothPress, depth: float) -> TopCurve:
    """The round pad's top; beyond the deepest solved press the free surface sinks on as it did last."""
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
