"""Finished pieces of long work, kept beside the bundle so that an interrupted command goes on where it stopped.

One line of JSON a piece, appended and flushed as soon as it is known; a line that was cut short by a power
cut is ignored. A store answers only for the same work: its file is named by a hash of what was asked (the
caller's key: digests, seed, settings) and of all sources and data that a result depends on, so a changed
program never takes up an old result. The file is removed when the work is done.
"""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import design
import sims
from design.whole_file import unwritable

SOURCES = ("*.py", "*.toml", "*.npz")
ROOMS = (design, sims)


class FinishedWork:
    """Results by name, in memory and in one file.

    Parameters
    ----------
    out : folder of the bundles; made when missing
    title : start of the file's name, as ``piacenza2017-pair-0123abcd.sweep``
    asked : plain data that says what is worked on
    """

    def __init__(self, out: Path, title: str, asked: object) -> None:
        text = json.dumps([asked, source_digest()], sort_keys=True)
        self.path = out / f".{title}.{hashlib.sha256(text.encode()).hexdigest()[:16]}.jsonl"
        self._results = _read(self.path)

    def __len__(self) -> int:
        return len(self._results)

    def get(self, name: str) -> Any | None:
        """An earlier result; None when there is none."""
        return self._results.get(name)

    def put(self, name: str, result: Any) -> None:
        """Keep a result on the disk.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        self._results[name] = result
        line = json.dumps({"name": name, "result": result}, allow_nan=False) + "\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write("\n" + line)  # the line before may have been cut short
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as err:
            raise unwritable(self.path, err, "choose another folder with --out") from err

    def forget(self) -> None:
        """Remove the file: the work is done and lies in its bundle."""
        self._results = {}
        self.path.unlink(missing_ok=True)


@cache
def source_digest() -> str:
    """SHA-256 over every source and data file of the rooms that results depend on, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in ROOMS:
        folder = Path(str(room.__file__)).parent
        for path in sorted(found for pattern in SOURCES for found in folder.rglob(pattern)):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _read(path: Path) -> dict[str, Any]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    found: dict[str, Any] = {}
    for line in lines:
        try:
            piece = json.loads(line)
            found[piece["name"]] = piece["result"]
        except (ValueError, KeyError, TypeError):
            continue  # cut short while it was written
    return found
