"""A rule's finding about a design: field, message, limit and way out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from design.errors import readable

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An error, a warning or a note about a design.

    A design with an error cannot be built or simulated. A design with a warning can, but the user should know of it.
    A note states a limitation that all usual designs of the kind have, and its remedy.

    Attributes
    ----------
    severity : error, warning or note
    field : dotted path in the design that the finding is about
    value : the design's value, with its unit
    limit : the limit of the value, with its unit
    message : the fault, in one sentence
    way_out : the change that removes it
    """

    severity: Severity
    field: str
    value: str
    limit: str
    message: str
    way_out: str

    def __str__(self) -> str:
        return readable(f"{self.field}: {self.message} ({self.value}; needs {self.limit}); {self.way_out}")


def error(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """A finding that stops the design."""
    return Finding(
        severity="error",
        field=field,
        value=str(value),
        limit=str(limit),
        message=message,
        way_out=way_out,
    )


def warning(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """A finding that lets the design through."""
    return Finding(
        severity="warning",
        field=field,
        value=str(value),
        limit=str(limit),
        message=message,
        way_out=way_out,
    )


def note(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """A finding that is true of every usual design of its kind."""
    return replace(warning(field, message, value=value, limit=limit, way_out=way_out), severity="note")


def mm(length_mm: float) -> str:
    """A length as text, to the hundredth of a millimetre [mm]."""
    return f"{round(length_mm, 2) + 0.0:.2f} mm"  # adding 0 changes -0.00 to 0.00
