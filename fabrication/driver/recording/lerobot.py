"""Frames as observations of a LeRobot data set: fast frames gathered in the slower steps of a robot's cameras.

A step at time t has the frames of (t - 1/fps, t]. ``take`` says what becomes of them: their mean, the last one, or all
of them. `optopad.fabrication.driver.observations` does this live, within a robot's own recording; `write_episodes`
writes recordings as a data set.

Times are those of the board's clock, which never goes back within a connection and knows no delay of the line. The
clock's error is in the length of the steps: up to 100 ppm with a quartz, 0.5 % with the ceramic resonator of an Arduino
Uno or Mega (Murata CSTCE16M0V53).

An episode ends with its connection, and at a gap: frames that are further apart than usual by more than one step. A new
episode begins behind the gap, so no frame is repeated for the time of a gap. Within an episode a step may have no
frame, because the pad is slower than the steps, or because of a gap of less than one step. Such a step repeats the
frame before it, and is counted.

Format: LeRobot data sets, codebase version 3.0 (files ``meta/info.json``, ``meta/stats.json``, ``meta/tasks.parquet``,
``meta/episodes`` and ``data`` as Parquet). The statistics of several episodes are aggregated as LeRobot does: exactly,
but for quantiles, which are means weighted by the number of steps. Parquet needs pandas and pyarrow.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError, OutputError
from optopad.design.files import whole_folder
from optopad.design.recordings import signals_of
from optopad.fabrication.driver.descriptor import descriptor_of
from optopad.fabrication.driver.recording.recorded import Recorded

Take = Literal["mean", "last", "all"]
CODEBASE_VERSION = "v3.0"
SIGNALS, PRESS = "observation.optopad", "observation.press"
FILES_MB, FILES_A_CHUNK = 100, 1000
"""Limits that LeRobot writes into every data set; the files here stay below them."""
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
MOST_FPS = 1000
DATA, EPISODES = "data", "meta/episodes"
US = 1e-6
"""Resolution of the board's clock [s]."""
Statistics = dict[str, dict[str, Any]]
INSTALL = "pip install pandas pyarrow"


def rows_of_step(rate_hz: float, fps: float) -> int:
    """Number of frames that a step has at most, at a frame rate [Hz]."""
    return max(1, math.ceil(rate_hz / fps - 1e-9))


def gathered(signals: FloatArray, take: Take, rows: int) -> NDArray[np.float32]:
    """Observation (pair,), or (rows, pair) with "all", from the signals (frame, pair) of a step's frames.

    With "all" the latest frames are taken. If there are fewer than `rows`, the first one is repeated.
    """
    if take == "last":
        return np.asarray(signals[-1], dtype=np.float32)
    if take == "mean":
        return np.asarray(signals.mean(axis=0), dtype=np.float32)
    latest = signals[-rows:]
    return np.asarray(
        np.concatenate([np.repeat(latest[:1], rows - len(latest), axis=0), latest]), dtype=np.float32
    )


def features_of(
    emitters: tuple[str, ...], receivers: tuple[str, ...], rows: int, take: Take, *, fingers: int = 0
) -> dict[str, Any]:
    """Features of the observations, as LeRobot describes them: type, shape, names, and what they are.

    The columns of a feature are fixed, so each of the `fingers` whose presses are known has its own. One that does not
    touch has a depth of 0 or less and not NaN, which would make LeRobot's statistics NaN.
    """
    pairs = [f"{emitter}-{receiver}" for emitter in emitters for receiver in receivers]
    words = {
        "mean": "mean of the step's frames",
        "last": "last frame of the step",
        "all": "frames of the step, the latest one last",
    }
    shape = [rows, len(pairs)] if take == "all" else [len(pairs)]
    names = {"frame": [str(k - rows + 1) for k in range(rows)], "pair": pairs} if take == "all" else pairs
    found: dict[str, Any] = {
        SIGNALS: {
            "dtype": "float32",
            "shape": shape,
            "names": names,
            "info": {
                "description": f"light of each pair, dark reading subtracted; {words[take]}",
                "unit": "counts",
            },
        }
    }
    if fingers:
        numbers = ("", *(str(k) for k in range(2, fingers + 1)))
        found[PRESS] = {
            "dtype": "float32",
            "shape": [3 * fingers],
            "names": [f"{axis}{number}_mm" for number in numbers for axis in ("x", "y", "depth")],
            "info": {
                "description": "known press in the pad's coordinates; depth 0 or less: no contact",
                "unit": "mm",
            },
        }
    return found


