"""A number for the sources that results rest on: another number, other sources."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

SUFFIXES = {".py", ".toml", ".npz"}


def source_fingerprint(modules: Iterable[ModuleType]) -> int:
    """63-bit hash of the modules' source files, in their order."""
    return _hash_of_files(Path(str(module.__file__)) for module in modules)


def folder_fingerprint(*folders: Path) -> int:
    """63-bit hash of every source and data file in the folders and below them."""
    files = (path for folder in folders for path in sorted(folder.rglob("*")))
    return _hash_of_files(path for path in files if path.suffix in SUFFIXES)


def _hash_of_files(paths: Iterable[Path]) -> int:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return int.from_bytes(digest.digest()[:8], "big") >> 1
