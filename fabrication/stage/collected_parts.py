"""Presses made so far, a file each, in a folder beside the data set: what an interruption leaves, and resumes.

plan.json      which sensor, which presses, how
000012.npz     arrays of one whole press; written whole or not at all
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError
from design.plain_arrays import plain_arrays
from design.whole_file import own_folder, whole_file, write_whole
from fabrication.driver.link.frames import US_PER_S, Frame
from fabrication.driver.recording.export import Recorded
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver_file import DriverConfig
from fabrication.stage.press_list import PressList
from fabrication.stage.stage import Position

FORMAT, VERSION = "optopad-collection", 1
PLAN = "plan.json"
Arrays = dict[str, NDArray[Any]]
MOST_BYTES = 500_000_000
"""Of one press unpacked: an hour of frames at 400 a second of 17 x 16 readings has 400 MB."""
KEPT = "run the command again: the presses before are kept"
COLUMNS = ("counts", "press_mm", "connection", "sequence", "device_us", "host_s", "lost")


class CollectedParts:
    """The folder of one collection.

    Parameters
    ----------
    out : the data set that comes of it; the folder is named after it
    plan : what must be the same when it is resumed

    Attributes
    ----------
    was_begun : whether a run before this one began it

    Raises
    ------
    InputError : the folder is of another collection; `out` exists and there is no folder.
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
        """Make the folder, before anything moves; OutputError where it cannot be made."""
        own_folder(self.folder, "choose another --out")
        write_whole(self.folder / PLAN, json.dumps(self._document, indent=2).encode())

    def numbers(self) -> set[int]:
        """Of the presses that are there."""
        return {int(file.stem) for file in self.folder.glob("*.npz") if file.stem.isdecimal()}

    def save(self, number: int, frames: list[Frame], press_mm: list[Position]) -> None:
        """Keep one whole press; OutputError where the disk does not take it."""
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
        """All presses that are there, in the list's order; None where there is none.

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
        """Take the folder away: the data set has all of it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _part(self, number: int) -> Arrays:
        file = self.folder / f"{number:06d}.npz"
        try:
            found = plain_arrays(file, most_bytes=MOST_BYTES)
            return {name: found[name] for name in COLUMNS}
        except (OSError, ValueError, KeyError) as err:
            raise InputError(
                f"{file}: is damaged ({err}); delete it: that press is then made again"
            ) from None

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
