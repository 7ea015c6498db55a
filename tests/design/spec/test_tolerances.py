"""What may be off on a build: open values, making, and what the design itself says."""

import pytest

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at
from optopad.design.io import dump_design, load_design
from optopad.design.preset import PRESETS, preset
from optopad.design.rules.check import check
from optopad.design.spec.tolerances import build_tolerances

PAIR = preset("piacenza2017-pair")


def by_path(design):
    return {one.path: one for one in build_tolerances(design)}


@pytest.mark.parametrize("name", PRESETS)
def test_every_tolerance_has_a_source_and_holds_its_value(name):
    found = build_tolerances(preset(name))
    assert {"emitters.height_mm", "receivers.height_mm", "cavity.clear_thickness_mm"} <= set(
        by_path(preset(name))
    )
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
