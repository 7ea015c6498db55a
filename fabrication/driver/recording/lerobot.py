"""Frames as observations of a LeRobot data set: fast frames gathered in the slower steps of a robot's cameras.

A step at time t has the frames that arrived in (t - 1/fps, t]. ``take`` says what becomes of them: their mean, the last
one, or all of them. If a step has none, it repeats the frame before it. `fabrication.driver.observations` does this
live, within a robot's own recording; `write_lerobot` writes a recording as a data set of one episode.

Format: LeRobot data sets, codebase version 3.0 (files ``meta/info.json``, ``meta/stats.json``, ``meta/tasks.parquet``,
``meta/episodes`` and ``data`` as Parquet). Parquet needs pandas and pyarrow.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray, IntArray
from design.errors import InputError, OutputError
from design.files import whole_folder
from fabrication.driver.descriptor import descriptor_of
from fabrication.driver.recording.recorded import Recorded

Take = Literal["mean", "last", "all"]
CODEBASE_VERSION = "v3.0"
SIGNALS, PRESS = "observation.optopad", "observation.press"
FILES_MB, FILES_A_CHUNK = 100, 1000
"""Limits that LeRobot writes into every data set; the files here stay below them."""
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
MOST_FPS = 1000
INSTALL = "pip install pandas pyarrow"


def rows_of_step(rate_hz: float, fps: int) -> int:
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
    emitters: tuple[str, ...], receivers: tuple[str, ...], rows: int, take: Take, *, has_press: bool = False
) -> dict[str, Any]:
    """Features of the observations, as LeRobot describes them: type, shape, names, and what they are."""
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
    if has_press:
        found[PRESS] = {
            "dtype": "float32",
            "shape": [3],
            "names": ["x_mm", "y_mm", "depth_mm"],
            "info": {
                "description": "known press in the pad's coordinates; depth 0 or less: no contact",
                "unit": "mm",
            },
        }
    return found


def write_lerobot(
    recorded: Recorded, folder: Path, *, fps: int = 30, take: Take = "mean", task: str = "touch"
) -> int:
    """Write a recording as a LeRobot data set with one episode; returns the number of its steps.

    Parameters
    ----------
    fps : steps per second
    take : what becomes of the frames of a step: "mean", "last" or "all"
    task : sentence that describes the episode

    Raises
    ------
    InputError : an option is not permitted, or the recording is shorter than a step.
    OutputError : the folder exists or cannot be written, or pandas or pyarrow is missing.
    """
    checked_take(fps, take)
    said = descriptor_of(recorded.config)
    rows = (
        rows_of_step(1.0 / float(np.median(np.diff(recorded.device_s))), fps)
        if len(recorded.device_s) > 1
        else 1
    )
    columns = _steps(recorded, fps, take, rows)
    own = features_of(
        said.emitters.names, said.receivers.names, rows, take, has_press=recorded.press_mm is not None
    )
    count = len(columns["index"])
    scalars = {"timestamp": "float32"} | dict.fromkeys(
        ("frame_index", "episode_index", "index", "task_index"), "int64"
    )
    features = own | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in scalars.items()}
    try:
        with whole_folder(folder) as hidden:
            _write(hidden, columns, features, count, fps, task, said.design)
    except ImportError as err:
        raise OutputError(f"--lerobot {folder}: Parquet needs pandas and pyarrow: {err}; {INSTALL}") from None
    return count


def checked_take(fps: int, take: Take) -> Take:
    """Check the options of a data set and return `take`; raises InputError."""
    if not 1 <= fps <= MOST_FPS:
        raise InputError(f"--fps: {fps} is refused: give the robot's steps per second, 1 to {MOST_FPS}")
    if take not in get_args(Take):
        raise InputError(f"--take: {take!r} is refused: give {', '.join(get_args(Take))}")
    return take


def _steps(recorded: Recorded, fps: int, take: Take, rows: int) -> dict[str, Any]:
    """Columns of the data set, one entry for each step; the first step ends 1/fps after the first frame."""
    time_s = recorded.host_s - recorded.host_s[0]
    count = math.floor(float(time_s[-1]) * fps)
    if count < 1:
        raise InputError(
            f"the recording lasts {time_s[-1]:.3g} s, less than one step of {1 / fps:.3g} s; raise --fps"
        )
    ends: IntArray = np.searchsorted(time_s, (1 + np.arange(count)) / fps, side="right")
    begins = np.minimum(np.concatenate([[0], ends[:-1]]), ends - 1)
    signals = recorded.signals.reshape(len(time_s), -1)
    columns: dict[str, Any] = {
        SIGNALS: np.array([gathered(signals[a:b], take, rows) for a, b in zip(begins, ends, strict=True)])
    }
    if recorded.press_mm is not None:
        columns[PRESS] = recorded.press_mm[ends - 1].astype(np.float32)
    number = np.arange(count, dtype=np.int64)
    return columns | {
        "timestamp": (number / fps).astype(np.float32),
        "frame_index": number,
        "episode_index": np.zeros(count, dtype=np.int64),
        "index": number,
        "task_index": np.zeros(count, dtype=np.int64),
    }


def _write(
    folder: Path,
    columns: dict[str, Any],
    features: dict[str, Any],
    count: int,
    fps: int,
    task: str,
    design: str,
) -> None:
    import pandas as pd

    part = "chunk-000/file-000.parquet"
    for name in ("meta/episodes/chunk-000", "data/chunk-000"):
        (folder / name).mkdir(parents=True)
    plain = {
        name: [row.tolist() for row in values] if values.ndim > 1 else values
        for name, values in columns.items()
    }
    pd.DataFrame(plain).to_parquet(folder / "data" / part, engine="pyarrow", index=False)
    pd.DataFrame({"task_index": [0]}, index=[task]).to_parquet(
        folder / "meta" / "tasks.parquet", engine="pyarrow"
    )
    stats = {name: _statistics(np.asarray(values)) for name, values in columns.items()}
    episode: dict[str, Any] = {
        "episode_index": 0,
        "tasks": [task],
        "length": count,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": 0,
        "dataset_to_index": count,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    episode |= {f"stats/{name}/{key}": value for name, found in stats.items() for key, value in found.items()}
    pd.DataFrame({name: [value] for name, value in episode.items()}).to_parquet(
        folder / "meta" / "episodes" / part, engine="pyarrow", index=False
    )
    info = {
        "codebase_version": CODEBASE_VERSION,
        "robot_type": f"optopad {design}",
        "total_episodes": 1,
        "total_frames": count,
        "total_tasks": 1,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": FILES_MB,
        "video_files_size_in_mb": 2 * FILES_MB,
        "fps": fps,
        "splits": {"train": "0:1"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": features,
    }
    for name, document in (("info", info), ("stats", stats)):
        (folder / "meta" / f"{name}.json").write_text(json.dumps(document, indent=4), encoding="utf-8")


def _statistics(values: FloatArray) -> dict[str, Any]:
    """Statistics of a feature over all steps, as LeRobot states them: a list for every one, also of scalars."""
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
