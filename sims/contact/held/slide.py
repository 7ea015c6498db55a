r"""A sideways motion of objects that were pressed into a pad: stick, partial slip and slip.

The objects are pressed without friction (`press`). Then they move sideways at a constant depth. The load t along the
top and the pressure p move it sideways by u and downward by w, by the linear response of the pad (`layer`). With the
sideways motion s of the objects and the friction f (Coulomb):

    |t| ≤ f p,      where |t| < f p:   du = ds                    the top sticks to the objects
                    where |t| = f p:   ds - du = λ t,  λ ≥ 0      the objects slip over it

For a step ds this is the minimum of ½ <t, G t> - <t, ds - du⁰> over all |t| ≤ f p, with du⁰ the motion by the step's
change of pressure (Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990, chapter 4). It is found by
spectral projected gradients (Birgin, Martínez and Raydan, SIAM J. Optim. 10 (2000), 1196-1211), in turn with the
pressure, which the sideways load changes (`layer`).

The nodes are points of the material. A point that was at X is at X + u, under the part of the objects' lowest surface b
that was at X + u - s before the motion: the gap there is b(X + u - s) + w - depth. So a top that sticks keeps its
contact, and one that slips passes through it. For the light model, the deformed top is drawn over the places X + u.

Finite strains
--------------
The pad is softer under pressure (`press`): the limit is f times the corrected pressure. Sideways it is stiffer, since
the objects have pressed into it: their flank pushes the raised top ahead, so pressure pulls, too. At the depth d in a
layer of thickness h, the whole sideways load is h / (h - d) times t, that of the linear layer, as if only the layer
under the objects were sheared. This is not fitted. Finite elements with finite strains have 1.15 and 1.31 times t under
a long cylinder of 5 mm, 1 and 2 mm deep in 9 mm, where the factor is 1.13 and 1.29. In full slip, too, friction is f
times the force there, and the pull 1.15 times that at 1 mm. Far from the contact, the top answers to the whole load; in
the contact and next to it, it moves with the objects. In between, the answer is interpolated by the sideways motion.

Left out: friction during the press itself; that friction of silicone depends on speed, time and pressure; adhesion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import binary_dilation, map_coordinates, spline_filter

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.held_object import LARGEST_FRICTION
from optopad.design.rules.touch import LARGEST_HELD_SHARE
from optopad.sims.contact.held.press import (
    FINE,
    FORGIVEN,
    REACH,
    HeldPress,
    Pad,
    require_scope,
    settled,
    touched,
)
from optopad.sims.contact.held.solve import NotSettledError, contact_pressure
from optopad.sims.contact.scope import Contact, Place
from optopad.sims.press import GridTop

STEP_MM = 0.1
"""Longest step of a sideways motion; a point meets the objects' surface as it is at the end of a step."""
ROUNDS, ROUND_ERROR, EASED = 30, 1e-3, 2.0
"""Most rounds of pressure and sideways load, and accepted change of the pressures in a round, over their sum,
and factor of the part of a round that is taken, which falls with its number: points at the edge may change sides."""
SIDEWAYS_ERROR = 1e-3
"""Accepted sideways error of the top where it sticks, over the step [-]."""
PLACE_ROUNDS, PLACE_ERROR_MM = 100, 1e-3
"""Most rounds in which the points that are now at the nodes are found, and accepted error of their places [mm]."""
MOST_STEPS = 2000
PULL_ERROR, LEAST_PULL = 0.001, 0.01
"""Accepted error of a sideways force, over the force, or over this share of the largest one if that is more [-]."""
PILOT_MM, CAREFUL, MOST_PULLS = 0.005, 0.8, 60
"""First motion of a pull [mm], share of each later one that its stiffness asks for, and the most of them: a pull grows,
and only at its end it may go back by its error."""
CEILING = 0.1
"""Height of the objects' surface above the pressed depth from which on its form does not matter [thicknesses]."""


