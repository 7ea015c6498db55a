"""The press of a design's tip into its pad: surface, force and contact radius at a depth.

A press is taken from the shipped library of solved presses. It is solved live on request, or if the library does not
cover it. Library and solver are dimensionless: because the layer is neo-Hookean and frictionless, lengths scale with
the tip radius R and forces with E R² (E is Young's modulus). The pad is modelled as a round pad of the same area
(`scope.wall_radius`). In a flat rectangular pad ("block"), the effect of its four walls at the location is added
(`library.solved_press`). Other pads use the model below.

Presses on pads with another outline or top
-------------------------------------------
The tip presses along the normal of the undeformed top at its location (x, y), to a depth d from first touch. The press
is modelled as an axisymmetric one at the apex of a round pad. This round pad

- is as thick as the real pad at the location, measured along the normal (which agrees better with finite elements than
  the vertical thickness),
- has a spherical top with the mean curvature of the real top: 1/C for a sphere of radius C, 1/(2C) for a cylinder,
- has the real pad's area, limited to the library's range.

If the real pad has round walls, the surface follows the axisymmetric curve to the nearest wall and then fades out to
the farthest one.

A flat pad with round walls is treated in the same way, but without a crown, and its presses may also be solved live.
Heights are above the undeformed top, along its normal. The model is exact only in the middle of a disc whose top is
flat or spherical. docs/validation/contact-crowns.md compares off-centre presses with finite elements in three
dimensions.

Left out: the tilt of the top around the tip, because one wall is nearer and the layer is thinner on one side; and the
difference between a cylinder's two curvatures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.fields.finding import NO_VERDICT, Finding, outside_models
from optopad.design.rules.check import require_scope
from optopad.design.rules.shape import CROWNED_LAYER_RANGE, NEAREST_WALL, is_wide
from optopad.design.spec import Cavity, SensorDesign
from optopad.design.spec.indenter import tip_words
from optopad.sims.contact.library.live_press import live_note, live_press, mesh_size
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.library.smooth_press import SmoothPress
from optopad.sims.contact.library.solved_press import LARGEST_CHANGE, ROUNDS, PlacedPress, SolvedPress
from optopad.sims.contact.library.stored_press import UnitPress
from optopad.sims.contact.scope import Contact, ContactSolveError, Place, contact_of, half_width_of
from optopad.sims.contact.tip import HEMISPHERE
from optopad.sims.contact.walls import surroundings
from optopad.sims.press import Indentation


def crowned_press(contact: Contact, at_mm: Place | None) -> SmoothPress:
    """Presses of every depth at one location of a pad with a convex top, from the shipped library.

    Parameters
    ----------
    at_mm : (x, y) where the tip first touches, in cavity coordinates [mm]; None is the middle

    Raises
    ------
    ModelScopeError : the tip is not a hemisphere, or the library does not cover the layer or crown
    """
    if contact.tip != HEMISPHERE:
        raise ModelScopeError(
            f"indenter.shape: '{contact.design.indenter.shape}', but only a hemisphere is pressed into a crowned pad; "
            "use one, or leave the crown out"
        )
    layer, tip = contact.layer_at(at_mm), contact.tip_radius_mm
    low, high = CROWNED_LAYER_RANGE
    if not low - 1e-9 <= layer <= high + 1e-9:
        raise ModelScopeError(
            f"cavity.clear_thickness_mm: clear and black layer are {layer * tip:.4g} mm together at a "
            f"pressed location; presses into crowned pads are solved for {low * tip:.4g} to "
            f"{high * tip:.4g} mm with this tip; change it, or indenter.tip_radius_mm"
        )
    return shipped_library().press(layer, contact.wall_radius, contact.mean_crown)


def round_walls_mm(contact: Contact, at_mm: Place | None) -> tuple[float, float] | None:
    """Distances from a location to the nearest and the farthest wall [mm]; None if the pad has no round walls."""
    outline = contact.draft.plan.outline
    place = outline.centre_mm if at_mm is None else at_mm
    return (float(outline.gap_mm(*place)), outline.farthest_mm(*place)) if outline.arcs else None


def require_place(contact: Contact, at_mm: Place) -> None:
    """Refuse a location (x, y) [mm] outside the pad, or nearer to a wall than the contact model covers.

    Raises
    ------
    InputError : the location is outside the pad
    ModelScopeError : the location is too near a wall
    """
    plan, tip = contact.draft.cavity.plan, contact.tip_radius_mm
    if not all(map(math.isfinite, at_mm)) or not plan.contains(*at_mm):
        raise InputError(f"at_mm: x = {at_mm[0]:g}, y = {at_mm[1]:g} mm must lie in the pad")
    gap = float(plan.outline.gap_mm(*at_mm))
    if gap < NEAREST_WALL * tip - 1e-9:
        raise ModelScopeError(
            f"at_mm: the nearest wall is {gap / tip:.2f} tip radii from the press axis; the contact model "
            f"covers {NEAREST_WALL:g} and more; press farther from it, raise operating.workspace_margin_mm, or use a "
            "smaller tip"
        )


def is_in_library(contact: Contact) -> bool:
    """Whether the shipped library covers a design, with a hemispherical tip and a layer thickness in its range."""
    return contact.tip == HEMISPHERE and shipped_library().covers(round(contact.layer, 9))


@lru_cache(maxsize=64)
def _library_press(layer: float, wall: float) -> SmoothPress:
    """The library's presses into a round pad of a layer thickness and wall radius, both in tip radii; cached."""
    return shipped_library().press(layer, wall)


