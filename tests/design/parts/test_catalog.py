"""The packaged catalogue loads and says what its sources say; wrong entries are refused by name."""

import copy
import json
import math
import tomllib
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.errors import DesignError
from optopad.design.parts import catalog
from optopad.design.parts.catalog import CatalogEntries, Elastomer, Part, Quantity
from optopad.design.parts.circuits import families
from tests.said import says

ENTRIES = catalog.packaged()
SYLGARD = catalog.find_elastomer(ENTRIES, "sylgard-184")


def schneider_2009_sylgard(wavelength_um):
    return math.sqrt(1 + 1.0093 * wavelength_um**2 / (wavelength_um**2 - 0.013185))


def plain(entry):
    return json.loads(entry.model_dump_json(exclude_none=True))


def part_with(**changes):
    fields = plain(ENTRIES.parts["osram-lt-p4sg"])
    for name, value in changes.items():
        if value is None:
            fields.pop(name)
        else:
            fields[name] = value
    return {"parts": {"my-led": fields}}


def mm(value, **extra):
    return {"value": value, "unit": "mm", "source": "bench", "confidence": "measured", **extra}


def refused(mapping):
    with pytest.raises(DesignError) as caught:
        catalog.parse_entries(mapping, "mine.toml")
    return str(caught.value)


# the packaged content


def test_every_packaged_file_loads_and_contributes():
    for name in catalog.PACKAGED_FILES:
        text = resources.files("optopad.design").joinpath("data", f"{name}.toml").read_text(encoding="utf-8")
        entries = catalog.parse_entries(tomllib.loads(text), name)
        assert sum(len(getattr(entries, table)) for table in CatalogEntries.model_fields) >= 2


def test_a_recalled_or_assumed_value_is_never_marked_as_read():
    for name, part in ENTRIES.parts.items():
        for field in Part.model_fields:
            value = getattr(part, field)
            if isinstance(value, Quantity) and value.source.startswith(("recalled", "assumed")):
                assert value.confidence == "unverified", f"{name}.{field}"
            if isinstance(value, Quantity) and value.confidence == "unverified":
                assert value.source, f"{name}.{field}"


def test_every_packaged_body_holds_its_active_area_and_fits_behind_a_wall():
    for part in ENTRIES.parts.values():
        top = part.active_height_in_body_mm.value + part.active_height_mm.value / 2
        assert top <= part.body_height_mm.value
        assert part.body_depth_mm.value <= 5.0


def test_sfh206k_stands_as_its_data_sheet_says():
    part = catalog.find_part(ENTRIES, "osram-sfh206k", "receiver")
    assert (part.active_width_mm.value, part.active_height_mm.value) == (2.65, 2.65)
    assert (part.half_angle_deg.value, part.lead_pitch_mm.value) == (60.0, 2.54)
    assert part.responsivity_a_per_w is not None
    assert part.responsivity_a_per_w.value == 0.62
    assert part.capacitance_pf is not None
    assert part.capacitance_pf.value == 72.0
    assert part.lead_diameter_mm.value == pytest.approx(math.hypot(0.5, 0.4), abs=0.005)
    assert part.active_height_in_body_mm.confidence == "unverified"


def test_paper_led_rests_on_inferred_optics_and_unverified_package():
    part = catalog.find_part(ENTRIES, "sunled-xscwd23mb", "emitter")
    assert (part.active_width_mm.value, part.active_height_mm.value) == (2.0, 2.0)
    assert part.half_angle_deg.value == 60.0
    assert part.wavelength_nm is not None
    assert (part.wavelength_nm.value, part.wavelength_nm.confidence) == (550.0, "unverified")
    assert part.body_width_mm.confidence == "unverified"


def test_boards_have_the_channels_and_free_pins_that_they_are_known_for():
    mega = catalog.find_board(ENTRIES, "arduino-mega-2560")
    assert mega.analog_channels == tuple(f"A{i}" for i in range(16))
    assert mega.digital_pins[:32] == tuple(range(22, 54))
    assert not {0, 1} & set(mega.digital_pins)
    assert mega.clock_hz / 64 / mega.adc_clocks_per_conversion == pytest.approx(72 / 3.744e-3, rel=1e-6)
    assert len(catalog.find_board(ENTRIES, "arduino-uno").analog_channels) == 6
    assert catalog.find_board(ENTRIES, "arduino-nano").analog_channels[-2:] == ("A6", "A7")


