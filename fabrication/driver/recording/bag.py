"""Reads bags of ROS 2 and MCAP files with messages of `optopad_msgs`; ROS is not needed.

Any channels of these message types are read, from files or from the folder of a bag; others are skipped. Files are read
in the order of `metadata.yaml` or, without it, of their names. Frames are then ordered by log time, if their sequence
numbers agree with it; else, as after the clock was set back, in the order of the files. A file that lost its end or
other parts keeps every complete chunk.

Presses are valid within one recording, which may have several files: a file continues the one before it if its frames
continue the connection. Another file, even of a node that restarted just then, is another recording.

Within a connection, sequence number and board's clock increase from frame to frame. Where they do not, the board has
started again, if it can have: its clock shows less than the time since the frame before. Otherwise the frames are out
of order. Log times order the frames unless the order in which the recorder wrote them agrees better with the sequence
numbers. The latter is right after the recorder's clock was set back.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.files import read_text
from optopad.fabrication.driver.link.protocol import frame_format
from optopad.fabrication.driver.recording.bag_file import (
    BagFile,
    Channel,
    McapFile,
    SqliteFile,
    message_content,
)
from optopad.fabrication.driver.recording.mcap_file import FRAME, INSTALL, NS_PER_S, PRESS, SENSOR
from optopad.fabrication.driver.recording.messages import Frames, Presses, decoder_of
from optopad.fabrication.driver.recording.recorded import (
    NEVER_NS,
    Moments,
    PressLabels,
    Recorded,
    Start,
    absent_frames,
    press_labels,
    with_earlier_losses,
)
from optopad.fabrication.driver_file import DriverConfig, config_from_document

US_PER_S = 1_000_000
LATE_US = 50_000
"""Longest delay of a frame that may make a pause look shorter than the time since the board's start [us]."""
WRAP_US = 1 << 31
"""Backward step of the board's clock from which it was the wrap of its 32-bit counter [us]."""
NEXT_FRAMES = 10
"""Number of frames after the end of a connection that would continue it."""


def ordered(frames: Frames) -> tuple[IntArray, IntArray]:
    """Numbers of the frames in the order in which the sensor sent them, without doubled ones, and their connections.

    Returns
    -------
    shapes (n,) and (n,); connections count from 1

    Raises
    ------
    InputError : the frames contradict each other.
    """
    every = _Columns(
        *(
            frames.column(name)
            for name in ("connection", "sequence", "device_us", "arrived_ns", "time_ns", "place")
        )
    )
    count = len(every.place)
    by_time = (
        np.arange(count)
        if _is_sorted(every.time_ns, every.place)
        else np.lexsort((every.place, every.time_ns))
    )
    found = every.taken(by_time)
    if found.begins().all_rise:
        return by_time, np.ones(count, dtype=np.int64)
    single = by_time[found.is_first()]
    by_place = single[np.argsort(every.place[single], kind="stable")]
    candidates = [(order, every.taken(order).begins()) for order in (single, by_place)]
    order, begins = min(candidates, key=lambda one: (one[1].unexplained, one[1].count))
    if begins.unexplained:
        order, begins = _sorted_within(every, *candidates[0])
    elif order is by_place:
        _require_even(every.taken(order))
    _require_new_starts(every.taken(order), begins.mask)
    connection: IntArray = 1 + np.cumsum(begins.mask)
    return order, connection


@dataclass(frozen=True)
class _Begins:
    """Which frames cannot follow the frame before in one connection, and which of them a new start explains."""

    mask: BoolArray
    explained: BoolArray

    @property
    def all_rise(self) -> bool:
        return not self.mask.any()

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.mask))

    @property
    def unexplained(self) -> int:
        return int(np.count_nonzero(self.mask & ~self.explained))


