"""The base of every specification model, and the field types that several of them share."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
)

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

    unsaid: ClassVar[tuple[str, ...]] = ()
    """Fields that a dump leaves out at their default: content from before them keeps its digest."""

    @model_serializer(mode="wrap")
    def _as_said(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        document = plain(self)
        for name in self.unsaid:
            usual = type(self).model_fields[name].get_default(call_default_factory=True)
            if name in document and document[name] == usual:
                del document[name]
        return self._outlined(document)

    def _outlined(self, document: dict[str, Any]) -> dict[str, Any]:
        """What a dump becomes at last; a disc has a diameter in place of length and width."""
        return document
