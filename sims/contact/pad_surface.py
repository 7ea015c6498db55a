"""The deformed top of a whole pad under one press, between the pad's own walls, and notes for the user about a press.

The surface is the sum of two parts (`library.solved_press`): a curve rotated about the press axis, which ends a few tip
radii away, and a smooth height over the whole pad. The sum is a function of (x, y). Where the surface wraps around the
tip's shank, the lowest height counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.errors import ModelScopeError
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library.solved_press import PlacedPress, SolvedPress
from optopad.sims.contact.scope import Contact, contact_of
from optopad.sims.press import Indentation

_STEP = 1e-6
MOST_SURFACES = 1024
"""Largest number of pad surfaces that are cached; each takes 30 kB."""
_SURFACES: dict[tuple[object, ...], PadSurface] = {}
"""Cache of pad surfaces. Keys contain the `id` of the presses, which stays valid because the surface refers to them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PadSurface:
    """The deformed top of a whole pad under one press.

    Attributes
    ----------
    near : the part of the surface that is symmetric about the press axis, with force and contact at this location
    solved : the presses at this location, at every depth
    at_mm : (x, y) of the press axis in cavity coordinates [mm]
    size_mm : length and width of the cavity [mm]
    """

    near: Indentation
    solved: SolvedPress
    at_mm: tuple[float, float]
    size_mm: tuple[float, float]

    def beside_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Height (nx, ny) to add to the symmetric part `near` [mm], at cavity coordinates x (nx,) and y (ny,) [mm]."""
        tip = self.near.tip_radius_mm
        if self.solved.placed is None:
            return np.zeros((len(x_mm), len(y_mm)))
        return tip * self.solved.placed.beside(self.near.depth_mm / tip, x_mm / tip, y_mm / tip)

    def height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Height (nx, ny) of the top over the undeformed top [mm], at cavity coordinates x (nx,) and y (ny,) [mm].

        Inside the contact, this is the tip's height.
        """
        radius = np.hypot(x_mm[:, None] - self.at_mm[0], y_mm[None, :] - self.at_mm[1])
        beside = np.where(radius <= self.near.contact_radius_mm, 0.0, self.beside_mm(x_mm, y_mm))
        return curve_height_mm(self.near, radius) + beside


def curve_height_mm(press: Indentation, radius_mm: FloatArray) -> FloatArray:
    """Height (...) of a press's curve [mm] at distances (...) from its axis [mm]; constant beyond the curve's end."""
    farthest = np.maximum.accumulate(press.radius_mm)
    kept = np.append(True, np.diff(farthest) > _STEP)
    radius, height = press.radius_mm[kept], press.height_mm[kept]
    return np.asarray(
        PchipInterpolator(radius, height)(np.clip(radius_mm, 0.0, radius[-1])), dtype=np.float64
    )


def pad_surface(
    design: SensorDesign, depth_mm: float, at_mm: tuple[float, float] | None = None
) -> PadSurface:
    """Press a design's tip into its pad, and return the surface of the whole top.

    Parameters
    ----------
    design : the sensor
    depth_mm : depth of the press [mm]; 0 or less means no contact
    at_mm : (x, y) of the press axis in cavity coordinates [mm]; None is the middle

    Raises
    ------
    ModelScopeError : the contact model does not cover the tip, layer, depth or location
    """
    size = (design.cavity.length_mm, design.cavity.width_mm)
    solved = solved_press(contact_of(design), max(depth_mm, design.operating.max_depth_mm), at_mm=at_mm)
    return PadSurface(
        near=solved.near_at(depth_mm),
        solved=solved,
        at_mm=at_mm or (0.5 * size[0], 0.5 * size[1]),
        size_mm=size,
    )


def pad_surfaces(contact: Contact, presses_mm: FloatArray) -> Iterator[PadSurface]:
    """Yield the top under each of many presses (n, 3) at x, y, depth > 0 [mm]; errors are those of `pad_surface`."""
    design = contact.design
    deepest = float(max(presses_mm[:, 2].max(initial=0.0), design.operating.max_depth_mm))
    middle, size = solved_press(contact, deepest), (design.cavity.length_mm, design.cavity.width_mm)
    tip, is_block = middle.tip_radius_mm, contact.draft.plan.is_block
    for x, y, depth_mm in presses_mm.tolist():
        if is_block:
            placed = PlacedPress(
                smooth=middle.smooth, size=(size[0] / tip, size[1] / tip), at=(x / tip, y / tip)
            )
            solved = replace(middle, placed=placed)
        else:
            solved = solved_press(contact, deepest, at_mm=(x, y))
        yield _remembered(solved, depth_mm, (x, y), size)


def _remembered(
    solved: SolvedPress, depth_mm: float, at_mm: tuple[float, float], size_mm: tuple[float, float]
) -> PadSurface:
    """The pad surface of a press, from the cache if it is there; designs with the same press share one object."""
    press = (id(solved.smooth), solved.tip_radius_mm, solved.modulus.value, solved.walls_mm)
    key = (*press, solved.placed is None, depth_mm, *at_mm, *size_mm)
    found = _SURFACES.get(key)
    if found is None:
        found = PadSurface(near=solved.near_at(depth_mm), solved=solved, at_mm=at_mm, size_mm=size_mm)
        if len(_SURFACES) >= MOST_SURFACES:
            _SURFACES.clear()
        _SURFACES[key] = found
    return found


NOTED_FORCE_CHANGE = 0.03
"""Relative change of force by near walls from which the user is notified [-]; it equals the contact model's error.
"""


def edge_force_note(contact: Contact) -> str | None:
    """A note on how much near walls change the force at the workspace's corner; None if the change is small.

    In pads other than flat rectangular ones, the change is due to a thinner border, not to a nearer wall.
    """
    space, depth_mm = contact.draft.workspace, contact.design.operating.max_depth_mm
    corner = space.clamped(space.x0_mm, space.y0_mm)
    try:
        ratio = solved_press(contact, at_mm=corner).force_n(depth_mm) / solved_press(contact).force_n(
            depth_mm
        )
    except ModelScopeError as err:
        return f"walls: a press at the workspace corner is outside the contact model ({err})"
    if abs(ratio - 1.0) < NOTED_FORCE_CHANGE:
        return None
    does, percent = "stiffen" if ratio > 1.0 else "soften", f"{100.0 * abs(ratio - 1.0):.0f} %"
    if contact.draft.plan.is_block:
        return f"walls {does} the pad by {percent} at the workspace corner ({corner[0]:g}, {corner[1]:g}) mm"
    where = f"at the workspace border ({corner[0]:.3g}, {corner[1]:.3g}) mm"
    return f"the crown {does}s the pad by {percent} {where}"


def contact_notes(contact: Contact) -> tuple[str, ...]:
    """All notes for the user about a design's press: about its solution, and about the effect of the walls."""
    walls = edge_force_note(contact)
    return (*solved_press(contact).notes, *((walls,) if walls else ()))
