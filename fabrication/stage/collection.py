"""Unattended collection of a data set: press by press, with frames at every position; it resumes after a stop.

At a position the stage waits for the settling time, earlier frames are dropped, and a number of new ones is kept,
with the position that the stage reports. A press is kept if it is complete. Kept presses are
written as netCDF at the end of every run, also of one that was stopped early.

Each press so far is a file in a folder next to the data set, from which a stopped collection resumes.

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

from design.errors import DeviceError, InputError
from design.files import own_folder, whole_file, write_whole
from design.plain_arrays import plain_arrays
from design.recordings import SetEntry
from fabrication.driver.link.frames import US_PER_S, Frame
from fabrication.driver.recording.export import Recorded, write_netcdf
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver.sensor import Sensor
from fabrication.driver_file import DriverConfig
from fabrication.stage.stage import Position, Press, PressList, Stage

FORMAT, VERSION = "optopad-collection", 1
PLAN = "plan.json"
Arrays = dict[str, NDArray[Any]]
MOST_BYTES = 500_000_000
"""Largest press unpacked: an hour at 400 frames per second of 17 x 16 readings has 400 MB."""
KEPT = "run the command again: earlier presses are kept"
COLUMNS = ("counts", "press_mm", "connection", "sequence", "device_us", "host_s", "lost")


class CollectedParts:
    """The folder of one collection.

    Parameters
    ----------
    out : the resulting data set; the folder is named after it
    plan : settings that must be equal on resumption

    Attributes
    ----------
    was_begun : whether an earlier run began it

    Raises
    ------
    InputError : the folder is of another collection, or `out` exists without a folder.
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
        """Make the folder before any motion; OutputError if it cannot be made."""
        own_folder(self.folder, "choose another --out")
        write_whole(self.folder / PLAN, json.dumps(self._document, indent=2).encode())

    def numbers(self) -> set[int]:
        """Numbers of the kept presses."""
        return {int(file.stem) for file in self.folder.glob("*.npz") if file.stem.isdecimal()}

    def save(self, number: int, frames: list[Frame], press_mm: list[Position]) -> None:
        """Keep one complete press; OutputError if the disk refuses it."""
        arrays = {
            "counts": np.array([frame.counts for frame in frames]),
            "press_mm": np.array(press_mm, dtype=np.float64),
            "host_s": np.array([frame.host_s for frame in frames]),
            "lost": np.array([frame.lost_before for frame in frames]),
        }
        for name in ("connection", "sequence", "device_us"):
            arrays[name] = np.array([getattr(frame, name) for frame in frames], dtype=np.int64)
        file = self.folder / f"{number:06d}.npz"
        with whole_file(file, KEPT) as hidden, hidden.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    def recorded(self, config: DriverConfig, presses: PressList) -> Recorded | None:
        """All kept presses, in the list's order; None if there are none.

        Raises
        ------
        InputError : a file is damaged; the message names it.
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
            ended_cleanly=len(numbers) == len(presses.presses),
        )

    def remove(self) -> None:
        """Remove the folder, because the data set has all presses."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _part(self, number: int) -> Arrays:
        file = self.folder / f"{number:06d}.npz"
        try:
            found = plain_arrays(file, most_bytes=MOST_BYTES)
            return {name: found[name] for name in COLUMNS}
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


SETTLE_S = 0.3
FRAMES = 1
TRIES = 3
"""Number of attempts for a press during which the board was reconnected."""


@dataclass(frozen=True, kw_only=True)
class Collected:
    """Result of a run.

    Attributes
    ----------
    file : the data set; None if no press is complete
    made, kept, wanted : number of presses of this run, of all runs, of the list
    frames : number of frames in the file
    """

    file: Path | None
    made: int
    kept: int
    wanted: int
    frames: int

    @property
    def is_complete(self) -> bool:
        """Whether all presses of the list are kept."""
        return self.kept == self.wanted


class Collector:
    """One collection.

    Parameters
    ----------
    sensor : open sensor, with or without a baseline
    presses : all presses of the collection
    out : the data set, netCDF; there is a folder next to it until it is complete
    settle_s : settling time of the tip before frames are taken [s]
    frames : number of frames at each position

    Raises
    ------
    InputError : `out` exists, or was begun with other presses, another sensor or other settings.
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
        """Whether an earlier run began it; the tip may then be anywhere."""
        return self._parts.was_begun

    def begin(self) -> None:
        """Record on the disk that it has begun, before any motion; OutputError if that fails."""
        self._parts.begin()

    def remaining(self, only: Collection[str] = ()) -> list[int]:
        """Numbers of the missing presses, of all sets or of the named ones."""
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
        """The first set, and the first one after every change of the room's light, along these presses."""
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
        """Make presses; return their number.

        Parameters
        ----------
        numbers : numbers from `remaining`
        on_step : called with the completed share
        on_light : called, with the tip lifted, before a set in another light than the previous one

        Raises
        ------
        InputError : a position outside the stage's limits, before any motion.
        DeviceError : a fault of stage or sensor; earlier presses are kept.
        """
        self._presses.require_within(stage.limits)
        self.begin()
        order = list(numbers)
        is_ambient: bool | None = None
        for done, number in enumerate(order):
            press = self._presses.presses[number]
            entry = self._presses.sets[press.set_number]
            if entry.is_ambient != is_ambient:
                stage.lift()
                on_light(entry)
                is_ambient = entry.is_ambient
            self._parts.save(number, *self._made(stage, press))
            on_step((done + 1) / len(order))
        return len(order)

    def finish(self, made: int = 0) -> Collected:
        """Write the kept presses as a data set; if it is complete, the folder is removed.

        Raises
        ------
        OutputError : the disk refuses it; the folder keeps everything.
        """
        recorded = self._parts.recorded(self._sensor.config, self._presses)
        kept = len(self._parts.numbers())
        if recorded is not None:
            write_netcdf(recorded, self._out, f"{self._out.name}: collected")
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

    def _made(self, stage: Stage, press: Press) -> tuple[list[Frame], list[Position]]:
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
