"""Exports a recording as netCDF or CSV, for `optopad compare` and machine learning (see docs/reference/files.md).

netCDF needs xarray."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError, OutputError
from optopad.design.files import require_suffix, whole_file
from optopad.design.progress import OnStep, silent
from optopad.design.recordings import LOSSES, sets_json, signals_of
from optopad.fabrication.driver.descriptor import UNITS, descriptor_of
from optopad.fabrication.driver.link.frames import Repeats, WrappingCounter, restarts
from optopad.fabrication.driver.link.protocol import STAMP, Unpacked, frame_format, unpack_frames
from optopad.fabrication.driver.recording.bag import is_bag, read_mcap
from optopad.fabrication.driver.recording.mcap_file import FRAMES_A_PIECE, MCAP_SUFFIX, STEP, write_mcap
from optopad.fabrication.driver.recording.raw import RawRecording, RecordKind, packed_size, read_raw
from optopad.fabrication.driver.recording.recorded import (
    NEVER_NS,
    Moments,
    PressLabels,
    Recorded,
    press_labels,
)
from optopad.fabrication.driver.simulated.finger import FingerPath

if TYPE_CHECKING:
    import xarray as xr

US_PER_S = 1e6
LOST_BYTES = 4
"""Number of bytes that damage may have removed or added where the rest are those of lost frames."""

COMPRESSION = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


def read_recorded(
    file: Path,
    path: FingerPath | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    *,
    with_presses: bool = True,
    on_step: OnStep = silent,
) -> Recorded:
    """Read all complete frames of a recording: ``.optorec``, ``.mcap``, or a ROS 2 bag's file or folder.

    Parameters
    ----------
    path : presses over time by the board's clock; if None, the presses in the recording are used
    topic, press_topic : topics of frames and presses in a bag of several sensors
    with_presses : whether presses in the recording are used, if `path` is None

    Raises
    ------
    InputError : the file is not a recording, or contains no complete frame.
    """
    if os.path.isdir(file) or is_bag(file):
        found = read_mcap(file, topic, press_topic, with_presses=with_presses and path is None)
        return found if path is None else replace(found, labels=_labels_of(path, found.device_s))
    for option, value in (("--topic", topic), ("--press-topic", press_topic)):
        if value is not None:
            raise InputError(f"{option} {value}: {file} is not a bag or MCAP file; leave {option} out")
    raw = read_raw(file, on_step)
    if not raw.frames:
        raise InputError(f"{file}: holds no whole frame")
    is_kept = _without_repeats(raw)
    kinds, record_s = raw.kinds[is_kept], raw.host_s[is_kept]
    unpacked = _unpacked(raw, is_kept[raw.kinds == RecordKind.FRAME])
    connection = _connections(kinds, unpacked)
    sequence, device_us, lost = _unwrapped(unpacked, connection)
    device_s = device_us / US_PER_S
    has_presses = with_presses and path is None and len(raw.presses_mm) > 0
    labels, known = (
        _presses(raw, is_kept, sequence, connection)
        if has_presses
        else (None, np.ones(len(connection), np.bool_))
    )
    found = Recorded(
        config=raw.config,
        counts=unpacked.counts,
        connection=connection,
        sequence=sequence,
        device_s=device_s,
        host_s=record_s[kinds == RecordKind.FRAME],
        labels=labels,
        lost=lost,
        doubled=len(raw.kinds) - len(kinds),
        stray_bytes=raw.stray_bytes,
        ended_cleanly=bool((kinds == RecordKind.END).any()),
    )
    if path is not None:
        return replace(found, labels=_labels_of(path, device_s))
    if known.all():
        return found
    return replace(found.only(known), left_out=int(np.count_nonzero(~known)))


def _labels_of(path: FingerPath, device_s: FloatArray) -> PressLabels:
    tips_mm = path.at(device_s).reshape(len(device_s), -1, 3)
    return PressLabels(press_mm=tips_mm[:, 0], others_mm=tips_mm[:, 1:])


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
            **({} if recorded.is_whole else {LOSSES: recorded.losses}),
        },
    )
    if recorded.labels is not None:
        _label(dataset, recorded.labels)
    return dataset


def _label(dataset: xr.Dataset, labels: PressLabels) -> None:
    for k, axis in enumerate(("press_x", "press_y", "press_depth")):
        positive = {"positive": "into the pad"} if axis == "press_depth" else {}
        dataset[axis] = ("time", labels.press_mm[:, k], {"units": "mm"} | positive)
    if (labels.others_mm[..., 2] > 0.0).any():
        known = {"units": "mm", "long_name": "further tips that touch at the same time; NaN: none"}
        dataset["others"] = (("time", "other", "axis"), labels.others_mm, known)
        dataset.coords["axis"] = ["x", "y", "depth"]
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


def write_export(recorded: Recorded, out: Path, name: str, *, on_step: OnStep = silent) -> None:
    """Write frames in the format that the file's suffix names: netCDF, .csv or .mcap; see `write_netcdf`."""
    if out.suffix.lower() == MCAP_SUFFIX:
        write_mcap(recorded, out, on_step=on_step)
    elif out.suffix.lower() == ".csv":
        write_csv(recorded, out, name, on_step=on_step)
    else:
        write_netcdf(recorded, out, name, on_step=on_step)


