"""The driver configuration: of exactly this geometry, read back whole, refused when it does not fit."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from optopad.design.circuit import circuit as electronics
from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError, InputError
from optopad.design.preset import PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver_config import driver_config, dump_driver_config
from optopad.fabrication.driver_file import (
    CHECKSUM,
    DriverConfig,
    EmitterEntry,
    MemoryNote,
    ReceiverEntry,
    config_from_document,
    content_sha256,
    load_driver_config,
    plain_of,
)

PAD = preset("piacenza2017-pad")


_TEXTS: dict[str, str] = {}


def text_of(design: SensorDesign) -> str:
    """What is written for a design; made once, as most tests look at the same few."""
    if design.digest not in _TEXTS:
        _TEXTS[design.digest] = dump_driver_config(design)
    return _TEXTS[design.digest]


def config_of(design: SensorDesign) -> DriverConfig:
    return config_from_document(tomllib.loads(text_of(design)), where="driver.toml")


def document_of(design: SensorDesign) -> dict[str, Any]:
    """A copy of one's own."""
    return tomllib.loads(text_of(design))


def resealed(document: dict[str, Any]) -> dict[str, Any]:
    """With the checksum that belongs to the changed content."""
    return document | {CHECKSUM: content_sha256(document)}


@pytest.mark.parametrize("name", PRESETS)
def test_places_names_and_normals_are_those_of_the_cavity(name: str) -> None:
    design = preset(name)
    config, cavity = config_of(design), cavity_of(design)
    assert [e.position_mm for e in config.emitters] == [p.position_mm for p in cavity.emitters]
    assert [r.position_mm for r in config.receivers] == [p.position_mm for p in cavity.receivers]
    entries: list[EmitterEntry | ReceiverEntry] = [*config.emitters, *config.receivers]
    assert [entry.name for entry in entries] == [part.name for part in cavity.parts]
    middle = (cavity.length_mm / 2, cavity.width_mm / 2)
    for entry in entries:
        (x, y, _), (nx, ny, nz) = entry.position_mm, entry.normal
        part = next(part for part in cavity.parts if part.name == entry.name)
        if part.is_on_floor:
            assert (entry.wall, entry.normal) == ("floor", (0.0, 0.0, 1.0))
            continue
        assert (np.hypot(nx, ny), nz) == pytest.approx((1.0, 0.0))
        to_middle = (middle[0] - x) * nx + (middle[1] - y) * ny
        assert to_middle == pytest.approx(cavity.plan.stands_mm(part.line))
        if part.angle_deg is None:
            assert to_middle == pytest.approx(middle[0] if ny == 0 else middle[1])


@pytest.mark.parametrize("name", PRESETS)
def test_pins_and_channels_are_those_of_the_design_and_single(name: str) -> None:
    design = preset(name)
    config, circuit = config_of(design), Circuit.of(design)
    pins, channels = (
        [path.number for path in circuit.emitters],
        [path.pin for path in circuit.receivers],
    )
    assert [e.pin for e in config.emitters] == pins
    assert [r.channel for r in config.receivers] == channels
    assert len(set(pins)) == len(pins)
    assert len(set(channels)) == len(channels)


def test_pins_chosen_by_hand_reach_the_file_in_their_order() -> None:
    design = PAD.with_(
        **{
            "board.emitter_pins": [40, 22, 41, 23, 42, 24, 43, 25],
            "board.receiver_channels": ["A15", "A0", "A14", "A1", "A13", "A2", "A12", "A3"],
        }
    )
    config = config_of(design)
    assert [e.pin for e in config.emitters] == [40, 22, 41, 23, 42, 24, 43, 25]
    assert [r.channel_number for r in config.receivers] == [15, 0, 14, 1, 13, 2, 12, 3]
    assert [r.column for r in config.receivers] == list(range(8))


def test_the_pad_has_nine_states_the_last_one_dark() -> None:
    config = config_of(PAD)
    assert [state.emitter for state in config.states] == ["E1", "E2", "E3", "E4", "E5", "E6", "E7", "E8", ""]
    assert config.ambient.subtract_state == 8
    assert [e.state for e in config.emitters] == list(range(8))


