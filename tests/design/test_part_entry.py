"""Entries from the data sheets of three LEDs and two photodiodes, and the sockets that they fit into."""

import tomllib

import pytest

from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.part_entry import LedSheet, PhotodiodeSheet, packages, part_entry
from optopad.design.parts.catalog import packaged, parse_entries
from optopad.design.parts.photometry import Intensity
from optopad.design.rules.check import check
from optopad.design.rules.mold import housing_notes
from optopad.design.shape.cavity import cavity_of
from tests.design.spec.spec_fields import good
from tests.said import says

ROUND = {"package": "radial-5mm", "manufacturer": "Cree", "half_angle_deg": 15.0, "current_ma": 20.0}
LEDS = {
    "red": LedSheet(
        **ROUND,
        part_id="cree-lc503uhr1",
        source="data sheet CLD-CT011.000 (2007)",
        intensity=Intensity(value=5100.0, unit="mcd"),
        wavelength_nm=624.0,
        forward_voltage_v=2.1,
        max_current_ma=50.0,
    ),
    "blue": LedSheet(
        **ROUND,
        part_id="cree-lc503tbl1",
        source="data sheet CLD-CT063.000",
        intensity=Intensity(value=2100.0, unit="mcd"),
        wavelength_nm=470.0,
        forward_voltage_v=3.4,
    ),
    "white": LedSheet(
        **ROUND | {"half_angle_deg": 30.0},
        part_id="cree-lc513fwh1",
        source="data sheet CLD-CT208.001",
        intensity=Intensity(value=4000.0, unit="mcd"),
        wavelength_nm=None,
        forward_voltage_v=3.2,
    ),
}
"""Typical values of the sheets, read at dtsheet.com, pdf.datasheet.world and xonelec.com."""
SFH206K = PhotodiodeSheet(
    part_id="my-sfh206k",
    package="side-looking-5mm",
    source="data sheet SFH 206 K v1.3 (2018)",
    half_angle_deg=60.0,
    area_mm=(2.65, 2.65),
    responsivity_a_per_w=0.62,
    wavelength_nm=850.0,
    dark_current_na=2.0,
    capacitance_pf=72.0,
)
SFH213 = PhotodiodeSheet(
    part_id="osram-sfh213",
    package="radial-5mm",
    source="data sheet SFH 213 v1.4 (2022)",
    half_angle_deg=10.0,
    area_mm=(1.0, 1.0),
    responsivity_a_per_w=0.65,
    wavelength_nm=870.0,
)


@pytest.mark.parametrize(("colour", "on_axis", "power"), [("red", 22.5, 6.73), ("blue", 33.8, 10.1)])
def test_a_leds_power_follows_from_its_sheet(colour, on_axis, power):
    sheet = LEDS[colour]
    part = part_entry(sheet).part
    ratio = (sheet.max_current_ma or sheet.current_ma) / sheet.current_ma
    assert part.radiant_power_mw.value == pytest.approx(power * ratio, rel=0.005)
    assert f"{on_axis:g} mW/sr" in part_entry(sheet).remarks["Light"]
    assert part.radiant_power_mw.low < power * ratio < part.radiant_power_mw.high


def test_no_led_emits_more_than_it_takes():
    for sheet in LEDS.values():
        part = part_entry(sheet).part
        electrical_mw = sheet.forward_voltage_v * part.max_current_ma.value
        assert 0.05 < part.radiant_power_mw.value / electrical_mw < 0.5


def test_a_white_led_is_converted_by_an_assumed_efficacy():
    part = part_entry(LEDS["white"]).part
    assert part.radiant_power_mw.value == pytest.approx(14.4, rel=0.01)
    assert "300 lm/W" in part.radiant_power_mw.source
    assert part.wavelength_nm.confidence == "unverified"


