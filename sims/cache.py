"""The cache folder, fingerprints of sources, and the store of traced light.

The cache folder keeps results between runs. It is the system's cache folder for optopad, or the one that
`OPTOPAD_CACHE` names. A fingerprint is a hash of the sources on which results depend.

The store is one SQLite file. Each table row holds the light of one emitter under one press and is named by a hash of
all its inputs. SQLite's locks separate processes, and its journal undoes the unfinished writes of a killed process.
Writes do not wait for the disk, so a power cut may damage the file. Each table row has a checksum over its name and
bytes: a row that fails it counts as missing, and a damaged file is removed and recreated. When the file is full, the
oldest quarter of its rows is dropped. If the store fails, light is traced again and no result is lost. Only an invalid
size raises an error.

For one press on a pad of 8 + 8 parts, tracing takes at least 60 ms, naming the rows 0.03 ms, reading them 0.1 ms and
writing them 0.05 ms (measured).

`OPTOPAD_LIGHT_CACHE_MB` sets the store's largest size; 0 turns it off. The folder may be deleted at any time.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
import sqlite3
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from optopad.design.errors import InputError

CACHE_VARIABLE = "OPTOPAD_CACHE"
"""Environment variable that names the cache folder."""


NO_HOME = Path(os.devnull) / "no home folder"
"""Stand-in for the cache folder of a user without a home folder: nothing can be stored there, so runs do not cache."""


def cache_folder() -> Path:
    """The folder that `OPTOPAD_CACHE` names, or else the system's cache folder for optopad. It may not exist yet."""
    from platformdirs import user_cache_path  # an installation of the driver alone lacks it

    if chosen := os.environ.get(CACHE_VARIABLE):
        return Path(os.path.expanduser(chosen))
    try:
        folder = user_cache_path("optopad")
    except RuntimeError:  # no home
        return NO_HOME
    return folder if folder.is_absolute() else NO_HOME


def kernel_folder() -> Path:
    """Folder of compiled kernels: `NUMBA_CACHE_DIR` if set, else ``kernels`` in the cache folder; may not exist yet."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return Path(chosen) if chosen else cache_folder() / "kernels"


SUFFIXES = {".py", ".toml", ".npz"}
WORDS = re.compile(rb'^\s*r?"""(?s:.*?)"""\s*$|^\s*#.*$', re.MULTILINE)
"""Pattern that matches docstrings, and comments on lines of their own."""


def source_fingerprint(modules: Iterable[ModuleType]) -> int:
    """63-bit hash of the modules' source files, in the given order, ignoring docstrings and comments."""
    return _hash_of_files(Path(str(module.__file__)) for module in modules)


def folder_fingerprint(*folders: Path) -> int:
    """63-bit hash of the given files, and of all source and data files in the given folders and their subfolders.

    Docstrings and comments of Python files are ignored.
    """
    files = (path for folder in folders for path in (folder, *sorted(folder.rglob("*"))) if path.is_file())
    return _hash_of_files(path for path in files if path.suffix in SUFFIXES)


def _hash_of_files(paths: Iterable[Path]) -> int:
    digest = hashlib.sha256()
    for path in paths:
        content = path.read_bytes()
        code = WORDS.sub(b"", content).split(b"\n") if path.suffix == ".py" else [content]
        digest.update(b"\n".join(line for line in code if line.strip()))
    return int.from_bytes(digest.digest()[:8], "big") >> 1


