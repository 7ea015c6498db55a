"""A press at the apex of a round, spherically crowned pad in mm and N; solved live, kept in the cache.

The layer (clear and black together) is bonded to a flat bottom and to its round wall; its top is a sphere, highest
where the tip presses. Heights are reported above the untouched crown at the same radius, so an untouched pad has height
0 everywhere, as a flat one has. Compared with finite elements by `tests/validation/contact/crown`: to 1 tip radius deep
in layers of 3, on crowns of 4 to 20 tip radii.

Left out: presses beside the apex, rectangular pads, walls that are not bonded, and what the flat presses leave out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.shape import DEEPEST_PRESS, LARGEST_SHARE_OF_LAYER, LAYER_DEPTH_RANGE
from optopad.sims.contact.library.live_press import LEAST_DEPTH, MESH_RANGE, both_ratios
from optopad.sims.contact.library.smooth_press import POISSON_RATIOS, SmoothPress, TopCurve, above_crown
from optopad.sims.contact.library.stored_press import PressInputs
from optopad.sims.contact.scope import require_rim, solved_depths
from optopad.sims.press import Indentation

CROWNED_MESH = 1 / 15
"""Node spacing under the tip [tip radii]: 0.2 mm for a 3 mm tip, that of the library."""


@dataclass(frozen=True, kw_only=True)
class CrownedPad:
    """A round pad with a spherical top, and what presses its apex.

    Attributes
    ----------
    tip_radius_mm : of the hemispherical tip and its shank [mm]
    crown_radius_mm : of the untouched top [mm]
    elastic_depth_mm : clear and black layer together, at the apex [mm]
    pad_radius_mm : of the bonded wall [mm]
    youngs_modulus_mpa : of the layer [MPa]
    """

    tip_radius_mm: float
    crown_radius_mm: float
    elastic_depth_mm: float
    pad_radius_mm: float
    youngs_modulus_mpa: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{field.name}: {value:g} must be a positive number")

    @property
    def crown(self) -> float:
        """Tip radius over crown radius [-]."""
        return self.tip_radius_mm / self.crown_radius_mm

    @property
    def layer(self) -> float:
        """Thickness at the apex [tip radii]."""
        return self.elastic_depth_mm / self.tip_radius_mm

    @property
    def wall_radius(self) -> float:
        """Radius of the bonded wall [tip radii]."""
        return self.pad_radius_mm / self.tip_radius_mm


@dataclass(frozen=True, kw_only=True)
class CrownedPress:
    """The presses at the apex of one crowned pad, at every depth up to the deepest solved one.

    Attributes
    ----------
    pad : what is pressed
    smooth : the presses in tip radii and E R²; heights above the untouched apex
    notes : what the user should know about this solution
    """

    pad: CrownedPad
    smooth: SmoothPress
    notes: tuple[str, ...] = ()

    def _depth(self, depth_mm: float) -> float:
        """A depth in tip radii, at most the deepest solved one."""
        depth, deepest = depth_mm / self.pad.tip_radius_mm, self.smooth.deepest
        if not depth <= deepest * (1.0 + 1e-8):  # solved depths are rounded to nine digits
            limit = deepest * self.pad.tip_radius_mm
            raise ModelScopeError(
                f"depth_mm: {depth_mm:g} is beyond the solved {limit:g} mm; press less deep or solve deeper"
            )
        return min(depth, deepest)

    def force_n(self, depth_mm: float) -> float:
        """Press force at a depth [mm], in N; 0 at 0 or less.

        Raises
        ------
        ModelScopeError : deeper than solved
        """
        unit_n = self.pad.youngs_modulus_mpa * self.pad.tip_radius_mm**2
        return unit_n * self.smooth.force_at(self._depth(depth_mm))

    def at(self, depth_mm: float) -> Indentation:
        """The press at a depth of the tip's apex below the untouched apex [mm]; 0 or less is untouched.

        Its curve runs from the axis to the wall; height and inclination are those above the untouched crown, also
        inside the contact, so the curve there is no sphere.

        Raises
        ------
        ModelScopeError : deeper than solved
        """
        curve = above_crown(self.smooth.curve_at(self._depth(depth_mm)), self.smooth.crown)
        return self._indentation(curve, depth_mm, is_hemisphere=False)

    def absolute_at(self, depth_mm: float) -> Indentation:
        """The same press with heights above the untouched apex: a sphere inside the contact; error of `at`."""
        return self._indentation(self.smooth.curve_at(self._depth(depth_mm)), depth_mm, is_hemisphere=True)

    def _indentation(self, curve: TopCurve, depth_mm: float, *, is_hemisphere: bool) -> Indentation:
        scale = self.pad.tip_radius_mm
        return Indentation(
            depth_mm=max(0.0, depth_mm),
            tip_radius_mm=scale,
            radius_mm=curve.radius * scale,
            height_mm=curve.height * scale,
            contact_radius_mm=curve.contact_radius * scale,
            force_n=self.force_n(depth_mm),
            is_hemisphere=is_hemisphere,
            inclination_deg=np.degrees(curve.inclination),
        )


def crowned_press(
    pad: CrownedPad,
    deepest_mm: float,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
) -> CrownedPress:
    """Solve the presses of a crowned pad at its apex, or take them from the cache.

    Parameters
    ----------
    pad : what is pressed
    deepest_mm : deepest press wanted [mm]
    mesh_mm : node spacing under the tip [mm]; None takes a fifteenth of the tip radius
    on_step : called with the fraction done while solving

    Raises
    ------
    InputError : a depth or a mesh that is no such number
    ModelScopeError : a layer or depth outside the model, a crown that leaves too little at the rim
    ContactSolveError : a state fails its checks
    """
    require_rim(pad.layer, pad.wall_radius, pad.crown)
    deepest = _within_model(pad, deepest_mm)
    depths = solved_depths(pad.layer, max(deepest, LEAST_DEPTH))
    inputs = PressInputs(
        layer=round(pad.layer, 9),
        mesh_size=_mesh_size(pad, mesh_mm),
        depths=tuple(round(float(depth), 9) for depth in depths),
        poisson_ratio=POISSON_RATIOS[-1],
        wall_radius=pad.wall_radius,
        crown=pad.crown,
    )
    _, smooth, notes = both_ratios(inputs, on_step)
    return CrownedPress(pad=pad, smooth=smooth, notes=notes)


def _within_model(pad: CrownedPad, deepest_mm: float) -> float:
    """The deepest press in tip radii, if layer and depth are within what is solved."""
    tip, (low, high) = pad.tip_radius_mm, LAYER_DEPTH_RANGE
    if not low - 1e-9 <= pad.layer <= high + 1e-9:
        raise ModelScopeError(
            f"elastic_depth_mm: {pad.elastic_depth_mm:g} mm must lie between {low * tip:g} and {high * tip:g} mm"
        )
    if not (math.isfinite(deepest_mm) and deepest_mm > 0.0):
        raise InputError(f"deepest_mm: {deepest_mm:g} must be a positive number")
    limit = min(LARGEST_SHARE_OF_LAYER * pad.layer, DEEPEST_PRESS)
    if deepest_mm > limit * tip + 1e-9:
        raise ModelScopeError(
            f"deepest_mm: {deepest_mm:g} mm is deeper than the contact model covers: {limit * tip:g} mm; "
            "press less deep or make the pad thicker"
        )
    return deepest_mm / tip


def _mesh_size(pad: CrownedPad, mesh_mm: float | None) -> float:
    """Node spacing under the tip in tip radii."""
    if mesh_mm is None:
        return CROWNED_MESH
    low, high = (bound * pad.tip_radius_mm for bound in MESH_RANGE)
    if not low - 1e-9 <= mesh_mm <= high + 1e-9:
        raise InputError(f"mesh_mm: {mesh_mm:g} mm must lie between {low:g} and {high:g} mm for this tip")
    return mesh_mm / pad.tip_radius_mm
