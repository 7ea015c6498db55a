"""The specification: limits of each field, identity by content, change by copy."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at, leaves, set_at
from optopad.design.io import dump_design, load_design
from optopad.design.preset import FLOOR_PRESETS, PRESETS, preset
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign, Viscoelastic
from optopad.design.spec.tolerances import build_tolerances
from tests.design.bad_designs import design_text
from tests.design.for_each import for_each
from tests.design.spec.spec_fields import (
    OF_A_DISC,
    NumericField,
    designs,
    good,
    good_disc,
    good_document,
    limited_fields,
    pattern_of,
    unlimited_fields,
)
from tests.said import says

LIMITED = limited_fields()
OF_OTHER_TIPS = ("indenter.edge_radius_mm", "indenter.cone_half_angle_deg", "indenter.apex_radius_mm")
"""Numbers that a hemisphere does not have."""
NO_OPTION: dict[str, str | None] = {
    "elastomer.viscoelastic.relaxed_share": None,
    "elastomer.viscoelastic.time_constant_s": None,
}


def from_text(text: str) -> SensorDesign:
    return SensorDesign.from_document(tomllib.loads(text), where="text")


def changed(path: str, value: Any) -> SensorDesign:
    if path in OF_A_DISC:
        return good_disc(**{path: value})
    if path == "layout.0.first_angle_deg":
        return good_disc(**{path: value})
    if path.startswith("top."):
        return good(top={"finish": "diffuse", "reflectance": 0.5} | {path.removeprefix("top."): value})
    if path == "crown.radius_mm":
        return good(crown={"shape": "sphere", "radius_mm": value})
    if path.startswith("layout.0."):
        return good(layout=[pattern_of(path) | {path.split(".")[2]: value}])
    if path in OF_OTHER_TIPS:
        return good(**{"indenter.shape": "cone", "indenter.tip_radius_mm": 20.0, path: value})
    return good(**{path: value})


def test_the_walk_over_the_schema_finds_its_numbers() -> None:
    paths = {field.path for field in LIMITED}
    assert {
        "cavity.length_mm",
        "elastomer.youngs_modulus_mpa",
        "layout.0.count",
        "layout.0.pitch_mm",
    } <= paths
    assert len(LIMITED) == 86


def test_every_number_has_limits_but_those_that_the_board_limits() -> None:
    assert unlimited_fields() == ["board.adc_prescaler"]


@for_each(LIMITED)
def test_a_value_just_below_its_limit_is_refused_with_field_value_and_limit(field: NumericField) -> None:
    below, _ = field.outside
    low, _ = field.shown_limits
    with pytest.raises(DesignError) as caught:
        changed(field.path, below)
    line = next(line for line in str(caught.value).splitlines() if line.strip().startswith(f"{field.path}:"))
    assert repr(below) in line
    assert f"must be {'at least' if field.above is None else 'above'} {low}" in line


@for_each(LIMITED)
def test_a_value_just_above_its_limit_is_refused_with_field_value_and_limit(field: NumericField) -> None:
    _, above = field.outside
    _, high = field.shown_limits
    with pytest.raises(DesignError) as caught:
        changed(field.path, above)
    line = next(line for line in str(caught.value).splitlines() if line.strip().startswith(f"{field.path}:"))
    assert repr(above) in line
    assert f"must be {'at most' if field.below is None else 'below'} {high}" in line


def attribute_at(design: Any, path: str) -> Any:
    """The value at a dotted path of a design, options at their default included."""
    for key in path.split("."):
        design = design[int(key)] if isinstance(design, tuple) else getattr(design, key)
    return design


@for_each(LIMITED)
def test_both_limits_themselves_are_accepted(field: NumericField) -> None:
    for value in field.bounds:
        assert attribute_at(changed(field.path, value), field.path) == value


def test_a_design_is_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        good().cavity.length_mm = 10.0  # type: ignore[misc]


def test_with_changes_a_copy_and_leaves_the_original() -> None:
    design = good()
    thicker = design.with_(**{"cavity.clear_thickness_mm": 10})
    assert thicker.cavity.clear_thickness_mm == 10.0
    assert design.cavity.clear_thickness_mm == 8.0
    assert thicker.digest != design.digest
    assert thicker.with_(**{"cavity.clear_thickness_mm": 8}).digest == design.digest


def test_a_design_without_the_viscoelastic_option_has_no_word_of_it() -> None:
    absent = good(**{"elastomer.viscoelastic": None})
    assert "viscoelastic" not in json.dumps(absent.model_dump(mode="json"))
    assert absent.digest == from_text(design_text(NO_OPTION)).digest
    assert absent.digest != good().digest


def test_with_an_unknown_path_offers_the_nearest_names() -> None:
    with pytest.raises(
        DesignError, match=r"cavity\.clear_thicknes_mm: .* did you mean cavity\.clear_thickness_mm"
    ):
        good().with_(**{"cavity.clear_thicknes_mm": 10})


def test_with_a_bad_value_names_design_field_value_and_limit() -> None:
    with pytest.raises(DesignError) as caught:
        good().with_(**{"cavity.clear_thickness_mm": 0.5})
    assert "usable design" in str(caught.value)
    assert says(str(caught.value), "cavity.clear_thickness_mm: 0.5 ... least 1 mm")


def test_measured_names_values_that_the_design_has() -> None:
    assert good(measured=["emitters.height_mm", "layout.0.parts_per_side"]).measured == (
        "emitters.height_mm",
        "layout.0.parts_per_side",
    )
    with pytest.raises(DesignError, match=r"measured: elastomer\.refractive_index: no such field"):
        good(measured=["elastomer.refractive_index"])  # not given in this design
    assert good(measured=["elastomer.refractive_index"], **{"elastomer.refractive_index": 1.41}).measured


def test_a_digest_ignores_comments_order_and_number_format() -> None:
    plain = from_text(design_text())
    reordered = "\n".join(
        [
            "# a comment",
            "name = 'bad'  # another",
            "schema_version = 0x1",
            "layout = [{parts_per_side = 4, pattern = 'alternating_ring'}]",
            "receivers = {height_mm = 6, part = 'osram-sfh206k'}",
            "emitters = {height_mm = 5e0, part = 'sunled-xscwd23mb'}",
            "elastomer.viscoelastic = {time_constant_s = 5, relaxed_share = 2e-1}",
            "elastomer.mixing_ratio = 20",
            "mold = {outer_width_mm = 45, outer_length_mm = 4.5e1}",
            "cavity = {clear_thickness_mm = 8, width_mm = 32, length_mm = 3_2.0}",
        ]
    )
    assert from_text(reordered).digest == plain.digest
    assert from_text(reordered) == plain


def test_a_digest_does_not_tell_a_default_from_the_same_value_spelt_out() -> None:
    assert from_text(design_text({"cavity.black_thickness_mm": "1.0"})).digest == good().digest


FULL: dict[str, Any] = {
    "elastomer.refractive_index": 1.41,
    "elastomer.absorption_db_per_cm": 0.3,
    "elastomer.youngs_modulus_mpa": 1.1,
    "board.emitter_pins": [22, 23],
    "board.receiver_channels": ["A0", "A1"],
    "measured": ["emitters.height_mm"],
    "part_measurements": {"osram-sfh206k": {"active_width_mm": 2.6}},
    "layout": [
        {"pattern": "alternating_ring", "parts_per_side": [1, 1, 1, 1], "pitch_mm": 7.0},
        {"pattern": "facing_rows", "count": 2, "pitch_mm": 7.0},
        {
            "pattern": "per_side",
            "kind": "emitter",
            "south": 2,
            "part": "a",
            "height_mm": 2.0,
            "pitch_mm": 7.0,
        },
        {
            "pattern": "single",
            "kind": "emitter",
            "wall": "north",
            "along_mm": 3.0,
            "part": "a",
            "height_mm": 2.0,
            "name": "X",
        },
    ],
    "catalog.mold_materials": {
        "mine": {
            "title": "Mine",
            "wall_reflectance": {
                "value": 0.05,
                "unit": "1",
                "source": "s",
                "confidence": "read",
                "low": 0.01,
                "high": 0.9,
            },
            "density_g_per_cm3": {"value": 1.0, "unit": "g/cm3", "source": "s", "confidence": "read"},
            "notes": ["a note"],
        }
    },
}
FULL_DOCUMENT = good(**FULL).model_dump(mode="json")
FIXED = ("schema_version", "pattern", "unit")
"""Leaves that have one value only, or that change a table's form."""
OTHER_WORDS = ("south", "west", "emitter", "receiver", "measured", "cavity.length_mm", "x-other")