def test_black_abs_reflects_five_percent_within_its_band():
    wall = catalog.find_mold_material(ENTRIES, "abs-black").wall_reflectance
    assert (wall.value, wall.low, wall.high) == (0.05, 0.03, 0.10)


# refractive index


@pytest.mark.parametrize(
    ("wavelength_um", "index"),
    [(0.46, 1.4150), (0.50, 1.4119), (0.55, 1.4093), (0.59, 1.4074), (0.63, 1.4055), (0.85, 1.4015)],
)
def test_index_at_20_to_1_is_that_of_the_reference(wavelength_um, index):
    found = catalog.refractive_index(SYLGARD, 20, wavelength_um)
    assert found.value == pytest.approx(index, abs=6e-5)  # the reference is rounded to four digits
    assert (found.confidence, found.unit) == ("read", "1")


def test_index_band_reaches_to_the_other_source():
    found = catalog.refractive_index(SYLGARD, 20, 0.55)
    assert found.high == pytest.approx(schneider_2009_sylgard(0.55), abs=1e-12)
    assert found.high == pytest.approx(1.4336, abs=5e-5)
    assert found.low == found.value


def test_index_band_beyond_the_other_source_keeps_its_last_difference():
    at_end = catalog.refractive_index(SYLGARD, 20, 0.70)
    beyond = catalog.refractive_index(SYLGARD, 20, 0.85)
    assert beyond.high - beyond.value == pytest.approx(at_end.high - at_end.value, abs=1e-12)


def test_index_is_linear_between_ratios_and_wavelengths_and_then_inferred():
    at_15, at_20 = (catalog.refractive_index(SYLGARD, ratio, 0.55).value for ratio in (15, 20))
    between = catalog.refractive_index(SYLGARD, 17, 0.55)
    assert between.value == pytest.approx(at_15 + 0.4 * (at_20 - at_15), abs=1e-12)
    assert between.confidence == "inferred"
    assert between.low == pytest.approx(at_15)
    ends = [catalog.refractive_index(SYLGARD, 20, at).value for at in (0.55, 0.56)]
    middle = catalog.refractive_index(SYLGARD, 20, 0.555)
    assert middle.value == pytest.approx(sum(ends) / 2, abs=1e-12)
    assert middle.confidence == "inferred"


@given(ratio=st.floats(5, 20), wavelength_um=st.floats(0.4, 1.0))
def test_index_lies_in_its_band_and_among_all_tables(ratio, wavelength_um):
    found = catalog.refractive_index(SYLGARD, ratio, wavelength_um)
    assert found.low <= found.value <= found.high
    assert 1.388 <= found.value <= 1.4211


def test_index_outside_the_tables_is_refused_with_the_range():
    with pytest.raises(DesignError, match=r"184 has.*5 to 20.*at 34"):
        catalog.refractive_index(SYLGARD, 34, 0.55)
    with pytest.raises(DesignError, match=r"20:1 has.*0\.4 to 1.*at 1\.2"):
        catalog.refractive_index(SYLGARD, 20, 1.2)
    with pytest.raises(DesignError, match=r"1 only.*10; choose"):
        catalog.refractive_index(catalog.find_elastomer(ENTRIES, "smooth-on-solaris"), 10, 0.55)


@pytest.mark.parametrize("ratio", [20.5, 25, 33])
def test_index_of_a_softer_mix_than_any_table_is_the_last_ones_with_a_band_over_all(ratio):
    found, last = (catalog.refractive_index(SYLGARD, at, 0.55) for at in (ratio, 20))
    tables = [catalog.refractive_index(SYLGARD, table.mixing_ratio, 0.55).value for table in SYLGARD.index]
    assert found.value == last.value
    assert found.confidence == "inferred"
    assert found.low == min(tables)  # the tables do not order by ratio: their spread is that of samples
    assert found.high >= max(tables)


def test_rtv615_table_follows_its_published_formula():
    rtv615 = catalog.find_elastomer(ENTRIES, "momentive-rtv615")
    for wavelength_um in (0.36, 0.45, 0.513, 0.55, 0.689):
        square = wavelength_um**2
        exact = math.sqrt(1 + 1.0057 * square / (square - 0.013217))
        found = catalog.refractive_index(rtv615, 10, wavelength_um)
        # steps of 0.01 um, n'' = 2.3 /um^2 at 0.36 um: step^2 n''/8 = 2.9e-5; rounding adds 0.5e-5
        assert found.value == pytest.approx(exact, abs=3.4e-5)
        assert found.confidence == "inferred"
    at_sodium = catalog.refractive_index(rtv615, 10, 0.589)
    assert at_sodium.low == pytest.approx(1.406, abs=3.4e-5)


