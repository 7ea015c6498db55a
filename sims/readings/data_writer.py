"""Write a data set press by press: written presses survive a kill, and a complete set becomes one netCDF file.

Until then the presses are in a journal next to the file. A journal is a line of JSON, followed by one record per press,

    length of the content, CRC-32 of it (4 bytes each, little-endian), content (samples, as `_sample_type`)

Each record is flushed to the disk before the next. The writer locks the journal. If a kill or a power cut leaves a
record half-written, its length or its check sum is wrong. Such a record and all later ones are cut off, and writing
continues after the last whole press. HDF5 itself has no such guarantee: if a program is killed while it writes a file,
that file may never open again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from optopad.design.errors import InputError
from optopad.design.files import made_folder, unwritable, whole_file
from optopad.design.recordings import sets_json
from optopad.sims.readings.press_data import PressData

if TYPE_CHECKING:
    pass

RECORD = struct.Struct("<II")
CHUNK_SAMPLES = 2048
"""Number of samples per compressed chunk of the netCDF file: 0.6 MB for 8 emitters and 8 receivers."""
JOURNAL_VERSION = 1
AXIS_NAMES = ("x", "y", "depth")
DIMENSIONS = {"counts": ("time", "state", "receiver"), "others": ("time", "other", "axis")}
"""Dimensions of the variables that have more than `time`."""

ByPress = Mapping[str, Sequence[str] | Sequence[float]]


class DataWriter:
    """Writes presses to a journal that survives a kill, and makes ``file`` from it at the end.

    Parameters
    ----------
    file : the netCDF file to make, by `finish` or `write`
    header : data without samples, with the information that all samples share (see `header_of`)
    asked : plain data that identify the data set, such as protocol, seed and versions; a journal is continued only if
        its own are equal
    journal_folder : folder of the journal; by default that of the file
    by_press : variables (press,) of texts or numbers to add to the netCDF file, by name; the number of a press in its
        set is the index

    Raises
    ------
    InputError : another process or thread is making the same file.
    OutputError : the folder cannot be written.
    """

    def __init__(
        self,
        file: Path,
        header: PressData,
        *,
        asked: Any = None,
        journal_folder: Path | None = None,
        by_press: ByPress | None = None,
    ) -> None:
        self.file, self._header, self._by_press = file, header, by_press or {}
        self._type = _sample_type(header)
        self._line = _header_line(header, asked)
        name = hashlib.sha256(self._line).hexdigest()[:16]
        self.journal = (journal_folder or file.parent) / (f".{file.name}.{name}.journal")
        self._stream = self._opened()
        try:
            self._done = self._begun()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()

    @property
    def done(self) -> frozenset[tuple[int, int]]:
        """Presses in the journal, as (number of the set, number of the press in it)."""
        return frozenset(self._done)

    def add(self, press: PressData) -> None:
        """Append the samples of one or several presses to the journal, flushed to the disk.

        Raises
        ------
        InputError : states or receivers differ from the header's, or only one of the two has true positions.
        OutputError : the disk cannot be written.
        """
        for name in ("state_names", "receiver_names", "sets"):
            if getattr(press, name) != getattr(self._header, name):
                raise InputError(f"press: {name} differ from those that the file was begun with")
        content = _rows_of(press, self._type).tobytes()
        try:
            self._stream.write(RECORD.pack(len(content), zlib.crc32(content)) + content)
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as err:
            raise unwritable(self.journal, err) from err
        self._done |= _presses_of(press)

    def finish(self) -> Path:
        """Make the netCDF file from all added presses, completely or not at all, and remove the journal.

        Raises
        ------
        OutputError : the disk cannot be written; the journal is kept.
        """
        self.write()
        self._stream.close()
        self.forget()
        return self.file

    def write(self) -> None:
        """Make the netCDF file but keep the journal, for a file that is still to be moved to its final path.

        Raises
        ------
        OutputError : the disk cannot be written.
        """
        _write_whole(self.file, self._header, (rows for rows, _ in self._records()), self._by_press)

    def forget(self) -> None:
        """Remove the journal; call this after the file is at its final path."""
        self.journal.unlink(missing_ok=True)

    def _begun(self) -> set[tuple[int, int]]:
        """Numbers (set, press) of the presses that an earlier run wrote completely; cut off the rest of the journal."""
        presses: set[tuple[int, int]] = set()
        end = 0
        try:
            self._stream.seek(0)
            if self._stream.read(len(self._line)) == self._line:
                end = len(self._line)
                for rows, after in self._records():
                    presses |= {(int(s), int(p)) for s, p in zip(rows["set"], rows["place"], strict=True)}
                    end = after
            self._stream.seek(end)
            self._stream.truncate()
            if not end:
                self._stream.write(self._line)
                self._stream.flush()
        except OSError as err:
            raise unwritable(self.journal, err) from err
        return presses

    def _opened(self) -> IO[bytes]:
        made_folder(self.journal.parent)
        try:
            stream = self.journal.open("a+b")  # write at its end, read anywhere
        except OSError as err:
            raise unwritable(self.journal, err) from err
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.close()
            raise InputError(
                f"{self.file.name}: another process is writing it ({self.journal}); wait for it, or "
                "choose another folder with --out"
            ) from None
        except OSError:  # the file system has no locks
            pass
        return stream

    def _records(self) -> Iterator[tuple[NDArray[np.void], int]]:
        """For each complete record of the journal: its samples, and its end in bytes from the start of the file."""
        stream, size = self._stream, os.fstat(self._stream.fileno()).st_size
        stream.seek(len(self._line))
        while len(head := stream.read(RECORD.size)) == RECORD.size:
            length, check = RECORD.unpack(head)
            if length > size - stream.tell() or length % self._type.itemsize:
                return
            content = stream.read(length)
            if zlib.crc32(content) != check:
                return
            yield np.frombuffer(content, dtype=self._type), stream.tell()


def save_data(data: PressData, file: Path) -> Path:
    """Write data to a netCDF file in one step, completely or not at all.

    Raises
    ------
    OutputError : the folder cannot be written.
    """
    if not np.isfinite(data.others_mm).any():
        data = replace(data, others_mm=np.zeros((len(data), 0, 3)))
    header = header_of(data)
    return _write_whole(file, header, iter([_rows_of(data, _sample_type(header))]), {})


def header_of(data: PressData) -> PressData:
    """The same data without any samples."""
    return data.only(np.zeros(0, dtype=np.int64))


def _sample_type(header: PressData) -> np.dtype[np.void]:
    shape = (len(header.state_names), len(header.receiver_names))
    columns: list[Any] = [
        ("counts", "<f4", shape), ("press", "<f8", (3,)), ("time", "<f8"), ("set", "<i4"), ("place", "<i4"),
    ]  # fmt: skip
    columns += [("true", "<f8", (3,))] if header.true_press_mm is not None else []
    return np.dtype(columns + ([("others", "<f8", (tips, 3))] if (tips := _tips(header)) else []))


def _tips(header: PressData) -> int:
    """Number of further tips in each sample."""
    return int(header.others_mm.shape[1])


def _rows_of(press: PressData, kind: np.dtype[np.void]) -> NDArray[np.void]:
    rows = np.zeros(len(press), dtype=kind)
    rows["counts"], rows["press"], rows["time"] = press.counts, press.press_mm, press.time_s
    rows["set"], rows["place"] = press.set_number, press.place_number
    if "true" in (kind.names or ()):
        if press.true_press_mm is None:
            raise InputError("press: has no true_press_mm, which the file was begun with")
        rows["true"] = press.true_press_mm
    if _tips(press):
        rows["others"] = press.others_mm
    return rows


def _presses_of(press: PressData) -> set[tuple[int, int]]:
    return {(int(s), int(p)) for s, p in zip(press.set_number, press.place_number, strict=True)}


def _header_line(header: PressData, asked: Any) -> bytes:
    document = {
        "optopad_journal": JOURNAL_VERSION,
        "states": header.state_names,
        "receivers": header.receiver_names,
        "sets": [asdict(one) for one in header.sets],
        "full_scale_counts": header.full_scale_counts,
        "design_digest": header.design_digest,
        "attributes": dict(header.attributes),
        "has_truth": header.true_press_mm is not None,
        "asked": asked,
        **({"others": tips} if (tips := _tips(header)) else {}),
    }
    return json.dumps(document, sort_keys=True).encode() + b"\n"


def _write_whole(file: Path, header: PressData, parts: Iterator[NDArray[np.void]], by_press: ByPress) -> Path:
    with whole_file(file) as hidden:
        _write_netcdf(hidden, header, parts, by_press)
    return file


def _write_netcdf(
    file: Path, header: PressData, parts: Iterator[NDArray[np.void]], by_press: ByPress
) -> None:
    """Write presses one after another into one netCDF file; memory holds one press at a time.

    The length of the time axis is unlimited.
    """
    import h5netcdf

    columns = _columns(header)
    with h5netcdf.File(file, "w") as out:
        out.dimensions = {
            "time": None, "state": len(header.state_names), "receiver": len(header.receiver_names),
        }  # fmt: skip
        for name, values in (("state", header.state_names), ("receiver", header.receiver_names)):
            out.create_variable(name, (name,), dtype=_text(), data=np.array(values, dtype=object))
        for name, along in by_press.items():
            if "press" not in out.dimensions:
                out.dimensions["press"] = len(along)
            is_text = isinstance(along[0], str)
            listed = np.array(along, dtype=object if is_text else np.float64)
            out.create_variable(name, ("press",), dtype=_text() if is_text else "f8", data=listed)
        if tips := _tips(header):
            out.dimensions["other"], out.dimensions["axis"] = tips, len(AXIS_NAMES)
            out.create_variable("axis", ("axis",), dtype=_text(), data=np.array(AXIS_NAMES, dtype=object))
        for name, (_, _, kind, attributes) in columns.items():
            axes = DIMENSIONS.get(name, ("time",))
            chunks = (CHUNK_SAMPLES, *(out.dimensions[axis].size for axis in axes[1:]))
            made = out.create_variable(
                name, axes, dtype=kind, chunks=chunks, compression="gzip", compression_opts=4, shuffle=True
            )
            made.attrs.update(attributes)
        out.attrs.update(_attributes(header))
        done = 0
        for rows in parts:
            out.resize_dimension("time", done + len(rows))
            for name, (source, index, _, _) in columns.items():
                column = rows[source] if index is None else rows[source][:, index]
                out[name][done : done + len(rows)] = column
            done += len(rows)


def _columns(header: PressData) -> dict[str, tuple[str, int | None, str, dict[str, str]]]:
    """Variables of the netCDF file by name: (column of the journal, index in it, number type, attributes)."""
    place = {"units": "mm", "long_name": "as the stage reports it"}
    columns: dict[str, tuple[str, int | None, str, dict[str, str]]] = {
        "counts": ("counts", None, "f4", {"units": "counts"}),
        "press_x": ("press", 0, "f8", place),
        "press_y": ("press", 1, "f8", place),
        "press_depth": ("press", 2, "f8", place | {"positive": "into the pad"}),
        "time_s": ("time", None, "f8", {"units": "s", "long_name": "within the set"}),
        "set": ("set", None, "i4", {"long_name": "number of the set, from 0"}),
        "place": ("place", None, "i4", {"long_name": "number of the press within its set, from 0"}),
    }
    if header.true_press_mm is not None:
        truth = {"units": "mm", "long_name": "true position of the tip; known to the simulation only"}
        for index, axis in enumerate(AXIS_NAMES):
            columns[f"true_{axis}"] = ("true", index, "f8", truth)
    if _tips(header):
        more = {"units": "mm", "long_name": "further tips that touch at the same time; NaN: none"}
        columns["others"] = ("others", None, "f8", more)
    return columns


def _attributes(header: PressData) -> dict[str, Any]:
    found: dict[str, Any] = {
        "title": "optopad press data",
        "sets": sets_json(header.sets),
        "attributes": json.dumps(dict(header.attributes), sort_keys=True),
    }
    if header.design_digest is not None:
        found["design_digest"] = header.design_digest
    if header.full_scale_counts is not None:
        found["full_scale_counts"] = float(header.full_scale_counts)
    return found


def _text() -> Any:
    import h5py

    return h5py.string_dtype()
