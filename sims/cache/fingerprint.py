"""A number for the sources that results rest on: another number, other sources."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from types import ModuleType


def source_fingerprint(modules: Iterable[ModuleType]) -> int:
    """63-bit hash of the modules' source files, in their order."""
    digest = hashlib.sha256()
    for module in modules:
        with open(str(module.__file__), "rb") as source:
            digest.update(source.read())
    return int.from_bytes(digest.digest()[:8], "big") >> 1
