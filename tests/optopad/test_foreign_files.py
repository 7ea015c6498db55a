"""Files as spreadsheets, editors and other programs write them: each reader reads them right or names the way out."""

from __future__ import annotations

import errno
import io
import os
import zipfile
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, NoReturn

import h5py
import pytest
import xarray as xr

from optopad.design.csv_table import read_csv
from optopad.design.errors import OptopadError
from optopad.design.io import dump_design, load_design
from optopad.design.preset import preset, preset_text
from optopad.design.press_protocol import load_protocol_file
from optopad.design.search.space import load_space
from optopad.fabrication.driver.recording.position_log import read_position_log
from optopad.fabrication.driver.recording.raw import read_records
from optopad.fabrication.driver.simulated.finger import read_path
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.driver_file import load_driver_config
from optopad.fabrication.stage.stage import read_press_list
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.readings.dataset import read_data
from optopad.sims.readings.recording import read_recording
from optopad.verbs.improve import _text as improve_text

TABLES: dict[str, tuple[Callable[[Path], Any], str, tuple[str, str]]] = {
    "press list": (read_press_list, "x_mm,y_mm,depth_mm", ("8.5,9.5,2.5", "8.5,9.5,3.5")),
    "recording": (read_recording, "depth_mm,E2-R2", ("-0.5,801.5", "0.5,799.5")),
    "position log": (read_position_log, "time_s,x_mm,y_mm,depth_mm", ("0.5,8.5,9.5,2.5", "1.5,8.5,9.5,2.5")),
    "path of a finger": (read_path, "t_s,x_mm,y_mm,depth_mm", ("0,8.5,9.5,2.5", "1.5,8.5,9.5,2.5")),
    "path of two fingers": (
        read_path,
        "t_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm",
        ("0,8.5,9.5,2.5,16.5,9.5,1.5", "1.5,8.5,9.5,2.5,16.5,9.5,1.5"),
    ),
}
"""Each reader of a table, its heading and two rows."""
DECIMAL_COMMA = "decimal comma? write 8.9, and separate by commas"
OTHERS: dict[str, Callable[[Path], Any]] = {
    "design": load_design,
    "driver.toml": load_driver_config,
    "protocol": load_protocol_file,
    "search space": load_space,
    "data set": read_data,
    "raw recording": read_records,
    "model": load_model,
}


def bytes_of(*rows: str) -> bytes:
    return ("\n".join(rows) + "\n").encode()


@pytest.mark.parametrize("name", TABLES)
def test_a_table_of_a_spreadsheet_is_read_right_or_refused_with_the_way_out(
    name: str, tmp_path: Path
) -> None:
    read, heading, rows = TABLES[name]
    file = tmp_path / "table.csv"

    def told(content: bytes) -> str:
        file.write_bytes(content)
        with pytest.raises(OptopadError) as err:
            read(file)
        assert str(file) in str(err.value)
        return str(err.value)

    plain = bytes_of(heading, *rows)
    file.write_bytes(plain)
    right = str(read(file))
    quoted = ",".join(f'"{cell}"' for cell in rows[0].split(","))
    for same in (
        b"\xef\xbb\xbf" + plain.replace(b"\n", b"\r\n"),
        plain.replace(b"\n", b"\r"),
        bytes_of(heading + ",,", rows[0] + ",,", "", ",,,,,", rows[1] + ",,"),
        bytes_of("sep=,", "# a remark", heading, quoted, rows[1]),
    ):
        file.write_bytes(same)
        assert str(read(file)) == right, same

    comma = rows[1].replace(".", ",")
    message = told(bytes_of(heading, rows[0], comma))
    assert "row 3 has" in message
    assert DECIMAL_COMMA in message
    german = [row.replace(",", ";").replace(".", ",") for row in (heading, *rows)]
    for table in (german, ["sep=;", *german], [row.replace(";", "\t") for row in german]):
        assert DECIMAL_COMMA in told(bytes_of(*table))
    assert "give an empty" in told(bytes_of(heading, rows[0], rows[1].rpartition(",")[0]))
    assert "row 3 has" in told(bytes_of(heading, rows[0], rows[1] + ",word"))
    assert "twice" in told(bytes_of(heading + ",depth_mm", rows[0] + ",1", rows[1] + ",1"))
    assert DECIMAL_COMMA in told(bytes_of(heading, rows[0], rows[1].rpartition(",")[0] + ',"2,5"'))
    assert "without its unit" in told(bytes_of(heading, rows[0], rows[1] + " mm"))
    assert "UTF-16" in told(plain.decode().encode("utf-16"))
    assert "line 1); save it as UTF-8" in told("# Größe\n".encode("latin-1") + plain)


