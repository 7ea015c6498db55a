"""Short objects pressed into the middle of the paper's pad, in three dimensions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.held.object_press import AxisGrading, ObjectPress, ObjectState
from tests.validation.held.rounded_objects import LyingCylinder, RigidObject, RoundedBox
from tests.validation.held.truth_file import BESIDE_MM, FAR_MM, Row

PAD_MM = (16.0, 16.0, 9.0)
"""Half its length and width, and its layer, clear and black."""
DOWN = AxisGrading(focus_mm=0.0, size_mm=0.45, fine_mm=0.9, growth=1.7)


@dataclass(frozen=True, kw_only=True)
class ObjectCase:
    """An object, and the mesh under it: along x, along y.

    Attributes
    ----------
    coarser : sizes of the elements on meshes from coarse to fine; the last two tell the error
    penalty : contact stiffness [E / mm]; where it is too large, touching points of coarse faces cycle
    """

    thing: RigidObject
    grading: tuple[AxisGrading, AxisGrading]
    depths_mm: tuple[float, ...] = (1.0, 2.0)
    unit_mm: float = 1.0
    coarser: tuple[float, ...] = (1.45, 1.1, 0.85)
    penalty: float = 30.0
    names: ClassVar = tuple(ObjectPress.ways)

    def presses(self) -> list[ObjectPress]:
        """The untouched pad on meshes from coarse to fine."""
        return [self.press(coarser) for coarser in self.coarser]

    def press(self, coarser: float) -> ObjectPress:
        """The untouched pad on one mesh."""
        return ObjectPress(self.thing, self.ticks(coarser), POISSON_RATIO, self.penalty)

    def ticks(self, coarser: float) -> tuple[FloatArray, ...]:
        """The mesh along x, along y and down."""
        axes = zip((*self.grading, DOWN), PAD_MM, strict=True)
        return tuple(axis.ticks(length, coarser) for axis, length in axes)

    def kept(self, depth_mm: float, half: ObjectState, state: ObjectState) -> Iterator[Row]:
        """Quantities on the finer mesh, and how far the coarser one is off."""
        yield Row.of(depth_mm, "force/E [mm2]", state.force, half.force)
        yield Row.of(depth_mm, "contact area from above [mm2]", state.area, half.area)
        for way, name in enumerate(self.names):
            edge = state.edge[way]
            yield Row.of(depth_mm, f"contact half width along {name} [mm]", edge, half.edge[way])
            for place, at_mm in self.places_mm(name, edge).items():
                heights = (one.height(way, at_mm) for one in (state, half))
                yield Row.of(depth_mm, f"height at {name} = {place} mm [mm]", *heights)

    def places_mm(self, name: str, edge_mm: float) -> dict[str, float]:
        """Places along a way at which heights are kept, by name."""
        beside = {f"edge + {beside:g}": edge_mm + beside for beside in BESIDE_MM}
        return beside | {f"{far:g}": far for far in FAR_MM}


def _even(size_mm: float, fine_mm: float, focus_mm: float = 0.0) -> AxisGrading:
    return AxisGrading(focus_mm=focus_mm, size_mm=size_mm, fine_mm=fine_mm)


OBJECT_CASES = {
    "ball, radius 3": ObjectCase(
        thing=RoundedBox(half_mm=(0.0, 0.0, 0.0), rounding_mm=3.0),
        grading=(_even(0.5, 3.0), _even(0.5, 3.0)),
        coarser=(1.7, 1.2),
    ),
    "lying cylinder, radius 3, length 8 along x": ObjectCase(
        thing=LyingCylinder(radius_mm=3.0, length_mm=8.0, rounding_mm=0.5),
        grading=(_even(0.5, 1.0, 4.0), _even(0.6, 3.0)),
        coarser=(1.7, 1.3, 1.0),
    ),
    "box edge, length 10 along x": ObjectCase(
        thing=RoundedBox(half_mm=(4.5, 4.5, 4.5), rounding_mm=0.5, roll_deg=45.0),
        grading=(_even(0.5, 1.0, 5.0), _even(0.35, 1.75)),
        penalty=100.0,
    ),
}