@pytest.mark.parametrize("name", PRESETS)
def test_the_file_says_what_the_configuration_says(name: str, tmp_path: Path) -> None:
    design = preset(name)
    file = tmp_path / "driver.toml"
    file.write_text(dump_driver_config(design, 12345.678), encoding="utf-8")
    config = load_driver_config(file, digest=design.digest)
    assert config == driver_config(design, 12345.678)
    assert (config.design, config.digest) == (design.name, design.digest)
    assert config.gain.counts_per_flux == 12345.678


def test_a_memory_is_stated_if_the_design_has_one() -> None:
    assert config_of(PAD).memory is None
    keeps = PAD.with_(**{"noise.release_residue": 0.05, "noise.release_decay_s": 0.5})
    assert config_of(keeps).memory == MemoryNote(residue=0.05, decay_s=0.5)


def test_an_unknown_gain_is_left_out() -> None:
    assert config_of(PAD).gain.counts_per_flux is None
    assert config_of(PAD).gain.target_counts == 300.0


def test_the_expected_pattern_reaches_the_reader_to_a_tenth_of_a_count() -> None:
    counts = np.linspace(0.0, 1023.0, 64).reshape(8, 8)
    text = dump_driver_config(PAD, 1e5, counts)
    expected = config_from_document(tomllib.loads(text), where="driver.toml").expected
    assert expected is not None
    assert np.abs(np.array(expected.untouched_counts) - counts).max() <= 0.05 + 1e-9  # rounded to 0.1


def test_an_expected_pattern_of_another_shape_is_refused() -> None:
    document = plain_of(driver_config(PAD, 1e5, np.zeros((8, 7))))
    with pytest.raises(InputError, match="emitters x receivers"):
        config_from_document(document, where="driver.toml")


def test_the_same_design_gives_the_same_file() -> None:
    assert dump_driver_config(PAD) == dump_driver_config(preset("piacenza2017-pad"))


def test_the_configuration_of_another_design_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "driver.toml"
    file.write_text(text_of(PAD), encoding="utf-8")
    other = PAD.with_(**{"cavity.clear_thickness_mm": 10.0})
    with pytest.raises(InputError, match=f"digest {PAD.digest[:8]}, needed {other.digest[:8]}"):
        load_driver_config(file, digest=other.digest)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"driver\.toml"):
        load_driver_config(tmp_path / "driver.toml")


@pytest.mark.parametrize("content", [b"\xff", b"[[", b"a = " + b"[" * 5000])
def test_a_file_that_is_no_toml_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "driver.toml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"damaged: not valid TOML|not UTF-8 text"):
        load_driver_config(file)


def test_a_design_file_is_not_taken_for_a_configuration(tmp_path: Path) -> None:
    file = tmp_path / "design.toml"
    file.write_text("schema_version = 1\n", encoding="utf-8")
    with pytest.raises(InputError, match="no driver configuration"):
        load_driver_config(file)


@pytest.mark.parametrize("version", [0, 1, 3, "2"])
def test_another_format_version_is_refused(version: object) -> None:
    with pytest.raises(InputError, match="format_version"):
        config_from_document(document_of(PAD) | {"format_version": version}, where="driver.toml")


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_a_file_that_was_cut_short_is_refused(share: float, tmp_path: Path) -> None:
    text = text_of(PAD)
    file = tmp_path / "driver.toml"
    file.write_text(text[: int(len(text) * share)], encoding="utf-8")
    with pytest.raises(InputError, match=r"damaged|format_version"):
        load_driver_config(file)


def test_a_pin_changed_by_hand_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "driver.toml"
    file.write_text(text_of(PAD).replace("pin = 22", "pin = 52"), encoding="utf-8")
    with pytest.raises(InputError, match="checksum"):
        load_driver_config(file)