@dataclass(frozen=True)
class _Columns:
    connection: IntArray
    sequence: IntArray
    device_us: IntArray
    arrived_ns: IntArray
    time_ns: IntArray
    place: IntArray

    def taken(self, order: IntArray) -> _Columns:
        return _Columns(*(column[order] for column in vars(self).values()))

    def is_first(self) -> BoolArray:
        """Whether each frame is the first with its numbers and times."""
        columns = (self.arrived_ns, self.device_us, self.sequence, self.connection)
        order = np.lexsort(columns)
        mask = np.ones(len(order), dtype=np.bool_)
        mask[order[1:]] = np.any([np.diff(column[order]) != 0 for column in columns], axis=0)
        return mask

    def begins(self) -> _Begins:
        steps = [np.diff(column) for column in (self.connection, self.sequence, self.device_us)]
        connection, sequence, device_us = steps
        rises = (sequence > 0) & (device_us >= 0)
        passed_us = np.diff(self.time_ns) // 1000
        can_start = (connection > 0) | (self.device_us[1:] <= passed_us + LATE_US)
        can_start |= (sequence > 0) & ((connection < 0) & (device_us >= 0) | (device_us < -WRAP_US))
        mask = ~((connection == 0) & rises)
        return _Begins(np.concatenate([[False], mask]), np.concatenate([[False], can_start]))


def _is_sorted(time_ns: IntArray, place: IntArray) -> bool:
    step = np.diff(time_ns)
    return bool(((step > 0) | (step == 0) & (np.diff(place) > 0)).all())


def _sorted_within(every: _Columns, order: IntArray, begins: _Begins) -> tuple[IntArray, _Begins]:
    """Sort frames by their numbers within each run between new starts; raises InputError if that is no order either."""
    found = every.taken(order)
    run = np.cumsum(begins.mask & begins.explained)
    again = order[np.lexsort((found.sequence, found.connection, run))]
    after = every.taken(again).begins()
    if after.unexplained:
        raise InputError(
            f"{begins.unexplained} frames are out of order, and sequence numbers, board's clock and log times "
            "contradict each other: the file is damaged, or has several recordings of one time; keep those in folders "
            "of their own"
        )
    return again, after


def _require_even(found: _Columns) -> None:
    """Refuse an order of files in which the board's clock does not go on where the log time steps back."""
    device_us, sequence = np.diff(found.device_us), np.diff(found.sequence)
    goes_on = (device_us >= 0) & (sequence > 0) & (np.diff(found.connection) == 0)
    back = goes_on & (np.diff(found.time_ns) < 0)
    interval_us = np.median(device_us[goes_on] / sequence[goes_on])
    off_us = np.abs(device_us - sequence * interval_us)
    if (off_us[back] > US_PER_S + 0.1 * device_us[back]).any():
        raise InputError(
            "log times step back between frames that do not follow each other: the folder has several recordings; keep "
            "them in folders of their own"
        )


def _require_new_starts(found: _Columns, begins: BoolArray) -> None:
    """Refuse an order in which a connection continues one that comes later, as after the clock was set back."""
    first = np.flatnonzero(np.concatenate([[True], begins[1:]]))
    last = np.concatenate([first[1:] - 1, [len(begins) - 1]])
    ends = {(int(found.connection[k]), int(found.sequence[k])): int(k) for k in last}
    for one, k in enumerate(first.tolist()):
        for step in range(1, NEXT_FRAMES + 1):
            end = ends.get((int(found.connection[k]), int(found.sequence[k]) - step))
            if end is None or end <= last[one]:
                continue
            passed_us = int(found.device_us[k] - found.device_us[end])
            if 0 < passed_us < US_PER_S:
                raise InputError(
                    "the clock was set back between files, and their order is not known: add metadata.yaml, or name "
                    "the files in their order"
                )


METADATA = "metadata.yaml"
MOST_METADATA_BYTES = 20_000_000
SUFFIXES = (".mcap", ".mcap.zstd", ".db3", ".db3.zstd")
"""Endings of a bag's files: MCAP or SQLite, the latter also compressed as a whole."""
KINDS = frozenset((SENSOR, FRAME, PRESS))
BATCH = 4096
"""Number of messages that are decoded at a time."""
PAUSE_NS = 5 * NS_PER_S
"""Longest pause between the frames of two files of one recording, if frames are missing between them [ns]."""
FOREVER_NS = np.iinfo(np.int64).max
CONVERT = "`ros2 bag convert`, with `storage_id: mcap` and no compression in its output options"
_WORDS = re.compile(r"(?:^|(?<=[/_]))(?:frames?|press(?:es)?|sensors?)(?=$|[/_])")