SIZE_VARIABLE = "OPTOPAD_LIGHT_CACHE_MB"
"""Environment variable that sets the largest size of the store [MB]; 0 turns the store off."""
DEFAULT_SIZE_MB = 500.0
"""Default size of the store [MB]: enough for 50,000 presses on a pad of 8 + 8 parts, with derivatives."""
PATIENCE_S = 10.0
"""Longest wait for another process to finish writing [s]."""
CHECKSUM_BYTES = 8
WRITTEN_EVERY_S = 1.0
"""Interval at which a trace writes its rows to the store [s]; a killed process loses at most one interval's rows."""
MOST_ROW_BYTES = 64_000_000
"""Largest table row that is read [bytes]; the light of one emitter under one press takes a few kB."""
ASKED_AT_ONCE = 500
"""Largest number of names in one query; SQLite allows at least 999."""
PASSING = (
    sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_PERM, sqlite3.SQLITE_AUTH, sqlite3.SQLITE_NOMEM,
)  # fmt: skip
"""SQLite errors that do not mean a damaged file, such as a file in use, missing permissions, or a full disk."""
_TABLE = "CREATE TABLE IF NOT EXISTS light (name BLOB PRIMARY KEY, content BLOB NOT NULL)"


class _DamagedFileError(Exception):
    """The file's page counts are impossible, so it is damaged."""


@dataclass(frozen=True)
class LightStore:
    """Traced light in one SQLite file, one table row for each emitter and press; see the module.

    Attributes
    ----------
    path : path of the file; it may not exist yet
    size_mb : size beyond which the oldest rows are dropped [MB]
    """

    path: Path
    size_mb: float

    def read(self, names: Sequence[bytes]) -> dict[bytes, bytes]:
        """Contents of the named rows, by name; missing and damaged rows are left out."""
        found: dict[bytes, bytes] = {}
        if not os.path.isfile(self.path):  # False where the folder may not be read
            return found
        with (
            self._going_on((*PASSING, sqlite3.SQLITE_ERROR)),
            self._opened() as file,
        ):  # the table may not exist yet
            for start in range(0, len(names), ASKED_AT_ONCE):
                asked = names[start : start + ASKED_AT_ONCE]
                names_of = f"name IN ({','.join('?' * len(asked))}) AND length(content) <= ?"
                question = f"SELECT name, content FROM light WHERE {names_of}"
                found.update(file.execute(question, [*asked, MOST_ROW_BYTES]))
        whole = ((name, _unsealed(name, content)) for name, content in found.items())
        return {name: content for name, content in whole if content is not None}

    def write(self, rows: Mapping[bytes, bytes]) -> None:
        """Store rows, given by name; existing rows of the same name are replaced."""
        with contextlib.suppress(OSError), self._going_on(PASSING):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self._opened() as file:
                file.execute(_TABLE)
                sealed = [(name, _sealed(name, content)) for name, content in rows.items()]
                file.executemany("INSERT OR REPLACE INTO light VALUES (?, ?)", sealed)
                if _used_mb(file) > self.size_mb:
                    _drop_oldest_quarter(file)

    def rows(self) -> int:
        """Number of stored rows; 0 if the file is missing or cannot be read."""
        count = 0
        if os.path.isfile(self.path):
            with contextlib.suppress(sqlite3.Error, UnicodeDecodeError), self._opened() as file:
                (count,) = file.execute("SELECT COUNT(*) FROM light").fetchone()
        return count

    @contextlib.contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        with contextlib.closing(sqlite3.connect(self.path, timeout=PATIENCE_S)) as file, file:
            file.execute("PRAGMA synchronous = OFF")
            yield file

    @contextlib.contextmanager
    def _going_on(self, passing: tuple[int, ...]) -> Iterator[None]:
        """`with` block that suppresses SQLite errors; removes the file unless the error may be temporary.

        passing : SQLite codes of errors that may be temporary
        """
        try:
            yield
        except (UnicodeDecodeError, _DamagedFileError):
            self._remove()
        except sqlite3.Error as err:
            code = err.sqlite_errorcode & 0xFF
            is_protected = code == sqlite3.SQLITE_READONLY and not os.access(self.path, os.W_OK)
            if code not in passing and not is_protected:
                self._remove()

    def _remove(self) -> None:
        for path in (self.path, self.path.with_name(self.path.name + "-journal")):
            with contextlib.suppress(OSError):
                path.unlink()