def write_netcdf(
    recorded: Recorded, out: Path, name: str, moves: FloatArray | None = None, *, on_step: OnStep = silent
) -> None:
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
        with whole_file(out) as hidden:
            dataset.drop_vars("counts").to_netcdf(hidden, engine="h5netcdf")
            _append_counts(hidden, dataset["counts"], on_step)
    except ImportError as err:
        raise OutputError(
            f"{out}: netCDF needs xarray and h5netcdf: {err}; pip install xarray h5netcdf"
        ) from None


def _append_counts(file: Path, counts: xr.DataArray, on_step: OnStep) -> None:
    """Append the readings to a netCDF file part by part, because Python cannot interrupt the writing of a part."""
    import h5netcdf

    count, chunk = len(counts), (min(len(counts), FRAMES_A_PIECE), 1, 1)
    with h5netcdf.File(file, "a") as netcdf:
        made = netcdf.create_variable("counts", counts.dims, counts.dtype, chunks=chunk, **COMPRESSION)
        made.attrs["units"] = counts.attrs["units"]
        for begin in range(0, count, FRAMES_A_PIECE):
            end = min(begin + FRAMES_A_PIECE, count)
            made[begin:end] = counts.values[begin:end]
            on_step(STEP, end / count)


def write_csv(recorded: Recorded, out: Path, name: str, *, on_step: OnStep = silent) -> None:
    """Write frames as a table for `optopad compare`, with one table row per frame and one column per pair.

    Signals are readings minus those in the dark state [counts]. Positions are included if the recording has them [mm].
    For parameters and errors see `write_netcdf`.
    """
    require_suffix(out, (".csv",))
    recorded.require_one_finger(out)
    said, count = descriptor_of(recorded.config), len(recorded.sequence)
    with whole_file(out) as hidden, hidden.open("w", encoding="utf-8", newline="") as stream:
        stream.write(f"# optopad recording {name!r} of {said.design}; ADC counts, less the dark state's\n")
        stream.write(f"# design_digest: {said.digest}\n")
        if not recorded.is_whole:
            stream.write(f"# {LOSSES}: {recorded.losses}\n")
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(_columns(recorded, slice(0, 0)))
        for begin in range(0, count, FRAMES_A_PIECE):
            part = slice(begin, begin + FRAMES_A_PIECE)
            table.writerows(zip(*_columns(recorded, part).values(), strict=True))
            on_step(STEP, min(begin + FRAMES_A_PIECE, count) / count)


