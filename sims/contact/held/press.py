r"""A press of rigid objects of any form into a pad: its top, pressure and force.

The object is given by the height of its lowest surface over each node of a grid, in the press frame. It is rigid and
without friction. The pad is an incompressible, linear elastic layer between its own walls (`layer`), E its Young's
modulus, so its shear modulus is E/3. The heights of the object are exact, not those of a parabola.

The edge of the contact
-----------------------
Where a smooth object leaves the top, at a distance s inside or outside the edge,

    p = A √s,      gap = A s^(3/2) / (3 μ)

(the edge of Hertz's contact in plane strain, ν = 1/2; Johnson, Contact Mechanics, 1985, section 4.2). The level of a
node is this s, positive inside and negative outside; A is found from neighbours on both sides of the edge, whose
distances add up to the step of the grid. At a sharp edge of the object, the edge is taken as half way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.optimize import brentq

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.contact.held.layer import PadLayer, WideLayer, pad_layer
from optopad.sims.contact.held.solve import contact_pressure
from optopad.sims.contact.scope import Contact, Place
from optopad.sims.press import GridTop

STEP_MM = 0.16
"""Largest distance of the grid's nodes."""
SETTLED = 1e-6
"""Largest accepted gap or overlap in the contact, over the depth [-]."""
LARGEST_SHARE = 0.4
"""Deepest press over the elastic layer's thickness at the location [-]."""
NEAREST = 0.15
"""Least distance of the contact from a wall, over the layer's thickness [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldPress:
    """A press of rigid objects into a pad.

    Attributes
    ----------
    top : the deformed top
    pressure_mpa : (nx, ny) pressure at the top's nodes
    force_n : force along the press frame's z
    area_mm2 : area of the contact
    depth_mm : depth from first touch
    notes : notes for the user
    """

    top: GridTop
    pressure_mpa: FloatArray
    force_n: float
    area_mm2: float
    depth_mm: float
    notes: tuple[str, ...] = ()


def grid_of(contact: Contact, at_mm: Place) -> tuple[FloatArray, FloatArray]:
    """Equally spaced nodes x (nx,) and y (ny,) of a grid that covers the pad, in the press frame at a location [mm]."""
    plan = contact.draft.plan
    origin, axes = plan.top.press_frame(*at_mm)
    border = np.concatenate([one.points(np.linspace(0.0, 1.0, 65)) for one in plan.outline.loop])
    height = plan.top.height_mm(*border.T)
    x, y, _ = axes @ (np.column_stack([border, height]) - origin).T
    spans = [(float(one.min()), float(one.max())) for one in (x, y)]
    longest = max(high - low for low, high in spans)
    step = longest / math.ceil(longest / STEP_MM)
    counts = [math.ceil((high - low) / step - 1e-6) for low, high in spans]
    first, second = (
        (low + high) / 2 + step * (np.arange(count + 1) - count / 2)
        for (low, high), count in zip(spans, counts, strict=True)
    )
    return first, second


class _Pad:
    """A pad's top on the grid of the press frame at a location."""

    def __init__(self, contact: Contact, at_mm: Place) -> None:
        plan = contact.draft.plan
        cavity = contact.design.cavity
        elastic_mm = cavity.clear_thickness_mm + cavity.black_thickness_mm - float(plan.top.sag_mm(*at_mm))
        self.deepest_mm = LARGEST_SHARE * elastic_mm / float(plan.top.normal(*at_mm)[2])
        self.shear_mpa = contact.draft.modulus.value / 3.0
        self.x_mm, self.y_mm = grid_of(contact, at_mm)
        self.step_mm = float(self.x_mm[1] - self.x_mm[0])
        places = np.stack(np.meshgrid(self.x_mm, self.y_mm, indexing="ij"))
        self.sag_mm = plan.top.in_frame.sag_mm(*places)
        origin, axes = plan.top.press_frame(*at_mm)
        x, y, _ = np.einsum("kij,kc->cij", np.stack([*places, -self.sag_mm]), axes) + origin[:, None, None]
        self.wall_mm = np.where(np.isfinite(self.sag_mm), plan.outline.gap_mm(x, y), -np.inf)
        self.inside = self.wall_mm > 1e-9
        self.layer: PadLayer = pad_layer(plan, cavity.black_thickness_mm)
        self.wide = WideLayer(self.layer.thickness, (self.step_mm, self.step_mm), self.inside.shape)
        self.splines = self.layer.at(x[self.inside], y[self.inside])

    def moved(self, pressure: FloatArray) -> FloatArray:
        """Downward displacement (nx, ny) [mm] of the top under a pressure (nx, ny) [shear moduli]; 0 outside."""
        change = self.layer.coefficients @ (self.splines.T @ pressure[self.inside]) * self.step_mm**2
        found = np.zeros_like(pressure)
        found[self.inside] = self.wide.moved(pressure)[self.inside] + self.splines @ change
        return found

    def pressed(self, gap: FloatArray, depth_mm: float) -> FloatArray:
        """Pressure (nx, ny) [shear moduli] under an object whose gap (nx, ny) to the untouched top is given [mm]."""
        near = gap < 0.25 * depth_mm
        while True:
            window = tuple(slice(int(k.min()), int(k.max()) + 1) for k in np.nonzero(near))
            found = np.zeros_like(gap)
            found[window] = self._within(gap[window], window, SETTLED * depth_mm)
            beyond = (self.moved(found) + gap < -2.0 * SETTLED * depth_mm) & ~near
            beyond[window] = False
            if not beyond.any():
                return found
            near |= beyond

    def _within(self, gap: FloatArray, window: tuple[slice, ...], settled: float) -> FloatArray:
        inside = self.inside[window]
        number = np.cumsum(self.inside.ravel()).reshape(self.inside.shape)[window][inside] - 1
        splines, wide = self.splines[number], self.wide.within(gap.shape)

        def moved(pressure: FloatArray) -> FloatArray:
            change = self.layer.coefficients @ (splines.T @ pressure[inside]) * self.step_mm**2
            found = wide.moved(pressure)
            found[inside] += splines @ change
            return found

        return contact_pressure(moved, gap, settled, np.maximum(-gap, 0.0))[0]


