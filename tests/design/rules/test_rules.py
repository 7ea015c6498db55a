"""Each rule fires on its own fault, with the number, the limit and the way out, and on nothing else."""

from __future__ import annotations

import re

import pytest

from optopad.design.draft import Draft
from optopad.design.errors import DesignError, ModelScopeError
from optopad.design.fields.finding import OUT_OF_SCOPE
from optopad.design.preset import preset
from optopad.design.rules.check import check, require_scope, require_valid
from optopad.design.rules.light import deepest_modelled_mm
from optopad.design.spec import SensorDesign
from tests.design.rules.rule_cases import BENCHMARK, about, and_more, facing, only, single
from tests.design.spec.spec_fields import good, with_layout


def test_a_sound_design_has_no_findings() -> None:
    assert check(good()) == ()
    assert check(with_layout(facing(), **BENCHMARK)) == ()
    assert check(and_more()) == ()
    require_valid(good())


def test_a_finding_is_one_line_with_field_value_limit_and_way_out() -> None:
    finding = only(good(**{"operating.max_depth_mm": 8.1}))
    line = str(finding)
    assert "\n" not in line
    for words in (finding.field, finding.value, finding.limit, finding.message, finding.way_out):
        assert words
        assert words in line


def test_all_findings_come_at_once_errors_first() -> None:
    design = good(
        **{
            "elastomer.material": "no-gel",
            "board.adc_prescaler": 63,
            "board.baud": 115200,
            "receivers.height_mm": 9.0,
            "operating.workspace_margin_mm": 14.0,
            "mold.fixing_hole_inset_mm": 1.0,
            "mold.rim_mm": 0.0,
        }
    )
    findings = check(design)
    severities = [finding.severity for finding in findings]
    assert severities == sorted(severities)  # "error" before "warning"
    assert {finding.field for finding in findings} == {
        "elastomer.material",
        "board.adc_prescaler",
        "board.baud",
        "receivers.height_mm",
        "operating.workspace_margin_mm",
        "mold.fixing_hole_inset_mm",
    }
    with pytest.raises(DesignError) as caught:
        require_valid(design)
    assert str(caught.value).splitlines()[1:] == [f"  {f}" for f in findings if f.severity == "error"]


def test_warnings_do_not_refuse_a_design() -> None:
    design = good(**{"board.baud": 115200})
    assert only(design).severity == "warning"
    require_valid(design)


# --- light ---------------------------------------------------------------------------------------


def test_an_area_above_the_surface_is_a_warning_with_the_lost_share() -> None:
    finding = about(good(**{"emitters.height_mm": 7.5}), "above the surface")
    assert finding.severity == "warning"
    assert finding.field == "emitters.height_mm"
    assert "cuts off 25%" in finding.message  # 6.5 to 8.5 mm in a layer of 8 mm


def test_an_area_whose_centre_is_at_the_surface_is_a_warning_and_above_it_an_error() -> None:
    assert "cuts off 50%" in about(good(**{"emitters.height_mm": 8.0}), "above the surface").message
    finding = about(good(**{"emitters.height_mm": 8.01}), "centre of the emitting area")
    assert (finding.severity, finding.value) == ("error", "8.01 mm")


def test_an_area_below_the_clear_layer_is_an_error() -> None:
    assert check(with_layout(facing(), **BENCHMARK, **{"receivers.height_mm": 1.325})) == ()
    finding = only(with_layout(facing(), **BENCHMARK, **{"receivers.height_mm": 1.225}))
    assert (finding.severity, finding.value) == ("error", "its lower edge at -0.10 mm")


def test_a_heated_mixture_outside_the_table_names_the_way_out() -> None:
    finding = about(good(**{"elastomer.mixing_ratio": 34.0}), "refractive index")
    assert (finding.severity, finding.field) == ("error", "elastomer.mixing_ratio")
    assert "not at 34" in finding.message
    assert "elastomer.refractive_index" in finding.way_out
    measured = {"elastomer.refractive_index": 1.41, "elastomer.youngs_modulus_mpa": 0.6}
    assert check(good(**{"elastomer.mixing_ratio": 34.0, **measured})) == ()


def test_a_wavelength_outside_the_table_is_an_error_unless_the_index_is_given() -> None:
    infrared = {"part_measurements.sunled-xscwd23mb.wavelength_nm": 1550.0}
    finding = about(good(**infrared), "refractive index")
    assert (finding.severity, finding.field) == ("error", "emitters.part")
    assert "1.55" in finding.message
    assert check(good(**infrared, **{"elastomer.refractive_index": 1.4})) == ()