def workbook() -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>" + "\x00")
    return held.getvalue()


def hdf5(folder: Path) -> bytes:
    with h5py.File(folder / "made.h5", "w") as held:
        held["a"] = 1
    return (folder / "made.h5").read_bytes()


@pytest.mark.parametrize("name", [*TABLES, *OTHERS])
def test_a_file_of_another_kind_is_named_with_what_is_needed(name: str, tmp_path: Path) -> None:
    read = OTHERS[name] if name in OTHERS else TABLES[name][0]
    kinds = {
        "an Excel workbook (.xlsx)": workbook(),
        "a Parquet file": b"PAR1\x15\x04\x15",
        "an MCAP log": b"\x89MCAP0\r\n\x01",
        "a MATLAB file (.mat)": b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(128) + b"\x00\x01",
        "binary data of an unknown kind": b"\x80\x04\x95\x0b\x00\x00.",
        "a gzip file": b"\x1f\x8b\x08\x00",
        "an SQLite database (.db3)": b"SQLite format 3\x00",
        "a PNG picture": b"\x89PNG\r\n\x1a\n\x00",
        "a zip archive": b"PK\x03\x04\x14\x00",
        "an HDF5 or netCDF-4 file": hdf5(tmp_path),
    }
    read_by = {
        "data set": "an HDF5 or netCDF-4 file",
        "recording": "an HDF5 or netCDF-4 file",
    }
    file = tmp_path / "given"
    for kind, content in kinds.items():
        file.write_bytes(content)
        with pytest.raises(OptopadError) as err:
            read(file)
        if kind != read_by.get(name):
            assert kind in str(err.value), str(err.value)
            assert "needs " in str(err.value)
    os.mkfifo(tmp_path / "pipe")  # opening it would wait forever
    for wrong in (tmp_path / "none", tmp_path, tmp_path / "pipe", Path("/dev/zero"), file / "in a file"):
        with pytest.raises(OptopadError, match=r"no such|folder|device|Not a directory") as err:
            read(wrong)
        assert str(err.value).startswith(str(wrong))
        assert "\n" not in str(err.value)


@pytest.mark.parametrize("name", [*TABLES, *OTHERS])
def test_a_file_without_the_right_to_read_it_is_refused_in_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = OTHERS[name] if name in OTHERS else TABLES[name][0]
    file = tmp_path / "given"
    file.write_bytes(b"a")

    def refused(path: Path, *_: object, **__: object) -> NoReturn:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(OptopadError, match=r"given: .*Permission denied") as err:
        read(file)
    assert "\n" not in str(err.value)


def test_text_from_the_pipe_of_a_shell_is_read(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.write(writing, b"a,b\n1,2\n")
    os.close(writing)
    try:
        assert read_csv(Path(f"/dev/fd/{reading}"), needed="a table").heading == ("a", "b")
    finally:
        os.close(reading)


def test_a_byte_order_mark_and_ends_of_lines_matter_in_no_text(tmp_path: Path) -> None:
    design = preset("piacenza2017-pad")
    protocol = (
        resources.files("optopad.design.protocols").joinpath("piacenza2017.toml").read_text(encoding="utf-8")
    )
    texts: dict[str, tuple[Callable[[Path], Any], str]] = {
        "design": (load_design, dump_design(design)),
        "driver.toml": (load_driver_config, dump_driver_config(design, None, None)),
        "protocol": (load_protocol_file, protocol),
    }
    for name, (read, text) in texts.items():
        file = tmp_path / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        right = read(file)
        for content in (
            b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode(),
            text.replace("\n", "\r").encode(),
        ):
            file.write_bytes(content)
            assert read(file) == right, name
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf" + preset_text("piacenza2017-pad").encode())
    assert not (improve_text(str(tmp_path / "bom.toml"), design, is_changed=False) or "").startswith("\ufeff")


def test_netcdf_3_is_refused_with_the_way_to_netcdf_4(tmp_path: Path) -> None:
    xr.Dataset({"a": ("time", [1.0])}).to_netcdf(tmp_path / "three.nc", engine="scipy")
    for read in (read_recording, read_data):
        with pytest.raises(OptopadError, match=r"a netCDF-3 file; needs .*; `nccopy -k nc4 OLD NEW` makes"):
            read(tmp_path / "three.nc")


def test_a_row_is_named_as_an_editor_numbers_it(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("# remark\n\na,b\n1,2\n\n3,x\n", encoding="utf-8")
    with pytest.raises(OptopadError, match="row 6: b is 'x'"):
        read_csv(tmp_path / "t.csv", needed="a table").numbers("b")