@dataclass(frozen=True, kw_only=True)
class Written:
    """What was written to a data set.

    Attributes
    ----------
    episodes, steps : numbers of new episodes and of their steps
    repeated : number of those steps that have no frame, and repeat the one before
    left_out_s : time from the first to the last frame of each recording that is in no step: gaps, and less than a
        step at the end of an episode [s]
    total_episodes : number of episodes in the data set
    """

    episodes: int = 0
    steps: int = 0
    repeated: int = 0
    left_out_s: float = 0.0
    total_episodes: int = 0

    def to_json(self) -> dict[str, Any]:
        """The fields as plain numbers; the time to a millisecond."""
        return asdict(self) | {"left_out_s": round(self.left_out_s, 3)}

    @property
    def sentence(self) -> str:
        """What was written, in words."""
        text = f"{self.episodes} with {self.steps} steps"
        if self.repeated:
            text += f"; {self.repeated} steps without a frame repeat the one before"
        if self.episodes > 1 or self.left_out_s > 1.0:
            text += f"; {self.left_out_s:.2f} s are in no step: gaps, and ends of less than a step"
        return text + ("" if self.total_episodes == self.episodes else f"; {self.total_episodes} in all")


@dataclass(frozen=True, kw_only=True)
class Source:
    """A recording, a sentence that describes its episodes (the task), and the recording's name for messages."""

    recorded: Recorded
    task: str = "touch"
    name: str = "the recording"


def write_lerobot(
    recorded: Recorded, folder: Path, *, fps: float = 30, take: Take = "mean", task: str = "touch"
) -> Written:
    """Write one recording as a LeRobot data set; parameters and errors are those of `write_episodes`."""
    return write_episodes([Source(recorded=recorded, task=task)], folder, fps=fps, take=take)


def write_episodes(
    sources: Iterable[Source],
    folder: Path,
    *,
    fps: float = 30,
    take: Take = "mean",
    is_appended: bool = False,
) -> Written:
    """Write recordings of one sensor as episodes of a LeRobot data set, all of them or none.

    Parameters
    ----------
    sources : the recordings; taken one by one
    fps : steps per second
    take : what becomes of the frames of a step: "mean", "last" or "all"
    is_appended : whether the episodes are added to an existing data set that this function wrote

    Raises
    ------
    InputError : an option is not permitted, a recording is shorter than a step, or a recording or the data set does not
        fit the others: design, presses, `fps`, `take`.
    OutputError : the folder exists or cannot be written, or pandas or pyarrow is missing.
    """
    checked_take(fps, take)
    if folder.exists() and not is_appended:
        raise OutputError(
            f"--lerobot {folder}: exists already; choose another folder, or add to it with --append"
        )
    try:
        with whole_folder(folder.resolve(), replaces=is_appended) as hidden:
            made = _DataSet(hidden, folder, fps, take)
            for source in sources:
                made.add(source)
            return made.finish()
    except ImportError as err:
        raise OutputError(f"--lerobot {folder}: Parquet needs pandas and pyarrow: {err}; {INSTALL}") from None


def checked_take(fps: float, take: Take) -> Take:
    """Check the options of a data set and return `take`; raises InputError."""
    if not 1 <= fps <= MOST_FPS:
        raise InputError(f"--fps: {fps:g} is refused: give the robot's steps per second, 1 to {MOST_FPS}")
    if take not in get_args(Take):
        raise InputError(f"--take: {take!r} is refused: give {', '.join(get_args(Take))}")
    return take