def _columns(recorded: Recorded, part: slice) -> dict[str, Iterable[Any]]:
    said, labels = descriptor_of(recorded.config), recorded.labels
    columns: dict[str, Iterable[Any]] = {
        "time_s": (f"{time_s:.6f}" for time_s in (recorded.host_s[part] - recorded.host_s[0]).tolist()),
        "connection": recorded.connection[part].tolist(),
        "sequence": recorded.sequence[part].tolist(),
    }
    if labels is not None:
        for axis, values in zip(("x_mm", "y_mm", "depth_mm"), labels.press_mm[part].T.tolist(), strict=True):
            columns[axis] = (f"{value:.4f}" for value in values)
        if labels.set_number is not None and labels.sets:
            columns["set"] = (labels.sets[number].name for number in labels.set_number[part])
        if labels.place_number is not None:
            columns["place"] = labels.place_number[part].tolist()
    signals = signals_of(recorded.counts[part].astype(np.int64))
    pairs = [f"{emitter}-{receiver}" for emitter in said.emitters.names for receiver in said.receivers.names]
    return columns | dict(zip(pairs, signals.reshape(len(signals), len(pairs)).T.tolist(), strict=True))


def can_export() -> bool:
    """Whether the libraries for netCDF are installed."""
    from importlib.util import find_spec

    return all(find_spec(name) is not None for name in ("xarray", "h5netcdf"))


def _without_repeats(raw: RawRecording) -> BoolArray:
    """Whether each record is no frame that repeats one of the last 256 of its connection, shape (r,)."""
    is_kept = np.ones(len(raw.kinds), dtype=bool)
    stamps = np.concatenate([frames[:, STAMP] for frames in raw.frames]).view(np.uint64)
    if len(np.unique(stamps)) == len(stamps):
        return is_kept
    messages, repeats = (message.tobytes() for frames in raw.frames for message in frames), Repeats()
    for k, kind in enumerate(raw.kinds.tolist()):
        if kind == RecordKind.HELLO:
            repeats = Repeats()
        elif kind == RecordKind.FRAME:
            is_kept[k] = not repeats.has(next(messages))
    return is_kept


def _unpacked(raw: RawRecording, is_kept: BoolArray) -> Unpacked:
    """The kept frames of a recording, unpacked piece by piece; each piece's bytes are given up."""
    layout, count = frame_format(raw.config), int(is_kept.sum())
    sequence, device_us = np.empty(count, np.uint32), np.empty(count, np.uint32)
    counts = np.empty((count, layout.emitters + 1, layout.receivers), np.uint16)
    read = end = 0
    raw.frames.reverse()
    while raw.frames:
        frames = raw.frames.pop()
        part = unpack_frames(layout, [frames[is_kept[read : read + len(frames)]].tobytes()])
        begin, end, read = end, end + len(part.sequence), read + len(frames)
        sequence[begin:end], device_us[begin:end] = part.sequence, part.device_us
        counts[begin:end] = part.counts
    return Unpacked(sequence=sequence, device_us=device_us, counts=counts)


def _connections(kinds: NDArray[np.uint8], found: Unpacked) -> IntArray:
    """Connection number of each frame, from 1, shape (n,).

    The number increases after every hello (identification of the board), and if a sequence number does not increase.

    Parameters
    ----------
    kinds : types of all records, as in `RecordKind`, shape (r,)
    """
    hellos = np.cumsum(kinds == RecordKind.HELLO)[kinds == RecordKind.FRAME]
    begins = np.diff(hellos, prepend=hellos[0]) > 0
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


def _presses(
    raw: RawRecording, is_kept: BoolArray, sequence: IntArray, connection: IntArray
) -> tuple[PressLabels, BoolArray]:
    """Press of each kept frame, and whether it is known; damage of whole frames alone leaves it known."""
    time_ns = np.rint(raw.host_s * 1e9).astype(np.int64)
    places = [np.flatnonzero(is_kept & (raw.kinds == kind)) for kind in (RecordKind.PRESS, RecordKind.FRAME)]
    presses, frames = (Moments(time_ns=time_ns[place], place=place) for place in places)
    frame_bytes = packed_size(frame_format(raw.config).total_bytes)
    gaps_ns = []
    for behind, size in raw.gaps:
        k = int(np.searchsorted(frames.place, behind))
        is_within = 0 < k < len(sequence) and connection[k] == connection[k - 1]
        more = size - frame_bytes * (sequence[k] - sequence[k - 1] - 1) if is_within else size
        if abs(more) > LOST_BYTES:
            gaps_ns.append((int(time_ns[behind - 1]) if behind else NEVER_NS, int(time_ns[behind])))
    return press_labels(raw.presses_mm, presses, frames, gaps_ns)