def test_a_side_looking_photodiode_is_the_packaged_one():
    mine, theirs = part_entry(SFH206K).part, packaged().parts["osram-sfh206k"]
    for name in type(mine).model_fields:
        given, known = getattr(mine, name), getattr(theirs, name)
        if hasattr(known, "unit"):
            assert given.value == known.value, name
    assert (mine.mounting, mine.lead_count) == (theirs.mounting, theirs.lead_count)


def test_a_round_part_lies_on_its_side_and_its_dome_is_filed_unless_kept():
    filed, kept = (part_entry(SFH213), part_entry(replaced(SFH213, lens="kept")))
    assert (filed.part.mounting, filed.part.view) == ("surface", "top")
    assert (filed.part.half_angle_deg.value, filed.part.half_angle_deg.confidence) == (60.0, "unverified")
    assert (filed.part.body_depth_mm.value, kept.part.body_depth_mm.value) == (6.1, 8.6)
    assert 45.0 < kept.part.half_angle_deg.value < 60.0
    assert filed.part.capacitance_pf.value == pytest.approx(11.0, rel=0.1)  # the sheet's, left to the default


def replaced(sheet, **changes):
    return type(sheet)(**{**vars(sheet), **changes})


def test_the_text_of_an_entry_is_a_catalogue_with_the_same_part():
    for sheet in (*LEDS.values(), SFH206K, SFH213):
        entry = part_entry(sheet)
        found = parse_entries(tomllib.loads(entry.text()), "mine.toml")
        assert found.parts == {sheet.part_id: entry.part}
        assert max(map(len, entry.text().partition("[parts.")[0].splitlines())) <= 118


def test_a_name_with_line_ends_stays_inside_its_quotes():
    entry = part_entry(replaced(SFH213, title='a\n[parts.b]\n"', source="x\u007f\\"))
    assert list(tomllib.loads(entry.text())["parts"]) == ["osram-sfh213"]


def with_all(entries, **changes):
    catalog = {"parts": {entry.part_id: entry.part.model_dump(mode="json") for entry in entries}}
    names = {f"{entry.part.kind}s.part": entry.part_id for entry in entries}
    layout = [{"pattern": "facing_rows", "count": 2, "pitch_mm": 7.0}]
    return good(catalog=catalog, layout=layout, **names, **changes)


def messages(design, words):
    return [str(found) for found in check(design) if words in found.message]


def test_the_least_wall_is_the_thinnest_without_an_error():
    led, diode = part_entry(LEDS["red"]), part_entry(SFH213)
    base = good()
    for spare_mm, faults in ((0.0, 0), (-0.02, 1)):
        outer = base.cavity.length_mm + 2 * (led.wall_mm + spare_mm)
        design = with_all([led, diode], **{"mold.outer_length_mm": outer})
        assert len(messages(design, "wall behind the socket")) == faults, messages(design, "")


def test_the_least_pitch_is_the_nearest_without_an_error():
    led, diode = part_entry(LEDS["red"]), part_entry(SFH213)
    for spare_mm, faults in ((0.0, 0), (-0.02, 2)):  # on both walls
        design = with_all([led, diode], **{"mold.outer_length_mm": 60.0})
        layout = [{"pattern": "facing_rows", "count": 2, "pitch_mm": led.pitch_mm + spare_mm}]
        design = design.with_(layout=layout)
        assert len(messages(design, "web between the sockets")) == faults


def test_a_flat_pair_is_suggested_where_the_housing_is_half_as_large_again():
    small = {"cavity.length_mm": 20.0, "cavity.width_mm": 20.0}
    found = {}
    for lens in ("kept", "filed"):  # 8.6 and 6.1 mm deep
        led, diode = part_entry(replaced(LEDS["red"], lens=lens)), part_entry(SFH213)
        found[lens] = [str(one) for one in housing_notes(Draft(with_all([led, diode], **small)))]
    assert found["filed"] == []
    (said,) = found["kept"]
    assert f"the housing of {led.part_id} is 1.7 times as large" in said
    assert says(said, "40 x 40 mm ... 31 x 31 mm")
    assert "receivers.part = 'osram-sfh2400'" in said


