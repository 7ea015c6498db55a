"""Lifting design files of older schema versions to the present one, step by step.

Version 1 is the first, so no step exists yet; a step is a function from one version's plain data to
the next one's, registered under the version that it starts from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from design.errors import DesignError
from design.spec import SCHEMA_VERSION

Document = dict[str, Any]
Step = Callable[[Document], Document]
STEPS: Mapping[int, Step] = {}


def migrated(
    document: Document, *, steps: Mapping[int, Step] = STEPS, target: int = SCHEMA_VERSION
) -> Document:
    """Plain data of an older version, lifted to ``target``; data of that version is returned as it is.

    Raises
    ------
    DesignError : no version, a newer one, or one that no step starts from.
    """
    version = document.get("schema_version")
    if not isinstance(version, int) or isinstance(version, bool):
        raise DesignError(f"schema_version: {version!r} is no version; it is a whole number from 1")
    if version > target:
        raise DesignError(f"schema_version: {version} is newer than {target}; update optopad")
    while version < target:
        if version not in steps:
            raise DesignError(f"schema_version: there is no way from {version} to {version + 1}")
        document = steps[version](document) | {"schema_version": version + 1}
        version += 1
    return document
