"""Each kind of file that a fuzz once broke something with, by itself."""

from __future__ import annotations

import re
import time
import tracemalloc
import zipfile

import h5py
import numpy as np
import pytest

from optopad.cli.main import BAD_INPUT, main
from optopad.design.errors import LONGEST_MESSAGE_BYTES, DesignError, InputError, readable
from optopad.design.io import load_design
from optopad.design.preset import preset, preset_text
from optopad.design.rules.check import check
from optopad.design.search.space import load_space
from optopad.design.toml_text import parsed_toml
from optopad.sims.learning.inference.model_file import load_model, save_model
from optopad.sims.readings.dataset import read_data, save_data
from optopad.sims.readings.recording import read_recording
from tests.design.search.cheap_search import cheap_space
from tests.sims.learning.made_up_models import made_up_kernel_ridge
from tests.sims.readings.test_dataset import made_up

PAD = "piacenza2017-pad"


def design_with(tmp_path, line: str, table: str = "board"):
    text = preset_text(PAD)
    file = tmp_path / "a.toml"
    file.write_text(
        text.replace(f"[{table}]", f"[{table}]\n{line}", 1) if table else f"{line}\n{text}", encoding="utf-8"
    )
    return file


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ("cavity", "x = 0x" + "f" * 5_000),
        ("", "measured = [0x" + "f" * 5_000 + "]"),
        ("cavity", "x = 1" + "0" * 400),
    ],
)
def test_a_number_of_many_digits_is_refused(tmp_path, table, line):
    with pytest.raises(DesignError, match="100 digits"):
        load_design(design_with(tmp_path, line, table))


def test_a_schema_version_of_many_digits_is_refused(tmp_path, capsys):
    file = tmp_path / "a.toml"
    file.write_text("schema_version = 0x" + "f" * 5_000, encoding="utf-8")
    assert main(["check", str(file)]) == BAD_INPUT
    assert "Traceback" not in capsys.readouterr().err


def test_a_number_from_python_is_held_to_the_same():
    with pytest.raises(DesignError, match=r"board\.adc_prescaler: 1000.* digits"):
        preset(PAD).with_(**{"board.adc_prescaler": 10**400})


def test_a_prescaler_of_a_hundred_digits_is_a_finding():
    found = check(preset(PAD).with_(**{"board.adc_prescaler": 10**99}))
    assert "board.adc_prescaler" in {one.field for one in found if one.severity == "error"}


@pytest.mark.parametrize(
    "line", ['catalog_files = ["{}"]', 'indenter = {{ shape = "profile", profile_csv = "{}" }}']
)
def test_a_file_name_that_is_too_long_is_refused(tmp_path, line):
    file = tmp_path / "a.toml"
    file.write_text(f"schema_version = 1\n{line.format('x' * 5_000)}\n", encoding="utf-8")
    with pytest.raises(DesignError, match="long; correct"):
        load_design(file)


def test_a_base_whose_name_is_too_long_is_refused(tmp_path):
    (tmp_path / "space.toml").write_text(f'base = "{"x" * 5_000}"\n', encoding="utf-8")
    with pytest.raises(DesignError, match=r"base: .*File name too long"):
        load_space(tmp_path / "space.toml")


def test_an_argument_that_is_too_long_is_refused(capsys):
    assert main(["check", "x" * 5_000]) == BAD_INPUT
    assert "give another name" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 300_000 + " = 1",
        "[a" + ".a" * 300_000 + "]",
        '"a"' + ' . "a"' * 100_000 + " = 1",
        '"""' * 300_000,
    ],
)
def test_deep_keys_are_refused_before_they_are_parsed(text):
    with pytest.raises(ValueError, match=r"too deep|Expected"):
        parsed_toml(text)


def test_dots_in_texts_and_comments_are_no_depth():
    text = "# a" + ".a" * 100 + '\nx = "a' + ".a" * 100 + '"\ny = """\na' + ".a" * 100 + '\n"""\n'
    assert set(parsed_toml(text)) == {"x", "y"}