def solved_press(
    contact: Contact,
    max_depth_mm: float | None = None,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
    *,
    at_mm: tuple[float, float] | None = None,
) -> SolvedPress:
    """The press of a design's tip into its pad, at all depths down to at least the required one.

    Parameters
    ----------
    contact : the design's tip and pad
    max_depth_mm : deepest press required [mm]; None is the end of the design's usable range
    mesh_mm : node spacing under the tip [mm]. If given, the press is solved live. If None, it is taken from the shipped
        library, which has hemispheres and layers 1.3 to 6 tip radii thick. Other designs are solved live with a
        spacing of a tenth of the tip radius
    on_step : called with the fraction done (0 to 1) while solving
    at_mm : (x, y) of the press axis in cavity coordinates [mm]; None is the middle

    Raises
    ------
    DesignError, InputError : a value is not a positive number
    ModelScopeError : the layer, the depth, or a given `at_mm` is outside the range of the model
    """
    press = round_press(contact, max_depth_mm, mesh_mm, on_step, at_mm=at_mm)
    if not contact.draft.plan.is_block:
        if at_mm is not None:
            require_place(contact, at_mm)
        return press
    placed, told = _placed(contact.design.cavity, press, at_mm, _deepest(contact, max_depth_mm))
    return replace(press, placed=placed, notes=press.notes + told)


def round_press(
    contact: Contact,
    max_depth_mm: float | None = None,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
    *,
    at_mm: tuple[float, float] | None = None,
) -> SolvedPress:
    """The press in a round pad of the same area: faster than `solved_press`, because it ignores straight walls.

    Parameters and errors are those of `solved_press`. In a flat rectangular pad, the location has no effect.
    """
    radius, layer, modulus = contact.tip_radius_mm, round(contact.layer, 9), contact.draft.modulus
    deepest = _deepest(contact, max_depth_mm) / radius
    notes: tuple[str, ...] = ()
    unit: UnitPress | None = None
    if not contact.draft.plan.top.is_flat:
        smooth = crowned_press(contact, at_mm)
    elif mesh_mm is None and is_in_library(contact):
        smooth = _library_press(layer, round(contact.wall_radius, 9))
    else:
        try:
            unit, smooth, told = live_press(contact, mesh_size(contact, mesh_mm), deepest, on_step)
        except ContactSolveError as err:
            raise ModelScopeError(
                f"indenter.shape: a press of a {tip_words(contact.design.indenter)} to {deepest * radius:g} mm is not "
                f"solved ({err}); lower operating.max_depth_mm, or use a rounder tip"
            ) from err
        notes = (live_note(contact, mesh_mm), *told)
    return SolvedPress(
        smooth=smooth,
        unit=unit,
        tip_radius_mm=radius,
        modulus=modulus,
        placed=None,
        walls_mm=round_walls_mm(contact, at_mm),
        notes=notes,
    )


