"""Files: what is saved is what is loaded, and nothing is half-written."""

from __future__ import annotations

import os
import re
import stat
import tempfile
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from hypothesis import given, settings

from optopad.design.errors import DesignError, OptopadError
from optopad.design.file_sets import written_together
from optopad.design.io import (
    dump_design,
    load_design,
    save_design,
    without_empty,
    write_text_atomically,
)
from optopad.design.parts import catalog
from optopad.design.preset import PRESETS, preset, preset_text
from optopad.design.rules.check import check, require_valid
from optopad.design.spec import SensorDesign
from tests.design.bad_designs import design_text
from tests.design.spec.spec_fields import designs, good

MY_LED = """
[parts.my-led]
kind = "emitter"
title = "My LED"
manufacturer = "Mine"
mounting = "surface"
lead_count = 2
"""
MY_LED_MM = {
    "active_width_mm": 1.0,
    "active_height_mm": 1.0,
    "body_width_mm": 3.0,
    "body_depth_mm": 1.5,
    "body_height_mm": 3.0,
    "active_height_in_body_mm": 1.5,
    "lead_pitch_mm": 2.54,
    "lead_diameter_mm": 0.8,
}


def quantity(name: str, value: float, unit: str) -> str:
    return (
        f'{name} = {{ value = {value}, unit = "{unit}", source = "my caliper", confidence = "measured" }}\n'
    )


def my_led_file() -> str:
    lengths = "".join(quantity(name, value, "mm") for name, value in MY_LED_MM.items())
    rest = (
        quantity("half_angle_deg", 60.0, "deg")
        + quantity("wavelength_nm", 530.0, "nm")
        + quantity("forward_voltage_v", 3.0, "V")
        + quantity("max_current_ma", 20.0, "mA")
    )
    return MY_LED + lengths + rest


@settings(max_examples=20)
@given(designs())
def test_saving_and_loading_gives_the_same_digest(design: SensorDesign) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "design.toml"
        save_design(design, file)
        assert load_design(file).digest == design.digest
        assert load_design(file) == design


@pytest.mark.parametrize("name", PRESETS)
def test_a_saved_preset_is_the_preset(name: str, tmp_path: Path) -> None:
    save_design(preset(name), tmp_path / "design.toml")
    assert load_design(tmp_path / "design.toml").digest == preset(name).digest


def test_an_own_part_is_read_from_a_file_beside_the_design_and_saved_inside_it(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(my_led_file(), encoding="utf-8")
    text = design_text({"emitters.part": '"my-led"'}, head='catalog_files = ["mine.toml"]')
    (tmp_path / "d.toml").write_text(text, encoding="utf-8")
    design = load_design(tmp_path / "d.toml")
    require_valid(design)
    (tmp_path / "elsewhere").mkdir()
    save_design(design, tmp_path / "elsewhere" / "alone.toml")
    again = load_design(tmp_path / "elsewhere" / "alone.toml")
    assert again.digest == design.digest
    assert again.catalog.parts["my-led"].active_width_mm.value == 1.0


def test_what_the_design_says_itself_wins_over_its_catalogue_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(my_led_file(), encoding="utf-8")
    own = my_led_file().replace("[parts.", "[catalog.parts.").replace("My LED", "My other LED")
    text = design_text(head='catalog_files = ["mine.toml"]', tail=own)
    (tmp_path / "d.toml").write_text(text, encoding="utf-8")
    assert load_design(tmp_path / "d.toml").catalog.parts["my-led"].title == "My other LED"


def test_a_name_with_a_null_byte_is_refused() -> None:
    with pytest.raises(DesignError, match="name of"):
        load_design("a\0b.toml")


def test_an_endless_file_is_refused_and_not_read_to_its_end() -> None:
    with pytest.raises(DesignError, match="a device"):
        load_design("/dev/zero")


def test_a_link_that_leads_out_of_the_folder_is_no_catalogue_file(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    (tmp_path / "outside.toml").write_text(my_led_file(), encoding="utf-8")
    (folder / "mine.toml").symlink_to(tmp_path / "outside.toml")
    (folder / "d.toml").write_text(design_text(head='catalog_files = ["mine.toml"]'), encoding="utf-8")
    with pytest.raises(DesignError, match="leaves the design's folder"):
        load_design(folder / "d.toml")


def test_a_failed_write_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "d.toml"
    save_design(good(), file)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OptopadError, match="left on device"):
        write_text_atomically(file, "half")
    assert [path.name for path in tmp_path.iterdir()] == ["d.toml"]
    assert load_design(file).digest == good().digest


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt


def test_an_interrupted_write_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "d.toml"
    save_design(good(), file)
    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_text_atomically(file, "half")
    assert [path.name for path in tmp_path.iterdir()] == ["d.toml"]
    assert load_design(file).digest == good().digest


def test_files_written_together_come_together_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    for content in ("old", "new"):
        with written_together(folder) as made:
            (made / "a.txt").write_text(content)
            (made / "b.txt").write_text(content)
    with pytest.raises(KeyboardInterrupt), written_together(folder) as made:
        interrupted((made / "a.txt").write_text("newer"))
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "new", "b.txt": "new"}


