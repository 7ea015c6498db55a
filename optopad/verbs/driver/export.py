"""Exports recordings: netCDF, tables, ROS 2 messages, or LeRobot data sets."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from optopad.cli.verb import checked_out, file_name, named, parsed_offset, typed, verb
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.fabrication.driver.recording.export import read_recorded, write_export
from optopad.fabrication.driver.recording.joined_log import joined
from optopad.fabrication.driver.recording.lerobot import Source, write_episodes
from optopad.fabrication.driver.recording.position_log import read_position_log
from optopad.fabrication.driver.recording.recorded import Recorded
from optopad.fabrication.driver.simulated.finger import read_path
from optopad.screen.live_sensor import recording_told
from optopad.screen.output import Told, progress

if TYPE_CHECKING:
    from optopad.fabrication.driver.recording.lerobot import Take


@verb(
    recordings=typed("RECORDING"),
    out=typed("FILE", type=Path, callback=file_name(".nc", ".csv", ".mcap")),
    presses=typed("CSV"),
    stage=typed("CSV"),
    lerobot=typed("FOLDER"),
    task=typed("TEXT"),
)
def export(
    recordings: Sequence[Path],
    *,
    out: Path | None = None,
    presses: Path | None = None,
    stage: Path | None = None,
    offset: str | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    lerobot: Path | None = None,
    append: bool = False,
    fps: float = 30.0,
    take: str = "mean",
    task: Sequence[str] = (),
    as_json: bool = False,
) -> Told:
    """Export the whole frames of a recording: netCDF or CSV for `compare` and `train`, MCAP, or LeRobot.

    Parameters
    ----------
    recordings : A file of `driver record`, or a ROS 2 bag (.mcap, .db3, folder); several with --lerobot.
    out : netCDF (.nc), a table (.csv) or ROS 2 messages (.mcap); default: .nc, next to the recording.
    presses : Positions of the tip, repeated: t_s (the board's clock), x_mm, y_mm, depth_mm.
    stage : A stage's log: time, x_mm, y_mm, depth_mm; optionally 'set', 'place'; x2_mm, y2_mm, depth2_mm.
    lerobot : Write the episodes of a LeRobot data set instead.
    append : LeRobot: add the episodes to the data set in the folder.
    fps : LeRobot: steps a second, as of the robot's cameras.
    take : LeRobot: mean, last, or all of the frames of a step.
    task : LeRobot: what the episodes show ('touch'); once, or once a recording.
    """
    target = lerobot or out or named(recordings[0]).with_suffix(".nc")
    tasks = _tasks_of(recordings, task)
    _require_one_result(recordings, target, lerobot, out, append=append)
    if lerobot is None:
        checked_out(target, presses, stage)
    if presses is not None and stage is not None:
        raise InputError("--presses and --stage: two sources of positions; give one")
    if offset is not None and stage is None:
        raise InputError("--offset: shifts a stage's log; give --stage, too")
    for option, value in (("--presses", presses), ("--stage", stage)):
        if value is not None and len(recordings) > 1:
            raise InputError(f"{option} {value}: is of one recording; export each with --append")
    shift = parsed_offset(offset)
    log = None if stage is None else read_position_log(stage)
    path = None if presses is None else read_path(presses)
    told: list[tuple[Path, dict[str, Any], list[str]]] = []

    def read_one(recording: Path, step: OnStep) -> Recorded:
        found = read_recorded(recording, path, topic, press_topic, with_presses=log is None, on_step=step)
        join = None if log is None else joined(found, log, shift)
        found = found if join is None else join.recorded
        document, lines = recording_told(found, join)
        if path is not None and (rounds := float(found.device_s.max()) / max(path.time_s[-1], 1e-9)) > 1.0:
            lines.append(
                f"presses   the path of {path.time_s[-1]:g} s was repeated, {rounds:.3g} times in all"
            )
        told.append((recording, document, lines))
        return found

    with progress(quiet=as_json or not sys.stderr.isatty()) as step:
        if lerobot is not None:
            sources = (
                Source(recorded=read_one(recording, step), task=text, name=str(recording))
                for recording, text in zip(recordings, tasks, strict=True)
            )
            made = write_episodes(sources, lerobot, fps=fps, take=cast("Take", take), is_appended=append)
        else:
            write_export(read_one(recordings[0], step), target, recordings[0].name, on_step=step)
            made = None
    documents = [document for _, document, _ in told]
    found = documents[0] if len(told) == 1 else {"recordings": documents}
    shown = []
    for recording, _, lines in told:
        shown += [f"{recording}: {lines[0]}" if len(told) > 1 else lines[0], *lines[1:]]
    shown += [] if made is None else [f"episodes  {made.sentence}"]
    of_set = {} if made is None else {"lerobot": made.to_json()}
    return Told({"file": str(target)} | found | of_set, [*shown, f"files     {target}"])


def _tasks_of(recordings: Sequence[Path], task: Sequence[str]) -> list[str]:
    texts = list(task) or ["touch"]
    if len(texts) not in (1, len(recordings)):
        raise InputError(
            f"--task: {len(texts)} for {len(recordings)} recordings; give one, or one a recording"
        )
    return texts * len(recordings) if len(texts) == 1 else texts


def _require_one_result(
    recordings: Sequence[Path], target: Path, lerobot: Path | None, out: Path | None, *, append: bool
) -> None:
    if lerobot is not None and out is not None:
        raise InputError("--lerobot and --out: two results; give one")
    if append and lerobot is None:
        raise InputError("--append: adds episodes to a LeRobot data set; give --lerobot, too")
    if len(recordings) > 1 and lerobot is None:
        raise InputError(
            f"{recordings[1]}: a second recording, and a file has one; export each, or give --lerobot"
        )
    names = [os.path.realpath(recording) for recording in recordings]
    for number, name in enumerate(names):
        if name in names[:number]:
            raise InputError(f"{recordings[number]}: is given twice; give each recording once")
    result = os.path.realpath(target)
    if result in names or os.path.dirname(result) in names:
        raise InputError(f"--out {target}: is the recording itself, or in its folder; choose another name")