# stiffness


@pytest.mark.parametrize(("ratio", "modulus_mpa"), [(10, 2.0), (15, 1.33), (20, 1.0), (30, 0.67)])
def test_modulus_is_that_of_the_reference(ratio, modulus_mpa):
    found = catalog.youngs_modulus_mpa(SYLGARD, ratio)
    assert found.value == pytest.approx(modulus_mpa, abs=0.004)  # the reference is rounded to 0.01
    assert (found.unit, found.confidence) == ("MPa", "read")


@given(ratio=st.floats(5, 33))
def test_modulus_between_rows_keeps_twenty_over_ratio(ratio):
    found = catalog.youngs_modulus_mpa(SYLGARD, ratio)
    assert found.value == pytest.approx(20 / ratio, rel=1e-5)
    assert found.low < found.value < found.high


def test_modulus_at_25_lies_between_its_neighbours_and_is_inferred():
    low, found, high = (catalog.youngs_modulus_mpa(SYLGARD, ratio) for ratio in (30, 25, 20))
    assert low.value < found.value < high.value
    assert found.value == pytest.approx(0.8, rel=1e-5)
    assert found.confidence == "inferred"


def test_modulus_band_at_10_to_1_is_the_published_spread():
    found = catalog.youngs_modulus_mpa(SYLGARD, 10)
    assert (found.low, found.high) == (1.32, 2.97)


def test_modulus_outside_the_rows_is_refused_with_the_range():
    with pytest.raises(DesignError, match=r"Young's modulus from 5 to 33, not at 40; .*youngs_modulus_mpa"):
        catalog.youngs_modulus_mpa(SYLGARD, 40)


# skins


def test_reflectance_of_a_skin_is_linear_between_wavelengths_with_its_band():
    skin = catalog.find_skin(ENTRIES, "gelsight-aluminium")
    found = skin.reflectance_at(775.0)  # half-way between 0.55 at 700 nm and 0.52 at 850 nm
    assert found.value == pytest.approx(0.535)
    assert (found.low, found.high) == (pytest.approx(0.3), pytest.approx(0.79))
    assert (found.unit, found.confidence) == ("1", "unverified")


def test_reflectance_of_a_skin_outside_its_table_is_refused_with_the_range():
    with pytest.raises(DesignError, match=r"from 400 to 1000 nm, not at 1100 nm; give top\.finish"):
        catalog.find_skin(ENTRIES, "white-silicone").reflectance_at(1100.0)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("share", [0.5], "wavelength_nm has 2 entries, share 1: they pair up"),
        ("low", [0.0, 0.1], "the band 0.1 to 0.04 does not include the value 0.02"),
        ("wavelength_nm", [1000.0, 400.0], "wavelength_nm must rise"),
    ],
)
def test_a_bad_reflectance_of_a_skin_is_refused(field, value, message):
    fields = plain(ENTRIES.skins["black-silicone"])
    fields["reflectance"][field] = value
    assert message in refused({"skins": {"mine": fields}})


# look-up


def test_an_unknown_part_is_answered_with_the_nearest_name_and_the_way_out():
    with pytest.raises(DesignError) as caught:
        catalog.find_part(ENTRIES, "osram-sfh206", "receiver")
    assert "did you mean osram-sfh206k" in str(caught.value)
    assert '[catalog.parts."osram-sfh206"]' in str(caught.value)


def test_a_part_of_the_other_kind_is_refused_as_such():
    with pytest.raises(DesignError, match="receivers, needed"):
        catalog.find_part(ENTRIES, "osram-sfh206k", "emitter")


@pytest.mark.parametrize(
    ("find", "name", "nearest"),
    [
        (catalog.find_elastomer, "sylgard184", "sylgard-184"),
        (catalog.find_mold_material, "abs", "abs-black"),
        (catalog.find_board, "arduino-mega", "arduino-mega-2560"),
        (catalog.find_skin, "gelsight", "gelsight-aluminium"),
    ],
)
def test_every_look_up_names_the_nearest_entry(find, name, nearest):
    with pytest.raises(DesignError, match=nearest):
        find(ENTRIES, name)


