"""Press protocols: what the packaged ones amount to, patterns, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from optopad.design.errors import DesignError, InputError, ModelScopeError
from optopad.design.fields.quantity import Quantity
from optopad.design.preset import PRESETS, preset
from optopad.design.press_protocol import (
    PROTOCOLS,
    LoadProtocol,
    PressProtocol,
    load_protocol,
    load_protocol_file,
    protocol_from,
)
from tests.said import pattern

PAD = preset("piacenza2017-pad")


def document(**changes: Any) -> dict[str, Any]:
    """A small protocol as plain data."""
    return {
        "name": "small",
        "approach": [
            {"from_mm": -1.0, "to_mm": 0.0, "step_mm": 0.5},
            {"from_mm": 0.2, "to_mm": 1.0, "step_mm": 0.2},
        ],
        "sets": [
            {"name": "a", "role": "train", "is_ambient": True, "grid_mm": 10.0},
            {"name": "b", "role": "test", "is_ambient": False, "random_places": 7},
        ],
    } | changes


def small(**changes: Any) -> PressProtocol:
    return protocol_from(document(**changes), where="small.toml")


def test_the_papers_protocol_states_its_counts() -> None:
    """158 points a press, 102 touched; 121 places of the grid, 100 random ones; 49,368 touched samples to train on."""
    protocol = load_protocol_file("piacenza2017")
    found = protocol.summary(PAD)
    assert (found["points_per_press"], found["touched_per_press"]) == (158, 102)
    assert found["presses"] == [121, 121, 121, 121, 100, 100]
    assert found["samples"] == 108_072
    assert 4 * 121 * found["touched_per_press"] == 49_368
    assert [(one.role, one.is_ambient) for one in protocol.sets] == [
        ("train", True), ("train", True), ("train", False), ("train", False), ("test", True), ("test", False),
    ]  # fmt: skip


def test_the_deepest_point_once_is_the_other_reading_of_the_paper() -> None:
    whole = load_protocol_file("piacenza2017").model_dump(mode="json")
    once = protocol_from(whole | {"turn": "once"}, where="once").summary(PAD)
    assert (once["points_per_press"], once["touched_per_press"]) == (157, 101)


def test_the_papers_schedule_has_the_rows_of_its_tables() -> None:
    for name in PROTOCOLS:
        rows = load_protocol_file(name).approach_mm
        assert {-0.4, -0.2, 0.0, 0.1, 0.2, 0.4, 0.5, 0.6, 0.8, 1.0, 2.0, 3.0, 5.0} <= set(rows)


def test_the_papers_grid_is_the_workspace_by_two_millimetres() -> None:
    grid = load_protocol_file("piacenza2017").places_mm(PAD)[0]
    np.testing.assert_array_equal(np.unique(grid[:, 0]), np.arange(6.0, 26.1, 2.0))
    np.testing.assert_array_equal(np.unique(grid[:, 1]), np.arange(6.0, 26.1, 2.0))


@pytest.mark.parametrize("name", PROTOCOLS)
@pytest.mark.parametrize("design", PRESETS)
def test_every_packaged_protocol_fits_every_preset(name: str, design: str) -> None:
    pad = preset(design)
    fitted = load_protocol_file(name).fitted_to(pad)
    limit = pad.operating.max_depth_mm
    assert limit - 0.5 < fitted.deepest_mm <= limit + 1e-9
    assert fitted.summary(pad)["samples"] > 1000


def test_depths_go_in_and_come_back_mirrored() -> None:
    protocol = small()
    way_in = [-1.0, -0.5, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    np.testing.assert_allclose(protocol.depth_mm, way_in + way_in[::-1], atol=1e-12)
    np.testing.assert_array_equal(protocol.is_retracting, [False] * 8 + [True] * 8)
    np.testing.assert_allclose(small(turn="once").depth_mm, way_in + way_in[-2::-1], atol=1e-12)
    np.testing.assert_allclose(small(retract="none").depth_mm, way_in, atol=1e-12)


def test_a_grid_that_does_not_fill_the_workspace_is_centred() -> None:
    grid = small(sets=[document()["sets"][0] | {"grid_mm": 7.0}]).places_mm(PAD)[0]
    np.testing.assert_allclose(np.unique(grid[:, 0]), [9.0, 16.0, 23.0])


def test_random_places_fill_the_workspace_and_belong_to_their_seed() -> None:
    one = document()["sets"][1] | {"random_places": 2000}
    sets = [one, one | {"name": "c", "place_seed": 5}, one | {"name": "d"}]
    first, other, same = small(sets=sets, approach=[document()["approach"][1]]).places_mm(PAD)
    np.testing.assert_array_equal(first, same)
    assert (first != other).all()
    assert first.min() >= 6.0
    assert first.max() <= 26.0
    np.testing.assert_allclose(first.mean(axis=0), 16.0, atol=5 * 20 / np.sqrt(12 * 2000))


def test_a_narrower_workspace_holds_all_places() -> None:
    for places in small(workspace_mm=[10.0, 12.0, 20.0, 22.0]).places_mm(PAD):
        assert (places.min(axis=0) >= [10.0, 12.0]).all()
        assert (places.max(axis=0) <= [20.0, 22.0]).all()


def test_fitting_drops_depths_and_nothing_else() -> None:
    shallow = PAD.with_(**{"operating.max_depth_mm": 0.5})
    assert small().fitted_to(shallow).approach_mm == (-1.0, -0.5, 0.0, 0.2, 0.4)
    assert small().fitted_to(PAD) == small()


def test_the_digest_names_the_content() -> None:
    assert small().digest == small().digest
    assert small().digest != small(turn="once").digest


def test_a_file_is_read_and_a_misspelt_name_is_answered(tmp_path: Path) -> None:
    text = Path("design/protocols/piacenza2017.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text.replace('"piacenza2017"', '"own"'))
    assert load_protocol_file(tmp_path / "own.toml").name == "own"
    with pytest.raises(DesignError, match="piacenza2017"):
        load_protocol_file("piacenza2071")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"approach": [{"from_mm": 0.0, "to_mm": 1.0, "step_mm": 0.3}]}, "do not reach 1 mm"),
        ({"approach": [{"from_mm": 0.0, "to_mm": 1.0, "step_mm": 0.0}]}, "step_mm: 0.0 is refused"),
        ({"approach": [{"from_mm": -2.0, "to_mm": -1.0, "step_mm": 0.5}]}, "touches nothing"),
        ({"approach": [{"from_mm": 0.0, "to_mm": 50.0, "step_mm": 1e-4}]}, "give at most 20000"),
        ({"approach": document()["approach"][::-1]}, "segment to segment"),
        ({"sets": [document()["sets"][0]] * 2}, "given twice"),
        ({"sets": [{"name": "a", "role": "train", "is_ambient": True}]}, "give grid_mm or random_places"),
        ({"sets": [document()["sets"][0] | {"role": "both"}]}, "must be 'train' or 'test'"),
        ({"workspace_mm": [10.0, 10.0, 9.0, 20.0]}, "is empty"),
        ({"dwel_s": 1.0}, "a protocol"),
    ],
)
def test_a_protocol_that_cannot_be_run_is_refused_by_field(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DesignError, match=message):
        small(**changes)


def test_a_protocol_beyond_the_design_is_refused_with_the_way_out() -> None:
    with pytest.raises(ModelScopeError, match=r"1 mm, the.*0\.5; raise"):
        small().places_mm(PAD.with_(**{"operating.max_depth_mm": 0.5}))
    with pytest.raises(ModelScopeError, match=r"leaves the design's, x 6 to 26"):
        small(workspace_mm=[5.0, 6.0, 26.0, 26.0]).places_mm(PAD)
    with pytest.raises(ModelScopeError, match="has no workspace"):
        small().places_mm(PAD.with_(**{"operating.workspace_margin_mm": 14.0}))


def test_more_places_or_samples_than_can_be_meant_are_refused() -> None:
    with pytest.raises(InputError, match="makes 4004001 locations"):
        small(sets=[document()["sets"][0] | {"grid_mm": 0.01}]).places_mm(PAD)
    deep = [{"from_mm": 0.0, "to_mm": 1.0, "step_mm": 1e-3}]
    with pytest.raises(InputError, match="samples, at most 5000000"):
        small(approach=deep, sets=[document()["sets"][0] | {"grid_mm": 0.4}]).places_mm(PAD)


PAPER = load_protocol("piacenza2017")


def changed(name: str, value: float) -> LoadProtocol:
    quantity = getattr(PAPER, name)
    return LoadProtocol.model_validate(
        dict(PAPER) | {name: Quantity.model_validate(dict(quantity) | {"value": value})}
    )


def test_the_published_protocol_is_as_stated_and_says_what_is_assumed() -> None:
    assert (PAPER.step_mm.value, PAPER.deepest_mm.value, PAPER.pause_s.value, PAPER.steps) == (
        1.0,
        5.0,
        10.0,
        5,
    )
    read = {PAPER.step_mm.confidence, PAPER.deepest_mm.confidence, PAPER.pause_s.confidence}
    assert read == {"read"}
    assert PAPER.speed_mm_per_s.confidence == "unverified"
    assert "does not state" in PAPER.speed_mm_per_s.source


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("step_mm", 0.0, "step_mm: 0 must be above 0"),
        ("speed_mm_per_s", -1.0, "speed_mm_per_s: -1 must be above 0"),
        ("pause_s", -1.0, "pause_s: -1 must be at least 0"),
        ("deepest_mm", 4.5, "deepest_mm: 4.5 ... of 1"),
        ("deepest_mm", 0.0, "deepest_mm: 0 ... of 1"),
    ],
)
def test_a_protocol_that_cannot_be_driven_is_refused(name: str, value: float, words: str) -> None:
    with pytest.raises(ValidationError, match=pattern(words)):
        changed(name, value)


def test_an_unknown_protocol_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'piacenza'.*piacenza2017"):
        load_protocol("piacenza")
    with pytest.raises(InputError, match="there are: piacenza2017"):
        load_protocol("x")
