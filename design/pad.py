"""A design that breaks no rule, and what is resolved from it."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.draft import Draft
from optopad.design.fields.finding import Finding
from optopad.design.once import once
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign


@dataclass(frozen=True)
class Pad(Draft):
    """A valid design.

    A function that takes a Pad needs no check of its own.

    Attributes
    ----------
    findings : warnings and notes of the rules
    """

    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, design: SensorDesign) -> Pad:
        """The pad of a design, whose rules are checked once; all that ask for it share it.

        Raises
        ------
        DesignError : the design has errors; the message lists all of them.
        """
        return _pad_of(design)


@once
def _pad_of(design: SensorDesign) -> Pad:
    pad = Pad(design, require_valid(design))
    vars(pad).update(vars(Draft.of(design)))  # what the rules resolved
    return pad
