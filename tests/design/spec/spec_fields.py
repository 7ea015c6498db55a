"""What a design is made of, for tests: its numeric fields with their limits, and designs at random."""

from __future__ import annotations

import math
import tomllib
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import annotated_types as at
from hypothesis import strategies as st
from pydantic import BaseModel

from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import (
    AlternatingRing,
    AtAngles,
    Checkerboard,
    DiscRing,
    FacingRows,
    Grid,
    PerSide,
    Ring,
    RingInside,
    Single,
)
from tests.design.bad_designs import design_text

Patterns = tuple[tuple[type[BaseModel], dict[str, Any]], ...]
FLOOR_PATTERNS: Patterns = (
    (Grid, {"pattern": "grid", "kind": "coupler", "columns": 2, "rows": 2, "pitch_mm": 8.0, "apart_mm": 3.0}),
    (Checkerboard, {"pattern": "checkerboard", "columns": 2, "rows": 2, "pitch_mm": 8.0}),
    (RingInside, {"pattern": "ring_inside", "emitters": 2, "receivers": 4, "inset_mm": 5.0}),
    (Single, {"pattern": "single", "kind": "emitter", "wall": "floor", "x_mm": 16.0, "y_mm": 12.0}),
)
"""Each layout pattern of the floor, and the least that it needs; a part on the floor has no `along_mm`."""
PATTERNS: Patterns = (
    (AlternatingRing, {"pattern": "alternating_ring", "parts_per_side": 4}),
    (FacingRows, {"pattern": "facing_rows", "count": 2}),
    (PerSide, {"pattern": "per_side", "kind": "emitter", "south": 1}),
    (Ring, {"pattern": "ring", "emitters": 2, "receivers": 4}),
    (Single, {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 16.0}),
)
"""The same of the straight walls of a rectangle."""
DISC_PATTERNS: Patterns = (
    (DiscRing, {"pattern": "disc_ring", "count": 4}),
    (AtAngles, {"pattern": "at_angles", "kind": "emitter", "angles_deg": [10.0, 200.0]}),
)
"""The same of the wall of a disc."""
OF_THE_FLOOR = ("x_mm", "y_mm", "tilt_deg", "turn_deg")
"""Fields of a single part that a wall does not permit."""
OF_A_DISC = ("cavity.diameter_mm", "mold.outer_diameter_mm")
OF_A_RECTANGLE = ("cavity.length_mm", "cavity.width_mm", "mold.outer_length_mm", "mold.outer_width_mm")