def other_values(value: Any) -> list[Any]:
    """Values unlike the given one, of which at least one suits the same field."""
    if isinstance(value, bool) or value is None:
        return [1, 1.5, "x"]
    if isinstance(value, int):
        return [value + 1, value + 2]
    if isinstance(value, float):
        return [value * (1 + 1e-12) if value else 1e-12]
    return [word for word in OTHER_WORDS if word != value]


def changed_leaf(path: str, value: Any) -> SensorDesign:
    """The full design with one leaf changed to some value that its field accepts."""
    refused = []
    for other in other_values(value):
        document = json.loads(json.dumps(FULL_DOCUMENT))
        set_at(document, path, other, known=(path,))
        if path.startswith("layout.0.parts_per_side."):
            document["layout"][0]["parts_per_side"][0] += 1  # the sum stays even
        try:
            return SensorDesign.from_document(document, where=path)
        except DesignError as err:
            refused.append(str(err))
    raise AssertionError(refused)


LEAVES = [(path, value) for path, value in leaves(FULL_DOCUMENT) if path.split(".")[-1] not in FIXED]


@for_each(LEAVES)
def test_a_digest_changes_with_every_field(path: str, value: Any) -> None:
    full = SensorDesign.from_document(FULL_DOCUMENT, where="full")
    assert changed_leaf(path, value).digest != full.digest


