# mypy: allow-untyped-calls
"""Compiled kernels on disk: one folder per version of the sources, outside the checkout and the installation.

Numba stores compiled code next to the sources, where a new clone does not find it. Here it is stored in the cache
folder (`optopad.sims.cache.kernel_folder`), in a subfolder named by a hash of the code. Any checkout with the same code
reads it, and changed code never uses an old cache. Numba itself checks its own version and the processor. If two
processes need the same kernel, one compiles it and the other waits.

Some parts of numba used here are not a public interface: `FunctionCache`, its locators, and the attribute ``_cache``.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

from optopad.design.files import folder_fault
from optopad.sims.cache import kernel_folder, source_fingerprint
from optopad.sims.compiling import is_there, tell_of

Function = TypeVar("Function", bound=Callable[..., object])
KEPT_FOLDERS = 24
"""Number of source versions whose kernels are kept. When another is added, the least recently compiled is removed."""


def entry_points(modules: Sequence[ModuleType], **options: Any) -> Callable[[Function], Function]:
    """Decorator that compiles an entry point together with all functions that it calls, and caches it on disk.

    Parameters
    ----------
    modules : modules of all functions that the entry point calls; last, the module that defines the entry point itself
    options : keyword arguments for `numba.njit`
    """
    room, _, own = modules[-1].__name__.rpartition(".")
    name = f"{room.rpartition('.')[2]}-{own}-{source_fingerprint(modules):016x}"

    def entry_point(function: Function) -> Function:
        dispatcher: Any = njit(**options)(function)
        dispatcher._cache = _KernelFiles(function, name)
        tell_of(function.__name__)
        return dispatcher  # type: ignore[no-any-return]

    return entry_point


@cache
def compile_beside(program: str, entry_point: Any) -> None:
    """Start a program in the background that compiles kernels, unless the entry point is already on disk.

    It starts at most once, and ends no later than this process.

    Parameters
    ----------
    program : name of the module to run; it must end when it is done or its standard input closes
    entry_point : one of the entry points that the program compiles
    """
    files = entry_point._cache
    folder = Path(files.cache_path)
    if (
        os.path.isfile(folder / f"{files._impl.filename_base}.nbi")
        or folder_fault(folder)  # another process could not pass its kernels on
    ):
        return
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", program],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    threading.Thread(target=_see_out, args=(process,), daemon=True).start()


def _see_out(process: subprocess.Popen[bytes]) -> None:
    with process:  # leaving closes its standard input
        process.wait()


class _KernelFiles(FunctionCache):
    """Numba's cache of one entry point, with a lock so that only one process compiles it."""

    def __init__(self, function: Any, name: str) -> None:
        class Implementation(CompileResultCacheImpl):
            _locator_classes: list[Any] = [_located(name)]  # noqa: RUF012 (as numba has it)

        self._impl_class = Implementation
        self._lock: int | None = None
        super().__init__(function)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the kernel from disk; None if it is missing. If another process is compiling it, wait for it."""
        try:
            found = super().load_overload(sig, target_context)
            if found is None and self._lock is None:
                self._take_lock()
                found = super().load_overload(sig, target_context)
        except OSError:
            found = None
        if found is not None:
            self._leave_lock()
            is_there(self._py_func.__name__)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled kernel. If the folder is not writable, the next process has to compile it again."""
        try:
            super().save_overload(sig, data)
        except OSError:
            self.disable()
        finally:
            self._leave_lock()

    def _take_lock(self) -> None:
        """Wait for the lock and take it. `_leave_lock` releases it, and so does the end of this process."""
        self._impl.locator.ensure_cache_path()
        file = Path(self.cache_path) / f"{self._impl.filename_base}.lock"
        self._lock = os.open(file, os.O_RDWR | os.O_CREAT)
        fcntl.flock(self._lock, fcntl.LOCK_EX)

    def _leave_lock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _located(name: str) -> type[Any]:
    """Locator class with which numba finds the folder of this name, where the kernels are cached."""

    class Locator(_CacheLocator):
        def get_cache_path(self) -> str:
            return str(kernel_folder() / name)

        def ensure_cache_path(self) -> None:
            folder = kernel_folder() / name
            if not any(folder.glob("*.nbi")):
                _make_room(folder.parent)
            folder.mkdir(parents=True, exist_ok=True)

        def get_source_stamp(self) -> str:
            return name

        def get_disambiguator(self) -> str:
            return "1"

        @classmethod
        def from_function(cls, _function: Any, _file: str) -> Any:
            return cls()

    return Locator


def _make_room(folder: Path) -> None:
    """Remove the folders of the least recently compiled sources, so that one more makes at most `KEPT_FOLDERS`."""
    if folder.is_dir():
        known = sorted(
            (path for path in folder.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime
        )
        for path in known[: 1 - KEPT_FOLDERS]:
            shutil.rmtree(path, ignore_errors=True)