def test_a_folder_for_files_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    message = r"file/folder: cannot be written: .* choose another folder"
    with pytest.raises(OptopadError, match=message), written_together(tmp_path / "file" / "folder"):
        raise AssertionError


@pytest.mark.skipif(os.name == "nt", reason="modes are a POSIX notion")
def test_a_saved_file_can_be_read_by_others(tmp_path: Path) -> None:
    save_design(good(), tmp_path / "d.toml")
    assert stat.S_IMODE((tmp_path / "d.toml").stat().st_mode) == 0o644


def test_only_nothing_and_empty_tables_are_left_out() -> None:
    given_data = {
        "a": None,
        "b": {},
        "c": {"d": None},
        "e": 0,
        "f": "",
        "g": [],
        "h": False,
        "i": [{"j": None}],
    }
    assert without_empty(given_data) == {"e": 0, "f": "", "g": [], "h": False, "i": [{}]}


def test_a_tips_points_are_read_from_a_file_beside_the_design_and_saved_inside_it(tmp_path: Path) -> None:
    text = design_text({"indenter.shape": '"profile"', "indenter.profile_csv": '"tip.csv"'})
    (tmp_path / "d.toml").write_text(text, encoding="utf-8")
    (tmp_path / "tip.csv").write_text(
        "r_mm; height_mm\n# made by hand\n0; 0\n\n1.5; 0.4\n3; 3\n", encoding="utf-8"
    )
    design = load_design(tmp_path / "d.toml")
    assert design.indenter.profile_mm == ((0.0, 0.0), (1.5, 0.4), (3.0, 3.0))
    (tmp_path / "elsewhere").mkdir()
    save_design(design, tmp_path / "elsewhere" / "alone.toml")
    assert load_design(tmp_path / "elsewhere" / "alone.toml").digest == design.digest


def test_a_part_in_two_catalogue_files_is_refused(tmp_path):
    for name in ("one.toml", "two.toml"):
        (tmp_path / name).write_text(my_led_file(), encoding="utf-8")
    file = tmp_path / "pad.toml"
    file.write_text(design_text(head='catalog_files = ["one.toml", "two.toml"]'), encoding="utf-8")
    with pytest.raises(DesignError, match=r"two\.toml: parts\.my-led.*catalog_files"):
        load_design(file)


def led_with(curve: str, folder: Path, *, kind: str = "angular_pattern") -> SensorDesign:
    """The paper's pad with an emitter of one's own, a curve of it in a file."""
    base = catalog.packaged().parts[preset("piacenza2017-pad").emitters.part]
    part = without_empty(base.model_dump(mode="json")) | {
        kind: {"curve_csv": "curve.csv", "source": "digitised", "confidence": "read"}
    }
    (folder / "curve.csv").write_text(curve, encoding="utf-8")
    (folder / "parts.toml").write_text(tomlkit.dumps({"parts": {"my-led": part}}), encoding="utf-8")
    text = preset_text("piacenza2017-pad")
    text = re.sub(r'(?m)^part = ".*"', 'part = "my-led"', text, count=1)
    (folder / "pad.toml").write_text('catalog_files = ["parts.toml"]\n' + text, encoding="utf-8")
    return load_design(folder / "pad.toml")