@dataclass(frozen=True, kw_only=True)
class NumericField:
    """A number in a design and where it may lie; `above` and `below` exclude the limit itself."""

    path: str
    is_whole: bool
    at_least: float | None = None
    above: float | None = None
    at_most: float | None = None
    below: float | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest accepted value."""
        low = self.at_least if self.above is None else math.nextafter(self.above, math.inf)
        high = self.at_most if self.below is None else math.nextafter(self.below, -math.inf)
        assert low is not None
        assert high is not None
        return low, high

    @property
    def outside(self) -> tuple[float, float]:
        """The nearest values that are refused, below and above."""
        low, high = self.bounds
        if self.is_whole:
            return low - 1, high + 1
        return (
            math.nextafter(low, -math.inf) if self.above is None else self.above,
            math.nextafter(high, math.inf) if self.below is None else self.below,
        )

    @property
    def shown_limits(self) -> tuple[str, str]:
        """Lower and upper limit as a message shows them."""
        low = self.at_least if self.above is None else self.above
        high = self.at_most if self.below is None else self.below
        return f"{low:.12g}", f"{high:.12g}"


def good_document() -> dict[str, Any]:
    """A small design without a fault, as plain data."""
    return tomllib.loads(design_text())


def good(**changes: Any) -> SensorDesign:
    """The same as a design, with dotted paths changed; `__` stands for a dot."""
    design = SensorDesign.from_document(good_document(), where="good")
    return design.with_(**{path.replace("__", "."): value for path, value in changes.items()})


def with_layout(*patterns: dict[str, Any], **changes: Any) -> SensorDesign:
    """The good design with another layout."""
    return good(layout=list(patterns), **changes)


def good_disc(**changes: Any) -> SensorDesign:
    """A small disc without a fault; `__` stands for a dot."""
    document = good_document()
    del document["cavity"]["length_mm"], document["cavity"]["width_mm"]
    del document["mold"]["outer_length_mm"], document["mold"]["outer_width_mm"]
    document["cavity"] |= {"outline": "disc", "diameter_mm": 40.0}
    document["mold"]["outer_diameter_mm"] = 56.0
    document["layout"] = [dict(DISC_PATTERNS[0][1])]
    design = SensorDesign.from_document(document, where="good disc")
    return design.with_(**{path.replace("__", "."): value for path, value in changes.items()})


def limited_fields() -> list[NumericField]:
    """Every number of the schema that has both limits; patterns stand at `layout.0`."""
    found = list(_fields_of(SensorDesign, ""))
    for pattern, _ in (*PATTERNS, *DISC_PATTERNS, *FLOOR_PATTERNS):
        known = {field.path for field in found}
        found += [field for field in _fields_of(pattern, "layout.0.") if field.path not in known]
    return [field for field in found if _is_limited(field)]


def unlimited_fields() -> list[str]:
    """Every number of the schema that lacks a limit."""
    return [field.path for field in _fields_of(SensorDesign, "") if not _is_limited(field)]


def pattern_of(path: str) -> dict[str, Any]:
    """The least that a layout pattern with this field needs."""
    name = path.split(".")[2]
    return next(
        dict(least) for model, least in (*PATTERNS, *FLOOR_PATTERNS) if name in _permitted(model, least)
    )


def _permitted(model: type[BaseModel], least: dict[str, Any]) -> set[str]:
    """Names of the fields that go with the least that a pattern needs."""
    wall = least.get("wall")
    others = () if wall is None else ("along_mm",) if wall == "floor" else OF_THE_FLOOR
    return set(model.model_fields).difference(others)


def designs() -> st.SearchStrategy[SensorDesign]:
    """Valid designs: every number anywhere in its limits, any text, any mixture of patterns."""
    values = {
        field.path: _values(field)
        for field in _fields_of(SensorDesign, "")
        if _is_limited(field) and not field.path.startswith(("indenter.", "crown.", "top."))
    }
    radius = st.floats(3.0, 100_000.0)
    crown = st.one_of(
        st.fixed_dictionaries({"shape": st.just("sphere"), "radius_mm": radius}),
        st.fixed_dictionaries(
            {"shape": st.just("cylinder"), "radius_mm": radius, "axis": st.sampled_from(["x", "y"])}
        ),
    )
    top = st.fixed_dictionaries(
        {"finish": st.sampled_from(["diffuse", "specular"]), "reflectance": st.floats(0.0, 0.99)},
        optional={"thickness_mm": st.floats(0.0, 5.0), "black_outside": st.booleans()},
    )
    ids = st.from_regex(r"[a-z0-9][a-z0-9-]{0,20}", fullmatch=True)
    others = {
        "name": st.from_regex(r"[A-Za-z0-9]([A-Za-z0-9._-]{0,19}[A-Za-z0-9_-])?", fullmatch=True),
        "description": st.text(st.characters(exclude_categories=["Cs"]), max_size=30),
        "crown": crown,
        "top": top,
        "measured": st.lists(st.sampled_from(["emitters.height_mm", "board.baud"]), unique=True),
        "part_measurements": st.dictionaries(
            ids, st.dictionaries(st.just("active_width_mm"), st.floats(-1e6, 1e6), min_size=1), max_size=2
        ),
    }

    def of(patterns: Any, others_size: tuple[str, ...], made: Any) -> st.SearchStrategy[SensorDesign]:
        layout = st.lists(st.one_of(_patterns(patterns)), min_size=1, max_size=3)
        own = {path: value for path, value in values.items() if path not in others_size}
        given = st.fixed_dictionaries({}, optional={**own, **others, "layout": layout})
        return st.tuples(given, tips()).map(lambda parts: made(**parts[0], **parts[1]))

    return st.one_of(
        of((*PATTERNS, *FLOOR_PATTERNS), OF_A_DISC, good),
        of((*DISC_PATTERNS, *FLOOR_PATTERNS), OF_A_RECTANGLE, good_disc),
    )


def tips() -> st.SearchStrategy[dict[str, Any]]:
    """Dotted paths of any tip; rounding radii are at most the smallest tip's radius."""
    rounding = st.floats(0.05, 0.5)
    radius = {"indenter.tip_radius_mm": st.floats(0.5, 20.0)}
    edge = {"indenter.edge_radius_mm": rounding}
    cone = {
        "indenter.apex_radius_mm": rounding,
        "indenter.cone_half_angle_deg": st.floats(20.0, 85.0),
    }
    profile = st.lists(st.floats(0.01, 1.0), min_size=1, max_size=8).map(profile_through)
    return st.one_of(
        st.fixed_dictionaries({}, optional=radius),
        st.fixed_dictionaries({"indenter.shape": st.just("flat_punch")}, optional=radius | edge),
        st.fixed_dictionaries({"indenter.shape": st.just("cone")}, optional=radius | edge | cone),
        st.fixed_dictionaries({"indenter.shape": st.just("profile"), "indenter.profile_mm": profile}),
    )