def test_comments_and_line_ends_may_change(tmp_path: Path) -> None:
    file = tmp_path / "driver.toml"
    text = text_of(PAD).replace("# Driver", "# My driver").replace("\n", "\r\n")
    file.write_bytes(text.encode())
    assert load_driver_config(file).digest == PAD.digest


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("board", "clock_hz"), "fast", r"board\.clock_hz: 'fast' is no int"),
        (("board", "clock_hz"), True, r"board\.clock_hz: True"),
        (("board", "settle_us"), float("nan"), r"board\.settle_us"),
        (("board", "extra"), 1, r"board\.extra"),
        (("frame",), 3, "frame: is no table"),
        (("emitters",), {}, "emitters: .* is no list"),
        (("emitters", 0, "position_mm"), [1.0, 2.0], r"emitters\[0\]\.position_mm: has 2 entries, needs 3"),
        (("emitters", 1, "name"), "E1", "damaged: "),
        (("emitters", 1, "pin"), 22, "pins must be unique"),
        (("receivers", 1, "channel"), "A0", "channels must be unique"),
        (("receivers", 1, "column"), 5, "order of columns"),
        (("emitters", 0, "state"), 5, "order of states"),
        (("states", 8, "emitter"), "E1", "lit in turn"),
        (("states", 3, "number"), 4, "numbered from 0"),
        (("frame", "readings"), 71, "states x receivers"),
        (("frame", "reading_bytes"), 89, "readings must fit"),
        (("frame", "total_bytes"), 104, "bytes must add up"),
        (("frame", "order"), ["receiver", "state"], "state, receiver"),
        (("ambient", "subtract_state"), 0, "last state"),
        (("design",), "../../elsewhere/pad", "a file's name"),
        (("receivers", 0, "name"), "R1\x1b[2J", "printable"),
    ],
)
def test_a_field_that_does_not_fit_is_named(path: tuple[str | int, ...], value: object, message: str) -> None:
    document: Any = document_of(PAD)
    table: Any = document
    for key in path[:-1]:
        table = table[key]
    table[path[-1]] = value
    with pytest.raises(InputError, match=message):
        config_from_document(resealed(document), where="driver.toml")


@pytest.mark.parametrize("field", ["digest", "board", "states", "gain"])
def test_a_missing_field_is_named(field: str) -> None:
    document = document_of(PAD)
    del document[field]
    with pytest.raises(InputError, match=f"damaged: {field}: is missing"):
        config_from_document(resealed(document), where="driver.toml")


def test_the_reader_needs_the_standard_library_only() -> None:
    program = (
        "import sys; import optopad.fabrication.driver_file; "
        "print([n for n in ('numpy', 'pydantic', 'tomlkit', 'cadquery', 'mujoco', 'numba') if n in sys.modules])"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", PRESETS)
def test_a_press_has_its_point_and_normal_on_the_untouched_top(name: str) -> None:
    design = preset(name)
    surface, plan, space = config_of(design).surface, cavity_of(design).plan, config_of(design).workspace
    assert surface is not None
    assert space.area.kind == plan.outline.kind
    x, y = 0.3 * space.x0_mm + 0.7 * space.x1_mm, 0.6 * space.y0_mm + 0.4 * space.y1_mm
    point, normal = surface.point_and_normal(x, y)
    assert point == pytest.approx((x, y, plan.top_mm(x, y)), abs=1e-9)
    assert normal == pytest.approx(plan.normal(x, y), abs=1e-9)


def test_beyond_a_crown_s_reach_the_normal_is_that_of_its_border() -> None:
    surface = config_of(preset("fingertip-dome")).surface
    assert surface is not None
    point, normal = surface.point_and_normal(11.0 + 40.0, 11.0)
    assert np.isfinite(point).all()
    assert normal[0] == pytest.approx(0.999)
    assert np.hypot(*normal[::2]) == pytest.approx(1.0)


def test_the_pad_s_frame_has_72_readings_in_90_bytes_of_105() -> None:
    frame = config_of(PAD).frame
    assert (frame.readings, frame.bits_per_reading, frame.reading_bytes, frame.total_bytes) == (
        72,
        10,
        90,
        105,
    )


def test_a_pin_given_twice_is_refused() -> None:
    with pytest.raises(DesignError, match=r"board\.emitter_pins"):
        driver_config(PAD.with_(**{"board.emitter_pins": [22] * 8}))


def test_the_timing_budget_of_the_pad_is_the_sum_by_hand() -> None:
    budget = config_of(PAD).timing
    assert budget.conversion_us == pytest.approx(13 * 64 / 16)
    assert budget.link_ms == pytest.approx(105 * 10 / 1e6 * 1e3)
    assert budget.frame_ms == pytest.approx(9 * (0.020 + 8 * 0.052) + 1.05)
    assert budget.possible_hz == pytest.approx(1000 / budget.frame_ms)
    assert budget.wanted_hz == 60.0


def test_the_baud_error_is_that_of_the_clock() -> None:
    board = config_of(PAD.with_(**{"board.baud": 115200})).board
    assert board.baud_error == pytest.approx(16e6 / (8 * 17) / 115200 - 1)
    assert board.made_baud == pytest.approx(electronics.made_baud(16_000_000, 115200))
