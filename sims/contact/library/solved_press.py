"""A press of one tip into one layer in mm and N, at every depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.errors import ModelScopeError
from sims.contact.library.profiles import UnitPress
from sims.contact.library.run_out import run_out
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.library.surface_curve import TopCurve
from sims.contact.scope import half_width_of
from sims.contact.tip import HEMISPHERE
from sims.contact.walls.near_walls import wall_force_factor
from sims.contact.walls.superposition import Walls
from sims.press.indentation import Indentation


@dataclass(frozen=True, kw_only=True)
class SolvedPress:
    """A press of one tip into one layer, in mm and N, at every depth up to the deepest solved one.

    Attributes
    ----------
    smooth : the presses in tip radii and E R²
    tip_radius_mm : radius of the hemispherical tip [mm]
    youngs_modulus_mpa : modulus of the layer [MPa]; it scales the force only
    walls : distances (west, east, south, north) of the pad's walls from the press axis [tip radii]; None leaves the
        force that of the round pad
    unit : the solver's states, where the press was solved live; None from the library
    notes : what the user should know about this solution
    """

    smooth: SmoothPress
    tip_radius_mm: float
    youngs_modulus_mpa: float
    walls: Walls | None = None
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

    def force_n(self, depth_mm: float) -> float:
        """Press force at a depth [mm], in N."""
        depth, unit_n = self.scaled_depth(depth_mm), self.youngs_modulus_mpa * self.tip_radius_mm**2
        return self.smooth.force_at(depth) * unit_n * self._wall_factor(depth)

    def _wall_factor(self, depth: float) -> float:
        """Force over that of the round pad [-], which a square of its area has in the middle."""
        if self.walls is None or depth <= 0.0:
            return 1.0
        half = round(half_width_of(self.smooth.wall_radius), 9)
        here, there = (
            wall_force_factor(self.smooth.layer_depth, depth, walls) for walls in (self.walls, (half,) * 4)
        )
        return here / there

    def at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm], its surface run out beyond the half width of the pad; 0 or less is untouched.

        Raises
        ------
        ModelScopeError : deeper than solved
        """
        curve = self.smooth.curve_at(self.scaled_depth(depth_mm))
        return self._indentation(run_out(curve, half_width_of(self.smooth.wall_radius)), depth_mm)

    def round_pad_at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm], its surface that of the round pad out to its wall; errors of `at`."""
        return self._indentation(self.smooth.curve_at(self.scaled_depth(depth_mm)), depth_mm)

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
            is_hemisphere=self.smooth.tip == HEMISPHERE,
        )
