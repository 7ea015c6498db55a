"""A rule's finding about a design: field, value, limit, message and remedy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from optopad.design.errors import readable

Severity = Literal["error", "warning", "note"]
OUT_OF_SCOPE, FAILS, USUAL = 3, 2, 1
"""Weights of a finding or warning: the models give no verdict; the pad or its figures fail; most."""
NO_VERDICT = ", so the verdict will be OUT_OF_MODEL_SCOPE"
"""End of the message of a finding that prevents a verdict."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An error, a warning or a note about a design.

    A design with an error cannot be manufactured or simulated. A warning names a problem that does not prevent this. A
    note states a limitation of all ordinary designs.

    Attributes
    ----------
    severity : error, warning or note
    field : dotted path of the field that the finding is about
    value : the design's value, with its unit
    limit : the limit of the value, with its unit
    message : description of the problem in one sentence
    way_out : change of the design that solves the problem
    weight : `OUT_OF_SCOPE`, `FAILS` or `USUAL`; screens show findings of larger weight first
    """

    severity: Severity
    field: str
    value: str
    limit: str
    message: str
    way_out: str
    weight: int = USUAL

    def __str__(self) -> str:
        return readable(f"{self.field}: {self.message} ({self.value}; needs {self.limit}); {self.way_out}")


def error(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """Make a finding of severity `error`, which prevents manufacture and simulation of the design."""
    return Finding(
        severity="error",
        field=field,
        value=str(value),
        limit=str(limit),
        message=message,
        way_out=way_out,
    )


def warning(
    field: str, message: str, *, value: object, limit: object, way_out: str, weight: int = USUAL
) -> Finding:
    """Make a finding of severity `warning`, which prevents neither manufacture nor simulation of the design."""
    return Finding(
        severity="warning",
        field=field,
        value=str(value),
        limit=str(limit),
        message=message,
        way_out=way_out,
        weight=weight,
    )


def outside_models(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """Make a warning that the models give no verdict on the design, which can nevertheless be manufactured."""
    return warning(
        field, message + NO_VERDICT, value=value, limit=limit, way_out=way_out, weight=OUT_OF_SCOPE
    )


def note(field: str, message: str, *, value: object, limit: object, way_out: str) -> Finding:
    """Make a finding of severity `note`, about a limitation of all ordinary designs."""
    return replace(warning(field, message, value=value, limit=limit, way_out=way_out), severity="note")


def mm(length_mm: float) -> str:
    """A length as text, rounded to 0.01 mm, with its unit."""
    return f"{round(length_mm, 2) + 0.0:.2f} mm"  # adding 0 changes -0.00 to 0.00
