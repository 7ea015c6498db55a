"""Parts on the floor in the studio: they move along x and y, and their patterns have fields."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from viser.transforms import SO3

from optopad.design.errors import InputError
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.studio.editable_fields import BY_HAND, changes_of, editable_fields_of, pattern_of
from optopad.studio.moves import moved, part_named
from optopad.studio.view.shapes import body_box, facing
from tests.design.rules.rule_cases import BENCHMARK
from tests.design.spec.spec_fields import with_layout

BOARD = {"pattern": "checkerboard", "columns": 3, "rows": 3, "pitch_mm": 7.0}
COUPLERS = {"pattern": "grid", "kind": "coupler", "columns": 2, "rows": 2, "pitch_mm": 9.0, "apart_mm": 4.0}
SINGLE = {"pattern": "single", "kind": "emitter", "wall": "floor", "x_mm": 9.0, "y_mm": 8.0, "tilt_deg": 60.0}


def floor(*patterns: dict[str, Any]) -> SensorDesign:
    return with_layout(*patterns, **BENCHMARK)


def places(design: SensorDesign) -> dict[str, tuple[float, ...]]:
    return {part.name: tuple(np.round(part.position_mm, 6)) for part in cavity_of(design).parts}


@pytest.mark.parametrize(("layout", "name"), [(BOARD, "R2"), (SINGLE, "E1")])
def test_one_part_moves_and_the_others_stay(layout: dict[str, Any], name: str) -> None:
    design = floor(layout)
    x, y, z = places(design)[name]
    now = design.with_(**moved(design, name, x_mm=x + 0.52, y_mm=y - 1.0))
    assert places(now) == places(design) | {name: (x + 0.5, y - 1.0, z)}
    assert [part.tilt_deg for part in cavity_of(now).parts] == [
        part.tilt_deg for part in cavity_of(design).parts
    ]
    assert moved(design, name, x_mm=x, y_mm=y) == {}


def test_couplers_move_with_their_grid() -> None:
    design = floor(COUPLERS)
    x, _, _ = part_named(design, "R1").position_mm
    assert moved(design, "R1", x_mm=x + 1.0) == {"layout.0.shift_x_mm": 1.0}
    assert moved(design, "E4", y_mm=part_named(design, "E4").position_mm[1] - 0.5) == {
        "layout.0.shift_y_mm": -0.5
    }
    assert design.with_(**changes_of(design, "layout", BY_HAND)).layout == design.layout


def test_a_position_of_a_wall_is_refused_on_the_floor() -> None:
    with pytest.raises(InputError, match=r"E1: along_mm: the part is on the floor; give x_mm and y_mm"):
        moved(floor(BOARD), "E1", along_mm=3.0)
    walls = with_layout({"pattern": "alternating_ring", "parts_per_side": 2})
    with pytest.raises(InputError, match=r"E1: x_mm: the part is in a wall; give along_mm"):
        moved(walls, "E1", x_mm=3.0)


def test_patterns_of_the_floor_have_fields_and_replace_each_other() -> None:
    for layout, pattern in ((BOARD, "checkerboard"), (COUPLERS, "grid")):
        design = floor(layout)
        assert pattern_of(design) == pattern
        fields = {field.path: field for field in editable_fields_of(design)}
        assert {"layout.0.columns", "layout.0.rows", "layout.0.pitch_mm"} <= set(fields)
        assert fields["layout"].choices[:2] == ("checkerboard", "ring inside")
        own = {path: field.value for path, field in fields.items() if path.startswith("layout.")}
        assert own == {path: getattr(design.layout[0], path.rpartition(".")[2]) for path in own}
        assert design.with_(**{path: value + 1 for path, value in own.items()}).layout != design.layout
    ring = floor(BOARD).with_(**changes_of(floor(BOARD), "layout", "ring inside"))
    assert pattern_of(ring) == "ring inside"
    assert len(cavity_of(ring).emitters) == 5
    back = ring.with_(**changes_of(ring, "layout", "checkerboard"))
    assert len(cavity_of(back).parts) == 9
    by_hand = back.with_(**changes_of(back, "layout", BY_HAND))
    assert places(by_hand) == places(back)


@pytest.mark.parametrize("tilt_deg", [0.0, 60.0, 90.0])
def test_a_body_is_drawn_where_the_part_is(tilt_deg: float) -> None:
    part = cavity_of(floor(SINGLE | {"tilt_deg": tilt_deg, "turn_deg": 30.0})).emitters[0]
    size, middle = body_box(part)
    turn = SO3(np.array(facing(part))).as_matrix()
    signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    drawn = part.position_mm + (middle + signs * size / 2) @ turn.T
    for corner in part.body_mm:
        assert np.linalg.norm(drawn - corner, axis=1).min() == pytest.approx(0.0, abs=1e-9)
    assert drawn[:, 2].min() == pytest.approx(part.body_base_mm)
    assert drawn[:, 2].max() == pytest.approx(part.body_top_mm)