def profile_through(steps: list[float]) -> list[list[float]]:
    """A profile of the default tip radius, 3 mm, with these relative steps in radius and in height."""
    along = [sum(steps[:count]) / sum(steps) for count in range(len(steps) + 1)]
    return [[3.0 * share, 2.0 * share**2] for share in along]


def _patterns(patterns: Patterns) -> list[st.SearchStrategy[dict[str, Any]]]:
    return [
        st.fixed_dictionaries(
            {key: st.just(value) for key, value in least.items()},
            optional={
                field.path: _values(field)
                for field in _fields_of(model, "")
                if _is_limited(field) and field.path not in least and field.path in _permitted(model, least)
            },
        )
        for model, least in patterns
    ]


def _values(field: NumericField) -> st.SearchStrategy[float]:
    low, high = field.bounds
    return st.integers(int(low), int(high)) if field.is_whole else st.floats(low, high)


def _is_limited(field: NumericField) -> bool:
    has_low = field.at_least is not None or field.above is not None
    return has_low and (field.at_most is not None or field.below is not None)


def _fields_of(model: type[BaseModel], prefix: str) -> Iterator[NumericField]:
    hints = typing.get_type_hints(model, include_extras=True)
    for name in model.model_fields:
        if name != "catalog":  # the catalogue's own tests cover it
            yield from _numbers(hints[name], f"{prefix}{name}")


def _numbers(hint: Any, path: str, limits: tuple[Any, ...] = ()) -> Iterator[NumericField]:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        more = [m for extra in arguments[1:] for m in getattr(extra, "metadata", [extra])]
        yield from _numbers(arguments[0], path, (*limits, *more))
    elif origin in (typing.Union, types.UnionType):
        for argument in arguments:
            yield from _numbers(argument, path, limits)
    elif isinstance(hint, type) and issubclass(hint, BaseModel):
        yield from _fields_of(hint, f"{path}.")
    elif hint in (int, float):
        yield _limited(NumericField(path=path, is_whole=hint is int), limits)


def _limited(field: NumericField, limits: tuple[Any, ...]) -> NumericField:
    names = {
        at.Ge: ("ge", "at_least"),
        at.Gt: ("gt", "above"),
        at.Le: ("le", "at_most"),
        at.Lt: ("lt", "below"),
    }
    for limit in limits:
        if type(limit) in names:
            theirs, ours = names[type(limit)]
            field = replace(field, **{ours: getattr(limit, theirs)})
    return field
