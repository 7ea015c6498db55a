r"""A press of rigid objects of any form into a pad: its top, pressure and force.

The object is given by the height of its lowest surface over each node of a grid, in the press frame. It is rigid and
without friction. The pad is an incompressible, linear elastic layer between its own walls (`layer`), E its Young's
modulus, so its shear modulus is E/3. The heights of the object are exact, not those of a parabola.

Finite strains
--------------
Forces and pressures of the linear layer are divided by a factor for each separate area of contact. With the depth d of
the object there, the largest distance a of its points from its edge, the layer's thickness h, and its roundness λ (the
ratio of its principal radii of gyration: 1 for a disc, 0 for a long strip), the factor is

    1 + λ (0.075 d/a + 0.042 (d/a)²) - (1 - λ) 0.3 d/h.

The first part is fitted to solved balls in layers of 1.5 to 4.5 radii, in the middle and near corners (within 2 % up to
d = a). The second part is fitted to long cylinders of 2 and 5 mm and a punch in plane strain (within 2.2 % up to 2 mm
in 9 mm, for walls 32 mm apart; 0.3 is also that for 160 mm). In between, it is an assumption: for a cylinder of 3 mm,
8 mm long and 1 mm deep, the force is 2.7 % too high.

The top outside is not corrected. It is too low next to the contact: beside balls and the sides of cylinders by at most
2 % of a depth of 0.1 h, and 5 % at 0.3 h; beyond the ends of a short cylinder and of a box's edge by 3 and 5 % at 0.1
h. Contacts are 2 % narrower at 0.1 h and 4 % at 0.3 h than with finite strains. Nothing is computed deeper than a third
of the layer, nor deeper than a sixth if the contact ends at a sharp edge or a steep side.

The edge of the contact
-----------------------
Where a smooth object leaves the top, at a distance s inside or outside the edge,

    p = A √s,      gap = A s^(3/2) / (3 μ)

(the edge of Hertz's contact in plane strain, ν = 1/2; Johnson, Contact Mechanics, 1985, section 4.2). The level of a
node is this s, positive inside and negative outside; A is found from neighbours on both sides of the edge, whose
distances from the edge add up to the part of the grid's step that is normal to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, label, map_coordinates, uniform_filter
from scipy.optimize import brentq
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.touch import LARGEST_HELD_SHARE, NEAREST_HELD
from optopad.design.shape.cavity import Plan
from optopad.sims.contact.held.layer import LEAST_NORMAL, PadLayer, WideLayer, pad_layer
from optopad.sims.contact.held.solve import contact_pressure
from optopad.sims.contact.scope import Contact, Place
from optopad.sims.press import GridTop

MOST_STEPS = 360
FORGIVEN = 1e-4
"""Overlap over the depth [-] outside the part of the grid that is solved, from which on this part is enlarged."""
UNSEEN = 0.1
"""Height over the grid's step within which an object that touches between the nodes is not missed [-]."""
BORDER = 256
"""Pieces of each wall at whose ends the splines' error is known."""
REACH = 0.25
"""Nodes with a gap below this share of the depth are solved first; others join if they touch."""
FADING = 0.1
"""Length over the thickness over which the error of the splines at the walls is taken back [-]."""


class Fineness(NamedTuple):
    """How finely a press is solved.

    Attributes
    ----------
    step_mm : largest distance of the grid's nodes, on pads that need at most `MOST_STEPS` of them along a side
    settled : largest accepted gap or overlap in the contact, over the depth [-]
    """

    step_mm: float
    settled: float


FINE = Fineness(step_mm=0.16, settled=1e-6)
COARSE = Fineness(step_mm=0.32, settled=3e-4)
"""A third of the time, for maps of many presses."""

