"""Long objects pressed into the layer of the paper's pad, in plane strain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.tip_outlines import Tip, flat_tip, sphere_tip
from tests.validation.held.plane_oracle import PlanePress, PlaneState
from tests.validation.held.truth_file import BESIDE_MM, FAR_MM, Row

LAYER_MM = 9.0
"""Clear and black layer of the pad."""
PUNCH = Grading(size=0.05, axis_size=0.1, fine_depth=0.3, growth=1.2)
"""Half the size at the contact: its edge has a radius of 0.2 half widths."""
HALVINGS = 2
"""Of the finer mesh; the coarser one is halved once less."""


@dataclass(frozen=True, kw_only=True)
class PlaneCase:
    """A long object, the walls, and how deep it is pressed.

    Attributes
    ----------
    half_width_mm : of the section: a cylinder's radius
    width_mm : between the bonded walls
    edge_mm : radius of a punch's edge; a cylinder has none
    """

    half_width_mm: float
    depths_mm: tuple[float, ...] = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)
    width_mm: float = 32.0
    edge_mm: float | None = None
    poisson_ratio: float = POISSON_RATIO

    @property
    def unit_mm(self) -> float:
        """Length that depths are counted in."""
        return self.half_width_mm

    @property
    def tip(self) -> Tip:
        """The section, of half width 1."""
        return sphere_tip() if self.edge_mm is None else flat_tip(self.edge_mm / self.half_width_mm)

    def presses(self) -> list[PlanePress]:
        """The untouched layer on meshes from coarse to fine."""
        scale = self.half_width_mm
        grading = Grading() if self.edge_mm is None else PUNCH
        return [
            PlanePress(
                LAYER_MM / scale, 0.5 * self.width_mm / scale, grading, self.poisson_ratio, self.tip, level
            )
            for level in range(HALVINGS + 1)
        ]

    def kept(self, depth_mm: float, half: PlaneState, state: PlaneState) -> Iterator[Row]:
        """Quantities on the finer mesh, and how far the coarser one is off."""
        scale = self.half_width_mm
        yield Row.of(depth_mm, "force/E [mm]", scale * state.force, scale * half.force)
        yield Row.of(depth_mm, "contact half width [mm]", scale * state.edge, scale * half.edge)
        places = {f"edge + {beside:g}": scale * state.edge + beside for beside in BESIDE_MM}
        for name, x_mm in (places | {f"{far:g}": far for far in FAR_MM}).items():
            heights = (scale * one.height(x_mm / scale) for one in (state, half))
            yield Row.of(depth_mm, f"height at x = {name} mm [mm]", *heights)


PLANE_CASES = {
    "long cylinder, radius 2": PlaneCase(half_width_mm=2.0),
    "long cylinder, radius 5": PlaneCase(half_width_mm=5.0),
    "long punch, half width 2.5": PlaneCase(half_width_mm=2.5, edge_mm=0.5),
    "long cylinder, radius 5, walls 160 apart": PlaneCase(half_width_mm=5.0, width_mm=160.0),
    "long punch, half width 2.5, walls 160 apart": PlaneCase(
        half_width_mm=2.5, edge_mm=0.5, width_mm=160.0, depths_mm=(0.25, 0.5, 1.0, 1.5, 2.0)
    ),
    "long cylinder, radius 5, Poisson's ratio 0.4999": PlaneCase(half_width_mm=5.0, poisson_ratio=0.4999),
}