@settings(max_examples=25)
@given(designs())
def test_any_design_survives_its_text(design: SensorDesign) -> None:
    again = from_text(dump_design(design))
    assert again == design
    assert again.digest == design.digest


@settings(max_examples=15)
@given(designs(), st.randoms(use_true_random=False))
def test_a_digest_does_not_depend_on_the_order_of_keys(design: SensorDesign, order: Any) -> None:
    def shuffled(document: Any) -> Any:
        if isinstance(document, dict):
            keys = list(document)
            order.shuffle(keys)
            return {key: shuffled(document[key]) for key in keys}
        return [shuffled(item) for item in document] if isinstance(document, list) else document

    document = shuffled(design.model_dump(mode="json"))
    assert SensorDesign.from_document(document, where="shuffled").digest == design.digest


def test_plain_data_goes_in_and_comes_out() -> None:
    design = SensorDesign.from_document(good_document(), where="good")
    assert SensorDesign.from_document(design.model_dump(mode="json"), where="again") == design


def test_a_digest_is_64_hexadecimal_digits_and_stays() -> None:
    design = good()
    assert len(design.digest) == 64
    assert int(design.digest, 16) >= 0
    assert design.digest == good().digest == design.digest


def test_with_takes_several_paths_at_once() -> None:
    design = good().with_(**{"layout.0.parts_per_side": 2, "board.frame_rate_hz": 30})
    assert design.layout[0].parts_per_side == 2  # type: ignore[union-attr]
    assert design.board.frame_rate_hz == 30.0


def test_with_sets_the_first_measurement_of_a_part() -> None:
    design = good().with_(**{"part_measurements.osram-sfh206k.active_width_mm": 2.6})
    assert design.part_measurements == {"osram-sfh206k": {"active_width_mm": 2.6}}