def held_press(
    contact: Contact,
    at_mm: Place,
    bottoms: FloatArray,
    *,
    depth_mm: float | None = None,
    force_n: float | None = None,
) -> HeldPress:
    """Press rigid objects into a pad, to a depth or with a force.

    Parameters
    ----------
    at_mm : (x, y) of the press frame's origin in cavity coordinates
    bottoms : (nx, ny) height of the objects' lowest surface over each node of `grid_of` above their lowest point, along
        the frame's z [mm]; infinite where there is none
    depth_mm, force_n : how far the objects move from first touch, or the force that moves them; one of both

    Raises
    ------
    InputError : not exactly one of depth and force is given, or a value is not a number
    ModelScopeError : the press is outside the range of the model
    """
    if (depth_mm is None) == (force_n is None):
        raise InputError("depth_mm, force_n: give one of both")
    for name, value in (("depth_mm", depth_mm), ("force_n", force_n)):
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"{name}: {value} must be a finite number, 0 or more")
    if not contact.draft.plan.contains(*at_mm):
        raise InputError(f"at_mm: x = {at_mm[0]:g}, y = {at_mm[1]:g} mm must lie in the pad")
    pad = _Pad(contact, at_mm)
    if bottoms.shape != pad.inside.shape or np.isnan(bottoms).any():
        raise InputError(f"bottoms: give one height, or infinity, for each of {pad.inside.shape} nodes")
    gap = bottoms + np.nan_to_num(pad.sag_mm)
    if not np.isfinite(gap[pad.inside]).any():
        raise ModelScopeError("objects: none of them is over the pad; move them")
    gap = gap - _first_touch(gap, pad)
    if depth_mm is not None:
        return _at_depth(pad, at_mm, gap, depth_mm)
    assert force_n is not None
    return _at_force(pad, at_mm, gap, force_n)


def _first_touch(gap: FloatArray, pad: _Pad) -> float:
    """Height at which the objects first touch the untouched top [mm]."""
    inner = np.where(pad.inside, gap, np.inf)
    if not pad.sag_mm.any():
        return 0.0
    x, y = np.unravel_index(int(inner.argmin()), gap.shape)
    near = inner[max(x - 1, 0) : x + 2, max(y - 1, 0) : y + 2]
    lowest = float(inner[x, y])
    if near.shape != (3, 3) or not np.isfinite(near).all():
        return lowest
    for before, after in ((near[0, 1], near[2, 1]), (near[1, 0], near[1, 2])):
        bend = before - 2.0 * near[1, 1] + after
        if bend > 0.0:
            lowest -= (after - before) ** 2 / (8.0 * bend)
    return lowest


def _require_scope(pad: _Pad, gap: FloatArray, depth_mm: float) -> None:
    """Refuse a press that the model does not cover, before it is solved."""
    if depth_mm > pad.deepest_mm + 1e-9:
        raise ModelScopeError(
            f"depth_mm: {depth_mm:g} mm is deeper than the model of pressed objects covers: {pad.deepest_mm:.3g} mm, "
            f"{LARGEST_SHARE:g} of the elastic layer there; press less deep or make the pad thicker"
        )
    over = gap - depth_mm < -1e-9
    if (over & ~pad.inside).any():
        raise ModelScopeError(
            f"objects: at {depth_mm:.3g} mm they would touch the rim around the pad; press less deep, move them to "
            "the middle, or take smaller ones"
        )
    if not (over & pad.inside).any() and depth_mm > 0.0:
        raise ModelScopeError("objects: none of them touches the pad; press deeper or move them over the pad")


FORCE_ERROR = 1e-6
"""Accepted relative error of the depth of a press with a given force."""


