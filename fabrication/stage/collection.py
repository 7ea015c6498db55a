"""Unattended collection of a data set: a stage presses, and frames are stored at every position.

At each position the stage waits for the settling time. Then a number of new frames is stored, with the position that
the stage reports; frames that arrived earlier are discarded. Only complete presses are stored. At the end of every run,
even if it was interrupted, the stored presses are written as netCDF.

Each complete press is a file in a folder next to the data set, from which a stopped collection resumes.

plan.json      sensor, presses and settings
000012.npz     arrays of one complete press; written completely or not at all
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import DeviceError, InputError
from optopad.design.files import own_folder, whole_file, write_whole
from optopad.design.plain_arrays import plain_arrays
from optopad.design.recordings import SetEntry
from optopad.fabrication.driver.link.frames import US_PER_S, Frame
from optopad.fabrication.driver.recording.export import write_netcdf
from optopad.fabrication.driver.recording.recorded import PressLabels, Recorded
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.driver_file import DriverConfig
from optopad.fabrication.stage.stage import (
    NOWHERE,
    Knot,
    Position,
    PressList,
    Stage,
    StagePress,
    TracedStage,
    joined_path,
)

FORMAT, VERSION = "optopad-collection", 1
PLAN = "plan.json"
Arrays = dict[str, NDArray[Any]]
MOST_BYTES = 500_000_000
"""Largest unpacked size of one press [bytes]; half an hour at 400 frames per second of 17 x 16 readings is 400 MB."""
KEPT = "run the command again: earlier presses are kept"
COLUMNS = ("counts", "press_mm", "connection", "sequence", "device_us", "host_s", "lost")
PATH = "path"


class CollectedParts:
    """The folder in which the presses of one collection are stored.

    Parameters
    ----------
    out : file of the resulting data set; the folder is named after it
    plan : sensor, presses and settings as plain data; a collection can only be resumed with the same plan

    Attributes
    ----------
    was_begun : whether an earlier run began the collection

    Raises
    ------
    InputError : the folder belongs to another collection, or `out` exists but the folder does not.
    """

    def __init__(self, out: Path, plan: dict[str, Any]) -> None:
        self.folder = out.with_name(out.name + ".parts")
        self.was_begun = (self.folder / PLAN).is_file()
        self._document = {"format": FORMAT, "version": VERSION} | plan
        if (self.folder / PLAN).is_file() and self.numbers():
            self._require_same(self._document)
            return
        if out.exists():
            raise InputError(f"{out}: exists already; choose another name")

    def begin(self) -> None:
        """Create the folder for the stored presses, before the stage moves; raises OutputError on failure."""
        own_folder(self.folder, "choose another --out")
        write_whole(self.folder / PLAN, json.dumps(self._document, indent=2).encode())

    def numbers(self) -> set[int]:
        """Numbers of the stored presses, which are their indices in the list of presses."""
        return {int(file.stem) for file in self.folder.glob("*.npz") if file.stem.isdecimal()}

    def save(self, number: int, frames: list[Frame], press_mm: list[Position], path: list[Knot]) -> None:
        """Store one complete press with the position of each frame, and the tip's path since the press before it.

        Raises
        ------
        OutputError : the file cannot be written.
        """
        arrays = {
            "counts": np.array([frame.counts for frame in frames]),
            "press_mm": np.array(press_mm, dtype=np.float64),
            "host_s": np.array([frame.host_s for frame in frames]),
            "lost": np.array([frame.lost_before for frame in frames]),
            PATH: np.array(path, dtype=np.float64).reshape(-1, 4),
        }
        for name in ("connection", "sequence", "device_us"):
            arrays[name] = np.array([getattr(frame, name) for frame in frames], dtype=np.int64)
        file = self.folder / f"{number:06d}.npz"
        with whole_file(file, KEPT) as hidden, hidden.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    def recorded(self, config: DriverConfig, presses: PressList) -> Recorded | None:
        """All stored presses as a recording, in the order of the list of presses; None if there are none.

        Raises
        ------
        InputError : a file is damaged; the message names the file.
        """
        numbers = sorted(self.numbers())
        if not numbers:
            return None
        parts = [self._part(number) for number in numbers]
        whole = {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}
        lengths = [len(part["host_s"]) for part in parts]
        of_set = [presses.presses[number].set_number for number in numbers]
        of_place = [presses.presses[number].place_number for number in numbers]
        labels = PressLabels(
            press_mm=whole["press_mm"],
            set_number=np.repeat(np.array(of_set, dtype=np.int64), lengths),
            place_number=np.repeat(np.array(of_place, dtype=np.int64), lengths),
            sets=presses.sets,
        )
        return Recorded(
            config=config,
            counts=whole["counts"],
            connection=whole["connection"],
            sequence=whole["sequence"],
            device_s=whole["device_us"] / US_PER_S,
            host_s=whole["host_s"],
            labels=labels,
            lost=int(whole["lost"].sum()),
            stray_bytes=0,
            ended_cleanly=True,
            made_presses=(len(numbers), len(presses.presses)),
        )

    def path(self) -> FloatArray | None:
        """The tip's path during all stored presses, as knots (n, 4) of time [s since 1970] and x, y, depth [mm].

        It is None if the stage reported none, or if the clock was set back.
        """
        return joined_path(self._part(number)[PATH] for number in self.numbers())

    def remove(self) -> None:
        """Remove the folder; should be called when the data set contains all presses."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _part(self, number: int) -> Arrays:
        file = self.folder / f"{number:06d}.npz"
        try:
            found = plain_arrays(file, most_bytes=MOST_BYTES)
            return {name: found[name] for name in COLUMNS} | {PATH: found.get(PATH, np.empty((0, 4)))}
        except (OSError, ValueError, KeyError) as err:
            raise InputError(f"{file}: is damaged ({err}); delete it: that press is then repeated") from None

    def _require_same(self, document: dict[str, Any]) -> None:
        try:
            held = json.loads((self.folder / PLAN).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as err:
            raise InputError(f"{self.folder}: its plan cannot be read: {err}; choose another --out") from None
        if not isinstance(held, dict):
            raise InputError(f"{self.folder}: its plan is no table; choose another --out")
        other = sorted(key for key in document if held.get(key) != document[key])
        if other:
            raise InputError(
                f"{self.folder}: holds presses of another collection ({', '.join(other)} differ); choose another "
                "--out, or delete the folder"
            )


def _path(stage: Stage) -> list[Knot]:
    return stage.path() if isinstance(stage, TracedStage) else []


def _since_now(stage: Stage) -> list[Knot]:
    """Beginning of a run's path: the position before it, since the last run, is unknown."""
    return [(knot[0], *NOWHERE) for knot in _path(stage)[-1:]]


SETTLE_S = 0.3
FRAMES = 1
TRIES = 3
"""Number of attempts to make a press if the connection to the board is lost during it."""


@dataclass(frozen=True, kw_only=True)
class Collected:
    """Result of one run of a collection of a data set.

    Attributes
    ----------
    file : file of the data set; None if no press is complete
    made : number of presses made in this run
    kept : number of stored presses from all runs
    wanted : number of presses in the whole collection
    frames : number of frames in the data set
    """

    file: Path | None
    made: int
    kept: int
    wanted: int
    frames: int

    @property
    def is_complete(self) -> bool:
        """Whether all presses of the list are stored."""
        return self.kept == self.wanted


class Collector:
    """Collects a data set: moves a stage through presses, and stores a sensor's frames.

    Parameters
    ----------
    sensor : open sensor, with or without a baseline
    presses : all presses of the collection
    out : netCDF file of the data set; a folder next to it contains the presses until the data set is complete
    settle_s : settling time of the tip before frames are taken [s]
    frames : number of frames at each position

    Raises
    ------
    InputError : `out` exists, or the collection was begun with other presses, another sensor or other settings.
    """

    def __init__(
        self,
        sensor: Sensor,
        presses: PressList,
        out: Path,
        *,
        settle_s: float = SETTLE_S,
        frames: int = FRAMES,
    ) -> None:
        if not settle_s >= 0 or frames < 1:
            raise InputError(f"settle_s {settle_s:g}, frames {frames}: need 0 s or more, 1 frame or more")
        self._sensor, self._presses, self._out = sensor, presses, out
        self._settle_s, self._frames = settle_s, frames
        plan = {
            "design_digest": sensor.config.digest,
            "presses": presses.digest,
            "settle_s": settle_s,
            "frames": frames,
        }
        self._parts = CollectedParts(out, plan)

    @property
    def was_begun(self) -> bool:
        """Whether an earlier run began this collection; if so, the tip may be anywhere."""
        return self._parts.was_begun

    def begin(self) -> None:
        """Record on the disk that the collection has begun, before the stage moves; raises OutputError on failure."""
        self._parts.begin()

    def remaining(self, only: Collection[str] = ()) -> list[int]:
        """Numbers of the presses that are not yet stored, from the sets named in `only`, or from all if it is empty."""
        names = [entry.name for entry in self._presses.sets]
        if strange := sorted(set(only) - set(names)):
            raise InputError(f"--only: no set {', '.join(strange)}; the sets are {', '.join(names)}")
        there = self._parts.numbers()
        return [
            number
            for number, press in enumerate(self._presses.presses)
            if number not in there and (not only or names[press.set_number] in only)
        ]

    def lights(self, numbers: Iterable[int]) -> list[SetEntry]:
        """Sets of presses before which the user must switch the room light on or off.

        These are the first set, and each set whose room light differs from that of the previous set.
        """
        changes: list[SetEntry] = []
        for number in numbers:
            entry = self._presses.sets[self._presses.presses[number].set_number]
            if not changes or changes[-1].is_ambient != entry.is_ambient:
                changes.append(entry)
        return changes

    def run(
        self,
        stage: Stage,
        numbers: Iterable[int],
        *,
        on_step: Callable[[float], None] = lambda _share: None,
        on_light: Callable[[SetEntry], None] = lambda _entry: None,
    ) -> int:
        """Make the presses with the given numbers; return how many were made.

        Parameters
        ----------
        numbers : numbers of presses, as returned by `remaining`
        on_step : called with the completed fraction
        on_light : called with a set before its presses, while the tip is lifted, if it is the first set or its room
            light differs from that of the previous set

        Raises
        ------
        InputError : a position is outside the stage's limits; nothing has moved.
        DeviceError : stage or sensor failed; earlier presses are stored.
        """
        self._presses.require_within(stage.limits)
        self.begin()
        order = list(numbers)
        path = _since_now(stage)
        is_ambient: bool | None = None
        for done, number in enumerate(order):
            press = self._presses.presses[number]
            entry = self._presses.sets[press.set_number]
            if entry.is_ambient != is_ambient:
                stage.lift()
                on_light(entry)
                is_ambient = entry.is_ambient
            frames, at = self._made(stage, press)
            self._parts.save(number, frames, at, path + _path(stage))
            path = []
            on_step((done + 1) / len(order))
        return len(order)

    def finish(self, made: int = 0) -> Collected:
        """Write the stored presses as a data set; remove their folder if the collection is complete.

        `made` is the number of presses made in this run, which is included in the result.

        Raises
        ------
        OutputError : the file cannot be written; the folder still contains all presses.
        """
        recorded = self._parts.recorded(self._sensor.config, self._presses)
        kept = len(self._parts.numbers())
        if recorded is not None:
            write_netcdf(recorded, self._out, f"{self._out.name}: collected", self._parts.path())
        found = Collected(
            file=None if recorded is None else self._out,
            made=made,
            kept=kept,
            wanted=len(self._presses.presses),
            frames=0 if recorded is None else len(recorded.host_s),
        )
        if found.is_complete:
            self._parts.remove()
        return found

    def _made(self, stage: Stage, press: StagePress) -> tuple[list[Frame], list[Position]]:
        for _ in range(TRIES):
            frames: list[Frame] = []
            at: list[Position] = []
            for step in press.steps_mm:
                position = stage.move_to(*step)
                time.sleep(self._settle_s)
                self._sensor.skip_waiting()
                frames += self._sensor.frames(count=self._frames)
                at += [position] * self._frames
            if len({frame.connection for frame in frames}) == 1:
                return frames, at
        raise DeviceError(
            f"{self._sensor.port}: the board restarted in {TRIES} tries of one press; check its supply and cable"
        )