def slid(
    contact: Contact,
    at_mm: Place,
    bottoms: FloatArray,
    *,
    depth_mm: float,
    friction: float,
    path_mm: FloatArray,
) -> list[HeldPress]:
    """Press rigid objects into a pad, then move them sideways along a path, at constant depth.

    Parameters
    ----------
    at_mm, bottoms, depth_mm : as of `optopad.sims.contact.held.press.held_press`
    friction : Coulomb's coefficient [-]
    path_mm : (n, 2) positions of the objects along the frame's x and y, from where they were pressed

    Returns
    -------
    the press at each point of the path

    Raises
    ------
    InputError : friction or path are invalid, or the objects do not touch
    ModelScopeError : the press is outside the range of the model, there or on its way
    """
    path = np.asarray(path_mm, np.float64).reshape(-1, 2)
    if not np.isfinite(path).all():
        raise InputError("shear: needs two finite numbers of millimetres")
    slide = _begun(contact, at_mm, bottoms, depth_mm, friction)
    for end in path:
        slide.require(end)
    found = []
    for start, end in pairwise(np.concatenate([np.zeros((1, 2)), path])):
        count = math.ceil(float(np.hypot(*(end - start))) / STEP_MM - 1e-9)
        for share in np.arange(1, count + 1) / max(count, 1):
            slide.advance(start + share * (end - start))
        found.append(slide.press())
    return found


def pulled(
    contact: Contact,
    at_mm: Place,
    bottoms: FloatArray,
    *,
    depth_mm: float,
    friction: float,
    pull_n: tuple[float, float],
) -> HeldPress:
    """Press rigid objects into a pad, then pull them sideways with a force that grows to `pull_n` along x and y [N].

    Other parameters and errors are those of `slid`.

    Raises
    ------
    ModelScopeError : the pad does not hold the objects.
    """
    if not np.isfinite(pull_n).all():
        raise InputError("pull: needs two finite numbers of newtons")
    slide, wanted = _begun(contact, at_mm, bottoms, depth_mm, friction), np.asarray(pull_n, np.float64)
    size, holds, now = float(np.hypot(*wanted)), slide.press().holds_n, np.zeros(2)
    if size >= holds > 0.0 or size > holds:
        raise ModelScopeError(
            f"pull: {size:.3g} N is more than the pad holds: at most {holds:.3g} N with a friction of {friction:g}; "
            "the objects would slide: pull less, press harder, or give --shear instead"
        )
    step = PILOT_MM * wanted / max(size, 1e-12)
    for _ in range(MOST_PULLS):
        left = float(np.hypot(*(wanted - now)))
        if left <= PULL_ERROR * max(size, LEAST_PULL * holds):
            return slide.press()
        slide.advance(slide.at + step)
        before, now = now, slide.pull_n
        stiffness = float((now - before) @ step) / float(step @ step)
        step = (wanted - now) / max(stiffness, 1e-9)
        step *= min(CAREFUL if left > 0.1 * size else 1.0, STEP_MM / max(float(np.hypot(*step)), 1e-12))
    raise NotSettledError(
        f"pull: {size:.3g} N was not reached; it is close to the {holds:.3g} N that the pad holds, or very small: pull "
        "less or more, or give --shear instead"
    )


def _begun(contact: Contact, at_mm: Place, bottoms: FloatArray, depth_mm: float, friction: float) -> Slide:
    if not 0.0 <= friction <= LARGEST_FRICTION:
        raise InputError(f"friction: {friction:g} is refused: give 0 to {LARGEST_FRICTION:g}")
    return Slide(*touched(contact, at_mm, bottoms), depth_mm, friction)


Part = tuple[slice, slice]
WHOLE: Part = slice(None), slice(None)