def test_a_name_like_nothing_known_lists_what_there_is():
    with pytest.raises(DesignError, match=r"known: abs-black, petg-black, pla-black\. To use your own"):
        catalog.find_mold_material(ENTRIES, "zzzz")


def test_the_users_entry_wins_over_the_packaged_one():
    own = catalog.parse_entries(
        {"parts": {"osram-lt-p4sg": part_with(body_depth_mm=mm(0.9))["parts"]["my-led"]}}, "mine.toml"
    )
    both = catalog.merged(ENTRIES, own)
    assert both.parts["osram-lt-p4sg"].body_depth_mm.value == 0.9
    assert len(both.parts) == len(ENTRIES.parts)
    assert ENTRIES.parts["osram-lt-p4sg"].body_depth_mm.value == 0.775


# refusals: one bad value a field, its message checked


REFUSED = [
    ("half_angle_deg", mm(60), "half_angle_deg ... 'mm'; this ... in 'deg'"),
    ("body_depth_mm", {**mm(0.9), "unit": "m"}, "body_depth_mm ... 'm'; this ... in 'mm'"),
    ("body_depth_mm", mm(0), "body_depth_mm: 0 mm ... 0 to 100 mm"),
    ("body_depth_mm", mm(1, low=1.1), "body_depth_mm ... 1.1 to None ... value 1"),
    ("body_depth_mm", {**mm(1), "source": " "}, "body_depth_mm.source: ' ' is refused"),
    ("body_depth_mm", {**mm(1), "confidence": "sure"}, "body_depth_mm.confidence: 'sure' is refused"),
    ("body_depth_mm", mm("1"), "body_depth_mm.value: '1' is refused"),
    ("body_depth_mm", mm(math.nan), "body_depth_mm.value"),
    ("active_width_mm", mm(2.5), "active_width_mm = 2.5 ... body_width_mm = 2"),
    ("active_height_in_body_mm", mm(1.9), "the area reaches from 1.235 to 2.565 mm above the base"),
    ("lead_diameter_mm", mm(3.5), "lead_diameter_mm = 3.5 must be below lead_pitch_mm = 3"),
    ("lead_count", 1, "lead_count: 1 ... to 2"),
    ("mounting", "glued", "'glued' ... 'radial' or 'surface'"),
    ("wavelength_nm", None, "kind = 'emitter' needs wavelength_nm"),
    ("dark_current_na", {**mm(1), "unit": "nA"}, "kind = 'emitter' has no dark_current_na"),
    ("colour", "green", "catalogue entry"),
    ("title", None, "title: is missing"),
    ("cost", {"value": -1, "currency": "EUR", "date": "2024-05", "source": "shop"}, "cost.value: -1"),
    (
        "cost",
        {"value": 1, "currency": "eur", "date": "2024-05", "source": "shop"},
        "cost.currency: 'eur'",
    ),
    ("cost", {"value": 1, "currency": "EUR", "date": "May 24", "source": "shop"}, "cost.date: 'May 24'"),
]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    REFUSED,
)
def test_a_bad_part_is_refused_by_file_part_and_field(field, value, message):
    answer = refused(part_with(**{field: value}))
    assert says(answer, "mine.toml ... parts.my-led")
    assert says(answer, message)


def test_a_receiver_needs_its_own_fields_and_refuses_an_emitters():
    fields = plain(ENTRIES.parts["osram-sfh2440"])
    without = {name: value for name, value in fields.items() if name != "responsivity_a_per_w"}
    assert "kind = 'receiver' needs responsivity_a_per_w" in refused({"parts": {"pd": without}})
    volts = {"value": 1, "unit": "V", "source": "bench", "confidence": "measured"}
    answer = refused({"parts": {"pd": {**fields, "forward_voltage_v": volts}}})
    assert "kind = 'receiver' has no forward_voltage_v" in answer


@pytest.mark.parametrize("name", ["My LED", "../x", "-x", "x" * 64, ""])
def test_an_identifier_that_is_no_plain_name_is_refused(name):
    fields = part_with()["parts"]["my-led"]
    assert "small letters, digits" in refused({"parts": {name: fields}})


def test_a_table_of_no_known_kind_is_refused():
    assert "lenses: is" in refused({"lenses": {}})


