"""The result of a check: findings of the design rules."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.fields.finding import Finding
from optopad.design.spec import SensorDesign
from optopad.screen.answer import counted
from optopad.screen.shown import block, table


@dataclass(frozen=True, kw_only=True, repr=False)
class Checked:
    """Findings of the design rules. A design with errors cannot be made or scored; warnings do not prevent it.

    Attributes
    ----------
    design : the design that was checked
    findings : the findings, each with severity, field, value, limit, message and fix
    """

    design: SensorDesign
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that prevent the design from being made or scored."""
        return tuple(one for one in self.findings if one.severity == "error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that do not prevent the design from being made or scored."""
        return tuple(one for one in self.findings if one.severity == "warning")

    @property
    def ok(self) -> bool:
        """Whether there are no errors."""
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
