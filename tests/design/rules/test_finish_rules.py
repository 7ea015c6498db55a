"""Finish of walls, patterns and epoxy: absent they change nothing, given they are checked and told."""

import pytest

from optopad.design.errors import DesignError
from optopad.design.fields.finding import Finding
from optopad.design.io import dump_design, load_design
from optopad.design.parts.catalog import parse_entries
from optopad.design.rules.check import check
from optopad.design.spec.properties import part_of, refractive_index, used_values, wall_index
from tests.design.parts.own_parts import SHEET, own_part, quantity, with_own_part
from tests.design.spec.spec_fields import good

FLAT = {"angle_deg": [0.0, 45.0, 90.0], "relative": [1.0, 0.7, 0.0], **SHEET}
NARROW = {"angle_deg": [0.0, 20.0, 40.0], "relative": [1.0, 0.4, 0.0], **SHEET}


def about_field(design, field) -> list[Finding]:
    return [finding for finding in check(design) if finding.field == field]


def paths_used(design):
    return {used.path: used.quantity for used in used_values(design)}


def test_a_design_without_the_options_says_nothing_of_them():
    document = good().model_dump(mode="json")
    assert not {"wall_finish", "wall_index"} & set(document["surfaces"])
    assert good(**{"surfaces.wall_finish": "diffuse"}).digest == good().digest
    part = with_own_part("emitter").model_dump(mode="json")["catalog"]["parts"]["mine"]
    assert not {"angular_pattern", "spectrum", "epoxy_index", "angular_response"} & set(part)
    assert wall_index(good()) is None


def test_a_given_finish_changes_the_digest_and_survives_a_file(tmp_path):
    design = good(**{"surfaces.wall_finish": "glossy", "surfaces.wall_index": 1.5})
    assert design.digest != good().digest
    (tmp_path / "d.toml").write_text(dump_design(design), encoding="utf-8")
    assert load_design(tmp_path / "d.toml") == design


def test_own_tables_survive_a_file(tmp_path):
    design = with_own_part("receiver", epoxy_index=quantity(1.53, "1"), angular_response=FLAT)
    (tmp_path / "d.toml").write_text(dump_design(design), encoding="utf-8")
    assert load_design(tmp_path / "d.toml").digest == design.digest


def test_glossy_walls_have_the_materials_index_until_one_is_given():
    glossy = good(**{"surfaces.wall_finish": "glossy"})
    assert (wall_index(glossy).value, wall_index(glossy).confidence) == (1.54, "unverified")
    given = glossy.with_(**{"surfaces.wall_index": 1.49})
    assert (wall_index(given).value, wall_index(given).confidence) == (1.49, "measured")
    assert paths_used(glossy)["surfaces.wall_index"].low == 1.5
    assert "surfaces.wall_index" not in paths_used(good())


def test_an_air_gap_has_the_index_of_air():
    assert wall_index(good(**{"surfaces.wall_finish": "air_gap"})).value == 1.0


@pytest.mark.parametrize("finish", ["glossy", "air_gap"])
def test_walls_that_mirror_are_told_to_cost_time(finish):
    (finding,) = about_field(good(**{"surfaces.wall_finish": finish}), "surfaces.wall_finish")
    assert finding.severity == "warning"
    assert "traced" in finding.message


@pytest.mark.parametrize("finish", ["diffuse", "air_gap"])
def test_an_index_that_has_no_use_is_an_error(finish):
    changes = {"surfaces.wall_finish": finish, "surfaces.wall_index": 1.5}
    (finding,) = about_field(good(**changes), "surfaces.wall_index")
    assert (finding.severity, finding.value) == ("error", "1.5")


def test_a_glossy_material_without_an_index_is_an_error_with_the_way_out():
    material = {"title": "Mine", "wall_reflectance": quantity(0.1, "1")}
    material["density_g_per_cm3"] = quantity(1.1, "g/cm3")
    changes = {"catalog": {"mold_materials": {"mine": material}}, "mold.material": "mine"}
    assert about_field(good(**changes), "surfaces.wall_index") == []
    (finding,) = about_field(good(**changes, **{"surfaces.wall_finish": "glossy"}), "surfaces.wall_index")
    assert finding.severity == "error"
    assert "give surfaces.wall_index" in finding.way_out


def test_a_pattern_takes_the_half_angles_place_among_the_values_in_use():
    assert "part_measurements.mine.half_angle_deg" in paths_used(with_own_part("emitter"))
    used = paths_used(with_own_part("emitter", angular_pattern=FLAT))
    assert "part_measurements.mine.half_angle_deg" not in used
    assert used["catalog.parts.mine.angular_pattern"].confidence == "read"


def test_a_receivers_angles_are_in_use_only_behind_epoxy():
    assert not {name for name in paths_used(with_own_part("receiver")) if "mine.half" in name}
    behind = paths_used(with_own_part("receiver", epoxy_index=quantity(1.53, "1")))
    assert {"part_measurements.mine.epoxy_index", "part_measurements.mine.half_angle_deg"} <= set(behind)
    table = paths_used(with_own_part("receiver", epoxy_index=quantity(1.53, "1"), angular_response=FLAT))
    assert "part_measurements.mine.half_angle_deg" not in table
    assert "catalog.parts.mine.angular_response" in table


def test_epoxy_can_be_measured_on_a_packaged_part():
    design = good(part_measurements={"osram-sfh206k": {"epoxy_index": 1.53}})
    assert part_of(design, "osram-sfh206k", "receiver").epoxy_index.value == 1.53
    with pytest.raises(DesignError, match=r"0\.9 1 is out of range"):
        part_of(good(part_measurements={"osram-sfh206k": {"epoxy_index": 0.9}}), "osram-sfh206k", "receiver")
    with pytest.raises(DesignError, match="has no such value"):
        part_of(
            good(part_measurements={"generic-emitter": {"epoxy_index": 1.5}}), "generic-emitter", "emitter"
        )


