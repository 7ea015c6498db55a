"""The base of every specification model, and the field types that several of them share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from design.whole_file import name_fault

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,62}$"
"""Of designs, protocols and searches, which name files and folders."""


def _usable(name: str) -> str:
    if fault := name_fault(name):
        raise ValueError(f"{fault}, and files are named after it")
    return name


FileName = Annotated[str, Field(pattern=NAME_PATTERN), AfterValidator(_usable)]
"""A name that becomes part of the names of files; device names of Windows are refused."""

IDENTIFIER_PATTERN = r"^[a-z0-9][a-z0-9-]{0,62}$"
PartId = Annotated[str, Field(pattern=IDENTIFIER_PATTERN)]
"""Identifier of a catalogue entry: lower-case letters, digits and dashes."""


class Model(BaseModel):
    """Frozen, refuses unknown keys, refuses NaN and infinity."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True, strict=False
    )


def without_defaults(document: dict[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Leave options out that have their default value: content from before them keeps its digest."""
    return {
        name: value for name, value in document.items() if name not in defaults or value != defaults[name]
    }