class _DataSet:
    """A data set in a folder, new or with earlier episodes, to which episodes are added.

    Parameters
    ----------
    folder : where it is written
    old : the earlier data set, whose files are copied into `folder`; a folder that does not exist has none
    """

    def __init__(self, folder: Path, old: Path, fps: float, take: Take) -> None:
        import pandas as pd
        import pyarrow  # noqa: F401

        self._folder, self._fps, self._take = folder, fps, take
        self._info: dict[str, Any] = {}
        self._tasks, self._stats, self._rows = list[str](), list[Statistics](), list[dict[str, Any]]()
        self._tables, self._written = list[Any](), Written()
        self._part = self._episodes_part = _Part(0, 0)
        if not old.exists():
            return
        try:
            self._info = _old_info(old / "meta" / "info.json")
            self._tasks = list(pd.read_parquet(old / "meta" / "tasks.parquet").index)
            self._stats = [json.loads((old / "meta" / "stats.json").read_text(encoding="utf-8"))]
            self._part, self._episodes_part = (_part_after(old / one) for one in (DATA, EPISODES))
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as err:
            raise InputError(
                f"--append: {old} is no data set of `driver export --lerobot`, or damaged ({err}); choose "
                "another folder"
            ) from None
        shutil.copytree(old, folder, dirs_exist_ok=True)

    def add(self, source: Source) -> None:
        """Write a recording's episodes."""
        recorded, fps = source.recorded, self._fps
        said, rows = descriptor_of(recorded.config), self._rows_of(recorded)
        own = features_of(
            said.emitters.names,
            said.receivers.names,
            rows,
            self._take,
            fingers=0 if recorded.labels is None else 1 + recorded.labels.others_mm.shape[1],
        )
        own[SIGNALS]["info"]["design_digest"] = said.digest
        info = _info_of(said.design, fps, own)
        self._info = self._info or info
        _require_equal(self._info, info, source.name)
        parts, gaps_s = _episodes(recorded, fps)
        span_s = gaps_s + float(
            sum(recorded.device_s[one.stop - 1] - recorded.device_s[one.start] for one in parts)
        )
        steps, repeated = 0, 0
        for part in parts:
            columns, repeats = _steps(recorded, part, fps, self._take, rows)
            if count := len(columns[SIGNALS]):
                self._add_episode(columns, source.task)
                steps, repeated = steps + count, repeated + repeats
        if not steps:
            raise InputError(
                f"{source.name} lasts {span_s:.3g} s, without gaps less than one step of {1 / fps:.3g} s; raise --fps"
            )
        self._written = replace(
            self._written,
            steps=self._written.steps + steps,
            repeated=self._written.repeated + repeated,
            left_out_s=self._written.left_out_s + max(span_s - steps / fps, 0.0),
        )

    def _rows_of(self, recorded: Recorded) -> int:
        """Number of frames of a step; that of the data set if the recording's rate differs by rounding only."""
        usual_s = _usual_s(recorded)
        rows = rows_of_step(1.0 / usual_s, self._fps) if usual_s > 0 else 1
        shape = self._info["features"][SIGNALS]["shape"] if self._info else []
        return int(shape[0]) if len(shape) == 2 and abs(shape[0] - rows) <= 1 else rows

    def finish(self) -> Written:
        """Write the last steps, and the descriptions of the data set."""
        import pandas as pd

        self._write_tables()
        meta, episodes = self._folder / "meta", self._episodes_part.made_in(self._folder / EPISODES)
        pd.DataFrame(self._rows).to_parquet(episodes, engine="pyarrow", index=False)
        tasks = pd.DataFrame({"task_index": range(len(self._tasks))}, index=self._tasks)
        tasks.to_parquet(meta / "tasks.parquet", engine="pyarrow")
        stats = {name: _aggregated([one[name] for one in self._stats]) for name in self._stats[0]}
        for name, document in (("info", self._info), ("stats", stats)):
            (meta / f"{name}.json").write_text(json.dumps(document, indent=4), encoding="utf-8")
        return replace(self._written, episodes=len(self._rows), total_episodes=self._info["total_episodes"])

    def _add_episode(self, columns: dict[str, Any], task: str) -> None:
        if task not in self._tasks:
            self._tasks.append(task)
        count, info = len(columns[SIGNALS]), self._info
        number, begin = info["total_episodes"], info["total_frames"]
        steps = np.arange(count, dtype=np.int64)
        columns = columns | {
            "timestamp": (steps / self._fps).astype(np.float32),
            "frame_index": steps,
            "episode_index": np.full(count, number),
            "index": begin + steps,
            "task_index": np.full(count, self._tasks.index(task)),
        }
        table = _table_of(columns)
        if self._tables and sum(one.nbytes for one in (*self._tables, table)) > FILES_MB * 1e6:
            self._write_tables()
            self._part = self._part.next
        self._tables.append(table)
        stats = {name: _statistics(values) for name, values in columns.items()}
        self._stats.append(stats)
        info["total_episodes"], info["total_frames"] = number + 1, begin + count
        info["total_tasks"], info["splits"] = len(self._tasks), {"train": f"0:{number + 1}"}
        self._rows.append(
            {
                "episode_index": number,
                "tasks": [task],
                "length": count,
                "data/chunk_index": self._part.chunk,
                "data/file_index": self._part.file,
                "dataset_from_index": begin,
                "dataset_to_index": begin + count,
                "meta/episodes/chunk_index": self._episodes_part.chunk,
                "meta/episodes/file_index": self._episodes_part.file,
            }
            | {f"stats/{name}/{key}": value for name, found in stats.items() for key, value in found.items()}
        )

    def _write_tables(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.concat_tables(self._tables), self._part.made_in(self._folder / DATA))
        self._tables = []