class GatheredLight:
    """Table rows of one trace: available at once, and written to the store every `WRITTEN_EVERY_S`. Thread-safe.

    Parameters
    ----------
    store : the store; None keeps the rows in memory only
    """

    def __init__(self, store: LightStore | None) -> None:
        self._store = store
        self._rows: dict[bytes, bytes] = {}
        self._asked: set[bytes] = set()
        self._unwritten: dict[bytes, bytes] = {}
        self._lock = threading.Lock()
        self._written_s = time.monotonic()

    def read(self, names: Sequence[bytes]) -> dict[bytes, bytes]:
        """Contents of the known rows, by name, from memory or the store. The store is queried once for each name."""
        new = [name for name in names if name not in self._asked]
        if new and self._store is not None:
            self._rows.update(self._store.read(new))
        self._asked.update(new)
        return {name: self._rows[name] for name in names if name in self._rows}

    def write(self, rows: Mapping[bytes, bytes]) -> None:
        """Add rows; they are written to the store when `WRITTEN_EVERY_S` has passed since the last write."""
        with self._lock:
            self._asked.update(rows)
            self._rows.update(rows)
            self._unwritten.update(rows)
            if time.monotonic() - self._written_s >= WRITTEN_EVERY_S:
                self._put_away()

    def put_away(self) -> None:
        """Write all rows to the store that are in memory only."""
        with self._lock:
            self._put_away()

    def _put_away(self) -> None:
        if self._store is not None and self._unwritten:
            self._store.write(self._unwritten)
        self._unwritten = {}
        self._written_s = time.monotonic()


def light_store() -> LightStore | None:
    """This user's store of traced light; None if it is turned off.

    Raises
    ------
    InputError : `OPTOPAD_LIGHT_CACHE_MB` is not a number, or is negative.
    """
    size_mb = _size_mb()
    return LightStore(store_file(), size_mb) if size_mb > 0 else None


def store_file() -> Path:
    """Path of the store's file."""
    return cache_folder() / "light" / "rows.sqlite"


def _size_mb() -> float:
    text = os.environ.get(SIZE_VARIABLE, "")
    try:
        size_mb = float(text) if text else DEFAULT_SIZE_MB
    except ValueError:
        size_mb = math.nan
    if not 0 <= size_mb < math.inf:
        raise InputError(
            f"{SIZE_VARIABLE}: {text!r} is refused: give megabytes, as {DEFAULT_SIZE_MB:g}, or 0 to keep no light"
        )
    return size_mb


def _checksum(name: bytes, content: bytes) -> bytes:
    return hashlib.blake2b(name + content, digest_size=CHECKSUM_BYTES).digest()


def _sealed(name: bytes, content: bytes) -> bytes:
    return _checksum(name, content) + content


def _unsealed(name: bytes, sealed: object) -> bytes | None:
    """A row's content without its checksum; None if the checksum does not match."""
    if not isinstance(sealed, bytes):
        return None
    content = sealed[CHECKSUM_BYTES:]
    return content if sealed[:CHECKSUM_BYTES] == _checksum(name, content) else None


def _used_mb(file: sqlite3.Connection) -> float:
    pages, free, size = (
        file.execute(f"PRAGMA {what}").fetchone()[0] for what in ("page_count", "freelist_count", "page_size")
    )
    if not 0 <= free < pages:
        raise _DamagedFileError
    return float((pages - free) * size / 1e6)


def _drop_oldest_quarter(file: sqlite3.Connection) -> None:
    """Delete the quarter of the rows with the lowest row numbers, which are the oldest. Freed pages are reused."""
    (count,) = file.execute("SELECT COUNT(*) FROM light").fetchone()
    file.execute(
        "DELETE FROM light WHERE rowid IN (SELECT rowid FROM light ORDER BY rowid LIMIT ?)", (-(-count // 4),)
    )
