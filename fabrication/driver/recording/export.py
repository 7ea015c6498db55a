"""Exports a recording as netCDF or CSV, for `optopad compare` and machine learning (see docs/reference/files.md).

netCDF needs xarray."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from design.arrays import FloatArray, IntArray
from design.errors import InputError, OutputError
from design.files import require_suffix, whole_file
from design.recordings import sets_json
from fabrication.driver.descriptor import UNITS, descriptor_of
from fabrication.driver.link.counters import Repeats, WrappingCounter, restarts
from fabrication.driver.link.protocol import Unpacked, frame_format, unpack_frames
from fabrication.driver.recording.bag import read_mcap
from fabrication.driver.recording.mcap_file import MCAP_SUFFIX
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver.recording.raw import PRESS_BYTES, Record, RecordKind, press_of, read_records
from fabrication.driver.recording.recorded import Recorded, labels_at, press_labels
from fabrication.driver.simulated.finger import FingerPath

if TYPE_CHECKING:
    import xarray as xr

US_PER_S = 1e6

CLOCK_SLACK_S = 1.0
"""Largest backward step in the times of successive records that is tolerated [s]; a larger step means that the clock
was set back."""

COMPRESSION = {"zlib": True, "complevel": 4}


def read_recorded(file: Path, path: FingerPath | None = None, topic: str | None = None) -> Recorded:
    """Read all complete frames of a recording: ``.optorec``, ``.mcap``, or a ROS 2 bag's folder.

    Parameters
    ----------
    path : presses over time by the board's clock; if None, the presses in the recording are used
    topic : topic of the frames in an MCAP file with several sensors

    Raises
    ------
    InputError : the file is not a recording, or contains no complete frame.
    """
    if file.is_dir() or file.suffix.lower() == MCAP_SUFFIX:
        found = read_mcap(file, topic)
        return found if path is None else replace(found, labels=PressLabels(press_mm=path.at(found.device_s)))
    if topic is not None:
        raise InputError(f"--topic {topic}: {file} is not an MCAP file; leave --topic out")
    _, config, every, stray = read_records(file)
    layout = frame_format(config)
    records = [record for record in every if _fits(record, layout.total_bytes)]
    stray += sum(record.size for record in every) - sum(record.size for record in records)
    whole = len(records)
    records = _without_repeats(records)
    frames = [record for record in records if record.kind == RecordKind.FRAME]
    if not frames:
        raise InputError(f"{file}: holds no whole frame")
    unpacked = unpack_frames(layout, [record.content for record in frames])
    connection = _connections(records, unpacked)
    sequence, device_us, lost = _unwrapped(unpacked, connection)
    host_s = np.array([record.host_s for record in frames])
    device_s = device_us / US_PER_S
    return Recorded(
        config=config,
        counts=unpacked.counts,
        connection=connection,
        sequence=sequence,
        device_s=device_s,
        host_s=host_s,
        labels=_presses(records, host_s) if path is None else PressLabels(press_mm=path.at(device_s)),
        lost=lost,
        doubled=whole - len(records),
        stray_bytes=stray,
        ended_cleanly=any(record.kind == RecordKind.END for record in records),
    )


def dataset_of(recorded: Recorded, name: str) -> xr.Dataset:
    """The recording as an xarray data set with named axes and units; `name` is stored in the attribute `source`."""
    import xarray as xr

    said = descriptor_of(recorded.config)
    dataset = xr.Dataset(
        {
            "counts": (("time", "state", "receiver"), recorded.counts, {"units": UNITS["counts"]}),
            "device_time": (
                "time",
                recorded.device_s,
                {"units": "s", "long_name": "since the board's reset"},
            ),
            "host_time": ("time", recorded.host_s, {"units": "s", "long_name": "since 1970"}),
            "time_s": (
                "time",
                recorded.host_s - recorded.host_s[0],
                {"units": "s", "long_name": "since the first frame, by this machine's clock"},
            ),
            "sequence": ("time", recorded.sequence, {"units": "1"}),
            "connection": ("time", recorded.connection, {"units": "1"}),
        },
        coords={"state": list(said.states), "receiver": list(said.receivers.names)},
        attrs={
            "title": "optopad recording",
            "source": name,
            "design": said.design,
            "design_digest": said.digest,
            "full_scale_counts": float(said.full_scale),
            "lost_frames": recorded.lost,
        },
    )
    if recorded.labels is not None:
        _label(dataset, recorded.labels)
    return dataset


def _label(dataset: xr.Dataset, labels: PressLabels) -> None:
    for k, axis in enumerate(("press_x", "press_y", "press_depth")):
        positive = {"positive": "into the pad"} if axis == "press_depth" else {}
        dataset[axis] = ("time", labels.press_mm[:, k], {"units": "mm"} | positive)
    if labels.set_number is not None:
        dataset["set"] = ("time", labels.set_number, {"long_name": "number in the attribute sets, from 0"})
    if labels.place_number is not None:
        dataset["place"] = ("time", labels.place_number, {"long_name": "press within its set"})
    if labels.sets:
        dataset.attrs["sets"] = sets_json(labels.sets)


def _add_moves(dataset: xr.Dataset, moves: FloatArray) -> None:
    known = {"units": "mm", "long_name": "path of the tip, linear between these times; NaN: unknown"}
    dataset["move_time"] = ("move", moves[:, 0], {"units": "s", "long_name": "since 1970"})
    for k, axis in enumerate(("move_x", "move_y", "move_depth"), start=1):
        dataset[axis] = ("move", moves[:, k], known)


def write_netcdf(recorded: Recorded, out: Path, name: str, moves: FloatArray | None = None) -> None:
    """Write frames as netCDF; the file is written completely or not at all.

    Parameters
    ----------
    name : origin of the frames, for the attribute `source`
    moves : knots (n, 4) of the tip's path: times since 1970 [s] and x, y, depth [mm], NaN where unknown; None if
        the path is not known

    Raises
    ------
    OutputError : the folder cannot be written, or xarray is missing.
    """
    require_suffix(out, (".nc",))
    try:
        dataset = dataset_of(recorded, name)
        if moves is not None:
            _add_moves(dataset, moves)
        encoding: dict[Any, Any] = {"counts": COMPRESSION}
        with whole_file(out) as hidden:
            dataset.to_netcdf(hidden, engine="h5netcdf", encoding=encoding)
    except ImportError as err:
        raise OutputError(
            f"{out}: netCDF needs xarray and h5netcdf: {err}; pip install xarray h5netcdf"
        ) from None


def write_csv(recorded: Recorded, out: Path, name: str) -> None:
    """Write frames as a table for `optopad compare`, with one table row per frame and one column per pair.

    Signals are readings minus those in the dark state [counts]. Positions are included if the recording has them [mm].
    For parameters and errors see `write_netcdf`.
    """
    require_suffix(out, (".csv",))
    said, labels = descriptor_of(recorded.config), recorded.labels
    columns: dict[str, Iterable[Any]] = {
        "time_s": (f"{time_s:.6f}" for time_s in recorded.host_s - recorded.host_s[0]),
        "connection": recorded.connection,
        "sequence": recorded.sequence,
    }
    if labels is not None:
        for axis, values in zip(("x_mm", "y_mm", "depth_mm"), labels.press_mm.T, strict=True):
            columns[axis] = (f"{value:.4f}" for value in values)
        if labels.set_number is not None and labels.sets:
            columns["set"] = (labels.sets[number].name for number in labels.set_number)
        if labels.place_number is not None:
            columns["place"] = labels.place_number
    signals = recorded.signals.astype(np.int64)
    for i, emitter in enumerate(said.emitters.names):
        for j, receiver in enumerate(said.receivers.names):
            columns[f"{emitter}-{receiver}"] = signals[:, i, j]
    with whole_file(out) as hidden, hidden.open("w", encoding="utf-8", newline="") as stream:
        stream.write(f"# optopad recording {name!r} of {said.design}; ADC counts, less the dark state's\n")
        stream.write(f"# design_digest: {said.digest}\n")
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(columns)
        table.writerows(zip(*columns.values(), strict=True))


def can_export() -> bool:
    """Whether the libraries for netCDF are installed."""
    from importlib.util import find_spec

    return all(find_spec(name) is not None for name in ("xarray", "h5netcdf"))


def _without_repeats(records: list[Record]) -> list[Record]:
    kept, repeats = [], Repeats()
    for record in records:
        if record.kind == RecordKind.HELLO:
            repeats = Repeats()
        if record.kind != RecordKind.FRAME or not repeats.has(record.content):
            kept.append(record)
    return kept


def _connections(records: list[Record], found: Unpacked) -> IntArray:
    """Connection number of each frame, from 1, shape (n,).

    The number increases after every hello (identification of the board), and if a sequence number does not increase.
    """
    begins, number = np.zeros(len(found.sequence), dtype=bool), 0
    is_new = False
    for record in records:
        if record.kind == RecordKind.HELLO:
            is_new = True
        elif record.kind == RecordKind.FRAME:
            begins[number] = is_new
            number, is_new = number + 1, False
    begins[restarts(found.sequence, int(found.sequence[0]) - 1)] = True
    begins[0] = False
    numbers: IntArray = 1 + np.cumsum(begins)
    return numbers


def _unwrapped(found: Unpacked, connection: IntArray) -> tuple[IntArray, IntArray, int]:
    sequence, device_us = np.empty(len(connection), np.int64), np.empty(len(connection), np.int64)
    lost = 0
    for number in np.unique(connection):
        own = connection == number
        sequence[own], steps = WrappingCounter(goes_back=True).extended(found.sequence[own])
        device_us[own], _ = WrappingCounter(goes_back=False).extended(found.device_us[own])
        lost += int((steps - 1).sum())
    return sequence, device_us, lost


def _fits(record: Record, frame_bytes: int) -> bool:
    lengths = {RecordKind.FRAME: frame_bytes, RecordKind.PRESS: PRESS_BYTES}
    return len(record.content) == lengths.get(record.kind, len(record.content))


def _presses(records: list[Record], host_s: FloatArray) -> PressLabels | None:
    """Press of each frame; None if the recording contains no presses."""
    said = [record for record in records if record.kind == RecordKind.PRESS]
    if not said:
        return None
    values = np.array([press_of(record) for record in said])
    steps_s = np.diff([record.host_s for record in records])
    if (steps_s < -CLOCK_SLACK_S).any():  # the clock was set back: the file's order is used
        kinds = np.array([record.kind for record in records])
        return labels_at(values, (np.cumsum(kinds == RecordKind.PRESS) - 1)[kinds == RecordKind.FRAME])
    return press_labels(values, np.array([record.host_s for record in said]), host_s)