def test_every_finding_is_listed_at_once():
    mapping = part_with(body_depth_mm=mm(0), colour="green", title=None)
    assert len(refused(mapping).splitlines()) == 4


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("index", 0, "index"), [1.4], "wavelength_um has 61 entries, index 1"),
        (("index", 0, "wavelength_um", 1), 0.4, "wavelength_um must rise"),
        (("index", 0, "index", 0), 0.9, "to 1"),
        (("index", 0, "mixing_ratio"), 12.0, "mixing_ratio"),
        (("modulus", 0, "mixing_ratio"), 4.0, "modulus: mixing_ratio must be within 5 to 33"),
        (("modulus", 0, "high"), 1.0, "2.64 to 1.0 ... value 4"),
        (("mixing_ratio_high",), 2.0, "mixing_ratio_high = 2 ... mixing_ratio_low = 5"),
        (("index_band", 0, "to_um"), 0.2, "to_um = 0.2 must be above from_um = 0.35"),
        (("index_band", 0, "from_um"), 1.5, "to_um = 0.7 must be above from_um = 1.5"),
        (("poisson_ratio", "high"), 0.6, "0 to 0.5"),
        (("cure", 0, "minutes"), 0.0, "than 0"),
    ],
)
def test_a_bad_elastomer_is_refused_by_field(path, value, message):
    fields = plain(SYLGARD)
    target = fields
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    assert says(refused({"elastomers": {"my-gel": fields}}), message)


def test_a_band_that_shares_no_wavelength_with_the_tables_is_refused():
    fields = plain(SYLGARD)
    fields["index_band"][0] |= {"from_um": 1.5, "to_um": 1.8}
    assert "index_band.0: its wavelengths must overlap" in refused({"elastomers": {"my-gel": fields}})


def test_a_bad_mold_material_is_refused_by_field():
    fields = plain(ENTRIES.mold_materials["abs-black"])
    fields["wall_reflectance"]["high"] = 1.2
    assert "wall_reflectance: 1.2 1 is out of range" in refused({"mold_materials": {"mine": fields}})


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("digital_pins", [1, 2], "digital_pins: [1] are reserved"),
        ("digital_pins", [2, 2], "digital_pins"),
        ("analog_channels", ["A0", "A0"], "analog_channels"),
        ("exact_bauds", [115200], "exact_bauds: 115200 does not divide clock_hz / 8"),
        ("adc_bits", 4, "adc_bits: 4 is refused"),
    ],
)
def test_a_bad_board_is_refused_by_field(field, value, message):
    fields = plain(ENTRIES.boards["arduino-uno"]) | {field: value}
    assert message in refused({"boards": {"mine": fields}})


# round trips


def test_the_catalogue_survives_plain_data_and_back():
    assert catalog.parse_entries(plain(ENTRIES), "dump") == ENTRIES
    assert CatalogEntries.model_validate_json(ENTRIES.model_dump_json(), strict=True) == ENTRIES


@given(value=st.floats(0.1, 90.0), spread=st.floats(0.0, 5.0))
def test_a_measured_length_survives_a_round_trip(value, spread):
    fields = copy.deepcopy(part_with()["parts"]["my-led"])
    fields["body_depth_mm"] = mm(value, low=value, high=value + spread)
    entries = catalog.parse_entries({"parts": {"my-led": fields}}, "mine.toml")
    assert entries.parts["my-led"].body_depth_mm.value == value
    assert catalog.parse_entries(plain(entries), "again") == entries


def test_a_bare_toml_date_is_taken_as_the_quotes_date():
    text = 'value = 1.5\ncurrency = "EUR"\ndate = 2024-05-01\nsource = "shop quote"'
    entries = catalog.parse_entries(part_with(cost=tomllib.loads(text)), "mine.toml")
    assert entries.parts["my-led"].cost.date == "2024-05-01"


def test_entries_are_frozen():
    with pytest.raises(ValueError, match="frozen"):
        SYLGARD.title = "other"
    assert isinstance(SYLGARD, Elastomer)


def test_every_family_with_commands_has_its_file_and_every_entry_its_family() -> None:
    entries = catalog.packaged()
    for table in ("multiplexers", "shift_registers", "converters", "led_drivers"):
        for name, entry in getattr(entries, table).items():
            assert entry.family.table == table, name
    for name, family in families().items():
        source = resources.files("optopad.fabrication") / "firmware" / "source" / f"{name}.h"
        assert source.is_file() == (family.table in ("converters", "led_drivers")), name