def test_too_many_values_are_refused_before_they_are_parsed():
    with pytest.raises(ValueError, match="reads at most 30000"):
        parsed_toml("a = [" + "1, " * 300_000 + "]")


def test_a_long_list_of_measured_values_is_refused(tmp_path):
    line = "measured = [" + '"cavity.length_mm", ' * 20_000 + "]"
    with pytest.raises(DesignError, match=r"measured: .*at most 1000"):
        load_design(design_with(tmp_path, line, ""))


RING = '{ pattern = "alternating_ring", parts_per_side = 32 }'
SINGLE = '{{ pattern = "single", kind = "{}", wall = "{}", along_mm = {}.4, height_mm = 3.{} }}'
SINGLES = [
    SINGLE.format(kind, wall, k, k)
    for kind in ("emitter", "receiver")
    for wall in ("north", "east")
    for k in range(32)
]
HEAVY = {
    "rows of parts": (f"layout = [{', '.join([RING] * 128)}]", {"layout"}),
    "tolerances of parts": (
        f"layout = [{', '.join(SINGLES)}]\n[tolerances]\n"
        + "\n".join(f'"layout.{k}.height_mm" = 0.1' for k in range(64)),
        {"layout.32"},
    ),
    "identifiers": (
        f"layout = [{', '.join(SINGLES)}]\n[part_measurements]\n"
        + "\n".join(f'"osram-{"sfh206-" * 7}{k}" = {{ a = 1.0 }}' for k in range(200)),
        {f"part_measurements.osram-{'sfh206-' * 7}199"},
    ),
}
"""Designs of up to 64 kB: what replaces the layout, and fields of findings among others."""


@pytest.mark.parametrize("name", HEAVY)
def test_a_heavy_design_is_checked_within_two_seconds(tmp_path, name):
    text, fields = HEAVY[name]
    file = tmp_path / "a.toml"
    head, _, rest = preset_text(PAD).partition("[[layout]]")
    rest = rest[rest.index("[indenter]") :]
    layout, _, tables = text.partition("\n")
    file.write_text(
        head.replace("schema_version", f"{layout}\nschema_version", 1) + rest + "\n" + tables, "utf-8"
    )
    assert file.stat().st_size < 64_000
    started = time.process_time()
    found = check(load_design(file))
    assert time.process_time() - started < 2.0
    assert fields <= {one.field for one in found if one.severity == "error"}


def test_a_line_of_blanks_is_explained_within_two_seconds(tmp_path):
    (tmp_path / "a.toml").write_text("a" + " " * 60_000 + "= 1 2\n")
    started = time.process_time()
    with pytest.raises(DesignError, match="not valid TOML"):
        load_design(tmp_path / "a.toml")
    assert time.process_time() - started < 2.0


def test_parts_in_one_corner_are_checked_without_a_warning():
    rows = [
        {"pattern": "per_side", "kind": "emitter", "north": 1, "shift_mm": -16.0},
        {"pattern": "per_side", "kind": "receiver", "west": 1, "shift_mm": 16.0},
    ]
    found = check(preset(PAD).with_(layout=rows))
    assert {"layout.0", "layout.1"} <= {one.field for one in found if one.severity == "error"}


def test_a_range_of_billions_of_steps_is_refused(tmp_path):
    field = {"path": "cavity.clear_thickness_mm", "low": 6.0, "high": 10.0, "step": 1e-9}
    with pytest.raises(DesignError, match=r"cavity\.clear_thickness_mm: 4e\+09 steps of 1e-09 are refused"):
        cheap_space("grid", fields=[field])


def test_messages_are_short_and_printable_whatever_they_quote():
    error = DesignError("a\x1b[31m\x00\u202e: " + "y" * 50_000 + "; way out\n" + "漢\x07 line\n" * 5_000)
    said = str(error)
    assert len(said.encode()) <= LONGEST_MESSAGE_BYTES
    assert all(one == "\n" or one.isprintable() for one in said)
    assert said.startswith("a\\x1b[31m\\x00\\u202e: yyy")
    assert "y; way out\n" in said
    assert said.endswith("more lines")
    assert readable(said) == said