class Slide:
    """Objects in a pad on their way sideways."""

    def __init__(self, pad: Pad, gap: FloatArray, depth_mm: float, friction: float) -> None:
        """Press them, given the gap (nx, ny) at first touch."""
        self.pad, self.depth_mm, self.friction = pad, depth_mm, friction
        self._stiffness = pad.thickness_mm / (pad.thickness_mm - depth_mm)
        require_scope(pad, gap, depth_mm)
        if gap.min() >= depth_mm:
            raise InputError(
                f"shear: at {depth_mm:g} mm the objects do not touch the pad, so nothing holds them; press deeper"
            )
        self.at = np.zeros(2)
        overlap = np.where(pad.wall_mm > 1e-9, gap - depth_mm, np.inf)
        load, moved = pad.pressed(pad.slope * overlap, depth_mm)
        start = settled(pad, overlap, load, moved, depth_mm)
        self._start = replace(start, holds_n=self._holds_n(start.force_n))
        pressure = start.pressure_mpa / pad.shear_mpa
        self._softness = float(pressure.sum() / (load * pad.slope).sum())
        none = np.zeros((2, *load.shape))
        self.load, self.moved = np.concatenate([none, load[None]]), np.concatenate([none, moved[None]])
        self._pressed, self._linear = load, none
        self.is_slipping = np.zeros(load.shape, np.bool_)
        bottom = gap - np.nan_to_num(pad.sag_mm)
        ceiling = float(bottom.min()) + depth_mm + CEILING * pad.thickness_mm
        is_steep = (binary_dilation(~np.isfinite(bottom)) & (bottom < ceiling)).any()
        self._order = 1 if is_steep else 3
        bottom = np.minimum(bottom, ceiling)
        self._gap, self._bottom = gap, bottom if is_steep else spline_filter(bottom)
        self._places = np.stack(np.meshgrid(*(np.arange(n) for n in load.shape), indexing="ij")).astype(float)

    def _gap_at(self, at: FloatArray, moved: FloatArray, part: Part = WHOLE) -> FloatArray:
        """Gap (nx, ny), without downward motion and depth, over points of the top that moved sideways (2, nx, ny)."""
        if not at.any() and not moved.any():
            return self._gap[part]
        places = self._places[:, *part] + (moved - at[:, None, None]) / self.pad.step_mm
        bottom = map_coordinates(self._bottom, places, order=self._order, mode="nearest", prefilter=False)
        return np.asarray(bottom + self.pad.sag_at(moved, part))

    def overlap(self, at: FloatArray, moved: FloatArray, part: Part = WHOLE) -> FloatArray:
        """Height (nx, ny) of the objects above such points of the untouched top; infinite at and beyond the walls."""
        return np.where(self.pad.wall_mm[part] > 1e-9, self._gap_at(at, moved, part) - self.depth_mm, np.inf)

    def require(self, at: FloatArray) -> None:
        """Refuse a place (2,) of the objects that the model does not cover."""
        require_scope(self.pad, self._gap_at(at, np.zeros_like(self.moved[:2])), self.depth_mm)

    def advance(self, to: FloatArray) -> None:
        """Move the objects to a place (2,), in one step."""
        pad = self.pad
        self.require(to)
        near = pad.slope * self.overlap(to, np.zeros_like(self._linear)) < (REACH - 1.0) * self.depth_mm
        near |= self.load[2] > 0.0
        while True:
            x, y = (slice(int(k.min()), int(k.max()) + 1) for k in np.nonzero(near))
            load, is_slipping = self._settled((x, y), to)
            linear, moved = self._motion(pad.moved, load, self._pressed)
            moved[2] += pad.moved(load[2])
            beyond = moved[2] + pad.slope * self.overlap(to, moved[:2]) < -FORGIVEN * self.depth_mm
            beyond[x, y] = False
            if not beyond.any():
                break
            near |= beyond
        farthest, most = float(np.hypot(*moved[:2]).max()), LARGEST_HELD_SHARE * pad.thickness_mm
        if farthest > most:
            raise ModelScopeError(
                f"shear: the top would be dragged along by {farthest:.3g} mm; the model covers {most:.3g} mm, "
                f"{LARGEST_HELD_SHARE:.0%} of the layer; move the objects less far, or press less deep"
            )
        self.at, self.load, self.is_slipping = to, load, is_slipping
        self._linear, self.moved = linear, moved

    def _motion(
        self, moved: Callable[[FloatArray], FloatArray], load: FloatArray, pressed: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sideways motion (2, nx, ny) by the linear response, and motion (3, nx, ny) without that down by pressure.

        Parameters
        ----------
        moved : the linear response of the top
        load : (3, nx, ny) sideways loads and pressure
        pressed : (nx, ny) pressure of the press without sideways load
        """
        none = np.zeros_like(load)
        by_pressure = moved(np.concatenate([none[:2], (load[2] - pressed)[None]]))[:2]
        found = moved(np.concatenate([load[:2] / self._stiffness, none[2:]]))
        linear, size = found[:2] + by_pressure, np.hypot(*found[:2])
        found *= self._stiffness - (self._stiffness - 1.0) * size / max(float(size.max()), 1e-12)
        found[:2] += by_pressure
        return linear, found

    def _settled(self, window: Part, to: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Load (3, nx, ny) after a step, with the contact within a part of the grid, and what of it (nx, ny) slips."""
        pad, cut, step = self.pad, (slice(None), *window), to - self.at
        whole, down = pad.response(window, sideways=True), pad.response(window)
        load, pressed, before = self.load[cut].copy(), self._pressed[window], self._linear[cut]
        moved, limit = self.moved[cut].copy(), np.zeros_like(pressed)
        moved[2] = self._motion(whole, load, pressed)[1][2]
        if self.friction > 0.0:
            moved[:2] += np.where(load[2] > 0.0, step[:, None, None], 0.0)  # as if it stuck
        for turn in range(ROUNDS):
            gap = pad.slope[window] * self.overlap(to, moved[:2], window) + moved[2]
            start = np.maximum(load[2], np.where(gap < 0.0, -gap, 0.0))
            pressure, _ = contact_pressure(down, gap, FINE.settled * self.depth_mm, start)
            change = float(np.abs(pressure - load[2]).sum() / pressure.sum())
            load[2], limit = pressure, self.friction * self._softness * pressure
            drawn = whole(np.concatenate([0.0 * load[:2], (pressure - pressed)[None]]))[:2]
            load[:2] = self._stiffness * _sideways_load(
                whole,
                load[:2] / self._stiffness,
                step[:, None, None] + before - drawn,
                limit,
                SIDEWAYS_ERROR * float(np.hypot(*step)),
            )
            moved += min(0.5, EASED / (turn + 1)) * (self._motion(whole, load, pressed)[1] - moved)
            if change <= ROUND_ERROR:
                break
        else:
            raise NotSettledError("shear: pressure and friction did not settle; move the objects less far")
        found, is_slipping = np.zeros_like(self.load), np.zeros(self.is_slipping.shape, np.bool_)
        found[cut] = load
        slips = np.hypot(*load[:2]) >= (1.0 - 1e-6) * self._stiffness * limit
        is_slipping[window] = (load[2] > 0.0) & slips
        return found, is_slipping

    def _holds_n(self, force_n: float) -> float:
        return self.friction * self._stiffness * force_n

    @property
    def pull_n(self) -> FloatArray:
        """Sideways force (2,) of the objects on the pad [N]."""
        return np.asarray(self.load[:2].sum(axis=(1, 2)) * self.pad.shear_mpa * self.pad.step_mm**2)

    def press(self) -> HeldPress:
        """The press as it is now."""
        pad = self.pad
        if not self.at.any() and not self.load[:2].any():
            return self._start
        overlap = self.overlap(self.at, self.moved[:2])
        found = settled(pad, overlap, self.load[2], self.moved[2], self.depth_mm)
        touching = self.load[2] > 0.0
        pull = self.pull_n
        return replace(
            found,
            top=self._drawn(found),
            shear_mm=(float(self.at[0]), float(self.at[1])),
            pull_n=(float(pull[0]), float(pull[1])),
            slip_share=float(self.is_slipping[touching].mean()),
            holds_n=self._holds_n(found.force_n),
        )

    def _drawn(self, found: HeldPress) -> GridTop:
        """The top over the places to which its points moved."""
        top, moved = found.top, self.moved[:2] / self.pad.step_mm
        at = self._places - moved
        for _ in range(PLACE_ROUNDS):
            shift = np.stack([map_coordinates(one, at, order=1, mode="nearest") for one in moved])
            off = self._places - shift - at
            at = at + 0.5 * off
            if np.abs(off).max() * self.pad.step_mm <= PLACE_ERROR_MM:
                break
        else:
            raise ModelScopeError(
                "shear: the top would fold next to the objects, which the model does not cover; move them less far"
            )
        level = map_coordinates(top.level, at, order=1, mode="nearest")
        height = map_coordinates(top.height_mm, at, order=3, mode="nearest")
        exact = self.overlap(self.at, np.zeros_like(moved))
        return replace(top, height_mm=np.where(level > 0.0, exact, height), level=level)


def _sideways_load(
    moved: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    wanted: FloatArray,
    limit: FloatArray,
    error: float,
) -> FloatArray:
    """Load (2, nx, ny) within a limit (nx, ny) that moves the top as wanted (2, nx, ny), where it can."""

    def within(load: FloatArray) -> FloatArray:
        size = np.hypot(*load)
        return np.asarray(
            load * np.minimum(1.0, np.divide(limit, size, out=np.ones_like(size), where=size > 0.0))
        )

    def motion(load: FloatArray) -> FloatArray:
        return moved(np.concatenate([load, np.zeros((1, *limit.shape))]))[:2]

    load = within(start)
    slope = motion(load) - wanted
    scale = 1.0
    for _ in range(MOST_STEPS):
        way = within(load - scale * slope) - load
        if np.abs(way).max() <= error * min(scale, 1.0):
            return load
        answer = motion(way)
        bend = float((way * answer).sum())
        length = min(1.0, -float((way * slope).sum()) / bend)
        load, slope = load + length * way, slope + length * answer
        scale = float((way * way).sum()) / bend
    raise NotSettledError("shear: friction did not settle; move the objects less far")