@pytest.mark.parametrize("name", packages())
def test_a_part_in_any_package_has_a_socket_that_can_be_printed(name):
    dim = replaced(LEDS["red"], intensity=Intensity(value=500.0, unit="mcd"), half_angle_deg=60.0)
    entry = part_entry(replaced(dim, part_id="mine", package=name))
    layer_mm = entry.part.body_height_mm.value + 2.0
    changes = {
        "emitters.part": "mine",
        "emitters.height_mm": entry.flush_floor_mm + 1.0,
        "cavity.clear_thickness_mm": max(layer_mm, 8.0),
        "mold.outer_length_mm": good().cavity.length_mm + 2 * entry.wall_mm,
    }
    catalog = {"parts": {"mine": entry.part.model_dump(mode="json")}}
    layout = [{"pattern": "facing_rows", "count": 2, "pitch_mm": entry.pitch_mm}]
    findings = check(good(catalog=catalog, layout=layout, **changes))
    assert [str(one) for one in findings if "E1" in one.message or "mine" in one.message] == []


def test_the_heights_end_flush_with_both_faces_of_the_layer():
    led, diode = part_entry(LEDS["red"]), part_entry(SFH213)
    layer_mm = good().cavity.clear_thickness_mm
    low = with_all([led, diode], **{"emitters.height_mm": led.flush_floor_mm})
    high = with_all([led, diode], **{"emitters.height_mm": layer_mm - led.below_top_mm})
    assert cavity_of(low).emitters[0].body_base_mm == pytest.approx(0.0)
    assert cavity_of(high).emitters[0].body_top_mm == pytest.approx(layer_mm)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"package": "radial-5"}, ["--package", "radial-5", "did you mean radial-5mm?"]),
        ({"package": "plcc-2", "lens": "filed"}, ["--lens", "filed", "plcc-2 has no dome"]),
        ({"area_mm": (7.0, 7.0)}, ["active_width_mm = 7", "body_width_mm = 5.8"]),
        ({"responsivity_a_per_w": 2.5}, ["--responsivity: 2.5 A/W", "at most 0.702 A/W at 870 nm"]),
        ({"responsivity_a_per_w": 1.2, "wavelength_nm": 500.0}, ["--responsivity: 1.2 A/W", "0.403 A/W"]),
    ],
)
def test_a_bad_sheet_is_refused(changes, words):
    with pytest.raises(InputError) as caught:
        part_entry(replaced(SFH213, **changes))
    assert [word for word in words if word not in str(caught.value)] == []


def test_a_test_current_is_inferred_and_a_remark_asks_for_the_continuous_one():
    pulsed = replaced(
        LEDS["blue"],
        wavelength_nm=940.0,
        forward_voltage_v=2.4,
        current_ma=1000.0,
        intensity=Intensity(value=600.0, unit="mW/sr"),
    )
    entry = part_entry(pulsed)
    most = entry.part.max_current_ma
    assert (most.value, most.confidence) == (1000.0, "inferred")
    assert "largest continuous current" in most.source
    assert "--max-current" in entry.remarks["Current"]
    assert "--max-current" in entry.text()
    continuous = part_entry(replaced(pulsed, max_current_ma=100.0))
    assert continuous.part.max_current_ma.confidence == "read"
    assert "Current" not in continuous.remarks


def test_more_light_than_electrical_power_is_refused():
    bright = replaced(LEDS["red"], intensity=Intensity(value=250e3, unit="mcd"))
    with pytest.raises(
        InputError, match=r"^--intensity: .* 330 mW of light, .* at most 42 mW \(2.1 V x 20 mA\)"
    ):
        part_entry(bright)
    with pytest.raises(InputError, match=r"at most 52 mW \(2.6 V x 20 mA\)"):
        part_entry(replaced(bright, forward_voltage_v=None))
