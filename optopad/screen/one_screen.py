"""A verdict on one screen: at most twelve lines of a hundred characters; the rest is behind ``--details``."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from textwrap import shorten, wrap
from typing import TYPE_CHECKING

from design.spec import SensorDesign
from optopad.screen.answer import answer_of
from optopad.screen.numbers import counted
from optopad.screen.trials import command_words, set_options

if TYPE_CHECKING:
    from design.fields.finding import Finding
    from sims.continuity.result import ContinuityScore

WIDTH, LINES = 100, 12
LABEL = 12
"""Columns of the label in front of a line."""
FIRST = ("full scale", "do not settle", "cannot light", "too much current", "stay tacky")
"""Words of warnings that come first: a pad that is built as it is would not work."""
FINDING_LINES = 4
"""Lines of a finding at most."""


def verdict_screen(
    design: SensorDesign,
    score: ContinuityScore,
    closing: Sequence[str],
    *,
    command: str = "",
    is_built: bool = False,
    learner: str = "",
) -> list[str]:
    """The verdict, why, how sure, the resolution, what a learner reaches, what to heed, and the next command.

    Parameters
    ----------
    closing : finished lines for the end, such as where the files are
    command : the design and its changes as given on the command line, for the next command; empty names none
    is_built : whether the bundle with mold and report is there
    learner : what `optopad.screen.learner_line` says, beside the bound of a pad where there is room; empty says nothing
    """
    said = answer_of(design, score)
    head = [
        *row("design", f"{score.name}  {score.digest[:8]}"),
        *row("verdict", said.verdict, 2 if score.causes or score.reason == "" else 4),
        *row("why" if score.causes else "weakest", said.why, 2),
        *row("sure", said.sure, 2),
        *row("resolution", said.worth, 2),
    ]
    onward = _next(score, command, said.fix, is_built=is_built) if command else ""
    foot = [*row("next", onward, 2), *closing]
    beside = row("learner", learner, 2) if said.worth and not score.is_facing_rows else []
    if len(head) + len(beside) + len(foot) < LINES:  # one is left for what to heed
        head += beside
    room = max(LINES - len(head) - len(foot), 1)
    return [*head, *_heeded(_to_heed(score), room), *foot]


def findings_screen(name: str, findings: Sequence[Finding], *, command: str) -> list[str]:
    """Findings of the rules, errors first and notes last, as many whole ones as there is room for; the next command.

    command : verb and design, as `score pad.toml`
    """
    errors = [one for one in findings if one.severity == "error"]
    notes = [one for one in findings if one.severity == "note"]
    warnings = [one for one in findings if one.severity == "warning"]
    ordered = [*errors, *warnings, *notes]
    total = f"{counted(len(errors), 'error')}, {counted(len(warnings), 'warning')}"
    foot = [] if errors else row("next", f"optopad {command}")
    room = LINES - len(foot) - 2
    lines: list[str] = []
    shown = 0
    for one in ordered:
        told = row(one.severity, str(one), FINDING_LINES)
        if lines and len(lines) + len(told) > room:
            break
        lines, shown = [*lines, *told], shown + 1
    if shown < len(ordered):
        lines += row("", f"and {len(ordered) - shown} more; all of them with --details")
    return [*row("design", f"{name}: {total}"), *lines, *foot]


def row(label: str, text: str, most: int = 1) -> list[str]:
    """A sentence behind its label, on as many lines as it may take; nothing for an empty one."""
    if not text:
        return []
    room = WIDTH - LABEL
    parts = wrap(text, room, break_long_words=False, break_on_hyphens=False)
    if len(parts) > most:
        last = " ".join(parts[most - 1 :])
        parts = [*parts[: most - 1], shorten(last, room, placeholder=" …")]
    return [f"{label if number == 0 else '':<{LABEL}}{part}" for number, part in enumerate(parts)]


def _to_heed(score: ContinuityScore) -> list[str]:
    """Warnings that no other line tells, the worst first, then the rest as they come.

    The trace's error is told where it leaves the verdict open; else it concerns the figures of single pairs alone.
    """
    told = ("rests on values not measured", "the verdict is open", "light trace: standard error")
    left = [text for text in score.warnings if not text.startswith(told)]
    return sorted(left, key=lambda text: not any(words in text for words in FIRST))


def _heeded(texts: Sequence[str], room: int) -> list[str]:
    """One line each; what has no room is counted."""
    shown = list(texts) if len(texts) <= room else list(texts[: max(room - 1, 0)])
    lines = [line for text in shown for line in row("heed", _clause(text))]
    left = len(texts) - len(shown)
    if left:
        lines += row("heed", f"{counted(left, 'more warning' if shown else 'warning')}; see --details")
    return lines


def _clause(text: str) -> str:
    """A warning, or as many whole clauses of it as a line holds."""
    room = WIDTH - LABEL
    if len(text) <= room:
        return text
    ends = [text.rfind(mark, 0, room - 2) for mark in (" (", "; ", ", ")]
    return f"{text[: max(ends)].rstrip(';,')} \N{HORIZONTAL ELLIPSIS}" if max(ends) > 0 else text


def _next(score: ContinuityScore, command: str, fix: str, *, is_built: bool) -> str:
    """The exact next command, and what it does."""
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return f"change what the reason names, then optopad check {command}"
    if score.trial is not None and score.trial.found == "move":
        return f"optopad score {command} {set_options(score.trial)}   ({command_words(score.trial)})"
    if fix:
        return f"optopad improve {command} --more-parts   ({fix})"
    if score.causes:
        return f"optopad improve {command}   (up to three changes that mend it, verified: minutes)"
    if score.tolerance is not None and score.tolerance.flipping and not is_built:
        return f"optopad improve {command}   (up to three changes that better it, verified: minutes)"
    if is_built:
        return "open the report, print cad/mold.stl, and follow fabrication/casting.md"
    return f"optopad run {command}   (mold, wiring, firmware, report: about a minute)"


def as_typed(design: str, changes: Sequence[str] | None) -> str:
    """A design and its changes as they were given, for a command to be typed."""
    return " ".join([shlex.quote(design), *(f"--set {shlex.quote(one)}" for one in changes or ())])