def test_emitters_of_two_colours_are_a_warning() -> None:
    blue = {"part_measurements.generic-emitter.wavelength_nm": 470.0}
    design = and_more(single("emitter", "south", 16.0, part="sunled-xscwd23mb"), **blue)
    finding = only(design)
    assert (finding.severity, finding.field, finding.value, finding.limit) == (
        "warning",
        "layout.3",
        "550 nm",
        "470 nm",
    )


def test_no_pair_with_a_direct_path_is_an_error() -> None:
    design = with_layout(single("emitter", "south", 8.0), single("receiver", "south", 20.0), **BENCHMARK)
    assert "direct path" in only(design).message


def test_one_wall_of_emitters_is_a_warning_but_not_in_facing_rows() -> None:
    design = with_layout(
        single("emitter", "south", 16.0),
        single("receiver", "north", 16.0),
        single("receiver", "east", 16.0),
        **BENCHMARK,
    )
    finding = only(design)
    assert (finding.severity, finding.value) == ("warning", "all emitters on the south wall")
    assert check(with_layout(facing(), **BENCHMARK)) == ()


def test_65_emitters_are_too_many_and_64_are_not() -> None:
    def crowd(west: int) -> SensorDesign:
        counts = {"south": 16, "east": 16, "north": 16, "west": west}
        return with_layout(
            {"pattern": "per_side", "kind": "emitter", **counts},
            single("receiver", "south", 16.0),
            **BENCHMARK,
        )

    assert about(crowd(17), "too many emitters").value == "65"
    assert not any("too many" in finding.message for finding in check(crowd(16)))


def test_a_name_given_twice_is_an_error() -> None:
    finding = only(and_more(single("emitter", "south", 16.0, name="E2")))
    assert (finding.field, finding.value) == ("layout.3", "E2")


# --- range of use --------------------------------------------------------------------------------


def test_an_empty_workspace_is_an_error_and_a_single_point_is_not() -> None:
    assert "no location is left" in only(good(**{"operating.workspace_margin_mm": 13.01})).message
    assert only(good(**{"operating.workspace_margin_mm": 13.0})).severity == "warning"


def test_a_tip_wider_than_its_workspace_is_a_warning() -> None:
    assert check(good(**{"operating.workspace_margin_mm": 10.0})) == ()  # 6 mm of workspace, 6 mm of tip
    finding = only(good(**{"operating.workspace_margin_mm": 10.1}))
    assert (finding.severity, finding.field) == ("warning", "indenter.tip_radius_mm")


def test_facing_pairs_outside_the_workspace_are_a_warning_with_the_shift() -> None:
    finding = only(with_layout(facing(3, 12.0), **BENCHMARK))  # at 4, 16 and 28; workspace 6 to 26
    assert finding.severity == "warning"
    assert finding.message.startswith("E1-R1, E3-R3 are judged")
    assert finding.value == "2.00 mm from the chord"


@pytest.mark.parametrize(
    ("clear_mm", "radius_mm", "deepest_mm"), [(8.0, 3.0, 5.1), (4.0, 3.0, 4.0), (8.0, 20.0, 7.2)]
)
def test_the_contact_model_reaches_the_lesser_of_two_depths(
    clear_mm: float, radius_mm: float, deepest_mm: float
) -> None:
    design = good(**{"cavity.clear_thickness_mm": clear_mm, "indenter.tip_radius_mm": radius_mm})
    assert deepest_modelled_mm(Draft(design)) == pytest.approx(deepest_mm, rel=1e-12)


def test_a_press_beyond_the_contact_model_is_a_warning_that_names_the_verdict() -> None:
    assert check(good(**{"operating.max_depth_mm": 5.1})) == ()
    finding = only(good(**{"operating.max_depth_mm": 5.2}))
    assert finding.severity == "warning"
    assert "OUT_OF_MODEL_SCOPE" in finding.message
    assert finding.limit.startswith("at most 5.10 mm")


def test_a_press_beyond_the_clear_layer_is_an_error() -> None:
    assert only(good(**{"operating.max_depth_mm": 7.9})).severity == "warning"
    finding = only(good(**{"operating.max_depth_mm": 8.0}))
    assert (finding.severity, finding.value) == ("error", "8 mm")


