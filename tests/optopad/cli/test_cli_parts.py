"""`optopad part new` writes entries that a design takes, and `optopad parts` lists the catalogue."""

from __future__ import annotations

import json
import tomllib

import pytest

from optopad.cli import main
from optopad.design.io import load_design
from optopad.design.part_entry import packages
from optopad.design.parts.catalog import CatalogEntries, packaged
from optopad.design.parts.listing import kinds_of
from optopad.design.preset import preset
from optopad.verbs import part as parts
from tests.said import says

LED = {
    "kind": "led",
    "package": "radial-5mm",
    "intensity": "5100mcd",
    "viewing-angle": "30",
    "wavelength": "624",
    "current": "20",
}
DIODE = {
    "kind": "photodiode",
    "package": "side-looking-5mm",
    "area": "2.65x2.65",
    "responsivity": "0.62",
    "wavelength": "850",
    "half-angle": "60",
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def typed(name, given, *more):
    options = [word for key, value in given.items() if value is not None for word in (f"--{key}", value)]
    return ["part", "new", name, *options, *more]


def test_a_written_part_is_used_by_a_design_that_names_its_file(folder, capsys):
    assert main(["new", "pad.toml"]) == 0
    assert main(typed("my-led", LED, "--out", "mine.toml")) == 0
    assert main(typed("my-diode", DIODE, "--out", "mine.toml")) == 0
    said = capsys.readouterr().out
    assert [line.split()[0] for line in said.splitlines() if line.startswith("next")] == ["next"] * 2
    assert 'catalog_files = ["mine.toml"]' in " ".join(said.split())
    text = (folder / "pad.toml").read_text(encoding="utf-8")
    text = text.replace('name = "pad"', 'name = "pad"\ncatalog_files = ["mine.toml"]')
    text = text.replace('"sunled-xscwd23mb"', '"my-led"').replace('"osram-sfh206k"', '"my-diode"')
    (folder / "pad.toml").write_text(text, encoding="utf-8")
    design = load_design(folder / "pad.toml")
    assert (design.emitters.part, design.receivers.part) == ("my-led", "my-diode")
    assert set(design.catalog.parts) == {"my-led", "my-diode"}


def test_json_has_the_entry_the_remarks_and_the_sizes_of_the_housing(folder, capsys):
    assert main(typed("my-led", LED, "--json")) == 0
    printed = capsys.readouterr()
    document = json.loads(printed.out)
    assert printed.err == ""
    assert document["file"] == "my-led.toml"
    assert document["entry"]["radiant_power_mw"]["value"] == pytest.approx(6.73, rel=0.002)
    assert (document["least_wall_mm"], document["flush_floor_height_mm"]) == (7.05, 2.9)
    assert {"Light", "Lens", "Legs", "Flush", "Housing"} <= set(document["remarks"])
    written = tomllib.loads((folder / "my-led.toml").read_text(encoding="utf-8"))
    assert written["parts"]["my-led"]["view"] == "top"


def test_a_full_and_a_half_angle_and_all_units_of_intensity_say_the_same(folder, capsys):
    powers = set()
    for number, changes in enumerate(
        (
            {},
            {"viewing-angle": None, "half-angle": "15"},
            {"intensity": "5.1 cd", "wavelength": "624nm", "current": "20 mA"},
            {"intensity": "22.4781 mW/sr"},
            {"intensity": "0.0224781W/sr"},
        )
    ):
        assert main(typed(f"led-{number}", LED | changes, "--json")) == 0
        powers.add(round(json.loads(capsys.readouterr().out)["entry"]["radiant_power_mw"]["value"], 2))
    assert powers == {6.73}


def test_a_terminal_is_prompted_for_what_is_missing(folder, monkeypatch, capsys):
    answers = {**LED, "kind": "LED"}
    prompted = []

    def answer(question):
        name = next(name for name, text in parts.QUESTIONS.items() if text == question)
        prompted.append(name)
        return answers[name.removeprefix("led-").removeprefix("photodiode-")]

    for stream in (parts.sys.stdin, parts.sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(parts.typer, "prompt", answer)
    assert main(["part", "new", "my-led", "--package", "radial-5mm", "--current", "20"]) == 0
    assert prompted == ["kind", "intensity", "viewing-angle", "led-wavelength"]
    assert main(["part", "new", "other", "--kind", "led", "--json"]) == 2
    assert len(prompted) == 4
    answers |= DIODE
    assert main(typed("my-diode", DIODE | {"kind": "Photodiode", "wavelength": None})) == 0
    assert prompted[4:] == ["photodiode-wavelength"]
    assert "wavelengths it differs" in " ".join(capsys.readouterr().out.split())
    assert [name for name in packages() if name not in parts.QUESTIONS["package"]] == []


def test_a_bad_answer_is_asked_again_and_the_others_stay(folder, monkeypatch, capsys):
    answers = {name: [text] for name, text in LED.items()}
    answers |= {"kind": ["laser", "led"], "intensity": ["250", "5100mcd"], "viewing-angle": ["190", "30"]}

    def answer(question):
        name = next(name for name, text in parts.QUESTIONS.items() if text == question)
        return answers[name.removeprefix("led-")].pop(0)

    for stream in (parts.sys.stdin, parts.sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(parts.typer, "prompt", answer)
    assert main(["part", "new", "my-led"]) == 0
    assert not any(answers.values())
    printed = capsys.readouterr()
    assert "'250' has no unit" in printed.err
    assert "6.73 mW" in " ".join(printed.out.split())


BAD = (
    ({"package": None, "current": None}, ["--package, --current", "led"]),
    ({"kind": None}, ["--kind", "led or photodiode"]),
    ({"kind": "laser"}, ["--kind", "laser", "led or photodiode"]),
    ({"viewing-angle": "190"}, ["--viewing-angle", "190 deg", "2 to 178 deg", "full angle"]),
    (
        {"viewing-angle": None, "half-angle": "95"},
        ["--half-angle", "95 deg", "1 to 89 deg", "--viewing-angle"],
    ),
    ({"half-angle": "15"}, ["--viewing-angle", "30", "--half-angle", "15", "give one"]),
    ({"wavelength": None}, ["--wavelength", "missing"]),
    ({"wavelength": "940"}, ["mcd", "940 nm", "420 to 700 nm", "mW/sr"]),
    ({"wavelength": "0.63"}, ["--wavelength", "0.63 nm", "200 to 2000 nm", "nanometres"]),
    ({"current": "twenty"}, ["--current", "'twenty'", "above 0 to 5000 mA"]),
    ({"wavelength": "red"}, ["--wavelength", "'red'", "200 to 2000 nm"]),
    ({"package": "dip-8"}, ["--package", "dip-8", "radial-5mm", "0805", "nearest"]),
    ({"current": "-20"}, ["--current", "-20 mA", "above 0 to 5000 mA", "positive"]),
    ({"intensity": "250"}, ["--intensity", "'250' has no unit", "250mcd", "12mW/sr"]),
    (
        {"intensity": "250cd"},
        ["--intensity", "250000 mcd", "330 mW", "at most 52 mW", "2.6 V x 20 mA", "--current"],
    ),
    ({"intensity": "5lm"}, ["--intensity", "5lm", "not the flux"]),
    ({"intensity": "-5mcd"}, ["--intensity", "-5mcd", "above 0"]),
    ({"intensity": "nanmcd"}, ["--intensity", "nanmcd"]),
    ({"lens": "glued"}, ["--lens", "glued", "filed or kept"]),
    ({"package": "plcc-2", "lens": "filed"}, ["--lens", "plcc-2", "leave --lens out"]),
    ({"area": "7.5"}, ["--area", "7.5", "a led has none"]),
)


@pytest.mark.parametrize(("changes", "words"), BAD, ids=lambda one: str(one)[:40])
def test_a_bad_sheet_is_refused_by_option_and_nothing_is_written(folder, capsys, changes, words):
    assert main(typed("my-led", LED | changes)) == 2
    said = capsys.readouterr().err
    assert said.startswith("optopad: ")
    assert [word for word in words if word not in said] == [], said
    assert len(said.splitlines()) == 1
    assert list(folder.iterdir()) == []


def test_a_bad_photodiode_name_or_file_is_refused(folder, capsys):
    def refusal(arguments):
        assert main(arguments) == 2
        return capsys.readouterr().err

    for area in ("-7", "0", "2.65x", "x", "1x-1", "7 cm2"):
        assert "--area" in refusal(typed("d", DIODE | {"area": area}))
    sheet = DIODE | {"responsivity": "1.2", "wavelength": "500"}
    assert says(refusal(typed("d", sheet)), "--responsivity: 1.2 A/W ... 0.403 A/W")
    assert "use wp7113srd" in refusal(typed("WP7113SRD", LED))
    assert "use my-osram-sfh206k, or give" in refusal(typed("osram-sfh206k", DIODE))
    assert list(folder.iterdir()) == []
    assert main(typed("d", DIODE)) == 0
    before = (folder / "d.toml").read_bytes()
    assert "part d already" in refusal(typed("d", DIODE))
    assert main(["new", "pad.toml"]) == 0
    assert "pad.toml" in refusal(typed("e", DIODE, "--out", "pad.toml"))
    assert (folder / "d.toml").read_bytes() == before


def test_the_list_has_every_entry_with_its_figures_and_source(capsys):
    assert main(["parts", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["entries"]
    names = {name for table in CatalogEntries.model_fields for name in getattr(packaged(), table)}
    assert {one["name"] for one in found} == names
    assert [
        one["name"] for one in found if not (one["figures"] and one["source"] and one["confidences"])
    ] == []
    assert {"petg-black", "sylgard-184", "teensy-41", "osram-sfh206k"} <= names


def test_the_list_of_one_group_has_two_lines_an_entry(capsys):
    assert main(["parts", "--kind", "plastics"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1::2]] == ["abs-black", "petg-black", "pla-black"]
    assert "(3 unverified)" in lines[2]
    assert main(["parts", "--kind", "LED driver"]) == 0
    assert "led-drivers" in capsys.readouterr().out
    assert main(["parts", "--kind", "silicnoes"]) == 2
    said = capsys.readouterr().err
    assert "did you mean silicones?" in said
    assert [group for group in kinds_of(packaged()) if group not in said] == []


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("emitters.luminous_intensity_mcd=250", ["emitters.luminous_intensity_mcd", "radiant_power_mw"]),
        ("emitters.viewing_angle=30", ["emitters.viewing_angle", "half_angle_deg"]),
        (
            "part_measurements.osram-lt-p4sg.mcd=250",
            ["part_measurements.osram-lt-p4sg.mcd", "radiant_power_mw"],
        ),
    ],
)
def test_a_quantity_of_a_data_sheet_in_a_design_names_the_command(capsys, place, words):
    assert main(["check", "piacenza2017-pad", "--set", place]) == 2
    printed = capsys.readouterr()
    said = " ".join((printed.out + printed.err).split())
    assert [word for word in (*words, "optopad part new") if word not in said] == [], said


def test_an_amplifier_has_the_limits_that_the_circuit_needs(capsys):
    assert main(["parts", "--kind", "Amplifier"]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "mcp6004 " in line)
    assert "1.8 to 6 V, 1 MHz, 0.6 V/us, bias 1 (at most 30) pA, output to 0.025 V below the supply" in line


def test_the_view_of_a_part_that_has_none_leaves_the_digest_of_a_design():
    pad = preset("piacenza2017-pad")
    assert pad.digest.startswith("0c3a4f54")
    entry = packaged().parts["sunled-xscwd23mb"].model_dump(mode="json")
    assert "view" not in entry
    mine = pad.with_(catalog={"parts": {"sunled-xscwd23mb": entry}})
    same = pad.with_(catalog={"parts": {"sunled-xscwd23mb": entry | {"view": None}}})
    assert "view" not in mine.model_dump(mode="json")["catalog"]["parts"]["sunled-xscwd23mb"]
    assert mine.digest == same.digest != pad.digest
