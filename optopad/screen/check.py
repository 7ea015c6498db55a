"""The result of a check: findings of the design rules, and the frame rate. No model of light or contact is imported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.pin_rules import faster_boards
from optopad.design.fields.finding import OUT_OF_SCOPE, Finding
from optopad.design.spec import SensorDesign
from optopad.screen.answer import FINDING_LINES, LINES, block, counted, row, table


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


EIGHT_BIT_PRESCALER = 16
"""Prescaler with which an AVR's converter runs at 1 MHz from a clock of 16 MHz.

According to the data sheet, about 8 bits are then exact."""


def rate_words(design: SensorDesign) -> str:
    """Sentence on the board's possible frame rate, the required rate, and changes that raise the possible rate."""
    circuit = Circuit.of(design)
    use, ways = circuit.use, []
    if circuit.board.divides_clock and use.adc_prescaler > EIGHT_BIT_PRESCALER:
        faster = circuit.with_use(adc_prescaler=EIGHT_BIT_PRESCALER).frame_rate_hz
        ways.append(f"{faster:.0f} with board.adc_prescaler = {EIGHT_BIT_PRESCALER}, at about 8 bits")
    if boards := faster_boards(circuit):
        ways.append(f'{boards[0][1]:.0f} with board.kind = "{boards[0][0]}"')
    can = f"{circuit.frame_rate_hz:.0f} frames a second by the timing model, {use.frame_rate_hz:g} required"
    return "; ".join([can, *ways])


def findings_screen(
    name: str,
    findings: Sequence[Finding],
    *,
    command: str,
    rate: str = "",
    size: str = "",
    details: bool = False,
) -> list[str]:
    """Lines with findings of the design rules, errors first, as many as there is room for; then the next command.

    Parameters
    ----------
    name : name of the design
    command : command and design as typed, for example `score pad.toml`
    rate : sentence on the frame rate from `rate_words`; shown if there is no error
    size : line on size, parts and price from `summary_words`; shown if there is no error
    details : whether to show every finding at its full length
    """
    errors = [one for one in findings if one.severity == "error"]
    notes = [one for one in findings if one.severity == "note"]
    warnings = [one for one in findings if one.severity == "warning"]
    ordered = [*errors, *warnings, *notes]
    total = f"{counted(len(errors), 'error')}, {counted(len(warnings), 'warning')}"
    onward = f"optopad {command}"
    if any(one.weight == OUT_OF_SCOPE for one in warnings):
        onward = f"change what the first warning names, then {onward.replace(' score ', ' check ', 1)}"
    foot = [] if errors else [*row("size", size), *row("rate", rate, 2), *row("next", onward, 3)]
    room = LINES - len(foot) - 2
    lines: list[str] = []
    shown = 0
    for one in ordered:
        made = row(one.severity, str(one), len(str(one)) if details else FINDING_LINES)
        if lines and len(lines) + len(made) > room and not details:
            break
        lines, shown = [*lines, *made], shown + 1
    if shown < len(ordered):
        lines += row("", f"and {len(ordered) - shown} more; all of them with --details")
    return [*row("design", f"{name}: {total}"), *lines, *foot]