def test_findings_are_printable(tmp_path):
    design = preset(PAD).with_(tolerances={"a\x1bb": 0.1})
    assert all(str(one).isprintable() for one in check(design))


def damaged_model(tmp_path, content: bytes):
    file = tmp_path / "a.optomodel"
    save_model(file, made_up_kernel_ridge())
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["touch_bias.npy"] = content
    with zipfile.ZipFile(file, "w") as archive:
        for name, one in members.items():
            archive.writestr(name, one)
    return file


def header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + bytes(8)


@pytest.mark.parametrize(
    "content", [header("(99999999999,)"), header("(" * 400), header("(1e9,)"), b"no array", b""]
)
def test_a_model_whose_array_is_damaged_is_refused(tmp_path, content):
    file = damaged_model(tmp_path, content)
    with pytest.raises(InputError, match="damaged"):
        load_model(file)
    assert main(["driver", "read", PAD, "--model", str(file)]) == BAD_INPUT


def damaged_netcdf(tmp_path, at: float):
    """The names of the file's heap overwritten: the library finds nothing where the header says that something is."""
    file = tmp_path / "a.nc"
    save_data(made_up(), file)
    content = bytearray(file.read_bytes())
    place = content.find(b"OHDR", int(len(content) * at))
    content[place + 4 : place + 40] = bytes(36)
    file.write_bytes(bytes(content))
    return file


@pytest.mark.parametrize("at", [0.0, 0.01, 0.1, 0.3])
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_netcdf_file_of_damaged_metadata_is_refused(tmp_path, at):
    file = damaged_netcdf(tmp_path, at)
    for read in (read_data, read_recording):
        with pytest.raises(InputError, match=r"a\.nc"):
            read(file)


def test_a_netcdf_file_that_unpacks_to_terabytes_is_refused(tmp_path):
    file = tmp_path / "a.nc"
    save_data(made_up(), file)
    with h5py.File(file, "r+") as held:
        held.create_dataset("more", shape=(2**42,), dtype="f4", chunks=(1024,))
    with pytest.raises(InputError, match="reads at most"):
        read_data(file)


@pytest.mark.parametrize(
    ("flux", "told"),
    [
        (np.full((2, 8, 8), b"xy"), "needs numbers"),
        (np.zeros((2, 8, 5)), "needs (state, emitter, 8)"),
    ],
    ids=["another type", "another shape"],
)
def test_simulated_signals_that_are_damaged_are_refused(tmp_path, flux, told):
    import xarray as xr

    from optopad.fabrication.driver.simulated.press_table import table_from_signals
    from tests.fabrication.driver.made_up_pad import pad_config

    config = pad_config()
    presses = {f"press_{axis}": ("state", np.zeros(2)) for axis in ("x", "y", "depth")}
    signals = xr.Dataset(presses | {"flux": (("state", "emitter", "receiver"), flux)})
    signals.attrs["design_digest"] = config.digest
    signals.to_netcdf(tmp_path / "signals.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=re.escape(told)):
        table_from_signals(tmp_path / "signals.nc", config)


def test_simulated_signals_that_unpack_to_much_are_refused_before_they_do(tmp_path):
    import h5py

    from optopad.fabrication.driver.simulated.press_table import table_from_signals
    from tests.fabrication.driver.made_up_pad import pad_config

    with h5py.File(tmp_path / "signals.nc", "w") as held:
        for axis in ("x", "y", "depth"):
            held.create_dataset(
                f"press_{axis}", shape=(2**26,), dtype="f8", chunks=(2**16,), compression="gzip"
            )
        held.create_dataset("flux", shape=(2**26, 1, 1), dtype="f8", chunks=(2**16, 1, 1), compression="gzip")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"unpacks to 2\.15e\+09 bytes, reads at most 5e\+08"):
            table_from_signals(tmp_path / "signals.nc", pad_config())
        assert tracemalloc.get_traced_memory()[1] < 50_000_000
    finally:
        tracemalloc.stop()