Window = tuple[slice, slice]


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
    shear_mm : how far the objects moved sideways after the press, along the frame's x and y
        (`optopad.sims.held` gives it along the cavity's)
    pull_n : sideways force of the objects on the pad, as `shear_mm`
    slip_share : share of the contact's area that slips [-]
    holds_n : largest sideways force before all of the contact slips; 0 for a press without a sideways motion
    """

    top: GridTop
    pressure_mpa: FloatArray
    force_n: float
    area_mm2: float
    depth_mm: float
    notes: tuple[str, ...] = ()
    shear_mm: tuple[float, float] = (0.0, 0.0)
    pull_n: tuple[float, float] = (0.0, 0.0)
    slip_share: float = 0.0
    holds_n: float = 0.0


def grid_of(contact: Contact, at_mm: Place, fineness: Fineness = FINE) -> tuple[FloatArray, FloatArray]:
    """Equally spaced nodes x (nx,) and y (ny,) of a grid that covers the pad, in the press frame at a location [mm]."""
    x, y = _border(contact.draft.plan, at_mm)[1].T
    spans = [(float(one.min()), float(one.max())) for one in (x, y)]
    longest = max(high - low for low, high in spans)
    step = longest / min(math.ceil(longest / fineness.step_mm), MOST_STEPS)
    counts = [math.ceil((high - low) / step - 1e-6) for low, high in spans]
    first, second = (
        np.asarray((low + high) / 2 + step * (np.arange(count + 1) - count / 2), np.float64)
        for (low, high), count in zip(spans, counts, strict=True)
    )
    return first, second


def _border(plan: Plan, at_mm: Place) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) of the pad's border in cavity coordinates, and in the press frame at a location [mm]."""
    share = np.linspace(0.0, 1.0, BORDER + 1)
    border = np.concatenate([one.points(share) for one in plan.outline.loop])
    origin, axes = plan.top.press_frame(*at_mm)
    return border, ((np.column_stack([border, plan.top.height_mm(*border.T)]) - origin) @ axes.T)[:, :2]


class Pad:
    """A pad's top on the grid of the press frame at a location."""

    def __init__(self, contact: Contact, at_mm: Place, fineness: Fineness = FINE) -> None:
        plan, self._settled = contact.draft.plan, fineness.settled
        cavity = contact.design.cavity
        elastic_mm = cavity.elastic_mm - float(plan.top.sag_mm(*at_mm))
        self.thickness_mm = elastic_mm / float(plan.top.normal(*at_mm)[2])
        self.deepest_mm = LARGEST_HELD_SHARE * self.thickness_mm
        self.shear_mpa = contact.draft.modulus.value / 3.0
        self.x_mm, self.y_mm = grid_of(contact, at_mm, fineness)
        self.step_mm = float(self.x_mm[1] - self.x_mm[0])
        places = np.stack(np.meshgrid(self.x_mm, self.y_mm, indexing="ij"))
        self.sag_mm = plan.top.in_frame.sag_mm(*places)
        origin, axes = plan.top.press_frame(*at_mm)
        normal = plan.top.in_frame.normal(*places)[..., 2]
        x, y, _ = np.einsum("kij,kc->cij", np.stack([*places, -self.sag_mm]), axes) + origin[:, None, None]
        self.wall_mm = np.where(np.isfinite(self.sag_mm), plan.outline.gap_mm(x, y), -np.inf)
        self.inside = self.wall_mm > -1e-9
        self.slope = np.maximum(normal, LEAST_NORMAL)
        self._plan, self._black_mm, self.at_mm = plan, cavity.black_thickness_mm, at_mm
        self._in_cavity, self._nodes = (x, y), places

    def sag_at(self, moved: FloatArray, part: Window) -> FloatArray:
        """Sag (nx, ny) of a part of the untouched top where its points moved sideways (2, nx, ny) [mm]."""
        x, y = self._nodes[:, *part] + moved
        return np.nan_to_num(self._plan.top.in_frame.sag_mm(x, y))

    @cached_property
    def layer(self) -> PadLayer:
        """What the pad changes of a wide layer; it takes seconds."""
        return pad_layer(self._plan, self._black_mm)

    @cached_property
    def wide(self) -> WideLayer:
        """The wide layer on the pad's grid."""
        return WideLayer(self.layer.thickness, (self.step_mm, self.step_mm), (len(self.x_mm), len(self.y_mm)))

    @cached_property
    def splines(self) -> csr_matrix:
        """Values (node inside, spline) of the layer's splines."""
        return self.layer.at(*(one[self.inside] for one in self._in_cavity))

    @cached_property
    def _walls(self) -> tuple[FloatArray, csr_matrix, csr_matrix]:
        """Points of the border as places (2, n) in the grid, their splines, and the matrix of `_faded`."""
        border, in_frame = _border(self._plan, self.at_mm)
        places = (in_frame - (self.x_mm[0], self.y_mm[0])).T / self.step_mm
        nodes = np.stack([one[self.inside] for one in self._nodes], axis=1)
        return places, self.layer.at(*border.T), self._faded(in_frame, nodes)

    def _faded(self, border: FloatArray, nodes: FloatArray) -> csr_matrix:
        """Matrix (node, point of the border) that continues errors at the walls into the pad, where they fade out.

        An error falls with the distance s from a wall as (1 - s/l) exp(-s/l), whose integral is 0: the volume stays.
        """
        walls = np.split(border, len(border) // (BORDER + 1))
        away, nearest = zip(*(cKDTree(wall).query(nodes) for wall in walls), strict=True)
        share = np.stack(away, axis=1) / (FADING * self.layer.thickness)
        weight = 1.0 / (share**2 + 1e-9)
        values = weight / weight.sum(axis=1, keepdims=True) * (1.0 - share) * np.exp(-share)
        columns = np.stack(nearest, axis=1) + (BORDER + 1) * np.arange(len(walls))
        pointer = len(walls) * np.arange(len(nodes) + 1)
        return csr_matrix((values.ravel(), columns.ravel(), pointer), shape=(len(nodes), len(border)))

    def moved(self, load: FloatArray) -> FloatArray:
        """Displacement of the top [mm]; 0 at the walls and outside.

        Parameters
        ----------
        load : (nx, ny) pressure, or (3, nx, ny) loads along the frame's x and y and pressure, times the top's area over
            the grid's [shear moduli]

        Returns
        -------
        displacement of the shape of `load`, that by pressure downward along the top's normal
        """
        steep = self.slope**0.25
        wide = steep * (self.wide.moved if load.ndim == 2 else self.wide.moved_by)(steep * load)
        change = self._changed((self.splines.T @ load[..., self.inside].T).T)
        places, splines, faded = self._walls
        found = np.zeros_like(load)
        for k in np.ndindex(load.shape[:-2]):  # one empty index, or that of each component
            left = map_coordinates(wide[k], places, order=1, mode="nearest") + splines @ change[k]
            found[k][self.inside] = wide[k][self.inside] + self.splines @ change[k] - faded @ left
        return found

    def _changed(self, shares: FloatArray) -> FloatArray:
        """Factors (..., spline) of the splines that change a wide layer's motion, from the loads on them."""
        if shares.ndim == 1:
            return np.asarray(self.layer.coefficients @ shares) * self.step_mm**2
        found = self.sideways.coefficients @ (self._turn @ shares).ravel()
        return np.asarray(self._turn.T @ found.reshape(shares.shape)) * self.step_mm**2

    @cached_property
    def sideways(self) -> PadLayer:
        """`layer` with loads and motions along x and y of the cavity; it takes seconds."""
        return pad_layer(self._plan, self._black_mm, sideways=True)

    @cached_property
    def _turn(self) -> FloatArray:
        """Rotation (3, 3) of components in the press frame to those in the cavity, about the top's normal."""
        angle = math.radians(self._plan.top.frame_turn_deg)
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def response(self, window: Window, sideways: bool = False) -> Callable[[FloatArray], FloatArray]:
        """The function from loads to displacements in a part of the grid; without what is taken back at the walls."""
        inside, steep = self.inside[window], self.slope[window] ** 0.25
        number = np.cumsum(self.inside).reshape(self.inside.shape)[window][inside] - 1
        splines, wide = self.splines[number], self.wide.within((inside.shape[0], inside.shape[1]), sideways)
        spread = splines.T.tocsr()

        def moved(load: FloatArray) -> FloatArray:
            found = steep * (wide.moved if load.ndim == 2 else wide.moved_by)(steep * load)
            found[..., inside] += (splines @ self._changed((spread @ load[..., inside].T).T).T).T
            return found

        return moved

    def pressed(self, gap: FloatArray, depth_mm: float) -> tuple[FloatArray, FloatArray]:
        """Load and displacement (nx, ny), as of `moved`, under an object.

        Parameters
        ----------
        gap : (nx, ny) gap between the object and the untouched top, along its normal [mm]
        depth_mm : depth of the press; it sets the accuracy
        """
        near, settled = gap < REACH * depth_mm, self._settled * depth_mm
        while True:
            x, y = (slice(int(k.min()), int(k.max()) + 1) for k in np.nonzero(near))
            load, start = np.zeros_like(gap), np.maximum(-gap[x, y], 0.0)
            load[x, y], _ = contact_pressure(self.response((x, y)), gap[x, y], settled, start)
            moved = self.moved(load)
            beyond = moved + gap < -FORGIVEN * depth_mm
            beyond[x, y] = False
            if not beyond.any():
                return load, moved
            near |= beyond


@lru_cache(maxsize=4)
def pad_at(contact: Contact, at_mm: Place, fineness: Fineness) -> Pad:
    """The pad in the press frame at a location; the last ones are kept."""
    return Pad(contact, at_mm, fineness)


def held_press(
    contact: Contact,
    at_mm: Place,
    bottoms: FloatArray,
    *,
    depth_mm: float | None = None,
    force_n: float | None = None,
    fineness: Fineness = FINE,
) -> HeldPress:
    """Press rigid objects into a pad, to a depth or with a force.

    Parameters
    ----------
    at_mm : (x, y) of the press frame's origin in cavity coordinates
    bottoms : (nx, ny) height of the objects' lowest surface over each node of `grid_of` above their lowest point, along
        the frame's z [mm]; infinite where there is none
    depth_mm, force_n : how far the objects move from first touch, or the force that moves them; one of both
    fineness : of the grid and the solution

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
    pad, gap = touched(contact, at_mm, bottoms, fineness)
    if depth_mm is not None:
        return at_depth(pad, gap, depth_mm)
    assert force_n is not None
    return _at_force(pad, gap, force_n)


def touched(
    contact: Contact, at_mm: Place, bottoms: FloatArray, fineness: Fineness = FINE
) -> tuple[Pad, FloatArray]:
    """A pad, and the gap (nx, ny) along the frame's z between its untouched top and objects at first touch [mm].

    Raises
    ------
    InputError : the heights do not fit the grid
    ModelScopeError : no object is over the pad
    """
    if not contact.draft.plan.contains(*at_mm):
        raise InputError(f"at_mm: x = {at_mm[0]:g}, y = {at_mm[1]:g} mm must lie in the pad")
    pad = pad_at(contact, at_mm, fineness)
    if bottoms.shape != pad.inside.shape or np.isnan(bottoms).any():
        raise InputError(f"bottoms: give one height, or infinity, for each of {pad.inside.shape} nodes")
    gap = bottoms + np.nan_to_num(pad.sag_mm, nan=float(np.nanmax(pad.sag_mm)))
    if not np.isfinite(gap[pad.wall_mm > 1e-9]).any():
        raise ModelScopeError("objects: none of them is over the pad; move them")
    return pad, gap - _first_touch(gap, pad)


def _first_touch(gap: FloatArray, pad: Pad) -> float:
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


def require_scope(pad: Pad, gap: FloatArray, depth_mm: float) -> None:
    """Refuse a press that the model does not cover, before it is solved."""
    if depth_mm == 0.0:
        return
    if depth_mm > pad.deepest_mm + 1e-9:
        raise ModelScopeError(
            f"depth: {depth_mm:g} mm is deeper than the model of pressed objects covers: {pad.deepest_mm:.3g} mm, "
            f"{LARGEST_HELD_SHARE:.0%} of the elastic layer there; press less deep or make the pad thicker"
        )
    over = gap - depth_mm < -1e-9
    if (over & (pad.wall_mm <= 1e-9)).any():
        raise ModelScopeError(
            f"objects: at {depth_mm:.3g} mm they would touch the rim around the pad; press less deep, move them to "
            "the middle, or take smaller ones"
        )
    if gap.min() > depth_mm + UNSEEN * pad.step_mm:
        raise ModelScopeError("objects: none of them touches the pad; press deeper or move them over the pad")


DEPTH_ERROR, SHALLOWEST = 1e-6, 1e-3
"""Accepted relative error of the depth of a press with a given force, and of the deepest depth that is covered."""


def _at_force(pad: Pad, gap: FloatArray, force_n: float) -> HeldPress:
    """The press with a force; its power 2/3, which is nearly linear in the depth, is interpolated."""
    if force_n == 0.0:
        return at_depth(pad, gap, 0.0)
    strongest, step, refused = at_depth(pad, gap, 0.0), pad.deepest_mm, None
    while strongest.force_n < force_n and step > SHALLOWEST * pad.deepest_mm:
        try:
            strongest = at_depth(pad, gap, min(strongest.depth_mm + step, pad.deepest_mm))
        except ModelScopeError as err:
            refused = err
        step = 0.5 * step
    deepest = strongest.depth_mm
    if strongest.depth_mm == 0.0 and refused:
        raise refused
    if strongest.force_n < force_n:
        raise ModelScopeError(
            f"force: {force_n:g} N is more than the model covers with these objects: {strongest.force_n:.3g} N at "
            f"{deepest:.3g} mm{f' (deeper: {refused})' if refused else ''}; press with less force"
        )

    def excess_n(depth_mm: float) -> float:
        return float(at_depth(pad, gap, depth_mm).force_n ** (2 / 3) - force_n ** (2 / 3))

    found = brentq(excess_n, 0.0, deepest, rtol=DEPTH_ERROR, xtol=DEPTH_ERROR * deepest)
    return at_depth(pad, gap, found)


def at_depth(pad: Pad, gap: FloatArray, depth_mm: float) -> HeldPress:
    """The press to a depth, with the gap (nx, ny) at first touch as of `touched`."""
    require_scope(pad, gap, depth_mm)
    if depth_mm == 0.0 or gap.min() >= depth_mm:  # or between the nodes
        zero = np.zeros_like(gap)
        top = GridTop(at_mm=pad.at_mm, x_mm=pad.x_mm, y_mm=pad.y_mm, height_mm=zero, level=zero - pad.step_mm)
        return HeldPress(top=top, pressure_mpa=zero, force_n=0.0, area_mm2=0.0, depth_mm=depth_mm)
    overlap = np.where(pad.wall_mm > 1e-9, gap - depth_mm, np.inf)
    return settled(pad, overlap, *pad.pressed(pad.slope * overlap, depth_mm), depth_mm)


def settled(
    pad: Pad,
    overlap: FloatArray,
    load: FloatArray,
    moved: FloatArray,
    depth_mm: float,
    *,
    is_sharp_allowed: bool = False,
) -> HeldPress:
    """A press with its load and downward motion (nx, ny), and the objects' height over the untouched top (nx, ny).

    is_sharp_allowed : whether deep presses may end at a sharp edge or steep side; the top is less accurate there
    """
    touching = load > 0.0
    nearest = float(pad.wall_mm[touching].min())
    if nearest < NEAREST_HELD * pad.layer.thickness:
        raise ModelScopeError(
            f"objects: at {depth_mm:.3g} mm their contact comes within {nearest:.2g} mm of a wall; the model covers "
            f"{NEAREST_HELD * pad.layer.thickness:.2g} mm and more; press less deep, or move them to the middle"
        )
    moved = moved / pad.slope
    height = np.where(touching, overlap, -moved)
    pressure = load * pad.slope
    gap_mm = np.where(touching, 0.0, moved + overlap)
    level = edge_level(pressure, gap_mm, pad.step_mm)
    pressure *= pad.shear_mpa / excess(overlap, level, pad.step_mm, pad.thickness_mm)
    cell, area = pad.step_mm**2, _area(level, pad.step_mm)
    return HeldPress(
        top=GridTop(at_mm=pad.at_mm, x_mm=pad.x_mm, y_mm=pad.y_mm, height_mm=height, level=level),
        pressure_mpa=pressure,
        force_n=float(pressure.sum() * cell),
        area_mm2=area,
        depth_mm=depth_mm,
        notes=_notes(pad, gap_mm, touching, area, 0.0 if is_sharp_allowed else depth_mm),
    )


FEW_NODES = 9
"""Nodes in contact below which force and area are less accurate."""
SHARP_SHARE = 1.0 / 6.0
"""Deepest press with a contact that ends at a sharp edge, over the layer's thickness [-]."""


def _notes(
    pad: Pad, gap: FloatArray, touching: BoolArray, area_mm2: float, depth_mm: float
) -> tuple[str, ...]:
    """Notes on a contact, with the gap (nx, ny) between object and top [mm]; refuses one that is not covered."""
    notes, nodes = [], int(touching.sum())
    if nodes < FEW_NODES:
        notes.append(
            f"contact: it covers {area_mm2:.2g} mm², {nodes} nodes of a grid of {pad.step_mm:.2g} mm: force is "
            "within 20 %, area within a half"
        )
    around = binary_dilation(touching) & ~touching & pad.inside
    deepest_mm = SHARP_SHARE * pad.thickness_mm
    if depth_mm > deepest_mm + 1e-9 and (gap[around] > pad.step_mm).any():
        raise ModelScopeError(
            f"objects: at {depth_mm:.3g} mm the contact ends at a sharp edge or steep side; around it the top is then "
            f"off by more than 5 % of the depth, and the model covers {deepest_mm:.3g} mm; press less deep, or take an "
            "object with rounder edges"
        )
    return tuple(notes)


SOFTER = 0.075, 0.042
"""Coefficients of d/a and its square in the excess of force under round contacts [-]; see the module."""
STIFFER = 0.3
"""Coefficient of d/h in the missing force under long contacts [-]; see the module."""


def excess(overlap: FloatArray, level: FloatArray, step: float, thickness: float) -> FloatArray:
    """Force of the linear layer over that with finite strains (nx, ny), the same over each area of contact [-].

    Parameters
    ----------
    overlap : (nx, ny) object's height over the untouched top, negative where it overlaps [mm]
    level : (nx, ny) distance from the contact's edge near it [mm]
    step, thickness : distance of the nodes, thickness of the layer [mm]
    """
    factor, around = np.ones_like(level), _around(level > 0.0)
    overlap, level, found = overlap[around], level[around], factor[around]
    number, count = label(level > 0.0, structure=np.ones((3, 3)))
    away, nearest = distance_transform_edt(number > 0, sampling=step, return_indices=True)
    away += level[tuple(nearest)]
    for one in range(1, count + 1):
        area = number == one
        depth = -float(overlap[area].min())
        spread = np.linalg.eigvalsh(np.cov(np.nonzero(area), bias=True) + np.eye(2) / 12.0)
        roundness, strain = (
            math.sqrt(spread[0] / spread[1]),
            depth / max(float(away[area].max()), UNSEEN * step),
        )
        softer = SOFTER[0] * strain + SOFTER[1] * strain**2
        found[area] += roundness * softer - (1.0 - roundness) * STIFFER * depth / thickness
    return factor


EDGE_ROUNDS, NEWTON_ROUNDS = 3, 20


def edge_level(pressure: FloatArray, gap: FloatArray, step: float) -> FloatArray:
    """Distance (nx, ny) of nodes from the edge of the contact, positive inside, limited to the grid's step [mm].

    Parameters
    ----------
    pressure : (nx, ny) pressure over shear modulus [-]
    gap : (nx, ny) gap outside the contact [mm]
    step : distance of the nodes [mm]
    """
    whole, around = np.where(pressure > 0.0, step, -step), _around(pressure > 0.0)
    pressure, gap = pressure[around], gap[around]
    touching = pressure > 0.0
    inner, outer = pressure**2, np.where(touching, 0.0, 3.0 * np.clip(gap, 1e-12, step)) ** (2.0 / 3.0)
    level = np.where(touching, step, -step)
    for _ in range(EDGE_ROUNDS):
        slope = np.stack(np.gradient(uniform_filter(level, 3)))
        slope = np.abs(slope / np.maximum(np.hypot(*slope), 1e-12))
        total, weight = np.zeros_like(pressure), np.zeros_like(pressure)
        for axis in range(2):
            one, other = (_shifted(axis, *ends) for ends in ((None, -1), (1, None)))
            pair = touching[one] != touching[other]
            facing = np.where(pair, np.maximum(0.5 * (slope[axis][one] + slope[axis][other]), 0.1), 0.0)
            a, c = np.where(pair, [inner[one] + inner[other], outer[one] + outer[other]], 1.0)
            z = np.minimum(np.cbrt(facing * step / a), facing * step / c)
            for _ in range(NEWTON_ROUNDS):
                z -= (a * z**3 + c * z - facing * step) / (3.0 * a * z**2 + c)
            for side in (one, other):
                total[side] += facing * np.log(np.where(pair, z, 1.0))
                weight[side] += facing
        near = uniform_filter(weight, 3)
        is_near = near > 1e-9
        z = np.exp(uniform_filter(total, 3)[is_near] / near[is_near])
        found = np.where(touching[is_near], inner[is_near] * z**3, -outer[is_near] * z)
        level = np.where(touching, step, -step)
        level[is_near] = np.clip(found, -step, step)
    whole[around] = level
    return whole


def _around(touching: BoolArray) -> Window:
    """The part of the grid with all contact, and some nodes around it."""
    x, y = (slice(max(int(k.min()) - 4, 0), int(k.max()) + 5) for k in np.nonzero(touching))
    return x, y


def _shifted(axis: int, start: int | None, stop: int | None) -> Window:
    return (slice(start, stop), slice(None)) if axis == 0 else (slice(None), slice(start, stop))


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