def test_packaged_parts_are_bare_because_no_sheet_gives_their_epoxy():
    assert part_of(good(), "osram-sfh206k", "receiver").epoxy_index is None


def test_a_lens_in_elastomer_is_told():
    assert not [f for f in check(with_own_part("receiver", angular_pattern=None)) if "lens" in f.message]
    design = with_own_part("receiver", epoxy_index=quantity(1.53, "1"), half_angle_deg=quantity(20.0, "deg"))
    assert [f.value for f in check(design) if "lens" in f.message] == ["20 deg"]
    assert [f for f in check(with_own_part("emitter", angular_pattern=NARROW)) if "lens" in f.message]


def sized(width_mm, depth_mm, height_mm, half_deg=15.0, **more):
    """An own LED of a size."""
    sizes = {"body_width_mm": width_mm, "body_depth_mm": depth_mm, "body_height_mm": height_mm}
    lengths = {name: quantity(value, "mm") for name, value in sizes.items()}
    middle = quantity(height_mm / 2, "mm")
    angle = quantity(half_deg, "deg")
    options = {"mounting": "radial", **lengths, **more}
    return with_own_part("emitter", active_height_in_body_mm=middle, half_angle_deg=angle, **options)


@pytest.mark.parametrize(
    ("size", "way_out"),
    [
        ((5.0, 5.0, 8.6), "body_depth_mm = 8.6, body_height_mm = 5"),  # upright: its light leaves upward
        ((5.8, 8.6, 5.8), "mounting = 'surface'"),  # lying: its leads leave through the back
        ((3.0, 3.0, 5.3), "body_depth_mm = 5.3"),
    ],
)
def test_a_radial_led_whose_light_goes_the_wrong_way_is_an_error(size, way_out):
    field = "catalog.parts.mine.mounting"
    for half_deg in (15.0, 60.0):
        (finding,) = about_field(sized(*size, half_deg), field)
        assert finding.severity == "error"
        assert way_out in finding.way_out
        assert "optopad part new" in finding.way_out
    assert about_field(sized(*size, view="side"), field) == []


def test_a_flat_side_looking_body_and_a_round_one_on_its_side_are_no_error():
    field = "catalog.parts.mine.mounting"
    assert about_field(with_own_part("receiver"), field) == []
    assert about_field(sized(5.1, 4.1, 6.9), field) == []
    assert about_field(sized(5.8, 6.1, 5.8, mounting="surface"), field) == []
    assert about_field(sized(5.0, 5.0, 8.6, 60.0, mounting="surface"), field) == []  # no lens: any block
    assert [f.severity for f in about_field(sized(5.0, 5.0, 8.6, mounting="surface"), field)] == ["error"]


def test_a_part_that_sends_its_light_upward_by_its_own_words_is_refused():
    with pytest.raises(DesignError, match=r"mounting = 'radial' with view = 'top'.*surface"):
        sized(5.0, 5.0, 8.6, view="top")


def test_a_table_that_ends_early_is_told():
    design = with_own_part("emitter", angular_pattern=NARROW)
    assert [f.value for f in check(design) if "ends early" in f.message] == ["40 deg"]
    assert not [f for f in check(with_own_part("emitter", angular_pattern=FLAT)) if "ends early" in f.message]


def test_emitters_of_two_spectra_are_told():
    flat = {"wavelength_nm": [450.0, 650.0], "weight": [1.0, 1.0], **SHEET}
    parts = {"parts": {"mine": own_part("emitter", spectrum=flat)}}
    base = good().model_dump(mode="json")["layout"]
    more = {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 16.0, "part": "mine"}
    design = good(catalog=parts, layout=[*base, more], **{"emitters.part": "generic-emitter"})
    assert [f.limit for f in check(design) if "another spectrum" in f.message] == ["550 nm"]
    assert refractive_index(design) == refractive_index(good(**{"emitters.part": "generic-emitter"}))


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("receiver", {"angular_response": FLAT}, "needs epoxy_index"),
        ("receiver", {"angular_pattern": FLAT}, "has no angular_pattern"),
        ("emitter", {"epoxy_index": quantity(1.5, "1")}, "has no epoxy_index"),
        ("emitter", {"angular_response": FLAT}, "has no angular_response"),
        (
            "receiver",
            {"spectrum": {"wavelength_nm": [450, 500], "weight": [1, 1], **SHEET}},
            "has no spectrum",
        ),
        ("receiver", {"epoxy_index": quantity(1.5, "mm")}, "this field is in '1'"),
        ("receiver", {"epoxy_index": quantity(0.5, "1")}, "must be from 1 to 2.5"),
        (
            "receiver",
            {"epoxy_index": quantity(1.5, "1"), "angular_response": FLAT | {"relative": [0.0, 1.0, 0.0]}},
            "is 0 on the axis",
        ),
        ("emitter", {"angular_pattern": FLAT | {"relative": [1.0, 0.5]}}, "they pair up"),
        ("emitter", {"angular_pattern": {"angle_deg": [0, 90], "relative": [1, 0]}}, "source: is missing"),
    ],
)
def test_options_of_the_wrong_kind_or_form_are_refused_by_name(kind, options, message):
    with pytest.raises(DesignError, match=message):
        parse_entries({"parts": {"mine": own_part(kind, **options)}}, "mine.toml")