class _Part(NamedTuple):
    """Numbers of a Parquet file among those of a data set."""

    chunk: int
    file: int

    @property
    def next(self) -> _Part:
        return _Part(*divmod(self.chunk * FILES_A_CHUNK + self.file + 1, FILES_A_CHUNK))

    def made_in(self, folder: Path) -> Path:
        """The file's name; its folder is made."""
        file = folder / f"chunk-{self.chunk:03d}" / f"file-{self.file:03d}.parquet"
        file.parent.mkdir(parents=True, exist_ok=True)
        return file


def _part_after(folder: Path) -> _Part:
    """The part after the last one in a folder; ValueError if there is none, or a file has another name."""
    found = [one.relative_to(folder).parts for one in folder.glob("*/*.parquet")]
    return max(_Part(*(int(Path(name).stem.rpartition("-")[2]) for name in names)) for names in found).next


def _old_info(file: Path) -> dict[str, Any]:
    info = json.loads(file.read_text(encoding="utf-8"))
    version = info["codebase_version"]
    if version != CODEBASE_VERSION:
        raise ValueError(f"its version is {version}, not {CODEBASE_VERSION}")
    if "design_digest" not in info["features"][SIGNALS]["info"]:
        raise ValueError("it does not state its design, as those of older versions")
    _ = info["total_episodes"], info["total_frames"]
    return dict(info)


def _info_of(design: str, fps: float, own: dict[str, Any]) -> dict[str, Any]:
    """The description of a data set without episodes; ``fps`` is a whole number where it is one."""
    scalars = {"timestamp": "float32"} | dict.fromkeys(
        ("frame_index", "episode_index", "index", "task_index"), "int64"
    )
    return {
        "codebase_version": CODEBASE_VERSION,
        "robot_type": f"optopad {design}",
        "total_episodes": 0,
        "total_frames": 0,
        "total_tasks": 0,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": FILES_MB,
        "video_files_size_in_mb": 2 * FILES_MB,
        "fps": int(fps) if fps == int(fps) else fps,
        "splits": {},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": own
        | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in scalars.items()},
    }