def test_with_fills_an_optional_table_that_was_absent() -> None:
    design = good(**{"elastomer.viscoelastic": None})
    assert design.elastomer.viscoelastic is None
    changes = {"elastomer.viscoelastic.relaxed_share": 0.3, "elastomer.viscoelastic.time_constant_s": 2.0}
    assert design.with_(**changes).elastomer.viscoelastic == Viscoelastic(
        relaxed_share=0.3, time_constant_s=2.0
    )
    with pytest.raises(DesignError, match=r"elastomer\.viscoelastic\.time_constant_s: is missing"):
        design.with_(**{"elastomer.viscoelastic.relaxed_share": 0.3})


PAIR = preset("piacenza2017-pair")


def by_path(design):
    return {one.path: one for one in build_tolerances(design)}


@pytest.mark.parametrize("name", PRESETS)
def test_every_tolerance_has_a_source_and_holds_its_value(name):
    design = preset(name)
    found = build_tolerances(design)
    in_walls = {"emitters.height_mm", "receivers.height_mm"} if name not in FLOOR_PRESETS else set()
    assert in_walls | {"cavity.clear_thickness_mm"} <= set(by_path(design))
    for one in found:
        assert one.low <= one.value <= one.high
        assert one.low < one.high
        assert len(one.source) > 20


@pytest.mark.parametrize("name", PRESETS)
def test_every_end_is_a_design(name):
    design = preset(name)
    for one in build_tolerances(design):
        for end in (one.low, one.high):
            assert get_at(design.with_(**{one.path: end}).model_dump(), one.path) == pytest.approx(
                end, abs=1e-12
            )


def test_a_measured_value_varies_no_more():
    measured = PAIR.with_(measured=["emitters.height_mm", "cavity.clear_thickness_mm"])
    assert set(by_path(PAIR)) - set(by_path(measured)) == {"emitters.height_mm", "cavity.clear_thickness_mm"}


def test_the_design_replaces_a_default_and_a_band():
    given = {
        "cavity.clear_thickness_mm": 0.05,
        "emitters.height_mm": 0.1,
        "elastomer.absorption_db_per_cm": 0.0,
    }
    found = by_path(PAIR.with_(tolerances=given))
    thickness, height = found["cavity.clear_thickness_mm"], found["emitters.height_mm"]
    assert (thickness.low, thickness.high, thickness.origin) == (7.95, 8.05, "given in the design")
    assert (height.low, height.high, height.unit) == (4.9, 5.1, "mm")
    assert "elastomer.absorption_db_per_cm" not in found  # 0 is exact


def test_a_field_without_a_default_can_be_given_one():
    found = by_path(PAIR.with_(tolerances={"layout.0.pitch_mm": 0.1}))
    assert (found["layout.0.pitch_mm"].low, found["layout.0.pitch_mm"].unit) == (pytest.approx(6.25), "mm")


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("cavity.clear_thicknes_mm", "did you mean cavity.clear_thickness_mm"),
        ("emitters.part", "is no number"),
        ("cavity", "no such field"),
    ],
)
def test_a_tolerance_of_no_number_is_refused(path, words):
    with pytest.raises(DesignError, match=words):
        build_tolerances(PAIR.with_(tolerances={path: 0.1}))


def test_tolerances_survive_the_file_and_absent_ones_leave_the_digest(tmp_path):
    given = PAIR.with_(tolerances={"cavity.clear_thickness_mm": 0.05})
    (tmp_path / "mine.toml").write_text(dump_design(given), encoding="utf-8")
    assert load_design(tmp_path / "mine.toml").digest == given.digest
    assert given.digest != PAIR.digest
    assert "tolerances" not in PAIR.model_dump(mode="json")


@pytest.mark.parametrize(
    ("path", "near"), [("emitters.hight_mm", "emitters.height_mm"), ("name", "no number")]
)
def test_a_check_names_a_tolerance_of_nothing(path, near):
    found, *_ = check(PAIR.with_(tolerances={path: 0.05}))
    assert (found.severity, found.field) == ("error", f"tolerances.{path}")
    assert near in str(found)
