"""Files that belong together: a folder holds files of one generation only, even after a kill.

A new generation is written into a hidden folder, and a rename declares it complete. Then all files of the former
generation move out of the folder, and only then the new ones move in. A reader finds files of the one generation or of
the other, never of both. If the process dies on the way, the next reader or writer moves the rest (`settle`).

    <folder>/.optopad-<random>.partial/     a generation being written; removed if its process dies
    <folder>/.optopad-<random>.ready/new/   a complete generation, on its way into the folder
    <folder>/.optopad-<random>.ready/old/   the former one, on its way out

A process locks its hidden folder, so another one can tell whether it is alive (`optopad.design.files.is_abandoned`).
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from optopad.design.files import alone_in, is_abandoned, locked, made_folder, unwritable

NEW, OLD, STALE = "new", "old", "stale"
PREFIX = ".optopad-"
_HIDDEN = re.compile(re.escape(PREFIX) + r"[a-z0-9_]{8}\.(partial|ready)")


@contextmanager
def written_together(folder: Path, stale: Iterable[str] = ()) -> Iterator[Path]:
    """Context manager for a hidden folder, whose files move to `folder` together if the `with` block succeeds.

    Files of the same names, and those named in `stale`, are removed. If the block fails, its files are removed.

    Raises
    ------
    OutputError : the folder cannot be made or written; the old files are unchanged.
    """
    made_folder(folder)
    settle(folder)
    lock = None
    hidden = folder
    try:
        with alone_in(folder):
            hidden = Path(tempfile.mkdtemp(dir=folder, prefix=PREFIX, suffix=".partial"))
            lock = locked(hidden)
        for name in (NEW, OLD):
            (hidden / name).mkdir()
        (hidden / STALE).write_text("\n".join(stale), encoding="utf-8")
    except OSError as err:
        raise unwritable(folder, err) from err
    try:
        yield hidden / NEW
        try:
            with alone_in(folder):
                _exchange(hidden, folder)
        except OSError as err:
            raise unwritable(folder, err) from err
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def settle(folder: Path) -> None:
    """Complete or remove what processes that died have left of files written together; errors are ignored."""
    try:
        left = [folder / name for name in os.listdir(folder) if _HIDDEN.fullmatch(name)]
    except OSError:
        return
    if not left:
        return
    with suppress(OSError), alone_in(folder):
        for hidden in left:
            if not is_abandoned(hidden):
                continue
            if hidden.suffix == ".ready":
                _move(hidden, folder)
            shutil.rmtree(hidden, ignore_errors=True)


def _exchange(hidden: Path, folder: Path) -> None:
    ready = hidden.with_suffix(".ready")
    names = os.listdir(hidden / NEW)
    for name in names:
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(folder / name))
    os.replace(hidden, ready)
    try:
        _move(ready, folder)
    except BaseException:
        with suppress(OSError):
            _move_back(ready, folder, names)
            os.replace(ready, hidden)
        raise
    shutil.rmtree(ready, ignore_errors=True)


def _move(ready: Path, folder: Path) -> None:
    """Move the former generation out and the new one in, or what is left to move of both."""
    names = sorted(os.listdir(ready / NEW))
    stale = (ready / STALE).read_text(encoding="utf-8").split("\n")
    for name in (*names, *filter(None, set(stale) - set(names))):
        if os.path.lexists(folder / name) and not os.path.lexists(ready / OLD / name):
            os.replace(folder / name, ready / OLD / name)
    for name in names:
        os.replace(ready / NEW / name, folder / name)


def _move_back(ready: Path, folder: Path, names: Iterable[str]) -> None:
    for name in names:
        if not os.path.lexists(ready / NEW / name):
            os.replace(folder / name, ready / NEW / name)
    for name in os.listdir(ready / OLD):
        os.replace(ready / OLD / name, folder / name)
