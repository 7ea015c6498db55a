"""A press of one tip into one layer in mm and N, at every depth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.errors import ModelScopeError
from sims.contact.library.placed_press import PlacedPress
from sims.contact.library.profiles import UnitPress
from sims.contact.library.run_out import run_out
from sims.contact.library.smooth_press import SmoothPress, above_crown
from sims.contact.library.surface_curve import TopCurve
from sims.contact.scope import half_width_of
from sims.contact.tip import HEMISPHERE
from sims.press.indentation import Indentation

LEAST_RUN_OUT = 0.02
"""So much farther than the nearest wall the farthest one may be, and the curve still ends at the wall [-]."""


@dataclass(frozen=True, kw_only=True)
class SolvedPress:
    """A press of one tip into one layer, in mm and N, at every depth up to the deepest solved one.

    Attributes
    ----------
    smooth : the presses in tip radii and E R²
    tip_radius_mm : radius of the hemispherical tip [mm]
    youngs_modulus_mpa : modulus of the layer [MPa]; it scales the force only
    placed : the presses at a place of the pad; None: those of the round pad
    walls_mm : between round walls, the nearest and the farthest from the press axis; None: all walls are straight [mm]
    unit : the solver's states, where the press was solved live; None from the library
    notes : what the user should know about this solution
    """

    smooth: SmoothPress
    tip_radius_mm: float
    youngs_modulus_mpa: float
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
        """A depth in tip radii, at most the deepest solved one.

        Raises
        ------
        ModelScopeError : deeper than solved
        """
        depth = depth_mm / self.tip_radius_mm
        if not depth <= self.smooth.deepest * (1.0 + 1e-9):
            raise ModelScopeError(
                f"depth_mm: {depth_mm:g} is beyond the solved {self.deepest_mm:g} mm; "
                "raise operating.max_depth_mm or press less deep"
            )
        return min(depth, self.smooth.deepest)

    def round_depth(self, depth_mm: float) -> float:
        """Depth of the round pad's press that is this place's at a depth [mm], in tip radii; errors of `at`."""
        depth = self.scaled_depth(depth_mm)
        return depth if self.placed is None else self.placed.round_depth(depth)

    def force_n(self, depth_mm: float) -> float:
        """Press force at a depth [mm], in N."""
        depth, unit_n = self.scaled_depth(depth_mm), self.youngs_modulus_mpa * self.tip_radius_mm**2
        return unit_n * (self.placed or self.smooth).force_at(depth)

    def at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm], its surface run out to the pad's farthest walls; 0 or less is untouched.

        Heights are above the untouched top, along its normal: under a crown no sphere, even inside the contact.

        Raises
        ------
        ModelScopeError : deeper than solved, or walls that change the press too much
        """
        curve = above_crown(
            (self.placed or self.smooth).curve_at(self.scaled_depth(depth_mm)), self.smooth.crown
        )
        if self.walls_mm is None:
            return self._indentation(run_out(curve, half_width_of(self.smooth.wall_radius)), depth_mm)
        nearest, farthest = (wall / self.tip_radius_mm for wall in self.walls_mm)
        if self.smooth.wall_radius < 0.5 * (nearest + farthest) - 1e-9:  # a wall that the pad does not have
            nearest = min(nearest, half_width_of(self.smooth.wall_radius))
        if farthest - nearest > LEAST_RUN_OUT * nearest:
            curve = run_out(curve, nearest, farthest - nearest)
        return self._indentation(curve, depth_mm)

    def near_at(self, depth_mm: float) -> Indentation:
        """The part of the press at a depth [mm] that is a curve around its axis (`PlacedPress.near_at`).

        Raises
        ------
        ModelScopeError : as `at`
        """
        if self.placed is None:
            return self.at(depth_mm)
        return self._indentation(self.placed.near_at(self.scaled_depth(depth_mm)), depth_mm)

    def round_pad_at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm] in the round pad: its surface out to its wall, and its force; errors of `at`."""
        plain = replace(self, placed=None)
        curve = self.smooth.curve_at(self.scaled_depth(depth_mm))
        return plain._indentation(above_crown(curve, self.smooth.crown), depth_mm)

    def _indentation(self, curve: TopCurve, depth_mm: float) -> Indentation:
        """A curve in tip radii and the force of its depth."""
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