def is_bag(file: Path) -> bool:
    """Whether a path is a file or folder of a bag, by its name or by the names in the folder."""
    if not os.path.isdir(file):
        return _is_bag_file(file.name)
    try:
        return any(_is_bag_file(name) or name == METADATA for name in os.listdir(file))
    except OSError:
        return False


def read_mcap(
    file: Path, topic: str | None = None, press_topic: str | None = None, *, with_presses: bool = True
) -> Recorded:
    """Read the frames and presses of a file of a bag, or of the files in a bag's folder.

    Parameters
    ----------
    topic : topic of the frames; None if the bag has frames of one sensor only
    press_topic : topic of the presses; None for the one that belongs to the frames by its name
    with_presses : whether the presses in the bag are joined; if not, the recording has none

    Raises
    ------
    InputError : no such file, a damaged one, or one without frames of optopad; frames of several sensors; topics that
        do not clearly belong together; or frames or presses whose order is unknown.
    """
    read = _Bag(file, topic)
    topic = read.topic_of_frames(topic)
    config = read.config_of(topic)
    frames, presses = read.frames[topic], read.presses_of(topic, press_topic) if with_presses else None
    try:
        order, connection = ordered(frames)
        starts = read.starts(frames, order, connection, presses)
        labels, known = _labels(presses, frames, order, read.gaps_ns(), starts)
    except InputError as err:
        raise InputError(f"{file}: {topic}: {err}") from None
    kept = slice(None) if len(order) == len(frames) and (np.diff(order) == 1).all() else order
    sequence = frames.column("sequence")[kept]
    found = Recorded(
        config=config,
        counts=frames.counts[kept],
        connection=connection,
        sequence=sequence,
        device_s=frames.column("device_us")[kept] / 1e6,
        host_s=_seconds(frames.column("arrived_ns")[kept]),
        labels=labels,
        lost=absent_frames(connection, sequence),
        doubled=len(frames) - len(order),
        stray_bytes=read.stray_bytes,
        ended_cleanly=read.ended_cleanly,
        missing_files=read.missing,
    )
    try:
        for one in read.losses_of(topic):
            found = with_earlier_losses(found, one)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    if known.all():
        return found
    if not known.any():
        raise InputError(f"{file}: {topic}: the press of no frame is known: {found.losses}; record again")
    return replace(found.only(known), left_out=found.left_out + int(np.count_nonzero(~known)))


def _labels(
    presses: Presses | None,
    frames: Frames,
    order: IntArray,
    gaps_ns: list[tuple[int, int]],
    starts: list[Start],
) -> tuple[PressLabels | None, BoolArray]:
    if presses is None or not len(presses):
        return None, np.ones(len(order), dtype=np.bool_)
    when = Moments(time_ns=frames.column("time_ns")[order], place=frames.column("place")[order])
    return press_labels(
        presses.press_mm, Moments(time_ns=presses.time_ns, place=presses.place), when, gaps_ns, starts
    )


def _config(text: str, where: str) -> DriverConfig:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise InputError(f"{where}: cannot be read: {err}; record again") from None
    return config_from_document(document, where=where)


def _shape_of(config: DriverConfig) -> tuple[int, int]:
    layout = frame_format(config)
    return layout.emitters + 1, layout.receivers


def _seconds(time_ns: IntArray) -> FloatArray:
    """Times [s] from nanoseconds, as `mcap_file.seconds` gives each of them."""
    whole, rest = np.divmod(time_ns, NS_PER_S)
    return np.asarray(whole + rest / NS_PER_S, dtype=np.float64)


@dataclass(kw_only=True)
class _Part:
    """Log times of a file's first and last message [ns], and of those around its missing parts.

    `place` is the place of its first message among those of all files.
    """

    place: int
    first_ns: int | None = None
    last_ns: int | None = None
    gaps_ns: list[list[int | None]] = field(default_factory=list)

    def note(self, time_ns: int) -> None:
        """Take the log time of the next frame or press."""
        self.first_ns = time_ns if self.first_ns is None else min(self.first_ns, time_ns)
        self.last_ns = time_ns if self.last_ns is None else max(self.last_ns, time_ns)
        for gap in self.gaps_ns:
            gap[1] = time_ns if gap[1] is None else gap[1]


