"""Fields of the silicone pad: outline, size, layers, and the crown of its top.

The module `optopad.design.shape.cavity` computes the geometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from optopad.design.fields.base import Model, PartId

Wall = Literal["south", "east", "north", "west"]
WALLS: tuple[Wall, ...] = ("south", "east", "north", "west")


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A wall seen from above: a straight wall has a name, a round wall has a start direction and an angle."""

    length_mm: float
    wall: Wall | None = None
    start_deg: float = 0.0
    turn_deg: float = 0.0


class Cavity(Model):
    """The silicone pad: its outline, its length and width (inside the mold), and the thickness of its two layers.

    A disc has `diameter_mm` in place of length and width, which then equal the diameter. A stadium is a rectangle with
    a half circle at each of its shorter sides.
    """

    unsaid = ("outline", "diameter_mm")

    outline: Annotated[
        Literal["rectangle", "disc", "stadium"],
        Field(description="seen from above; a disc has diameter_mm, a stadium half-round ends"),
    ] = "rectangle"
    length_mm: Annotated[float, Field(ge=5.0, le=200.0, description="inner length along x, not of a disc")]
    width_mm: Annotated[float, Field(ge=5.0, le=200.0, description="inner width along y, not of a disc")]
    diameter_mm: Annotated[float | None, Field(ge=5.0, le=200.0, description="inner diameter of a disc")] = (
        None
    )
    clear_thickness_mm: Annotated[
        float, Field(ge=1.0, le=50.0, description="clear layer that light uses, at its highest point")
    ]
    black_thickness_mm: Annotated[float, Field(ge=0.0, le=20.0, description="absorbing layer below")] = 1.0

    @model_validator(mode="before")
    @classmethod
    def _size_of_its_outline(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        if given.get("outline", "rectangle") != "disc":
            if given.get("diameter_mm") is not None and given.get("outline", "rectangle") == "rectangle":
                raise ValueError(
                    "diameter_mm belongs to a disc; remove it, or set outline = 'disc' and remove "
                    "length_mm and width_mm"
                )
            return given
        extra = [name for name in ("length_mm", "width_mm") if name in given]
        if extra:
            raise ValueError(
                f"a disc has diameter_mm, no {' and no '.join(extra)}: remove the others, or start from "
                "`optopad new --preset levi2013-disc`"
            )
        if given.get("diameter_mm") is None:
            raise ValueError("diameter_mm is missing: outline = 'disc' needs it; add it")
        return {**given, "length_mm": given["diameter_mm"], "width_mm": given["diameter_mm"]}

    @property
    def walls(self) -> dict[str, float]:
        """Name and inner length [mm] of each straight wall in which parts can be."""
        if self.outline == "disc":
            return {}
        if self.outline == "stadium":
            names = ("south", "north") if self.length_mm > self.width_mm else ("east", "west")
            return dict.fromkeys(names, abs(self.length_mm - self.width_mm))
        return {
            "south": self.length_mm,
            "east": self.width_mm,
            "north": self.length_mm,
            "west": self.width_mm,
        }

    @property
    def has_round_walls(self) -> bool:
        """Whether the outline has round walls, in which each part has its own facet in a given direction."""
        return self.outline != "rectangle"

    @property
    def border(self) -> tuple[Stretch, ...]:
        """Straight and round walls, counter-clockwise.

        The first is the south wall if that is straight, else the east wall. A disc has a single round wall.
        """
        straight = [Stretch(wall=wall, length_mm=self.walls[wall]) for wall in WALLS if wall in self.walls]
        if not self.has_round_walls:
            return tuple(straight)
        if not straight:
            return (Stretch(length_mm=math.pi * self.width_mm, turn_deg=360.0),)
        half = math.pi / 2 * min(self.length_mm, self.width_mm)
        first_deg = -90.0 if self.length_mm > self.width_mm else 0.0
        ends = [Stretch(length_mm=half, start_deg=first_deg + 180.0 * k, turn_deg=180.0) for k in (0, 1)]
        return straight[0], ends[0], straight[1], ends[1]

    @property
    def size_fields(self) -> tuple[str, str]:
        """Dotted paths of the fields for the inner size along x and along y; for a disc, both are the diameter."""
        own = ("length_mm", "width_mm") if self.diameter_mm is None else ("diameter_mm",) * 2
        return f"cavity.{own[0]}", f"cavity.{own[1]}"

    @property
    def elastic_mm(self) -> float:
        """Thickness of both layers, which deform as one elastomer, at the highest point [mm]."""
        return self.clear_thickness_mm + self.black_thickness_mm

    def wall_length_mm(self, wall: str) -> float:
        """Inner length of a straight wall [mm]; 0 if the outline does not have this wall."""
        return self.walls.get(wall, 0.0)

    @model_validator(mode="after")
    def _longer_than_wide(self) -> Self:
        if self.outline == "stadium" and self.length_mm == self.width_mm:
            raise ValueError(
                f"a stadium of {self.length_mm:g} x {self.width_mm:g} mm has no straight walls; make a side longer, or "
                f"set outline = 'disc' and diameter_mm = {self.length_mm:g}"
            )
        return self

    def _outlined(self, document: dict[str, Any]) -> dict[str, Any]:
        if self.outline == "disc":
            del document["length_mm"], document["width_mm"]
        return document


class Crown(Model):
    """Convex top of a pad, highest over its middle."""

    shape: Annotated[
        Literal["sphere", "cylinder"], Field(description="curved in every direction, or in one alone")
    ]
    radius_mm: Annotated[float, Field(ge=3.0, le=100_000.0, description="radius of curvature")]
    axis: Annotated[
        Literal["x", "y"] | None, Field(description="cylinder: the direction that stays straight")
    ] = None

    @model_validator(mode="after")
    def _axis_of_a_cylinder(self) -> Self:
        if self.shape == "cylinder" and self.axis is None:
            raise ValueError("axis is missing: a cylinder stays straight along 'x' or 'y'; add it")
        if self.shape == "sphere" and self.axis is not None:
            raise ValueError(
                f"axis = '{self.axis}' belongs to a cylinder; remove it, or set shape = 'cylinder'"
            )
        return self


class Covering(Model):
    """The pad's top: a skin that mirrors or scatters light, in place of the bare surface."""

    unsaid = ("skin", "finish", "reflectance", "thickness_mm", "youngs_modulus_mpa", "black_outside")

    skin: Annotated[PartId | None, Field(description="catalogue entry of the skin")] = None
    finish: Annotated[
        Literal["diffuse", "specular"] | None,
        Field(description="diffuse: scatters in all directions; specular: mirrors; default: the skin's"),
    ] = None
    reflectance: Annotated[
        float | None,
        Field(ge=0.0, le=0.99, description="share of the light that it returns; default: the skin's"),
    ] = None
    thickness_mm: Annotated[
        float | None, Field(ge=0.0, le=5.0, description="thickness of the skin; default: the skin's")
    ] = None
    youngs_modulus_mpa: Annotated[
        float | None, Field(gt=0.0, le=1e5, description="Young's modulus of the skin; default: the skin's")
    ] = None
    black_outside: Annotated[
        bool, Field(description="a black coat outside keeps ambient light out of the pad")
    ] = False

    @model_validator(mode="after")
    def _has_its_light(self) -> Self:
        missing = [name for name in ("finish", "reflectance") if getattr(self, name) is None]
        if self.skin is None and missing:
            raise ValueError(
                f"{missing[0]} is missing: a skin needs its finish and its reflectance; add it, name a skin of the "
                "catalogue (`optopad parts`), or remove [top] for a bare surface"
            )
        return self