def test_a_press_on_which_no_verdict_is_possible_is_refused_before_any_work() -> None:
    short = good(**{"operating.max_depth_mm": 0.29})
    assert only(short).weight == OUT_OF_SCOPE
    with pytest.raises(
        ModelScopeError, match=r"max_depth_mm: .* \(0\.29 mm; needs at least 0\.3 mm\); raise it$"
    ):
        require_scope(short)
    require_scope(good(**{"operating.max_depth_mm": 0.3}))
    dome = preset("fingertip-dome")
    for changes, field in (
        ({"indenter.shape": "cone"}, "indenter.shape"),
        ({"crown.radius_mm": 13.0, "cavity.clear_thickness_mm": 11.0}, "crown.radius_mm"),
    ):
        assert [one.field for one in check(dome.with_(**changes)) if one.weight == OUT_OF_SCOPE] == [field]


def test_a_length_that_nothing_can_make_is_a_warning() -> None:
    found = check(good(**{"mold.rim_mm": 1.51, "operating.workspace_margin_mm": 0.003}))
    finding = next(one for one in found if "metres" in one.way_out)
    assert (finding.severity, finding.field, finding.value) == (
        "warning",
        "operating.workspace_margin_mm",
        "0.003 mm",
    )


def test_presses_nearer_to_a_wall_than_the_contact_model_are_a_warning() -> None:
    finding = only(good(**{"operating.workspace_margin_mm": 1.55}))
    assert (finding.severity, finding.value) == ("warning", "1.55 mm")
    assert finding.limit.startswith("at least 1.60 mm")
    assert "OUT_OF_MODEL_SCOPE" in finding.message
    assert check(good(**{"operating.workspace_margin_mm": 1.6})) == ()


# --- references ----------------------------------------------------------------------------------


def test_every_unknown_name_is_reported_once_where_it_stands() -> None:
    design = with_layout(
        facing(),
        single("emitter", "south", 8.0, part="no-led"),
        single("emitter", "south", 16.0, part="osram-sfh206k"),
        **{"mold.material": "no-abs", "board.kind": "no-board", "elastomer.material": "no-gel"},
    )
    assert [finding.field for finding in check(design)] == [
        "layout.1.part",
        "layout.2.part",
        "elastomer.material",
        "mold.material",
        "board.kind",
    ]


@pytest.mark.parametrize(
    ("path", "name", "nearest"),
    [
        ("emitters.part", "sunled-xscwd23", "sunled-xscwd23mb"),
        ("receivers.part", "osram-sfh206", "osram-sfh206k"),
        ("elastomer.material", "sylgard", "sylgard-184"),
        ("mold.material", "black-abs", "abs-black"),
        ("board.kind", "mega-2560", "arduino-mega-2560"),
    ],
)
def test_an_unknown_name_offers_the_nearest(path: str, name: str, nearest: str) -> None:
    finding = only(good(**{path: name}))
    assert (finding.severity, finding.field, finding.value) == ("error", path, repr(name))
    assert nearest in finding.way_out


def test_an_unknown_part_of_every_emitter_does_not_hide_the_boards_faults() -> None:
    design = good(**{"emitters.part": "no-led", "board.adc_prescaler": 63})
    assert {finding.field for finding in check(design)} == {"emitters.part", "board.adc_prescaler"}


def test_no_finding_uses_a_number_that_is_not_one() -> None:
    for design in (good(), with_layout(facing(8, 4.0)), good(**{"mold.outer_length_mm": 10.0})):
        for finding in check(design):
            assert not re.search(r"\b(nan|inf|None)\b", str(finding))


def words_about(field, **changes):
    return [str(one) for one in check(preset("piacenza2017-pad").with_(**changes)) if one.field == field]


@pytest.mark.parametrize(
    ("thickness_mm", "said"),
    [
        (1.9, "outside the contact model"),
        (2.0, "outside the contact library"),
        (2.8, "outside the contact library"),
        (2.9, None),
        (17.0, None),
        (17.1, "outside the contact library"),
        (29.0, "outside the contact library"),
        (29.1, "outside the contact model"),
    ],
)
def test_a_layer_outside_library_or_model_is_told(thickness_mm, said):
    # 1 mm of black layer and a 3 mm tip: the library holds elastic depths of 3.9 to 18 mm, the model 3 to 30 mm
    found = " ".join(words_about("cavity.clear_thickness_mm", **{"cavity.clear_thickness_mm": thickness_mm}))
    for text in ("outside the contact model", "outside the contact library"):
        assert (text in found) == (text == said)