def _deepest(contact: Contact, max_depth_mm: float | None) -> float:
    """The deepest press required [mm]; None is the design's. Refuse it if it is deeper than the model covers."""
    return contact.deepest_mm if max_depth_mm is None else contact.require_depth(max_depth_mm, "max_depth_mm")


def _placed(
    cavity: Cavity, press: SolvedPress, at_mm: Place | None, deepest_mm: float
) -> tuple[PlacedPress | None, tuple[str, ...]]:
    """Presses corrected for the rectangular pad's own walls at a location, and notes for the user.

    `at_mm` None is the middle. If the pad is too small for the wall model there, the presses are None and a note says
    why. If the wall model does not cover a given location, it raises `ModelScopeError` instead.
    """
    smooth, tip = press.smooth, press.tip_radius_mm
    size = cavity.length_mm / tip, cavity.width_mm / tip
    at = (0.5 * size[0], 0.5 * size[1]) if at_mm is None else (at_mm[0] / tip, at_mm[1] / tip)
    try:
        placed = PlacedPress(smooth=smooth, size=size, at=at)
        placed.round_depth(min(deepest_mm / tip, smooth.deepest))
    except ModelScopeError as err:
        if at_mm is not None:
            raise
        side = 2.0 * half_width_of(smooth.wall_radius) * tip
        return None, (
            f"pad: {cavity.length_mm:g} x {cavity.width_mm:g} mm is too small for this tip ({err}); surface and force "
            f"are those of a pad of {side:.1f} x {side:.1f} mm: the surface rises too little, the force is too low",
        )
    return placed, ()


LAYER_STIFFNESS = (1.0, 1.2, 1.4)
"""Stiffness of a flat punch on a bonded incompressible layer, over that on a half-space [-]: polynomial in contact
radius over thickness. It is within 2 % of W. C. Hayes et al., J. Biomechanics 5 (1972), up to a ratio of 1."""


def wall_findings(contact: Contact) -> Iterator[Finding]:
    """A finding if the walls change the deepest press at the workspace's corner more than the contact model covers.

    No press is solved: the force follows from the tip's outline (`force_in_advance`), the lift of the top by the walls
    from the linear layer. The solved press is checked again before any light is traced (`require_corner`).
    """
    tip, space, design = contact.tip_radius_mm, contact.draft.workspace, contact.design
    size = design.cavity.length_mm / tip, design.cavity.width_mm / tip
    if is_wide(contact.draft) or space.is_empty:
        return
    layer, wall, depth = contact.layer, contact.wall_radius, design.operating.max_depth_mm / tip

    def change(x_mm: float, y_mm: float) -> float:
        """Change of the depth by the walls at a location, over the depth [-]."""
        lift = 3.0 * float(surroundings(layer, wall, size, (x_mm / tip, y_mm / tip)).on_axis.mean())
        found = depth
        for _ in range(ROUNDS):
            found = depth + lift * force_in_advance(contact, min(found, 2.0 * depth))
        return found / depth - 1.0

    at, margin = (space.x0_mm, space.y0_mm), design.operating.workspace_margin_mm
    share = change(*at)
    if share <= LARGEST_CHANGE:
        return
    wider = np.linspace(margin, margin + 0.5 * min(space.x1_mm - at[0], space.y1_mm - at[1]), 7)[1:].tolist()
    enough = next(
        (one for one in wider if change(*(c + one - margin for c in at)) <= 0.9 * LARGEST_CHANGE), None
    )
    raised = "" if enough is None else f"raise operating.workspace_margin_mm to {enough:.1f} mm, "
    yield outside_models(
        "indenter.tip_radius_mm",
        "the walls change presses at the workspace's corner more than the contact model covers",
        value=f"a {tip_words(design.indenter)}, {design.operating.max_depth_mm:g} mm deep at {at[0]:g}, {at[1]:g} mm, "
        f"changes by {min(share, 1.0):.0%}",
        limit=f"at most {LARGEST_CHANGE:.0%} of the depth",
        way_out=f"{raised}use a smaller or rounder tip, or a larger pad",
    )