def _at_force(pad: _Pad, at_mm: Place, gap: FloatArray, force_n: float) -> HeldPress:
    """The press with a force; its power 2/3, which is nearly linear in the depth, is interpolated."""
    deepest, refused = pad.deepest_mm, None
    for _ in range(12):
        try:
            strongest = _at_depth(pad, at_mm, gap, deepest)
            break
        except ModelScopeError as err:
            refused, deepest = err, 0.7 * deepest
    else:
        assert refused is not None
        raise refused
    if strongest.force_n < force_n:
        raise ModelScopeError(
            f"force_n: {force_n:g} N is more than the model covers with these objects: {strongest.force_n:.3g} N at "
            f"{deepest:.3g} mm{f' (deeper: {refused})' if refused else ''}; press with less force"
        )

    def missing(depth_mm: float) -> float:
        return (
            _at_depth(pad, at_mm, gap, depth_mm).force_n ** (2 / 3) - force_n ** (2 / 3)
            if depth_mm
            else -(force_n ** (2 / 3))
        )

    found = brentq(missing, 0.0, deepest, rtol=FORCE_ERROR, xtol=FORCE_ERROR * deepest)
    return _at_depth(pad, at_mm, gap, found)


def _at_depth(pad: _Pad, at_mm: Place, gap: FloatArray, depth_mm: float) -> HeldPress:
    overlap = np.where(pad.inside, gap - depth_mm, np.inf)
    if depth_mm == 0.0:
        zero = np.zeros_like(gap)
        top = GridTop(at_mm=at_mm, x_mm=pad.x_mm, y_mm=pad.y_mm, height_mm=zero, level=zero - pad.step_mm)
        return HeldPress(top=top, pressure_mpa=zero, force_n=0.0, area_mm2=0.0, depth_mm=depth_mm)
    _require_scope(pad, gap, depth_mm)
    pressure = pad.pressed(overlap, depth_mm)
    moved = pad.moved(pressure)
    touching = pressure > 0.0
    nearest = float(pad.wall_mm[touching].min())
    if nearest < NEAREST * pad.layer.thickness:
        raise ModelScopeError(
            f"objects: at {depth_mm:.3g} mm their contact comes within {nearest:.2g} mm of a wall; the model covers "
            f"{NEAREST * pad.layer.thickness:.2g} mm and more; press less deep, or move them to the middle"
        )
    height = np.where(touching, overlap, -moved)
    level = edge_level(pressure, np.where(touching, 0.0, moved + overlap), pad.step_mm)
    cell = pad.step_mm**2
    return HeldPress(
        top=GridTop(at_mm=at_mm, x_mm=pad.x_mm, y_mm=pad.y_mm, height_mm=height, level=level),
        pressure_mpa=pad.shear_mpa * pressure,
        force_n=float(pad.shear_mpa * pressure.sum() * cell),
        area_mm2=float(_area(level, pad.step_mm)),
        depth_mm=depth_mm,
    )


def edge_level(pressure: FloatArray, gap: FloatArray, step: float) -> FloatArray:
    """Distance (nx, ny) of nodes from the edge of the contact, positive inside, limited to the grid's step [mm].

    Parameters
    ----------
    pressure : (nx, ny) pressure over shear modulus [-]
    gap : (nx, ny) gap outside the contact [mm]
    step : distance of the nodes [mm]
    """
    touching = pressure > 0.0
    inner, outer = pressure**2, np.where(touching, 0.0, 3.0 * np.clip(gap, 1e-12, step)) ** (2.0 / 3.0)
    total, count = np.zeros_like(pressure), np.zeros_like(pressure)
    for axis in range(2):
        low, high = [slice(None)] * 2, [slice(None)] * 2
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        one, other = tuple(low), tuple(high)
        pair = touching[one] != touching[other]
        a, c = np.where(pair, inner[one] + inner[other], 1.0), np.where(pair, outer[one] + outer[other], 1.0)
        z = np.minimum(np.cbrt(step / a), step / c)
        for _ in range(20):
            z = z - (a * z**3 + c * z - step) / (3.0 * a * z**2 + c)
        for side in (one, other):
            total[side] += np.where(pair, np.log(z), 0.0)
            count[side] += pair
    near = uniform_filter(count, 3)
    z = np.exp(np.divide(uniform_filter(total, 3), near, out=np.zeros_like(near), where=near > 1e-9))
    far = near <= 1e-9
    level = np.where(touching, inner * z**3, -outer * z)
    level[far] = np.where(touching[far], step, -step)
    return np.clip(level, -step, step)


def _area(level: FloatArray, step: float) -> float:
    """Area where a level is above 0; linear between the nodes, in four parts of each cell [mm²]."""
    fine = 4
    share = (np.arange(fine) + 0.5) / fine
    total = 0.0
    for u in share:
        for v in share:
            part = (1 - u) * ((1 - v) * level[:-1, :-1] + v * level[:-1, 1:]) + u * (
                (1 - v) * level[1:, :-1] + v * level[1:, 1:]
            )
            total += float((part > 0.0).sum())
    return total * (step / fine) ** 2