def _require_equal(info: dict[str, Any], new: dict[str, Any], name: str) -> None:
    features, others = info["features"], new["features"]
    digests = [one[SIGNALS]["info"]["design_digest"] for one in (features, others)]
    if digests[0] != digests[1]:
        raise InputError(
            f"{name}: is of another sensor (design digest {digests[1][:8]}) than the episodes before "
            f"({digests[0][:8]}); a data set is of one sensor, choose another folder"
        )
    if info["fps"] != new["fps"]:
        raise InputError(
            f"--fps: {new['fps']:g} is refused: the data set has {info['fps']:g} steps per second; give "
            f"--fps {info['fps']:g}"
        )
    if (PRESS in features) != (PRESS in others):
        has = (
            "has known presses, and the episodes before have none"
            if PRESS in others
            else "has no known presses"
        )
        raise InputError(
            f"{name}: {has}; the episodes of a data set have the same content, choose another folder"
        )
    if features.get(PRESS) != others.get(PRESS):
        fingers = [one[PRESS]["shape"][0] // 3 for one in (others, features)]
        raise InputError(
            f"{name}: has known presses of {fingers[0]} at a time, and the episodes before of {fingers[1]}; the "
            "episodes of a data set have the same content, choose another folder"
        )
    if features[SIGNALS] != others[SIGNALS]:
        has, needs = (
            f"{one[SIGNALS]['shape']} of {one[SIGNALS]['info']['description']}" for one in (others, features)
        )
        raise InputError(
            f"{name}: its steps have {has}; the data set has {needs}; give its --take, or another folder"
        )


def _usual_s(recorded: Recorded) -> float:
    """Usual time from frame to frame, the median within connections [s]; 0 if there is none."""
    steps_s = np.diff(recorded.device_s)
    within = steps_s[(np.diff(recorded.connection) == 0) & (steps_s > 0)]
    return float(np.median(within)) if len(within) else 0.0


def _episodes(recorded: Recorded, fps: float) -> tuple[list[slice], float]:
    """Frames of each episode, and the sum of the times between the episodes [s]."""
    steps_s, host_s = np.diff(recorded.device_s), np.diff(recorded.host_s)
    is_new = (np.diff(recorded.connection) != 0) | (steps_s < 0)
    is_cut = is_new | (steps_s > 1 / fps + _usual_s(recorded) + US)
    gaps_s = np.where(is_new, np.maximum(host_s, 0.0), steps_s)[is_cut]
    bounds = [0, *(1 + np.flatnonzero(is_cut)).tolist(), len(recorded.sequence)]
    return [slice(a, b) for a, b in pairwise(bounds)], float(gaps_s.sum())


def _steps(
    recorded: Recorded, part: slice, fps: float, take: Take, rows: int
) -> tuple[dict[str, NDArray[np.float32]], int]:
    """Observations of an episode's steps, and how many of them repeat a frame; the first step ends at 1/fps."""
    time_s = np.round(recorded.device_s[part] - recorded.device_s[part.start], 6)
    count = math.floor(float(time_s[-1]) * fps + 1e-9)
    ends: IntArray = np.searchsorted(time_s, np.round((1 + np.arange(count)) / fps, 9) + 1e-9, side="right")
    begins = np.concatenate([[0], ends])[:count]
    is_empty = begins == ends
    begins = np.minimum(begins, ends - 1)
    counts = recorded.counts[part]
    pairs = (counts.shape[1] - 1) * counts.shape[2]
    shape = (count, rows, pairs) if take == "all" else (count, pairs)
    columns = {SIGNALS: np.empty(shape, np.float32)}
    for k, (a, b) in enumerate(zip(begins.tolist(), ends.tolist(), strict=True)):
        signals = signals_of(counts[a:b].astype(np.float64))
        columns[SIGNALS][k] = gathered(signals.reshape(b - a, -1), take, rows)
    if (labels := recorded.labels) is not None:
        each = [labels.press_mm, *np.moveaxis(np.nan_to_num(labels.others_mm), 1, 0)]
        columns[PRESS] = np.concatenate(each, axis=1)[part][ends - 1].astype(np.float32)
    return columns, int(is_empty.sum())


def _table_of(columns: dict[str, Any]) -> Any:
    """Columns as a table of Parquet: a list for each step of a column with more than one axis."""
    import pyarrow as pa

    def array(values: NDArray[Any]) -> Any:
        if values.ndim == 1:
            return pa.array(values)
        offsets = np.arange(len(values) + 1, dtype=np.int32) * values.shape[1]
        return pa.ListArray.from_arrays(offsets, array(values.reshape(-1, *values.shape[2:])))

    return pa.table({name: array(values) for name, values in columns.items()})


def _statistics(values: NDArray[Any]) -> dict[str, Any]:
    """Statistics of a feature over all steps, as LeRobot states them: a list for every one, also of scalars."""
    if values.ndim == 3:  # one frame of the step after the other, which takes less memory
        parts = [_statistics(values[:, row]) for row in range(values.shape[1])]
        return {name: [one[name] for one in parts] for name in parts[0]} | {"count": [len(values)]}
    table = values.astype(np.float64).reshape(len(values), *(values.shape[1:] or (1,)))
    found = {
        "min": table.min(axis=0),
        "max": table.max(axis=0),
        "mean": table.mean(axis=0),
        "std": table.std(axis=0),
        "count": np.array([len(table)]),
    }
    found |= {f"q{round(100 * q):02d}": np.quantile(table, q, axis=0) for q in QUANTILES}
    return {name: one.tolist() for name, one in found.items()}


def _aggregated(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Statistics of a feature over several episodes; quantiles are weighted means, as in LeRobot."""
    stacked = {key: np.array([one[key] for one in parts]) for key in parts[0]}
    share = stacked["count"] / stacked["count"].sum()
    share = share.reshape(-1, *(1,) * (stacked["mean"].ndim - 1))
    found = {key: (share * values).sum(axis=0) for key, values in stacked.items() if key[0] in "mq"}
    variance = share * (stacked["std"] ** 2 + (stacked["mean"] - found["mean"]) ** 2)
    found |= {
        "min": stacked["min"].min(axis=0),
        "max": stacked["max"].max(axis=0),
        "std": np.sqrt(variance.sum(axis=0)),
        "count": stacked["count"].sum(axis=0),
    }
    return {key: found[key].tolist() for key in parts[0]}
