"""Fields offered for editing are those of the specification; a dragged part moves what it should and nothing else."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import pytest

from optopad.design.errors import DesignError, InputError
from optopad.design.fields.base import get_at
from optopad.design.io import file_schema
from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.studio.editable_fields import (
    BY_HAND,
    PATTERNS,
    ROUND_PATTERNS,
    EditableField,
    changes_of,
    editable_fields_of,
    pattern_of,
)
from optopad.studio.moves import STEP_MM, moved, part_named, placed_singles
from tests.design.for_each import for_each

PAD, PAIR, OBLONG = "piacenza2017-pad", "piacenza2017-pair", "oblong-60x40"
DISC, CROWNED, DOME, STADIUM = SHAPED_PRESETS
ROUNDING_MM = STEP_MM / 2 + 1e-9
SIDES = [
    {"pattern": "per_side", "kind": "emitter", "south": 2, "west": 2, "part": "generic-emitter", "height_mm": 4.4},
    {"pattern": "per_side", "kind": "receiver", "north": 2, "east": 3, "shift_mm": 0.5},
    {"pattern": "single", "kind": "receiver", "wall": "south", "along_mm": 25.0, "name": "corner"},
]  # fmt: skip


def by_side() -> SensorDesign:
    """Emitters of a part and height of their own, receivers shifted, and one part with a name of its own."""
    return preset(PAD).with_(layout=SIDES)


DESIGNS = {name: preset(name) for name in (*FLAT_PRESETS, CROWNED)} | {"by side": by_side()}
"""Rectangles."""
DISCS = {name: preset(name) for name in (DISC, DOME)}
ALL = DESIGNS | DISCS
FIELDS = [(where, field) for where, design in ALL.items() for field in editable_fields_of(design)]
NUMBERS = [one for one in FIELDS if one[1].kind != "choice"]


def after(design: SensorDesign, name: str, **where: Any) -> SensorDesign:
    return design.with_(**moved(design, name, **where))


def places(design: SensorDesign) -> dict[str, tuple[Any, ...]]:
    """What each part is and where, by name, in order."""
    return {
        part.name: (part.kind, part.wall, part.part_id, part.along_mm, part.height_mm)
        for part in cavity_of(design).parts
    }


@cache
def whole_schema() -> dict[str, Any]:
    return file_schema()


def field_schema(path: str) -> dict[str, Any]:
    """The JSON schema of a field, read without the code that is tested here."""
    schema = whole_schema()
    branches: list[dict[str, Any]] = [schema]
    for name in path.split("."):
        found = [one["properties"][name] for one in branches if name in one.get("properties", {})]
        found += [one["items"] for one in branches if name.isdigit() and "items" in one]
        found += [
            one["prefixItems"][int(name)] for one in branches if name.isdigit() and "prefixItems" in one
        ]
        branches = []
        while found:
            one = found.pop()
            if "$ref" in one:
                found.append(schema["$defs"][one["$ref"].rsplit("/", 1)[-1]])
            elif "anyOf" in one or "oneOf" in one:
                found += one.get("anyOf", []) + one.get("oneOf", [])
            else:
                branches.append(one)
    numbers = [one for one in branches if one.get("type") in ("number", "integer")]
    said = ("title", "description")  # of a field that is optional in one pattern and required in another
    plain = [{key: value for key, value in one.items() if key not in said} for one in numbers]
    assert len({str(sorted(one.items())) for one in plain}) == 1, path
    return plain[0]


@for_each(FIELDS)
def test_a_field_shows_what_the_design_has(where: str, field: EditableField) -> None:
    design = ALL[where]
    if field.path == "layout":
        assert field.value == pattern_of(design)
        return
    value = (
        get_at(design.model_dump(mode="json"), field.path) if field.path != "gain.feedback_ohm" else "each"
    )
    if value is None:  # no pitch is given: even along the shorter wall
        along = sorted(part.along_mm for part in cavity_of(design).parts if part.wall == "west")
        assert field.path == "layout.0.pitch_mm"
        assert field.value == pytest.approx(along[1] - along[0], abs=1e-3)
    else:
        assert field.value == value


@for_each(NUMBERS)
def test_limits_are_those_of_the_specification(where: str, field: EditableField) -> None:
    schema = field_schema(field.path)
    pattern = get_at(ALL[where].model_dump(mode="json"), field.path.rpartition(".")[0])
    if isinstance(pattern, dict) and pattern.get("pattern") == "facing_rows" and field.path.endswith("count"):
        schema = {"minimum": 1, "maximum": 32, "type": "integer"}
    assert field.low == schema.get("minimum", schema.get("exclusiveMinimum"))
    assert field.high == schema.get("maximum", schema.get("exclusiveMaximum"))
    assert (field.kind == "whole") == (schema["type"] == "integer")
    assert field.step > 0


@for_each(NUMBERS)
def test_a_value_beyond_a_limit_is_refused_by_name(where: str, field: EditableField) -> None:
    design = ALL[where]
    beyond = [
        *([] if field.low is None else [field.low - 1]),
        *([] if field.high is None else [field.high + 1]),
        "much",
        None,
    ]
    if field.path.endswith("pitch_mm") or (where, field.path) == ("by side", "emitters.height_mm"):
        beyond.remove(None)  # no pitch of its own: even; and every emitter there has a height of its own
    for value in beyond:
        with pytest.raises(DesignError, match=field.path.replace(".", r"(\.|: )")):
            design.with_(**changes_of(design, field.path, value))


def test_a_design_has_the_fields_of_its_outline_and_top() -> None:
    sides, round_ones = {"cavity.length_mm", "cavity.width_mm"}, {"cavity.diameter_mm"}
    for design in ALL.values():
        paths = {field.path for field in editable_fields_of(design)}
        plan = plan_of(design)
        is_round = any(one.is_diameter for one in plan.outline.dimensions)
        assert paths & (sides | round_ones) == (round_ones if is_round else sides)
        assert ("crown.radius_mm" in paths) == (not plan.top.is_flat)
        assert ("layout.0.first_angle_deg" in paths) == (pattern_of(design) == ROUND_PATTERNS[0])


@for_each([DISC, DOME])
def test_a_round_mold_follows_the_disc_in_it(name: str) -> None:
    design = preset(name)
    assert design.mold.outer_diameter_mm is not None
    walls = design.mold.outer_diameter_mm - design.cavity.length_mm
    for value in (40.0, 23.7):
        found = design.with_(**changes_of(design, "cavity.diameter_mm", value))
        assert found.cavity.diameter_mm == value
        assert found.mold.outer_diameter_mm == pytest.approx(value + walls, abs=1e-6)


@pytest.mark.parametrize(
    ("where", "path", "words"),
    [
        (DISC, "cavity.length_mm", "a disc has diameter_mm, no length_mm"),
        (PAD, "cavity.diameter_mm", "diameter_mm"),
        (DISC, "layout.0.pitch_mm", "layout.0.pitch_mm"),
        (PAD, "crown.radius_mm", "crown.shape: is missing"),
    ],
)
def test_a_field_that_a_design_has_not_is_refused_in_words(where: str, path: str, words: str) -> None:
    with pytest.raises(DesignError, match=words):
        ALL[where].with_(**changes_of(ALL[where], path, 20.0))


@for_each(product([*FLAT_PRESETS, CROWNED], ["length", "width"]))
def test_the_mold_s_outside_follows_the_pad_s_inside(name: str, side: str) -> None:
    design = preset(name)
    inner = getattr(design.cavity, f"{side}_mm")
    walls = getattr(design.mold, f"outer_{side}_mm") - inner
    for value in (inner + 2.5, inner - 3.3):
        found = design.with_(**changes_of(design, f"cavity.{side}_mm", value))
        assert getattr(found.mold, f"outer_{side}_mm") - value == pytest.approx(walls, abs=1e-6)
        other = "width" if side == "length" else "length"
        assert getattr(found.cavity, f"{other}_mm") == getattr(design.cavity, f"{other}_mm")
        assert getattr(found.mold, f"outer_{other}_mm") == getattr(design.mold, f"outer_{other}_mm")


@for_each(product(range(4), [-1, 1, 2, -4]))
def test_a_ring_counted_wall_by_wall_keeps_its_sum_even(wall: int, change: int) -> None:
    design = preset(OBLONG)
    counts = [7, 5, 7, 5]
    changes = changes_of(design, f"layout.0.parts_per_side.{wall}", counts[wall] + change)
    counts[wall] += change
    counts[(wall + 2) % 4] += change if change % 2 else 0
    assert list(design.with_(**changes).layout[0].parts_per_side) == counts


@for_each(product(DESIGNS, (*PATTERNS, BY_HAND)))
def test_another_pattern_is_that_pattern_and_has_both_kinds(where: str, pattern: str) -> None:
    design = DESIGNS[where]
    found = design.with_(**changes_of(design, "layout", pattern))
    assert pattern_of(found) == pattern
    cavity = cavity_of(found)
    assert min(len(cavity.emitters), len(cavity.receivers)) >= 1
    if pattern == BY_HAND:
        assert list(places(found)) == list(places(design))


@for_each(DESIGNS)
def test_a_part_moved_along_is_the_only_one_that_moves(where: str) -> None:
    design = DESIGNS[where]
    for name in places(design):
        was, now = (
            places(design),
            places(after(design, name, along_mm=part_named(design, name).along_mm + 0.5)),
        )
        assert list(now) == list(was)
        kind, wall, part, along_mm, height_mm = was.pop(name)
        found = now.pop(name)
        assert (*found[:3], found[4]) == (kind, wall, part, height_mm)
        assert found[3] == pytest.approx(along_mm + 0.5, abs=ROUNDING_MM)
        assert [one[:3] for one in now.values()] == [one[:3] for one in was.values()]
        assert [one[3:] for one in now.values()] == [pytest.approx(one[3:], abs=1e-6) for one in was.values()]


@for_each(ALL)
def test_a_part_moved_up_takes_all_of_its_kind_along_but_those_with_a_height_of_their_own(where: str) -> None:
    design = ALL[where]
    for name in places(design):
        was = {part.name: part for part in cavity_of(design).parts}
        found = after(design, name, height_mm=was[name].height_mm + 0.3)
        now = cavity_of(found).parts
        goes = {part.name for part in was.values() if part.height_field == was[name].height_field}
        for part in now:
            rise = 0.3 if part.name in goes else 0.0
            assert part.height_mm == pytest.approx(was[part.name].height_mm + rise, abs=ROUNDING_MM)
        assert [part.along_mm for part in now] == [part.along_mm for part in was.values()]
        assert found.layout == design.layout or was[name].height_field.startswith("layout.")


@for_each(DESIGNS)
def test_with_its_whole_row_the_pattern_stays(where: str) -> None:
    design = DESIGNS[where]
    for name in places(design):
        part = part_named(design, name)
        found = after(design, name, along_mm=part.along_mm + 0.5, with_row=True)
        assert [type(one) for one in found.layout] == [type(one) for one in design.layout]
        assert list(places(found)) == list(places(design))
        middle = cavity_of(design).wall_length_mm(part.wall) / 2
        if abs(part.along_mm - middle) > 0.01 or where == "by side":
            assert part_named(found, name).along_mm == pytest.approx(part.along_mm + 0.5, abs=ROUNDING_MM)
        else:  # a pitch does not move the part in the middle
            assert found.digest == design.digest


@for_each(DESIGNS)
def test_a_part_put_where_it_is_stays_in_its_pattern(where: str) -> None:
    design = DESIGNS[where]
    for name in places(design):
        part = part_named(design, name)
        for off_mm in (0.0, 0.02, -0.02):
            for with_row in (False, True):
                near = {"along_mm": part.along_mm + off_mm, "height_mm": part.height_mm - off_mm}
                assert moved(design, name, **near, with_row=with_row) == {}
        assert moved(design, name) == {}


def test_an_unknown_part_and_a_place_that_is_no_number_are_refused() -> None:
    with pytest.raises(InputError, match=r"E9: no.*E1, E2, E3, R1.*R2, R3"):
        moved(preset(PAIR), "E9", along_mm=3.0)
    for value in (float("nan"), float("inf")):
        with pytest.raises(InputError, match="E1: along_mm"):
            moved(preset(PAIR), "E1", along_mm=value)


@for_each(DESIGNS)
def test_a_layout_taken_apart_is_the_same_layout(where: str) -> None:
    design = DESIGNS[where]
    found = design.with_(layout=placed_singles(design, range(len(design.layout))))
    assert {one.pattern for one in found.layout} == {"single"}
    assert {
        name: (*at[:3], *(round(one, 6) for one in at[3:])) for name, at in places(design).items()
    } == places(found)
    assert placed_singles(design, []) == design.model_dump(mode="json")["layout"]


@for_each(DISCS)
def test_a_ring_taken_apart_and_made_again_is_the_same_ring(where: str) -> None:
    design = DISCS[where].with_(**{"layout.0.first_angle_deg": 12.5})
    assert pattern_of(design) == ROUND_PATTERNS[0]
    apart = design.with_(**changes_of(design, "layout", BY_HAND))
    assert pattern_of(apart) == BY_HAND
    assert {one.pattern for one in apart.layout} == {"at_angles"}
    assert places(apart) == places(design)
    assert apart.with_(**changes_of(apart, "layout", ROUND_PATTERNS[0])).digest == design.digest