class _Bag:
    """All messages of optopad in a file of a bag, or in the files of a folder.

    Attributes
    ----------
    kinds : by topic, the type of its messages, also of channels without messages
    frames, presses, configs : by topic, the frames, the presses, and the different driver configurations
    missing : names of files that `metadata.yaml` lists, but that are not in the folder
    stray_bytes : number of bytes in damaged parts and behind the last complete record
    ended_cleanly : whether the recorder ended every file normally, and no file is missing
    """

    def __init__(self, file: Path, topic: str | None) -> None:
        self.file = file
        self.kinds: dict[str, str] = {}
        self.frames: dict[str, Frames] = {}
        self.presses: dict[str, Presses] = {}
        self.configs: dict[str, dict[str, None]] = {}
        self.stray_bytes, self.ended_cleanly = 0, True
        self._wanted = topic
        self._parts: list[_Part] = []
        self._losses: list[dict[str, str]] = []
        self._place = 0
        files = _files(file)
        self.missing = tuple(one.name for one in files if not os.path.lexists(one))
        self._fault = next(filter(None, [self._read(one) for one in files]), "")
        if not self.kinds and self._fault:
            raise InputError(f"{file}: is not an MCAP file, or damaged: {self._fault}")

    def topic_of_frames(self, topic: str | None) -> str:
        """The given topic, or the only one, with frames; raises InputError."""
        found = [name for name, frames in self.frames.items() if topic in (None, name) and len(frames)]
        if len(found) > 1:
            raise InputError(
                f"{self.file}: has frames of several sensors; give --topic, one of {', '.join(sorted(found))}"
            )
        if not found:
            raise self._lacks(FRAME, "" if topic is None else f" on {topic}")
        return found[0]

    def presses_of(self, topic: str, press_topic: str | None) -> Presses | None:
        """The presses of a topic, or those that belong to a topic of frames by its name; None if there are none.

        Topics belong together if their names are the same without the words frame, press and sensor. Else the only
        topic of presses is taken, if no other sensor has it, and one of both names no sensor. Raises InputError.
        """
        found, pad = self._topics_of(PRESS), _pad_of(topic)
        if press_topic is not None:
            if press_topic not in found:
                raise self._lacks(PRESS, f" on {press_topic}")
            return self.presses.get(press_topic)
        others = {_pad_of(name) for kind in (FRAME, SENSOR) for name in self._topics_of(kind)} - {pad}
        own = [name for name in found if _pad_of(name) == pad]
        free = own or [name for name in found if _pad_of(name) not in others]
        if not free:
            return None
        if len(own) == 1 or (len(free) == 1 and not others and _may_belong(_pad_of(free[0]), pad)):
            return self.presses.get(free[0])
        raise InputError(
            f"{self.file}: it is not clear which presses belong to {topic}; give --press-topic, one of "
            f"{', '.join(sorted(found))}"
        )

    def config_of(self, topic: str) -> DriverConfig:
        """The driver configuration that belongs to a topic of frames; raises InputError.

        Nodes in one namespace may share the topic of configurations; then numbers of states and receivers decide.
        """
        found, pad = self._topics_of(SENSOR), _pad_of(topic)
        others = {_pad_of(name) for name in self._topics_of(FRAME)} - {pad}
        own = [name for name in found if _pad_of(name) == pad] or [
            name for name in found if _pad_of(name) not in others and _may_belong(_pad_of(name), pad)
        ]
        texts = sorted({text for name in own for text in self.configs.get(name, {})})
        if not texts:
            raise self._lacks(SENSOR, f" that belongs to {topic}")
        configs = [_config(text, f"{self.file}: the driver configuration of {topic}") for text in texts]
        shape = self.frames[topic].shape
        fitting = {one.digest: one for one in configs if _shape_of(one) == shape}
        if not fitting:
            raise InputError(
                f"{self.file}: {topic} has frames of another sensor than its driver configuration; record again"
            )
        if len(fitting) > 1:
            raise InputError(
                f"{self.file}: the frames of {topic} may be of several designs, "
                f"{', '.join(sorted(digest[:8] for digest in fitting))}; record each sensor with a topic of its own, "
                "and keep recordings of two designs in folders of their own"
            )
        return next(iter(fitting.values()))

    def gaps_ns(self) -> list[tuple[int, int]]:
        """Log times of the last message before and the first one behind each missing part of the bag [ns]."""
        found = []
        for number, part in enumerate(self._parts):
            before = [one.last_ns for one in self._parts[:number] if one.last_ns is not None]
            for begin_ns, end_ns in part.gaps_ns:
                begin = begin_ns if begin_ns is not None else before[-1] if before else NEVER_NS
                later = [
                    one.first_ns for one in self._parts if one.first_ns is not None and one.first_ns > begin
                ]
                found.append((begin, end_ns if end_ns is not None else min(later, default=FOREVER_NS)))
        return found

    def losses_of(self, topic: str) -> list[dict[str, str]]:
        """Metadata on losses of the recordings of which the frames of a topic are copies, once for each recording."""
        return [one for one in self._losses if one.get("topic") == topic]

    def starts(
        self, frames: Frames, order: IntArray, connection: IntArray, presses: Presses | None
    ) -> list[Start]:
        """Where a file begins another recording, and no file has the presses of the time between the two.

        A file continues the one before it if the connection goes on without a pause in which frames are missing.

        Parameters
        ----------
        order, connection : numbers of the frames in their order, and their connections, shapes (n,)
        """
        if presses is None or len(self._parts) == 1:
            return []
        places = np.array([part.place for part in self._parts])
        place, time_ns = frames.column("place")[order], frames.column("time_ns")[order]
        file, of_press = (np.searchsorted(places, one, side="right") - 1 for one in (place, presses.place))
        is_missing = np.diff(frames.column("sequence")[order]) > 1
        is_new = (np.diff(connection) > 0) | (is_missing & (np.diff(time_ns) > PAUSE_NS))
        found = []
        for k in 1 + np.flatnonzero((np.diff(file) != 0) & is_new):
            part, before_ns, first_ns = self._parts[file[k]], int(time_ns[k - 1]), int(time_ns[k])
            first_ns = first_ns if part.first_ns is None else part.first_ns
            spans = [presses.time_ns[of_press == one] for one in np.unique(of_press)]
            if not any(one.min() <= before_ns and one.max() >= first_ns for one in spans):
                found.append(Start(before_ns=before_ns, first_ns=first_ns, place=part.place))
        return found

    def _lacks(self, kind: str, where: str = "") -> InputError:
        has = ", ".join(f"{name} ({one})" for name, one in self.kinds.items()) or "no messages"
        damage = f", and is damaged: {self._fault}" if self._fault else ""
        return InputError(
            f"{self.file}: has no {kind}{where}; it has {has}{damage}. Record the topics of optopad_ros, or use "
            "`optopad driver record --out x.mcap`"
        )

    def _topics_of(self, kind: str) -> list[str]:
        return [name for name, one in self.kinds.items() if one == kind]

    def _read(self, file: Path) -> str:
        """Read a file; returns its damage in words, "" without any."""
        part = _Part(place=self._place)
        self._parts.append(part)
        if not os.path.lexists(file):
            part.gaps_ns.append([None, None])
            self.ended_cleanly = False
            return ""
        read: BagFile = (SqliteFile if file.suffix.lower() == ".db3" else McapFile)(file, KINDS)
        pending: dict[Channel, tuple[list[bytes], list[int], list[int]]] = {}
        for message in read.messages():
            if message is None:
                part.gaps_ns.append([part.last_ns, None])
            elif message[0].encoding == "cdr":
                channel, time_ns, content = message
                part.note(time_ns)
                contents, times_ns, places = pending.setdefault(channel, ([], [], []))
                contents.append(bytes(message_content(channel, content, file)))
                times_ns.append(time_ns)
                places.append(self._place)
                self._place += 1
                if self._place % BATCH == 0:
                    self._decode(pending)
        self._decode(pending)
        for channel in read.channels:
            kind = (
                channel.kind if channel.encoding == "cdr" else f"{channel.kind} in {channel.encoding}".strip()
            )
            if self.kinds.get(channel.topic) not in KINDS:
                self.kinds[channel.topic] = kind
        if not read.is_whole:
            part.gaps_ns.append([part.last_ns, None])
        self.ended_cleanly &= read.is_whole
        self.stray_bytes += read.lost_bytes
        self._losses += [one for one in read.losses if one not in self._losses]
        return read.fault

    def _decode(self, pending: dict[Channel, tuple[list[bytes], list[int], list[int]]]) -> None:
        for channel, (contents, times_ns, places) in pending.items():
            try:
                if channel.kind == SENSOR:
                    decode, seen = decoder_of(channel), self.configs.setdefault(channel.topic, {})
                    seen.update(dict.fromkeys(decode(one).driver_config for one in dict.fromkeys(contents)))
                elif channel.kind == PRESS:
                    self.presses.setdefault(channel.topic, Presses()).add(channel, contents, times_ns, places)
                elif self._wanted in (None, channel.topic):
                    frames = self.frames.setdefault(channel.topic, Frames(channel.topic))
                    frames.add(channel, contents, times_ns, places)
            except InputError as err:
                raise InputError(f"{self.file}: {err}") from None
        pending.clear()