def test_a_digitised_pattern_is_sorted_folded_clipped_and_thinned_and_says_so(tmp_path: Path) -> None:
    angles = np.linspace(-90.4, 90.4, 1600)
    values = np.cos(np.radians(np.clip(angles, -90.0, 90.0))) - 0.004
    order = np.random.default_rng(0).permutation(len(angles))
    rows = "\n".join(f"{angles[k]:.5f}, {values[k]:.6f}" for k in order)
    design = led_with(f"angle,intensity\n{rows}\n", tmp_path)
    table = design.catalog.parts["my-led"].angular_pattern
    assert table is not None
    assert (table.angle_deg[0], table.angle_deg[-1]) == (0.0, 90.0)
    assert len(table.angle_deg) <= 400
    at = np.linspace(0.0, 90.0, 50)
    assert table.at(at) == pytest.approx(np.maximum(np.cos(np.radians(at)) - 0.004, 0.0), abs=1e-3)
    for word in ("curve.csv", "set to 0", "up to 90.4 deg set to 90", "both sides", "thinned to 181"):
        assert word in (table.adapted or "")
    told = [str(finding) for finding in check(design) if "was adapted" in finding.message]
    assert len(told) == 1
    assert "thinned" in told[0]
    assert load_design_text(dump_design(design), tmp_path).digest == design.digest


def load_design_text(text: str, folder: Path) -> SensorDesign:
    (folder / "again.toml").write_text(text, encoding="utf-8")
    return load_design(folder / "again.toml")


def test_a_digitised_curve_that_is_a_table_is_taken_as_it_is(tmp_path: Path) -> None:
    pattern = led_with("0;1\n45;0.7\n90;0\n", tmp_path).catalog.parts["my-led"].angular_pattern
    assert pattern is not None
    assert (pattern.angle_deg, pattern.relative, pattern.adapted) == ((0, 45, 90), (1, 0.7, 0), None)
    first = led_with("0.31,1\n45,0.7\n", tmp_path).catalog.parts["my-led"].angular_pattern
    assert first is not None
    assert first.angle_deg == (0, 45)
    assert "0.31 deg" in (first.adapted or "")
    curve = "# nm, weight\n520,1\n500,0.2\n520,0.8\n560,-0.01\n"
    spectrum = led_with(curve, tmp_path, kind="spectrum").catalog.parts["my-led"].spectrum
    assert spectrum is not None
    assert (spectrum.wavelength_nm, spectrum.weight) == ((500, 520, 560), (0.2, 0.9, 0))


def test_a_curve_that_is_none_is_refused_with_its_file(tmp_path: Path) -> None:
    for kind, curve, words in (
        ("angular_pattern", "3,1\n45,0.7\n", "starts at 3; needs a point at 2 or less"),
        ("angular_pattern", "0,1\n120,0.7\n", "reaches 120; needs angles to the axis"),
        ("angular_pattern", "0,1\n45,-0.1\n", "at most 2% of the largest below"),
        ("angular_pattern", "0,31;0,99\n45,1;0,7\n", "decimal comma"),
        ("angular_pattern", "0,1\n", "has 1 points"),
        ("angular_pattern", "0,0\n1,0\n", "correct the axis"),
        ("spectrum", "0.52,1\n0.56,0.7\n", "in nm, not in µm"),
    ):
        with pytest.raises(DesignError, match=r"curve\.csv: ") as err:
            led_with(curve, tmp_path, kind=kind)
        assert words in str(err.value)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "d.toml").write_bytes(b"\xef\xbb\xbf" + design_text().encode())
    assert load_design(tmp_path / "d.toml").digest == good().digest


def test_windows_line_ends_make_the_same_design(tmp_path: Path) -> None:
    (tmp_path / "d.toml").write_bytes(design_text().replace("\n", "\r\n").encode())
    assert load_design(tmp_path / "d.toml").digest == good().digest