def force_in_advance(contact: Contact, depth: float) -> float:
    """Estimated force of a press into the design's layer, without solving it [E R²].

    The contact grows through flat punches of radius a (Popov's dimensionality reduction): depth d(a) = a ∫ h'(r) /
    √(a² - r²) dr over the outline h(r), stiffness 8/3 E a times the layer's factor. For hemispheres in layers of 1.3
    to 6 tip radii the force is within 21 % of the library's.

    Parameters
    ----------
    depth : press depth [tip radii]
    """
    edges = np.linspace(0.0, 1.0, 201)
    middles, rises = 0.5 * (edges[1:] + edges[:-1]), np.diff(contact.tip.height(edges))
    radii = edges[1:]
    reach = np.where(middles < radii[:, None], radii[:, None] ** 2 - middles**2, np.inf)
    depths = radii * (rises / np.sqrt(reach)).sum(axis=1)
    slopes = 8.0 / 3.0 * radii * np.polynomial.polynomial.polyval(radii / contact.layer, LAYER_STIFFNESS)
    forces = np.append(0.0, np.cumsum(0.5 * (slopes[1:] + slopes[:-1]) * np.diff(depths)))
    return float(np.interp(depth, depths, forces) + slopes[-1] * max(depth - depths[-1], 0.0))


def require_covered(contact: Contact) -> None:
    """Refuse a design on which the models give no verdict, as far as this is known before a press is solved.

    Raises
    ------
    ModelScopeError : a rule's finding or the walls say so; the message has value, limit and way out.
    """
    require_scope(contact.design)
    for one in wall_findings(contact):
        raise ModelScopeError(str(one).replace(NO_VERDICT, ""))


def require_corner(contact: Contact) -> None:
    """Refuse a design with a press at the workspace's corner that the contact model does not cover, once it is solved.

    Raises
    ------
    ModelScopeError : the model does not cover it.
    """
    space = contact.draft.workspace
    if not space.is_empty:
        solved_press(contact, at_mm=space.clamped(space.x0_mm, space.y0_mm))


def _require_inside(design: SensorDesign, at_mm: tuple[float, float]) -> None:
    """Refuse a location (x, y) [mm] that is outside the cavity or not finite."""
    for letter, value, limit in zip(
        "xy", at_mm, (design.cavity.length_mm, design.cavity.width_mm), strict=True
    ):
        if not (math.isfinite(value) and 0.0 <= value <= limit):
            raise InputError(f"at_mm: {letter} = {value:g} mm must lie in the cavity, 0 to {limit:g} mm")


def indent(
    design: SensorDesign,
    depth_mm: float,
    at_mm: tuple[float, float] | None = None,
    *,
    mesh_mm: float | None = None,
) -> Indentation:
    """Press the design's tip into its pad.

    Parameters
    ----------
    design : the sensor
    depth_mm : depth of the tip's apex below the undeformed surface [mm]; 0 or less means no contact
    at_mm : (x, y) of the press axis in cavity coordinates [mm]; None is the middle
    mesh_mm : node spacing under the tip [mm]; if given, the press is solved live, see `solved_press`

    Returns
    -------
    Indentation : deformed top as a curve about the press axis, contact radius and force. `pad_surface` adds the part of
        the surface that is not symmetric about this axis

    Raises
    ------
    DesignError, InputError : a value is not a number, or the location is outside the cavity
    ModelScopeError : the layer, depth or location is outside the range of the model
    """
    contact = contact_of(design)
    contact.require_depth(depth_mm, "depth_mm")
    if at_mm is not None:
        _require_inside(design, at_mm)
    deepest = max(depth_mm, design.operating.max_depth_mm)
    return solved_press(contact, deepest, mesh_mm, at_mm=at_mm).at(depth_mm)