def _pad_of(topic: str) -> str:
    """The part of a topic's name that names the sensor: `/pads/left_frame` and `/pads/left/press` give `pads/left`."""
    return "/".join(filter(None, re.split(r"[/_]+", _WORDS.sub("", topic))))


def _may_belong(one: str, other: str) -> bool:
    """Whether two names can be of the same sensor: one of them names none, or is within the other."""
    return any(
        not a or a == "optopad" or f"{b}/".startswith(f"{a}/") for a, b in ((one, other), (other, one))
    )


def _is_bag_file(name: str) -> bool:
    return name.lower().endswith(SUFFIXES)


def _files(file: Path) -> list[Path]:
    """The files of a bag in their order, also those that only `metadata.yaml` lists; raises InputError."""
    try:
        import mcap_ros2.decoder  # noqa: F401
    except ImportError:
        raise InputError(f"{file}: MCAP needs the package mcap-ros2-support; {INSTALL}") from None
    found = list(_files_of_folder(file)) if os.path.isdir(file) else [file]
    packed = [one for one in found if one.name.lower().endswith(".db3.zstd")]
    if packed:
        raise InputError(
            f"{packed[0]}: a bag in SQLite that is compressed as a whole is not read; unpack it with `zstd -d`, or "
            f"convert the bag with {CONVERT}"
        )
    if not any(os.path.lexists(one) for one in found):
        raise InputError(
            f"{file}: no such file"
            if found == [file]
            else f"{file}: has no MCAP file; record with `ros2 bag record -s mcap`, or use `ros2 bag convert`"
        )
    return found


