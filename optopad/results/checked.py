"""What a check of a design found."""

from __future__ import annotations

from dataclasses import dataclass

from design.fields.finding import Finding
from design.spec import SensorDesign
from optopad.results.shown import block, table
from optopad.screen.numbers import counted


@dataclass(frozen=True, kw_only=True, repr=False)
class Checked:
    """Findings of the rules: errors stop a design, warnings are to be kept in mind.

    Attributes
    ----------
    design : what was checked
    findings : severity, field, value, limit, message and way out of each
    """

    design: SensorDesign
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """What stops the design."""
        return tuple(one for one in self.findings if one.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What lets it through."""
        return tuple(one for one in self.findings if one.severity == "warning")

    @property
    def ok(self) -> bool:
        """Whether nothing stops the design."""
        return not self.errors

    def __repr__(self) -> str:
        return "\n".join([self._title, *map(str, self.findings)])

    def _repr_html_(self) -> str:
        rows = [(one.severity, one.field, one.message, one.limit, one.way_out) for one in self.findings]
        head = ("", "field", "what is wrong", "limit", "way out")
        return block(self._title, (), table(head, rows) if rows else "")

    @property
    def _title(self) -> str:
        return f"{self.design.name}: {counted(len(self.errors), 'error')}, {counted(len(self.warnings), 'warning')}"