def _files_of_folder(folder: Path) -> Iterator[Path]:
    try:
        found = (name for name in os.listdir(folder) if _is_bag_file(name))
        names = sorted((name for name in found if not os.path.isdir(folder / name)), key=_natural)
    except OSError as err:
        raise InputError(f"{folder}: cannot be read: {err.strerror or err}; name the right folder") from None
    listed = _listed(folder / METADATA, names)
    yield from (folder / name for name in (listed if set(names) <= set(listed) else names))


def _listed(metadata: Path, names: list[str]) -> list[str]:
    """Names of the files that `metadata.yaml` lists, in its order; none if there is no such file, or it is damaged."""
    try:
        text = read_text(metadata, needed="the metadata of a bag", most_bytes=MOST_METADATA_BYTES)
    except InputError:
        return []
    _, _, rest = text.partition("relative_file_paths:")
    found = []
    for line in rest.splitlines()[1:]:
        entry = re.fullmatch(r"\s*-\s+(['\"]?)(?P<name>.+?)\1\s*", line)
        if entry is None:
            break
        name = entry["name"].replace("\\", "/").rpartition("/")[2]
        packed = f"{name}.zstd"
        found.append(packed if name not in names and packed in names else name)
    return list(dict.fromkeys(name for name in found if _is_bag_file(name)))


def _natural(name: str) -> list[tuple[int, str]]:
    """Key by which `bag_10` comes after `bag_9`."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d{1,18})", name)]
